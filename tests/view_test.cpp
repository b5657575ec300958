// SPDX-License-Identifier: BSD-3-Clause
//
// What a page is told: bodies, frames and their poses. tests/browser reads back what it draws.
#include <gtest/gtest.h>

#include <unistd.h>

#include <cmath>
#include <set>

#include "support/refusal.hpp"
#include "support/rig.hpp"
#include "ves/results/tool_motion.hpp"
#include "ves/view/page.hpp"
#include "ves/view/scene.hpp"
#include "ves/view/web_server.hpp"

namespace ves {
namespace {

RecordedRun puma() {
  static const RecordedRun run = recordLockstep(test::experiment(
      "puma_on_table_4_1",
      {"program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 2}, robot: [{at_s: 0, "
       "duration_s: 1, joint: joint_2, to_deg_or_m: -60}]}]"}));
  return run;
}

/// A frame of a picture, by name.
Transform frameOf(const Scene& scene, const std::vector<float>& picture, const std::string& name) {
  const auto& frames = scene.description()["frames"];
  for (std::size_t k = 0; k < frames.size(); ++k) {
    if (frames[k]["name"] != name) continue;
    const float* p = picture.data() + 7 * k;
    return {Eigen::Quaterniond(p[6], p[3], p[4], p[5]).toRotationMatrix(), Vec3(p[0], p[1], p[2])};
  }
  ADD_FAILURE() << name;
  return {};
}

TEST(Scene, LegsReachFromJointToJoint) {
  const RecordedRun run = puma();
  const Experiment& e = run.series.experiment;
  const Scene scene(e);
  for (std::size_t k = 0; k < run.series.rows.size(); k += 50) {
    const Row& row = run.series.rows[k];
    const std::vector<float> picture = scene.picture(row, {});
    ASSERT_EQ(picture.size(), scene.width());
    const Transform X_IP = frameOf(scene, picture, "platform");
    EXPECT_LT((X_IP.p -
               Vec3(row.truth.x[0], row.truth.x[1], row.truth.x[2] + e.plant.geometry.home_height))
                  .norm(),
              1e-6);
    for (int i = 0; i < kLegs; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const Transform leg = frameOf(scene, picture, "leg" + std::to_string(i + 1)),
                      rod = frameOf(scene, picture, "rod" + std::to_string(i + 1));
      EXPECT_LT((leg.p - e.plant.geometry.p_IBi_I[at]).norm(), 1e-6);
      // The leg's z axis, as long as the leg, ends in the platform's joint.
      EXPECT_LT((leg.p + row.truth.leg[i] * leg.R.col(2) - rod.p).norm(), 2e-6);
      EXPECT_LT((X_IP * e.plant.geometry.p_PPi_P[at] - rod.p).norm(), 2e-6);
      EXPECT_LT((leg.R - rod.R).norm(), 1e-6);
    }
  }
}

TEST(Scene, TheToolIsAtTheEndOfTheLinks) {
  const RecordedRun run = puma();
  const Experiment& e = run.series.experiment;
  const Scene scene(e);
  const Row& row = run.series.rows.back();
  const std::vector<float> picture = scene.picture(row, {});
  const Transform tool = frameOf(scene, picture, "platform") * frameOf(scene, picture, "tool");
  const Transform due = toolPose(e, Vec6::Map(row.truth.x), JointVector::Map(row.truth.q));
  EXPECT_LT((tool.p - due.p).norm() + (tool.R - due.R).norm(), 3e-6);
  // Every shape is in a frame that is there, and every capsule begins where the one before ends.
  std::set<std::string> frames = {""};
  for (const auto& frame : scene.description()["frames"]) {
    EXPECT_TRUE(frames.count(frame["parent"])) << frame;
    frames.insert(frame["name"]);
  }
  for (const auto& shape : scene.description()["shapes"])
    EXPECT_TRUE(frames.count(shape["frame"])) << shape;
}

TEST(Scene, TheBaseIsThereInAdmittanceControlOnly) {
  const RecordedRun run = puma();
  const Scene scene(run.series.experiment);
  const std::vector<float> without = scene.picture(run.series.rows.front(), {});
  EXPECT_TRUE(std::isnan(without[7]));
  Vec6 base = Vec6::Zero();
  base(2) = 0.25;
  EXPECT_NEAR(scene.picture(run.series.rows.front(), base)[9],
              run.series.experiment.plant.geometry.home_height + 0.25, 1e-6);
}

TEST(Scene, TheArmEndsInThePlatformAndStandsAtItsRoot) {
  // Small displacements that the modes express: the arm's tip goes where the platform does.
  const Experiment e = test::experiment("srms_low_hover_puma");
  const Scene scene(e);
  const auto& points = scene.description()["arm"];
  ASSERT_EQ(points.size(), 22u);  // 21 beams: config/arms/srms.yaml
  const Vec3 home(0.0, 0.0, e.plant.geometry.home_height);
  EXPECT_LT((Vec3(points.back()[0], points.back()[1], points.back()[2]) - home).norm(), 1e-9);
  double length = 0.0;
  for (std::size_t i = 1; i < points.size(); ++i)
    length += (Vec3(points[i][0], points[i][1], points[i][2]) -
               Vec3(points[i - 1][0], points[i - 1][1], points[i - 1][2]))
                  .norm();
  EXPECT_NEAR(
      length,
      0.3048 + std::hypot(6.3767, 0.1524) + std::hypot(7.0599, 0.1524) + 0.4572 + 2 * 0.7112, 1e-6);
  const Eigen::VectorXd eta = Eigen::Vector3d(0.3, -0.2, 0.1);
  const Vec6 x = e.controller.admittance.Phi * eta;
  Row row;
  Vec6::Map(row.state.x_measured) = x;
  const std::vector<float> picture = scene.picture(row, {});
  const float* arm = picture.data() + 7 * scene.description()["frames"].size();
  EXPECT_LT(Vec3(arm[0], arm[1], arm[2]).norm(), 1e-12);
  const float* tip = arm + 3 * (points.size() - 1);
  EXPECT_GT(x.head<3>().norm(), 1e-3);
  EXPECT_LT((Vec3(tip[0], tip[1], tip[2]) - x.head<3>()).norm(), 1e-6);
}

TEST(Scene, WithoutAnArmThereIsNone) {
  const Scene scene(puma().series.experiment);
  EXPECT_TRUE(scene.description()["arm"].empty());
}

TEST(PageMessage, HasTwoWords) {
  using Kind = PageMessage::Kind;
  EXPECT_EQ(parsePageMessage("drawn")->kind, Kind::kDrawn);
  const auto stop = parsePageMessage("stop 12");
  EXPECT_EQ(stop->kind, Kind::kStop);
  EXPECT_EQ(stop->edition, 12);
  for (const char* text :
       {"", "drawn ", "Drawn", "stop", "stop ", "stop 0", "stop -1", "stop 1x", "stop +1",
        "stop 1 ", " stop 1", "stop 9223372036854775808", "stop 0x1", "start 1"})
    EXPECT_FALSE(parsePageMessage(text)) << text;
}

TEST(Listener, TakesAFreePortAndNamesWhatItCannot) {
  const Listener first = listenOn("127.0.0.1", 0), second = listenOn("127.0.0.1", 0);
  EXPECT_NE(first.port, second.port);
  EXPECT_NE(first.token, second.token);
  EXPECT_EQ(first.token.size(), 32u);
  EXPECT_EQ(inheritedListener(first.descriptor, "t").url(),
            fmt::format("http://127.0.0.1:{}/?token=t", first.port));
  const auto refused = [](const auto& act, const char* why) {
    EXPECT_NE(test::refusal(act).find(why), std::string::npos) << test::refusal(act);
  };
  refused([&] { listenOn("127.0.0.1", first.port); }, "in use");
  refused([] { listenOn("203.0.113.7", 0); }, "--bind 203.0.113.7");
  refused([] { listenOn("example.com", 0); }, "IPv4 address");
  refused([] { inheritedListener(0, "t"); }, "no socket that listens");
  close(first.descriptor);
  close(second.descriptor);
}

TEST(BaseMotion, IsKnownFromItsStartToItsEnd) {
  const RecordedRun run = puma();
  const auto emulated = emulation(run.series);
  ASSERT_TRUE(emulated);
  EXPECT_FALSE(emulated->at(-1));
  EXPECT_LT((*emulated->at(0) - commanded(run.series).x.front()).norm(), 1e-12);
  const auto last = std::ssize(emulated->base.x) - 1;
  EXPECT_TRUE(emulated->at(last));
  EXPECT_FALSE(emulated->at(last + 1));
  // Live, it begins where the platform is let go: the same motion.
  ReferenceMotions references;
  const auto live = baseMotion(run.series.experiment, commanded(run.series).x.front(), references);
  ASSERT_TRUE(live);
  EXPECT_EQ(*live->at(last), *emulated->at(last));
}

TEST(Page, BytesAreWrittenAsRfc4648Does) {
  // 0.0f is four zero bytes, 1.0f 00 00 80 3f.
  EXPECT_EQ(base64({}), "");
  EXPECT_EQ(base64({0.0f}), "AAAAAA==");
  EXPECT_EQ(base64({1.0f}), "AACAPw==");
  EXPECT_EQ(base64({1.0f, 1.0f}), "AACAPwAAgD8=");
  EXPECT_EQ(base64({1.0f, 1.0f, 1.0f}), "AACAPwAAgD8AAIA/");
}

TEST(Page, HasAPictureForEveryInstantThatCanBeSeen) {
  const RecordedRun run = puma();
  const auto shown = recording(run.series, 50.0);
  const std::size_t numbers = shown["pictures"].get<std::string>().size() / 4 * 3 / 4;
  const std::size_t pictures = numbers / shown["width"].get<std::size_t>();
  EXPECT_NEAR(static_cast<double>(pictures), 0.5 * static_cast<double>(run.series.rows.size()),
              2.0);
}

}  // namespace
}  // namespace ves
