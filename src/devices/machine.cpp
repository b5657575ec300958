// SPDX-License-Identifier: BSD-3-Clause
#include "ves/devices/machine.hpp"

#include "ves/bus/channels.hpp"
#include "ves/devices/force_stream.hpp"
#include "ves/devices/net_ft.hpp"
#include "ves/devices/on_bus.hpp"

namespace ves::devices {
namespace {

/// The driver of a real force sensor; nothing where it is simulated.
struct ForceSensorOf {
  const Experiment& experiment;
  Bus& bus;

  std::unique_ptr<ForceSensor> operator()(Simulated) const { return nullptr; }
  std::unique_ptr<ForceSensor> operator()(External) const {
    return std::make_unique<ForceSensorOnBus>(bus);
  }
  std::unique_ptr<ForceSensor> operator()(const NetFtAddress& address) const {
    const plant::PlantConfig& p = experiment.plant;
    return std::make_unique<NetFt>(address, p.sensor.S_proc(), p.sensor_window);
  }
  std::unique_ptr<ForceSensor> operator()(const StreamSource& source) const {
    const plant::PlantConfig& p = experiment.plant;
    return std::make_unique<ForceStream>(source, p.sensor.S_proc(), p.sensor_window);
  }
};

}  // namespace

Machine::Machine(const Experiment& experiment, Bus& bus)
    : simulation_(experiment.plant),
      codec_(experiment.controller.legs),
      leg_tracker_(experiment.machine.follow),
      joint_tracker_(experiment.machine.follow) {
  const MachinePieces& m = experiment.machine;
  if (m.external_legs) real_legs_ = std::make_unique<LegsOnBus>(bus);
  if (m.external_robot) real_robot_ = std::make_unique<RobotOnBus>(bus);
  if (m.external_switches) real_switches_ = std::make_unique<SwitchesOnBus>(bus);
  real_sensor_ = std::visit(ForceSensorOf{experiment, bus}, m.force_sensor);
}

void Machine::command(const LegCommand& command) noexcept {
  simulation_.command(command);
  if (real_legs_) real_legs_->command(command);
}

void Machine::advance(std::int64_t until, std::int64_t now) noexcept {
  waits_for_ = {};
  const auto wait = [&](const char* piece) {
    if (waits_for_.empty()) waits_for_ = piece;
  };
  LegReading legs;
  JointReading joints;
  if (real_legs_) {
    if (real_legs_->read(legs)) {
      leg_tracker_.take(legLengths(codec_, legs.counts), legs.time);
      const auto m = leg_tracker_.at(now);
      simulation_.plant().follow(LegMotion{m.x, m.v, m.a});
    } else {
      wait("legs (VES_LEGS)");
    }
  }
  if (real_robot_) {
    if (real_robot_->read(joints)) {
      joint_tracker_.take(joints.q, joints.time);
      const auto m = joint_tracker_.at(now);
      simulation_.plant().follow(JointState{m.x, m.v, m.a});
    } else {
      wait("the robot's joints (VES_JOINTS)");
    }
  }
  simulation_.advance(until, now);
  if (!real_legs_) simulation_.legs().read(legs);
  if (!real_robot_) simulation_.robot().read(joints);
  WrenchReading wrench;
  if (!(real_sensor_ ? *real_sensor_ : simulation_.sensor()).read(wrench)) wait("the force sensor");
  std::uint32_t switches = 0;
  if (!(real_switches_ ? *real_switches_ : simulation_.switches()).read(switches))
    wait("the safety loops (VES_SWITCHES)");
  if (!waits_for_.empty()) return;

  Sample s = simulation_.sample();
  s.time = now;
  s.legs = legs.counts;
  s.legs_time = std::min(legs.time, now);
  std::copy(wrench.counts.begin(), wrench.counts.end(), s.adc.begin());
  s.adc[kWrenchChannels] = legs.pressure;
  s.wrench_time = std::min(wrench.time, now);
  s.q = joints.q;
  s.joints_time = std::min(joints.time, now);
  s.switches = switches;
  s.faults = (legs.fault ? kLegsPiece : 0u) | (wrench.fault ? kSensorPiece : 0u) |
             (joints.fault ? kRobotPiece : 0u);
  sample_ = s;
}

}  // namespace ves::devices
