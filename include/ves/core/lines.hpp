// SPDX-License-Identifier: BSD-3-Clause
#pragma once

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

}  // namespace ves
