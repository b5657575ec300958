// SPDX-License-Identifier: BSD-3-Clause
#include "ves/devices/on_bus.hpp"

#include "ves/bus/channels.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves::devices {

BusPiece::BusPiece(Bus& bus, const std::string& channel) {
  bus.subscribe({channel}, [this, &bus](const std::string&, const void* data, std::uint32_t size) {
    const auto message = decode<sample_t>(data, size);
    const auto sample = message ? fromMessage(*message) : std::nullopt;
    if (!sample) return;
    const header_t& h = message->header;
    const bool same = h.source == driver_.source && h.epoch == driver_.epoch;
    if (!same && h.epoch <= driver_.epoch) return;
    if (same && newest_ && sample->sequence <= newest_->sequence) return;
    driver_ = {h.source, h.epoch};
    newest_ = *sample;
    arrival_ = bus.arrival();
  });
}

std::int64_t BusPiece::stamp(std::int64_t theirs) const noexcept {
  constexpr std::int64_t kLongest = 100'000'000;  // [ns] on its way within a host
  const std::int64_t left = newest_->time;
  const bool same_clock = left <= arrival_ && arrival_ - left < kLongest;
  return (same_clock ? left : arrival_) - (left - theirs);
}

LegsOnBus::LegsOnBus(Bus& bus) : piece_(bus, channel::kLegs) {}

bool LegsOnBus::read(LegReading& out) noexcept {
  const auto& s = piece_.newest();
  if (!s) return false;
  out = {s->legs, s->adc[kWrenchChannels], piece_.stamp(s->legs_time),
         (s->faults & kLegsPiece) != 0};
  return true;
}

ForceSensorOnBus::ForceSensorOnBus(Bus& bus) : piece_(bus, channel::kWrench) {}

bool ForceSensorOnBus::read(WrenchReading& out) noexcept {
  const auto& s = piece_.newest();
  if (!s) return false;
  std::copy_n(s->adc.begin(), kWrenchChannels, out.counts.begin());
  out.time = piece_.stamp(s->wrench_time);
  out.fault = (s->faults & kSensorPiece) != 0;
  return true;
}

RobotOnBus::RobotOnBus(Bus& bus) : piece_(bus, channel::kJoints) {}

bool RobotOnBus::read(JointReading& out) noexcept {
  const auto& s = piece_.newest();
  if (!s) return false;
  out = {s->q, piece_.stamp(s->joints_time), (s->faults & kRobotPiece) != 0};
  return true;
}

SwitchesOnBus::SwitchesOnBus(Bus& bus) : piece_(bus, channel::kSwitches) {}

bool SwitchesOnBus::read(std::uint32_t& out) noexcept {
  const auto& s = piece_.newest();
  if (!s) return false;
  out = monotonicNow() - piece_.arrival() < kSilence ? s->switches : 0;
  return true;
}

}  // namespace ves::devices
