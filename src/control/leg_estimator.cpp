// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/leg_estimator.hpp"

#include <algorithm>

namespace ves {

LegEstimator::LegEstimator(const ControllerConfig& config)
    : geometry_(config.geometry),
      codec_(config.legs),
      period_(config.periodSeconds()),
      limits_(config.safety),
      feels_(config.compensation.inertia),
      adapts_(config.compensation.adaptation),
      servo_(config.servo, period_, feels_),
      adaptation_(config.servo,
                  {config.compensation.gain_error, config.compensation.timing_error,
                   config.compensation.adaptation_limit, config.compensation.forgetting},
                  period_) {
  measured_.X_IP = geometry_.fromHome({});
}

const Measured& LegEstimator::update(const SampleStream& samples, const Elapsed& elapsed,
                                     bool following, const LegCommander& sent) noexcept {
  speed_.step(sent.legs().L_dot, period_, limits_.speed_memory);
  if (!following) readings_.reset();
  if (samples.fresh() || !following) {
    const auto waited = static_cast<double>(samples.ageBefore() + elapsed.between + 1) * period_;
    measured_.L =
        readings_.take(limits_, legLengths(codec_, samples.sample().legs), speed_.speed(), waited);
  }
  const Sample& sample = samples.sample();
  if (!following) {
    servo_.reset(measured_.L, sample.time);
    adaptation_.reset(measured_.L, sample.time);
  } else if (samples.fresh()) {
    servo_.arrived(sample.command_tick, sample.command_time);
    servo_.advance(std::max(sample.legs_time, sample.wrench_time));
    servo_.correct(measured_.L, sample.legs_time);
    if (adapts_) adapt(sample);
  }
  if (feels_)
    felt_ = {measured_.L, servo_.velocity(), servo_.filteredAcceleration(sample.wrench_time)};

  const ForwardSolution forward = forwardPose(geometry_, measured_.L, measured_.X_IP);
  measured_.solved = forward.ok();
  if (measured_.solved) measured_.X_IP = forward.X_IP;
  measured_.pose = geometry_.toHome(measured_.X_IP);
  return measured_;
}

void LegEstimator::adapt(const Sample& sample) noexcept {
  adaptation_.arrived(sample.command_tick, sample.command_time);
  adaptation_.learn(measured_.L, sample.legs_time);
  servo_.use(adaptation_.gains());
}

void LegEstimator::sent(const LegCounts& counts, std::int64_t tick, std::int64_t time) noexcept {
  const Vec6 reference = legLengths(codec_, counts);
  servo_.send(reference, tick, time);
  adaptation_.send(reference, tick, time);
}

}  // namespace ves
