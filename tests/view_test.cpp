// SPDX-License-Identifier: BSD-3-Clause
//
// What a page is told: bodies, frames and their poses. tests/browser reads back what it draws.
#include <gtest/gtest.h>

#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>

#include "support/followed.hpp"
#include "support/refusal.hpp"
#include "support/rig.hpp"
#include "support/robots.hpp"
#include "ves/bus/channels.hpp"
#include "ves/evaluation/tool_motion.hpp"
#include "ves/page/live_run.hpp"
#include "ves/page/page.hpp"
#include "ves/page/scene.hpp"
#include "ves/page/still.hpp"
#include "ves/page/web_server.hpp"
#include "ves/pictures/marks.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;

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

/// As a drawing is seen, written anew: from above and aside, without perspective.
Eigen::Vector2d seen(const Vec3& p) {
  const Vec3 eye = Vec3(0.62, -0.95, 0.5).normalized();
  const Vec3 right = Vec3(-eye.y(), eye.x(), 0.0).normalized(), up = eye.cross(right);
  return {right.dot(p), -up.dot(p)};
}

/// A line or a polygon of a drawing.
struct Drawn {
  bool closed;
  std::vector<Eigen::Vector2d> at;
  double width = 0.0;

  bool joins(const Vec3& a, const Vec3& b) const {
    const auto near = [&](std::size_t i, const Vec3& p) { return (at[i] - seen(p)).norm() < 3e-4; };
    return !closed && at.size() == 2 && ((near(0, a) && near(1, b)) || (near(0, b) && near(1, a)));
  }
};

/// In the order in which they cover each other.
std::vector<Drawn> drawnIn(const std::string& svg) {
  std::vector<Drawn> out;
  const std::regex element("<(polygon|polyline) points=\"([^\"]*)\"[^>]*"),
      width("stroke-width=\"([^\"]*)\"");
  for (std::sregex_iterator it(svg.begin(), svg.end(), element), end; it != end; ++it) {
    Drawn one{(*it)[1] == "polygon", {}};
    std::istringstream points((*it)[2]);
    for (std::string point; points >> point;)
      one.at.emplace_back(std::stod(point), std::stod(point.substr(point.find(',') + 1)));
    const std::string text = it->str();
    std::smatch found;
    if (std::regex_search(text, found, width)) one.width = std::stod(found[1]);
    out.push_back(one);
  }
  return out;
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
    const auto& legs = scene.description()["legs"];
    ASSERT_EQ(legs.size(), 6u);
    for (std::size_t i = 0; i < kLegs; ++i) {
      const auto joint = [&](int end) {
        const auto& p = legs[i][static_cast<std::size_t>(end)];
        return Vec3(p[0], p[1], p[2]);
      };
      EXPECT_EQ(joint(0), e.plant.geometry.p_IBi_I[i]);
      EXPECT_NEAR((X_IP * joint(1) - joint(0)).norm(), row.truth.leg[i], 2e-6);
    }
  }
}

