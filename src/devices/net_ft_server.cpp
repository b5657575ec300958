// SPDX-License-Identifier: BSD-3-Clause
#include "ves/devices/net_ft_server.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "ves/core/errors.hpp"

namespace ves::devices {
namespace {

constexpr std::uint32_t kSaturated = 0x80020000;  // error, saturation

int bound(const std::string& address, int& port, int type) {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(port));
  if (inet_pton(AF_INET, address.c_str(), &to.sin_addr) != 1)
    throw InputError(fmt::format("--address {}: want a numeric IPv4 address", address));
  const int fd = socket(AF_INET, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const int on = 1;
  if (type == SOCK_STREAM) setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  socklen_t size = sizeof to;
  auto* name = reinterpret_cast<sockaddr*>(&to);
  if (fd < 0 || bind(fd, name, sizeof to) != 0 || (type == SOCK_STREAM && listen(fd, 8) != 0) ||
      getsockname(fd, name, &size) != 0) {
    const int why = errno;
    if (fd >= 0) close(fd);
    throw InputError(fmt::format("port {} of {}: {}", port, address, std::strerror(why)));
  }
  port = ntohs(to.sin_port);
  return fd;
}

}  // namespace

NetFtServer::NetFtServer(const Options& options)
    : options_(options), port_(options.port), http_port_(options.http_port) {
  records_ = bound(options.address, port_, SOCK_DGRAM);
  try {
    pages_ = bound(options.address, http_port_, SOCK_STREAM);
  } catch (...) {
    close(records_);
    throw;
  }
}

NetFtServer::~NetFtServer() {
  close(records_);
  close(pages_);
}

void NetFtServer::set(const Wrench& F_So_S, std::uint32_t status) noexcept {
  const Vec6 W = F_So_S.stacked();
  counts_ << W.head<3>() * options_.calibration.counts_per_newton,
      W.tail<3>() * options_.calibration.counts_per_newton_metre;
  status_ = status;
}

void NetFtServer::serve(std::int64_t now) {
  constexpr std::int64_t kMade = 100'000'000;  // [ns] that are made up for
  takeRequests();
  answerPage();
  if (start_ == 0 || now - due() > kMade) {
    start_ = now;
    moments_ = 0;
  }
  for (; due() <= now; ++moments_) sendRecord();
  for (; moments_ >= options_.rate; moments_ -= options_.rate) start_ += 1'000'000'000;
}

void NetFtServer::takeRequests() {
  std::uint8_t data[64];
  sockaddr_in from{};
  socklen_t size = sizeof from;
  for (ssize_t got; (got = recvfrom(records_, data, sizeof data, 0,
                                    reinterpret_cast<sockaddr*>(&from), &size)) >= 0;
       size = sizeof from) {
    const auto request = rdtRequest(data, static_cast<std::size_t>(got));
    if (!request) continue;
    switch (request->command) {
      case RdtCommand::kStream: client_ = Client{from, 0, request->samples}; break;
      case RdtCommand::kStop: client_.reset(); break;
      case RdtCommand::kBias: bias_ = counts_; break;
      case RdtCommand::kResetLatch: break;
    }
  }
}

/// One page, to whoever asks; nobody is waited for.
void NetFtServer::answerPage() {
  constexpr int kWhole = 20;  // [ms] for a request that has not come whole
  for (int fd; (fd = accept4(pages_, nullptr, nullptr, SOCK_CLOEXEC)) >= 0; close(fd)) {
    pollfd p{fd, POLLIN, 0};
    char request[2048];
    if (poll(&p, 1, kWhole) <= 0) continue;
    const ssize_t got = recv(fd, request, sizeof request, MSG_DONTWAIT);
    if (got <= 0) continue;
    const std::string_view asked(request, static_cast<std::size_t>(got));
    const bool known = asked.rfind("GET /netftapi2.xml", 0) == 0;
    const std::string body = known ? netFtXml(options_.calibration, options_.rate) : "not here\n";
    const std::string answer = fmt::format(
        "HTTP/1.0 {}\r\nContent-Type: text/xml\r\nContent-Length: {}\r\nConnection: "
        "close\r\n\r\n{}",
        known ? "200 OK" : "404 Not Found", body.size(), body);
    send(fd, answer.data(), answer.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  }
}

void NetFtServer::sendRecord() {
  RdtRecord record;
  record.sensor_sequence = ++sensor_sequence_;
  record.status = status_;
  for (int i = 0; i < kWrenchChannels; ++i) {
    const double count = std::nearbyint(counts_(i) - bias_(i));
    const double held = std::clamp<double>(count, INT32_MIN, INT32_MAX);
    if (!(held == count)) record.status |= kSaturated;
    record.counts[static_cast<std::size_t>(i)] =
        std::isnan(count) ? 0 : static_cast<std::int32_t>(held);
  }
  if (!client_) return;
  record.sequence = ++client_->sequence;
  const auto data = encode(record);
  sendto(records_, data.data(), data.size(), MSG_NOSIGNAL | MSG_DONTWAIT,
         reinterpret_cast<const sockaddr*>(&client_->address), sizeof client_->address);
  ++sent_;
  if (client_->left > 0 && --client_->left == 0) client_.reset();
}

}  // namespace ves::devices
