// SPDX-License-Identifier: BSD-3-Clause
//
// Learns the servos' gains and delay from where the legs go, while things run.
#pragma once

#include "ves/control/modelled_servos.hpp"

namespace ves {

/// What the believed gains and delay may be off by, how far from the belief what is learnt may go,
/// and how long what was seen counts.
struct AdaptationSettings {
  double gain = 0.0;        // [-] of a gain, one deviation
  double delay = 0.0;       // [s] one deviation
  double limit = 0.0;       // [-] deviations
  double forgetting = 0.0;  // [s] of motion, to 1/e
};

/// Weighted least squares per leg, by recursion. The believed model runs on the commands alone; no
/// reading ever corrects it, so what it misses a reading by is the parameters' doing: to first
/// order the sensitivities times what they are off by. The sensitivities run beside it.
///
///   minimise  sum of e^{-age/forgetting} (L - L_believed - s^T theta)^2 / R  +  |theta|^2,
///   R = 4 count^2 / 12 + (jitter v)^2,
///
/// with theta = (extend, retract, delay) in deviations of the belief: theta stays what it was
/// believed to be until readings say more. It keeps what it has while a leg shows nothing new, as
/// at rest. The believed model is stable and no feedback passes it, so theta cannot run away.
class ServoAdaptation {
 public:
  ServoAdaptation(const ServoModel& believed, const AdaptationSettings& settings, double period);

  /// At rest at L; what was learnt stays.
  void reset(const Vec6& L, std::int64_t time) noexcept;

  /// See ModelledServos.
  void send(const Vec6& reference, std::int64_t tick, std::int64_t time) noexcept {
    believed_.send(reference, tick, time);
  }
  void arrived(std::int64_t tick, std::int64_t time) noexcept { believed_.arrived(tick, time); }

  /// The transducers read L at `time`, later than the last.
  void learn(const Vec6& L, std::int64_t time) noexcept;

  const ServoGains& gains() const noexcept { return gains_; }

 private:
  using Channels = ModelledServos::Channels;

  /// What a leg does for a change of one gain by its own size.
  struct Sensitivity {
    Channels L = Channels::Zero(), v = Channels::Zero(), v_end = Channels::Zero();
    void pass(const ModelledServos::Passage& passage, const Channels& tau) noexcept;
  };
  void advance(std::int64_t time) noexcept;
  void update() noexcept;
  void learn(int leg, double missed, double decay) noexcept;

  AdaptationSettings settings_;
  ModelledServos believed_;
  Sensitivity extend_, retract_;
  std::array<Mat3, kLegs> information_{};  // [-] sum of s s^T / R
  std::array<Vec3, kLegs> evidence_{};     // [-] sum of s missed / R
  ServoGains gains_;
};

}  // namespace ves
