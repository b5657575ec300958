// SPDX-License-Identifier: BSD-3-Clause
//
// Sweeps: what a run is depends on its number alone.
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <sstream>

#include "support/programs.hpp"
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

TEST_F(Sweep, RefusesByName) {
  const auto refused = [&](const std::string& arguments, const std::string& line) {
    const test::Output o = sweep(arguments);
    EXPECT_EQ(o.status, 2) << arguments;
    EXPECT_NE(o.text.find(line), std::string::npos) << o.text;
  };
  refused("z_sine" + out("s"), "one run only");
  refused("z_sine --vary legs.K_Q=1,2" + out("s"), "legs.K_Q: unknown key");
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
