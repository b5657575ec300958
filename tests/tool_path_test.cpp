// SPDX-License-Identifier: BSD-3-Clause
//
// The robot led by its tool, and what it takes in hand.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include <kdl/chainfksolverpos_recursive.hpp>
#include <random>

#include "support/refusal.hpp"
#include "support/rig.hpp"
#include "support/robots.hpp"
#include "ves/analysis/gate.hpp"
#include "ves/planning/tool_planner.hpp"
#include "ves/run/robot_orders.hpp"
#include "ves/run/run.hpp"
#include "ves/srms/interaction.hpp"

namespace ves {
namespace {

struct Arm {
  const char* name;
  std::vector<double> degrees;  // a pose far from singular ones
};
void PrintTo(const Arm& arm, std::ostream* out) { *out << arm.name; }
const Arm kPuma = {"puma560", {10, -60, 150, 20, 45, 30}};
const Arm kDoss = {"doss", {10, 20, -70, 80, 20, 30, 15}};

/// A robot of config with its planner, and KDL's opinion of where its tool is.
class ToolPath : public testing::TestWithParam<Arm> {
 protected:
  ToolPath() {
    for (std::size_t i = 0; i < GetParam().degrees.size(); ++i)
      q0(static_cast<Eigen::Index>(i)) = GetParam().degrees[i] * kDegree;
  }

  Transform tool(const JointVector& q) const {
    KDL::ChainFkSolverPos_recursive solver(chain);
    KDL::JntArray values(chain.getNrOfJoints());
    for (unsigned i = 0; i < values.rows(); ++i) values(i) = q(i);
    KDL::Frame at;
    solver.JntToCart(values, at);
    Transform X;
    for (int i = 0; i < 3; ++i) {
      X.p(i) = at.p(i);
      for (int k = 0; k < 3; ++k) X.R(i, k) = at.M(i, k);
    }
    return X;
  }

  JointTrajectory plan(const ToolGoal& goal) const { return planner.plan(q0, goal); }
  std::string refused(const ToolGoal& goal) const {
    return test::refusal([&] { plan(goal); });
  }

