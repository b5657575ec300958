// SPDX-License-Identifier: BSD-3-Clause
//
// What stands in a robot's file is used, known to be harmless, or reported.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <array>

#include "support/refusal.hpp"
#include "support/robots.hpp"
#include "ves/robot/newton_euler.hpp"

namespace ves {
namespace {

/// A base, joint `j` about y, 0.3 m above it, and the link it moves; each part may be another.
struct Parts {
  std::string origin = R"(<origin xyz="0 0 0.3" rpy="0 0 0"/>)";
  std::string limit = R"(<limit lower="-2" upper="2" effort="10" velocity="1"/>)";
  std::string inertial =
      R"(<inertial><origin xyz="0 0 0.1"/><mass value="2"/>)"
      R"(<inertia ixx="0.02" iyy="0.02" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial>)";
  std::string in_link = "", in_joint = "", in_robot = "", type = "revolute";

  std::string text() const {
    return "<robot name=\"r\">\n<link name=\"base\"/>\n<joint name=\"j\" type=\"" + type + "\">\n" +
           "<parent link=\"base\"/><child link=\"l\"/><axis xyz=\"0 1 0\"/>" + origin + limit +
           in_joint + "</joint>\n<link name=\"l\">" + inertial + in_link + "</link>\n" + in_robot +
           "</robot>\n";
  }
  UrdfRobot load() const { return loadUrdf(text(), "r.urdf"); }
  std::string refused() const {
    return test::refusal([&] { load(); });
  }
  /// Its warnings, by lines.
  std::string warned() const { return fmt::format("{}", fmt::join(load().warnings, "\n")); }
};

bool says(const std::string& text, const std::string& what) {
  return text.find(what) != std::string::npos;
}

TEST(UrdfFile, WhatIsAsItShouldBeSaysNothing) { EXPECT_EQ(Parts().warned(), ""); }

TEST(UrdfFile, WhatIsNotKnownIsReportedWithWhatWasMeant) {
  struct Case {
    Parts parts;
    const char* says;
  };
  for (
      const Case& one : std::initializer_list<Case>{
          {{.origin = R"(<origin xyz="0 0 0.3" rotation="0 1 0"/>)"},
           "r.urdf:4: joint 'j': unknown attribute 'rotation' of origin, did you mean 'rpy'?"},
          {{.limit = R"(<limit min="-1" max="1" effort="1" velocity="1"/>)"},
           "unknown attribute 'min' of limit, did you mean 'lower'?"},
          {{.in_link = R"(<inertail/>)"},
           "unknown element 'inertail' of link, did you mean 'inertial'?"},
          {{.in_link = R"(<origin xyz="0 0 1"/>)"}, "unknown element 'origin' of link"},
          {{.in_link =
                R"(<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>)"},
           "a second element 'inertial' is not used"},
          {{.in_robot = R"(<loop_joint name="c"/>)"}, "unknown element 'loop_joint' of robot"},
          {{.in_joint = "0.3"}, "text \"0.3\" in joint is not used"}}) {
    EXPECT_TRUE(says(one.parts.warned(), one.says)) << one.says << "\n" << one.parts.warned();
  }
}

TEST(UrdfFile, WhatOtherProgramsPutThereIsNoMatter) {
  Parts parts;
  parts.in_robot =
      R"(<transmission name="t"><joint name="j"/></transmission><gazebo reference="l"/>)"
      R"(<material name="grey"><color rgba="1 1 1 1"/></material>)";
  parts.in_joint = R"(<dynamics damping="1" friction="0"/><safety_controller k_velocity="1"/>)";
  parts.in_link = R"(<contact/><self_collision_checking/>)";
  EXPECT_EQ(parts.warned(), "");
}

TEST(UrdfFile, WarningsOfAKindAreOne) {
  Parts parts;
  for (int i = 0; i < 20; ++i) parts.in_robot += R"(<loop_joint/>)";
  const std::vector<std::string> warnings = parts.load().warnings;
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(says(warnings[0], "and 19 more")) << warnings[0];
}

TEST(UrdfFile, NumbersAreNumbers) {
  for (const char* bad : {"0, 0, 0.3", "0 0 0,3", "0 0 0.3m", "0 0", "0 0 0 1", "0 0 x", ""}) {
    const std::string said = Parts{.origin = fmt::format("<origin xyz=\"{}\"/>", bad)}.refused();
    EXPECT_TRUE(says(said, "r.urdf:4: joint 'j': origin: xyz")) << said;
    EXPECT_TRUE(says(said, "want 3 numbers with blanks between")) << said;
  }
  for (const char* good : {"0 0 +0.3", " 0\t0\n3e-1 ", "-0 0. .3"})
    EXPECT_NEAR(Parts{.origin = fmt::format("<origin xyz=\"{}\"/>", good)}
                    .load()
                    .model.link(0)
                    .X_parent.p.z(),
                0.3, 1e-15);
}

TEST(UrdfFile, WhatIsMissingIsNamed) {
  EXPECT_TRUE(says(Parts{.limit = R"(<limit lower="-1" upper="1"/>)"}.refused(),
                   "r.urdf:4: joint 'j': limit: attribute 'effort' is missing"));
  EXPECT_TRUE(says(Parts{.limit = ""}.refused(), "wants an element 'limit'"));
  EXPECT_TRUE(says(
      Parts{
          .inertial =
              R"(<inertial><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>)"}
          .refused(),
      "r.urdf:5: link 'l': inertial: element 'mass' is missing"));
  EXPECT_TRUE(says(Parts{.type = "rotary"}.refused(), "type 'rotary' is not supported"));
}

TEST(UrdfFile, ATreeIsATree) {
  const auto with = [](const std::string& more) { return Parts{.in_robot = more}.refused(); };
  const std::string to_l =
      R"(<joint name="k" type="fixed"><parent link="base"/><child link="l"/></joint>)";
  EXPECT_TRUE(
      says(with(to_l), "r.urdf:6: joint 'k': link 'l' is carried by joint 'j' too (line 3)"));
  EXPECT_TRUE(
      says(with(R"(<joint name="k" type="fixed"><parent link="l"/><child link="base"/></joint>)"),
           "is part of a loop"));
  EXPECT_TRUE(says(
      with(
          R"(<link name="a"/><link name="b"/><joint name="k" type="fixed"><parent link="a"/><child link="b"/></joint>
<joint name="m" type="fixed"><parent link="b"/><child link="a"/></joint>)"),
      "is part of a loop"));
  EXPECT_TRUE(says(with(R"(<link name="alone"/>)"),
                   "link 'alone' is carried by nothing, and so is 'base' (line 2)"));
  EXPECT_TRUE(
      says(with(R"(<joint name="k" type="fixed"><parent link="l"/><child link="gone"/></joint>)"),
           "there is no link 'gone'"));
  EXPECT_TRUE(
      says(with(R"(<link name="l"/>)"), "link 'l' is the second of that name, after line 5"));
}

TEST(UrdfFile, JointsStandInTheOrderOfTheirElements) {
  // Names of joints in a transmission, in a comment and in another attribute count for nothing.
  const std::string link =
      R"(<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>)";
  const auto joint = [](const char* name, const char* child) {
    return fmt::format(
        R"(<joint type="continuous" name="{}"><parent link="base"/><child link="{}"/></joint>)",
        name, child);
  };
  const std::string text =
      R"(<robot name="r"><transmission name="t"><joint name="a_first"/></transmission><!-- <joint name="a_first"> -->)"
      R"(<link name="base"/><link name="x">)" +
      link + R"(<link name="y">)" + link + joint("b_second", "x") + joint("a_first", "y") +
      "</robot>";
  EXPECT_EQ(loadUrdf(text, "r.urdf").joint_names,
            (std::vector<std::string>{"b_second", "a_first"}));
}

TEST(UrdfFile, InertiaWithoutMassCounts) {
  const UrdfRobot robot =
      Parts{
          .inertial =
              R"(<inertial><mass value="0"/><inertia ixx="0.5" iyy="0.25" izz="0.5" ixy="0" ixz="0" iyz="0"/></inertial>)"}
          .load();
  ASSERT_EQ(robot.warnings.size(), 1u);
  EXPECT_TRUE(says(robot.warnings[0], "an inertia without a mass, counted"));
  JointState s;
  s.q_ddot(0) = 2.0;
  const auto effort = newtonEuler(robot.model, s, {}).tau;
  EXPECT_NEAR(effort(0), 0.5, 1e-12);  // 0.25 kg m^2 at 2 rad/s^2
}

TEST(UrdfFile, WhatIsUnlikelyIsGuessed) {
  struct Case {
    Parts parts;
    const char* says;
  };
  const auto inertial = [](const char* xyz, const char* mass, double i) {
    return fmt::format(
        R"(<inertial><origin xyz="{}"/><mass value="{}"/><inertia ixx="{}" iyy="{}" izz="{}" ixy="0" ixz="0" iyz="0"/></inertial>)",
        xyz, mass, i, i, i);
  };
  const std::string box = R"(<visual><geometry><box size="0.1 0.1 0.3"/></geometry></visual>)";
  for (const Case& one : std::initializer_list<Case>{
           {{.origin = R"(<origin xyz="0 0 0.3" rpy="0 0 90"/>)"},
            "rpy is more than a turn: degrees? (0 0 90, read as rad)"},
           {{.origin = R"(<origin xyz="0 0 330"/>)"}, "away: mm? (0 0 330)"},
           {{.limit = R"(<limit lower="-170" upper="170" effort="1" velocity="1"/>)"},
            "more than two turns: degrees? ([-170, 170]), read as rad"},
           {{.limit = R"(<limit lower="0" upper="0" effort="1" velocity="1"/>)"},
            "the joint cannot move"},
           {{.limit = R"(<limit effort="1" velocity="1"/>)"}, "has neither lower nor upper"},
           {{.limit = R"(<limit lower="-1" upper="1" effort="1" velocity="-1"/>)"},
            "velocity is not above 0"},
           {{.limit = R"(<limit lower="-1" upper="1" effort="1" velocity="0"/>)"},
            "velocity 0: taken as no limit"},
           {{.inertial = inertial("0 0 0.1", "20000", 400.0)}, "g? (20000)"},
           {{.inertial = inertial("0 0 0.1", "4.5", 36000.0)}, "far larger body"},
           {{.inertial = inertial("0 0 0.1", "4.5", 0.0), .in_link = box}, "that of a point"},
           {{.inertial = inertial("0 0 5", "4.5", 0.1), .in_link = box}, "far outside of it"}}) {
    EXPECT_TRUE(says(one.parts.warned(), one.says)) << one.says << "\n" << one.parts.warned();
  }
  // A wrist of 400 degrees either way, and limits that stand for none.
  for (const char* range : {"6.98", "1e16"})
    EXPECT_EQ(Parts{.limit = fmt::format(
                        R"(<limit lower="-{}" upper="{}" effort="1" velocity="1"/>)", range, range)}
                  .warned(),
              "");
}

TEST(UrdfFile, AFollowerHasToReachWhereItIsLed) {
  const auto follower = [](const char* upper) {
    return Parts{
        .in_robot = fmt::format(
            R"(<link name="m"/><joint name="f" type="revolute"><parent link="base"/><child link="m"/>
<limit lower="-4" upper="{}" effort="1" velocity="1"/><mimic joint="j" multiplier="-2"/></joint>)",
            upper)}
        .warned();
  };
  EXPECT_TRUE(
      says(follower("0.5"), "joint 'f' follows 'j' over [-4, 4], beyond its own limits [-4, 0.5]"))
      << follower("0.5");
  EXPECT_FALSE(says(follower("4"), "beyond"));
  EXPECT_FALSE(says(follower("3.9999999"), "beyond"));  // as far as such a number is written
}

TEST(UrdfFile, APictureNeverRefusesARobot) {
  for (
      const char* part :
      {R"(<visual><geometry/></visual>)", R"(<visual/>)",
       R"(<visual><geometry><box size="a"/></geometry></visual>)",
       R"(<visual><geometry><cone radius="1"/></geometry></visual>)",
       R"(<collision><geometry><mesh/></geometry></collision>)",
       R"(<visual><origin xyz="0 0"/><geometry><sphere radius="1"/></geometry></visual>)",
       R"(<visual><geometry><box size="1 1 1"/></geometry><material><color rgba="1 1"/></material></visual>)",
       R"(<visual><geometry><box size="0 1 1"/></geometry></visual>)",
       R"(<visual><geometry><sphere radius="1"/></geometry><material name="m" colour="red"/></visual>)",
       R"(<visual><xacro:grey/><geometry><sphere radius="1"/></geometry></visual>)"}) {
    Parts parts{.in_link = part};
    EXPECT_EQ(parts.refused(), "") << part;
    EXPECT_TRUE(says(parts.warned(), "r.urdf:5: link 'l': ")) << parts.warned();
  }
  const UrdfRobot capsule =
      Parts{.in_link =
                R"(<visual><geometry><capsule radius="0.05" length="0.3"/></geometry></visual>)"}
          .load();
  ASSERT_EQ(capsule.visuals.size(), 1u);
  EXPECT_EQ(capsule.visuals[0].kind, Visual::Kind::kCapsule);
}

TEST(UrdfFile, QuaternionsAreAttitudes) {
  const Transform X =
      Parts{
          .origin =
              R"(<origin xyz="0 0 0.3" quat_xyzw="0 0.70710678118654752 0 0.70710678118654752"/>)"}
          .load()
          .model.link(0)
          .X_parent;
  EXPECT_LT((X.R * Vec3::UnitX() + Vec3::UnitZ()).norm(), 1e-12);  // a quarter turn about y
  EXPECT_TRUE(says(Parts{.origin = R"(<origin quat_xyzw="0 0 0 0"/>)"}.refused(), "no direction"));
  EXPECT_TRUE(says(Parts{.origin = R"(<origin rpy="0 0 0" quat_xyzw="0 0 0 1"/>)"}.refused(),
                   "want one of them"));
}

TEST(UrdfFile, XacroIsToBeExpandedFirst) {
  EXPECT_TRUE(says(Parts{.in_robot = R"(<xacro:arm parent="l"/>)"}.refused(),
                   "r.urdf:6: robot: '<xacro:arm>' is left of xacro"));
}

TEST(Xml, IsReadAsXmlHasIt) {
  const Parts parts;
  const auto joints = [](const std::string& text) { return loadUrdf(text, "r.urdf").model.joints; };
  EXPECT_EQ(joints("\xef\xbb\xbf" + parts.text()), 1);
  EXPECT_EQ(joints("<!-- " + std::string(100'000, 'x') + " <robot> > -->\n" + parts.text()), 1);
  std::string wide;  // UTF-16
  for (const char c : "<?xml version=\"1.0\" encoding=\"UTF-16\"?>" + parts.text())
    wide += {c, '\0'};
  EXPECT_EQ(joints("\xff\xfe" + wide), 1);
  EXPECT_TRUE(says(
      test::refusal([] { loadUrdf("version https://git-lfs.github.com/spec/v1\n", "r.urdf"); }),
      "r.urdf:1: is a Git LFS pointer"));
  EXPECT_TRUE(
      says(test::refusal([] { loadUrdf("<robot>\n<link name=\"a\">\n</robot>", "r.urdf"); }),
           "r.urdf:3: not well-formed XML"));
  EXPECT_TRUE(says(test::refusal([] { loadUrdf("<sdf/>", "r.urdf"); }), "want <robot>"));
}

}  // namespace
}  // namespace ves
