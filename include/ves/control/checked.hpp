// SPDX-License-Identifier: BSD-3-Clause
//
// What may be sent.
#pragma once

#include "ves/control/inverse_kinematics.hpp"
#include "ves/control/safety_checks.hpp"

namespace ves {

/// A proposal that went through all checks. Only a SafetyMonitor makes one, and only one of these
/// can be sent (LegCommander).
class Checked {
 public:
  const Proposal& proposal() const noexcept { return proposal_; }
  const Tripped& tripped() const noexcept { return tripped_; }
  /// No check fails that freezes.
  bool passes() const noexcept { return !tripped_.freeze(); }

 private:
  friend class SafetyMonitor;
  Checked(const Proposal& proposal, const Tripped& tripped) noexcept
      : proposal_(proposal), tripped_(tripped) {}

  Proposal proposal_;
  Tripped tripped_;
};

}  // namespace ves
