// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/modelled_servos.hpp"

#include <algorithm>
#include <cmath>

namespace ves {

ModelledServos::ModelledServos(const ServoModel& servo, double period, double phase)
    : servo_(servo),
      rubs_(!servo.friction.isZero(0.0)),
      period_(std::llround(period * 1e9)),
      first_update_(phase * servo.update),
      whole_(passage(servo.update)) {
  useDelays();
}

ModelledServos::Passage ModelledServos::passage(double dt) const noexcept {
  return {dt, (-dt / servo_.tau.array()).exp()};
}

void ModelledServos::reset(const Vec6& L, std::int64_t time) noexcept {
  L_ = L;
  v_.setZero();
  v_end_.setZero();
  E_.setZero();
  friction_.reset();
  now_ = time;
  to_update_ = first_update_;
  sent_ = 0;
  send(L, -1, time - period_);
}

void ModelledServos::send(const Vec6& reference, std::int64_t tick, std::int64_t time) noexcept {
  commands_[sent_++ % kCommands] = {tick, time, reference};
}

void ModelledServos::arrived(std::int64_t tick, std::int64_t time) noexcept {
  constexpr std::int64_t kMostPeriods = 5;  // [-] on the way; what says more is not about ours
  for (std::size_t i = 1; i <= std::min(sent_, kCommands); ++i) {
    Command& command = commands_[(sent_ - i) % kCommands];
    if (command.tick != tick) continue;
    if (std::abs(time - command.time) < kMostPeriods * period_) command.time = time;
    return;
  }
}

void ModelledServos::use(const ServoGains& gains) noexcept {
  servo_.extend = gains.extend;
  servo_.retract = gains.retract;
  servo_.delay = gains.delay;
  useDelays();
}

void ModelledServos::useDelays() noexcept {
  for (std::size_t i = 0; i < kLegs; ++i)
    delay_[i] = std::llround(servo_.delay(static_cast<Eigen::Index>(i)) * 1e9);
}

/// The newest command that has taken effect, of legs with this delay [ns].
const ModelledServos::Command& ModelledServos::effective(std::int64_t delay) const noexcept {
  const std::size_t known = std::min(sent_, kCommands);
  for (std::size_t i = 1; i < known; ++i) {
    const Command& command = commands_[(sent_ - i) % kCommands];
    if (command.time + delay <= now_) return command;
  }
  return commands_[(sent_ - known) % kCommands];
}

/// All LegSlaves compare.
void ModelledServos::update() noexcept {
  const Command* command = nullptr;
  for (std::size_t i = 0; i < kLegs; ++i) {
    if (i == 0 || delay_[i] != delay_[i - 1]) command = &effective(delay_[i]);
    const auto leg = static_cast<Eigen::Index>(i);
    E_(leg) = command->reference(leg);
  }
  E_ -= reading(L_, v_) + servo_.derivative * v_;
  if (rubs_) E_ -= friction_.turn(servo_, v_, servo_.update);
  E_ = E_.cwiseMin(servo_.rail).cwiseMax(-servo_.rail);
  v_end_ = speedsOf(servo_, E_);
}

/// Returns the mean acceleration.
ModelledServos::Channels ModelledServos::pass(const Passage& passage) noexcept {
  const Channels excess = v_.array() - v_end_.array();
  const Channels v = v_end_.array() + excess * passage.decay;
  L_.array() += v_end_.array() * passage.dt + excess * servo_.tau.array() * (1.0 - passage.decay);
  const Channels acceleration = (v - v_.array()) / passage.dt;
  v_ = v.matrix();
  return acceleration;
}

Vec6 ModelledServos::reading(const Vec6& L, const Vec6& v) const noexcept {
  constexpr double kWhole =
      6755399441055744.0;  // 1.5 * 2^52: adding it rounds to the nearest integer
  const auto offset = servo_.readings.offset.array(), scale = servo_.readings.scale.array();
  const Channels newer = (L.array() - offset) / scale + kWhole,
                 older = ((L - 2.0 * servo_.reading_age * v).array() - offset) / scale + kWhole;
  return offset + 0.5 * scale * ((newer - kWhole) + (older - kWhole));
}

}  // namespace ves
