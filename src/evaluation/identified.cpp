// SPDX-License-Identifier: BSD-3-Clause
#include "ves/evaluation/identified.hpp"

#include <algorithm>
#include <ctime>
#include <span>
#include <stdexcept>
#include <utility>

#include "ves/evaluation/static_intervals.hpp"
#include "ves/identification/scenario.hpp"
#include "ves/robot/mass_regressor.hpp"

namespace ves {
namespace {

struct MotionRecord {
  LegRecord legs;
  ShakeRecord shake;
};

/// The longest stretch under command without a gap.
MotionRecord longestMotion(const Series& series) {
  MotionRecord longest, record;
  std::int64_t last = -1;
  for (const Row& row : series.rows) {
    const auto sample = row.has_sample ? fromMessage(row.sample) : std::nullopt;
    const bool usable = row.state.engaged && sample;
    if (!usable || row.state.header.sequence != last + 1) record = {};
    last = row.state.header.sequence;
    if (!usable) continue;
    LegCounts sent{};
    std::copy_n(row.state.counts, kLegs, sent.begin());
    const ControllerConfig& c = series.experiment.controller;
    const Vec6 reference = legLengths(c.legs, sent);
    // When a command came the next sample tells.
    if (!record.legs.sent.empty() && sample->command_tick == record.shake.tick.back())
      record.legs.sent.back() = sample->command_time;
    record.legs.reference.push_back(reference);
    record.legs.sent.push_back(row.state.machine_time_ns);
    record.legs.length.push_back(legLengths(c.legs, sample->legs));
    record.legs.read.push_back(sample->legs_time);
    record.shake.tick.push_back(row.state.header.sequence);
    record.shake.time.push_back(row.state.machine_time_ns);
    record.shake.reference.push_back(reference);
    record.shake.sample.push_back(*sample);
    record.shake.bias.push_back(Vec6::Map(row.state.bias));
    if (record.legs.length.size() > longest.legs.length.size()) longest = record;
  }
  return longest;
}

}  // namespace

CalibrationRecord calibrationOf(const state_t& state, const std::string& setup,
                                double temperature) {
  CalibrationRecord out;
  out.date = std::time(nullptr);
  out.setup = setup;
  out.temperature = temperature;
  out.bias = Vec6::Map(state.bias);
  out.deviation = Vec6::Map(state.deviation);
  out.standard_error = Vec6::Map(state.standard_error);
  return out;
}

IdentifiedMasses identifiedMasses(const Series& series) {
  IdentifiedMasses out;
  out.rests = staticIntervals(series);
  if (out.rests.empty())
    throw std::domain_error("platform and robot never stand still for a second");
  const StaticSetup setup = staticSetup(series.experiment.controller);
  out.combinations = separableCombinations(setup.robot);
  out.estimate = estimateMasses(setup, out.combinations, out.rests);
  const Eigen::VectorXd full =
      completed(out.combinations, out.estimate.beta, massParameters(setup.robot));
  out.record.date = std::time(nullptr);
  out.record.kinematics = kinematicsOf(series.experiment.controller.payload);
  out.record.deviation = out.estimate.deviation;
  for (Eigen::Index i = 0; i < full.size(); i += 4)
    out.record.bodies.push_back({full(i), full.segment<3>(i + 1)});
  return out;
}

std::optional<MassRecord> learntMasses(const Series& series) {
  const ControllerConfig& c = series.experiment.controller;
  const MassRegressor regressor(c.payload.robot, c.hand);
  const std::span<const int> links = regressor.links();
  if (!c.compensation.learns_masses || series.rows.empty()) return {};
  const state_t& last = series.rows.back().state;
  if (!(last.learnt_mass[0] > 0.0)) return {};
  MassRecord out;
  out.date = std::time(nullptr);
  out.kinematics = kinematicsOf(c.payload);
  const RobotModel believed = carried(c.payload);  // with the plates in link 0
  for (int i = -1; i < believed.size; ++i) {
    const RigidBody& body = believed.bodyOf(i);
    out.bodies.push_back({body.mass, body.mass * body.p_BoBcm_B});
  }
  for (std::size_t k = 0; k < links.size(); ++k) {
    if (static_cast<int>(4 * k) == regressor.hand()) continue;
    const RigidBody& before = c.payload.robot.bodyOf(links[k]);
    MassRecord::Body& body = out.bodies[static_cast<std::size_t>(links[k] + 1)];
    body.mass += last.learnt_mass[k] - before.mass;
    body.moment += Vec3::Map(last.learnt_moment + 3 * k) - before.mass * before.p_BoBcm_B;
  }
  return out;
}

ServoEstimate identifiedLegs(const Series& series) {
  const ControllerConfig& c = series.experiment.controller;
  return identifyServo(c.servo, c.periodSeconds(), longestMotion(series).legs);
}

IdentifiedServo identifiedServo(const Series& series, const std::optional<ServoEstimate>& legs) {
  const ControllerConfig& c = series.experiment.controller;
  const MotionRecord record = longestMotion(series);
  IdentifiedServo out;
  out.legs = legs ? *legs : identifyServo(c.servo, c.periodSeconds(), record.legs);
  out.record = {std::time(nullptr), out.legs.servo, out.legs.deviation};
  try {
    ControllerConfig known = c;
    known.servo = out.legs.servo;
    out.sensor = identifySensor(known, record.shake);
    out.record.servo.sensor_delay = out.sensor->delay;
    out.record.servo.sensor_scale = out.sensor->scale;
    out.record.deviation.sensor_delay = out.sensor->delay_deviation;
    out.record.deviation.sensor_scale = out.sensor->scale_deviation;
  } catch (const std::domain_error& why) {
    out.why = why.what();
  }
  return out;
}

}  // namespace ves
