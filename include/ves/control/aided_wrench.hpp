// SPDX-License-Identifier: BSD-3-Clause
//
// The wrench without the sensor's noise: what the robot's joints do is computed from their angles,
// and of what the sensor shows beyond that, masses and bias are learnt, and forces pass. Beyond the
// report.
#pragma once

#include "ves/control/hindsight.hpp"
#include "ves/control/mass_belief.hpp"
#include "ves/control/moving_frame.hpp"
#include "ves/control/residual_gate.hpp"

namespace ves {

/// The admittance model's input: the measured wrench, or the modelled one while they differ by no
/// more than noise and what is not known of the masses explain.
///
/// Masses and bias are learnt from the means of what is left (MassBelief), from the calibration on:
/// that is one measurement of bias and weight together. What means of 1 to 200 samples show beyond
/// it is a force: it passes, the base is given what was withheld of it, and what was learnt from it
/// is forgotten. One that only long means show is small and lasts: its mean since it was found
/// passes, without the noise, until another mean shows that it has changed. The sensor's noise is
/// what its last calibration found; without one everything passes.
///
/// Where the gripper has closed or opened, for half a second what a body in the hand may explain is
/// taken for its weight, also what passed in the half second before.
class AidedWrench {
 public:
  explicit AidedWrench(const ControllerConfig& config);

  struct Input {
    const Wrench& measured;     // F_Po_I that the sensor shows beyond weight and inertia
    const Wrench& weight;       // F_Po_I
    const RobotModel& carried;  // whose joints' momentum counts
    const RobotInertia& robot;
    const JointMomentum& joints;
    const SampleStream& samples;
    const SensorBias& bias;
    const Transform& X_IP;
    const Emulated& emulated;
    double share;  // [-] of the compensation
    bool gripper;  // has closed or opened: what is in the hand is not known any more
  };
  /// F_Po_I that the admittance model is to feel; before the legs are `engaged`, the measured one.
  Wrench update(const Input& in, bool engaged) noexcept;

  /// Of the newest sample; zero unless the wrench is aided.
  const Wrench& reaction() const noexcept { return reaction_; }  // F_Po_I, modelled
  bool withholds() const noexcept { return withholds_; }         // the residual, or its noise
  const ResidualNoise& noise() const noexcept { return noise_.now(); }
  const MassBelief& belief() const noexcept { return belief_; }
  /// What the model has, and how well it is known.
  BodyMasses masses() const noexcept { return regressor_.described(used_, belief_.covariance()); }
  bool learnsMasses() const noexcept { return begun_ && prior_.size() > 0; }
  /// Of this tick.
  const Lesson& lesson() const noexcept { return lesson_; }
  /// The robot to reckon with from the next tick on, where this one taught another.
  bool taught() const noexcept { return taught_; }
  RobotModel robot() const noexcept { return regressor_.changed(used_); }

 private:
  /// A force that lasts, as far as it is known by now.
  struct Lasting {
    Vec6 mean = Vec6::Zero();   // [count] that passes
    Vec6 found = Vec6::Zero();  // [count] the mean that showed it,
    int samples = 0;            // [-] of so many; 0: there is none
  };
  /// Sums of means over groups of samples: residuals [count], beyond the first belief, and what
  /// each parameter adds to them.
  struct Sum {
    MassColumns columns;
    Vec6 y = Vec6::Zero();
    double time = 0.0;  // [s]
  };
  /// What is left of the last samples.
  struct Window {
    int samples;
    Vec6 mean;     // [count]
    Vec6 unknown;  // [count^2] its variance for want of knowledge
  };
  static constexpr std::size_t kGroupsOfBlock = 4;                          // what is learnt from
  static constexpr std::size_t kBlocks = Lesson::kGroups / kGroupsOfBlock;  // at most

  void calibrate(const Input& in) noexcept;
  void take(const Input& in, const Mat6& counts_per_wrench, const Wrench& residual) noexcept;
  void endGroup(const Mat6& counts_per_wrench) noexcept;
  Window window(std::size_t groups, const MassBelief& before) const noexcept;
  bool isForce(std::size_t mean, const MassBelief& before) noexcept;
  void open(const MassBelief& before, int samples) noexcept;
  void refineLasting() noexcept;
  Wrench lasting(const Mat3& R_IP) const noexcept;  // F_Po_I
  void restart() noexcept;
  void doubtHand(const Mat6& counts_per_wrench) noexcept;
  void use() noexcept;
  void refreshNoise(const Input& in) noexcept;

  bool aided_;
  int hold_;  // [-] samples
  Vec3 gravity_;
  SensorCounts counts_;
  Transform X_PL0_;
  MassRegressor regressor_;
  double common_;          // [-] deviation of all bodies' density,
  MassVector prior_;       // [-, m] and of each parameter besides
  MassVector most_;        // [-, m, kg, kg m] that a parameter may be
  Eigen::Vector4d hand_;   // [kg, kg m] deviations of what is in the hand, where that is not known
  double bias_deviation_;  // [count] before a calibration
  ResidualGate gate_;
  NoiseOfResidual noise_;
  Butterworth2<6> twist_;       // of the platform, as the wrench shows it
  bool settled_ = false;        // twist_
  int doubted_;                 // [-] samples for which the hand's load is doubted
  std::int64_t residuals_ = 0;  // [-] so far

  MassBelief belief_;
  MassVector used_;                      // the parameters that the model has
  Vec6 bias_ = Vec6::Zero();             // [count] that belief_ counts its bias from
  bool begun_ = false, taking_ = false;  // a calibration
  bool taring_ = false;                  // a tare is under way
  Vec6 before_tare_ = Vec6::Zero();      // [count] the bias as it began
  bool hand_moved_ = false;              // and that has not been looked at
  bool taught_ = false;

  MassColumns weight_;    // of the newest sample, about Po in I
  MassColumns momentum_;  // of the robot in the laboratory, as Lesson::momentum
  MassColumns momentum_before_, weight_before_;  // as the group began
  Vec6 residual_sum_ = Vec6::Zero();
  double group_time_ = 0.0;      // [s]
  int in_group_ = 0;             // [-] samples; -1: nothing is known of the time before it
  Vec6 unknown_ = Vec6::Zero();  // [count^2] of a group
  std::array<Sum, Lesson::kGroups + 1> sums_{};  // a ring, the newest at groups_
  std::size_t groups_ = 0;
  std::array<MassBelief, kBlocks> beliefs_{};  // before each block, a ring
  int open_ = 0;                               // [-] samples to come
  Lasting lasting_;
  int doubts_ = 0;                // [-] samples in which the hand's load may change
  int passing_ = 0, closed_ = 0;  // [-] ticks since residuals passed first of late,
                                  // and since they passed last

  Lesson lesson_;
  Wrench reaction_;
  bool withholds_ = false;
};

}  // namespace ves
