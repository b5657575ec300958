// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <complex>
#include <filesystem>
#include <fstream>
#include <regex>

#include "support/refusal.hpp"
#include "support/rig.hpp"
#include "ves/analysis/loop.hpp"
#include "ves/evaluation/let_go.hpp"
#include "ves/math/dense.hpp"
#include "ves/run/run.hpp"
#include "ves/validation/chapter4.hpp"
#include "ves/validation/claims.hpp"
#include "ves/validation/page.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;

Interaction interaction(const std::string& scenario, const std::vector<std::string>& set = {}) {
  std::int64_t duration = 0;
  return interactionOf(test::experiment(scenario, set), duration);
}

TEST(CoupledModes, AreTheRootsOfBaseAndRobotTogether) {
  const Interaction i = interaction("srms_capture_doss", {"base.keep_modes=6"});
  const Eigen::MatrixXd A = augmentedModalMass(
      linearised(i.vehicle),
      combine(RigidBody{}, i.payload.X_PL0(), compositeBody(carried(i.payload), i.q0)));
  Eigen::MatrixXd S = Eigen::MatrixXd::Zero(12, 12);
  S.topRightCorner(6, 6).setIdentity();
  S.bottomLeftCorner(6, 6) = -solvePositive(A, linearised(i.vehicle).stiffness.asDiagonal());
  S.bottomRightCorner(6, 6) = -solvePositive(A, linearised(i.vehicle).damping);
  const Eigen::VectorXcd roots = eigenvalues(S);
  ASSERT_EQ(coupledModes(i).size(), 6u);
  for (const CoupledMode& mode : coupledModes(i)) {
    const std::complex<double> expected =
        std::polar(2 * M_PI * mode.frequency, M_PI / 2 + std::asin(mode.damping_ratio));
    EXPECT_LT((roots.array() - expected).abs().minCoeff(), 1e-3 * std::abs(expected));
  }
}

TEST(RingDown, FitsADecayThatIsKnown) {
  const Interaction i = interaction("srms_unberth_puma");
  const std::vector<CoupledMode> modes = coupledModes(i);
  ASSERT_FALSE(modes.empty());
  for (const CoupledMode& mode : modes) {
    const double zeta = 0.07, w = 2 * M_PI * 1.02 * mode.frequency;
    Motion motion;
    for (int n = 0; n < 1000; ++n) {
      const double t = 0.01 * n, e = std::exp(-zeta * w * t), d = w * std::sqrt(1 - zeta * zeta);
      motion.t.push_back(t);
      motion.x.push_back(mode.shape * e * std::cos(d * t));
      motion.x_dot.push_back(mode.shape * e * (-zeta * w * std::cos(d * t) - d * std::sin(d * t)));
    }
    const RingDown fit = ringDown(motion, mode);
    EXPECT_NEAR(fit.damping_ratio, zeta, 0.02 * zeta);
    EXPECT_NEAR(fit.frequency, w / (2 * M_PI), 0.01 * fit.frequency);
  }
}

TEST(ReferenceMotions, AreSharedByRunsThatDifferInWhatTheBaseDoesNotFeel) {
  ReferenceMotions references;
  const auto base = [&](const std::vector<std::string>& set) {
    std::vector<std::string> all = {
        "program=[{move: {}}, {calibration: {}}, {admittance: "
        "{duration_s: 1}, robot: [{at_s: 0, duration_s: 1, joint: "
        "joint_1, to_deg_or_m: 10}]}]"};
    all.insert(all.end(), set.begin(), set.end());
    const Series series = recordLockstep(test::experiment("srms_capture_puma", all)).series;
    const auto shared = emulation(series, references), fresh = emulation(series);
    EXPECT_EQ(shared->base.x, fresh->base.x);
    return shared->base.x.back();
  };
  const Vec6 first = base({});
  for (const char* same : {"seed=5", "gravity_m_per_s2=0", "legs.filters=outputs",
                           "sensor.noise=false", "controller.compensation.feed_forward=true"})
    EXPECT_EQ(base({same}), first) << same;
  EXPECT_EQ(references.computed(), 1);
  int computed = 1;
  for (const char* other :
       {"base.keep_modes=1", "robot.adapter.mass_kg=40", "program.2.admittance.duration_s=1.1",
        "controller.period_ns=5000000", "program.2.robot.0.to_deg_or_m=11",
        "robot.joints_deg_or_m=[0, 0, 90, 0, 0, 10]"}) {
    base({other});
    EXPECT_EQ(references.computed(), ++computed) << other;
  }
}

