// SPDX-License-Identifier: BSD-3-Clause
#include "ves/results/gnuplot.hpp"

#include <fmt/format.h>

#include <cstdio>

namespace ves {

std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("''") : std::string(1, c);
  return out + "'";
}

void gnuplot(const std::string& script, const std::filesystem::path& folder) {
  std::FILE* program = popen("gnuplot", "w");
  if (!program) return;
  std::fputs(fmt::format("cd {}\n{}", quoted(folder.string()), script).c_str(), program);
  pclose(program);
}

}  // namespace ves
