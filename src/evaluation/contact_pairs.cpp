// SPDX-License-Identifier: BSD-3-Clause
#include "ves/evaluation/contact_pairs.hpp"

#include <fmt/format.h>
#include <fmt/os.h>

#include <algorithm>
#include <cmath>

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

double ContactPair::energyError() const {
  if (!emulated || !free_space || !emulated->over() || !free_space->over()) return NAN;
  return std::pow(emulated->restitution(), 2) - std::pow(free_space->restitution(), 2);
}

std::vector<ContactPair> contactPairs(const Series& series, const std::optional<Emulation>& e) {
  const std::vector<Contact> emulated = contactsOf(series),
                             free_space = e ? e->base.contacts : std::vector<Contact>();
  std::vector<ContactPair> out(std::max(emulated.size(), free_space.size()));
  for (std::size_t i = 0; i < emulated.size(); ++i) out[i].emulated = emulated[i];
  for (std::size_t i = 0; i < free_space.size(); ++i) out[i].free_space = free_space[i];
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
    one["energy_error"] = pair.energyError();
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
    if (const double error = first.energyError(); std::isfinite(error))
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
      out.print(",{}\n", pairs[i].energyError());
    }
  } catch (const std::system_error& error) {
    throw InputError(fmt::format("{}: cannot be written: {}", file, error.what()));
  }
}

}  // namespace ves