TEST(VesOnTheArm, RingsDownAsTheModelOfItsLoopSays) {
  // Two routes to the damping that the lag adds: the whole nonlinear lockstep simulation, and the
  // largest root of the linear loop. The legs move both ways, so it lies between the two gains'.
  for (const char* filters : {"none", "outputs"}) {
    const std::vector<std::string> set = {std::string("legs.filters=") + filters,
                                          "gravity_m_per_s2=0", "sensor.noise=false"};
    const Interaction i = interaction("srms_unberth_doss", set);
    const CoupledMode softest_mode = coupledModes(i)[0];
    const Vec6 offset = softest_mode.shape * 0.015 / softest_mode.shape.head<3>().norm();
    std::vector<std::string> with = set;
    with.push_back(
        "program=[{move: {}}, {calibration: {}}, {move: {to: {x_m: " + std::to_string(offset(0)) +
        ", y_m: " + std::to_string(offset(1)) + ", z_m: " + std::to_string(offset(2)) +
        ", beta_deg: " + std::to_string(offset(4) / kDegree) +
        "}}}, {admittance: {duration_s: 15}}]");
    const Experiment e = test::experiment("srms_unberth_doss", with);
    const RingDown fit = ringDown(commanded(recordLockstep(e).series), softest_mode);
    const double decay = fit.damping_ratio * 2 * M_PI * fit.frequency;
    const JointVector& q = e.plant.task.initial_joints;
    const double slow = -dominantRoot(loopOf(e.controller, q, Direction::kExtending)).growth;
    const double fast = -dominantRoot(loopOf(e.controller, q, Direction::kRetracting)).growth;
    EXPECT_GT(decay, 0.95 * slow) << filters;
    EXPECT_LT(decay, 1.05 * fast) << filters;
  }
}

TEST(VesOnTheArm, IsSrmsRobotLateByTheSensorWhenTheArmHardlyGives) {
  // What the VES does wrong comes back through the sensor, but for one delay: the wrench is late by
  // its filter (sqrt 2 / w = 11.3 ms) and half a period. On an arm 64 times as heavy and stiff,
  // with a robot that swings hard, little comes back, and the delay is what is left.
  Experiment e =
      test::experiment("srms_unberth_doss",
                       {"gravity_m_per_s2=0", "sensor.noise=false",
                        "program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 6}, "
                        "robot: [{at_s: 0, duration_s: 2.4, joint: joint_3, to_deg_or_m: -20}]}]"});
  std::get<ModalModel>(e.controller.vehicle.kind).Phi /= 8.0;
  InteractionOptions options;
  const Interaction i = interactionOf(e, options.duration);
  options.step = 1'000'000;
  const std::vector<InteractionPoint> srms = simulate(i, options);
  std::vector<Vec6> ves;  // without a log: its configuration would not know the changed base
  runLockstep(e, nullptr, [&](const TickState& s) {
    if (s.phase == Phase::kRunning && s.segment == 2) ves.push_back(s.motion.x);
    return Order();
  });
  double most = 0.0;
  for (const InteractionPoint& p : srms) most = std::max(most, p.x.norm());
  const auto apart = [&](int late) {  // [ms]; rms over the largest displacement
    double sum = 0.0;
    for (std::size_t n = 0; n + 1 < ves.size(); ++n) {
      const int at = 10 * static_cast<int>(n + 1) - late;
      sum += (ves[n] - srms[static_cast<std::size_t>(std::max(0, at))].x).squaredNorm();
    }
    return std::sqrt(sum / static_cast<double>(ves.size())) / most;
  };
  int best = 0;
  for (int late = 0; late <= 60; ++late)
    if (apart(late) < apart(best)) best = late;
  EXPECT_NEAR(best, 16.3, 3.0);
  EXPECT_LT(apart(best), 0.02);
  EXPECT_GT(apart(0), 2.0 * apart(best));
}

