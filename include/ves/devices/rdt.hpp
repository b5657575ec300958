// SPDX-License-Identifier: BSD-3-Clause
//
// ATI's Raw Data Transfer, by which a Net F/T sensor sends its records over UDP (ATI 9620-05-NET
// FT, section 10), and what its web page says of counts and units. Big endian. The status word's
// bits differ from box to box; 16 (latch) and 31 (any error) are common.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "ves/devices/wrench_window.hpp"

namespace ves::devices {

enum class RdtCommand : std::uint16_t { kStop = 0, kStream = 2, kResetLatch = 0x41, kBias = 0x42 };

struct RdtRequest {
  RdtCommand command = RdtCommand::kStop;
  std::uint32_t samples = 0;  // [-] 0: without end
};
inline constexpr std::size_t kRdtRequestSize = 8;  // [B]

struct RdtRecord {
  std::uint32_t sequence = 0;                          // [-] of records sent
  std::uint32_t sensor_sequence = 0;                   // [-] of the sensor's own samples
  std::uint32_t status = 0;                            // 0: all is well
  std::array<std::int32_t, kWrenchChannels> counts{};  // Fx Fy Fz Tx Ty Tz
};
inline constexpr std::size_t kRdtRecordSize = 36;  // [B]

std::array<std::uint8_t, kRdtRequestSize> encode(const RdtRequest& request) noexcept;
std::optional<RdtRequest> rdtRequest(const std::uint8_t* data, std::size_t size) noexcept;
std::array<std::uint8_t, kRdtRecordSize> encode(const RdtRecord& record) noexcept;
std::optional<RdtRecord> rdtRecord(const std::uint8_t* data, std::size_t size) noexcept;

/// Of netftapi2.xml.
struct NetFtCalibration {
  double counts_per_newton = 0.0;  // [-]
  double counts_per_newton_metre = 0.0;
  std::string serial;   // of the calibration
  Transform X_ST = {};  // where the box reports its wrench: its tool transform

  bool operator==(const NetFtCalibration&) const = default;
};
/// Throws InputError, naming the tag. A low-pass filter of the box is refused: it would be late.
NetFtCalibration netFtCalibration(const std::string& xml);
std::string netFtXml(const NetFtCalibration& calibration, int records_per_second);

/// The newest record of a stream that loses, repeats and reorders, or the mean of the newest ones,
/// as counts of the converter that the controller knows.
class RdtStream {
 public:
  /// `S_proc` [count/N | count/(N m)] turns a wrench into those counts, (2.6). `window` [ns] before
  /// the newest record is averaged; 0: that one alone.
  RdtStream(const NetFtCalibration& calibration, const Mat6& S_proc, std::int64_t window);

  struct Counters {
    std::int64_t records = 0;    // [-] taken
    std::int64_t lost = 0;       // [-] by the gaps of their sequence
    std::int64_t repeated = 0;   // [-] of the same sequence again
    std::int64_t late = 0;       // [-] of an earlier one
    std::int64_t malformed = 0;  // [-] no record
  };

  /// A datagram that came at `time` [ns]. The sequence wraps at 2^32.
  void take(const std::uint8_t* data, std::size_t size, std::int64_t time) noexcept;
  /// The sensor begins anew: whatever comes next is the newest.
  void restart() noexcept { known_ = false; }
  /// False before the first record. A status with any bit set, of any record of the window, is a
  /// fault, but for the latch of a threshold (bit 16), which is none.
  bool read(WrenchReading& out) const noexcept { return window_.read(out); }
  const Counters& counters() const noexcept { return counters_; }

 private:
  WrenchWindow window_;
  bool known_ = false;
  std::uint32_t sequence_ = 0;  // of the newest
  Counters counters_;
};

}  // namespace ves::devices
