// SPDX-License-Identifier: BSD-3-Clause
//
// Files that a command is told to write. What is there already gives way only to its like: a log
// that is being read, or a file of something else, stays.
#pragma once

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <string>
#include <string_view>

#include "ves/core/errors.hpp"

namespace ves::app {

/// Throws InputError where a file is there that does not begin as what is to be written will.
inline void requireReplaceable(const char* option, const std::string& file,
                               std::string_view begins) {
  std::error_code none;
  if (!std::filesystem::is_regular_file(file, none)) return;
  std::string there(begins.size(), '\0');
  std::ifstream in(file, std::ios::binary);
  in.read(there.data(), static_cast<std::streamsize>(there.size()));
  there.resize(static_cast<std::size_t>(std::max<std::streamsize>(0, in.gcount())));
  if (there != begins.substr(0, there.size()))
    throw InputError(fmt::format(
        "{} {}: something else is there already, which is kept; want another name", option, file));
}

/// Throws InputError where one of the files is in the folder that --out named.
inline void requireWithout(const std::filesystem::path& folder, const std::string& out,
                           std::initializer_list<const char*> files) {
  for (const char* file : files)
    if (std::filesystem::exists(folder / file))
      throw InputError(
          fmt::format("--out {}: {} is there already, want another or --overwrite", out, file));
}

/// Throws InputError, naming the option, when it cannot be written, or something else is there.
inline void writeGiven(const char* option, const std::string& file, const std::string& text) {
  constexpr std::size_t kTelling = 4;  // bytes
  requireReplaceable(option, file, std::string_view(text).substr(0, kTelling));
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.close();
  if (!out) throw InputError(fmt::format("{} {}: {}", option, file, std::strerror(errno)));
}

}  // namespace ves::app
