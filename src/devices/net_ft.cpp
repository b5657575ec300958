// SPDX-License-Identifier: BSD-3-Clause
#include "ves/devices/net_ft.hpp"

#include <curl/curl.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <netdb.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <memory>

#include "ves/core/errors.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves::devices {
namespace {

constexpr int kPatience = 2000;                     // [ms] for the sensor's web page
constexpr std::int64_t kSilence = 500'000'000;      // [ns]
constexpr std::int64_t kLookAgain = 1'000'000'000;  // [ns] at the calibration

std::string nameOf(const NetFtAddress& address, int port) {
  return fmt::format("force sensor {}:{}", address.host, port);
}

/// A socket that is connected, or being connected, and does not block.
int connected(const NetFtAddress& address, int port, int type) {
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = type;
  addrinfo* found = nullptr;
  const int error = getaddrinfo(address.host.c_str(), std::to_string(port).c_str(), &hints, &found);
  if (error) throw InputError(fmt::format("{}: {}", nameOf(address, port), gai_strerror(error)));
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> owner(found, freeaddrinfo);
  const int fd = socket(found->ai_family, found->ai_socktype | SOCK_CLOEXEC | SOCK_NONBLOCK,
                        found->ai_protocol);
  if (fd < 0 || (connect(fd, found->ai_addr, found->ai_addrlen) != 0 && errno != EINPROGRESS)) {
    const int why = errno;
    if (fd >= 0) close(fd);
    throw InputError(fmt::format("{}: {}", nameOf(address, port), std::strerror(why)));
  }
  return fd;
}

}  // namespace

NetFtPage fetchNetFtXml(const NetFtAddress& address, int patience) {
  static const CURLcode ready = curl_global_init(CURL_GLOBAL_DEFAULT);
  const std::unique_ptr<CURL, decltype(&curl_easy_cleanup)> curl(curl_easy_init(),
                                                                 curl_easy_cleanup);
  const auto fail = [&](const std::string& why) {
    throw InputError(
        fmt::format("{}: /netftapi2.xml: {}", nameOf(address, address.http_port), why));
  };
  if (ready != CURLE_OK || !curl) fail("no HTTP");
  NetFtPage page;
  const auto take = +[](char* data, std::size_t one, std::size_t n, void* to) -> std::size_t {
    constexpr std::size_t kLongest = 65536;  // [B]
    auto& text = *static_cast<std::string*>(to);
    if (text.size() + one * n > kLongest) return 0;
    text.append(data, one * n);
    return one * n;
  };
  const bool v6 = address.host.find(':') != std::string::npos;
  const std::string url = fmt::format("http://{}{}{}:{}/netftapi2.xml", v6 ? "[" : "", address.host,
                                      v6 ? "]" : "", address.http_port);
  char error[CURL_ERROR_SIZE] = "";
  curl_easy_setopt(curl.get(), CURLOPT_URL, url.c_str());
  curl_easy_setopt(curl.get(), CURLOPT_PROTOCOLS_STR, "http");
  curl_easy_setopt(curl.get(), CURLOPT_PROXY, "");
  curl_easy_setopt(curl.get(), CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(curl.get(), CURLOPT_TIMEOUT_MS, static_cast<long>(patience));
  curl_easy_setopt(curl.get(), CURLOPT_ERRORBUFFER, error);
  curl_easy_setopt(curl.get(), CURLOPT_WRITEFUNCTION, take);
  curl_easy_setopt(curl.get(), CURLOPT_WRITEDATA, &page.xml);
  const CURLcode result = curl_easy_perform(curl.get());
  long status = 0;
  const char* ip = nullptr;
  curl_easy_getinfo(curl.get(), CURLINFO_RESPONSE_CODE, &status);
  curl_easy_getinfo(curl.get(), CURLINFO_PRIMARY_IP, &ip);
  if (result == CURLE_WRITE_ERROR) fail("longer than 64 kB");
  if (result == CURLE_OPERATION_TIMEDOUT) fail("no answer");
  if (result != CURLE_OK) fail(*error ? error : curl_easy_strerror(result));
  if (status >= 300 && status < 400)
    fail(fmt::format("answers {}: it sends elsewhere, want the box itself", status));
  if (status != 200) fail(fmt::format("answers {}", status));
  if (ip) page.ip = ip;
  return page;
}

NetFt::NetFt(const NetFtAddress& address, const Mat6& S_proc, std::int64_t window)
    : NetFt(address, fetchNetFtXml(address, kPatience), S_proc, window) {}

NetFt::NetFt(const NetFtAddress& address, const NetFtPage& page, const Mat6& S_proc,
             std::int64_t window)
    : address_(address),
      calibration_(netFtCalibration(page.xml)),
      stream_(calibration_, S_proc, window),
      socket_(connected({page.ip, address.port, address.http_port}, address.port, SOCK_DGRAM)) {
  const int on = 1, room = 1 << 20;
  setsockopt(socket_, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
  ask(monotonicNow());
  watcher_ = std::thread([this] { watchCalibration(); });
}

NetFt::~NetFt() {
  over_ = true;
  watcher_.join();
  const auto stop = encode(RdtRequest{RdtCommand::kStop, 0});
  send(socket_, stop.data(), stop.size(), MSG_NOSIGNAL);
  close(socket_);
}

void NetFt::ask(std::int64_t now) noexcept {
  const auto request = encode(RdtRequest{RdtCommand::kStream, 0});
  send(socket_, request.data(), request.size(), MSG_NOSIGNAL);
  asked_ = now;
}

void NetFt::watchCalibration() {
  for (std::int64_t next = monotonicNow() + kLookAgain; !over_;) {
    usleep(20'000);
    if (monotonicNow() < next) continue;
    try {
      const NetFtCalibration now = netFtCalibration(fetchNetFtXml(address_, kPatience).xml);
      if (now != calibration_ && !changed_.exchange(true))
        fmt::print(stderr,
                   "{}: its calibration was {} and is {} now: a fault until it is read anew\n",
                   nameOf(address_, address_.port), calibration_.serial, now.serial);
    } catch (const InputError&) {  // a busy web page is no fault; its records say how it is
    }
    next = monotonicNow() + kLookAgain;
  }
}

bool NetFt::read(WrenchReading& out) noexcept {
  const std::int64_t now = monotonicNow();
  const std::int64_t behind = wallNow() - now;  // [ns] from this clock to the kernel's stamps
  for (;;) {
    std::uint8_t data[kRdtRecordSize + 1];
    alignas(cmsghdr) char control[64];
    iovec part{data, sizeof data};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control;
    message.msg_controllen = sizeof control;
    const ssize_t got = recvmsg(socket_, &message, MSG_DONTWAIT);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0 && errno == ECONNREFUSED) continue;  // of an earlier request; it is taken off
    if (got < 0) break;
    const std::int64_t came = arrivalOf(message, now, behind, kSilence);
    const std::int64_t before = stream_.counters().records;
    stream_.take(data, static_cast<std::size_t>(got), came);
    if (stream_.counters().records > before) heard_ = now;
  }
  if (now - std::max(heard_, asked_) > kSilence) {
    stream_.restart();
    ask(now);
  }
  if (!stream_.read(out)) return false;
  out.fault = out.fault || changed_;
  return true;
}

}  // namespace ves::devices