// Whatever the order of the joints: each is a corner, and a turn to the left follows at each.
TEST(Scene, APlateGoesRoundItsJointsAtTheirMeanHeight) {
  for (const char* scenario : {"free_decay", "arm_on_desk", "puma_on_hall"}) {
    const Experiment e = test::experiment(scenario);
    const Scene scene(e);
    const Geometry& g = e.plant.geometry;
    int plates = 0;
    for (const auto& shape : scene.description()["shapes"]) {
      if (shape["kind"] != "plate") continue;
      const auto& joints = shape["frame"] == "platform" ? g.p_PPi_P : g.p_IBi_I;
      std::vector<Eigen::Vector2d> corners;
      for (const auto& corner : shape["corners"]) corners.emplace_back(corner[0], corner[1]);
      ASSERT_EQ(corners.size(), joints.size());
      double height = 0.0;
      for (const Vec3& joint : joints) {
        EXPECT_TRUE(std::any_of(corners.begin(), corners.end(), [&](const auto& corner) {
          return (corner - joint.head<2>()).norm() < 1e-9;
        }));
        height += joint.z() / kLegs;
      }
      EXPECT_NEAR(shape["top"].get<double>(), height, 1e-12);
      for (std::size_t i = 0; i < kLegs; ++i) {
        const Eigen::Vector2d to = corners[(i + 1) % kLegs] - corners[i],
                              on = corners[(i + 2) % kLegs] - corners[(i + 1) % kLegs];
        EXPECT_GT(to.x() * on.y() - to.y() * on.x(), 0.0) << scenario << i;
      }
      ++plates;
    }
    EXPECT_EQ(plates, 2) << scenario;
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
  for (int i = 1; i <= 6; ++i) frames.insert({fmt::format("leg{}", i), fmt::format("rod{}", i)});
  for (const auto& frame : scene.description()["frames"]) {
    EXPECT_TRUE(frames.count(frame["parent"])) << frame;
    frames.insert(frame["name"]);
  }
  for (const auto& shape : scene.description()["shapes"])
    EXPECT_TRUE(frames.count(shape["frame"])) << shape;
}

// As far as its links are long, however they are bent.
TEST(Scene, TheReachIsThatOfAStretchedRobot) {
  const Experiment e = test::experiment("puma_on_table_4_1");
  const RobotModel& robot = e.plant.payload.robot;
  const LinkPoses links = linkPoses(robot, JointVector::Constant(0.3));
  double length = 0.0;
  Vec3 from = Vec3::Zero();
  for (int i = 0; i < robot.size; ++i) {
    length += (links[i].p - from).norm();
    from = links[i].p;
  }
  length += (e.robot.tool()->pose(links).p - from).norm();
  EXPECT_NEAR(Scene(e).description()["reach"].get<double>(), length, 1e-12);
}

// The tops of a socket's boards are flush with its mouth, its floor is at its depth.
TEST(Scene, ASocketIsAHoleInABoard) {
  const Experiment e = test::experiment("contact_peg_puma");
  const FixedBody& body = e.plant.task.world->environment.bodies.front();
  const Socket& socket = std::get<Socket>(body.shape);
  const Scene scene(e);
  int boards = 0, floors = 0;
  for (const auto& shape : scene.description()["shapes"]) {
    if (!shape.contains("world")) continue;
    ASSERT_EQ(shape["kind"], "box");
    const auto& p = shape["position"];
    const Vec3 at = inverse(body.X_IB) * Vec3(p[0], p[1], p[2]);
    const double top = at.z() + 0.5 * shape["size"][2].get<double>();
    if (at.head<2>().norm() < 1e-9) {
      ++floors;
      EXPECT_NEAR(top, -socket.depth, 1e-12);
    } else {
      ++boards;
      EXPECT_NEAR(top, 0.0, 1e-12);
      const Vec3 half = 0.5 * Vec3(shape["size"][0], shape["size"][1], shape["size"][2]);
      EXPECT_NEAR((at.cwiseAbs() - half).head<2>().maxCoeff(), socket.radius + socket.chamfer,
                  1e-12);
    }
  }
  EXPECT_EQ(boards, 4);
  EXPECT_EQ(floors, 1);
}

TEST(Scene, APushIsShownWhileItLasts) {
  const RecordedRun run = puma();
  const Scene scene(run.series.experiment);
  const auto d = scene.description();
  Row row = run.series.rows.back();
  const auto shown = [&](const std::string& name) {
    std::size_t at = 7 * d["frames"].size() + 3 * d["arm"].size();
    for (const auto& one : d["scalars"]) {
      if (one == name) return static_cast<double>(scene.picture(row, {})[at]);
      ++at;
    }
    ADD_FAILURE() << name;
    return 0.0;
  };
  row.truth.pushes = 1;
  row.truth.push_began_ns = row.truth.header.time_ns - 400'000'000;
  row.truth.push_on = 1;
  row.truth.push_link = 3;
  for (int i = 0; i < 3; ++i) {
    row.truth.push_force[i] = 1.0 + i;
    row.truth.push_point[i] = 0.5 + i;
  }
  for (const double duration : {0.5, 0.3}) {  // [s] that it lasts
    row.truth.push_duration = duration;
    const std::map<std::string, double> due = {
        {"push_on", 1.0}, {"push_link", 3.0}, {"push_x", 0.5},  {"push_y", 1.5},
        {"push_z", 2.5},  {"push_fx", 1.0},   {"push_fy", 2.0}, {"push_fz", 3.0}};
    for (const auto& [name, value] : due)
      if (duration > 0.4)
        EXPECT_EQ(shown(name), value) << name;
      else
        EXPECT_TRUE(std::isnan(shown(name))) << name;
  }
}

// What of its stroke a leg has left: all of it in the middle.
TEST(Scene, AMarginIsOfHalfAStroke) {
  const RecordedRun run = puma();
  const Scene scene(run.series.experiment);
  const SafetyLimits& limits = run.series.experiment.controller.safety;
  const auto d = scene.description();
  Row row = run.series.rows.back();
  for (std::size_t i = 0; i < kLegs; ++i) {
    std::size_t at = 7 * d["frames"].size() + 3 * d["arm"].size();
    for (const auto& one : d["scalars"]) {
      if (one == fmt::format("leg{}_margin", i + 1)) break;
      ++at;
    }
    ASSERT_LT(at, scene.width());
    for (const auto& [length, margin] : {std::pair(0.5 * (limits.leg_min + limits.leg_max), 1.0),
                                         {limits.leg_min, 0.0},
                                         {0.75 * limits.leg_max + 0.25 * limits.leg_min, 0.5}}) {
      row.state.leg_measured[i] = length;
      EXPECT_NEAR(scene.picture(row, {})[at], margin, 1e-6) << i;
    }
  }
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

// Before its calibration the wrench is the sensor's bias, hundreds of newtons of nothing.
TEST(Scene, TheForceIsShownOnceTheSensorsBiasIsKnown) {
  const RecordedRun run = puma();
  const Scene scene(run.series.experiment);
  const auto d = scene.description();
  std::size_t at = 7 * d["frames"].size() + 3 * d["arm"].size();
  for (const auto& one : d["scalars"]) {
    if (one == "fz_dynamic") break;
    ++at;
  }
  int hidden = 0, known = 0;
  for (const Row& row : run.series.rows) {
    const float fz = scene.picture(row, {})[at];
    if (row.state.calibration == static_cast<int>(CalibrationStatus::kDone) &&
        row.state.kind != static_cast<int>(SegmentKind::kCalibration)) {
      ASSERT_LT(std::abs(fz), 40.0f);  // the weight is 180 N
      ASSERT_EQ(fz, static_cast<float>(row.state.dynamic[2]));
      ++known;
    } else {
      ASSERT_TRUE(std::isnan(fz));
      ++hidden;
    }
  }
  EXPECT_GT(hidden, 100);
  EXPECT_GT(known, 200);
}

// What a wheel gives the vehicle it has lost: torque times time.
TEST(Scene, WheelsHaveTakenWhatTheyGave) {
  const RecordedRun run = recordLockstep(test::experiment(
      "satellite_puma", {"program=[{calibration: {}}, {admittance: {duration_s: 3}}]",
                         "base.free.wheels=[{axis: [0, 0, 2], most_nms: 20, torques_s_nm: [[1, "
                         "1.5, 0.8], [2, 2.25, -3]]}, {axis: [1, 0, 0], most_nms: 20, "
                         "torques_s_nm: [[0, 1, 0.5]]}]"}));
  const Scene scene(run.series.experiment);
  const auto d = scene.description();
  ASSERT_EQ(d["wheels"].size(), 2u);
  EXPECT_EQ(d["wheels"][0]["axis"], (nlohmann::ordered_json{0.0, 0.0, 1.0}));
  EXPECT_NEAR(d["wheels"][0]["most"].get<double>(), 0.4, 1e-12);
  const std::vector<Column> all = columns(run.series.experiment);
  const auto column = [&](const std::string& name) {
    return std::find_if(all.begin(), all.end(), [&](const Column& c) { return c.name == name; });
  };
  ASSERT_NE(column("wheel1_nms"), all.end());
  const auto& scalars = d["scalars"];
  const std::size_t before = 7 * d["frames"].size() + 3 * d["arm"].size();
  int ticks = 0;
  eachTick(run.series, [&](const Row& row, double t) {
    // The vehicle's clock is a few ticks behind.
    const double first = t < 0.98   ? 0.0
                         : t < 1.6  ? NAN
                         : t < 1.98 ? -0.4
                         : t < 2.35 ? NAN
                                    : 0.35,
                 second = t < 1.1 ? NAN : -0.5;
    const std::vector<float> picture = scene.picture(row, {});
    for (const auto& [name, due] : {std::pair("wheel0", first), std::pair("wheel1", second)}) {
      if (std::isnan(due)) continue;
      EXPECT_NEAR(column(fmt::format("{}_nms", name))->value(row), due, 1e-9) << t;
      const auto at = std::find(scalars.begin(), scalars.end(), fmt::format("{}_momentum", name));
      ASSERT_NE(at, scalars.end());
      EXPECT_NEAR(picture[before + static_cast<std::size_t>(at - scalars.begin())], due, 1e-6);
      ++ticks;
    }
  });
  EXPECT_GT(ticks, 300);
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
  const Vec6 x = linearised(e.controller.vehicle).Phi * eta;
  Row row{};
  Vec6::Map(row.state.x_measured) = x;
  const std::vector<float> picture = scene.picture(row, {});
  const float* arm = picture.data() + 7 * scene.description()["frames"].size();
  EXPECT_LT(Vec3(arm[0], arm[1], arm[2]).norm(), 1e-12);
  const float* tip = arm + 3 * (points.size() - 1);
  EXPECT_GT(x.head<3>().norm(), 1e-3);
  EXPECT_LT((Vec3(tip[0], tip[1], tip[2]) - x.head<3>()).norm(), 1e-6);
}

/// The PUMA with looks: base a box, link 2 no visual but a mesh to collide with, link 3 a sphere
/// and a cylinder, link 4 a mesh that is nowhere.
class Looks : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_ / "arm/meshes");
    const float corners[] = {0, 0, 0, 1, 0, 0, 0, 2, 0};  // one triangle
    std::string stl(80, ' ');
    const std::uint32_t count = 1;
    stl.append(reinterpret_cast<const char*>(&count), 4).append(12, '\0');
    stl.append(reinterpret_cast<const char*>(corners), sizeof corners).append(2, '\0');
    write("arm/meshes/two.stl", stl);
    write("arm/meshes/text.stl",
          "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 2e0 "
          "0\nendloop\nendfacet\nendsolid x\n");
    setenv("ROS_PACKAGE_PATH", folder_.c_str(), 1);
    std::string text =
        std::regex_replace(test::readText(test::configDir() + "/robots/puma560.urdf"),
                           std::regex("<visual>[^]*?</visual>"), "");
    const auto dress = [&](const std::string& link, const std::string& with) {
      const std::string head = "<link name=\"" + link + "\">";
      const std::size_t at = text.find(head);
      ASSERT_NE(at, std::string::npos) << link;
      text.insert(at + head.size(), with);
    };
    const std::string visual = "<visual><geometry>", end = "</geometry></visual>";
    dress("link_0", visual + "<box size='0.1 0.2 0.3'/>" + end);
    dress("link_2",
          "<collision><origin xyz='0 0 0.5' rpy='0 0 1.5707963267948966'/><geometry>"
          "<mesh filename='package://arm/meshes/two.stl' scale='0.1 0.1 0.1'/>"
          "</geometry></collision>");
    dress("link_3", visual + "<sphere radius='0.04'/>" + end + visual +
                        "<cylinder radius='0.03' length='0.4'/>" + end);
    dress("link_4", visual + "<mesh filename='package://arm/meshes/none.stl'/>" + end);
    write("dressed.urdf", text);
  }
  void TearDown() override {
    unsetenv("ROS_PACKAGE_PATH");
    fs::remove_all(folder_);
  }
  void write(const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
  }
  nlohmann::ordered_json shapes(const std::string& kind, const std::string& frame) {
    nlohmann::ordered_json out = nlohmann::ordered_json::array();
    const Scene drawn = scene();
    for (const auto& shape : drawn.description()["shapes"])
      if (shape["kind"] == kind && shape["frame"] == frame) out.push_back(shape);
    return out;
  }
  Scene scene() {
    return Scene(test::experiment("puma_on_table_4_1",
                                  {"robot.urdf=" + (folder_ / "dressed.urdf").string()}));
  }
  fs::path folder_ = fs::temp_directory_path() / ("ves_looks_" + std::to_string(getpid()));
};

