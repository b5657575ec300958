// SPDX-License-Identifier: BSD-3-Clause
#include "reproduction.hpp"

#include <algorithm>
#include <cmath>

namespace ves {
namespace {

/// Parts of the compensation, as overrides; with the inertia the converter is averaged over a tick.
Overrides compensation(bool feed_forward, bool observer, bool inertia) {
  return {fmt::format("controller.compensation.feed_forward={}", feed_forward),
          fmt::format("controller.compensation.observer={}", observer),
          fmt::format("controller.compensation.inertia={}", inertia),
          fmt::format("sensor.readings_per_tick={}", inertia ? 4 : 1)};
}
struct Stage {
  const char* name;
  Overrides set;
};
std::vector<Stage> stages() {
  return {{"as published", compensation(false, false, false)},
          {"feed-forward", compensation(true, false, false)},
          {"all", compensation(true, true, true)}};
}

/// Largest error [m | rad] of a coordinate after the first half second of what is measured.
double settled(const Series& series, SegmentKind kind, int i) {
  const Line error = lineOf("", series, kind, 0,
                            [&](const Row& r) { return r.state.x_desired[i] - r.truth.x[i]; });
  double most = 0.0;
  for (std::size_t k = 0; k < error.x.size(); ++k)
    if (error.x[k] > 0.5) most = std::max(most, std::abs(error.y[k]));
  return most;
}

/// Rms distance of the platform from the moving base, by the base's largest motion.
double share(const std::optional<Emulation>& e) {
  return e ? distance(e->platform, e->base).rms_position / travel(e->base).peak_position : NAN;
}
std::string ended(const Reproduction::Run& run, double share) {
  return run.result.good() ? percent(share) : std::string(name(run.result.phase));
}

/// Sines and the free decay, with each part of the compensation.
void onTable41(Reproduction& r) {
  r.page.text(
      "Three parts that the report does not have, each off by default: the reference goes "
      "through the inverse of the closed servo (feed-forward); a model beside the servos knows "
      "their counts, speeds and accelerations (observer); the robot's inertia is taken out of "
      "the wrench and put on the base's side of (3.11) (inertia; the A/D converter is read four "
      "times a tick then, and averaged). Counts and LegSlaves are in every run.");
  Numbers& n = r.numbers["beyond"];
  TableRows rows;
  struct Case {
    const char* title;
    const char* scenario;
    SegmentKind kind;
    std::vector<int> coordinates;
  };
  for (const Case& c : {Case{"z sine, 0.5 Hz", "z_sine", SegmentKind::kTrajectory, {2}},
                        Case{"alpha sine, 0.5 Hz", "alpha_sine", SegmentKind::kTrajectory, {3}},
                        Case{"free decay, Table 4.1, worst of six",
                             "free_decay",
                             SegmentKind::kAdmittance,
                             {0, 1, 2, 3, 4, 5}}}) {
    std::vector<std::string> row = {c.title};
    for (const Stage& stage : stages()) {
      const Reproduction::Run run = r.run(c.scenario, stage.set);
      double most = 0.0;
      for (const int i : c.coordinates) {
        const Line due = lineOf("", run.series, c.kind, 0,
                                [&](const Row& x) { return std::abs(x.state.x_desired[i]); });
        most = std::max(
            most, settled(run.series, c.kind, i) / *std::max_element(due.y.begin(), due.y.end()));
      }
      n[c.scenario][stage.name] = most;
      row.push_back(percent(most));
    }
    rows.push_back(row);
  }
  r.page.text(
      "Largest error after the first half second, percent of amplitude or offset. (A sine begins "
      "with a step in velocity, which no servo follows.)");
  r.page.table({"", "as published", "feed-forward", "all"}, rows);
}

/// Of the platform from the moving base.
Line distanceOverTime(const Emulation& e, const char* name, std::size_t colour) {
  Line out{name, {}, {}, static_cast<int>(colour), false};
  for (std::size_t i = 0; i < std::min(e.base.x.size(), e.platform.x.size()); ++i) {
    out.x.push_back(e.platform.t[i]);
    out.y.push_back(kMilli * (e.platform.x[i] - e.base.x[i]).head<3>().norm());
  }
  return out;
}

/// A row of the two lowest modes of base and robot, let go from a centimetre and a half.
TableRow addedDamping(Reproduction& r, const std::string& scenario, const std::string& what,
                      Overrides set, Numbers& numbers) {
  std::int64_t duration = 0;
  const std::vector<CoupledMode> modes = coupledModes(interactionOf(r.load(scenario), duration));
  std::vector<std::string> row = {what};
  set.push_back("gravity_m_per_s2=0");
  for (std::size_t j = 0; j < 2; ++j) {
    Overrides one = set;
    one.push_back(letGo(modes[j]));
    const RingDown fit = ringDown(commanded(r.run(scenario, one).series), modes[j]);
    const double added = fit.damping_ratio - modes[j].damping_ratio;
    numbers["damping_ratio_added"].push_back(added);
    row.insert(row.end(),
               {fmt::format("{:.3f}", modes[j].frequency),
                fmt::format("{:.4f}", modes[j].damping_ratio), fmt::format("{:+.4f}", added)});
  }
  return row;
}

/// One of the eight runs of 4.3 beside the robot on its base in free space: a row of each table.
/// The run that the figure shows, and no other, writes `distances`.
void oneOnTheArm(Reproduction& r, const Run43& which, TableRow& row, TableRow& damping,
                 Panel& distances) {
  const std::string scenario = "srms_" + which.configuration + "_" + which.robot,
                    what = title(which.configuration, which.robot);
  const Overrides quiet = {"sensor.noise=false"},
                  six = {"base.keep_modes=6", "controller.stability=forced"};
  const Overrides all = compensation(true, true, true);
  Numbers& own = r.numbers["beyond"][scenario];
  row = {what};
  const auto add = [&](const char* key, const Overrides& set) {
    const Reproduction::Run run = r.run(scenario, set);
    const std::optional<Emulation> e = r.emulation(run.series);
    if (run.result.good()) own[key] = share(e);
    row.push_back(ended(run, share(e)));
    return e;
  };
  for (const Stage& stage : stages()) {
    const std::optional<Emulation> e = add(stage.name, stage.set);
    if (!e) continue;
    if (row.size() == 2) row.insert(row.begin() + 1, mm(travel(e->base).peak_position));
    if (scenario == "srms_deploy_doss")
      distances.lines.push_back(distanceOverTime(*e, stage.name, distances.lines.size()));
  }
  add("all, no noise", with(all, quiet));
  add("six modes, as published, no noise",
      with(with(compensation(false, false, false), six), quiet));
  add("six modes, all, no noise", with(with(all, six), quiet));
  damping = addedDamping(r, scenario, what, with(all, quiet), own);
}

void onTheArm(Reproduction& r) {
  TableRows rows(kRuns), damping(kRuns);
  Panel distances{kSinceAdmittance, "distance [mm]", {}, false};
  r.parts(kRuns, [&](Reproduction& piece, std::size_t i) {
    oneOnTheArm(piece, runOf(i), rows[i], damping[i], distances);
  });
  r.page.text(
      "The platform's motion beside that of the robot on its base in free space, nothing left "
      "out: rms of the distance, percent of the base's largest motion. A run that ends itself is "
      "named. With the sensor's noise, about 1 N, the small motions drown: as published the "
      "lag's "
      "false damping calms what the noise excites, and without the lag it is there as it would "
      "be on the base. A percent of the PUMA's third of a millimetre is a twentieth of a count "
      "of "
      "a leg.");
  r.page.table({"", "moves [mm]", "as published", "feed-forward", "all", "all, no noise",
                "six modes, published, no noise", "six modes, all, no noise"},
               rows);
  r.page.figure("Deploy, DOSS: distance of the platform from the moving base.", {distances},
                "./ves run srms_deploy_doss --lockstep");
  r.page.text("Damping that the emulation adds to the two lowest modes, let go one by one:");
  r.page.table({"", "[Hz]", "zeta", "added, all", "[Hz]", "zeta", "added, all"}, damping);
}

/// What the rest of the error comes from: one thing changed at a time.
void remains(Reproduction& r) {
  const char* quiet = "sensor.noise=false";
  const Stage changes[] = {
      {"noise and counts, as it is", {}},
      {"without the sensor's noise", {quiet}},
      {"and the A/D converter four times finer",
       {quiet, "sensor.gain=[4000,4000,4000,4000,4000,4000]"}},
      {"and 200 Hz instead of 100", {quiet, "controller.period_ns=5000000"}},
      {"without the noise, the converter read once a tick", {quiet, "sensor.readings_per_tick=1"}},
      {"without the noise, samples three ticks late",
       {quiet,
        "program=[{move: {}, faults: [{at_s: 0, duration_s: 1000, fault: samples_late, samples: "
        "3}]}, {calibration: {}}, {admittance: {duration_s: 20}, robot: [{at_s: 0, duration_s: 5, "
        "joint: joint_3, to_deg_or_m: -60}]}]"}},
      {"without the noise, legs at the edge of their counts",
       {quiet, "controller.compensation.observer=false", "controller.compensation.inertia=false"}},
      {"without the noise, robot 5 percent heavier than modelled",
       {quiet, "plant_mismatch={mass: 1.05}"}},
      {"without the noise, servo gains 5 percent higher than modelled",
       {quiet, "plant_mismatch={gain_extend: 1.05, gain_retract: 1.05}"}}};
  TableRows rows(std::size(changes));
  r.parts(std::size(changes), [&](Reproduction& piece, std::size_t i) {
    const auto& [what, more] = changes[i];
    const Reproduction::Run run =
        piece.run("srms_capture_doss",
                  with(with(compensation(true, true, true), {"gravity_m_per_s2=0"}), more));
    const double reached = share(piece.emulation(run.series));
    piece.numbers["beyond"]["budget"][what] = reached;
    rows[i] = {what, ended(run, reached)};
  });
  r.page.text("What remains, and what sets it (capture, DOSS, in space), in the same percent:");
  r.page.table({"", "rms"}, rows);
}

}  // namespace

void compensationSection(Reproduction& r) {
  r.page.section("Beyond the report: without the lag, and past the limit");
  onTable41(r);
  onTheArm(r);
  remains(r);
}

}  // namespace ves
