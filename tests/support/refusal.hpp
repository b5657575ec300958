// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>

#include "ves/core/errors.hpp"

namespace ves::test {

/// The line with which `read` refuses its input; empty when it does not.
inline std::string refusal(const std::function<void()>& read) {
  try {
    read();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

}  // namespace ves::test
