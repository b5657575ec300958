// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "readers.hpp"
#include "robot_events.hpp"
#include "ves/core/coordinates.hpp"

namespace ves {
namespace {

class ProgramReader {
 public:
  explicit ProgramReader(Experiment& out)
      : out_(out), robot_(out), rehearsal_(out.controller, startOf(out)) {}

  void read(Section& root) {
    const std::vector<Section> items = root.list("program");
    if (items.empty() || items.size() > kMaxSegments)
      root.fail("program",
                fmt::format("has {} segments, want 1 to {}", items.size(), kMaxSegments));
    for (Section item : items) {
      const std::string kind = item.onlyKey(
          {"calibration", "move", "trajectory", "admittance", "monitor", "path", "excite"},
          {"robot", "faults"});
      if (kind == "excite") {
        readExcite(root, item);
        continue;
      }
      Segment& segment = next(root);  // which its events belong to
      const Section inside = item.section(kind);
      for (const std::string_view beside : {"robot", "faults"})
        if (const auto& keys = inside.keys();
            std::find(keys.begin(), keys.end(), beside) != keys.end())
          inside.fail(beside, fmt::format("stands beside {}, not in it", kind));
      readSegment(inside, kind, segment);
      if (const std::string why = rehearsal_.next(segment); !why.empty())
        item.failOfMotion(kind, why);
      if (item.has("robot")) readRobotEvents(item);
      if (item.has("faults"))
        for (Section event : item.list("faults")) readFault(event);
      item.finish();
      pass(segment);
    }
  }

 private:
  Segment& next(Section& root) {
    Program& program = out_.controller.program;
    if (program.size == kMaxSegments)
      root.fail("program",
                fmt::format("has more than {} segments, with the moves of excite", kMaxSegments));
    return program.segments[static_cast<std::size_t>(program.size)];
  }

  void pass(const Segment& segment) {
    robot_.pass(segment);
    ++out_.controller.program.size;
  }

  /// Tilts about x and y, there and back, which tell the robot's weight from the sensor's bias.
  void readExcite(Section& root, Section& item) {
    if (item.has("robot") || item.has("faults"))
      item.fail("excite", "has events beside it, want it alone: the robot stands still");
    Section s = item.section("excite");
    const double tilt = s.number("tilt_deg", 0.1, 45.0) * kDegree,
                 duration = s.number("duration_s", 2.0, 1e4);
    s.finish();
    item.finish();
    constexpr int kMoves = 5;
    const Vec3 tilts[kMoves] = {
        Vec3::UnitX(), -Vec3::UnitX(), Vec3::UnitY(), -Vec3::UnitY(), {0, 0, 0}};
    for (const Vec3& way : tilts) {
      Segment& move = next(root);
      move.kind = SegmentKind::kMove;
      move.duration = duration / kMoves;
      move.target = {Vec3::Zero(), tilt * way};
      if (const std::string why = rehearsal_.next(move); !why.empty())
        s.failOfMotion("tilt_deg", why);
      pass(move);
    }
  }

  void readSegment(Section s, const std::string& kind, Segment& segment) {
    if (kind == "calibration") {
      segment.kind = SegmentKind::kCalibration;
    } else if (kind == "move") {
      segment.kind = SegmentKind::kMove;
      if (s.has("duration_s")) segment.duration = s.number("duration_s", 0.1, 1e5);
      if (s.has("to")) segment.target = readPose(s.section("to"));
    } else if (kind == "trajectory") {
      segment.kind = SegmentKind::kTrajectory;
      segment.duration = s.number("duration_s", 0.01, 1e6);
      for (int i = 0; i < 6; ++i) {
        const std::string_view name = coordinate(i).name;
        if (s.has(name)) readMotion(s.section(name), i, segment.trajectory);
      }
    } else if (kind == "monitor") {
      segment.kind = SegmentKind::kMonitor;
      segment.duration = s.number("duration_s", 0.01, 1e6);
      segment.interval = s.number("interval_s", 1.0, 1e6);
    } else if (kind == "path") {
      segment.kind = SegmentKind::kPath;
      readPath(s, segment);
    } else {
      segment.kind = SegmentKind::kAdmittance;
      segment.duration = s.number("duration_s", 0.01, 1e6);
    }
    s.finish();
  }

