// SPDX-License-Identifier: BSD-3-Clause
//
// Sweeps: what a run is depends on its number alone.
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <sstream>

#include "support/programs.hpp"
#include "support/refusal.hpp"
#include "support/robots.hpp"
#include "ves/sweep/sweep.hpp"

namespace ves {
namespace {

using test::fs::path;

std::vector<std::map<std::string, std::string>> rows(const path& file) {
  std::ifstream in(file);
  std::string line, cell;
  std::vector<std::string> names;
  std::vector<std::map<std::string, std::string>> out;
  while (std::getline(in, line)) {
    std::istringstream cells(line + ",");
    std::vector<std::string> all;
    while (std::getline(cells, cell, ',')) all.push_back(cell);
    if (names.empty()) {
      names = all;
      continue;
    }
    out.emplace_back();
    for (std::size_t i = 0; i < names.size() && i < all.size(); ++i) out.back()[names[i]] = all[i];
  }
  return out;
}

TEST(SweepPlan, GoesThroughEveryCombination) {
  SweepPlan plan;
  plan.vary("a.b=1:2:3");
  plan.vary("c=x,[1, 2]");
  plan.repeat(2);
  EXPECT_EQ(plan.size(), 12);
  std::set<std::string> seen;
  for (int run = 0; run < plan.size(); ++run) {
    const std::vector<std::string> o = plan.overrides(run);
    ASSERT_EQ(o.size(), 3u);
    seen.insert(o[0] + " " + o[1] + " " + o[2]);
    EXPECT_EQ(o, plan.overrides(run));
  }
  EXPECT_EQ(seen.size(), 12u);
  EXPECT_EQ(plan.overrides(0)[0], "a.b=1");
  EXPECT_EQ(plan.overrides(2)[0], "a.b=1.5");
  EXPECT_EQ(plan.overrides(11)[1], "c=[1, 2]");
}

TEST(SweepPlan, DrawsAreUniformAndOfTheSeedAndTheRunAlone) {
  SweepPlan plan, same, other;
  for (SweepPlan* p : {&plan, &same, &other}) {
    p->draw("k=-2:4");
    p->draw("l=-2:4");
    p->repeat(20000);
  }
  other.seed(2);
  double mean = 0.0, square = 0.0, product = 0.0;
  int different = 0;
  for (int run = 0; run < 20000; ++run) {
    const auto o = plan.overrides(run);
    EXPECT_EQ(o, same.overrides(run));
    different += o[0] != other.overrides(run)[0];
    const double k = std::stod(o[0].substr(2)), l = std::stod(o[1].substr(2));
    EXPECT_GE(k, -2.0);
    EXPECT_LE(k, 4.0);
    mean += k / 20000.0;
    square += (k - 1.0) * (k - 1.0) / 20000.0;
    product += (k - 1.0) * (l - 1.0) / 20000.0;
  }
  EXPECT_EQ(different, 20000);
  EXPECT_NEAR(mean, 1.0, 0.06);   // five deviations of a mean of so many
  EXPECT_NEAR(square, 3.0, 0.1);  // 6^2 / 12
  EXPECT_NEAR(product, 0.0, 0.11);
}

TEST(SweepPlan, DrawsWholeNumbersWithBothEndsWhereNothingElseIsTaken) {
  SweepPlan plan;
  plan.draw("seed=3:6");
  plan.draw("plant_mismatch.mass=1:2");
  plan.repeat(4000);
  plan.drawWhole([](const std::string& key) { return key == "seed"; });
  std::map<std::string, int> seen;
  int between = 0;
  for (std::int64_t run = 0; run < plan.size(); ++run) {
    const auto set = plan.overrides(run);
    ++seen[set[0]];
    between += set[1].find('.') != std::string::npos ? 1 : 0;
  }
  EXPECT_EQ(seen.size(), 4u);
  for (const auto& [one, times] : seen) EXPECT_NEAR(times, 1000, 120) << one;  // 4 deviations
  EXPECT_TRUE(seen.count("seed=3") && seen.count("seed=6"));
  EXPECT_GT(between, 3900);
  SweepPlan fraction;
  fraction.draw("seed=1:2.5");
  EXPECT_NE(test::refusal([&] {
              fraction.drawWhole([](const std::string&) { return true; });
            }).find("whole"),
            std::string::npos);
}

TEST(SweepPlan, RefusesByName) {
  SweepPlan plan;
  plan.vary("a=1,2");
  for (const char* bad : {"", "a", "=1,2", "b=", "b=1,,2", "b=1:2", "b=1:2:1", "b=1:2:2.5",
                          "b=1:nan:3", "b=1:2:3:4", "a=3,4"})
    EXPECT_THROW(plan.vary(bad), InputError) << bad;
  for (const char* bad : {"", "b", "b=1", "b=2:1", "b=nan:1", "b=1:inf", "b=1:2:3", "a=1:2"})
    EXPECT_THROW(plan.draw(bad), InputError) << bad;
  plan.vary("c=0:1:1000000");
  plan.repeat(100'000'000);
  EXPECT_THROW(plan.size(), InputError);
}

/// [-] of each key's range, 0 to 1, of the runs of one combination after another.
std::vector<std::vector<double>> shares(SweepDesign design, std::int64_t runs, std::uint64_t seed,
                                        int keys = 2) {
  SweepPlan plan;
  plan.vary("c=1,2");
  for (int i = 0; i < keys; ++i) plan.draw("k" + std::to_string(i) + "=0:1");
  plan.repeat(runs);
  plan.seed(seed);
  plan.lay(design);
  std::vector<std::vector<double>> out(static_cast<std::size_t>(keys));
  for (std::int64_t run = 0; run < plan.size(); ++run) {
    const std::vector<std::string> all = plan.overrides(run);
    for (std::size_t i = 0; i < out.size(); ++i) out[i].push_back(std::stod(all[i + 1].substr(3)));
  }
  return out;
}

TEST(SweepDesign, ALatinHypercubeHasOneDrawInEachPartOfEveryKey) {
  constexpr std::int64_t kRuns = 1000;
  const auto a = shares(SweepDesign::kLatin, kRuns, 1), b = shares(SweepDesign::kLatin, kRuns, 2);
  EXPECT_EQ(a, shares(SweepDesign::kLatin, kRuns, 1));
  int same = 0, in_order = 0;
  for (const auto& key : a)
    for (std::int64_t first : {std::int64_t{0}, kRuns}) {  // of each combination
      std::set<int> parts;
      for (std::int64_t i = first; i < first + kRuns; ++i) {
        const double x = key[static_cast<std::size_t>(i)];
        ASSERT_TRUE(x >= 0.0 && x < 1.0);
        parts.insert(static_cast<int>(kRuns * x));
        in_order += static_cast<int>(kRuns * x) == i - first;
      }
      EXPECT_EQ(parts.size(), static_cast<std::size_t>(kRuns));
    }
  // Keys, combinations and seeds have orders of their own: about one in a thousand agrees.
  double product = 0.0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(kRuns); ++i) {
    const auto part = [&](double x) { return static_cast<int>(kRuns * x); };
    same += (part(a[0][i]) == part(a[1][i])) + (part(a[0][i]) == part(b[0][i])) +
            (part(a[0][i]) == part(a[0][i + kRuns]));
    product += (a[0][i] - 0.5) * (a[1][i] - 0.5) * 12.0 / kRuns;
  }
  EXPECT_LT(same, 20);
  EXPECT_LT(in_order, 25);
  EXPECT_LT(std::abs(product), 5.0 / std::sqrt(kRuns));  // uncorrelated
}

TEST(SweepDesign, SobolsPointsLeaveNoBoxOut) {
  // Of 2^10 points the first two keys have one in each of 2^10 boxes, of whichever sides, and every
  // key one in each part of its range.
  constexpr std::int64_t kRuns = 1024;
  for (std::uint64_t seed : {1u, 7u}) {
    const auto x = shares(SweepDesign::kSobol, kRuns, seed, 5);
    for (std::size_t first : {std::size_t{0}, static_cast<std::size_t>(kRuns)}) {
      for (int k = 0; k <= 10; ++k) {
        std::set<std::pair<int, int>> boxes;
        for (std::size_t i = first; i < first + kRuns; ++i)
          boxes.insert({static_cast<int>(std::ldexp(x[0][i], k)),
                        static_cast<int>(std::ldexp(x[1][i], 10 - k))});
        EXPECT_EQ(boxes.size(), static_cast<std::size_t>(kRuns)) << k;
      }
      for (const auto& key : x) {
        std::set<int> parts;
        for (std::size_t i = first; i < first + kRuns; ++i)
          parts.insert(static_cast<int>(kRuns * key[i]));
        EXPECT_EQ(parts.size(), static_cast<std::size_t>(kRuns));
      }
    }
  }
  EXPECT_NE(shares(SweepDesign::kSobol, 8, 1), shares(SweepDesign::kSobol, 8, 2));
}

TEST(SweepDesign, RefusesWhatItCannotLay) {
  SweepPlan none;
  none.repeat(8);
  EXPECT_THROW(none.lay(SweepDesign::kLatin), InputError);
  SweepPlan many;
  for (int i = 0; i < 41; ++i) many.draw("k" + std::to_string(i) + "=0:1");
  many.repeat(8);
  EXPECT_THROW(many.lay(SweepDesign::kSobol), InputError);
  SweepPlan long_one;
  long_one.draw("k=0:1");
  long_one.repeat(1'000'000'000);
  EXPECT_THROW(long_one.lay(SweepDesign::kSobol), InputError);
}

Figure::Estimate estimate(const std::string& text, const std::vector<std::string>& column) {
  Figure figure(text);
  figure.find({"run", "a", "b"});
  for (const std::string& one : column) figure.add({"0", "7", one});
  return figure.estimate();
}

TEST(Figure, IsTheMeanWithItsInterval) {
  std::vector<std::string> column;
  for (int i = 1; i <= 100; ++i) column.push_back(std::to_string(i));
  column.insert(column.end(), {"", "nan", "refused"});
  const Figure::Estimate e = estimate("b", column);
  EXPECT_DOUBLE_EQ(e.value, 50.5);
  // The variance of 1..n is n (n + 1) / 12; 1.96 deviations of a mean of a hundred.
  const double half = 1.959964 * std::sqrt(100.0 * 101.0 / 12.0 / 100.0);
  EXPECT_NEAR(e.low, 50.5 - half, 1e-4);
  EXPECT_NEAR(e.high, 50.5 + half, 1e-4);
  EXPECT_EQ(e.of, 100);
  EXPECT_EQ(e.without, 3);
}

TEST(Figure, IsAProbabilityWithWilsonsInterval) {
  // Brown, Cai, DasGupta (2001), by hand: 0 of 10, 5 of 10, 10 of 10.
  const auto of = [](int hits) {
    std::vector<std::string> column(10, "1.0");
    std::fill_n(column.begin(), hits, "3.0");
    return estimate("b>2", column);
  };
  EXPECT_NEAR(of(0).low, 0.0, 1e-12);
  EXPECT_NEAR(of(0).high, 0.2775, 1e-4);
  EXPECT_NEAR(of(5).low, 0.2366, 1e-4);
  EXPECT_NEAR(of(5).high, 0.7634, 1e-4);
  EXPECT_NEAR(of(10).low, 0.7225, 1e-4);
  EXPECT_EQ(of(3).value, 0.3);
  EXPECT_DOUBLE_EQ(estimate("b<2", {"1", "2", "3"}).value, 1.0 / 3.0);
  EXPECT_NEAR(estimate("b<2", {}).low, 0.0, 1e-12);
  EXPECT_NEAR(estimate("b<2", {}).high, 1.0, 1e-12);
  for (const char* bad : {"", ">1", "b>", "b>x", "b>nan", "c"})
    EXPECT_THROW(estimate(bad, {}), InputError) << bad;
}

TEST(Figure, IsBeyondItsLimitOnTheSideThatIsAskedFor) {
  const auto beyond = [](const std::string& text, const std::string& cell) {
    Figure figure(text);
    figure.find({"a", "b"});
    return figure.beyond({"0", cell});
  };
  EXPECT_EQ(beyond("b>2", "3.5"), 1.5);
  EXPECT_EQ(beyond("b>2", "0.5"), -1.5);
  EXPECT_EQ(beyond("b<2", "3.5"), -1.5);
  EXPECT_EQ(beyond("b<2", "0.5"), 1.5);
  EXPECT_TRUE(std::isnan(beyond("b<2", "")));
}

TEST(Figure, HoldsWhereItSaysInNineteenOfTwenty) {
  // A drawn mass ratio above a limit, whose probability is known, from 0.3 to 0.01.
  for (const double p : {0.3, 0.1, 0.01}) {
    int inside = 0;
    constexpr int kSweeps = 400;
    for (int s = 0; s < kSweeps; ++s) {
      SweepPlan plan;
      plan.draw("k=0:1");
      plan.repeat(500);
      plan.seed(static_cast<std::uint64_t>(s));
      Figure figure(fmt::format("k<{}", p));
      figure.find({"k"});
      for (int run = 0; run < 500; ++run) figure.add({plan.overrides(run)[0].substr(2)});
      const Figure::Estimate e = figure.estimate();
      inside += e.low <= p && p <= e.high;
    }
    EXPECT_NEAR(inside / double{kSweeps}, 0.95, 0.04) << p;
  }
}

class Sweep : public test::Programs {
 protected:
  static constexpr const char* kRuns =
      "free_decay --set 'program=[{calibration: {}},{move: {to: {x_m: 0.01}}},"
      "{admittance: {duration_s: 1}}]' "
      "--vary legs.tau_s=0.005,0.0064,0.008 --draw plant_mismatch.gain_extend=0.95:1.05 --runs 4 ";
  test::Output sweep(const std::string& arguments) { return test::sh(app("sweep") + arguments); }
  std::string csv(const std::string& folder) {
    return test::readText((folder_ / folder / "sweep.csv").string());
  }
};

TEST_F(Sweep, RowsDoNotDependOnTheWorkersNorOnAKill) {
  ASSERT_EQ(sweep(kRuns + out("one") + "--workers 1").status, 0);
  ASSERT_EQ(sweep(kRuns + out("three") + "--workers 3").status, 0);
  const std::string all = csv("one");
  const auto alone = rows(folder_ / "one/sweep.csv");
  EXPECT_EQ(alone.size(), 12u);
  std::set<std::string> errors;
  for (auto row : alone) {
    EXPECT_EQ(row["ended"], "parked");
    errors.insert(row["x_error_max_m"]);
  }
  EXPECT_EQ(errors.size(), 12u);  // every draw is a run of its own
  EXPECT_EQ(all, csv("three"));

  // As a kill leaves it: some rows, out of order, the last one cut short.
  std::istringstream lines(all);
  std::vector<std::string> line(13);
  for (std::string& one : line) std::getline(lines, one);
  const path killed = folder_ / "three/sweep.csv";
  std::ofstream(killed) << line[0] << '\n'
                        << line[9] << '\n'
                        << line[2] << '\n'
                        << line[4].substr(0, 20);
  ASSERT_EQ(sweep(kRuns + out("three")).status, 0);
  EXPECT_EQ(csv("three"), all);
}

TEST_F(Sweep, EndsWhereItsFigureIsKnownWellEnough) {
  const std::string runs =
      "free_decay --set 'program=[{move: {to: {x_m: 0.001}}}]' --draw "
      "plant_mismatch.gain_extend=0.9:1.1 --runs 400 --figure 'plant_mismatch.gain_extend>1.05' ";
  const test::Output one = sweep(runs + "--until 0.07" + out("one") + "--workers 1");
  ASSERT_EQ(one.status, 0) << one.text;
  ASSERT_EQ(sweep(runs + "--until 0.07" + out("three") + "--workers 3").status, 0);
  EXPECT_EQ(csv("one"), csv("three"));
  const auto some = rows(folder_ / "one/sweep.csv");
  const std::size_t n = some.size();
  EXPECT_TRUE(n >= 100 && n < 400 && n % 50 == 0) << n;
  // By hand: sqrt(p (1 - p) / n) is within, and was not before.
  double hits = 0.0, before = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const bool hit = std::stod(some[i].at("plant_mismatch.gain_extend")) > 1.05;
    hits += hit;
    if (i < n - 50) before += hit;
  }
  const auto half = [](double count, double of) {
    return 1.96 * std::sqrt(count / of * (1.0 - count / of) / of);
  };
  const auto of = static_cast<double>(n);
  EXPECT_LT(half(hits, of), 0.072);
  if (n > 100) {
    EXPECT_GT(half(before, of - 50.0), 0.068);
  }
  EXPECT_NE(one.text.find(fmt::format("gain_extend>1.05: {:.4g}, ", hits / of)), std::string::npos)
      << one.text;
  // The same runs come first where more are asked for.
  ASSERT_EQ(sweep(runs + "--until 0.06" + out("one")).status, 0);
  EXPECT_GT(rows(folder_ / "one/sweep.csv").size(), n);
  EXPECT_EQ(csv("one").compare(0, csv("three").size(), csv("three")), 0);
}

TEST_F(Sweep, GoesOnInASubsetSimulationWhereItWasKilled) {
  const std::string runs =
      "free_decay --set 'program=[{move: {to: {x_m: 0.001}}}]' --draw "
      "plant_mismatch.gain_extend=0.9:1.1 --runs 100 --design subset --seed 3 "
      "--figure 'plant_mismatch.gain_extend>1.094' ";  // three in a hundred
  const test::Output one = sweep(runs + out("one") + "--workers 1");
  ASSERT_EQ(one.status, 0) << one.text;
  ASSERT_EQ(sweep(runs + out("three") + "--workers 3").status, 0);
  const std::string all = csv("one");
  EXPECT_EQ(all, csv("three"));
  const auto at = one.text.find("gain_extend>1.094: ");
  ASSERT_NE(at, std::string::npos) << one.text;
  EXPECT_GT(std::stod(one.text.substr(at + 19)), 0.014);
  EXPECT_LT(std::stod(one.text.substr(at + 19)), 0.06);
  EXPECT_NE(one.text.find(" in 2 levels"), std::string::npos) << one.text;
  std::ofstream(folder_ / "three/sweep.csv") << all.substr(0, all.size() * 2 / 3);
  const test::Output again = sweep(runs + out("three"));
  EXPECT_EQ(csv("three"), all);
  EXPECT_NE(again.text.find(one.text.substr(at)), std::string::npos) << again.text;
}

TEST_F(Sweep, OfOneLevelASubsetSimulationIsAShareAsAnyOther) {
  const test::Output all = sweep(
      "free_decay --set 'program=[{move: {to: {x_m: 0.001}}}]' --draw plant_mismatch.tau=0.9:1 "
      "--runs 100 --design subset --figure 'plant_mismatch.tau>0.5'" +
      out("a"));
  EXPECT_NE(all.text.find(": 1, 0.963 to 1 with 95 % confidence, of 100 runs in 1 level\n"),
            std::string::npos)
      << all.text;
}

TEST_F(Sweep, KnowsNothingOfAFigureThatFewRunsHave) {
  // A column that is empty in every row: nothing is known, however many rows there are.
  const test::Output o = sweep(
      "free_decay --set 'program=[{move: {to: {x_m: 0.001}}}]' --draw "
      "plant_mismatch.gain_extend=0.9:1.1 --runs 150 --figure contact_restitution --until 1" +
      out("s"));
  ASSERT_EQ(o.status, 0) << o.text;
  EXPECT_EQ(rows(folder_ / "s/sweep.csv").size(), 150u);
  EXPECT_NE(o.text.find("of 0 runs; 150 have none"), std::string::npos) << o.text;
  EXPECT_NE(o.text.find("not within 1: want more --runs"), std::string::npos) << o.text;
}

TEST_F(Sweep, DrawsOfAKeyOfWholeNumbersAreWhole) {
  const std::string still = "free_decay --set 'program=[{move: {to: {x_m: 0.001}}}]' --runs 12 ";
  const test::Output o = sweep(still + "--draw legs.K_P=9000:9003 --draw seed=1:9" + out("s"));
  ASSERT_EQ(o.status, 0) << o.text;
  for (const auto& row : rows(folder_ / "s/sweep.csv")) {
    EXPECT_EQ(row.at("ended"), "parked");
    EXPECT_EQ(row.at("legs.K_P").find('.'), std::string::npos) << row.at("legs.K_P");
  }
  EXPECT_EQ(sweep(still + "--draw seed=1:9.5" + out("r")).status, 2);
}

TEST_F(Sweep, RowIsWhatRunSaysOfTheSameValues) {
  ASSERT_EQ(sweep("z_sine --vary legs.K_P=8000,9000 --vary seed=3,4" + out("s")).status, 0);
  for (const auto& row : rows(folder_ / "s/sweep.csv")) {
    ASSERT_EQ(run("z_sine --lockstep --no-plots --overwrite --set legs.K_P=" + row.at("legs.K_P") +
                  " --seed " + row.at("seed") + out("r"))
                  .status,
              0);
    const auto s = summary(folder_ / "r");
    EXPECT_EQ(row.at("ended"), s["ended"]);
    for (const char* number : {"z_error_max_m", "z_error_rms_m", "simulated_s"})
      EXPECT_EQ(std::stod(row.at(number)), s[number].get<double>()) << number;
  }
}

// What the stability check says is found once for runs of one belief, and is right for each.
TEST_F(Sweep, VerdictsAreThoseOfEachRunAlone) {
  const std::string rest =
      " --set legs.filters=outputs --set 'program=[{calibration: {}},{admittance: {duration_s: "
      "1}}]' ";
  ASSERT_EQ(sweep("srms_deploy_doss --vary plant_mismatch.mass=0.9,1.1 --vary seed=3,4 --vary "
                  "base.keep_modes=2,6" +
                  rest + out("s"))
                .status,
            0);
  int refused = 0;
  for (const auto& row : rows(folder_ / "s/sweep.csv")) {
    std::string values = " --seed " + row.at("seed");
    for (const char* key : {"plant_mismatch.mass", "base.keep_modes"})
      values += std::string(" --set ") + key + "=" + row.at(key);
    const test::Output o =
        run("srms_deploy_doss --lockstep --no-plots --overwrite" + values + rest + out("r"));
    EXPECT_EQ(o.status, row.at("ended") == "refused" ? 2 : 0) << o.text;
    if (o.status != 0) {
      ++refused;
      const std::size_t why = o.text.find("the loop of"), end = o.text.find("; --force");
      ASSERT_TRUE(why < end && end != std::string::npos) << o.text;
      EXPECT_NE(csv("s").find(o.text.substr(why, end - why)), std::string::npos) << o.text;
      continue;
    }
    for (const char* number : {"emulation_error_rms_m", "x_peak_to_peak_m"})
      EXPECT_EQ(std::stod(row.at(number)), summary(folder_ / "r")[number].get<double>()) << number;
  }
  EXPECT_EQ(refused, 4);
}

TEST_F(Sweep, ProcessesOfMpirunShareTheRunsAndMeetInOneFile) {
  ASSERT_EQ(sweep(kRuns + out("one")).status, 0);
  const std::string folder = out("shared");
  for (const char* rank : {"1", "0", "2"})
    ASSERT_EQ(test::sh(std::string("OMPI_COMM_WORLD_SIZE=3 OMPI_COMM_WORLD_RANK=") + rank + " " +
                       app("sweep") + kRuns + folder)
                  .status,
              0);
  EXPECT_EQ(csv("shared"), csv("one"));
}

TEST_F(Sweep, SaysInTheRowWhatCouldNotRun) {
  ASSERT_EQ(sweep("srms_deploy_doss --vary base.keep_modes=2,6,3 --set legs.filters=outputs --set "
                  "'program=[{calibration: {}},{admittance: {duration_s: 1}}]'" +
                  out("s"))
                .status,
            0);
  const auto all = rows(folder_ / "s/sweep.csv");
  EXPECT_EQ(all.at(0).at("ended"), "parked");
  EXPECT_EQ(all.at(1).at("ended"), "refused");
  EXPECT_NE(csv("s").find("would diverge: "), std::string::npos);
  EXPECT_EQ(all.at(2).at("ended"), "parked");
  // Without a calibration the sensor's bias is a load that admittance control must not begin with.
  ASSERT_EQ(sweep("puma_on_table_4_1 --vary seed=1,2 --set 'program=[{admittance: {duration_s: "
                  "1}}]'" +
                  out("t"))
                .status,
            0);
  EXPECT_EQ(rows(folder_ / "t/sweep.csv").at(0).at("ended"), "aborted");
}

TEST_F(Sweep, AMotionThatACheckWouldStopIsARow) {
  const test::Output o = sweep("z_sine --vary safety.translation_m=0.1,0.3" + out("s"));
  ASSERT_EQ(o.status, 0) << o.text;
  EXPECT_NE(o.text.find("run 0: "), std::string::npos) << o.text;
  const auto all = rows(folder_ / "s/sweep.csv");
  EXPECT_EQ(all.at(0).at("ended"), "refused");
  EXPECT_NE(csv("s").find("motion limits check would stop the run"), std::string::npos);
  EXPECT_EQ(all.at(1).at("ended"), "parked");
}

TEST(Csv, AFieldIsReadAsItWasWritten) {
  for (const std::string text : {"", "1", "a,b", "say \"no\"", "\"\"", ",", "a\"b,\"c"}) {
    const std::vector<std::string> fields =
        csvFields(csvField("x,y") + "," + csvField(text) + "," + csvField("z"));
    ASSERT_EQ(fields.size(), 3u) << text;
    EXPECT_EQ(fields[0], "x,y");
    EXPECT_EQ(fields[1], text);
    EXPECT_EQ(fields[2], "z");
  }
  // A row is a line, whatever its fields say.
  EXPECT_EQ(csvField("two\nlines"), "\"two lines\"");
}

TEST(Csv, ColumnsAreSelectedByHowTheirNamesBegin) {
  std::vector<bool> used(2);
  EXPECT_FALSE(selected("leg1_measured_m", {"measured", "eg"}, used));
  EXPECT_TRUE(selected("t_s", {"measured", "eg"}, used));
  EXPECT_EQ(used, std::vector<bool>({false, false}));
  EXPECT_TRUE(selected("leg1_measured_m", {"leg1", "z_"}, used));
  EXPECT_EQ(used, std::vector<bool>({true, false}));
  EXPECT_TRUE(selected("anything", {}, used));
}

TEST_F(Sweep, RefusesByName) {
  const auto refused = [&](const std::string& arguments, const std::string& line) {
    const test::Output o = sweep(arguments);
    EXPECT_EQ(o.status, 2) << arguments;
    EXPECT_NE(o.text.find(line), std::string::npos) << o.text;
  };
  refused("z_sine" + out("s"), "one run only");
  refused("z_sine --vary seed=1,2 --until 0.1" + out("s"), "--until requires --figure");
  refused("z_sine --vary seed=1,2 --figure nothing" + out("s"), "--figure 'nothing': no such");
  refused("z_sine --vary seed=1,2 --figure 'z_err>1'" + out("s"),
          "--figure 'z_err>1': no such column, did you mean 'z_error_");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "s"));  // what is refused leaves nothing
  refused("z_sine --vary seed=1,2 --figure 'seed>x'" + out("s"), "--figure 'seed>x': want COLUMN");
  refused("z_sine --vary seed=1,2 --design sobol" + out("s"), "--design: places draws");
  refused("z_sine --vary seed=1,2 --design best" + out("s"), "--design");
  refused("z_sine --draw plant_mismatch.tau=0.9:1 --runs 4 --design latin --figure seed --until 1" +
              out("s"),
          "--until: a design has all of its runs");
  const std::string drawn = "z_sine --draw plant_mismatch.tau=0.9:1 --design subset ";
  refused(drawn + "--runs 100 --figure seed" + out("s"), "--design subset: want --figure");
  refused(drawn + "--runs 100 --figure 'ended>1'" + out("n"), "'ended' has words, want a column");
  refused(drawn + "--runs 100 --figure 'contacts>1'" + out("n2"),
          "'contacts>': no run has a number");
  const std::string two =
      "free_decay --set 'program=[{move: {to: {x_m: 0.001}}}]' --draw plant_mismatch.tau=0.9:1 "
      "--draw plant_mismatch.gain_extend=0.9:1 --runs 100 --design subset --figure ";
  ASSERT_EQ(sweep(two + "'plant_mismatch.tau>0.95'" + out("u")).status, 0);
  ASSERT_EQ(sweep(two + "'plant_mismatch.tau>0.97'" + out("u")).status, 0);
  refused(two + "'plant_mismatch.gain_extend>0.95'" + out("u"), "another sweep was begun here");
  refused(two + "'plant_mismatch.tau<0.95'" + out("u"), "another sweep was begun here");
  refused(drawn + "--runs 90 --figure 'seed>1'" + out("s"), "--runs 90 a level, want a multiple");
  refused(drawn + "--runs 100 --vary seed=1,2 --figure 'seed>1'" + out("s"), "want no --vary");
  refused("z_sine --vary legs.K_Q=1,2" + out("s"), "--vary legs.K_Q=1:1: legs.K_Q: unknown key");
  refused("z_sine --draw legs.K_Q=1:2 --runs 2" + out("s"), "ves sweep: --draw legs.K_Q=1.");
  refused("z_sine --vary safety.translation_m=0.1,0.11" + out("s"), "motion limits check would");
  refused("z_sine --vary legs.K_P=1,-2" + out("s"), "legs.K_P: '-2'");  // the last one, too
  refused("nothing --vary legs.K_P=1,2" + out("s"), "nothing");
  refused("z_sine --vary legs.K_P=1,2 --workers 0" + out("s"), "--workers");
  ASSERT_EQ(sweep("free_decay --vary seed=1,2" + out("s")).status, 0);
  refused("free_decay --vary seed=1,3" + out("s"), "another sweep was begun here");
  ASSERT_EQ(sweep("free_decay --vary seed=1,2,3" + out("t")).status, 0);
  refused("free_decay --vary seed=1,4,3" + out("t"), "another sweep was begun here");
  std::ofstream(folder_ / "t/sweep.csv", std::ios::app) << "1garbage\n";
  refused("free_decay --vary seed=1,2,3" + out("t"), "sweep.csv:5: no row of this sweep");
  refused("z_sine --vary seed=1,2" + out("s"), "another sweep was begun here");
}

}  // namespace
}  // namespace ves
