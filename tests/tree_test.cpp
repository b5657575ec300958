// SPDX-License-Identifier: BSD-3-Clause
//
// Robots that are trees: branches, grippers, joints that follow others, joints that are held.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <random>

#include "support/refusal.hpp"
#include "support/rig.hpp"
#include "support/robots.hpp"
#include "support/trees.hpp"
#include "ves/control/gravity_compensation.hpp"
#include "ves/identification/mass_parameters.hpp"
#include "ves/robot/newton_euler.hpp"
#include "ves/run/run.hpp"

namespace ves {
namespace {

using test::kG;

/// A tree that nobody designed: every link on any earlier one, some fixed, some that follow.
std::string anyTree(unsigned seed, int links = 14) {
  std::mt19937 random(seed);
  const auto u = [&](double lo, double hi) {
    return std::uniform_real_distribution<double>(lo, hi)(random);
  };
  std::string text = "<robot name=\"tree\">\n";
  std::vector<std::string> masters;
  for (int i = 0; i < links; ++i) {
    const double a = u(0.1, 0.2), b = u(0.1, 0.2), c = u(0.15, 0.25);
    text += fmt::format(
        "<link name=\"l{}\"><inertial><origin xyz=\"{} {} {}\" rpy=\"{} {} {}\"/><mass "
        "value=\"{}\"/><inertia ixx=\"{}\" iyy=\"{}\" izz=\"{}\" ixy=\"0.01\" ixz=\"-0.02\" "
        "iyz=\"0.015\"/></inertial></link>\n",
        i, u(-0.2, 0.2), u(-0.2, 0.2), u(-0.2, 0.2), u(-1, 1), u(-1, 1), u(-1, 1), u(0.5, 3), a, b,
        c);
    if (i == 0) continue;
    const double kind = u(0, 1);
    const bool fixed = kind < 0.15, follows = !fixed && kind > 0.8 && !masters.empty();
    const std::string name = fmt::format("j{}", i);
    text += fmt::format(
        "<joint name=\"{}\" type=\"{}\"><parent link=\"l{}\"/><child link=\"l{}\"/><origin "
        "xyz=\"{} "
        "{} {}\" rpy=\"{} {} {}\"/><axis xyz=\"{} {} {}\"/><limit lower=\"-3\" upper=\"3\" "
        "effort=\"1\" velocity=\"1\"/>{}</joint>\n",
        name, fixed ? "fixed" : (i % 4 == 3 ? "prismatic" : "revolute"),
        static_cast<int>(u(0, i - 1e-9)), i, u(-0.5, 0.5), u(-0.5, 0.5), u(-0.5, 0.5), u(-2, 2),
        u(-2, 2), u(-2, 2), u(-1, 1), u(-1, 1), u(0.1, 1),
        follows
            ? fmt::format("<mimic joint=\"{}\" multiplier=\"{}\" offset=\"{}\"/>",
                          masters[static_cast<std::size_t>(u(0, double(masters.size()) - 1e-9))],
                          u(-2, 2), u(-0.5, 0.5))
            : "");
    if (!fixed && !follows) masters.push_back(name);
  }
  return text + "</robot>\n";
}

class Tree : public testing::TestWithParam<unsigned> {
 protected:
  const std::string text = anyTree(GetParam());
  const UrdfTree tree{text, "tree.urdf"};
  const UrdfRobot robot = loadUrdf(text, "tree.urdf");
};

TEST_P(Tree, JointEffortsAreKdls) {
  EXPECT_LT(test::offFromKdl(tree, text, robot, GetParam()), 1e-12);
}

TEST_P(Tree, WrenchIsTheRateOfMomentum) {
  EXPECT_LT(test::offFromMomentum(robot.model, GetParam()), 1e-9);
}

TEST_P(Tree, AtRestCompensationRegressorAndNewtonEulerAgree) {
  std::mt19937 random(GetParam());
  Payload payload;
  payload.robot = robot.model;
  for (int k = 0; k < 20; ++k) {
    const JointVector q = test::anyState(robot.model.joints, random).q;
    const Mat3 R = rotation({0.3, -0.5, 0.1 * k});
    const Vec3 g(0.0, 0.0, -kG);
    const Vec6 felt = staticWrench(payload, q, R, g).stacked();
    ProperMotion still;
    still.a = -(R.transpose() * g);
    JointState s;
    s.q = q;
    EXPECT_LT((felt + newtonEuler(robot.model, s, still).F_L0o_L0.stacked()).norm(), 1e-10);
    EXPECT_LT((felt -
               staticRegressor(robot.model, {}, q, R.transpose() * g) * massParameters(robot.model))
                  .norm(),
              1e-10);
    const RigidBody all = compositeBody(robot.model, q);
    EXPECT_LT((all.mass * R.transpose() * g - felt.head<3>()).norm(), 1e-10);
  }
}

TEST_P(Tree, HeldJointsWeighWhatStandingOnesWeigh) {
  std::mt19937 random(GetParam());
  const JointVector q = test::anyState(robot.model.joints, random).q;
  std::map<std::string, double> held;
  std::set<std::string> moving;
  for (int i = 0; i < robot.model.joints; ++i) {
    const std::string& name = robot.joint_names[static_cast<std::size_t>(i)];
    if (i % 2)
      held[name] = q(i);
    else
      moving.insert(name);
  }
  const UrdfRobot fewer = tree.robot(moving, held);
  EXPECT_EQ(fewer.model.joints, static_cast<int>(moving.size()));
  JointVector rest = JointVector::Zero();
  for (int i = 0; i < fewer.model.joints; ++i)
    rest(i) = q(std::find(robot.joint_names.begin(), robot.joint_names.end(),
                          fewer.joint_names[static_cast<std::size_t>(i)]) -
                robot.joint_names.begin());
  const RigidBody a = compositeBody(robot.model, q), b = compositeBody(fewer.model, rest);
  EXPECT_NEAR(a.mass, b.mass, 1e-12);
  EXPECT_LT((a.p_BoBcm_B - b.p_BoBcm_B).norm(), 1e-12);
  EXPECT_LT((a.I_Bcm_B - b.I_Bcm_B).norm(), 1e-11);
  // Every frame stands where it stood.
  const LinkPoses X = linkPoses(robot.model, q), Y = linkPoses(fewer.model, rest);
  ASSERT_EQ(robot.frames.size(), fewer.frames.size());
  for (std::size_t i = 0; i < robot.frames.size(); ++i) {
    const Transform was = robot.frames[i].pose(X), is = fewer.frames[i].pose(Y);
    EXPECT_LT((was.p - is.p).norm() + (was.R - is.R).norm(), 1e-12) << robot.frames[i].name;
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, Tree, testing::Range(1u, 11u));

// --- What is asked of a description --------------------------------------------------------------

constexpr const char* kGripper = R"(<robot name="r">
<link name="base"/><link name="arm"/><link name="left"/><link name="right"/><link name="tool"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
 <limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
<joint name="open" type="prismatic"><parent link="arm"/><child link="left"/><axis xyz="0 1 0"/>
 <limit lower="0.01" upper="0.04" effort="1" velocity="1"/></joint>
<joint name="other" type="prismatic"><parent link="arm"/><child link="right"/><axis xyz="0 1 0"/>
 <limit lower="-0.04" upper="-0.01" effort="1" velocity="1"/><mimic joint="open" multiplier="-1"/></joint>
<joint name="flange" type="fixed"><parent link="arm"/><child link="tool"/></joint>
</robot>)";

UrdfRobot chosen(const std::string& keys) {
  const Value document = parseDocument(keys, "robot.yaml");
  Section s(document, "robot");
  return chosenRobot(s, UrdfTree(kGripper, "r.urdf"));
}

TEST(Chosen, AllJointsUnlessSomethingIsSaid) {
  const UrdfRobot robot = chosen("{}");
  EXPECT_EQ(robot.joint_names, (std::vector<std::string>{"turn", "open"}));
  EXPECT_EQ(robot.model.size, 3);
  EXPECT_TRUE(robot.held.empty());
  EXPECT_EQ(robot.choice,
            "all 2 joints of the robot move: turn, open (tip, joints or lock would choose)");
  EXPECT_EQ(chosen("joints: [turn, open]").choice, "");
}

TEST(Chosen, ATipMovesByWhatCarriesIt) {
  const UrdfRobot robot = chosen("tip: tool");
  EXPECT_EQ(robot.joint_names, (std::vector<std::string>{"turn"}));
  // Zero is outside the range of `open`: the limit next to it; `other` follows.
  EXPECT_EQ(robot.held,
            (std::vector<std::string>{"joint 'open' at 0.01 m", "joint 'other' at -0.01 m"}));
}

TEST(Chosen, AHeldMasterHoldsWhatFollows) {
  const UrdfRobot robot = chosen("lock: {open: 0.03}");
  EXPECT_EQ(robot.joint_names, (std::vector<std::string>{"turn"}));
  EXPECT_EQ(robot.held.at(1), "joint 'other' at -0.03 m");
  for (const NamedFrame& f : robot.frames) {
    if (f.name == "right") {
      EXPECT_NEAR(f.X_link.p.y(), -0.03, 1e-15);
    }
  }
}

TEST(Chosen, RefusesInOneLine) {
  const auto said = [](const std::string& keys) { return test::refusal([&] { chosen(keys); }); };
  EXPECT_EQ(said("tip: hand"), "robot.yaml:1: robot.tip: the robot has no link 'hand'");
  EXPECT_EQ(said("joints: [elbow]"),
            "robot.yaml:1: robot.joints: no joint 'elbow' that moves, want of turn, open");
  EXPECT_EQ(said("joints: [turn, turn]"), "robot.yaml:1: robot.joints: 'turn' is given twice");
  EXPECT_EQ(said("joints: [other]"),
            "robot.yaml:1: robot.joints: joint 'other' follows 'open', want that one");
  EXPECT_EQ(said("lock: {elbow: 1}"),
            "robot.yaml:1: robot.lock: no joint 'elbow' that moves, want of turn, open");
  EXPECT_NE(
      said("lock: {open: 0.05}").find("robot.lock.open: '0.05', want a number in [0.01, 0.04]"),
      std::string::npos)
      << said("lock: {open: 0.05}");
  EXPECT_NE(said("lock: {turn: .nan}").find("robot.lock.turn"), std::string::npos);
  EXPECT_EQ(said("{joints: [turn], lock: {turn: 0}}"),
            "robot.yaml:1: robot.lock.turn: joints lets it move, want one of the two");
  EXPECT_EQ(said("{joints: [turn], tip: tool}"),
            "robot.yaml:1: robot.joints: and tip both say it, want one of them");
}

TEST(Chosen, MoreThanTwelveWantAChoice) {
  std::string text = "<robot name=\"r\"><link name=\"l0\"/>";
  for (int i = 1; i <= 13; ++i)
    text += fmt::format(
        "<link name=\"l{}\"/><joint name=\"j{}\" type=\"continuous\"><parent link=\"l{}\"/><child "
        "link=\"l{}\"/><axis xyz=\"0 0 1\"/></joint>",
        i, i, i - 1, i);
  text += "</robot>";
  const auto with = [&](const std::string& keys) {
    const Value document = parseDocument(keys, "robot.yaml");
    Section s(document, "robot");
    return chosenRobot(s, UrdfTree(text, "r.urdf")).model.joints;
  };
  EXPECT_NE(test::refusal([&] { with("{}"); }).find("13 joints move, at most 12 may: say which"),
            std::string::npos);
  EXPECT_EQ(with("lock: {j1: 10}"), 12);
  EXPECT_EQ(with("tip: l5"), 5);
  EXPECT_NE(test::refusal([&] { loadUrdf(text, "r.urdf"); }).find("one too many"),
            std::string::npos);
}

TEST(UrdfTree, RefusesJointsThatFollowNobodyOrThemselves) {
  const auto said = [](std::string text, const std::string& from, const std::string& to) {
    text.replace(text.find(from), from.size(), to);
    return test::refusal([&] { loadUrdf(text, "r.urdf"); });
  };
  EXPECT_EQ(said(kGripper, "mimic joint=\"open\"", "mimic joint=\"gone\""),
            "r.urdf:7: joint 'other': follows 'gone', which is no joint that moves");
  EXPECT_EQ(said(kGripper, "mimic joint=\"open\"", "mimic joint=\"flange\""),
            "r.urdf:7: joint 'other': follows 'flange', which is no joint that moves");
  EXPECT_EQ(said(kGripper, "mimic joint=\"open\"", "mimic joint=\"other\""),
            "r.urdf:7: joint 'other': follows itself");
  EXPECT_NE(said(kGripper, "multiplier=\"-1\"", "multiplier=\"1e9\"").find("want a number within"),
            std::string::npos);
}

TEST(UrdfTree, WhoFollowsAFollowerFollowsItsMaster) {  // 0.5 (-2 q + 0.3) + 0.1 = -q + 0.25
  const auto joint = [](const std::string& name, const std::string& child,
                        const std::string& mimic) {
    return fmt::format(
        "<link name=\"{}\"/><joint name=\"{}\" type=\"continuous\"><parent link=\"base\"/><child "
        "link=\"{}\"/><axis xyz=\"0 0 1\"/>{}</joint>",
        child, name, child, mimic);
  };
  const UrdfTree tree(
      "<robot name=\"r\"><link name=\"base\"/>" +
          joint("third", "c", "<mimic joint=\"second\" multiplier=\"0.5\" offset=\"0.1\"/>") +
          joint("second", "b", "<mimic joint=\"first\" multiplier=\"-2\" offset=\"0.3\"/>") +
          joint("first", "a", "") + "</robot>",
      "r.urdf");
  EXPECT_EQ(tree.find("third")->follows, "first");
  EXPECT_DOUBLE_EQ(tree.find("third")->ratio, -1.0);
  EXPECT_DOUBLE_EQ(tree.find("third")->offset, 0.25);
  EXPECT_DOUBLE_EQ(tree.find("second")->offset, 0.3);
}

TEST(UrdfTree, RunsAsAnyRobot) {
  const std::string file =
      (std::filesystem::temp_directory_path() / fmt::format("ves_tree_{}.urdf", getpid())).string();
  const std::string text = anyTree(3, 8);
  std::ofstream(file) << text;
  const std::size_t joints = UrdfTree(text, file).jointsTo("l7").size();
  ASSERT_GT(joints, 0u);
  std::string zeros = "0";
  for (std::size_t i = 1; i < joints; ++i) zeros += ", 0";
  const Experiment e = test::experiment(
      "puma_tilt", {"robot.urdf=" + file, "robot.tip=l7", "robot.joints_deg_or_m=[" + zeros + "]"});
  std::filesystem::remove(file);
  EXPECT_EQ(e.controller.payload.robot.joints, static_cast<int>(joints));
  EXPECT_TRUE(runLockstep(e, nullptr, nullptr).good());
}

}  // namespace
}  // namespace ves