  const UrdfRobot robot = test::robot(GetParam().name);
  const KDL::Chain chain = test::kdlChain(GetParam().name);
  const NamedFrame& tip = robot.frames.back();
  const ToolPlanner planner{
      robot.model, tip.link, tip.X_link, JointVector::Constant(HUGE_VAL), robot.joint_names, 0.01};
  JointVector q0 = JointVector::Zero();
};

TEST_P(ToolPath, ALineIsStraightAndItsSpeedATrapezoid) {
  const Transform from = tool(q0);
  const Vec3 way = 0.3 * Vec3(0.2, 0.7, -0.5).normalized(), along = way.normalized();
  const JointTrajectory path = plan({{from.R, from.p + way}, {}, 0.0, 0.1});
  EXPECT_NEAR(path.duration(), 0.3 / (0.1 * 0.75), 1e-9);  // two ramps of a quarter each
  constexpr double h = 1e-3;                               // [s]
  double before = 0.0, most_step = 0.0;
  for (double t = 0.0; t <= path.duration(); t += h) {
    const Transform X = tool(path.at(t).q);
    const Vec3 off = X.p - from.p;
    ASSERT_LT((off - along * along.dot(off)).norm(), 5e-9) << t;
    ASSERT_LT((X.R - from.R).norm(), 1e-7) << t;
    const double speed =
        (tool(path.at(t + 0.5 * h).q).p - tool(path.at(t - 0.5 * h).q).p).norm() / h;
    most_step = std::max(most_step, std::abs(speed - before));
    before = speed;
    const double due = std::min({0.1, 0.1 * t / 1.0, 0.1 * (path.duration() - t) / 1.0});
    if (t > h && t < path.duration() - h) {
      ASSERT_NEAR(speed, due, 1e-4) << t;
    }
  }
  EXPECT_LT(most_step, 1.1e-4);  // 0.1 m/s^2 for a millisecond: no jumps
  EXPECT_LT((tool(path.at(path.duration()).q).p - from.p - way).norm(), 1e-7);
  EXPECT_EQ(path.at(path.duration() + 1.0).q_dot.norm(), 0.0);
}

TEST_P(ToolPath, AQuickLineIsStraightToo) {  // a tenth of a second for 0.3 m
  const Transform from = tool(q0);
  const Vec3 way = 0.3 * Vec3(0.2, 0.7, -0.5).normalized(), along = way.normalized();
  const JointTrajectory path = plan({{from.R, from.p + way}, {}, 0.1, 0.0});
  for (double t = 0.0; t <= 0.1; t += 1e-4) {
    const Vec3 off = tool(path.at(t).q).p - from.p;
    ASSERT_LT((off - along * along.dot(off)).norm(), 1e-5) << t;
  }
  EXPECT_LT((tool(path.end()).p - from.p - way).norm(), 2e-9);
}

TEST_P(ToolPath, RatesAndAccelerationsAreTheDerivatives) {
  const Transform from = tool(q0);
  const JointTrajectory path =
      plan({{rotation({0.2, -0.3, 0.4}) * from.R, from.p + Vec3(0.05, 0.1, -0.1)}, {}, 2.0, 0.0});
  constexpr double h = 1e-4;  // [s]
  for (const double t : {0.013, 0.25, 0.4999, 0.5001, 0.777, 1.0, 1.4, 1.6, 1.987}) {
    const JointState a = path.at(t - h), b = path.at(t), c = path.at(t + h);
    EXPECT_LT(((c.q - a.q) / (2.0 * h) - b.q_dot).norm(), 1e-5) << t;
    if (std::abs(t - 0.5) > 0.01 && std::abs(t - 1.5) > 0.01) {
      EXPECT_LT(((c.q_dot - a.q_dot) / (2.0 * h) - b.q_ddot).norm(), 1e-4) << t;
    }
  }
  // Rates do not jump where the profile's parts meet.
  EXPECT_LT((path.at(0.5 - 1e-9).q_dot - path.at(0.5 + 1e-9).q_dot).norm(), 1e-7);
}

TEST_P(ToolPath, AnArcKeepsItsDistanceAndMeetsItsPoint) {
  const Transform from = tool(q0);
  const Vec3 centre = from.p + Vec3(0.0, 0.1, 0.0), via = centre + Vec3(0.0, 0.0, -0.1),
             end = centre + 0.1 * Vec3(0.0, std::sin(0.5), -std::cos(0.5));
  const JointTrajectory path = plan({{from.R, end}, via, 3.0, 0.0});
  double nearest = HUGE_VAL, length = 0.0;
  Vec3 before = from.p;
  for (double t = 0.0; t <= 3.0; t += 1e-3) {
    const Transform X = tool(path.at(t).q);
    ASSERT_NEAR((X.p - centre).norm(), 0.1, 1e-7) << t;
    ASSERT_NEAR(X.p.x(), from.p.x(), 1e-7);
    ASSERT_LT((X.R - from.R).norm(), 1e-7);
    nearest = std::min(nearest, (X.p - via).norm());
    length += (X.p - before).norm();
    before = X.p;
  }
  EXPECT_LT(nearest, 1e-4);
  EXPECT_NEAR(length, 0.1 * (M_PI / 2 + 0.5), 1e-4);  // the short way, through via
  EXPECT_LT((tool(path.end()).p - end).norm(), 1e-7);
}

TEST_P(ToolPath, AnArcMayBeMoreThanHalfACircle) {
  const Transform from = tool(q0);
  const double r = 0.05;
  const Vec3 centre = from.p + Vec3(0.0, r, 0.0);
  // Three quarters of a turn from -y, by way of +y: the end is at -z.
  const JointTrajectory path =
      plan({{from.R, centre + Vec3(0, 0, -r)}, Vec3(centre + Vec3(0, 0, r)), 3.0, 0.0});
  double length = 0.0;
  Vec3 before = from.p;
  for (double t = 0.0; t <= 3.0; t += 1e-3) {
    const Vec3 p = tool(path.at(t).q).p;
    ASSERT_NEAR((p - centre).norm(), r, 1e-7);
    length += (p - before).norm();
    before = p;
  }
  EXPECT_NEAR(length, 1.5 * M_PI * r, 1e-4);
}

TEST_P(ToolPath, ATurnIsEvenAndStaysInPlace) {
  const Transform from = tool(q0);
  const double turn = 0.4;
  const JointTrajectory path = plan({{rotation({turn, 0.0, 0.0}) * from.R, from.p}, {}, 2.0, 0.0});
  const double middle =
      Eigen::AngleAxisd(Mat3(tool(path.at(1.0).q).R * from.R.transpose())).angle();
  EXPECT_NEAR(middle, 0.5 * turn, 1e-7);
  for (double t = 0.0; t <= 2.0; t += 0.01)
    ASSERT_LT((tool(path.at(t).q).p - from.p).norm(), 1e-7) << t;
}

TEST_P(ToolPath, InverseKinematicsFindsWhatItsPoseCameFrom) {
  std::mt19937 random(3);
  for (int k = 0; k < 10; ++k) {
    JointVector q = JointVector::Zero();
    for (int i = 0; i < robot.model.joints; ++i) {
      const Link& link = robot.model.jointLink(i);
      q(i) = std::uniform_real_distribution<double>(link.lower, link.upper)(random);
    }
    const std::optional<JointVector> found = planner.inverse(tool(q), q0);
    ASSERT_TRUE(found) << k;
    EXPECT_LT((tool(*found).p - tool(q).p).norm(), 2e-6);
    EXPECT_LT((tool(*found).R - tool(q).R).norm(), 4e-6);
    for (int i = 0; i < robot.model.joints; ++i) {
      EXPECT_GE((*found)(i), robot.model.jointLink(i).lower - 1e-6);
      EXPECT_LE((*found)(i), robot.model.jointLink(i).upper + 1e-6);
    }
  }
  EXPECT_FALSE(planner.inverse({Mat3::Identity(), Vec3(0.0, 0.0, 20.0)}, q0));
}

TEST_P(ToolPath, RefusesWhatTheArmCannotDo) {
  const Transform from = tool(q0);
  EXPECT_NE(refused({{from.R, from.p + Vec3(0.0, 0.0, 20.0)}, {}, 0.0, 1.0})
                .find("; where it leads cannot be reached"),
            std::string::npos);
  EXPECT_EQ(refused({from, {}, 1.0, 0.0}), "the tool is there already");
  EXPECT_EQ(refused({{rotation({0.1, 0, 0}) * from.R, from.p}, {}, 0.0, 0.1}),
            "the tool only turns, want duration_s");
  EXPECT_EQ(refused({{rotation({1e-3, 0, 0}) * from.R, from.p}, {}, 0.9, 0.0}), "");
  EXPECT_EQ(refused({{from.R, from.p + Vec3(0.2, 0, 0)}, Vec3(from.p + Vec3(0.1, 0, 0)), 1.0, 0.0}),
            "its start, via and its end are on one line, want three points of an arc");
}

INSTANTIATE_TEST_SUITE_P(Robots, ToolPath, testing::Values(kPuma, kDoss),
                         [](const auto& arm) { return std::string(arm.param.name); });

/// Two links of a metre each in a plane, on a slide along x: its limits are known by geometry.
constexpr const char* kScara = R"(<robot name="scara">
<link name="base"/>
<link name="slide"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="upper"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="lower"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="hand"/>
<joint name="lift" type="prismatic"><parent link="base"/><child link="slide"/><axis xyz="0 0 1"/>
 <limit lower="-0.2" upper="0.2" effort="1" velocity="0.5"/></joint>
<joint name="shoulder" type="revolute"><parent link="slide"/><child link="upper"/><axis xyz="0 0 1"/>
 <limit lower="-3" upper="3" effort="1" velocity="1.5"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>
 <limit lower="-3" upper="3" effort="1" velocity="100"/></joint>
<joint name="flange" type="fixed"><parent link="lower"/><child link="hand"/><origin xyz="1 0 0"/></joint>
</robot>)";

class Scara : public testing::Test {
 protected:
  std::string refused(const Transform& to, double duration) const {
    return test::refusal([&] { planner.plan(q0, {to, {}, duration, 0.0}); });
  }
  const UrdfRobot robot = loadUrdf(kScara, "scara.urdf");
  const ToolPlanner planner{robot.model,   robot.frames.back().link, robot.frames.back().X_link,
                            robot.fastest, robot.joint_names,        0.01};
  const JointVector q0 = [] {
    JointVector q = JointVector::Zero();
    q(1) = 0.5;
    q(2) = 1.0;
    return q;
  }();
  const Transform from = planner.pose(q0);
};

TEST_F(Scara, NamesTimeAndJointOfALimit) {
  // Up by 0.4 m in 2 s: 0.2 m are reached half-way, at 1 s.
  const std::string said = refused({from.R, from.p + Vec3(0.0, 0.0, 0.4)}, 2.0);
  EXPECT_EQ(said.rfind("at 1.02 s joint 'lift' would be at 0.20", 0), 0u) << said;
  EXPECT_NE(said.find(" m, want [-0.2, 0.2]; where it leads cannot be reached"), std::string::npos)
      << said;
  // 0.15 m in 0.3 s: the plateau is 0.15/(0.3*0.75) = 0.667 m/s, half of a metre a second too soon.
  EXPECT_EQ(refused({from.R, from.p + Vec3(0.0, 0.0, 0.15)}, 0.3)
                .rfind("at 0.06 s joint 'lift' would move at ", 0),
            0u);
}

TEST_F(Scara, KeepsAHandThatItCannotTurnFreely) {
  // Three joints move the hand in x, y, z; how it is turned they cannot choose.
  const std::string said = refused({from.R, from.p + Vec3(0.1, 0.0, 0.0)}, 2.0);
  EXPECT_NE(said.find("its 3 joints cannot keep the tool on its path"), std::string::npos) << said;
  EXPECT_EQ(refused({from.R, from.p + Vec3(0.0, 0.0, 0.1)}, 2.0), "");
}

TEST(ToolPlanner, AStraightWristIsSingular) {  // the axes of joints 4 and 6 are one
  const UrdfRobot puma = test::robot("puma560");
  const NamedFrame& tip = puma.frames.back();
  const ToolPlanner planner(puma.model, tip.link, tip.X_link, puma.fastest, puma.joint_names, 0.01);
  const auto said = [&](double joint_5) {
    JointVector q = JointVector::Zero();
    for (int i = 0; i < 6; ++i) q(i) = kPuma.degrees[static_cast<std::size_t>(i)] * kDegree;
    q(4) = joint_5;
    const Transform at = planner.pose(q);
    return test::refusal([&] {
      planner.plan(q, {{at.R, at.p + Vec3(0, 0, -0.02)}, {}, 1.0, 0.0});
    });
  };
  EXPECT_EQ(said(0.0).rfind("at 0.00 s the arm is singular", 0), 0u) << said(0.0);
  EXPECT_EQ(said(0.5), "");
}

TEST(ToolGoal, IsTheSamePoseInWhateverFrameItIsSaid) {
  const Transform X_FL0{rotation({0.3, -0.2, 0.9}), Vec3(1.0, 2.0, 3.0)},
      X_L0T{rotation({-0.4, 0.1, 0.2}), Vec3(0.3, 0.2, 0.7)};
  ToolOrder to;
  to.position = Vec3(0.1, 0.2, 0.3);
  to.rpy = Vec3(0.4, 0.5, 0.6);
  const Transform there = X_FL0 * goalOf(to, X_FL0, X_L0T).X_L0T;
  EXPECT_LT((there.p - *to.position).norm() + (there.R - rotation(*to.rpy)).norm(), 1e-14);
  ToolOrder by = to;
  by.by = true;
  by.via = Vec3(0.0, 0.1, 0.0);
  const ToolGoal goal = goalOf(by, X_FL0, X_L0T);
  const Transform before = X_FL0 * X_L0T, after = X_FL0 * goal.X_L0T;
  EXPECT_LT((after.p - before.p - *by.position).norm(), 1e-14);
  EXPECT_LT((after.R - rotation(*by.rpy) * before.R).norm(), 1e-14);
  EXPECT_LT((X_FL0 * *goal.via_L0 - before.p - *by.via).norm(), 1e-14);
  ToolOrder turn;
  turn.rpy = to.rpy;
  EXPECT_LT((goalOf(turn, X_FL0, X_L0T).X_L0T.p - X_L0T.p).norm(), 1e-15);
}

// --- In a scenario -------------------------------------------------------------------------------

const std::string kPose = "robot.joints_deg_or_m=[10,-60,150,20,45,30]";

Experiment withEvents(const std::string& events, const std::string& before = "",
                      const std::string& segment = "admittance: {duration_s: 8}") {
  return test::experiment("puma_on_table_4_1",
                          {kPose, "program=[{move: {}}, {calibration: {}}, " + before + "{" +
                                      segment + ", robot: [" + events + "]}]"});
}
std::string said(const std::string& events, const std::string& before = "",
                 const std::string& segment = "admittance: {duration_s: 8}") {
  const std::string all = test::refusal([&] { withEvents(events, before, segment); });
  const std::size_t at = all.find("program[");
  return at == std::string::npos ? all : all.substr(all.find('.', at) + 1);
}

Transform toolOf(const Experiment& e, const JointVector& q) {
  return e.robot.tool()->pose(linkPoses(e.robot.model, q));
}

TEST(ToolEvents, AreInTheAxesThatTheyName) {
  const std::string move = "{move: {to: {z_m: 0.05, gamma_deg: 10}}}, ";
  const auto way = [&](const std::string& frame, Experiment& e) {
    e = withEvents(
        "{at_s: 1, duration_s: 2, tool: {by: {position_m: [0.05, 0.02, -0.1]}, in: " + frame + "}}",
        move);
    const JointVector& end = std::get<ToolMove>(e.plant.task.robot_events[0].action).joints->end();
    return Vec3(toolOf(e, end).p - toolOf(e, e.plant.task.initial_joints).p);
  };
  Experiment e;
  const Vec3 due(0.05, 0.02, -0.1);
  EXPECT_LT((way("robot", e) - due).norm(), 1e-8);
  EXPECT_LT((e.plant.payload.X_PL0().R * way("platform", e) - due).norm(), 1e-8);
  const Vec3 inertial = way("inertial", e);
  EXPECT_LT((rotation({0, 0, 10 * kDegree}) * e.plant.payload.X_PL0().R * inertial - due).norm(),
            1e-8);
  ASSERT_FALSE(e.source.warnings.empty());
  EXPECT_EQ(e.source.warnings.front(),
            "program[3]: the tool path at 1 s is planned for a platform that stands where it is "
            "commanded: [0, 0, 0.05] m, [0, 0, 0.1745] rad");
}

/// The legs are told to stay where they are, in a segment of the program.
void holdIn(plant::Plant& plant, int segment) {
  LegCommand command;
  command.engaged = true;
  command.counts = plant.sample().legs;
  command.segment = segment;
  plant.command(command);
}

TEST(ToolEvents, ThePlantFollowsThePlan) {
  const Experiment e = withEvents(
      "{at_s: 0.5, speed_m_per_s: 0.1, tool: {by: {position_m: [0, 0.1, -0.1]}}}, {at_s: 4, "
      "duration_s: 1, joint: joint_1, to_deg_or_m: 0}",
      "", "monitor: {duration_s: 6, interval_s: 1}");
  const auto& path = *std::get<ToolMove>(e.plant.task.robot_events[0].action).joints;
  plant::Plant plant(e.plant);
  holdIn(plant, 2);
  for (std::int64_t t = 0; t <= 5'500'000'000; t += 10'000'000) {
    plant.advance(t);
    plant.sample();
    const JointState& s = plant.truth().joints;
    if (t < 4'000'000'000) {
      const JointState due = path.at((static_cast<double>(t) - 5e8) * 1e-9);
      ASSERT_LT((s.q - due.q).norm() + (s.q_dot - due.q_dot).norm(), 1e-12) << t;
    }
  }
  EXPECT_NEAR(plant.truth().joints.q(0), 0.0, 1e-12);
  EXPECT_NEAR(plant.truth().joints.q(1), path.end()(1), 1e-12);
}

TEST(ToolEvents, RefuseInOneLine) {
  EXPECT_EQ(said("{at_s: 1, duration_s: 1, tool: {by: {}}}"),
            "robot[0].tool.by.position_m: missing, want it, rpy_deg or both");
  EXPECT_EQ(said("{at_s: 1, tool: {by: {position_m: [0, 0, 0.1]}}}"),
            "robot[0].duration_s: or speed_m_per_s, want one of the two");
  EXPECT_EQ(said("{at_s: 1, duration_s: 1, tool: {by: {position_m: [0, 0, 0.1]}, in: tool}}")
                .rfind("robot[0].tool.in: 'tool', want", 0),
            0u);
  EXPECT_EQ(said("{at_s: 1, duration_s: 1, tool: {to: {position_m: [0, 0, 9]}}, joint: joint_1}"),
            "robot[0].tool: beside joint, want only one of them");
  EXPECT_EQ(said("{at_s: 1, duration_s: 1}"),
            "robot[0].joint: missing, want it, tool, grasp, release, gripper or push");
  EXPECT_EQ(said("{at_s: 8, duration_s: 1, joint: joint_1, to_deg_or_m: 0}"),
            "robot[0].at_s: 8 s, but the segment ends after 8 s");
  EXPECT_EQ(said("{at_s: 1, duration_s: 2, joint: joint_2, to_deg_or_m: -70}, {at_s: 2.5, "
                 "duration_s: 1, tool: {by: {position_m: [0, 0, -0.1]}}}"),
            "robot[1].at_s: joint 'joint_2' may move until 3 s, want the tool path after that");
  EXPECT_EQ(said("{at_s: 1, duration_s: 2, tool: {by: {position_m: [0, 0, -0.1]}}}, {at_s: 2.5, "
                 "duration_s: 1, joint: joint_2, to_deg_or_m: -70}"),
            "robot[1].at_s: the tool path before it may last until 3 s");
  const std::string down = "duration_s: 2, tool: {by: {position_m: [0, 0, -0.1]}}}";
  EXPECT_EQ(said("{at_s: 1, " + down + ", {at_s: 2, " + down),
            "robot[1].at_s: joint 'joint_1' may move until 3 s, want the tool path after that");
  const std::string inertial =
      "{at_s: 1, duration_s: 2, tool: {by: {position_m: [0, 0, -0.1]}, in: inertial}}";
  EXPECT_EQ(
      said(inertial, "", "trajectory: {duration_s: 8, z: {ramp: {to_m: 0.05}}}"),
      "robot[0].tool: in: inertial while a trajectory leads the platform, want robot or platform");
  EXPECT_EQ(said(inertial, "{admittance: {duration_s: 1}}, "),
            "robot[0].tool: in: inertial, but admittance control has left the platform anywhere; a "
            "move before it would tell");
  EXPECT_NE(test::refusal([] {
              test::experiment("z_sine", {"program=[{move: {}, robot: [{at_s: 0, release: {}}]}]"});
            }).find("robot[0].release: there is no robot"),
            std::string::npos);
}

// --- Ordered by hand -----------------------------------------------------------------------------

TEST(RobotOrders, APathIsPlannedBesideTheMachineFromWhereTheRobotIs) {
  const Experiment e = test::experiment("puma_on_table_4_1", {kPose});
  plant::Truth truth;
  truth.joints.q = e.plant.task.initial_joints;
  truth.P.X = e.plant.geometry.fromHome({});
  truth.P.X.R = rotation({0.0, 0.0, 0.5});
  RobotOrders orders(e);
  ToolOrder order;
  order.by = true;
  order.in = ToolOrder::Frame::kInertial;
  order.position = Vec3(0.05, 0.02, -0.1);
  order.duration = 2.0;
  EXPECT_FALSE(orders.take(order, truth));
  EXPECT_EQ(test::refusal([&] { orders.take(order, truth); }),
            "another tool path is being planned");
  const std::optional<RobotAction> planned = orders.done(true);
  ASSERT_TRUE(planned);
  const JointTrajectory& path = *std::get<ToolMove>(*planned).joints;
  const Vec3 way = toolOf(e, path.end()).p - toolOf(e, truth.joints.q).p;
  EXPECT_LT((truth.P.X.R * e.plant.payload.X_PL0().R * way - *order.position).norm(), 1e-8);
  EXPECT_FALSE(orders.done(true));
  order.position = Vec3(0.0, 0.0, 9.0);
  orders.take(order, truth);
  EXPECT_NE(test::refusal([&] { orders.done(true); }).find("cannot be reached"), std::string::npos);
  EXPECT_FALSE(orders.done(true));
  // Of rest the fastest instant of a fifth-order motion is 15/8 of the mean.
  const double change = 0.5, most = e.robot.fastest(0), least = 1.875 * change / most;
  const RobotMove by{0, truth.joints.q(0) + change, 0.0};
  const auto lasting = [&](double seconds) { return RobotMove{by.joint, by.target, seconds}; };
  EXPECT_TRUE(orders.take(lasting(least * 1.0001), truth));
  EXPECT_NE(
      test::refusal([&] { orders.take(lasting(least * 0.999), truth); }).find("would move at"),
      std::string::npos);
  plant::Truth moves = truth;  // one that has to turn round first goes faster after it
  moves.joints.q_dot(0) = -0.9 * most;
  EXPECT_THROW(orders.take(lasting(least * 1.0001), moves), InputError);
  moves.joints.q_dot(0) = NAN;  // which is no speed below the limit
  EXPECT_THROW(orders.take(lasting(least * 1.0001), moves), InputError);
  EXPECT_THROW(orders.take(RobotMove{6, 0.0, 1.0}, truth), InputError);
  // What needs no plan begins at once; a load is in the tool's frame.
  EXPECT_TRUE(orders.take(RobotMove{0, 1.0, 1.0}, truth));
  EXPECT_TRUE(orders.take(Release{}, truth));
  const auto grasp = orders.take(HandOrder{{2.0, Vec3(0, 0, 0.1), Mat3::Zero()}}, truth);
  ASSERT_TRUE(grasp);
  EXPECT_EQ(std::get<Grasp>(*grasp).link, e.robot.tool()->link);
  const Experiment none = test::experiment("z_sine");
  RobotOrders nobody(none);
  EXPECT_EQ(test::refusal([&] { nobody.take(order, truth); }),
            "the robot has no tip, want tip: LINK in its configuration");
}

// --- In hand -------------------------------------------------------------------------------------

const std::string kBox =
    "mass_kg: 4, center_m: [0, 0, 0.1], inertia_kg_m2: [0.02, 0.02, 0.02, 0, 0, 0]";

TEST(Grasp, ItsWeightIsOnTheSensorUntilItIsReleased) {
  Experiment e = withEvents("{at_s: 1, grasp: {" + kBox + "}}, {at_s: 3, release: {}}", "",
                            "monitor: {duration_s: 6, interval_s: 1}");
  plant::Plant plant(e.plant);
  holdIn(plant, 2);
  const auto load = [&](double t) {
    plant.advance(static_cast<std::int64_t>(t * 1e9));
    plant.sample();
    return plant.truth().F_Po_I;
  };
  const Wrench empty = load(0.9), full = load(2.9), again = load(4.9);
  EXPECT_NEAR(full.f.z() - empty.f.z(), -4.0 * 9.81, 1e-6);
  EXPECT_LT((again.stacked() - empty.stacked()).norm(), 1e-6);
  // Its moment about Po: r x F with r of the box's centre.
  const Transform X_PT = e.plant.payload.X_PL0() * toolOf(e, e.plant.task.initial_joints);
  const Vec3 r = plant.truth().P.X.R * (X_PT * Vec3(0.0, 0.0, 0.1));
  EXPECT_LT((full.n - empty.n - r.cross(Vec3(0.0, 0.0, -4.0 * 9.81))).norm(), 1e-4);
}

TEST(Grasp, IsInTheToolsFrame) {  // a metre from the link that carries it
  const auto file =
      std::filesystem::temp_directory_path() / fmt::format("ves_scara_{}.urdf", getpid());
  std::ofstream(file) << kScara;
  const Experiment e = test::experiment(
      "puma_on_table_4_1", {"robot.urdf=" + file.string(), "robot.joints_deg_or_m=[0, 0, 0]",
                            "program=[{move: {}, robot: [{at_s: 0, grasp: {" + kBox + "}}]}]"});
  std::filesystem::remove(file);
  const auto& grasp = std::get<Grasp>(e.plant.task.robot_events.at(0).action);
  EXPECT_EQ(grasp.link, 2);
  EXPECT_LT((grasp.body.p_BoBcm_B - Vec3(1.0, 0.0, 0.1)).norm(), 1e-12);
}

TEST(Grasp, GravityCompensationKnowsItFromWhenItIsTold) {
  const auto dynamic = [](const std::string& told) {
    const Experiment e = withEvents("{at_s: 1, grasp: {" + kBox + told + "}}", "",
                                    "monitor: {duration_s: 4, interval_s: 1}");
    double after = 0.0;
    runLockstep(e, nullptr, [&](const TickState& s) {
      if (s.segment == 2) after = s.dynamic.f.z();
      return Order();
    });
    return after;
  };
  EXPECT_NEAR(dynamic(""), -4.0 * 9.81, 2.0);  // noise of the sensor
  EXPECT_NEAR(dynamic(", told_after_s: 0.5"), 0.0, 2.0);
}

TEST(Grasp, IsTakenIntoTheLoopsJudgementBeforeAndAfterItIsTold) {
  const Experiment e = withEvents("{at_s: 1, grasp: {" + kBox +
                                  ", told_after_s: 0.5}}, {at_s: 3, release: {told_after_s: 0}}");
  const auto robots = programRobots(e.controller, e.plant.task);
  std::vector<std::pair<double, double>> masses;  // [kg] that it has, that are known
  for (const ProgramRobot& one : robots) {
    const std::pair<double, double> now{one.body.robot_P.mass, one.body.known_P.mass};
    if (masses.empty() || masses.back() != now) masses.push_back(now);
  }
  ASSERT_EQ(masses.size(), 3u);  // let go, it is as before
  const double m = masses[0].first;
  EXPECT_NEAR(masses[0].second, m, 1e-9);
  EXPECT_NEAR(masses[1].first, m + 4.0, 1e-9);
  EXPECT_NEAR(masses[1].second, m, 1e-9);
  EXPECT_NEAR(masses[2].second, m + 4.0, 1e-9);
}

TEST(Grasp, AHeldBodyIsOneWithTheLinkInTheReferenceMotion) {
  // Taken before admittance control begins: the same as a robot that was built so.
  const Experiment e = test::experiment(
      "srms_deploy_puma", {kPose, "program=[{move: {}, robot: [{at_s: 0, grasp: {" + kBox +
                                      "}}]}, "
                                      "{admittance: {duration_s: 3}, robot: [{at_s: 0, duration_s: "
                                      "2, joint: joint_1, to_deg_or_m: 40}]}]"});
  std::int64_t duration = 0;
  const Interaction held = interactionOf(e, duration);
  Interaction built = held;
  built.actions.erase(built.actions.begin());
  const NamedFrame& tip = *e.robot.tool();
  RigidBody& hand = built.payload.robot.links[static_cast<std::size_t>(tip.link)].body;
  hand = combine(hand, tip.X_link, {4.0, Vec3(0, 0, 0.1), 0.02 * Mat3::Identity()});
  InteractionOptions options;
  options.duration = 3'000'000'000;
  for (const auto model : {InteractionModel::kSplit, InteractionModel::kWhole}) {
    options.model = model;
    const auto a = simulate(held, options), b = simulate(built, options);
    ASSERT_EQ(a.size(), b.size());
    EXPECT_GT(b.back().x.norm(), 1e-5);
    for (std::size_t k = 0; k < a.size(); ++k) ASSERT_LT((a[k].x - b[k].x).norm(), 1e-12) << k;
  }
}

TEST(Grasp, RefusesInOneLine) {
  const std::string grasp = "{at_s: 1, grasp: {" + kBox + "}}";
  EXPECT_EQ(said(grasp + ", {at_s: 2, grasp: {" + kBox + "}}"),
            "robot[1].grasp: the robot has something in hand, want a release before");
  EXPECT_EQ(said("{at_s: 1, release: {}}"), "robot[0].release: the robot has nothing in hand");
  EXPECT_EQ(said(grasp + ", {at_s: 2, release: {}}, {at_s: 3, release: {}}"),
            "robot[2].release: the robot has nothing in hand");
  EXPECT_EQ(said("{at_s: 1, grasp: {mass_kg: -1, inertia_kg_m2: [1, 1, 1, 0, 0, 0]}}")
                .rfind("robot[0].grasp.mass_kg: ", 0),
            0u);
  EXPECT_EQ(said("{at_s: 1, grasp: {mass_kg: 1, inertia_kg_m2: [1, 1, -1, 0, 0, 0]}}")
                .rfind("robot[0].grasp.inertia_kg_m2: ", 0),
            0u);
  EXPECT_EQ(said("{at_s: 7, grasp: {" + kBox + ", told_after_s: 2}}"),
            "robot[0].at_s: the controller would be told at 9 s, after its segment's end at 8 s");
}

TEST(MovingRobot, RefusesWhatItCannotBegin) {
  const RobotModel puma = test::robot("puma560").model;
  JointVector q = JointVector::Zero();
  MovingRobot robot(puma, q);
  EXPECT_FALSE(robot.begin(Release{}, 0));
  EXPECT_FALSE(robot.begin(Grasp{6, {}}, 0));
  EXPECT_FALSE(robot.begin(Grasp{-2, {}}, 0));
  const RigidBody box{2.0, Vec3(0, 0, 0.1), Mat3::Identity()};
  EXPECT_TRUE(robot.begin(Grasp{5, box}, 0));
  EXPECT_NEAR(robot.model().link(5).body.mass, puma.link(5).body.mass + 2.0, 1e-12);
  EXPECT_FALSE(robot.begin(Grasp{5, box}, 0));
  EXPECT_TRUE(robot.begin(Release{}, 0));
  EXPECT_EQ(robot.model(), puma);
  // A path begins where the joints are, and they rest; it is not to be disturbed.
  constexpr std::int64_t s = 1'000'000'000;
  JointState to;
  to.q(0) = 1.0;
  JointTrajectory path(q);
  path.add({}, to, 2.0);
  const ToolMove follow{std::make_shared<JointTrajectory>(path)};
  EXPECT_TRUE(robot.begin(RobotMove{1, 0.5, 1.0}, 0));
  EXPECT_FALSE(robot.begin(follow, s / 2));
  EXPECT_FALSE(robot.begin(follow, 2 * s));  // joint 1 is elsewhere
  EXPECT_TRUE(robot.begin(RobotMove{1, 0.0, 1.0}, 2 * s));
  robot.begin(RobotMove{2, 0.0, 0.5}, 3 * s);  // goes nowhere, but is on its way
  EXPECT_FALSE(robot.begin(follow, 3 * s));
  EXPECT_TRUE(robot.begin(follow, 3 * s + s / 2));
  EXPECT_FALSE(robot.begin(RobotMove{1, 0.5, 1.0}, 4 * s));
  EXPECT_TRUE(robot.moving(4 * s));
  EXPECT_NEAR(robot.at(4 * s + s / 2).q(0), 0.5, 1e-12);
  EXPECT_FALSE(robot.moving(5 * s + s / 2));
  EXPECT_EQ(robot.at(6 * s).q(0), 1.0);
  EXPECT_TRUE(robot.begin(RobotMove{0, 0.0, 1.0}, 6 * s));
  EXPECT_EQ(robot.at(7 * s).q(0), 0.0);
  // Taken slower it is the same way.
  const auto slow = std::get<ToolMove>(slower(follow, 3.0));
  EXPECT_EQ(durationOf(slow), 6.0);
  EXPECT_NEAR((slow.joints->at(3.0).q - path.at(1.0).q).norm(), 0.0, 1e-12);
  EXPECT_NEAR((3.0 * slow.joints->at(3.0).q_dot - path.at(1.0).q_dot).norm(), 0.0, 1e-12);
  path.add(to, {}, 1.0);
  const JointTrajectory both = path.slower(3.0);
  for (const double t : {0.5, 1.9, 2.1, 2.9})
    EXPECT_NEAR(both.at(3.0 * t).q(0), path.at(t).q(0), 1e-12) << t;
}

}  // namespace
}  // namespace ves