// --- Claims --------------------------------------------------------------------------------------

TEST(Claims, AreJudgedByTheirRangesEndsIncluded) {
  const fs::path file = fs::temp_directory_path() / fmt::format("ves_claims_{}.yaml", getpid());
  const auto written = [&](const std::string& more) {
    std::ofstream(file) << "claims:\n  one:\n    where: \"1\"\n    says: s\n    why: w\n"
                           "    reached: \"{a:.1f} of {b:.0f}\"\n"
                        << more;
    return Claims(file);
  };
  const Claims ranges = written("    agrees: {a: [1, 2], b: [-3, 3]}\n");
  EXPECT_EQ(ranges.ids(), std::vector<std::string>({"one"}));
  const auto verdict = [&](double a, double b) {
    return ranges.judge("one", {{"a", a}, {"b", b}, {"c", 1e9}}).verdict;
  };
  for (const double a : {1.0, 1.5, 2.0})
    for (const double b : {-3.0, 0.0, 3.0}) EXPECT_EQ(verdict(a, b), Verdict::kAgrees) << a << b;
  for (const double a : {0.99, 2.01, double(NAN), HUGE_VAL})
    EXPECT_EQ(verdict(a, 0.0), Verdict::kDiffers) << a;
  for (const double b : {-3.01, 3.01, double(NAN)})
    EXPECT_EQ(verdict(1.5, b), Verdict::kDiffers) << b;
  const Claim said = ranges.judge("one", {{"a", 1.25}, {"b", 2.0}});
  EXPECT_EQ(said.reached, "1.2 of 2");
  EXPECT_EQ(said.where + said.says + said.why, "1sw");

  EXPECT_EQ(written("").judge("one", {{"a", 1.0}, {"b", 1.0}}).verdict, Verdict::kCannotTell);
  EXPECT_EQ(written("    range: true\n").judge("one", {{"a", 1.0}, {"b", 1.0}}).verdict,
            Verdict::kRange);

  const auto refused = [&](const auto& what) { return test::refusal(what); };
  EXPECT_NE(refused([&] { ranges.judge("two", {}); }).find("no claim 'two'"), std::string::npos);
  EXPECT_NE(refused([&] {
              ranges.judge("one", {{"a", 1.0}});
            }).find("claims.one.reached"),
            std::string::npos);
  const Claims third = written("    agrees: {c: [0, 1]}\n");
  EXPECT_NE(refused([&] {
              third.judge("one", {{"a", 1.0}, {"b", 1.0}});
            }).find("claims.one.agrees: c: is not measured"),
            std::string::npos);
  EXPECT_NE(refused([&] { written("    agrees: {a: [2, 1]}\n"); }).find("the lower end first"),
            std::string::npos);
  fs::remove(file);
}

// --- The page ------------------------------------------------------------------------------------

/// Every tag that opens closes, in order.
void expectBalanced(const std::string& html) {
  std::vector<std::string> open;
  const std::regex tag(R"(<(/?)([a-zA-Z0-9]+)([^>]*?)(/?)>)");
  const std::set<std::string> single = {"meta"};
  for (std::sregex_iterator m(html.begin(), html.end(), tag), end; m != end; ++m) {
    const std::string name = (*m)[2];
    if ((*m)[4].length() || single.count(name)) continue;
    if (!(*m)[1].length()) {
      open.push_back(name);
    } else {
      ASSERT_FALSE(open.empty()) << name;
      ASSERT_EQ(open.back(), name);
      open.pop_back();
    }
  }
  EXPECT_TRUE(open.empty());
}

