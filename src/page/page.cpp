// SPDX-License-Identifier: BSD-3-Clause
#include "ves/page/page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <sstream>

#include "ves/core/build.hpp"
#include "ves/core/errors.hpp"
#include "ves/page/sources.hpp"

namespace ves {
namespace {

/// What the page is made of beside its own sources: of a wheel, or Debian's libjs-three and
/// libjs-dygraphs.
std::string library(const char* file) {
  std::error_code error;
  const auto own = installedData() / "javascript" / file;
  const bool there = std::filesystem::exists(own, error);
  const std::string path = there ? own.string() : fmt::format("/usr/share/javascript/{}", file);
  std::ifstream in(path);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in)
    throw InputError(
        fmt::format("{}: missing, want libjs-three and libjs-dygraphs installed", path));
  return text.str();
}

/// A script may not hold its own end.
std::string script(std::string text) {
  for (std::size_t at = 0; (at = text.find("</script", at)) != std::string::npos; at += 3)
    text.replace(at, 2, "<\\/");
  return "<script>\n" + text + "\n</script>\n";
}

std::string pageOf(const std::string& title, const std::string& recordings) {
  std::string own;
  for (const char* part : kPageScripts) own += part;
  return "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>" +
         title + "</title>\n<style>\n" + library("dygraphs/dygraph.min.css") + kPageStyle +
         "</style>\n</head>\n" + kPageBody + script(library("three/three.min.js")) +
         script(library("three/examples/js/controls/OrbitControls.js")) +
         script(library("dygraphs/dygraph.min.js")) +
         script("window.VES_RECORDINGS = " + recordings + ";") +
         script("(function () {\n'use strict';\n" + own + "})();") + "</html>\n";
}

std::string base64Of(const void* data, std::size_t size) {
  constexpr const char* kLetters =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const auto* bytes = static_cast<const std::uint8_t*>(data);
  std::string out;
  out.reserve((size + 2) / 3 * 4);
  for (std::size_t i = 0; i < size; i += 3) {
    const std::size_t n = std::min<std::size_t>(3, size - i);
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k) word = word << 8 | (k < n ? bytes[i + k] : 0u);
    for (std::size_t k = 0; k < 4; ++k) out += k <= n ? kLetters[word >> (18 - 6 * k) & 63u] : '=';
  }
  return out;
}

}  // namespace

std::string base64(const std::vector<float>& numbers) {
  return base64Of(numbers.data(), numbers.size() * sizeof(float));
}
std::string base64OfCounts(const std::vector<std::uint16_t>& numbers) {
  return base64Of(numbers.data(), numbers.size() * sizeof(std::uint16_t));
}

std::string page(const std::vector<nlohmann::ordered_json>& recordings) {
  const nlohmann::ordered_json all = recordings;
  return pageOf(recordings.front()["scene"]["name"].get<std::string>(), all.dump());
}

std::string livePage() { return pageOf("VES", "[]"); }

}  // namespace ves
