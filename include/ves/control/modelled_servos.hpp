// SPDX-License-Identifier: BSD-3-Clause
//
// The six servos of the controller's model, run on the commands it sent: counts, LegSlave updates
// and arrival times as on the machine.
#pragma once

#include <array>

#include "ves/contract/tick_state.hpp"
#include "ves/control/servo.hpp"

namespace ves {

/// All times are [ns] of the machine's clock.
class ModelledServos {
 public:
  /// [-] periods that a command may be on its way: so many are remembered.
  static constexpr int kMostDelay = 12;

  using Channels = Eigen::Array<double, kLegs, 1>;

  /// What passes in one length of time under a constant current.
  struct Passage {
    double dt = 0.0;  // [s]
    Channels decay;   // e^{-dt/tau}
  };

  /// `phase` [-] of an update is to pass until the first: the LegSlaves' initial phase is
  /// unknown, and it drifts through all values.
  ModelledServos(const ServoModel& servo, double period, double phase);

  /// At rest at L, where all commands so far have led.
  void reset(const Vec6& L, std::int64_t time) noexcept;

  /// Command `tick` leaves at `time`; it counts as arrived then until arrived() knows better.
  void send(const Vec6& reference, std::int64_t tick, std::int64_t time) noexcept;
  void arrived(std::int64_t tick, std::int64_t time) noexcept;

  void use(const ServoGains& gains) noexcept;
  /// The lengths are elsewhere by `change` [m].
  void move(const Vec6& change) noexcept { L_ += change; }

  /// On to `time`; after more than a few periods the model has come to rest, and the rest is left
  /// out. Tells each passage with the mean acceleration [m/s^2] in it, passed(Passage, Channels),
  /// and each updated().
  template <class Passed, class Updated>
  void advance(std::int64_t time, const Passed& passed, const Updated& updated) noexcept;
  void advance(std::int64_t time) noexcept {
    advance(
        time, [](const Passage&, const Channels&) {}, [] {});
  }

  const ServoModel& model() const noexcept { return servo_; }
  std::int64_t time() const noexcept { return now_; }   // [ns] where they are
  const Vec6& length() const noexcept { return L_; }    // [m]
  const Vec6& velocity() const noexcept { return v_; }  // [m/s]
  Vec6 acceleration() const noexcept {                  // [m/s^2]
    return (v_end_ - v_).cwiseQuotient(servo_.tau);
  }
  /// [m] E of the last update, as far as the rail lets it.
  const Vec6& difference() const noexcept { return E_; }
  double toUpdate() const noexcept { return to_update_; }  // [s] until the next one
  /// Mean of a LegSlave's two readings, each to the nearest count, of legs at L that move at v.
  Vec6 reading(const Vec6& L, const Vec6& v) const noexcept;
  Passage passage(double dt) const noexcept;

 private:
  struct Command {
    std::int64_t tick = -1, time = 0;  // [-], [ns] when it came
    Vec6 reference = Vec6::Zero();     // [m]
  };
  void useDelays() noexcept;
  const Command& effective(std::int64_t delay) const noexcept;
  Channels pass(const Passage& passage) noexcept;
  void update() noexcept;

  static constexpr std::size_t kCommands = kMostDelay + 4;

  ServoModel servo_;
  bool rubs_;  // friction is believed in
  SealFriction friction_;
  std::array<std::int64_t, kLegs> delay_;  // [ns] of it
  std::int64_t period_;                    // [ns] of the controller
  double first_update_;                    // [s] from a reset to the first
  double to_update_ = 0.0;                 // [s]
  Passage whole_;                          // of an update
  std::int64_t now_ = 0;                   // [ns]
  Vec6 L_ = Vec6::Zero(), v_ = Vec6::Zero(), v_end_ = Vec6::Zero(), E_ = Vec6::Zero();
  std::array<Command, kCommands> commands_{};  // a ring: the newest at the number so far, less one
  std::size_t sent_ = 0;
};

template <class Passed, class Updated>
void ModelledServos::advance(std::int64_t time, const Passed& passed,
                             const Updated& updated) noexcept {
  constexpr std::int64_t kMostPeriods = 10;  // [-]
  if (time <= now_) return;
  now_ = std::max(now_, time - kMostPeriods * period_);
  double left = static_cast<double>(time - now_) * kSecondPerNanosecond;
  bool first = true;
  while (to_update_ <= left) {
    if (to_update_ > 0.0) {
      const Passage part = first ? passage(to_update_) : whole_;
      passed(part, pass(part));
    }
    first = false;
    left -= to_update_;
    to_update_ = servo_.update;
    now_ = time - static_cast<std::int64_t>(left * 1e9 + 0.5);
    update();
    updated();
  }
  if (left > 0.0) {
    const Passage part = passage(left);
    passed(part, pass(part));
  }
  to_update_ -= left;
  now_ = time;
}

}  // namespace ves
