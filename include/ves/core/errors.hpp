// SPDX-License-Identifier: BSD-3-Clause
//
// The exceptions of this project.
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

/// A motion that a check would stop, refused before it is run: nothing else is wrong with the input.
class WouldStop : public InputError {
 public:
  using InputError::InputError;
};

}  // namespace ves
