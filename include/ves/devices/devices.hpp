// SPDX-License-Identifier: BSD-3-Clause
//
// The four pieces that a machine is composed of, each behind a narrow interface: a driver of real
// hardware implements one of them. Times are this host's monotonic clock, in simulated pieces too.
// Nothing here throws, waits or blocks: it is called every 2 ms.
#pragma once

#include "ves/contract/sample.hpp"

namespace ves::devices {

struct LegReading {
  LegCounts counts{};         // [count] Temposonics, 14 bits
  std::int32_t pressure = 0;  // [count] of the seventh converter channel
  std::int64_t time = 0;      // [ns] when they were read
  bool fault = false;         // they say of themselves that they cannot be trusted
};

/// Six legs that follow references, each with a watchdog of its own (docs/machine.md, States).
class Legs {
 public:
  virtual ~Legs() = default;
  /// Not engaged: stay and ignore the counts. Engaged: follow them; `park` says what to do should
  /// no command follow.
  virtual void command(const LegCommand& command) noexcept = 0;
  /// False: nothing was read yet.
  virtual bool read(LegReading& out) noexcept = 0;
};

struct WrenchReading {
  std::array<std::int32_t, kWrenchChannels> counts{};  // [count] 16 bits, as the converter's
  std::int64_t time = 0;                               // [ns]
  bool fault = false;
};

class ForceSensor {
 public:
  virtual ~ForceSensor() = default;
  virtual bool read(WrenchReading& out) noexcept = 0;
};

struct JointReading {
  JointVector q = JointVector::Zero();  // [rad | m] base to tip
  std::int64_t time = 0;                // [ns]
  bool fault = false;
};

class Robot {
 public:
  virtual ~Robot() = default;
  virtual bool read(JointReading& out) noexcept = 0;
};

class Switches {
 public:
  virtual ~Switches() = default;
  /// Bits of Switch. Those that have fallen silent read as open.
  virtual bool read(std::uint32_t& out) noexcept = 0;
};

}  // namespace ves::devices
