// SPDX-License-Identifier: BSD-3-Clause
//
// Pieces whose drivers are programs of their own: each publishes a sample_t with its part filled
// in, on a channel of its own.
#pragma once

#include "ves/bus/bus.hpp"
#include "ves/devices/devices.hpp"

namespace ves::devices {

/// The newest sample of the driver of one piece. One that was started anew takes the old one's
/// place.
class BusPiece {
 public:
  BusPiece(Bus& bus, const std::string& channel);

  /// Nothing before the first sample.
  const std::optional<Sample>& newest() const noexcept { return newest_; }
  /// [ns] of this host's clock when a part was taken that the driver stamped `theirs`. How old it
  /// was when it left, the driver's own clock says; it left when its header says, where that clock
  /// can be this host's, else when it came.
  std::int64_t stamp(std::int64_t theirs) const noexcept;
  std::int64_t arrival() const noexcept { return arrival_; }  // [ns]

 private:
  Identity driver_;
  std::optional<Sample> newest_;
  std::int64_t arrival_ = 0;  // [ns]
};

/// A driver of legs hears VES_LEG_COMMAND itself, and keeps the rules of docs/machine.md itself:
/// legs have to rest whatever becomes of this process.
class LegsOnBus : public Legs {
 public:
  explicit LegsOnBus(Bus& bus);
  void command(const LegCommand&) noexcept override {}
  bool read(LegReading& out) noexcept override;

 private:
  BusPiece piece_;
};

class ForceSensorOnBus : public ForceSensor {
 public:
  explicit ForceSensorOnBus(Bus& bus);
  bool read(WrenchReading& out) noexcept override;

 private:
  BusPiece piece_;
};

class RobotOnBus : public Robot {
 public:
  explicit RobotOnBus(Bus& bus);
  bool read(JointReading& out) noexcept override;

 private:
  BusPiece piece_;
};

class SwitchesOnBus : public Switches {
 public:
  static constexpr std::int64_t kSilence = 100'000'000;  // [ns] after which they read as open

  explicit SwitchesOnBus(Bus& bus);
  bool read(std::uint32_t& out) noexcept override;

 private:
  BusPiece piece_;
};

}  // namespace ves::devices
