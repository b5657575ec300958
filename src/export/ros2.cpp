// SPDX-License-Identifier: BSD-3-Clause
#include "ves/export/ros2.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <map>

#include "cdr.hpp"
#include "ves/bus/channels.hpp"
#include "ves/bus/fields.hpp"
#include "ves/core/big_endian.hpp"
#include "ves/export/lcm_definition.hpp"
#include "ves/export/mcap.hpp"

namespace ves {
namespace {

// --- Definitions ---------------------------------------------------------------------------------

const std::string kRule(80, '=');

std::string with(const std::string& definition, std::initializer_list<const char*> others) {
  static const std::map<std::string, std::string> kAll = {
      {"std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"},
      {"builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"},
      {"builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n"},
      {"geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"},
      {"geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"},
      {"geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"},
      {"geometry_msgs/Pose",
       "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"},
      {"geometry_msgs/Wrench", "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n"},
      {"geometry_msgs/Transform",
       "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"},
      {"geometry_msgs/TransformStamped",
       "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"},
      {"std_msgs/ColorRGBA", "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n"},
      {"visualization_msgs/Marker",
       "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\n"
       "geometry_msgs/Pose pose\ngeometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\n"
       "builtin_interfaces/Duration lifetime\nbool frame_locked\ngeometry_msgs/Point[] points\n"
       "std_msgs/ColorRGBA[] colors\nstring text\nstring mesh_resource\n"
       "bool mesh_use_embedded_materials\n"}};
  std::string out = definition;
  for (const char* name : others) out += kRule + "\nMSG: " + name + "\n" + kAll.at(name);
  return out;
}

/// state_t -> State
std::string camel(const std::string& type) {
  std::string out;
  bool up = true;
  for (const char letter : type.substr(0, type.size() - 2)) {
    if (letter == '_') {
      up = true;
      continue;
    }
    out += up ? static_cast<char>(std::toupper(letter)) : letter;
    up = false;
  }
  return out;
}

}  // namespace

// --- The run -------------------------------------------------------------------------------------

class McapExport::Impl {
 public:
  Impl(const Experiment& experiment, const std::string& version, const std::string& file,
       BaseOf base)
      : experiment_(experiment),
        version_(version),
        out_(file, "ros2", "ves " + version),
        base_(std::move(base)) {
    open();
  }

  void add(const LogEvent& event) {
    const std::optional<std::int64_t> time = timeOf(event);
    if (!time) return;
    const std::int64_t now = *time;
    if (std::exchange(first_, false)) begin(now);
    message(event, now);
    if (event.channel != channel::kState) {
      if (const auto m = event.as<truth_t>()) rows_.add(*m);
      if (const auto m = event.as<sample_t>()) rows_.add(*m);
      return;
    }
    const auto state = event.as<state_t>();
    if (!state || !ours(*state)) return;
    // Its truth and its sample came before it: the row of the one before is not needed.
    rows_.add(*state);
    tick(*rows_.finish(), now);
  }

  void finish() {
    out_.attach(experiment_.name + ".yaml", "application/yaml", experiment_.source.resolved());
    out_.describe("ves", {{"configuration_hash", experiment_.source.hash()},
                          {"version", version_},
                          {"scenario", experiment_.name}});
    out_.finish();
  }

 private:
  /// [ns] By the run's own clock, begun at the first event's time: a recorder's wall clock may
  /// stand at zero, or be set back. Nothing for an event that stands there twice.
  std::optional<std::int64_t> timeOf(const LogEvent& event) {
    if (event.data.size() < kFingerprintSize + kHeaderSize) return event.time_us * 1000;
    const auto field = [&](std::size_t at) {
      return static_cast<std::int64_t>(bigEndian(&event.data[kFingerprintSize + at], 8));
    };
    const std::int64_t time = field(0), sequence = field(8), source = field(16);
    const auto [last, first] = last_.try_emplace({event.channel, source}, sequence);
    if (!first && std::exchange(last->second, sequence) == sequence) return {};
    return time + clocks_.try_emplace(source, event.time_us * 1000 - time).first->second;
  }

  std::uint16_t channel(const std::string& topic, const std::string& schema,
                        const std::string& text) {
    return out_.addChannel(topic, "cdr", schema, "ros2msg", text);
  }

