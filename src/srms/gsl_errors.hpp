// SPDX-License-Identifier: BSD-3-Clause
//
// GSL's way to fail.
#pragma once

#include <gsl/gsl_errno.h>

namespace ves {

/// From now on GSL returns its errors instead of aborting; for all threads.
inline void returnGslErrors() {
  static gsl_error_handler_t* const before = gsl_set_error_handler_off();
  static_cast<void>(before);
}

}  // namespace ves
