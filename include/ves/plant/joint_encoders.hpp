// SPDX-License-Identifier: BSD-3-Clause
//
// The robot's joint sensors.
#pragma once

#include <cstdint>

#include "ves/plant/noise.hpp"
#include "ves/robot/robot_model.hpp"

namespace ves::plant {

/// By joint, [rad | m]; without any the angles are exact.
struct JointEncoderModel {
  JointVector count = JointVector::Zero();  // to which a reading is rounded
  JointVector play = JointVector::Zero();   // of the gear between joint and encoder
  JointVector noise = JointVector::Zero();  // rms, before it is rounded
  std::int64_t interval = 0;                // [ns] between two readings; 0: read when asked

  bool exact() const noexcept { return count.isZero(0.0) && play.isZero(0.0) && noise.isZero(0.0); }
};

class JointEncoders {
 public:
  /// Joints at q, in the middle of their play.
  JointEncoders(const JointEncoderModel& model, Noise noise, const JointVector& q)
      : model_(model), noise_(std::move(noise)), turned_(q) {}

  /// [rad | m] of joints at q. The encoder follows only where the joint has taken up the play.
  JointVector read(const JointVector& q) noexcept;

 private:
  JointEncoderModel model_;
  Noise noise_;
  JointVector turned_;  // [rad | m] the encoders' shafts
};

}  // namespace ves::plant
