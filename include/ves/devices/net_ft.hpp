// SPDX-License-Identifier: BSD-3-Clause
//
// A force sensor that speaks ATI's RDT. Its axes are {S}; its own bias is left as it is: the
// controller's calibration takes it (report, 2.3).
#pragma once

#include <atomic>
#include <thread>

#include "ves/config/experiment.hpp"
#include "ves/devices/rdt.hpp"

namespace ves::devices {

/// The sensor's web page, and which of the host's addresses answered.
struct NetFtPage {
  std::string xml, ip;
};
/// Throws InputError; `patience` [ms].
NetFtPage fetchNetFtXml(const NetFtAddress& address, int patience);

class NetFt : public ForceSensor {
 public:
  /// Reads the sensor's calibration from its web page and asks for records. A thread of its own
  /// looks once a second whether the calibration is still the same: another one is a fault. Throws
  /// InputError.
  NetFt(const NetFtAddress& address, const Mat6& S_proc, std::int64_t window);
  ~NetFt() override;
  NetFt(const NetFt&) = delete;
  NetFt& operator=(const NetFt&) = delete;

  /// Takes in what has come, each record by the time at which the kernel had it. After half a
  /// second of silence it asks again.
  bool read(WrenchReading& out) noexcept override;
  const RdtStream::Counters& counters() const noexcept { return stream_.counters(); }

 private:
  NetFt(const NetFtAddress& address, const NetFtPage& page, const Mat6& S_proc,
        std::int64_t window);
  void ask(std::int64_t now) noexcept;
  void watchCalibration();

  NetFtAddress address_;
  NetFtCalibration calibration_;
  RdtStream stream_;
  int socket_ = -1;
  std::int64_t asked_ = 0, heard_ = 0;  // [ns]
  std::atomic<bool> changed_{false}, over_{false};
  std::thread watcher_;
};

}  // namespace ves::devices
