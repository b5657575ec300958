// SPDX-License-Identifier: BSD-3-Clause
#include "ves/pictures/gnuplot.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <fstream>

namespace ves {

std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("''") : std::string(1, c);
  return out + "'";
}

void gnuplot(const std::string& script, const std::filesystem::path& folder) {
  // From a file: from a pipe gnuplot reads byte by byte.
  const std::filesystem::path file = folder / ".gnuplot";
  std::ofstream(file) << fmt::format("cd {}\n{}", quoted(folder.string()), script);
  std::string quoted_file = "'";
  for (const char c : file.string()) quoted_file += c == '\'' ? "'\\''" : std::string(1, c);
  // Of what it says errors are worth a line, and its warnings of empty panels are not.
  const std::string command =
      "gnuplot " + quoted_file + "' 2>&1 >/dev/null | grep -v -e warning -e '^ *$' >&2";
  if (std::FILE* program = popen(command.c_str(), "w")) pclose(program);
  std::error_code none;
  std::filesystem::remove(file, none);
}

}  // namespace ves