TEST_F(Looks, AreDrawnWhereTheDescriptionHasThem) {
  const auto box = shapes("box", "platform");
  ASSERT_EQ(box.size(), 1u);
  EXPECT_EQ(box[0]["size"].dump(), "[0.1,0.2,0.3]");
  EXPECT_NEAR(box[0]["position"][2].get<double>(), 0.0957 + 0.0127, 1e-12);  // mount.yaml
  ASSERT_EQ(shapes("sphere", "link3").size(), 1u);
  ASSERT_EQ(shapes("rod", "link3").size(), 1u);
  EXPECT_EQ(shapes("rod", "link3")[0]["length"], 0.4);
  const auto mesh = shapes("mesh", "link2");
  ASSERT_EQ(mesh.size(), 1u);
  EXPECT_EQ(mesh[0]["position"].dump(), "[0.0,0.0,0.5]");
  EXPECT_NEAR(mesh[0]["quaternion"][2].get<double>(), std::sqrt(0.5), 1e-12);
  EXPECT_EQ(mesh[0]["triangles"], base64({0, 0, 0, 0.1f, 0, 0, 0, 0.2f, 0}));
  // What is drawn needs no line from joint to joint; what is not keeps it.
  EXPECT_TRUE(shapes("capsule", "link2").empty());
  EXPECT_FALSE(shapes("capsule", "link4").empty() && shapes("capsule", "link1").empty());
  ASSERT_EQ(scene().warnings().size(), 1u);
  EXPECT_EQ(scene().warnings()[0],
            "package://arm/meshes/none.stl: not found, its link is drawn as a line");
}

TEST_F(Looks, TheFirstLinkThatMovesTakesItsShapesAlong) {
  std::string text = test::readText((folder_ / "dressed.urdf").string());
  const std::string head = "<link name=\"link_1\">";
  ASSERT_NE(text.find(head), std::string::npos);
  text.insert(
      text.find(head) + head.size(),
      "<visual><origin xyz='0 0.2 0'/><geometry><sphere radius='0.05'/></geometry></visual>");
  write("dressed.urdf", text);
  ASSERT_EQ(shapes("sphere", "link1").size(), 1u);
  EXPECT_EQ(shapes("sphere", "link1")[0]["position"].dump(), "[0.0,0.2,0.0]");
  EXPECT_TRUE(shapes("sphere", "platform").empty());
}

// A box is a stroke along its longest side, as thick as the other two are in the mean.
TEST_F(Looks, ADrawingShowsABoxAlongItsLongestSide) {
  const Experiment e =
      test::experiment("puma_on_table_4_1", {"robot.urdf=" + (folder_ / "dressed.urdf").string()});
  const Transform X = e.plant.geometry.fromHome(Pose()) * e.plant.payload.X_PL0();
  const std::vector<Drawn> all = drawnIn(stillAtStart(e, StillView::kPlatform));
  const auto box = std::find_if(all.begin(), all.end(), [&](const Drawn& d) {
    return d.joins(X * Vec3(0.0, 0.0, -0.15), X * Vec3(0.0, 0.0, 0.15));
  });
  ASSERT_NE(box, all.end());
  EXPECT_NEAR(box->width, std::sqrt(0.1 * 0.2), 1e-4);
}

// A material of its own, or one that the robot, or a shape before, has named.
TEST_F(Looks, ShapesHaveTheColoursOfTheirMaterials) {
  std::string text = test::readText((folder_ / "dressed.urdf").string());
  const auto put = [&](const std::string& before, const std::string& what) {
    const std::size_t at = text.find(before);
    ASSERT_NE(at, std::string::npos) << before;
    text.insert(at + before.size(), what);
  };
  put("<box size='0.1 0.2 0.3'/></geometry>",
      "<material name='own'><color rgba='1 0 0 1'/></material>");
  put("<sphere radius='0.04'/></geometry>", "<material name='own'/>");
  put("<cylinder radius='0.03' length='0.4'/></geometry>", "<material name='above'/>");
  put("<robot name=\"puma560\">", "<material name='above'><color rgba='0 0.2 1 1'/></material>");
  write("dressed.urdf", text);
  EXPECT_EQ(shapes("box", "platform")[0]["colour"], 0xff0000);
  EXPECT_EQ(shapes("sphere", "link3")[0]["colour"], 0xff0000);
  EXPECT_EQ(shapes("rod", "link3")[0]["colour"], 0x0033ff);
}

