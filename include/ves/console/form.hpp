// SPDX-License-Identifier: BSD-3-Clause
//
// The questions of a form: what a bare word of the menu leaves open, coordinate by coordinate, as
// Appendix C describes its menu.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "ves/config/experiment.hpp"

namespace ves {

/// A person at the other end.
struct Questioner {
  /// One line of input; nothing at its end.
  std::function<std::optional<std::string>(const std::string& prompt)> line;
  std::function<void(const std::string&)> say;
  /// The coordinate i as it is now, in the menu's unit.
  std::function<std::string(int)> now;
};

/// How a form ended: with a command line, or with nothing when the input ended. A `hold` or `stop`
/// typed into it is that command; `back` and Escape leave it, which is an empty command.
std::optional<std::string> fillForm(const std::string& word, const Experiment& experiment,
                                    const Questioner& person);

}  // namespace ves
