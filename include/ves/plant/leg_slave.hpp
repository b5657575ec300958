// SPDX-License-Identifier: BSD-3-Clause
//
// One LegSlave (report, section 2.4): the 8031's position/derivative loop, in integers.
#pragma once

#include <array>
#include <cstdint>

#include "ves/contract/leg_communication.hpp"

namespace ves::plant {

struct LegSlaveGains {
  int K_P = 8500;  // [1/256 D/A digit per count] proportional; the Nomenclature swaps the two
  int K_D = 0;     // [1/256 D/A digit per count]
};

class LegSlave {
 public:
  /// At rest at the measured count.
  LegSlave(const LegSlaveGains& gains, std::int32_t count) noexcept;

  /// One Temposonics reading, every 341 us. Averages the first two of three to X(k), ignores the
  /// third, and with the second updates
  ///   U(k) = K_P E(k) - K_D (X(k) - X(k-4)),  E(k) = reference - X(k).
  void read(std::int32_t count, std::int32_t reference) noexcept;

  /// D/A code: U without its eight fractional bits, saturated at sign and fifteen bits. (2.7a)
  /// prints 10 V / (256 * 2^15) = 3.05e-4; that is 10 V / 2^15, per digit of this code.
  std::int32_t code() const noexcept { return code_; }

  /// True right after the reading that updated the code.
  bool updated() const noexcept { return phase_ == 2; }

  static constexpr std::int32_t kFullScale = 32767;         // [-]
  static constexpr double kVoltsPerDigit = 10.0 / 32768.0;  // [V]
  static constexpr double kAmperesPerVolt = 4e-3;           // [A/V] servo-amplifier

  double current() const noexcept { return code_ * kVoltsPerDigit * kAmperesPerVolt; }  // [A]

 private:
  LegSlaveGains gains_;
  int phase_ = 0;                          // readings so far in this period
  std::int64_t first_ = 0;                 // [count] first reading
  std::array<std::int64_t, 4> history_{};  // [half count] X(k-1) .. X(k-4)
  std::int32_t code_ = 0;
};

}  // namespace ves::plant
