// SPDX-License-Identifier: BSD-3-Clause
#include "ves/run/announcer.hpp"

#include <chrono>

#include "ves/bus/channels.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves {

MachineSetup setupOf(const Experiment& e, bool lockstep) {
  const ControllerConfig& c = e.controller;
  MachineSetup s;
  s.period = c.period;
  s.lockstep = lockstep;
  s.arming_samples = c.arming_samples;
  s.stale_ticks = c.safety.stale_ticks;
  s.legs = c.legs;
  s.leg_min = legCounts(c.legs, Vec6::Constant(c.safety.leg_min));
  s.leg_max = legCounts(c.legs, Vec6::Constant(c.safety.leg_max));
  s.leg_home = legCounts(c.legs, legLengths(c.geometry, c.geometry.fromHome(Pose())));
  s.leg_velocity = c.safety.leg_velocity;
  s.wrench_per_count = c.sensor.C_proc;
  s.wrench_window = e.plant.sensor_window;
  s.pressure_min = c.safety.pressure_min;
  s.pressure_max = c.safety.pressure_max;
  s.joints = c.payload.robot.joints;
  for (int i = 0; i < s.joints; ++i) {
    s.joint_min(i) = c.payload.robot.jointLink(i).lower;
    s.joint_max(i) = c.payload.robot.jointLink(i).upper;
  }
  s.watchdog = e.plant.watchdog;
  return s;
}

Announcer::Announcer(Bus& bus, const std::string& url, const experiment_t& experiment,
                     const MachineSetup& setup)
    : bus_(url), experiment_(experiment), setup_(toMessage(setup, experiment.header)) {
  bus.subscribe({channel::kQuery},
                [this](const std::string&, const void* data, std::uint32_t size) {
                  if (decode<query_t>(data, size)) asked_.store(true, std::memory_order_relaxed);
                });
  thread_ = std::thread([this] { announce(); });
}

Announcer::~Announcer() {
  {
    const std::lock_guard lock(mutex_);
    over_ = true;
  }
  ending_.notify_one();
  thread_.join();
}

void Announcer::announce() {
  constexpr std::int64_t kRepeat = 1'000'000'000, kRest = 200'000'000;  // [ns]
  std::int64_t told = monotonicNow() - kRepeat;
  std::unique_lock lock(mutex_);
  for (; !over_; ending_.wait_for(lock, std::chrono::milliseconds(50))) {
    const std::int64_t since = monotonicNow() - told;
    const bool due = disarmed_.load(std::memory_order_relaxed) && since >= kRepeat;
    if (!due && !(since >= kRest && asked_.exchange(false, std::memory_order_relaxed))) continue;
    told = monotonicNow();
    experiment_.header.time_ns = told;
    ++experiment_.header.sequence;
    setup_.header = experiment_.header;
    bus_.publish(channel::kExperiment, experiment_);
    bus_.publish(channel::kSetup, setup_);
  }
}

}  // namespace ves