TEST_F(Looks, AMeshThatIsNoneIsNamed) {
  const std::string good = test::readText((folder_ / "arm/meshes/two.stl").string());
  const std::string nan("\0\0\xc0\x7f", 4);
  for (const std::string& bytes :
       {std::string(), good.substr(0, 100), good.substr(0, 96) + nan + good.substr(100),
        std::string("solid\nvertex 1 2\n"), std::string("solid\nvertex 1 2 3\n")}) {
    write("arm/meshes/two.stl", bytes);
    const auto warnings = scene().warnings();
    ASSERT_EQ(warnings.size(), 2u) << bytes;
    EXPECT_NE(warnings[0].find("two.stl: no mesh: "), std::string::npos) << warnings[0];
  }
  // As text it is the same, and so it is with bytes behind its end.
  for (const std::string& bytes :
       {test::readText((folder_ / "arm/meshes/text.stl").string()), good + "1234567"}) {
    write("arm/meshes/two.stl", bytes);
    EXPECT_EQ(scene().warnings().size(), 1u);
    EXPECT_EQ(shapes("mesh", "link2")[0]["triangles"], base64({0, 0, 0, 0.1f, 0, 0, 0, 0.2f, 0}));
  }
}

TEST_F(Looks, MeshesOfOtherKindsHaveTheirColours) {
  write("arm/meshes/a b.obj",
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nusemtl red\nf 1 2 3\nusemtl blue\nf 1 3 "
        "4\n");
  write("arm/meshes/a.mtl", "newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n");
  const std::string text = test::readText((folder_ / "dressed.urdf").string());
  const std::string named = "package://arm/meshes/two.stl' scale='0.1 0.1 0.1'";
  const auto with = [&](const std::string& mesh) {
    std::string other = text;
    other.replace(other.find(named), named.size(), mesh);
    write("dressed.urdf", other);
    return shapes("mesh", "link2");
  };
  unsetenv("ROS_PACKAGE_PATH");  // found beside the description, and in the folders above it
  for (const char* name : {"arm/meshes/a b.obj", "arm/meshes/a%20b.obj",
                           "package://arm/meshes/a%20b.obj", "model://arm/meshes/a%20b.obj"}) {
    const auto parts = with(std::string(name) + "' scale='1 -1 1'");
    ASSERT_EQ(parts.size(), 2u) << name;
    EXPECT_EQ(parts[0]["colour"], 0xff0000);
    EXPECT_EQ(parts[1]["colour"], 0x0000ff);
    EXPECT_EQ(parts[0]["triangles"], base64({0, -0.0f, 0, 1, -0.0f, 0, 0, -2, 0}));
  }
  with("arm/meshes/a b.obj' scale='1000 1000 1000'");
  EXPECT_NE(scene().warnings()[0].find("reaches 3000 m: is it in mm"), std::string::npos);
}

// Collada says its unit (here a quarter of a metre) and which way is up, which a description says
// itself; glTF is in metres, its numbers in base64.
TEST_F(Looks, ColladaAndGltfAreReadAsTheySay) {
  write("arm/meshes/a.dae", R"(<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="span" meter="0.25"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="9">0 0 0 10 0 0 0 20 30</float_array><technique_common>
<accessor source="#a" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><translate>0 0 50</translate>
<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>)");
  write("arm/meshes/a.gltf",
        R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0},"material":0}]}],
"materials":[{"pbrMetallicRoughness":{"baseColorFactor":[0,1,0,1]}}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,2,3]}],
"bufferViews":[{"buffer":0,"byteLength":36}],
"buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,)" +
            base64({0, 0, 0, 1, 0, 0, 0, 2, 3}) + R"("}]})");
  const std::string text = test::readText((folder_ / "dressed.urdf").string());
  const std::string named = "package://arm/meshes/two.stl' scale='0.1 0.1 0.1'";
  const auto with = [&](const std::string& mesh) {
    std::string other = text;
    other.replace(other.find(named), named.size(), mesh);
    write("dressed.urdf", other);
    return shapes("mesh", "link2");
  };
  const auto collada = with("arm/meshes/a.dae'");
  ASSERT_EQ(collada.size(), 1u);
  EXPECT_EQ(collada[0]["triangles"], base64({0, 0, 12.5f, 2.5f, 0, 12.5f, 0, 5, 20}));
  const auto gltf = with("arm/meshes/a.gltf'");
  ASSERT_EQ(gltf.size(), 1u);
  EXPECT_EQ(gltf[0]["triangles"], base64({0, 0, 0, 1, 0, 0, 0, 2, 3}));
  EXPECT_EQ(gltf[0]["colour"], 0x00ff00);
}

TEST(Scene, WithoutAnArmThereIsNone) {
  const Scene scene(puma().series.experiment);
  EXPECT_TRUE(scene.description()["arm"].empty());
}

TEST(PageMessage, IsOneOfFewAndWithinItsRange) {
  EXPECT_TRUE(std::holds_alternative<PageMessage::Drawn>(parsePageMessage("drawn")->what));
  const auto stop = parsePageMessage("stop 12");
  EXPECT_TRUE(std::holds_alternative<PageMessage::Stop>(stop->what));
  EXPECT_EQ(stop->edition, 12);
  EXPECT_EQ(std::get<PushOrder>(parsePageMessage("push 1 tool 20 -3.5 0 0.2 0 0 1e-1")->what),
            (PushOrder{PushOrder::On::kTool, Vec3(0, 0, 0.1), Vec3(20, -3.5, 0), 0.2}));
  const auto vehicle = std::get<VehicleOrder>(parsePageMessage("vehicle 1 2 0.5 3 1.5")->what);
  EXPECT_EQ(vehicle.to, (VehicleFactors{2.0, 0.5, 3.0}));
  EXPECT_EQ(vehicle.over, 1.5);
  EXPECT_EQ(std::get<PageMessage::Pace>(parsePageMessage("pace 3 0")->what).rate, 0.0);
  for (const char* text : {"",
                           "drawn ",
                           "Drawn",
                           "stop",
                           "stop ",
                           "stop 0",
                           "stop -1",
                           "stop 1x",
                           "stop +1",
                           "stop 1 ",
                           " stop 1",
                           "stop 1 2",
                           "stop 9223372036854775808",
                           "stop 0x1",
                           "start 1",
                           "push 1 tool 20 0 0 0.2 0 0",
                           "push 1 tool 20 0 0 0.2 0 0 0 0",
                           "push 1 arm 20 0 0 1 0 0 0",
                           "push 1 tool 150 150 0 1 0 0 0",
                           "push 1 tool nan 0 0 1 0 0 0",
                           "push 1 tool 1 0 0 0 0 0 0",
                           "push 1 tool 1 0 0 61 0 0 0",
                           "push 1 tool inf 0 0 1 0 0 0",
                           "vehicle 1 2 3",
                           "vehicle 1 1000 1 1 2",
                           "vehicle 1 -1 1 1 2",
                           "vehicle 1 1 1 1 nan",
                           "pace 1 -1",
                           "pace 1 1e-12",
                           "pace 1 1e9",
                           "pace 1 nan",
                           "pace 1"})
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
  const Motion& base = emulated->base;
  EXPECT_FALSE(base.point(-1));
  EXPECT_LT((*base.point(0) - commanded(run.series).x.front()).norm(), 1e-12);
  const auto last = std::ssize(base.x) - 1;
  EXPECT_TRUE(base.point(last));
  EXPECT_FALSE(base.point(last + 1));
  // Live, it begins where the platform is let go: the same motion.
  test::expectFollowed(run.series, base);
}

