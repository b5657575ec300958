// SPDX-License-Identifier: BSD-3-Clause
#include "ves/validation/iterative_compensation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace ves {
namespace {

using Wrenches = Eigen::Matrix<double, 6, Eigen::Dynamic>;  // [N, N m] about Po in {I}

class Passes {
 public:
  Passes(const Experiment& experiment, IterativeResult& result)
      : experiment_(experiment), result_(result) {
    std::int64_t duration = 0;
    const Interaction interaction = interactionOf(experiment, duration);
    q0_ = interaction.q0;
    actions_ = interaction.actions;
    columns_ = duration / experiment.controller.period + 1;
    for (const Segment& segment : experiment.controller.program.segments) {
      if (segment.kind == SegmentKind::kAdmittance) break;
      if (segment.kind == SegmentKind::kMove) start_ = segment.target.stacked();
    }
  }
  /// Where the segment begins, all along.
  RecordedPath start() const { return start_.replicate(1, columns_); }

  /// What the sensor feels along the path, a column for each of its own; `slower` times slower, the
  /// mean of as many ticks. False when a check stopped it.
  bool feel(const RecordedPath& path, int slower, Wrenches& felt) {
    Experiment e = experiment_;
    e.plant.task.initial_joints = q0_;
    e.plant.task.robot_events.clear();
    constexpr int kMove = 0, kSettle = 1, kPath = 2;
    for (const TimedAction& one : actions_)
      e.plant.task.robot_events.push_back(
          {{kPath, one.start * slower}, ves::slower(one.action, slower)});
    Program& program = e.controller.program;
    program = {};
    program.size = 3;
    program.segments[kMove].kind = SegmentKind::kMove;
    program.segments[kMove].target = Pose::from(path.col(0));
    program.segments[kSettle].duration = 1.0;
    program.segments[kPath].kind = SegmentKind::kPath;
    e.controller.path = stretched(path, slower);
    const std::int64_t period = e.controller.period;
    program.segments[kPath].duration =
        static_cast<double>((e.controller.path.cols() - 1) * period) * kSecondPerNanosecond;

    felt = Wrenches::Zero(6, path.cols());
    Eigen::VectorXd readings = Eigen::VectorXd::Zero(path.cols());
    std::int64_t n = 0;
    const RunResult run = runLockstep(e, nullptr, [&](const TickState& state) {
      if (state.phase == Phase::kRunning && state.segment == kPath) {
        ++n;
        const Eigen::Index nearest = std::min((n + slower / 2) / slower, path.cols() - 1);
        felt.col(nearest) += state.total.stacked();
        readings(nearest) += 1.0;
      }
      return Order();
    });
    felt.array().rowwise() /= readings.cwiseMax(1.0).transpose().array();
    result_.machine_time += run.simulated;
    if (run.cause != Check::kCount) result_.stopped_by = run.cause;
    return run.good();
  }

 private:
  static RecordedPath stretched(const RecordedPath& path, int slower) {
    RecordedPath out(6, (path.cols() - 1) * slower + 1);
    for (Eigen::Index i = 0; i < out.cols(); ++i) {
      const Eigen::Index at = i / slower;
      const double share = static_cast<double>(i % slower) / slower;
      const auto next = path.col(std::min(at + 1, path.cols() - 1));
      out.col(i) = (1.0 - share) * path.col(at) + share * next;
    }
    return out;
  }

  const Experiment& experiment_;
  IterativeResult& result_;
  JointVector q0_;
  std::vector<TimedAction> actions_;
  Eigen::Index columns_ = 0;
  Vec6 start_ = Vec6::Zero();
};

}  // namespace

IterativeResult compensateIteratively(const Experiment& experiment, const IterativeOptions& options,
                                      const std::function<void(const IterativeChange&)>& shown) {
  IterativeResult out;
  Passes passes(experiment, out);
  constexpr Eigen::Index kMostRows = 25'000;
  const RecordedPath start = passes.start();
  if (start.cols() > kMostRows)
    throw InputError(fmt::format("{}: its admittance segment takes {} periods, want at most {}",
                                 experiment.name, start.cols(), kMostRows));
  const double period = static_cast<double>(experiment.controller.period) * kSecondPerNanosecond;
  out.path = start;
  for (int i = 0; i < options.most; ++i) {
    Wrenches weight, felt;
    if (!passes.feel(out.path, options.slower, weight) || !passes.feel(out.path, 1, felt))
      return out;
    AdmittanceModel model(experiment.controller.vehicle, period);
    model.reset(out.path.col(0));
    RecordedPath answer = out.path;
    for (Eigen::Index n = 1; n < answer.cols(); ++n) {
      model.step(Wrench::from(felt.col(n) - weight.col(n)));
      answer.col(n) = model.motion().x;
    }
    const RecordedPath off = answer - out.path;
    const IterativeChange change{off.topRows<3>().colwise().norm().maxCoeff(),
                                 off.bottomRows<3>().colwise().norm().maxCoeff()};
    out.changes.push_back(change);
    if (shown) shown(change);
    if (change.translation <= options.translation && change.rotation <= options.rotation) {
      out.converged = true;
      return out;
    }
    out.path += options.weight * off;
  }
  return out;
}

}  // namespace ves
