// SPDX-License-Identifier: BSD-3-Clause
//
// What a page is told: bodies, frames and their poses. tests/browser reads back what it draws.
#include <gtest/gtest.h>

#include <set>

#include "support/rig.hpp"
#include "ves/results/tool_motion.hpp"
#include "ves/view/page.hpp"
#include "ves/view/scene.hpp"

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