TEST(Still, IsADrawingOfEveryBody) {
  const Experiment e = test::experiment("srms_low_hover_puma");
  const auto count = [](const std::string& text, const char* what) {
    std::size_t n = 0;
    for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; ++at) ++n;
    return n;
  };
  const std::string platform = stillAtStart(e, StillView::kPlatform),
                    arm = stillAtStart(e, StillView::kArm);
  EXPECT_EQ(count(platform, "<polygon"), 2u);  // two plates
  EXPECT_EQ(count(arm, "<polyline"), count(platform, "<polyline") + 21u);
  EXPECT_EQ(count(platform, "nan"), 0u);
  // What is seen of the arm is larger: by its length, 15 m.
  const auto width = [](const std::string& svg) {
    double x, y, w, h;
    EXPECT_EQ(std::sscanf(svg.c_str(), "<svg viewBox=\"%lf %lf %lf %lf", &x, &y, &w, &h), 4);
    return std::max(w, h);
  };
  EXPECT_LT(width(platform), 5.0);
  EXPECT_GT(width(arm), 7.0);
}

TEST(Still, ShowsLegsBetweenPlatesAndAllOfItFits) {
  const Experiment e = test::experiment("puma_on_table_4_1");
  const std::string svg = stillAtStart(e, StillView::kPlatform);
  const std::vector<Drawn> all = drawnIn(svg);
  const Geometry& g = e.plant.geometry;
  const Transform X_IP = g.fromHome(Pose());
  const auto plate = [&](const Vec3& corner) {
    return std::find_if(all.begin(), all.end(), [&](const Drawn& d) {
      return d.closed && std::any_of(d.at.begin(), d.at.end(), [&](const Eigen::Vector2d& p) {
               return (p - seen(corner)).norm() < 3e-4;
             });
    });
  };
  const auto platform = plate(X_IP * g.p_PPi_P[0]);
  ASSERT_NE(platform, all.end());
  const auto depth = [](const Vec3& p) { return Vec3(0.62, -0.95, 0.5).dot(p); };
  Vec3 middle = Vec3::Zero();
  for (const Vec3& p : g.p_PPi_P) middle += X_IP * p / kLegs;
  for (std::size_t i = 0; i < kLegs; ++i) {
    const Vec3 from = g.p_IBi_I[i], to = X_IP * g.p_PPi_P[i], along = (to - from).normalized();
    const double least = e.plant.actuator.length_min;
    const auto line = [&](const Vec3& a, const Vec3& b) {
      return std::find_if(all.begin(), all.end(), [&](const Drawn& d) { return d.joins(a, b); });
    };
    const auto cylinder = line(from, from + 0.85 * least * along);
    ASSERT_NE(cylinder, all.end()) << i;
    // What is nearer to the eye covers what is behind.
    EXPECT_EQ(cylinder > platform, depth(from + 0.425 * least * along) > depth(middle)) << i;
    EXPECT_NE(line(to, to - least * along), all.end()) << i;
  }
  Eigen::AlignedBox2d box;
  for (const Drawn& d : all)
    for (const Eigen::Vector2d& p : d.at)
      for (const double side : {-0.5, 0.5})
        box.extend(Eigen::Vector2d(p + Eigen::Vector2d::Constant(side * d.width)));
  double x, y, w, h;
  ASSERT_EQ(std::sscanf(svg.c_str(), "<svg viewBox=\"%lf %lf %lf %lf", &x, &y, &w, &h), 4);
  const double margin = 0.03 * box.diagonal().norm();
  EXPECT_NEAR(x, box.min().x() - margin, 1e-3);
  EXPECT_NEAR(y, box.min().y() - margin, 1e-3);
  EXPECT_NEAR(w, box.sizes().x() + 2.0 * margin, 1e-3);
  EXPECT_NEAR(h, box.sizes().y() + 2.0 * margin, 1e-3);
}

// Every drawing shows the joints of the platform where the log says that they were.
TEST(Moving, FollowsTheRun) {
  const RecordedRun run = puma();
  const double from = 1.0, to = 5.0, rate = 4.0;
  const std::string svg = moving(run.series, {from, to, rate});
  EXPECT_NE(svg.find("dur=\"4s\""), std::string::npos);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  // The platform's plate is the second polygon of the scene, which moves; the base's does not.
  const std::size_t polygon = svg.find("<polygon"),
                    animate = svg.find("<animate", svg.rfind("<polygon"));
  ASSERT_NE(polygon, std::string::npos);
  ASSERT_NE(animate, std::string::npos);
  const std::size_t begin = svg.find("values=\"", animate) + 8;
  std::istringstream drawings(svg.substr(begin, svg.find('"', begin) - begin));
  const Geometry& g = run.series.experiment.plant.geometry;
  int k = 0;
  for (std::string drawing; std::getline(drawings, drawing, ';'); ++k) {
    const auto row = std::find_if(run.series.rows.begin(), run.series.rows.end(),
                                  [&](const Row& r) { return r.t >= from + k / rate - 1e-6; });
    const Transform X_IP = g.fromHome(Pose::from(Vec6::Map(row->truth.x)));
    for (const Vec3& p : g.p_PPi_P) {
      const Eigen::Vector2d at = seen(X_IP * p);
      EXPECT_NE(drawing.find(fmt::format("{:.4f},{:.4f}", at.x(), at.y())), std::string::npos) << k;
    }
  }
  EXPECT_EQ(k, 17);
  // A line from each caption to what it tells of.
  const auto first = std::find_if(run.series.rows.begin(), run.series.rows.end(),
                                  [&](const Row& r) { return r.t >= from - 1e-6; });
  const Transform X_IP = g.fromHome(Pose::from(Vec6::Map(first->truth.x)));
  const Vec3 corner = X_IP * g.p_PPi_P[0];
  const std::vector<Drawn> all = drawnIn(svg);
  for (const Vec3& told : {corner, Vec3(0.5 * (corner + g.p_IBi_I[0])),
                           Vec3(X_IP * run.series.experiment.plant.payload.X_PS.p)})
    EXPECT_TRUE(std::any_of(all.begin(), all.end(), [&](const Drawn& d) {
      return d.at.size() == 2 && (d.at[0] - seen(told)).norm() < 2e-3 &&
             d.at[1].x() > seen(told).x();
    }));
  EXPECT_EQ(moving(run.series, {5.0, 5.0, rate}).find("<animate"), std::string::npos);
  EXPECT_THROW(moving(run.series, {500.0, 501.0, rate}), InputError);
}