TEST(Page, TakesTextAsTextAndStandsAlone) {
  Page page;
  page.section("a < b & \"c\"");
  page.claim({"1 <i>", "x", "y > 2", Verdict::kDiffers, "why & how"});
  page.figure("it's", {{"t [s]", "it's [m]", {{"o'clock", {0, 1, 2}, {0, 1, 0}, 0, false}}, false}},
              "ves & <b>");
  page.table({"h"}, {{"<b>"}});
  const std::string html = page.html("T", "L");
  EXPECT_EQ(html.find("<i>"), std::string::npos);
  EXPECT_EQ(html.find("<b>"), std::string::npos);
  EXPECT_NE(html.find("a &lt; b &amp; &quot;c&quot;"), std::string::npos);
  EXPECT_NE(html.find("<svg"), std::string::npos);
  for (const char* outside : {"<script", "src=", "@import", "<link"})
    EXPECT_EQ(html.find(outside), std::string::npos) << outside;
  expectBalanced(html);
}

TEST(Figure, ThinningKeepsThePeakOfALongLine) {
  Line line{"", {}, {}, 0, false};
  for (int i = 0; i < 50'000; ++i) {
    line.x.push_back(i);
    line.y.push_back(i == 31'415 ? 1.0 : 0.0);
  }
  const std::string flat = svg({{"x", "y", {{"", {0, 49'999}, {0, 0}, 0, false}}, false}});
  const std::string drawn = svg({{"x", "y", {line}, false}});
  const auto highest = [](const std::string& text) {  // of the curve: its smallest y in the picture
    const std::regex point(R"([ML]?(\d+\.\d+),(\d+\.\d+))");
    const std::size_t at = text.find("class=\"c0\"");
    const std::string path = text.substr(at, text.find("/>", at) - at);
    double y = 1e9;
    for (std::sregex_iterator m(path.begin(), path.end(), point), end; m != end; ++m)
      y = std::min(y, std::stod((*m)[2]));
    return y;
  };
  EXPECT_LT(drawn.size(), 40'000u);
  EXPECT_LT(highest(drawn), highest(flat) - 50.0);
}

// Two a row, equally large, beside and above each other; every curve fills the same share of its
// panel, whatever its numbers are.
TEST(Figure, PanelsStandApartAndShowAllOfTheirCurves) {
  std::vector<Panel> panels;
  for (const auto& [low, high] :
       {std::pair(0.0, 1.0), {-3.0, 5.0}, {1e3, 1e3 + 2.0}, {-7e-3, -1e-3}, {0.0, 40.0}})
    panels.push_back({"time", "y", {{"", {1.0, 2.0, 5.0}, {low, high, low}, 0, false}}, false});
  const std::string text = svg(panels);
  std::vector<Eigen::AlignedBox2d> curves;
  const std::regex point(R"([ML]?(\d+\.?\d*),(\d+\.?\d*))");
  for (std::size_t at = 0; (at = text.find("class=\"c0\"", at)) != std::string::npos; ++at) {
    const std::string path = text.substr(at, text.find("/>", at) - at);
    Eigen::AlignedBox2d box;
    for (std::sregex_iterator m(path.begin(), path.end(), point), end; m != end; ++m)
      box.extend(Eigen::Vector2d(std::stod((*m)[1]), std::stod((*m)[2])));
    if (!box.isEmpty()) curves.push_back(box);
  }
  ASSERT_EQ(curves.size(), panels.size());
  for (std::size_t k = 0; k < curves.size(); ++k) {
    EXPECT_NEAR(curves[k].sizes().x(), curves[0].sizes().x(), 1.0) << k;
    EXPECT_NEAR(curves[k].sizes().y(), curves[0].sizes().y(), 1.0) << k;
    EXPECT_NEAR(curves[k].min().x(), curves[k % 2].min().x(), 0.2) << k;
    if (k >= 2) {
      EXPECT_GT(curves[k].min().y(), curves[k - 2].max().y() + 40.0) << k;
    }
  }
  EXPECT_GT(curves[1].min().x(), curves[0].max().x() + 40.0);
  EXPECT_NEAR(curves[1].min().y(), curves[0].min().y(), 0.2);
  EXPECT_GT(curves[0].sizes().x(), 300.0);  // of 960 and 250
  EXPECT_GT(curves[0].sizes().y(), 120.0);
}

#ifndef VES_SANITIZE  // a quarter of a minute without, minutes with
/// The tables of a page, by rows and cells.
std::vector<std::vector<std::vector<std::string>>> tablesOf(const std::string& html) {
  std::vector<std::vector<std::vector<std::string>>> out;
  const std::regex row("<tr>(.*?)</tr>"), cell("<t[hd][^>]*>(.*?)</t[hd]>");
  for (std::size_t at = 0; (at = html.find("<table", at)) != std::string::npos;) {
    const std::size_t end = html.find("</table>", at);
    std::string text = html.substr(at, end - at);
    std::replace(text.begin(), text.end(), '\n', ' ');
    at = end;
    out.emplace_back();
    for (std::sregex_iterator r(text.begin(), text.end(), row), none; r != none; ++r) {
      const std::string cells = (*r)[1];
      out.back().emplace_back();
      for (std::sregex_iterator c(cells.begin(), cells.end(), cell); c != none; ++c)
        out.back().back().push_back((*c)[1]);
    }
  }
  return out;
}

/// What is said of the eight runs on the Shuttle's arm, beside the numbers of each.
void expectSaidAsMeasured(const Chapter4& chapter) {
  const auto& srms = chapter.summary["srms"];
  double full = 0.0, half = 0.0, split = 0.0, least = HUGE_VAL, most = 0.0, added = HUGE_VAL;
  std::vector<std::vector<std::string>> sizes, distances, attitudes, damping;
  const auto mm = [](double x) { return fmt::format("{:.2f}", x * 1e3); };
  const auto mrad = [](double x) { return fmt::format("{:.3f}", x * 1e3); };
  for (const auto& [name, one] : srms.items()) {
    if (!one.is_object()) continue;
    const double moved = one["displacement_max_m"], all = one["displacement_max_12_modes_m"],
                 soft = one["displacement_max_12_modes_half_stiffness_m"],
                 off = one["split_error_max_m"].get<double>() / moved;
    full = std::max(full, all);
    half = std::max(half, soft);
    split = std::max(split, off);
    if (name.ends_with("doss")) {
      least = std::min(least, all);
      most = std::max(most, soft);
    }
    sizes.push_back({std::to_string(one["modes_kept"].get<int>()), mm(moved), mm(all), mm(soft),
                     fmt::format("{:.2f}", 100.0 * off)});
    distances.push_back({mm(moved)});
    attitudes.push_back({mrad(one["rotation_max_rad"])});
    for (const std::string setting :
         {"none_space_quiet", "none_space_noisy", "none_earth_quiet", "none_earth_noisy",
          "outputs_space_quiet", "outputs_space_noisy", "outputs_earth_quiet",
          "outputs_earth_noisy"}) {
      const auto& run = one["ves"][setting];
      distances.back().push_back(mm(run["position_error_rms_m"]) + " / " +
                                 mm(run["position_error_max_m"]));
      attitudes.back().push_back(mrad(run["attitude_error_rms_rad"]) + " / " +
                                 mrad(run["attitude_error_max_rad"]));
    }
    for (const auto& mode : one["modes"]) {
      damping.push_back({fmt::format("{:.3f}", mode["frequency_hz"].get<double>()),
                         fmt::format("{:.4f}", mode["damping_ratio"].get<double>())});
      for (const char* filters : {"ves_none", "ves_outputs"}) {
        const double more = mode[filters]["damping_ratio_added"];
        added = std::min(added, more);
        EXPECT_NEAR(
            more,
            mode[filters]["damping_ratio"].get<double>() - mode["damping_ratio"].get<double>(),
            1e-12);
        damping.back().push_back(
            fmt::format("{:.3f}", mode[filters]["frequency_hz"].get<double>()));
        damping.back().push_back(fmt::format("{:+.4f}", more));
      }
    }
  }
  const auto says = [&](const std::string& where, const std::string& what) {
    for (const auto& claim : chapter.summary["claims"])
      if (claim["where"] == where) {
        EXPECT_NE(claim["reached"].get<std::string>().find(what), std::string::npos)
            << claim["reached"] << " and not " << what;
      }
  };
  says("5",
       fmt::format("{:.1f} cm with stiffness_scale 1, {:.1f} cm with 0.5", 100 * full, 100 * half));
  says("4.3, figures 4.19 to 4.26", fmt::format("{:.1f} to {:.1f} cm", 100 * least, 100 * most));
  says("4.3", fmt::format("at most {:.2f} percent", 100 * split));
  says("4.3, figures 4.11 to 4.18", fmt::format("damping ratio {:+.4f}", added));
  // The rows of a table without their titles.
  const auto tables = tablesOf(chapter.html);
  const auto expectTable = [&](const std::string& second, const std::string& third,
                               const std::vector<std::vector<std::string>>& rows) {
    const auto at = std::find_if(tables.begin(), tables.end(), [&](const auto& table) {
      return table[0].size() > 2 && table[0][1] == second && table[0][2] == third;
    });
    ASSERT_NE(at, tables.end()) << second;
    auto found = *at;
    found.erase(found.begin());
    for (auto& row : found) row.erase(row.begin());
    EXPECT_EQ(found, rows) << second;
  };
  expectTable("modes kept", "those modes", sizes);
  expectTable("displacement", "none, space", distances);
  expectTable("rotation", "none, space", attitudes);
  expectTable("SRMS-robot [Hz]", "zeta", damping);
}

/// A leg in the frequency domain, in its own way: a LegSlave (2.16) that reads in the mean half a
/// reading ago and holds its current for three, a valve and a piston (2.17).
void expectServosLagAsTheirLoopSays(const Chapter4& chapter) {
  using namespace std::complex_literals;
  const plant::PlantConfig p = test::experiment("z_sine").plant;
  const double reading = static_cast<double>(kTransducerPeriod) * 1e-9;
  const double amperes = plant::LegSlave::kVoltsPerDigit * plant::LegSlave::kAmperesPerVolt /
                         (256.0 * p.transducer.scale);  // [A/m] of a gain of one
  const auto phase = [&](double K, double w) {
    const std::complex<double> s = 1i * w;
    const std::complex<double> hold = std::exp(-1.5 * reading * s),
                               late = std::exp(-0.5 * reading * s);
    const std::complex<double> to_velocity = K * amperes * hold / (p.actuator.tau * s + 1.0);
    const std::complex<double> back =
        late *
        (double(p.leg_slave.K_P) + double(p.leg_slave.K_D) * (1.0 - std::exp(-12.0 * reading * s)));
    return std::arg(to_velocity * double(p.leg_slave.K_P) / (s + to_velocity * back));
  };
  const auto lag = [&](double K) {   // [Hz] where the answer is 90 degrees behind
    double low = 0.1, high = 100.0;  // [rad/s]
    for (int i = 0; i < 60; ++i) {
      const double w = 0.5 * (low + high), at = phase(K, w);
      (at > -0.5 * M_PI && at < 0.5 ? low : high) = w;
    }
    return low / (2.0 * M_PI);
  };
  const auto& servo = chapter.summary["servo"];
  const double extending = servo["quarter_period_lag_extending_hz"],
               retracting = servo["quarter_period_lag_retracting_hz"];
  EXPECT_NEAR(extending, lag(p.actuator.gain_extend), 0.01 * extending);
  EXPECT_NEAR(retracting, lag(p.actuator.gain_retract), 0.01 * retracting);
  for (const auto& claim : chapter.summary["claims"])
    if (claim["where"] == "2.4") {
      EXPECT_EQ(claim["reached"],
                fmt::format("90 degrees behind at {:.1f} Hz extending, {:.1f} Hz retracting",
                            extending, retracting));
    }
}

/// Numbers of one run that two sections have worked out, each in its own way.
void expectSaidAlike(const Chapter4& chapter) {
  const auto numbers = [&](const std::string& where) {
    std::vector<std::string> out;
    for (const auto& claim : chapter.summary["claims"])
      if (claim["where"] == where) {
        const std::string reached = claim["reached"];
        const std::regex number("[0-9]+\\.[0-9]+");
        for (std::sregex_iterator m(reached.begin(), reached.end(), number), end; m != end; ++m)
          out.push_back(m->str());
      }
    return out;
  };
  const auto lag = numbers("4.2.1, figures 4.4 and 4.5"), error = numbers("4.2.1, figure 4.5");
  ASSERT_GE(std::min(lag.size(), error.size()), 2u);
  EXPECT_EQ(error[0], lag[0]);
  EXPECT_EQ(error[1], lag[1]);
}

TEST(Chapter4, EveryClaimHasItsVerdict) {
  const fs::path folder = fs::temp_directory_path() / ("ves_chapter4_" + std::to_string(getpid()));
  fs::create_directories(folder);
  int runs_told = 0;
  const Chapter4 chapter = reproduceChapter4(
      test::configDir(), folder, 2,
      [&](const std::string&, int run, int, int) { EXPECT_EQ(run, ++runs_told); });
  EXPECT_GT(runs_told, 200);
  EXPECT_TRUE(fs::is_empty(folder));
  fs::remove_all(folder);
  expectBalanced(chapter.html);
  EXPECT_EQ(chapter.html.find("could not draw"), std::string::npos);
  EXPECT_EQ(chapter.html.find("nan"), std::string::npos);

  // The verdicts that README and the guides speak of; config/claims.yaml has the ranges.
  const std::map<std::string, std::string> expected = {
      {"4.1.1, figure 4.1", "agrees"},
      {"4.1.2, figures 4.2 and 4.3", "cannot be judged"},
      {"2.4", "agrees"},
      {"4.2.1, figures 4.4 and 4.5", "agrees"},
      {"4.2.1, figure 4.5", "a range"},
      {"4.2.1, figures 4.6 and 4.7", "a range"},
      {"4.2.2, figures 4.8 to 4.10", "a range"},
      {"4.3, figures 4.11 to 4.18", "differs"},
      {"4.3, figures 4.19 to 4.26", "cannot be judged"},
      {"4.3", "agrees"},
      {"5", "cannot be judged"},
      {"E, figure E.4", "agrees"},
      {"E.18 to E.20", "cannot be judged"},
      {"B", "agrees"}};
  int judged = 0;
  for (const auto& claim : chapter.summary["claims"]) {
    const std::string where = claim["where"];
    ++judged;
    EXPECT_EQ(claim["verdict"], where == "2.3" ? "agrees" : expected.at(where))
        << where << ": " << claim["reached"];
  }
  EXPECT_EQ(judged, static_cast<int>(expected.size()) + 2);  // 2.3 makes two
  const auto& srms = chapter.summary["srms"];
  int runs = 0;
  for (const auto& [name, value] : srms.items()) {
    if (!value.is_object()) continue;
    ++runs;
    EXPECT_EQ(value["ves"].size(), 8u);
    for (const auto& [setting, run] : value["ves"].items())
      EXPECT_EQ(run["ended"], "parked") << name << setting;
    for (const auto& mode : value["modes"]) {
      EXPECT_GT(mode["ves_none"]["damping_ratio_added"], 0.0) << name;
      EXPECT_GT(mode["ves_outputs"]["damping_ratio_added"], 0.0) << name;
    }
  }
  EXPECT_EQ(runs, 8);
  expectSaidAsMeasured(chapter);
  expectServosLagAsTheirLoopSays(chapter);
  expectSaidAlike(chapter);
  EXPECT_EQ(chapter.summary["divergence"]["ended"], "stopped");
}
#endif

}  // namespace
}  // namespace ves
