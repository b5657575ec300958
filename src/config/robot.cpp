// SPDX-License-Identifier: BSD-3-Clause
#include "readers.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <fstream>

namespace ves {

void requireInLimits(const Section& s, std::string_view key, const UrdfRobot& robot, int joint,
                     double q) {
  const Link& link = robot.model.jointLink(joint);
  const double unit = jointUnit(link.type);
  if (!(q >= link.lower - 1e-9 && q <= link.upper + 1e-9))
    s.fail(key, fmt::format("joint '{}' at {:.6g}, want [{:.6g}, {:.6g}] {}",
                            robot.joint_names[static_cast<std::size_t>(joint)], q / unit,
                            link.lower / unit, link.upper / unit, jointUnitName(link.type)));
}

std::string whyTooFast(const UrdfRobot& robot, const RobotMove& move, const JointState& from) {
  constexpr int kLooks = 200;  // [-] along the way
  const int j = move.joint;
  const PathPoint<1> begin{Eigen::Matrix<double, 1, 1>(from.q(j)),
                           Eigen::Matrix<double, 1, 1>(from.q_dot(j)),
                           Eigen::Matrix<double, 1, 1>(from.q_ddot(j))};
  const Quintic<1> path(begin, Eigen::Matrix<double, 1, 1>(move.target), move.duration);
  const double most = robot.fastest(j);
  double peak = 0.0;
  bool keeps = true;
  for (int i = 0; i <= kLooks; ++i) {
    const double speed = std::abs(path.at(move.duration * i / kLooks).x_dot(0));
    keeps = keeps && speed <= most * (1.0 + 1e-9);
    peak = std::max(peak, speed);
  }
  if (keeps) return "";
  const JointType type = robot.model.jointLink(j).type;
  return fmt::format(
      "joint '{}' would move at up to {:.4g} {}/s, want at most {:.4g}: {:.6g} s or more",
      robot.joint_names[static_cast<std::size_t>(j)], peak / jointUnit(type), jointUnitName(type),
      most / jointUnit(type), std::ceil(1e3 * move.duration * peak / most) * 1e-3);
}

/// [-] of the robot's frames: the tip, or the only frame that carries no other; -1: none.
static int tipOf(const UrdfRobot& robot, const std::string& tip) {
  std::vector<bool> carries(robot.frames.size());
  for (const NamedFrame& f : robot.frames)
    if (f.parent >= 0) carries[static_cast<std::size_t>(f.parent)] = true;
  int end = -1;
  for (int i = 0; i < static_cast<int>(robot.frames.size()); ++i) {
    if (robot.frames[static_cast<std::size_t>(i)].name == tip) return i;
    if (carries[static_cast<std::size_t>(i)]) continue;
    if (tip.empty() && end >= 0) return -1;
    end = i;
  }
  return end;
}

UrdfRobot chosenRobot(Section& s, const UrdfTree& tree) {
  const auto own = [&](std::string_view key, const std::string& name) -> const UrdfTree::Joint& {
    const UrdfTree::Joint* joint = tree.find(name);
    if (!joint) {
      std::string all;
      for (const UrdfTree::Joint& one : tree.joints())
        if (one.follows.empty()) all += (all.empty() ? "" : ", ") + one.name;
      s.fail(key, fmt::format("no joint '{}' that moves, want of {}", name, all));
    }
    if (!joint->follows.empty())
      s.fail(key, fmt::format("joint '{}' follows '{}', want that one", name, joint->follows));
    return *joint;
  };
  std::set<std::string> moving;
  if (s.has("tip") && s.has("joints")) s.fail("joints", "and tip both say it, want one of them");
  if (s.has("joints")) {
    for (const std::string& name : s.texts("joints"))
      if (!moving.insert(own("joints", name).name).second)
        s.fail("joints", fmt::format("'{}' is given twice", name));
  } else if (s.has("tip")) {
    const std::string tip = s.text("tip");
    if (!tree.hasLink(tip)) s.fail("tip", fmt::format("the robot has no link '{}'", tip));
    moving = tree.jointsTo(tip);
  } else {
    for (const UrdfTree::Joint& joint : tree.joints())
      if (joint.follows.empty()) moving.insert(joint.name);
  }
  std::map<std::string, double> held;
  if (s.has("lock")) {
    Section lock = s.section("lock");
    for (const std::string& name : lock.keys()) {
      const UrdfTree::Joint& joint = own("lock", name);
      if (s.has("joints") && moving.count(name))
        lock.fail(name, "joints lets it move, want one of the two");
      moving.erase(name);
      const double unit = jointUnit(joint.type);
      held[name] = lock.number(name, joint.lower / unit, joint.upper / unit) * unit;
    }
    lock.finish();
  }
  if (std::ssize(moving) > kMaxJoints)
    s.fail("urdf",
           fmt::format("{} joints move, at most {} may: say which with tip: LINK or joints: "
                       "[..], or hold some with lock: {{joint: value}}",
                       moving.size(), kMaxJoints));
  UrdfRobot out = tree.robot(moving, held);
  const bool chosen = s.has("tip") || s.has("joints") || s.has("lock");
  out.tip = tipOf(out, s.has("tip") ? s.text("tip") : "");
  bool serial = true;
  for (int i = 0; i < out.model.size; ++i)
    serial = serial && out.model.link(i).parent == i - 1 && out.model.link(i).joint == i;
  if (!chosen && !serial)
    out.choice =
        fmt::format("all {} joints of the robot move: {} (tip, joints or lock would choose)",
                    out.model.joints, fmt::join(out.joint_names, ", "));
  return out;
}

JointVector initialJoints(Section& s, const UrdfRobot& robot) {
  constexpr const char* kKey = "joints_deg_or_m";
  JointVector q = JointVector::Zero();
  const int joints = robot.model.joints;
  if (!s.has(kKey)) {
    for (int i = 0; i < joints; ++i) {
      const Link& link = robot.model.jointLink(i);
      q(i) = std::clamp(0.0, link.lower, link.upper);
    }
  } else if (joints > 0) {
    q.head(joints) = s.vector(kKey, joints, -1e6, 1e6);
    for (int i = 0; i < joints; ++i) {
      q(i) *= jointUnit(robot.model.jointLink(i).type);
      requireInLimits(s, kKey, robot, i, q(i));
    }
  } else if (!s.texts(kKey).empty()) {
    s.fail(kKey, "the robot has no joint that moves, want none");
  }
  return q;
}

/// A number a joint, or one for all of them; zeros where the key is left out.
static JointVector ofJoints(Section& s, std::string_view key, int joints, double lo, double hi) {
  JointVector out = JointVector::Zero();
  if (!s.has(key)) return out;
  if (s.isList(key))
    out.head(joints) = s.vector(key, joints, lo, hi);
  else
    out.head(joints).setConstant(s.number(key, lo, hi));
  return out;
}

static plant::JointEncoderModel readEncoders(Section s, const RobotModel& robot) {
  plant::JointEncoderModel out;
  constexpr const char* kCounts = "counts_per_turn";
  const JointVector counts = ofJoints(s, kCounts, robot.joints, 10.0, 1e10);
  out.play = ofJoints(s, "play_deg_or_m", robot.joints, 0.0, 10.0);
  out.noise = ofJoints(s, "noise_deg_or_m", robot.joints, 0.0, 10.0);
  for (int i = 0; i < robot.joints; ++i) {
    const Link& link = robot.jointLink(i);
    const double unit = jointUnit(link.type),
                 turn = link.type == JointType::kPrismatic ? 1.0 : 2.0 * M_PI;
    if (counts(i) > 0.0) out.count(i) = turn / counts(i);
    out.play(i) *= unit;
    out.noise(i) *= unit;
  }
  if (s.has("rate_hz")) out.interval = std::llround(1e9 / s.number("rate_hz", 1.0, 1e5));
  s.finish();
  return out;
}

/// How it stands on the platform.
static void readMounting(Section& s, Robot& robot) {
  robot.X_PR = {Mat3::Identity(), s.vector("adapter_position_m", 3, -10.0, 10.0)};
  robot.adapter_R = readBox(s.section("adapter"));
  robot.X_RL0 = {rotation(s.vector("mount_rpy_deg", 3, -360.0, 360.0) * kDegree),
                 s.vector("mount_m", 3, -10.0, 10.0)};
}

static void readJoints(Section& s, Robot& robot) {
  robot.q = initialJoints(s, robot.urdf);
  if (s.has("gripper_switch")) robot.gripper_switch = s.flag("gripper_switch");
  if (s.has("encoders")) robot.encoders = readEncoders(s.section("encoders"), robot.urdf.model);
}

Robot readRobot(Section s, const Value& document) {
  Robot robot;
  const Value* text = document.find("robot")->find("urdf_text");
  if (!text) s.fail("urdf", "missing, want the robot's URDF file");
  const UrdfTree tree(s.text("urdf_text"), *text->file);
  robot.urdf = chosenRobot(s, tree);
  readMounting(s, robot);
  readJoints(s, robot);
  s.finish();
  return robot;
}

/// By what is in it, whatever it is called; a pointer to a large file stands for a URDF.
static bool looksLikeXml(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  std::string head(64, '\0');
  in.read(head.data(), std::ssize(head));
  const std::size_t first = head.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  return first != std::string::npos &&
         (head[first] == '<' || head.compare(first, 19, "version https://git") == 0);
}

LoadedRobot loadRobot(const std::string& file, const std::vector<std::string>& overrides) {
  if (!std::filesystem::exists(file)) throw InputError(file + ": no such file");
  Value document = parseDocument("{}", file);
  applyOverride(document, fmt::format("robot.{}={}", looksLikeXml(file) ? "urdf" : "from", file));
  for (const std::string& one : overrides)  // as in a scenario, too
    applyOverride(document, one.starts_with("robot.") ? one : "robot." + one);
  const Value& value = *document.find("robot");
  Section s(value, "robot");
  const Value* text = value.find("urdf_text");
  if (!text) s.fail("urdf", "missing, want the robot's URDF file");
  Robot robot;
  robot.urdf = chosenRobot(s, UrdfTree(s.text("urdf_text"), *text->file));
  readJoints(s, robot);
  // A description alone does not say how it is mounted.
  constexpr std::string_view kMounting[] = {"adapter_position_m", "adapter", "mount_m",
                                            "mount_rpy_deg"};
  if (std::any_of(std::begin(kMounting), std::end(kMounting),
                  [&](std::string_view key) { return s.has(key); }))
    readMounting(s, robot);
  s.finish();
  return {*text->file, std::move(robot.urdf), robot.q};
}

}  // namespace ves