TEST(Marks, AreWhereSegmentsAndTheRobotBegin) {
  const RecordedRun run = puma();
  const std::vector<Mark> segments = segmentMarks(run.series);
  ASSERT_GE(segments.size(), 5u);
  const auto admittance = std::find_if(segments.begin(), segments.end(),
                                       [](const Mark& m) { return m.name == "admittance"; });
  ASSERT_NE(admittance, segments.end());
  double start = NAN;
  eachTick(run.series, [&](const Row& row, double t) {
    if (t == 0.0) start = row.t;
  });
  EXPECT_EQ(admittance->x, start);
  EXPECT_EQ(segments.back().name, "parked");
  EXPECT_TRUE(robotMarks(run.series.experiment, 0).empty());
  const std::vector<Mark> robot = robotMarks(run.series.experiment, 2);
  ASSERT_EQ(robot.size(), 2u);
  EXPECT_EQ(robot[0].name, "joint_2");
  EXPECT_EQ(robot[0].x, 0.0);
  EXPECT_EQ(robot[1].name, "at rest");
  EXPECT_EQ(robot[1].x, 1.0);
  const Experiment two = test::experiment(
      "puma_on_table_4_1",
      {"program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 9}, robot: [{at_s: 0, "
       "duration_s: 1, joint: joint_2, to_deg_or_m: -60}, {at_s: 0, duration_s: 3, joint: joint_1, "
       "to_deg_or_m: 10}, {at_s: 2, duration_s: 0.5, joint: joint_2, to_deg_or_m: -50}, {at_s: 5, "
       "duration_s: 1, joint: joint_2, to_deg_or_m: -60}]}]"});
  std::string said;
  for (const Mark& m : robotMarks(two, 2)) said += fmt::format("{}: {}; ", m.x, m.name);
  EXPECT_EQ(said, "0: joint_2, joint_1; 2: joint_2; 3: at rest; 5: joint_2; 6: at rest; ");
  // Names that would lie over each other are left out, and marks beside the axis.
  const std::string lines =
      markLines({{-0.1, "early"}, {1.0, "a"}, {1.01, "b"}, {2.0, "c"}, {10.1, "late"}}, 0.0, 10.0);
  EXPECT_NE(lines.find("'a'"), std::string::npos);
  EXPECT_EQ(lines.find("'b'"), std::string::npos);
  EXPECT_NE(lines.find("'c'"), std::string::npos);
  EXPECT_NE(lines.find("from 1.01,"), std::string::npos);
  EXPECT_EQ(lines.find("from -0.1,"), std::string::npos);
  EXPECT_EQ(lines.find("from 10.1,"), std::string::npos);
}

TEST(Page, BytesAreWrittenAsRfc4648Does) {
  // 0.0f is four zero bytes, 1.0f 00 00 80 3f.
  EXPECT_EQ(base64({}), "");
  EXPECT_EQ(base64({0.0f}), "AAAAAA==");
  EXPECT_EQ(base64({1.0f}), "AACAPw==");
  EXPECT_EQ(base64({1.0f, 1.0f}), "AACAPwAAgD8=");
  EXPECT_EQ(base64({1.0f, 1.0f, 1.0f}), "AACAPwAAgD8AAIA/");
}

std::vector<std::uint8_t> bytesOf(const std::string& base64) {
  std::vector<std::uint8_t> out(base64.size() / 4 * 3);
  const std::string letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (std::size_t i = 0; i < out.size(); ++i) {
    const auto six = [&](std::size_t k) {
      return k < base64.size() && base64[k] != '=' ? letters.find(base64[k]) : 0u;
    };
    const std::size_t at = i / 3 * 4;
    const std::size_t word = six(at) << 18 | six(at + 1) << 12 | six(at + 2) << 6 | six(at + 3);
    out[i] = static_cast<std::uint8_t>(word >> (16 - 8 * (i % 3)));
  }
  return out;
}

// Every tick of every column, whatever the rate of the pictures; as exact as 16 bits are.
TEST(Page, HasEveryTickOfEveryColumn) {
  RecordedRun run = puma();
  run.series.rows[7].has_sample = false;  // a gap in what is the same all the time, too
  std::vector<std::string> warnings;
  const auto shown = recording(run.series, 5.0, warnings)["columns"];
  const std::vector<Row>& rows = run.series.rows;
  const std::vector<std::uint8_t> t = bytesOf(shown["t"]);
  std::size_t seen = 0;
  for (const Column& column : columns(run.series.experiment)) {
    const auto it = std::find_if(shown["curves"].begin(), shown["curves"].end(),
                                 [&](const auto& c) { return c["name"] == column.name; });
    ASSERT_NE(it, shown["curves"].end()) << column.name;
    if (column.name.find("_dynamic_") != std::string::npos) continue;  // hidden until calibrated
    if (it->contains("value")) {
      for (const Row& row : rows) {
        const double due = column.value(row);
        if (std::isnan(due))
          EXPECT_TRUE((*it)["value"].is_null()) << column.name;
        else
          EXPECT_EQ((*it)["value"].template get<float>(), static_cast<float>(due)) << column.name;
      }
      continue;
    }
    ++seen;
    const std::vector<std::uint8_t> counts = bytesOf((*it)["counts"]);
    const double least = (*it)["least"], step = (*it)["step"];
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const int count = counts[2 * i] | counts[2 * i + 1] << 8;
      const double due = column.value(rows[i]);
      if (std::isnan(due)) {
        EXPECT_EQ(count, 65535);
      } else {
        EXPECT_NEAR(least + step * count, due, 0.51 * step + 1e-6 * std::abs(due)) << column.name;
      }
      float time = NAN;
      std::memcpy(&time, t.data() + 4 * i, sizeof time);
      EXPECT_EQ(time, static_cast<float>(rows[i].t));
    }
  }
  EXPECT_GT(seen, 60u);
  // And the base in free space, where there is one.
  const std::size_t n = shown["curves"].size();
  const char* const base[] = {"x_base_m",       "y_base_m",      "z_base_m",
                              "alpha_base_rad", "beta_base_rad", "gamma_base_rad"};
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(shown["curves"][n - 6 + i]["name"], base[i]);
    EXPECT_TRUE(shown["curves"][n - 6 + i].contains("counts")) << base[i];
  }
}

