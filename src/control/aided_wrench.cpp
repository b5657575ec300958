// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/aided_wrench.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "ves/math/dense.hpp"

namespace ves {

namespace {

constexpr double kDoubt = 0.5;  // [s] before and after the gripper is told to have moved

}  // namespace

AidedWrench::AidedWrench(const ControllerConfig& config)
    : aided_(config.compensation.aided),
      hold_(std::max(1, static_cast<int>(
                            std::lround(config.compensation.gate_hold / config.periodSeconds())))),
      gravity_(config.gravity),
      counts_(config.sensor),
      X_PL0_(config.payload.X_PL0()),
      regressor_(config.compensation.learns_masses
                     ? MassRegressor(config.payload.robot, config.hand)
                     : MassRegressor(RobotModel())),
      common_(config.compensation.mass_error / std::sqrt(3.0)),
      prior_(regressor_.deviations(common_)),
      most_(regressor_.deviations(config.compensation.mostLearnt())),
      bias_deviation_(config.stillness.bias),
      gate_(config),
      noise_(config),
      twist_(config.servo.sensor_cutoff),
      doubted_(static_cast<int>(std::lround(kDoubt / config.periodSeconds()))),
      used_(MassVector::Zero(prior_.size())) {
  const double mass = config.compensation.hand_mass;
  hand_.setConstant(mass * config.compensation.hand_center);
  hand_(0) = mass;
  if (regressor_.hand() >= 0)
    most_.segment<4>(regressor_.hand()) = Compensation::kMostInHand * hand_;
}

Wrench AidedWrench::update(const Input& in, bool engaged) noexcept {
  taught_ = false;
  lesson_.learnt.resize(0);
  lesson_.withheld = {};
  lesson_.group_ends = false;
  lesson_.replay = 0;
  lesson_.passed = {};
  lesson_.passing = false;
  lesson_.hand = -1;
  lesson_.was_weight = false;
  if (!aided_) return in.measured;
  hand_moved_ = hand_moved_ || in.gripper;  // also where nothing is learnt yet
  if (!engaged) {
    restart();
    noise_.stop();
    settled_ = false;
    open_ = 0;
    residuals_ = 0;
    reaction_ = {};
    withholds_ = false;
    return in.measured;
  }
  reaction_ = in.joints.force();
  calibrate(in);
  if (!begun_) return in.measured;
  if (std::exchange(hand_moved_, false) && regressor_.hand() >= 0)
    doubtHand(counts_.perWrench(in.X_IP.R));
  if (in.samples.fresh()) {
    constexpr std::int64_t kRefresh = 100;  // [-] samples: attitude and joints change slowly
    if (residuals_++ % kRefresh == 0) refreshNoise(in);
    noise_.refreshLegs(in.robot.platform());
    const Wrench residual = in.measured - in.joints.shown(in.robot.platform().w);
    take(in, counts_.perWrench(in.X_IP.R), residual);
  }
  const Wrench beyond = Wrench::from(in.share * (in.measured - reaction_).stacked());
  Wrench passed = beyond;
  if (withholds_)
    passed =
        lasting_.samples > 0 ? Wrench::from(in.share * lasting(in.X_IP.R).stacked()) : Wrench();
  closed_ = withholds_ && lasting_.samples == 0 ? closed_ + 1 : 0;
  passing_ = closed_ <= hold_ ? passing_ + 1 : 0;
  lesson_.passing = passing_ > 0;
  const auto emulated = [&](const Wrench& F_Po_I) {
    return in.emulated.apart ? rotate(in.emulated.R_EI, F_Po_I) : F_Po_I;
  };
  lesson_.passed = emulated(passed);
  if (!withholds_) return in.measured;
  lesson_.withheld = emulated(beyond - passed);
  return in.measured - (beyond - passed);
}

/// A calibration measures bias and weight together: what it read beyond the weight then believed
/// counts as bias. So does a tare that came to its end; the bias may have drifted since the last.
void AidedWrench::calibrate(const Input& in) noexcept {
  const bool tared = taring_ && !in.bias.taring() && in.bias.found() != before_tare_;
  if (!taring_ && in.bias.taring()) before_tare_ = in.bias.found();
  taring_ = in.bias.taring();
  if (in.bias.found() != bias_) {
    if (begun_) belief_.moveBias(in.bias.found() - bias_);
    bias_ = in.bias.found();
    restart();
  }
  const bool took = taking_;
  taking_ = in.bias.calibration().status() == CalibrationStatus::kTaking;
  const bool done = in.bias.calibration().status() == CalibrationStatus::kDone;
  if (!(done && (took || !begun_)) && !(begun_ && tared)) return;
  if (begun_)
    belief_.doubtBias(bias_deviation_);
  else
    belief_.begin(prior_, common_, bias_deviation_);
  begun_ = true;
  open_ = 0;
  MassColumns momentum, weight;
  regressor_.evaluate(X_PL0_, gravity_, {in.X_IP.R, {}, {}, in.joints.q(), {}}, momentum, weight);
  MassColumns columns;
  columns.noalias() = counts_.perWrench(in.X_IP.R) * weight;
  refreshNoise(in);
  belief_.learnAtRest(columns, columns * used_, noise_.now().ofMean(kCalibrationSamples));
  restart();
}

void AidedWrench::restart() noexcept {
  lasting_ = {};
  in_group_ = -1;
  groups_ = 0;
  sums_[0].columns.setZero(6, prior_.size());
  sums_[0].y.setZero();
  sums_[0].time = 0.0;
  belief_.beginBlocks(noise_.ofMomentum());
  beliefs_[0] = belief_;
}

/// A new sample's residual.
void AidedWrench::take(const Input& in, const Mat6& counts_per_wrench,
                       const Wrench& residual) noexcept {
  const BodyMotion& P = in.robot.platform();
  const double since = in.samples.wrench().since;
  const Vec6 twist = (Vec6() << P.v, P.w).finished();
  if (!settled_)
    twist_.settle(twist.array());
  else if (since > 0.0)
    twist_.advance(twist_.prepare(since), twist.array());
  settled_ = true;
  const Vec6 felt = twist_.output().matrix();
  const JointVector &q = in.joints.q(), &q_dot = in.joints.q_dot();
  if (in.emulated.apart)
    regressor_.evaluate(X_PL0_, gravity_,
                        {in.emulated.R_EP, in.emulated.v, in.emulated.w, q, q_dot},
                        lesson_.momentum, weight_);
  regressor_.evaluate(X_PL0_, gravity_, {in.X_IP.R, felt.head<3>(), felt.tail<3>(), q, q_dot},
                      momentum_, weight_);
  if (!in.emulated.apart) lesson_.momentum = momentum_;
  open_ = std::max(0, open_ - 1);
  doubts_ = std::max(0, doubts_ - 1);
  withholds_ = open_ == 0;
  if (!withholds_) return;
  const Vec6 y = counts_per_wrench * residual.stacked() + in.bias.learnt(),
             beyond = weight_ * (belief_.parameters() - used_),
             left = y - belief_.bias() - counts_per_wrench * beyond - lasting_.mean;
  if (gate_.exceeds(1, left, noise_.now(), unknown_)) {
    open(belief_, std::max(0, in_group_) + 1);
    return;
  }
  if (in.share < 1.0) {
    restart();
  } else if (in_group_ < 0) {
    in_group_ = 0;
    residual_sum_.setZero();
    group_time_ = 0.0;
    momentum_before_ = momentum_;
    weight_before_ = weight_;
    lesson_.group_ends = true;  // where it begins
  } else {
    residual_sum_ += y;
    group_time_ += since;
    if (++in_group_ == Lesson::kGroup) endGroup(counts_per_wrench);
  }
}

void AidedWrench::endGroup(const Mat6& counts_per_wrench) noexcept {
  if (!(group_time_ > 0.0)) {  // samples that name one time
    restart();
    return;
  }
  lesson_.group_ends = true;
  const Sum& last = sums_[groups_++ % sums_.size()];
  Sum& sum = sums_[groups_ % sums_.size()];
  MassColumns one;
  one.noalias() = counts_per_wrench *
                  (0.5 * (weight_before_ + weight_) - (momentum_ - momentum_before_) / group_time_);
  sum.columns = last.columns + one;
  sum.y = last.y + residual_sum_ / Lesson::kGroup;
  sum.y.noalias() += one * used_;
  sum.time = last.time + group_time_;
  residual_sum_.setZero();
  group_time_ = 0.0;
  in_group_ = 0;
  momentum_before_ = momentum_;
  weight_before_ = weight_;
  unknown_ = belief_.variance(one);
  if (isForce(1, belief_)) return;
  if (groups_ >= 2 && isForce(2, beliefs_[(groups_ - 2) / kGroupsOfBlock % kBlocks])) return;
  if (groups_ % kGroupsOfBlock != 0) return;

  const std::size_t block = groups_ / kGroupsOfBlock - 1;
  for (std::size_t i = 3; i < ResidualGate::kMeans.size(); ++i) {
    const auto blocks =
        static_cast<std::size_t>(ResidualGate::kMeans[i]) / (kGroupsOfBlock * Lesson::kGroup);
    if (block + 1 >= blocks && isForce(i, beliefs_[(block + 1 - blocks) % kBlocks])) return;
  }
  if (lasting_.samples > 0) {
    beliefs_[(block + 1) % kBlocks] = belief_;
    return refineLasting();
  }
  const Sum& before = sums_[(groups_ - kGroupsOfBlock) % sums_.size()];
  const double block_time = sum.time - before.time;
  constexpr double kShare = 1.0 / static_cast<double>(kGroupsOfBlock);
  belief_.learn(kShare * (sum.columns - before.columns), kShare * (sum.y - before.y),
                noise_.now().ofMean(static_cast<int>(kGroupsOfBlock) * Lesson::kGroup),
                noise_.ofMomentum(), block_time);
  if (doubts_ > 0) belief_.doubt(regressor_.hand(), hand_);
  beliefs_[(block + 1) % kBlocks] = belief_;
  use();
}

/// With what came since it was found, until that is as much as is kept. Where later on the last of
/// it shows less than half of what would be found, there is none any more.
void AidedWrench::refineLasting() noexcept {
  const std::size_t n = std::min(groups_, Lesson::kGroups);
  const Window last = window(n, belief_);
  if (groups_ <= Lesson::kGroups) {
    const double found = lasting_.samples, since = last.samples;
    lasting_.mean = (found * lasting_.found + since * last.mean) / (found + since);
  }
  if (n == Lesson::kGroups &&
      !gate_.exceeds(last.samples, 2.0 * last.mean, noise_.now(), last.unknown))
    restart();
}

/// What passed of late was the weight in the hand, and what comes may be.
void AidedWrench::doubtHand(const Mat6& counts_per_wrench) noexcept {
  lesson_.hand = regressor_.hand();
  lesson_.was_weight = passing_ > 0 && passing_ <= doubted_;
  passing_ = open_ = 0;
  doubts_ = doubted_;
  belief_.doubt(regressor_.hand(), hand_);
  restart();
  if (weight_.cols() != prior_.size()) return;  // before the first sample
  MassColumns weight;
  weight.noalias() = counts_per_wrench * weight_;
  unknown_ = belief_.variance(weight);
}

/// The last groups, by what was known `before`.
AidedWrench::Window AidedWrench::window(std::size_t groups,
                                        const MassBelief& before) const noexcept {
  const Sum &now = sums_[groups_ % sums_.size()], &then = sums_[(groups_ - groups) % sums_.size()];
  const MassColumns columns = (now.columns - then.columns) / static_cast<double>(groups);
  return {static_cast<int>(groups) * Lesson::kGroup,
          before.unexplained(columns, (now.y - then.y) / static_cast<double>(groups)),
          before.variance(columns)};
}

/// Judged by what was known `before`. It began with the block from which on the mean is farthest
/// beyond what would be noise.
bool AidedWrench::isForce(std::size_t mean, const MassBelief& before) noexcept {
  const int samples = ResidualGate::kMeans[mean];
  const auto n = static_cast<std::size_t>(samples / Lesson::kGroup);
  Window best = window(n, before);
  const auto excess = [&](const Window& w) {
    return gate_.excess(w.samples, w.mean - lasting_.mean, noise_.now(), w.unknown);
  };
  if (!gate_.exceeds(samples, best.mean - lasting_.mean, noise_.now(), best.unknown)) return false;
  const MassBelief* known = &before;
  double farthest = excess(best);
  for (std::size_t block = (groups_ - 1) / kGroupsOfBlock + 1; block-- > 0;) {
    const std::size_t groups = groups_ - block * kGroupsOfBlock;
    if (groups <= n) continue;
    if (groups > Lesson::kGroups) break;
    const MassBelief& then = beliefs_[block % kBlocks];
    const Window longer = window(groups, then);
    const double beyond = excess(longer);
    if (!(beyond > farthest)) continue;
    farthest = beyond;
    best = longer;
    known = &then;
  }
  const bool lasts = gate_.exceeds(best.samples, best.mean, noise_.now(), best.unknown);
  // The sample before the first group, too, where it began with that: it was withheld.
  const bool all = best.samples == static_cast<int>(groups_) * Lesson::kGroup;
  open(*known, best.samples + (all ? 1 : 0));
  if (mean < ResidualGate::kLasting) return true;
  open_ = 0;
  withholds_ = true;
  if (lasts) lasting_ = {best.mean, best.mean, best.samples};
  return true;
}

void AidedWrench::open(const MassBelief& before, int samples) noexcept {
  lesson_.replay = samples;
  const MassBelief kept = before;  // which may be in beliefs_
  belief_ = kept;
  use();
  restart();
  withholds_ = false;
  open_ = hold_;
}

/// The model has what is believed now, within reason.
void AidedWrench::use() noexcept {
  if (prior_.size() == 0) return;
  MassVector next = belief_.parameters().cwiseMin(most_).cwiseMax(-most_);
  for (Eigen::Index i = 0; i < next.size(); i += 4)
    next(i) = std::max(next(i), i == regressor_.hand() ? 0.0 : Compensation::kLeastLearnt - 1.0);
  if (next == used_) return;
  lesson_.learnt = next - used_;
  used_ = next;
  taught_ = true;
}

Wrench AidedWrench::lasting(const Mat3& R_IP) const noexcept {
  return rotate(R_IP, counts_.wrench(lasting_.mean));
}

void AidedWrench::refreshNoise(const Input& in) noexcept {
  noise_.refresh({in.bias.noise(), in.carried, in.joints.q(), in.X_IP, in.robot.M_1(), in.weight});
}

}  // namespace ves
