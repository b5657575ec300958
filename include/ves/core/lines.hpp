// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <sstream>
#include <string>

namespace ves {

/// Words in lines of at most `width`, those after the first begun with `indent` blanks.
inline std::string wrapped(const std::string& text, std::size_t width, std::size_t indent = 0) {
  std::string out, line, word;
  const auto end = [&] {
    out += (out.empty() ? "" : "\n" + std::string(indent, ' ')) + line;
    line.clear();
  };
  std::istringstream lines(text);
  for (std::string given; std::getline(lines, given); end()) {
    std::istringstream words(given);
    while (words >> word) {
      if (!line.empty() && line.size() + 1 + word.size() > width) end();
      line += (line.empty() ? "" : " ") + word;
    }
  }
  return out;
}

/// Lines of at most `width`: what is too long goes on below, `indent` blanks in, or as far in as
/// its line began. Nothing else changes.
inline std::string folded(const std::string& text, std::size_t width, std::size_t indent) {
  std::string out;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line); out += line + "\n") {
    const std::size_t begins = std::min(line.find_first_not_of(' '), line.size());
    const std::size_t in = begins == 2 ? indent : begins;
    for (std::size_t at; line.size() > width; line = std::string(in, ' ') + line.substr(at + 1)) {
      at = line.rfind(' ', width);
      if (at == std::string::npos || at <= in) break;
      out += line.substr(0, at) + "\n";
    }
  }
  return out;
}

}  // namespace ves
