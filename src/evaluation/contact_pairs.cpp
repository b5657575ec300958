// SPDX-License-Identifier: BSD-3-Clause
#include "ves/evaluation/contact_pairs.hpp"

#include <fmt/format.h>
#include <fmt/os.h>

#include <algorithm>
#include <cmath>

#include "ves/math/dense.hpp"

namespace ves {
namespace {

Contact contactOf(const truth_t& truth) {
  Contact out;
  out.began = truth.contact_began;
  out.duration = truth.contact_duration;
  out.peak = truth.contact_peak;
  out.impulse = Vec3::Map(truth.contact_impulse);
  out.approach = truth.contact_approach;
  out.separation = truth.contact_separation;
  return out;
}

constexpr std::pair<const char*, double (*)(const Contact&)> kFigures[] = {
    {"began_s", [](const Contact& c) { return c.began; }},
    {"duration_s", [](const Contact& c) { return c.duration; }},
    {"peak_n", [](const Contact& c) { return c.peak; }},
    {"impulse_ns", [](const Contact& c) { return c.impulse.norm(); }},
    {"approach_m_per_s", [](const Contact& c) { return c.approach; }},
    {"separation_m_per_s", [](const Contact& c) { return c.separation; }},
    {"restitution", [](const Contact& c) { return c.over() ? c.restitution() : NAN; }}};

}  // namespace

std::vector<Contact> contactsOf(const Series& series) {
  std::vector<Contact> out;
  std::optional<double> start;  // [s] by the clock of the truth
  int before = -1;              // [-] contacts until then
  eachTick(series, [&](const Row& row, double) {
    if (!start) start = static_cast<double>(row.state.machine_time_ns) * kSecondPerNanosecond;
    if (!row.has_truth) return;
    if (before < 0) before = row.truth.contacts - row.truth.touching;
    const int fresh = row.truth.contacts - before;
    if (fresh <= 0) return;
    out.resize(static_cast<std::size_t>(fresh));
    out.back() = contactOf(row.truth);
    out.back().began -= *start;
  });
  return out;
}

namespace {

/// [J] of the vehicle with a robot that moves as one body, and of what floats.
double energy(const Experiment& e, const Vec6& x, const Vec6& x_dot, const JointVector& q,
              const Floating& floating) {
  const ModalModel base = linearised(e.controller.vehicle);
  const Mat6 M_1 = spatialMass(rotated(rotation(x.tail<3>()), lockedRobot(e.plant.payload, q)));
  const Eigen::VectorXd eta = leastSquares(base.Phi, x), eta_dot = leastSquares(base.Phi, x_dot);
  double twice =
      eta_dot.squaredNorm() + eta.dot(base.stiffness.cwiseProduct(eta)) + x_dot.dot(M_1 * x_dot);
  const Environment& environment = e.plant.task.world->environment;
  if (const auto& target = environment.target) {
    const Mat3 R = floating.q.toRotationMatrix();
    const Vec3 w_B = R.transpose() * floating.w;
    twice += target->mass * (floating.v.squaredNorm() - 2.0 * environment.gravity.dot(floating.p)) +
             w_B.dot(target->I_Bcm_B * w_B);
  }
  return 0.5 * twice;
}

/// The ticks of the first admittance segment with the true pose, and the same times in free space.
class Ticks {
 public:
  Ticks(const Series& series, const Motion& base) : experiment_(series.experiment), base_(base) {
    eachTick(series, [&](const Row& row, double since) {
      if (!row.hasTruePose()) return;
      t_.push_back(since);
      rows_.push_back(&row.truth);
    });
    size_ = std::min(rows_.size(), base.target.size());
  }

  using Energy = double (Ticks::*)(std::size_t) const;  // [J] in a tick that has two neighbours
  double emulated(std::size_t i) const {
    const truth_t& m = *rows_[i];
    Floating floating;
    floating.p = Vec3::Map(m.target_p);
    floating.q.coeffs() = Eigen::Vector4d::Map(m.target_q);
    floating.v = Vec3::Map(m.target_v);
    floating.w = Vec3::Map(m.target_w);
    const auto x = [&](std::size_t k) { return Vec6::Map(rows_[k]->x); };
    return energy(experiment_, x(i), (x(i + 1) - x(i - 1)) / (t_[i + 1] - t_[i - 1]), q(i),
                  floating);
  }
  /// With the joints where they were in the run.
  double freeSpace(std::size_t i) const {
    const Vec6 x_dot = (base_.x[i + 1] - base_.x[i - 1]) / (base_.t[i + 1] - base_.t[i - 1]);
    return energy(experiment_, base_.x[i], x_dot, q(i), base_.target[i]);
  }

  /// [J] gained from before `contact` until ContactPair::kAfter later, or until `next` [s].
  double gained(Energy energy, const Contact& contact, double next) const {
    const double end = contact.began + contact.duration;
    const std::size_t after = ticksUntil(std::min(end + ContactPair::kAfter, next)),
                      before = ticksUntil(contact.began);
    // Over a tick before and after: within one a platform's speed swings.
    if (before < 3 || after < 2 || after + 1 > size_ || !(t_[after - 1] > end)) return NAN;
    return (this->*energy)(after - 1) - (this->*energy)(before - 2);
  }

 private:
  JointVector q(std::size_t i) const { return JointVector::Map(rows_[i]->q); }
  std::size_t ticksUntil(double t) const {
    return static_cast<std::size_t>(std::upper_bound(t_.begin(), t_.end(), t) - t_.begin());
  }

