// SPDX-License-Identifier: BSD-3-Clause
//
// The one exception of this project.
#pragma once

#include <stdexcept>

namespace ves {

/// Bad input: a file, an argument, a log, a bus. Its text is one line for a person, with
/// `file:line: key: what is wrong, what is allowed` where there is a file. Programs end with
/// status 2.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace ves
