// SPDX-License-Identifier: BSD-3-Clause
#include "robot_events.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "readers.hpp"

namespace ves {
namespace {

constexpr double kFar = 100.0;  // [m]

void readPlace(Section s, ToolOrder& order) {
  if (s.has("position_m")) order.position = s.vector("position_m", 3, -kFar, kFar);
  if (s.has("via_m")) order.via = s.vector("via_m", 3, -kFar, kFar);
  if (s.has("rpy_deg")) order.rpy = s.vector("rpy_deg", 3, -360.0, 360.0) * kDegree;
  if (!order.position && !order.rpy) s.fail("position_m", "missing, want it, rpy_deg or both");
  s.finish();
}

/// [s] after which the controller is told; none: never.
std::optional<double> readDelay(Section& s) {
  if (!s.has("told_after_s")) return {};
  return s.number("told_after_s", 0.0, 1e5);
}

std::string secondsOf(std::int64_t ns) {
  return fmt::format("{:.9g} s", static_cast<double>(ns) * kSecondPerNanosecond);
}

/// "tool" of an event, with its duration_s or speed_m_per_s.
ToolOrder readToolOrder(Section& s) {
  ToolOrder order;
  Section tool = s.section("tool");
  const std::string kind = tool.onlyKey({"to", "by"}, {"in"});
  order.by = kind == "by";
  readPlace(tool.section(kind), order);
  if (tool.has("in")) {
    const std::string in =
        tool.choice("in", {kToolFrameNames[0], kToolFrameNames[1], kToolFrameNames[2]});
    order.in = static_cast<ToolOrder::Frame>(
        std::find(std::begin(kToolFrameNames), std::end(kToolFrameNames), in) -
        std::begin(kToolFrameNames));
  }
  tool.finish();
  if (s.has("duration_s") == s.has("speed_m_per_s"))
    s.fail("duration_s", "or speed_m_per_s, want one of the two");
  if (s.has("duration_s"))
    order.duration = s.number("duration_s", 1e-2, 1e4);
  else
    order.speed = s.number("speed_m_per_s", 1e-5, 100.0);
  return order;
}

}  // namespace

RobotEvents::RobotEvents(Experiment& out)
    : robot_(out.robot),
      out_(out),
      paths_(out.robot.model.joints, out.plant.task.initial_joints),
      q_(out.plant.task.initial_joints),
      stands_(out.plant.initial_pose) {}

void RobotEvents::pass(const Segment& segment) {
  if (segment.kind == SegmentKind::kMove) stands_ = segment.target;
  if (segment.kind == SegmentKind::kTrajectory && stands_) {
    const double period = out_.controller.periodSeconds();
    const std::int64_t steps = std::llround(segment.duration / period);
    stands_ = Pose::from(
        trajectoryGeneration(segment.trajectory, stands_->stacked(), steps, steps, period).x);
  }
  if (segment.kind == SegmentKind::kAdmittance) stands_.reset();
  if (segment.kind == SegmentKind::kPath)
    stands_ = Pose::from(out_.controller.path.col(out_.controller.path.cols() - 1));
  began_ += std::llround(segment.duration * 1e9);
}

void RobotEvents::read(Section& s, const Cue& cue) {
  using Read = void (RobotEvents::*)(Section&, const Cue&);
  constexpr std::pair<std::string_view, Read> kKinds[] = {
      {"joint", &RobotEvents::readJoint},     {"tool", &RobotEvents::readTool},
      {"grasp", &RobotEvents::readGrasp},     {"release", &RobotEvents::readRelease},
      {"gripper", &RobotEvents::readGripper}, {"push", &RobotEvents::readPush}};
  const auto* found = std::end(kKinds);
  for (const auto& kind : kKinds) {
    if (!s.has(kind.first)) continue;
    if (found != std::end(kKinds))
      s.fail(kind.first, fmt::format("beside {}, want only one of them", found->first));
    found = &kind;
  }
  if (found == std::end(kKinds))
    s.fail("joint", "missing, want it, tool, grasp, release, gripper or push");
  if (robot_.frames.empty() && found->first != "push") s.fail(found->first, "there is no robot");
  const std::int64_t end = std::llround(segmentOf(cue).duration * 1e9);
  if (end > 0 && cue.after >= end)
    s.fail("at_s",
           fmt::format("{}, but the segment ends after {}", secondsOf(cue.after), secondsOf(end)));
  (this->*found->second)(s, cue);
  s.finish();
}

void RobotEvents::moved(const Cue& cue, const RobotAction& action, std::int64_t until) {
  out_.plant.task.robot_events.push_back({cue, action});
  if (const auto* move = std::get_if<RobotMove>(&action)) {
    q_(move->joint) = move->target;
    until_[static_cast<std::size_t>(move->joint)] = until;
  } else if (const auto* path = std::get_if<ToolMove>(&action)) {
    q_ = path->joints->end();
    paths_ = JointPaths(robot_.model.joints, q_);
    until_.fill(until);
    path_until_ = until;
  }
}

void RobotEvents::readJoint(Section& s, const Cue& cue) {
  RobotMove move;
  move.duration = s.number("duration_s", 1e-3, 1e5);
  const std::string joint = s.text("joint");
  const auto at = std::find(robot_.joint_names.begin(), robot_.joint_names.end(), joint);
  if (at == robot_.joint_names.end())
    s.fail("joint",
           fmt::format("'{}', want one of {}", joint, fmt::join(robot_.joint_names, ", ")));
  move.joint = static_cast<int>(at - robot_.joint_names.begin());
  move.target =
      s.number("to_deg_or_m", -1e6, 1e6) * jointUnit(robot_.model.jointLink(move.joint).type);
  requireInLimits(s, "to_deg_or_m", robot_, move.joint, move.target);
  if (path_until_ > sinceStart(cue))
    s.fail("at_s", fmt::format("the tool path before it may last until {}",
                               secondsOf(path_until_ - began_)));
  const std::string why = whyTooFast(robot_, move, paths_.at(sinceStart(cue)));
  if (!why.empty()) s.fail("duration_s", why);
  paths_.move(move, sinceStart(cue));
  moved(cue, move, sinceStart(cue) + std::llround(move.duration * 1e9));
}

/// The tool, where the robot has one.
const NamedFrame& RobotEvents::tool(const Section& s, std::string_view key) const {
  if (!robot_.tool()) s.fail(key, "the robot has several ends, want tip: LINK in it");
  return *robot_.tool();
}

ToolPlanner& RobotEvents::planner(const Section& s) {
  const NamedFrame& frame = tool(s, "tool");
  try {
    if (!planner_)
      planner_ = std::make_unique<ToolPlanner>(robot_.model, frame.link, frame.X_link,
                                               robot_.fastest, robot_.joint_names,
                                               out_.controller.safety.tool_singularity);
  } catch (const InputError& error) {
    s.fail("tool", error.what());
  }
  return *planner_;
}

/// X_FL0 of a frame of orders.
Transform RobotEvents::frameOf(Section& s, const Cue& cue, ToolOrder::Frame frame) {
  const Transform X_PL0 = out_.controller.payload.X_PL0();
  if (frame != ToolOrder::Frame::kInertial) return baseIn(frame, {}, X_PL0);
  const SegmentKind kind = segmentOf(cue).kind;
  if (kind == SegmentKind::kMove || kind == SegmentKind::kTrajectory || kind == SegmentKind::kPath)
    s.fail("tool", fmt::format("in: inertial while a {} leads the platform, want robot or platform",
                               name(kind)));
  if (!stands_)
    s.fail("tool",
           "in: inertial, but admittance control has left the platform anywhere; a move "
           "before it would tell");
  const Vec6 x = stands_->stacked();
  out_.source.warnings.push_back(
      fmt::format("program[{}]: the tool path at {} is planned for a platform that stands where it "
                  "is commanded: [{:.4g}] m, [{:.4g}] rad",
                  cue.segment, secondsOf(cue.after), fmt::join(x.data(), x.data() + 3, ", "),
                  fmt::join(x.data() + 3, x.data() + 6, ", ")));
  return baseIn(frame, out_.controller.geometry.fromHome(*stands_), X_PL0);
}

void RobotEvents::readTool(Section& s, const Cue& cue) {
  const ToolOrder order = readToolOrder(s);
  for (std::size_t i = 0; i < until_.size(); ++i)
    if (until_[i] > sinceStart(cue))
      s.fail("at_s", fmt::format("joint '{}' may move until {}, want the tool path after that",
                                 robot_.joint_names[i], secondsOf(until_[i] - began_)));
  const ToolPlanner& planned = planner(s);
  const Transform X_FL0 = frameOf(s, cue, order.in);
  ToolMove move;
  try {
    move.joints =
        std::make_shared<JointTrajectory>(planned.plan(q_, goalOf(order, X_FL0, planned.pose(q_))));
  } catch (const InputError& error) {
    s.fail("tool", error.what());
  }
  moved(cue, move, sinceStart(cue) + std::llround(move.joints->duration() * 1e9));
}

void RobotEvents::readGrasp(Section& s, const Cue& cue) {
  const NamedFrame& frame = tool(s, "grasp");
  if (holds_) s.fail("grasp", "the robot has something in hand, want a release before");
  holds_ = true;
  Section grasp = s.section("grasp");
  if (grasp.has("target") && grasp.flag("target")) {
    const std::optional<World>& world = out_.plant.task.world;
    if (!world || !world->environment.target || !world->environment.grip)
      grasp.fail("target", "there is none, or no grip, in this scenario's environment");
    grasp.finish();
    moved(cue, GraspTarget{}, sinceStart(cue));
    return;
  }
  const std::optional<double> delay = readDelay(grasp);
  const RigidBody body = combine(RigidBody{}, frame.X_link, readBody(grasp));
  moved(cue, Grasp{frame.link, body}, sinceStart(cue));
  tell(s, cue, delay, {cue, frame.link, body});
}

void RobotEvents::readRelease(Section& s, const Cue& cue) {
  if (!holds_) s.fail("release", "the robot has nothing in hand");
  holds_ = false;
  Section release = s.section("release");
  const std::optional<double> delay = readDelay(release);
  release.finish();
  moved(cue, Release{}, sinceStart(cue));
  tell(s, cue, delay, {cue, -1, {}});
}

void RobotEvents::readGripper(Section& s, const Cue& cue) {
  tool(s, "gripper");
  if (!out_.controller.compensation.learns_masses)
    s.fail("gripper",
           "what it holds is to be learnt, want 'learns_masses: true' in controller.compensation");
  if (!s.flag("gripper")) s.fail("gripper", "want true");
  ToldLoad moved;
  moved.cue = cue;
  moved.known = false;
  tell(s, cue, 0.0, moved);
}

void RobotEvents::readPush(Section& s, const Cue& cue) {
  Section push = s.section("push");
  PushOrder order;
  const std::string on = push.choice("on", {kPushedNames[0], kPushedNames[1], kPushedNames[2]});
  order.on = static_cast<PushOrder::On>(
      std::find(std::begin(kPushedNames), std::end(kPushedNames), on) - std::begin(kPushedNames));
  order.force_I = push.vector("force_n", 3, -kMostPush, kMostPush);
  if (push.has("at_m")) order.point = push.vector("at_m", 3, -kFar, kFar);
  push.finish();
  order.duration = s.number("duration_s", kShortestPush, kLongestPush);
  const std::string why = whyNotPushed(out_, order);
  if (!why.empty()) s.fail("push", why);
  const NamedFrame* tip = robot_.tool();
  moved(cue, pushOf(order, tip ? tip->link : -1, tip ? tip->X_link : Transform()), sinceStart(cue));
}

/// `delay` [s] after the event; none: the controller is not told.
void RobotEvents::tell(Section& s, const Cue& cue, std::optional<double> delay, ToldLoad load) {
  if (!delay) return;
  load.cue.after += std::llround(*delay * 1e9);
  const std::int64_t end = std::llround(segmentOf(cue).duration * 1e9);
  if (end > 0 && load.cue.after > end)
    s.fail("at_s", fmt::format("the controller would be told at {}, after its segment's end at {}",
                               secondsOf(load.cue.after), secondsOf(end)));
  ToldLoads& told = out_.controller.told_loads;
  if (told.size == kMaxToldLoads)
    s.fail("at_s",
           fmt::format("told of a load once too often, want at most {} times", kMaxToldLoads));
  told.loads[static_cast<std::size_t>(told.size++)] = load;
}

}  // namespace ves