  const Experiment& experiment_;
  const Motion& base_;
  std::vector<double> t_;  // [s]
  std::vector<const truth_t*> rows_;
  std::size_t size_ = 0;
};

}  // namespace

std::vector<ContactPair> contactPairs(const Series& series, const std::optional<Emulation>& e) {
  const std::vector<Contact> emulated = contactsOf(series),
                             free_space = e ? e->base.contacts : std::vector<Contact>();
  std::vector<ContactPair> out(std::max(emulated.size(), free_space.size()));
  for (std::size_t i = 0; i < emulated.size(); ++i) out[i].emulated = emulated[i];
  for (std::size_t i = 0; i < free_space.size(); ++i) out[i].free_space = free_space[i];
  // Poses in a laboratory that flies say nothing of the energy.
  if (out.empty() || !e || series.experiment.controller.moving_frame.enabled) return out;
  const Ticks ticks(series, e->base);
  const auto next = [](const std::vector<Contact>& all, std::size_t i) {
    return i + 1 < all.size() ? all[i + 1].began : HUGE_VAL;
  };
  for (std::size_t i = 0; i < std::min(emulated.size(), free_space.size()); ++i) {
    const Contact &ours = emulated[i], &due = free_space[i];
    if (!ours.over() || !due.over()) continue;
    // Newton: the impulse is what mass meets, times the speeds' sum.
    const double mass = due.impulse.norm() / (due.approach + due.separation),
                 approach = 0.5 * mass * due.approach * due.approach;
    out[i].energy_error = (ticks.gained(&Ticks::emulated, ours, next(emulated, i)) -
                           ticks.gained(&Ticks::freeSpace, due, next(free_space, i))) /
                          approach;
  }
  return out;
}

void addContacts(const Series& series, const std::optional<Emulation>& e,
                 nlohmann::ordered_json& out) {
  if (!series.experiment.plant.task.world) return;
  const std::vector<ContactPair> pairs = contactPairs(series, e);
  int emulated = 0, free_space = 0;
  double peak = 0.0, due = 0.0;
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  for (const ContactPair& pair : pairs) {
    nlohmann::ordered_json one;
    for (const auto& [name, value] : kFigures) {
      if (pair.emulated) one[name] = value(*pair.emulated);
      if (pair.free_space) one[std::string("free_space_") + name] = value(*pair.free_space);
    }
    one["energy_error"] = pair.energy_error;
    all.push_back(one);
    emulated += pair.emulated.has_value();
    free_space += pair.free_space.has_value();
    if (pair.emulated) peak = std::max(peak, pair.emulated->peak);
    if (pair.free_space) due = std::max(due, pair.free_space->peak);
  }
  out["contacts"] = emulated;
  if (e) out["contacts_free_space"] = free_space;
  if (!pairs.empty()) {
    out["contact_peak_n"] = peak;
    if (e) out["contact_peak_free_space_n"] = due;
    const ContactPair& first = pairs.front();
    if (first.emulated && first.emulated->over())
      out["contact_restitution"] = first.emulated->restitution();
    if (first.free_space && first.free_space->over())
      out["contact_restitution_free_space"] = first.free_space->restitution();
    if (const double error = first.energy_error; std::isfinite(error))
      out["contact_energy_error"] = error;
  }
  out["contact_list"] = all;
}

void addEnergy(const Series& series, nlohmann::ordered_json& out) {
  double put_in = 0.0, most = 0.0, paid = 0.0;
  bool any = false;
  for (const Row& row : series.rows) {
    if (!inAdmittance(row.state)) continue;
    any = true;
    put_in = row.state.energy_put_in;
    most = std::max(most, put_in);
    paid = row.state.energy_paid;
  }
  if (!any) return;
  out["energy_put_in_j"] = put_in;
  out["energy_put_in_max_j"] = most;
  if (series.experiment.controller.passivity.enabled) out["energy_paid_j"] = paid;
}

std::string contactTable(const nlohmann::ordered_json& s) {
  constexpr std::size_t kMostShown = 5;
  std::string out = fmt::format("  contact  {} in the run", s["contacts"].get<int>());
  if (s.contains("contacts_free_space"))
    out += fmt::format(", {} on the base in free space", s["contacts_free_space"].get<int>());
  out += "\n";
  std::size_t shown = 0;
  for (const auto& one : s["contact_list"]) {
    if (++shown > kMostShown) break;
    const auto cell = [&](const char* key, double scale, int digits) {
      const auto text = [&](const std::string& name) {
        return one.contains(name) && one[name].is_number() && std::isfinite(one[name].get<double>())
                   ? fmt::format("{:.{}f}", one[name].get<double>() * scale, digits)
                   : std::string("-");
      };
      return fmt::format("{} ({})", text(key), text(std::string("free_space_") + key));
    };
    out += fmt::format("           {}: after {} s for {} ms, peak {} N, restitution {}\n", shown,
                       cell("began_s", 1.0, 2), cell("duration_s", 1e3, 1), cell("peak_n", 1.0, 2),
                       cell("restitution", 1.0, 4));
  }
  return out;
}

void writeContacts(const std::vector<ContactPair>& pairs, const std::string& file) {
  try {
    auto out = fmt::output_file(file);
    out.print("contact");
    for (const auto& [name, value] : kFigures) out.print(",{0},free_space_{0}", name);
    out.print(",energy_error\n");
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const auto number = [](const std::optional<Contact>& c, double (*value)(const Contact&)) {
        return c ? value(*c) : NAN;
      };
      out.print("{}", i + 1);
      for (const auto& [name, value] : kFigures)
        out.print(",{},{}", number(pairs[i].emulated, value), number(pairs[i].free_space, value));
      out.print(",{}\n", pairs[i].energy_error);
    }
  } catch (const std::system_error& error) {
    throw InputError(fmt::format("{}: cannot be written: {}", file, error.what()));
  }
}

}  // namespace ves
