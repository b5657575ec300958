// SPDX-License-Identifier: BSD-3-Clause
//
// A wrench served as an ATI Net F/T serves its own: records over UDP, its calibration over HTTP.
#pragma once

#include <cstdint>
#include <string>

#include <netinet/in.h>

#include "ves/devices/rdt.hpp"
#include "ves/math/frames.hpp"

namespace ves::devices {

class NetFtServer {
 public:
  static constexpr int kFastest = 7000;  // [1/s]

  struct Options {
    std::string address = "127.0.0.1";
    int port = 49152;      // [-] 0: any
    int http_port = 8080;  // [-] 0: any
    int rate = kFastest;   // [1/s]
    NetFtCalibration calibration{1e5, 1e5, "VES00001"};
  };

  /// Throws InputError where a port is taken.
  explicit NetFtServer(const Options& options);
  ~NetFtServer();
  NetFtServer(const NetFtServer&) = delete;
  NetFtServer& operator=(const NetFtServer&) = delete;

  /// F_So_S [N, N m] from now on, and the status word; a count that 32 bits do not hold reads as
  /// the largest, and is a fault.
  void set(const Wrench& F_So_S, std::uint32_t status = 0) noexcept;

  /// Of the records and the page from now on.
  void calibrate(const NetFtCalibration& calibration) { options_.calibration = calibration; }

  /// Answers requests, and sends the client the records that are due at `now` [ns]. What came late
  /// is sent at once, unless it is more than a tenth of a second.
  void serve(std::int64_t now);
  std::int64_t due() const noexcept {  // [ns] of the next record
    return start_ + moments_ * 1'000'000'000 / options_.rate;
  }

  int port() const noexcept { return port_; }
  int httpPort() const noexcept { return http_port_; }
  std::int64_t sent() const noexcept { return sent_; }  // [-] records
  bool streaming() const noexcept { return client_.has_value(); }

 private:
  void takeRequests();
  void answerPage();
  void sendRecord();

  struct Client {
    sockaddr_in address;
    std::uint32_t sequence = 0;
    std::uint32_t left = 0;  // [-] records still to send; 0: without end
  };

  Options options_;
  int records_ = -1, pages_ = -1;  // sockets
  int port_ = 0, http_port_ = 0;
  std::int64_t start_ = 0, moments_ = 0;              // [ns], [-] since then
  std::optional<Client> client_;                      // who asked last: the sensor has one stream
  Vec6 counts_ = Vec6::Zero(), bias_ = Vec6::Zero();  // of the sensor
  std::uint32_t status_ = 0, sensor_sequence_ = 0;
  std::int64_t sent_ = 0;
};

}  // namespace ves::devices
