// SPDX-License-Identifier: BSD-3-Clause
//
// A Net F/T sensor to test drivers against: RDT over UDP, its configuration over HTTP. Written from
// the protocol's description, apart from the code in devices/, and sharing nothing with it.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

namespace rdt_test {

struct Record {
  std::uint32_t rdt_sequence = 0, ft_sequence = 0, status = 0;
  std::array<std::int32_t, 6> counts{};
};

inline std::vector<std::uint8_t> bytesOf(const Record& record) {
  std::vector<std::uint8_t> out;
  const auto put = [&](std::uint32_t value) {
    for (int shift = 24; shift >= 0; shift -= 8)
      out.push_back(static_cast<std::uint8_t>(value >> shift));
  };
  put(record.rdt_sequence);
  put(record.ft_sequence);
  put(record.status);
  for (const std::int32_t count : record.counts) put(static_cast<std::uint32_t>(count));
  return out;
}

/// A box on 127.0.0.1 that answers by a thread of its own; records are sent when told.
class Sensor {
 public:
  Sensor()
      : udp_(open(SOCK_DGRAM, port_)),
        http_(open(SOCK_STREAM, http_port_)),
        thread_([this](std::stop_token stop) {
          for (; !stop.stop_requested(); usleep(500)) poll();
        }) {}
  ~Sensor() {
    thread_.request_stop();
    thread_.join();
    close(udp_);
    close(http_);
  }
  Sensor(const Sensor&) = delete;
  Sensor& operator=(const Sensor&) = delete;

  int port() const { return port_; }
  int httpPort() const { return http_port_; }

  /// As a live box writes it: the serial number of the calibration is `cfgcalsn`, torque is in
  /// `Nm`.
  struct Fields {
    std::string counts_per_force = "1000000", counts_per_torque = "2000000";
    std::string force_unit = "N", torque_unit = "Nm", serial = "FT27462";
  };
  void configure(const Fields& f) {
    setXml(
        "<?xml version=\"1.0\"?><netft>\n<runstat>0x00000000</runstat><runrate>7000</runrate>\n"
        "<cfgnam>empty</cfgnam><cfgcalsel>0</cfgcalsel><cfgcalsn>" +
        f.serial +
        "</cfgcalsn>\n"
        "<scfgfu>" +
        f.force_unit + "</scfgfu><scfgtu>" + f.torque_unit + "</scfgtu>\n<cfgcpf>" +
        f.counts_per_force + "</cfgcpf><cfgcpt>" + f.counts_per_torque +
        "</cfgcpt>\n<cfgmr>330;330;990;30;30;30</cfgmr>\n<comrdtrate>7000</comrdtrate>\n</"
        "netft>\n");
  }
  void setXml(const std::string& text) {
    const std::lock_guard lock(mutex_);
    xml_ = text;
  }
  void setHttpStatus(int status) {
    const std::lock_guard lock(mutex_);
    http_status_ = status;
  }

  /// Commands so far, in order.
  std::vector<int> commands() {
    const std::lock_guard lock(mutex_);
    return commands_;
  }
  bool streaming() {
    const std::lock_guard lock(mutex_);
    return client_.has_value();
  }
  /// Asked for so far.
  int pages() {
    const std::lock_guard lock(mutex_);
    return pages_;
  }
  std::optional<sockaddr_in> client() {
    const std::lock_guard lock(mutex_);
    return client_;
  }
  void sendBytesTo(const sockaddr_in& whom, const std::vector<std::uint8_t>& bytes) {
    sendto(udp_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&whom),
           sizeof whom);
  }
  void forgetClient() {
    const std::lock_guard lock(mutex_);
    client_.reset();
  }
  void sendBytes(const std::vector<std::uint8_t>& bytes) {
    const std::lock_guard lock(mutex_);
    if (client_) sendBytesTo(*client_, bytes);
  }
  void send(const Record& record) { sendBytes(bytesOf(record)); }

 private:
  static int open(int type, int& port) {
    const int fd = socket(AF_INET, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    sockaddr_in local{};
    local.sin_family = AF_INET;
    local.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    auto* name = reinterpret_cast<sockaddr*>(&local);
    socklen_t size = sizeof local;
    if (fd < 0 || bind(fd, name, size) != 0 || (type == SOCK_STREAM && listen(fd, 16) != 0) ||
        getsockname(fd, name, &size) != 0)
      throw std::runtime_error("test sensor: no socket");
    port = ntohs(local.sin_port);
    return fd;
  }

  void poll() {
    const std::lock_guard lock(mutex_);
    std::array<std::uint8_t, 64> data;
    sockaddr_in from{};
    socklen_t size = sizeof from;
    while (recvfrom(udp_, data.data(), data.size(), 0, reinterpret_cast<sockaddr*>(&from), &size) ==
           8) {
      if (data[0] != 0x12 || data[1] != 0x34) continue;
      const int command = data[2] << 8 | data[3];
      commands_.push_back(command);
      if (command == 0x0000) client_.reset();
      if (command == 0x0002) client_ = from;  // one stream: a later start takes it over
    }
    for (int fd; (fd = accept(http_, nullptr, nullptr)) >= 0; close(fd)) {
      std::string request;
      char buffer[1024];
      for (ssize_t got; request.find("\r\n\r\n") == std::string::npos &&
                        (got = recv(fd, buffer, sizeof buffer, 0)) > 0;)
        request.append(buffer, static_cast<std::size_t>(got));
      ++pages_;
      const bool found = request.rfind("GET /netftapi2.xml ", 0) == 0;
      const std::string answer = "HTTP/1.0 " + std::to_string(found ? http_status_ : 404) +
                                 " X\r\nContent-Type: text/xml\r\n\r\n" + (found ? xml_ : "");
      ::send(fd, answer.data(), answer.size(), MSG_NOSIGNAL);
    }
  }

  int port_ = 0, http_port_ = 0;
  int udp_, http_;
  std::mutex mutex_;
  std::string xml_;
  int http_status_ = 200, pages_ = 0;
  std::vector<int> commands_;
  std::optional<sockaddr_in> client_;
  std::jthread thread_;
};

}  // namespace rdt_test
