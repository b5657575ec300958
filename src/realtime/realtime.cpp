// SPDX-License-Identifier: BSD-3-Clause
#include "ves/realtime/realtime.hpp"

#include <fmt/format.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <time.h>

#include <cerrno>
#include <cstring>

#include "ves/core/errors.hpp"

namespace ves {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;  // [ns]

/// Touches more stack than a tick uses, so that no page is missing later.
void prefaultStack() noexcept {
  constexpr std::size_t kStack = 256 * 1024, kPage = 4096;  // [B]
  std::uint8_t stack[kStack];
  for (volatile std::uint8_t* p = stack; p < stack + kStack; p += kPage) *p = 0;
}

}  // namespace

std::int64_t monotonicNow() noexcept {
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * kSecond + now.tv_nsec;
}

std::int64_t wallNow() noexcept {
  timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  return now.tv_sec * kSecond + now.tv_nsec;
}

std::int64_t arrivalOf(msghdr& message, std::int64_t now, std::int64_t behind,
                       std::int64_t longest) noexcept {
  for (cmsghdr* c = CMSG_FIRSTHDR(&message); c; c = CMSG_NXTHDR(&message, c)) {
    if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_TIMESTAMPNS) continue;
    timespec stamp;
    std::memcpy(&stamp, CMSG_DATA(c), sizeof stamp);
    const std::int64_t at = stamp.tv_sec * kSecond + stamp.tv_nsec - behind;
    if (at <= now && now - at < longest) return at;
  }
  return now;
}

std::int64_t Ticker::wait() noexcept {
  next_ += period_;
  std::int64_t missed = 0;
  const std::int64_t now = monotonicNow();
  if (now > next_) {
    missed = (now - next_) / period_;
    next_ += missed * period_;
    missed_ += missed;
  }
  const timespec until{next_ / kSecond, next_ % kSecond};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
  late_ = monotonicNow() - next_;
  return missed;
}

std::string claimRealtime(int priority, bool required) {
  sched_param param{};
  param.sched_priority = priority;
  std::string refused;
  const auto refuse = [&](const char* what) {
    refused +=
        fmt::format("{}{} refused: {}", refused.empty() ? "" : "; ", what, std::strerror(errno));
  };
  // Threads and processes that are begun later have the ordinary priority.
  if (sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &param) != 0) refuse("SCHED_FIFO");
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0)
    refuse("locked memory");
  else
    prefaultStack();
  if (required && !refused.empty())
    throw InputError(fmt::format("--realtime: {} (see ulimit -r and -l, or run as root)", refused));
  return refused;
}

}  // namespace ves
