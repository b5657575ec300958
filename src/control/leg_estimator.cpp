// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/leg_estimator.hpp"

#include <algorithm>

namespace ves {

LegEstimator::LegEstimator(const ControllerConfig& config)
    : geometry_(config.geometry),
      codec_(config.legs),
      period_(config.periodSeconds()),
      reading_jump_(config.safety.reading_jump),
      observes_(config.compensation.observer),
      servo_(config.servo, period_) {
  measured_.X_IP = geometry_.fromHome({});
}

const Measured& LegEstimator::update(const SampleStream& samples, const Elapsed& elapsed,
                                     bool following, const LegCommander& sent) noexcept {
  speed_.step(sent.legs().L_dot, period_);
  if (!following) readings_.reset();
  if (samples.fresh() || !following) {
    const auto waited = static_cast<double>(samples.ageBefore() + elapsed.between + 1) * period_;
    measured_.L = readings_.take(legLengths(codec_, samples.sample().legs), speed_.speed(), waited,
                                 reading_jump_);
  }
  if (!following)
    servo_.reset(measured_.L);
  else if (observes_)
    observe(elapsed, samples.fresh(), sent.command().counts);

  const ForwardSolution forward = forwardPose(geometry_, measured_.L, measured_.X_IP);
  measured_.solved = forward.ok();
  if (measured_.solved) measured_.X_IP = forward.X_IP;
  measured_.pose = geometry_.toHome(measured_.X_IP);
  return measured_;
}

/// The servo model, brought to this tick.
void LegEstimator::observe(const Elapsed& elapsed, bool fresh, const LegCounts& sent) noexcept {
  constexpr std::int64_t kMost = 10;  // [-] periods; after more it has come to rest
  const Vec6 reference = legLengths(codec_, sent);
  for (std::int64_t i = 0; i < std::min(1 + elapsed.missed, kMost); ++i) servo_.advance(reference);
  if (fresh) servo_.correct(measured_.L);
}

}  // namespace ves