  void open() {
    const std::string transforms =
        with("geometry_msgs/TransformStamped[] transforms\n",
             {"geometry_msgs/TransformStamped", "std_msgs/Header", "builtin_interfaces/Time",
              "geometry_msgs/Transform", "geometry_msgs/Vector3", "geometry_msgs/Quaternion"});
    tf_ = channel("/tf", "tf2_msgs/msg/TFMessage", transforms);
    tf_static_ = channel("/tf_static", "tf2_msgs/msg/TFMessage", transforms);
    description_ = channel("/robot_description", "std_msgs/msg/String", "string data\n");
    joints_ = channel("/joint_states", "sensor_msgs/msg/JointState",
                      with("std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] "
                           "velocity\nfloat64[] effort\n",
                           {"std_msgs/Header", "builtin_interfaces/Time"}));
    wrench_ = channel("/wrench", "geometry_msgs/msg/WrenchStamped",
                      with("std_msgs/Header header\ngeometry_msgs/Wrench wrench\n",
                           {"std_msgs/Header", "builtin_interfaces/Time", "geometry_msgs/Wrench",
                            "geometry_msgs/Vector3"}));
    legs_ =
        channel("/legs", "visualization_msgs/msg/MarkerArray",
                with("visualization_msgs/Marker[] markers\n",
                     {"visualization_msgs/Marker", "std_msgs/Header", "builtin_interfaces/Time",
                      "builtin_interfaces/Duration", "geometry_msgs/Pose", "geometry_msgs/Point",
                      "geometry_msgs/Quaternion", "geometry_msgs/Vector3", "std_msgs/ColorRGBA"}));
    words_ = channel("/log", "rcl_interfaces/msg/Log",
                     with("builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring "
                          "msg\nstring file\nstring function\nuint32 line\n",
                          {"builtin_interfaces/Time"}));
    for (const auto& [name, type] :
         std::map<std::string, std::string>{{ves::channel::kState, "state_t"},
                                            {ves::channel::kSample, "sample_t"},
                                            {ves::channel::kLegCommand, "leg_command_t"},
                                            {ves::channel::kTruth, "truth_t"},
                                            {ves::channel::kTiming, "timing_t"},
                                            {ves::channel::kOperator, "operator_t"},
                                            {ves::channel::kRobot, "robot_command_t"}}) {
      std::string topic = "/ves/" + type.substr(0, type.size() - 2);
      const LcmDefinition definition(kLcmDefinitions.at(type));
      const std::uint16_t to = channel(topic, "ves_msgs/msg/" + camel(type), definition.ros2());
      own_.emplace(name, std::pair(to, definition));
    }
  }

  /// Of the first controller, and no tick twice.
  bool ours(const state_t& state) {
    const Identity from{state.header.source, state.header.epoch};
    if (tick_ < 0) controller_ = from;
    if (from.source != controller_.source || from.epoch != controller_.epoch ||
        state.header.sequence <= tick_)
      return false;
    tick_ = state.header.sequence;
    return true;
  }

  void message(const LogEvent& event, std::int64_t now) {
    const auto own = own_.find(event.channel);
    if (own == own_.end()) return;
    const std::string cdr = own->second.second.cdr(event.data);
    if (!cdr.empty()) out_.write(own->second.first, now, cdr);
  }

  struct Stamped {
    std::string parent, child;
    Transform X;
  };
  void transforms(std::uint16_t to, std::int64_t now, const std::vector<Stamped>& all) {
    Cdr cdr;
    cdr.count(all.size());
    for (const Stamped& one : all)
      cdr.header(now, one.parent).text(one.child).vector(one.X.p).quaternion(one.X.R);
    out_.write(to, now, cdr.bytes());
  }

  /// The robot's frames in their parents', on the platform or on its ghost: those that move, or
  /// those that do not.
  void robotFrames(const JointVector& q, bool moving, const std::string& prefix,
                   std::vector<Stamped>& out) const {
    const std::vector<NamedFrame>& frames = experiment_.robot.frames;
    const LinkPoses X_L0L = linkPoses(experiment_.plant.payload.robot, q);
    for (const NamedFrame& f : frames) {
      if (f.joint.empty() == moving) continue;
      if (f.parent < 0) {
        out.push_back({prefix + "platform", prefix + f.name, experiment_.plant.payload.X_PL0()});
        continue;
      }
      const NamedFrame& parent = frames[static_cast<std::size_t>(f.parent)];
      out.push_back(
          {prefix + parent.name, prefix + f.name, inverse(parent.pose(X_L0L)) * f.pose(X_L0L)});
    }
  }

  void begin(std::int64_t now) {
    std::vector<Stamped> fixed;
    for (const char* prefix : {"", "ghost/"})
      robotFrames(experiment_.plant.task.initial_joints, false, prefix, fixed);
    transforms(tf_static_, now, fixed);
    const Value* robot = experiment_.source.document.find("robot");
    if (const Value* urdf = robot ? robot->find("urdf_text") : nullptr)
      out_.write(description_, now, Cdr().text(urdf->text).bytes());
  }