TEST(Page, HasAPictureForEveryInstantThatCanBeSeen) {
  const RecordedRun run = puma();
  std::vector<std::string> warnings;
  const auto shown = recording(run.series, 50.0, warnings);
  EXPECT_TRUE(warnings.empty());
  const std::size_t numbers = shown["pictures"].get<std::string>().size() / 4 * 3 / 4;
  const std::size_t pictures = numbers / shown["width"].get<std::size_t>();
  EXPECT_NEAR(static_cast<double>(pictures), 0.5 * static_cast<double>(run.series.rows.size()),
              2.0);
}

// --- Live, in a network of its own
// -----------------------------------------------------------------

class Live : public testing::Test {
 protected:
  static void SetUpTestSuite() { enterPrivateBus(); }

  Live() {
    controllers.subscribe({channel::kQuery},
                          [this](const std::string&, const void*, std::uint32_t) { ++queries; });
    controllers.subscribe({channel::kOperator},
                          [this](const std::string&, const void* data, std::uint32_t size) {
                            const auto m = decode<operator_t>(data, size);
                            ASSERT_TRUE(m);
                            EXPECT_EQ(m->controller, 9);
                            orders.insert({m->header.source, m->header.sequence});
                            ++requests[m->request];
                            last = *m;
                          });
    controllers.subscribe({channel::kRobot},
                          [this](const std::string&, const void* data, std::uint32_t size) {
                            EXPECT_EQ(decode<robot_command_t>(data, size)->machine, 77);
                            const auto order = fromMessage(*decode<robot_command_t>(data, size));
                            ASSERT_TRUE(order);
                            pushes.push_back(std::get<PushOrder>(*order));
                          });
    controllers.subscribe({channel::kPace},
                          [this](const std::string&, const void* data, std::uint32_t size) {
                            paces.push_back(decode<pace_t>(data, size)->rate);
                          });
  }
  void ask(const char* text) { live.take(*parsePageMessage(text)); }
  /// So many ticks more.
  void pass(int ticks) {
    until(9, 100, true, [n = 0, ticks]() mutable { return ++n > ticks; });
  }

  /// A state of a controller that began at `epoch`.
  void tell(std::int64_t source, std::int64_t epoch, std::int64_t number, bool engaged) {
    state_t state = toMessage(TickState(), {});
    state.header = header({source, epoch}, number, 0);
    state.phase = static_cast<int>(engaged ? Phase::kRunning : Phase::kDisarmed);
    state.segment = segment;
    state.kind = static_cast<int>(kind);
    state.x_desired[0] = 0.1;
    state.cause = static_cast<int>(Check::kCount);
    state.engaged = engaged;
    state.order_source = last.header.source;
    state.order_sequence = answers ? last.header.sequence : -1;
    state.refusal = static_cast<int>(refusal);
    leg_command_t command{};
    command.header = state.header;
    command.machine = 77;
    if (!silent) controllers.publish(channel::kLegCommand, command);
    controllers.publish(channel::kState, state);
  }
  void describe(std::int64_t source, std::int64_t epoch, const std::vector<std::string>& set = {}) {
    experiment_t e = ves::describe(test::experiment("free_decay", set), {source, epoch}, 0);
    controllers.publish(channel::kExperiment, e);
  }
  /// Goes on, a tick every 10 ms, until `done`.
  void until(std::int64_t source, std::int64_t epoch, bool engaged,
             const std::function<bool()>& done) {
    for (int i = 0; i < 500 && !done(); ++i) {
      tell(source, epoch, tick++, engaged);
      controllers.wait(10);
      controllers.drain();
      live.listen();
    }
    ASSERT_TRUE(done());
  }
  std::string newestPicture() const {
    std::int64_t number = 0;
    return live.pictures(live.newest() - 1, number);
  }
  double scalar(const char* name) {
    const auto scene = nlohmann::json::parse(live.scene());
    const auto& d = scene["scene"];
    std::size_t at = 7 * d["frames"].size() + 3 * d["arm"].size();
    for (const auto& one : d["scalars"]) {
      if (one == name) break;
      ++at;
    }
    const std::string bytes = newestPicture();
    EXPECT_EQ(bytes.size(), 24 + 4 * scene["width"].get<std::size_t>());
    float value = NAN;
    std::memcpy(&value, bytes.data() + 24 + 4 * at, sizeof value);
    return value;
  }

  Bus controllers{kDefaultUrl};
  LiveRun live{kDefaultUrl};
  std::int64_t queries = 0, tick = 700;
  std::map<int, int> requests;
  std::vector<PushOrder> pushes;
  std::vector<double> paces;
  Refusal refusal = Refusal::kNone;
  int segment = -1;
  SegmentKind kind = SegmentKind::kMove;
  std::set<std::pair<std::int64_t, std::int64_t>> orders;
  operator_t last{};
  bool answers = true, silent = false;  // silent: to its machine
};

TEST_F(Live, WhoJoinsLateAsksForTheConfigurationAndHasTheSameTime) {
  until(9, 100, true, [&] { return queries > 0; });
  EXPECT_EQ(live.edition(), 0);
  EXPECT_TRUE(newestPicture().empty());
  describe(8, 100);  // somebody else's
  until(9, 100, true, [&] { return queries > 1; });
  EXPECT_EQ(live.edition(), 0);
  experiment_t bad = ves::describe(test::experiment("free_decay"), {9, 100}, 0);
  bad.resolved = "name: [";
  controllers.publish(channel::kExperiment, bad);
  until(9, 100, true, [&] { return queries > 3; });  // it asks on
  EXPECT_EQ(live.edition(), 0);
  describe(9, 100);
  until(9, 100, true, [&] { return live.newest() > 3; });
  EXPECT_EQ(live.edition(), 1);
  EXPECT_NEAR(scalar("t_s"), 0.01 * static_cast<double>(tick), 0.05);
  EXPECT_GT(scalar("t_s"), 6.9);
}

// Whoever draws seldom gets every sample that was heard, in messages of bounded size.
TEST_F(Live, NoSampleIsLeftOutBetweenTwoPictures) {
  describe(9, 100);
  until(9, 100, true, [&] { return live.edition() == 1 && live.newest() > 0; });
  std::int64_t got = live.newest();
  const std::int64_t from = got;
  for (int i = 0; i < 1300; ++i) {
    tell(9, 100, tick++, true);
    if (i % 20 == 0) live.listen();
  }
  until(9, 100, true, [&] { return live.newest() >= from + 1300; });
  const auto scene = nlohmann::json::parse(live.scene());
  const std::size_t width = 4 * scene["width"].get<std::size_t>(),
                    at_time = 4 * (7 * scene["scene"]["frames"].size() +
                                   3 * scene["scene"]["arm"].size());
  std::vector<float> times;
  std::size_t messages = 0;
  for (std::string bytes; !(bytes = live.pictures(got, got)).empty(); ++messages) {
    ASSERT_EQ((bytes.size() - 24) % width, 0u);
    double number = 0.0;
    std::memcpy(&number, bytes.data(), sizeof number);
    EXPECT_EQ(number, static_cast<double>(got));
    const std::size_t before = times.size();
    for (std::size_t at = 24; at < bytes.size(); at += width) {
      float t = NAN;
      std::memcpy(&t, bytes.data() + at + at_time, sizeof t);
      times.push_back(t);
    }
    EXPECT_LE(times.size() - before, 500u);
  }
  EXPECT_EQ(got, live.newest());
  EXPECT_GE(messages, 3u);
  ASSERT_EQ(static_cast<std::int64_t>(times.size()), live.newest() - from);
  for (std::size_t i = 1; i < times.size(); ++i) ASSERT_NEAR(times[i] - times[i - 1], 0.01, 1e-4);
}