  /// A pose a row and period: x y z [m], alpha beta gamma [deg].
  void readPath(Section& s, Segment& segment) {
    ControllerConfig& c = out_.controller;
    if (c.path.cols() > 0) s.fail("rows_m_deg", "is the second path, want one at most");
    c.path = s.matrix("rows_m_deg", -1, 6, -kAny, kAny).transpose();
    c.path.bottomRows<3>() *= kDegree;
    segment.duration = static_cast<double>((c.path.cols() - 1) * c.period) * kSecondPerNanosecond;
  }

  static void readMotion(Section s, int i, Trajectory& out) {
    std::vector<std::string_view> names;
    for (const MotionMeaning& motion : kMotions)
      if (motion.motion != AxisMotion::kHold) names.push_back(motion.name);
    const std::string kind = s.onlyKey(names, {});
    const auto& meaning = *std::find_if(std::begin(kMotions), std::end(kMotions),
                                        [&](const MotionMeaning& m) { return m.name == kind; });
    out.motion[static_cast<std::size_t>(i)] = meaning.motion;
    Section motion = s.section(kind);
    for (const MotionNumber& number : meaning.numbers)
      if (number.value)
        (out.*number.value)(i) = number.most > 0.0 ? motion.number(number.key, 0.0, number.most)
                                                   : readCoordinate(motion, number.key, i);
    motion.finish();
    s.finish();
  }

  void readRobotEvents(Section& item) {
    std::vector<std::pair<std::int64_t, Section>> events;  // [ns] when
    for (Section event : item.list("robot")) {
      const std::int64_t at = readTime(event, "at_s");
      events.emplace_back(at, event);
    }
    std::stable_sort(events.begin(), events.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    for (auto& [at, event] : events) robot_.read(event, {out_.controller.program.size, at});
  }

  void readFault(Section& s) {
    using plant::Fault;
    plant::FaultEvent event;
    event.cue = {out_.controller.program.size, readTime(s, "at_s")};
    event.duration = readTime(s, "duration_s");
    std::vector<std::string_view> names;
    for (int i = 0; i < static_cast<int>(Fault::kCount); ++i)
      names.push_back(plant::name(static_cast<Fault>(i)));
    const std::string fault = s.text("fault");
    const auto at = std::find(names.begin(), names.end(), fault);
    if (at == names.end())
      s.fail("fault", fmt::format("'{}', want one of {}", fault, fmt::join(names, ", ")));
    event.fault = static_cast<Fault>(at - names.begin());
    if (isHydraulic(event.fault) && !out_.plant.hydraulic)
      s.fail("fault", fmt::format("{} is of hydraulic legs, want legs.model: hydraulic", fault));
    const auto which = [&] { return static_cast<int>(s.integer("which", 1, 6)) - 1; };
    switch (event.fault) {
      case Fault::kWrenchStep:
      case Fault::kLegJump: event.amount = s.number("counts", -65536.0, 65536.0); [[fallthrough]];
      case Fault::kWrenchRail:
      case Fault::kLegFrozen:
      case Fault::kLegOutOfRange:
      case Fault::kValveStuck:
      case Fault::kRunaway:  // from 1, as the legs and channels are called
        event.index = which();
        break;
      case Fault::kAirInOil: event.index = which(); [[fallthrough]];
      case Fault::kSupplyFalls: event.amount = s.number("share", 0.001, 1.0); break;
      case Fault::kLegLeaks:
      case Fault::kSealWorn:
        event.index = which();
        event.amount = s.number("l_per_min_mpa", 0.0, 100.0) * kOilFlow;
        break;
      case Fault::kLegSticks:
        event.index = which();
        event.amount = s.number("newtons", 0.0, 1e5);
        break;
      case Fault::kPressure: event.amount = s.number("volts", -10.0, 10.0); break;
      case Fault::kLate: event.amount = static_cast<double>(s.integer("samples", 1, 15)); break;
      default: break;
    }
    s.finish();
    out_.plant.faults.push_back(event);
  }

  /// Real legs stand where they stand.
  static std::optional<Pose> startOf(const Experiment& e) {
    return e.machine.external_legs ? std::nullopt : std::optional(e.plant.initial_pose);
  }

  Experiment& out_;
  RobotEvents robot_;
  ProgramRehearsal rehearsal_;
};

}  // namespace

void readProgram(Section& root, Experiment& out) { ProgramReader(out).read(root); }

}  // namespace ves
