// SPDX-License-Identifier: BSD-3-Clause
#include "ves/console/command.hpp"
#include "ves/core/coordinates.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>

namespace ves {
namespace {

constexpr double kMillimetre = 1e-3;  // [m]
constexpr double kLongest = 1e5;      // [s] of anything

/// The words of a line, taken one by one.
class Words {
 public:
  explicit Words(const std::string& line) {
    std::istringstream in(line);
    std::string word;
    while (in >> word) words_.push_back(word);
  }
  bool empty() const { return next_ == words_.size(); }
  std::string word(const char* what) {
    if (empty()) throw InputError(fmt::format("{}: missing", what));
    return words_[next_++];
  }
  double number(const std::string& what, double lo, double hi, const char* unit) {
    return parseNumber(word(what.c_str()), what, lo, hi, unit);
  }
  double seconds(const std::string& what = "seconds", double least = 0.01) {
    return number(what, least, kLongest, "s");
  }
  std::vector<std::string> rest() {
    std::vector<std::string> out(words_.begin() + static_cast<std::ptrdiff_t>(next_), words_.end());
    next_ = words_.size();
    return out;
  }
  void end() const {
    if (!empty()) throw InputError(fmt::format("'{}': one word too many", words_[next_]));
  }

 private:
  std::vector<std::string> words_;
  std::size_t next_ = 0;
};

int coordinateNamed(const std::string& word) {
  std::string names;
  for (int i = 0; i < 6; ++i) {
    if (word == coordinate(i).name) return i;
    names += fmt::format("{}{}", i ? ", " : "", coordinate(i).name);
  }
  throw InputError(fmt::format("'{}', want one of {}", word, names));
}

/// A length or an angle within the workspace, in SI.
double within(Words& words, const std::string& what, int i, const SafetyLimits& limits) {
  const Coordinate& c = coordinate(i);
  const double reach = (i < 3 ? limits.translation : limits.rotation) * c.shown;
  return words.number(what, -reach, reach, std::string(c.shown_unit).c_str()) / c.shown;
}

/// "ramp or sine".
std::string motionNames(std::string_view between) {
  std::vector<std::string_view> names;
  for (const MotionMeaning& one : kMotions)
    if (one.motion != AxisMotion::kHold) names.push_back(one.name);
  return fmt::format("{}", fmt::join(names, between));
}

/// "ramp TO | sine AMPLITUDE FREQUENCY", as the menu shows them.
std::string motionUsage() {
  std::vector<std::string> motions;
  for (const MotionMeaning& one : kMotions) {
    if (one.motion == AxisMotion::kHold) continue;
    motions.emplace_back(one.name);
    for (const MotionNumber& number : one.numbers)
      if (number.value)
        for (const char c : " " + std::string(number.word))
          motions.back() += static_cast<char>(std::toupper(c));
  }
  return fmt::format("SECONDS [COORDINATE {}]...", fmt::join(motions, " | "));
}

Segment trajectory(Words& words, const SafetyLimits& limits) {
  Segment s;
  s.kind = SegmentKind::kTrajectory;
  s.duration = words.seconds();
  while (!words.empty()) {
    const int i = coordinateNamed(words.word("coordinate"));
    const std::string name(coordinate(i).name);
    AxisMotion& motion = s.trajectory.motion[static_cast<std::size_t>(i)];
    if (motion != AxisMotion::kHold) throw InputError(name + ": given twice");
    const std::string word = words.word((name + ": " + motionNames(" or ")).c_str());
    for (const MotionMeaning& one : kMotions) {
      if (one.name != word || one.motion == AxisMotion::kHold) continue;
      motion = one.motion;
      for (const MotionNumber& number : one.numbers)
        if (number.value) {
          const std::string what = fmt::format("{} {}", name, number.word);
          (s.trajectory.*number.value)(i) = number.most > 0.0
                                                ? words.number(what, 0.0, number.most, "Hz")
                                                : within(words, what, i, limits);
        }
    }
    if (motion == AxisMotion::kHold)
      throw InputError(fmt::format("{}: '{}', want {}", name, word, motionNames(" or ")));
  }
  return s;
}

Segment move(Words& words, const SafetyLimits& limits) {
  Segment s;
  s.kind = SegmentKind::kMove;
  Vec6 target = Vec6::Zero();
  while (!words.empty()) {
    const std::string word = words.word("coordinate");
    if (word == "in") {
      s.duration = words.seconds("in", 0.1);
      continue;
    }
    const int i = coordinateNamed(word);
    target(i) = within(words, word, i, limits);
  }
  s.target = Pose::from(target);
  return s;
}

/// "in 2 stiffness 2 mass 0.5"; what is not named stays.
VehicleOrder vehicle(Words& words) {
  VehicleOrder order;
  const std::pair<const char*, double*> factors[] = {
      {"mass", &order.to.mass}, {"damping", &order.to.damping}, {"stiffness", &order.to.stiffness}};
  do {
    const std::string word = words.word("mass, damping, stiffness or in");
    if (word == "in") {
      order.over = words.seconds("in", 0.0);
      continue;
    }
    const auto* one = std::find_if(std::begin(factors), std::end(factors),
                                   [&](const auto& factor) { return word == factor.first; });
    if (one == std::end(factors))
      throw InputError(fmt::format("'{}', want mass, damping, stiffness or in", word));
    if (*one->second > 0.0) throw InputError(word + ": given twice");
    *one->second = words.number(word, kLeastVehicleFactor, kMostVehicleFactor, "times");
  } while (!words.empty());
  if (order.to == VehicleFactors{0.0, 0.0, 0.0})
    throw InputError("nothing to change, want mass, damping or stiffness");
  return order;
}

/// "0.5 0 3": two thrusters for half a second.
ThrustOrder thrust(Words& words, const Propulsion& propulsion) {
  if (propulsion.size == 0) throw InputError("the vehicle has no thrusters");
  const double seconds = words.number("seconds", 1e-3, kLongestThrust, "s");
  ThrustOrder order = ThrustOrder::Zero();
  do {
    const double number = words.number("thruster", 0, propulsion.size - 1, "(the first is 0)");
    const int at = static_cast<int>(number);
    if (static_cast<double>(at) != number)
      throw InputError(fmt::format("thruster: '{}', want a whole number", number));
    if (order(at) > 0.0) throw InputError(fmt::format("thruster {}: given twice", at));
    if (const double least = propulsion.thrusters[static_cast<std::size_t>(at)].least_on;
        !(seconds >= least))
      throw InputError(fmt::format("thruster {} is on for at least {} s", at, least));
    order(at) = seconds;
  } while (!words.empty());
  return order;
}

RobotMove robotMove(Words& words, const Experiment& experiment) {
  const std::vector<std::string>& names = experiment.robot.joint_names;
  const std::string joint = words.word("joint");
  const auto at = std::find(names.begin(), names.end(), joint);
  if (at == names.end())
    throw InputError(names.empty()
                         ? std::string("there is no robot")
                         : fmt::format("'{}', want one of {}", joint, fmt::join(names, ", ")));
  RobotMove move;
  move.joint = static_cast<int>(at - names.begin());
  const Link& link = experiment.controller.payload.robot.jointLink(move.joint);
  const bool turns = link.type == JointType::kRevolute;
  const double unit = turns ? kDegree : kMillimetre;
  move.target =
      words.number(joint, link.lower / unit, link.upper / unit, turns ? "deg" : "mm") * unit;
  move.duration = words.seconds("seconds", 0.1);
  return move;
}

void needTool(const Experiment& experiment) {
  if (!experiment.robot.tool()) throw InputError("there is no robot with one tip");
}

Vec3 place(Words& words) {
  constexpr double kFar = 1e5;  // [mm]
  Vec3 p;
  for (int i = 0; i < 3; ++i)
    p(i) = words.number(std::string(coordinate(i).name), -kFar, kFar, "mm") * kMillimetre;
  return p;
}

ToolOrder toolPath(Words& words, const Experiment& experiment) {
  needTool(experiment);
  ToolOrder order;
  const std::string how = words.word("to or by");
  if (how != "to" && how != "by") throw InputError(fmt::format("'{}', want to or by", how));
  order.by = how == "by";
  order.position = place(words);
  order.duration = words.number("seconds", 0.1, 1e4, "s");
  if (words.empty()) return order;
  const std::string frame = words.word("frame");
  const auto at = std::find(std::begin(kToolFrameNames), std::end(kToolFrameNames), frame);
  if (at == std::end(kToolFrameNames))
    throw InputError(fmt::format("'{}', want one of {}", frame, fmt::join(kToolFrameNames, ", ")));
  order.in = static_cast<ToolOrder::Frame>(at - std::begin(kToolFrameNames));
  return order;
}

HandOrder load(Words& words, const Experiment& experiment) {
  needTool(experiment);
  HandOrder order;
  order.body_T.mass = words.number("kg", 0.0, 1e6, "kg");
  if (!words.empty()) order.body_T.p_BoBcm_B = place(words);
  return order;
}

PushOrder push(Words& words, const Experiment& experiment) {
  PushOrder order;
  const std::string on = words.word("platform, tool or target");
  const auto at = std::find(std::begin(kPushedNames), std::end(kPushedNames), on);
  if (at == std::end(kPushedNames))
    throw InputError(fmt::format("'{}', want one of {}", on, fmt::join(kPushedNames, ", ")));
  order.on = static_cast<PushOrder::On>(at - std::begin(kPushedNames));
  for (int i = 0; i < 3; ++i)
    order.force_I(i) =
        words.number(std::string(wrenchComponent(i).name), -kMostPush, kMostPush, "N");
  order.duration = words.number("seconds", kShortestPush, kLongestPush, "s");
  if (!words.empty()) order.point = place(words);
  const std::string why = whyNotPushed(experiment, order);
  if (!why.empty()) throw InputError(why);
  return order;
}

Collection collection(Words& words) {
  Collection c;
  c.file = words.word("file");
  if (!words.empty()) c.duration = words.seconds();
  if (!words.empty()) c.rate = words.number("rate", 1e-4, 1e4, "Hz");
  c.select = words.rest();
  return c;
}

}  // namespace

double parseNumber(const std::string& text, const std::string& what, double lo, double hi,
                   const char* unit) {
  double x = NAN;
  const char* end = text.data() + text.size();
  const auto [last, error] = std::from_chars(text.data(), end, x);
  if (error != std::errc() || last != end || !(x >= lo && x <= hi))
    throw InputError(
        fmt::format("{}: '{}', want a number in [{:g}, {:g}] {}", what, text, lo, hi, unit));
  return x;
}

const std::vector<Item>& menu() {
  static const std::string motions = motionUsage();
  static const std::vector<Item> items = {
      {Verb::kArm, "arm", "", "take the legs and hold"},
      {Verb::kProgram, "program", "", "what the scenario says, then home"},
      {Verb::kAdmittance, "admittance", "SECONDS", "move as the base would"},
      {Verb::kTrajectory, "trajectory", motions.c_str(), "a ramp or a sine in each coordinate"},
      {Verb::kMove, "move", "[in SECONDS] [COORDINATE TO]...", "gently to a pose; alone: home"},
      {Verb::kCalibration, "calibration", "", "the sensor's bias, from 100 samples at rest"},
      {Verb::kTare, "tare", "", "subtract the wrench that is measured now"},
      {Verb::kRobot, "robot", "JOINT TO SECONDS", "move a joint of the simulated robot"},
      {Verb::kTool, "tool", "to|by X Y Z SECONDS [FRAME]",
       "lead its tool straight there (robot, platform, inertial)"},
      {Verb::kGrasp, "grasp", "KG [X Y Z]", "a load in the tool, its centre there"},
      {Verb::kRelease, "release", "", "let go of it"},
      {Verb::kPush, "push", "platform|tool|target FX FY FZ SECONDS [X Y Z]",
       "a force on the simulated machine, there"},
      {Verb::kCollect, "collect", "FILE [SECONDS [HZ [NAME...]]]", "variables to a CSV file"},
      {Verb::kStatus, "status", "", "where everything is"},
      {Verb::kHold, "hold", "", "brake and stay"},
      {Verb::kStop, "stop", "", "brake, home, let go: the run is over"},
      {Verb::kReset, "reset", "", "out of a stop, back to disarmed"},
      {Verb::kCompensate, "compensate", "", "lag and inertia out, as far as configured"},
      {Verb::kUncompensate, "uncompensate", "", "as published again"},
      {Verb::kVehicle, "vehicle", "[in SECONDS] [mass|damping|stiffness FACTOR]...",
       "another vehicle: times the scenario's"},
      {Verb::kGripper, "gripper", "", "it has closed or opened: learn what it holds"},
      {Verb::kThrust, "thrust", "SECONDS THRUSTER...",
       "of a vehicle that floats, on from now; from 0"},
      {Verb::kWait, "wait", "SECONDS", "nothing, for so long"},
      {Verb::kHelp, "help", "", "this list"},
      {Verb::kQuit, "quit", "", "home, let go, end"},
  };
  return items;
}

Verb parseVerb(const std::string& word) {
  std::size_t number = 0;
  const auto [last, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (error == std::errc() && last == word.data() + word.size() && number >= 1 &&
      number <= menu().size())
    return menu()[number - 1].verb;
  const Item* found = nullptr;
  std::vector<std::string> words;
  for (const Item& item : menu()) {
    words.emplace_back(item.word);
    if (words.back() == word) return item.verb;
    if (words.back().rfind(word, 0) != 0) continue;
    if (found) throw InputError(fmt::format("'{}' is {} or {}", word, found->word, item.word));
    found = &item;
  }
  if (!found) throw InputError(fmt::format("'{}', want one of {}", word, fmt::join(words, ", ")));
  return found->verb;
}

namespace {

/// What stands behind the verb.
void parseArguments(Words& words, const Experiment& experiment, Command& command) {
  const SafetyLimits& limits = experiment.controller.safety;
  Order& order = command.order;
  const auto segment = [&](const Segment& s) {
    order.request = Request::kRun;
    order.segment = s;
  };
  Segment s;
  switch (command.verb) {
    case Verb::kArm: order.request = Request::kArm; break;
    case Verb::kProgram: order.request = Request::kStart; break;
    case Verb::kAdmittance:
      s.kind = SegmentKind::kAdmittance;
      s.duration = words.seconds();
      segment(s);
      break;
    case Verb::kTrajectory: segment(trajectory(words, limits)); break;
    case Verb::kMove: segment(move(words, limits)); break;
    case Verb::kCalibration:
      s.kind = SegmentKind::kCalibration;
      segment(s);
      break;
    case Verb::kTare: order.request = Request::kTare; break;
    case Verb::kHold: order.request = Request::kHold; break;
    case Verb::kReset: order.request = Request::kReset; break;
    case Verb::kCompensate: order.request = Request::kCompensate; break;
    case Verb::kUncompensate: order.request = Request::kUncompensate; break;
    case Verb::kVehicle:
      order.request = Request::kVehicle;
      order.vehicle = vehicle(words);
      break;
    case Verb::kGripper: order.request = Request::kGripper; break;
    case Verb::kThrust:
      order.request = Request::kThrust;
      order.thrust = thrust(words, propulsionOf(experiment.controller.vehicle));
      break;
    case Verb::kStop:
    case Verb::kQuit: order.request = Request::kStop; break;
    case Verb::kRobot: command.robot = robotMove(words, experiment); break;
    case Verb::kTool: command.robot = toolPath(words, experiment); break;
    case Verb::kGrasp: command.robot = load(words, experiment); break;
    case Verb::kRelease: command.robot = Release{}; break;
    case Verb::kPush: command.robot = push(words, experiment); break;
    case Verb::kCollect: command.collection = collection(words); break;
    case Verb::kWait: command.wait = words.seconds(); break;
    case Verb::kStatus:
    case Verb::kHelp: break;
  }
  words.end();
}

}  // namespace

Command parseCommand(const std::string& line, const Experiment& experiment) {
  Words words(line);
  Command command;
  command.verb = parseVerb(words.word("command"));
  try {
    parseArguments(words, experiment, command);
  } catch (const InputError& error) {
    const auto item = std::find_if(menu().begin(), menu().end(),
                                   [&](const Item& one) { return one.verb == command.verb; });
    throw InputError(fmt::format("{} ({})", error.what(),
                                 *item->arguments
                                     ? fmt::format("{} {}", item->word, item->arguments)
                                     : fmt::format("{} takes no more", item->word)));
  }
  return command;
}

}  // namespace ves