TEST_F(Live, TheBaseIsShownToWhoSawItLetGo) {
  const int admittance = admittanceSegment(test::experiment("free_decay").controller.program);
  const auto base = [&] {  // the second frame
    float x = NAN;
    std::memcpy(&x, newestPicture().data() + 24 + 4 * 7, sizeof x);
    return x;
  };
  describe(9, 100);
  segment = admittance;
  kind = SegmentKind::kAdmittance;
  until(9, 100, true, [&] { return live.newest() > 30; });
  EXPECT_TRUE(std::isnan(base()));  // it joined in the middle of it
  describe(10, 200);
  segment = 0;
  kind = SegmentKind::kMove;
  until(10, 200, true, [&] { return live.edition() == 2 && live.newest() > 60; });
  EXPECT_TRUE(std::isnan(base()));
  segment = admittance;
  kind = SegmentKind::kAdmittance;
  const std::int64_t start = tick;
  until(10, 200, true, [&] { return !std::isnan(base()); });
  // Table 4.1 in x, let go 0.1 m from home: 500 kg, 500 N s/m, 1500 N/m.
  const double t = 0.01 * (scalar("t_s") * 100.0 - static_cast<double>(start)),
               wd = std::sqrt(2.75);
  EXPECT_NEAR(base(), 0.1 * std::exp(-0.5 * t) * (std::cos(wd * t) + 0.5 / wd * std::sin(wd * t)),
              1e-4);
}

TEST_F(Live, ShowsTheControllerThatHasTheLegs) {
  describe(9, 100);
  until(9, 100, true, [&] { return live.edition() == 1 && live.newest() > 0; });
  // A younger one that is not engaged, and an older one that is.
  for (int i = 0; i < 20; ++i) {
    describe(10, 200);
    tell(10, 200, i, false);
    tell(7, 50, i, true);
    until(9, 100, true, [n = 0]() mutable { return ++n > 3; });
  }
  EXPECT_EQ(live.edition(), 1);
  describe(10, 200);
  until(10, 200, true, [&] { return live.edition() == 2; });  // it has the legs, and is the newest
}

TEST_F(Live, NothingOfOneControllerIsTakenForAnothers) {
  describe(9, 100);
  until(9, 100, true, [&] { return live.newest() > 10; });
  const std::int64_t before = live.newest();
  describe(10, 200);
  silent = true;
  until(10, 200, true, [&] { return live.edition() == 2 && live.newest() > before; });
  ask("push 2 platform 20 0 0 0.2 0 0 0.1");  // whose machine is not known yet
  until(10, 200, true, [n = 0]() mutable { return ++n > 20; });
  EXPECT_TRUE(pushes.empty());
  std::int64_t got = 0;
  const std::string bytes = live.pictures(0, got);
  EXPECT_LE(
      (bytes.size() - 24) / 4 / nlohmann::json::parse(live.scene())["width"].get<std::size_t>(),
      static_cast<std::size_t>(live.newest() - before));
}

TEST_F(Live, AStopIsRepeatedUntilItIsTakenAndIsOneOrder) {
  answers = false;
  describe(9, 100);
  until(9, 100, true, [&] { return live.newest() > 0; });
  const int& stops = requests[static_cast<int>(Request::kStop)];
  ask("stop 2");  // of a scene that is not shown
  pass(50);
  EXPECT_EQ(stops, 0);
  ask("stop 1");
  ask("stop 1");
  until(9, 100, true, [&] { return stops >= 3; });
  EXPECT_EQ(scalar("stop_asked"), 1.0);
  answers = true;
  until(9, 100, true, [&] { return scalar("stop_asked") == 2.0; });
  const int sent = stops;
  pass(100);
  EXPECT_EQ(stops, sent);
  EXPECT_EQ(orders.size(), 1u);
}

TEST_F(Live, AnotherVehicleIsAskedForAndTheAnswerShown) {
  describe(9, 100);
  until(9, 100, true, [&] { return live.newest() > 0; });
  EXPECT_EQ(scalar("vehicle_asked"), 0.0);
  refusal = Refusal::kChecking;  // not an answer yet
  ask("vehicle 1 2 1 3 1.5");
  until(9, 100, true, [&] { return requests[static_cast<int>(Request::kVehicle)] >= 2; });
  EXPECT_EQ(last.vehicle_mass, 2.0);
  EXPECT_EQ(last.vehicle_stiffness, 3.0);
  EXPECT_EQ(scalar("vehicle_asked"), 1.0);
  refusal = Refusal::kUnstable;
  until(9, 100, true, [&] { return scalar("vehicle_asked") == 2.0; });
  EXPECT_EQ(scalar("vehicle_refusal"), static_cast<double>(Refusal::kUnstable));
}

TEST_F(Live, APushAndAPaceGoToAMachineThatIsAllSimulated) {
  describe(9, 100);
  until(9, 100, true, [&] { return live.newest() > 0; });
  ask("push 1 platform 20 0 0 0.2 0 0 0.1");
  ask("push 1 tool 20 0 0 0.2 0 0 0.1");      // there is none
  ask("push 2 platform 20 0 0 0.2 0 0 0.1");  // of a scene that is not shown
  ask("pace 1 0.1");
  pass(20);
  ASSERT_EQ(pushes.size(), 1u);
  EXPECT_EQ(pushes[0], (PushOrder{PushOrder::On::kPlatform, Vec3(0, 0, 0.1), Vec3(20, 0, 0), 0.2}));
  EXPECT_EQ(paces, std::vector<double>{0.1});
}

TEST_F(Live, NothingButAStopReachesAMachineWithARealPiece) {
  describe(9, 100, {"machine.legs=external"});
  until(9, 100, true, [&] { return live.newest() > 0; });
  EXPECT_FALSE(nlohmann::json::parse(live.scene())["scene"]["simulated"].get<bool>());
  ask("push 1 platform 20 0 0 0.2 0 0 0.1");
  ask("vehicle 1 2 1 3 1.5");
  ask("pace 1 0.1");
  ask("stop 1");
  pass(40);
  EXPECT_TRUE(pushes.empty() && paces.empty());
  EXPECT_EQ(requests[static_cast<int>(Request::kVehicle)], 0);
  EXPECT_GT(requests[static_cast<int>(Request::kStop)], 0);
}

}  // namespace
}  // namespace ves