  void tick(const Row& row, std::int64_t now) {
    const Geometry& geometry = experiment_.plant.geometry;
    const Vec6 x =
        row.hasTruePose() ? Vec6(Vec6::Map(row.truth.x)) : Vec6(Vec6::Map(row.state.x_measured));
    const Transform X_IP = geometry.fromHome(Pose::from(x));
    const JointVector q = JointVector::Map(row.has_truth ? row.truth.q : row.sample.q);
    std::vector<Stamped> moving = {{"inertial", "platform", X_IP}};
    robotFrames(q, true, "", moving);
    const Transform X_EI = emulatedFrom(row.state);
    if (laboratoryOf(row.state).flies()) moving.push_back({"emulated", "inertial", X_EI});
    if (const auto base = base_(row)) {
      moving.push_back({"inertial", "ghost/platform", geometry.fromHome(Pose::from(*base))});
      robotFrames(q, true, "ghost/", moving);
    }
    transforms(tf_, now, moving);

    const std::vector<std::string>& names = experiment_.robot.joint_names;
    Cdr joints;
    joints.header(now, "").count(names.size());
    for (const std::string& name : names) joints.text(name);
    joints.count(names.size());
    for (std::size_t i = 0; i < names.size(); ++i) joints.number(q(static_cast<Eigen::Index>(i)));
    joints.count(row.has_truth ? names.size() : 0);
    if (row.has_truth)
      for (std::size_t i = 0; i < names.size(); ++i) joints.number(row.truth.q_dot[i]);
    joints.count(0);
    out_.write(joints_, now, joints.bytes());

    // Admittance control's input, in the axes of the frame that it is shown at.
    const Vec6 W = Vec6::Map(row.state.dynamic);
    const Mat3 R_PE = (X_EI.R * X_IP.R).transpose();
    out_.write(wrench_, now,
               Cdr()
                   .header(now, "platform")
                   .vector(R_PE * W.head<3>())
                   .vector(R_PE * W.tail<3>())
                   .bytes());
    legs(X_IP, now);
    words(row, now);
  }

  /// Of the laboratory where the vehicle is emulated, at the state's tick.
  Transform emulatedFrom(const state_t& state) const {
    const Vec3 home = experiment_.plant.geometry.home();
    const Transform X_EH = laboratoryOf(state).at(state.machine_time_ns).X;
    return {X_EH.R, home + X_EH.p - X_EH.R * home};
  }

  void legs(const Transform& X_IP, std::int64_t now) {
    constexpr std::int32_t kLineList = 5, kAdd = 0;
    constexpr double kWidth = 0.03;  // [m]
    const Geometry& g = experiment_.plant.geometry;
    Cdr cdr;
    cdr.count(1).header(now, "inertial").text("legs").number(std::int32_t{0}).number(kLineList);
    cdr.number(kAdd).vector(Vec3::Zero()).quaternion(Mat3::Identity());
    cdr.vector(Vec3(kWidth, 0.0, 0.0));
    for (const float colour : {0.5f, 0.6f, 0.5f, 1.0f}) cdr.number(colour);
    cdr.time(0).number(std::uint8_t{0}).count(2 * kLegs);
    for (std::size_t i = 0; i < kLegs; ++i) cdr.vector(g.p_IBi_I[i]).vector(X_IP * g.p_PPi_P[i]);
    cdr.count(0).text("").text("").number(std::uint8_t{0});
    out_.write(legs_, now, cdr.bytes());
  }

  /// A line where the phase, the segment or the cause of a stop changes.
  void words(const Row& row, std::int64_t now) {
    constexpr std::uint8_t kInfo = 20, kError = 40;
    const state_t& s = row.state;
    const auto kind = static_cast<SegmentKind>(s.kind);
    std::string said(name(static_cast<Phase>(s.phase)));
    if (kind != SegmentKind::kCount) said += fmt::format(": {}", name(kind));
    if (s.phase == static_cast<int>(Phase::kRunning) && s.segment >= 0)
      said += fmt::format(" ({} of {})", s.segment + 1, experiment_.controller.program.size);
    const bool stopped = s.cause >= 0 && s.cause < static_cast<int>(Check::kCount);
    if (stopped) {
      const auto cause = static_cast<Check>(s.cause);
      said += fmt::format(", stopped by {}", name(cause));
    }
    if (said == said_) return;
    said_ = said;
    out_.write(words_, now,
               Cdr()
                   .time(now)
                   .number(stopped ? kError : kInfo)
                   .text("ves")
                   .text(said)
                   .text("")
                   .text("")
                   .number(std::uint32_t{0})
                   .bytes());
  }

  const Experiment experiment_;
  const std::string version_;
  McapWriter out_;
  bool first_ = true;
  std::map<std::int64_t, std::int64_t> clocks_;  // [ns] by source: from its own clock
  std::map<std::pair<std::string, std::int64_t>, std::int64_t> last_;  // [-] sequence
  RowMaker rows_;
  BaseOf base_;
  Identity controller_;                                                 // whose run it is
  std::int64_t tick_ = -1;                                              // the last
  std::map<std::string, std::pair<std::uint16_t, LcmDefinition>> own_;  // by LCM channel
  std::uint16_t tf_ = 0, tf_static_ = 0, description_ = 0, joints_ = 0, wrench_ = 0, legs_ = 0,
                words_ = 0;
  std::string said_;
};

McapExport::McapExport(const Experiment& experiment, const std::string& version,
                       const std::string& file, BaseOf base)
    : impl_(std::make_unique<Impl>(experiment, version, file, std::move(base))) {}
McapExport::~McapExport() = default;
void McapExport::add(const LogEvent& event) { impl_->add(event); }
void McapExport::finish() { impl_->finish(); }

}  // namespace ves
