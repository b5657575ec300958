// SPDX-License-Identifier: BSD-3-Clause
#include "ves/evaluation/comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "ves/core/coordinates.hpp"
#include "ves/math/dense.hpp"
#include "ves/srms/modes.hpp"

namespace ves {

std::optional<Vec6> Motion::point(std::int64_t after) const {
  if (after < 0 || after >= std::ssize(x)) return {};
  return x[static_cast<std::size_t>(after)];
}

bool inAdmittance(const state_t& state) noexcept {
  return state.phase == static_cast<int>(Phase::kRunning) &&
         state.kind == static_cast<int>(SegmentKind::kAdmittance);
}

void eachTick(const Series& series, const std::function<void(const Row&, double)>& take) {
  const double* start = nullptr;
  int segment = -1;
  for (const Row& row : series.rows) {
    if (!inAdmittance(row.state)) continue;
    if (!start) {
      start = &row.t;
      segment = row.state.segment;
    }
    if (row.state.segment == segment) take(row, row.t - *start);
  }
}

Motion commanded(const Series& series) {
  const double period =
      static_cast<double>(series.experiment.controller.period) * kSecondPerNanosecond;
  Motion out;
  eachTick(series, [&](const Row& row, double t) {
    if (out.t.empty()) {  // where it starts from, at rest
      out.t.push_back(0.0);
      out.x.push_back(Vec6::Map(row.state.x_desired));
      out.x_dot.push_back(Vec6::Zero());
    }
    out.t.push_back(t + period);
    out.x.push_back(Vec6::Map(row.state.x));
    out.x_dot.push_back(Vec6::Map(row.state.x_dot));
  });
  return out;
}

Motion actual(const Series& series) {
  Motion out;
  std::optional<double> start;  // [ns] by the machine's clock, as the truth's time
  eachTick(series, [&](const Row& row, double) {
    if (!start) start = static_cast<double>(row.state.machine_time_ns);
    if (!row.hasTruePose()) return;
    out.t.push_back((static_cast<double>(row.truth.header.time_ns) - *start) *
                    kSecondPerNanosecond);
    out.x.push_back(Vec6::Map(row.truth.x));
  });
  return out;
}

namespace {

/// What of a pose no mode can express: it stays.
Vec6 restOf(const ModalModel& base, const Vec6& x) {
  return x - base.Phi * leastSquares(base.Phi, x);
}

}  // namespace

Amplitude amplitude(const Experiment& experiment, const Motion& base) {
  if (base.x.empty()) return {};
  const Vec6 rest = restOf(linearised(experiment.controller.vehicle), base.x.front());
  Amplitude out;
  for (const Vec6& x : base.x) {
    out.position = std::max(out.position, (x - rest).head<3>().norm());
    out.attitude = std::max(out.attitude, (x - rest).tail<3>().norm());
  }
  return out;
}

std::vector<Column> columnsOf(const Series& series, const Emulation& emulation) {
  const auto poses = std::make_shared<const BasePoses>(basePoses(series, emulation.base));
  std::vector<Column> out;
  for (int i = 0; i < 6; ++i)
    out.push_back({fmt::format("{}_base_{}", coordinate(i).name, coordinate(i).unit),
                   [poses, i](const Row& row) {
                     const auto x = at(*poses, row.state);
                     return x ? (*x)(i) : NAN;
                   },
                   "of the base in free space, let go where the platform was",
                   {}});
  return out;
}

std::optional<Vec6> at(const BasePoses& poses, const state_t& state) {
  const auto found = poses.find(state.header.sequence);
  return found == poses.end() ? std::nullopt : std::optional(found->second);
}

BasePoses basePoses(const Series& series, const Motion& base) {
  BasePoses out;
  std::optional<std::int64_t> first;
  eachTick(series, [&](const Row& row, double) {
    const std::int64_t tick = row.state.header.sequence;
    if (!first) first = tick;
    if (const auto x = base.point(tick - *first)) out[tick] = *x;  // late ticks are missing
  });
  return out;
}

Motion motion(const std::vector<InteractionPoint>& points) {
  Motion out;
  for (const InteractionPoint& p : points) {
    out.t.push_back(p.t);
    out.x.push_back(p.x);
    out.x_dot.push_back(p.x_dot);
    out.on_tool.push_back(p.touch.on_tool_To_I.f.norm());
    out.target.push_back(p.target);
    const auto begun = static_cast<std::size_t>(p.contacts.count());
    if (begun == 0) continue;
    out.contacts.resize(begun);  // of those that began between two points the last is known
    out.contacts.back() = p.contacts.last();
  }
  return out;
}

namespace {

/// x at time t: by a line between two points, by cubic Hermite polynomials where rates are known.
std::optional<Vec6> at(const Motion& motion, double t) {
  constexpr double kSame = 1e-9;  // [s]
  const auto after = std::lower_bound(motion.t.begin(), motion.t.end(), t - kSame);
  if (after == motion.t.end()) return {};
  const auto i = static_cast<std::size_t>(after - motion.t.begin());
  if (*after - t <= kSame) return motion.x[i];
  if (i == 0) return {};
  const double h = *after - motion.t[i - 1], s = (t - motion.t[i - 1]) / h;
  const Vec6 line = (1.0 - s) * motion.x[i - 1] + s * motion.x[i];
  if (motion.x_dot.empty()) return line;
  const Vec6 rise = motion.x[i] - motion.x[i - 1];
  return line +
         s * (1.0 - s) *
             ((1.0 - s) * (h * motion.x_dot[i - 1] - rise) - s * (h * motion.x_dot[i] - rise));
}

}  // namespace

Distance distance(const Motion& a, const Motion& b) {
  Distance d;
  double n = 0.0;
  for (std::size_t i = 0; i < a.x.size(); ++i) {
    const std::optional<Vec6> there = at(b, a.t[i]);
    if (!there) continue;
    const Vec6 apart = a.x[i] - *there;
    const double p = apart.head<3>().norm(), r = apart.tail<3>().norm();
    ++n;
    d.rms_position += p * p;
    d.rms_attitude += r * r;
    d.peak_position = std::max(d.peak_position, p);
    d.peak_attitude = std::max(d.peak_attitude, r);
  }
  if (n == 0.0) return d;
  d.rms_position = std::sqrt(d.rms_position / n);
  d.rms_attitude = std::sqrt(d.rms_attitude / n);
  return d;
}

Distance travel(const Motion& motion) {
  Motion still = motion;
  std::fill(still.x.begin(), still.x.end(), motion.x.empty() ? Vec6::Zero() : motion.x.front());
  return distance(motion, still);
}

std::vector<CoupledMode> coupledModes(const Interaction& interaction) {
  const ModalModel base = linearised(interaction.vehicle);
  const RigidBody robot = lockedRobot(interaction.payload, interaction.q0);
  const Eigen::MatrixXd A = augmentedModalMass(base, robot);
  const Eigenmodes modes = eigenmodes(A, base.stiffness.asDiagonal());
  // xi = V^T A eta, eta = Phi^+ x
  const Eigen::MatrixXd to_modes =
      modes.shapes.transpose() * A * leastSquares(base.Phi, Mat6::Identity());
  std::vector<CoupledMode> out;
  for (Eigen::Index j = 0; j < modes.stiffness.size(); ++j) {
    const Eigen::VectorXd v = modes.shapes.col(j);
    const double omega = std::sqrt(modes.stiffness(j));
    out.push_back({omega / (2.0 * M_PI), v.dot(base.damping * v) / (2.0 * omega), base.Phi * v,
                   to_modes.row(j)});
  }
  return out;
}

RingDown ringDown(const Motion& motion, const CoupledMode& mode) {
  double turn = 2.0 * M_PI * mode.frequency, decay = 0.0;
  for (int pass = 0; pass < 6; ++pass) {
    // xi = a e^{-decay t} cos(turn t + p), and its quadrature, which needs both.
    double n = 0, t1 = 0, t2 = 0, a1 = 0, at = 0, p1 = 0, pt = 0, phase = 0, first = 0;
    for (std::size_t i = 0; i < motion.t.size(); ++i) {
      const double xi = mode.of_tip.dot(motion.x[i]);
      const double other = -(mode.of_tip.dot(motion.x_dot[i]) + decay * xi) / turn;
      const double size = std::hypot(xi, other);
      if (i == 0) first = size;
      if (size < 0.05 * first) break;
      const double now = std::atan2(other, xi);
      phase = n > 0 ? phase + std::remainder(now - phase, 2.0 * M_PI) : now;
      const double t = motion.t[i], a = std::log(size);
      n += 1;
      t1 += t, t2 += t * t, a1 += a, at += a * t, p1 += phase, pt += phase * t;
    }
    const double spread = n * t2 - t1 * t1;
    decay = -(n * at - t1 * a1) / spread;
    turn = (n * pt - t1 * p1) / spread;
  }
  return {std::hypot(turn, decay) / (2.0 * M_PI), decay / std::hypot(decay, turn)};
}

}  // namespace ves
