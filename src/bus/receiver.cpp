// SPDX-License-Identifier: BSD-3-Clause
#include "ves/bus/receiver.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <linux/filter.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <utility>

#include "ves/core/big_endian.hpp"
#include "ves/core/errors.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves {
namespace {

constexpr std::uint32_t kWhole = 0x4c433032;  // "LC02": a message in one datagram
constexpr std::uint32_t kPart = 0x4c433033;   // "LC03": a part of one
constexpr std::size_t kWholeHeader = 8;       // [bytes] magic, sequence
// [bytes] magic, sequence, size, offset of this part, number of this part (2), parts (2)
constexpr std::size_t kPartHeader = 20;
constexpr std::size_t kLongestName = 63;         // [bytes] of a channel, LCM's limit
constexpr std::size_t kLongestDatagram = 65536;  // [bytes]
constexpr std::size_t kSenders = 8;              // [-] messages in parts at a time
// A second of everything on the bus, as ./ves doctor asks of net.core.rmem_max; beyond that it
// takes privileges.
constexpr int kKernelBuffer = 2 << 20;                 // [bytes]
constexpr std::int64_t kLongestWait = 10'000'000'000;  // [ns] in the kernel's buffer

std::uint32_t word(const std::uint8_t* bytes) noexcept {
  return static_cast<std::uint32_t>(bigEndian(bytes, 4));
}

/// The channel's name at the beginning of `bytes`, which ends with a zero; none when it does not.
std::optional<std::string_view> nameIn(const std::uint8_t* bytes, std::size_t size) noexcept {
  const void* const end = std::memchr(bytes, 0, std::min(size, kLongestName + 1));
  if (!end) return {};
  return std::string_view(reinterpret_cast<const char*>(bytes),
                          static_cast<std::size_t>(static_cast<const std::uint8_t*>(end) - bytes));
}

/// For the kernel: parts, and whole messages of these channels. It sees a datagram from its UDP
/// header on, and drops what is shorter than what it is to load.
std::vector<sock_filter> filter(const std::vector<std::string>& channels) {
  constexpr std::uint32_t kUdpHeader = 8;  // [bytes]
  constexpr std::uint32_t kTake = 0xffffffff, kDrop = 0;
  std::vector<sock_filter> program;
  const auto add = [&](int code, std::uint32_t k, std::size_t otherwise = 0) {
    program.push_back(
        {static_cast<std::uint16_t>(code), 0, static_cast<std::uint8_t>(otherwise), k});
  };
  add(BPF_LD | BPF_W | BPF_ABS, kUdpHeader);
  add(BPF_JMP | BPF_JEQ | BPF_K, kPart, 1);
  add(BPF_RET | BPF_K, kTake);
  for (const std::string& channel : channels) {
    const std::size_t length = channel.size() + 1;  // with its zero
    const std::size_t words = length / 4, rest = length % 4;
    const std::size_t end = program.size() + 2 * (1 + words + rest) + 1;
    add(BPF_LD | BPF_W | BPF_LEN, 0);
    add(BPF_JMP | BPF_JGE | BPF_K, kUdpHeader + static_cast<std::uint32_t>(kWholeHeader + length),
        end - program.size() - 1);
    std::size_t at = 0;
    const auto compare = [&](int width, std::size_t bytes) {
      std::uint32_t value = 0;
      for (std::size_t i = 0; i < bytes; ++i)
        value = value << 8 | static_cast<std::uint8_t>(channel.c_str()[at + i]);
      add(BPF_LD | width | BPF_ABS, kUdpHeader + static_cast<std::uint32_t>(kWholeHeader + at));
      add(BPF_JMP | BPF_JEQ | BPF_K, value, end - program.size() - 1);
      at += bytes;
    };
    for (std::size_t i = 0; i < words; ++i) compare(BPF_W, 4);
    for (std::size_t i = 0; i < rest; ++i) compare(BPF_B, 1);
    add(BPF_RET | BPF_K, kTake);
  }
  add(BPF_RET | BPF_K, kDrop);
  return program;
}

}  // namespace

Receiver::Receiver(const std::string& address, std::uint16_t port) : datagram_(kLongestDatagram) {
  parts_.reserve(kSenders + 1);
  sockaddr_in group{};
  group.sin_family = AF_INET;
  group.sin_port = htons(port);
  ip_mreq join{};
  fd_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const auto set = [this](int level, int option, const auto& value) {
    return setsockopt(fd_, level, option, &value, sizeof value) == 0;
  };
  // Several programs share the address.
  const bool good = inet_pton(AF_INET, address.c_str(), &group.sin_addr) == 1 && fd_ >= 0 &&
                    set(SOL_SOCKET, SO_REUSEADDR, 1) &&
                    bind(fd_, reinterpret_cast<const sockaddr*>(&group), sizeof group) == 0;
  join.imr_multiaddr = group.sin_addr;
  if (!good || !set(IPPROTO_IP, IP_ADD_MEMBERSHIP, join)) {
    const std::string why = std::strerror(errno);
    if (fd_ >= 0) close(fd_);
    throw InputError(fmt::format("bus udpm://{}:{}: {}", address, port, why));
  }
  if (!set(SOL_SOCKET, SO_RCVBUFFORCE, kKernelBuffer)) set(SOL_SOCKET, SO_RCVBUF, kKernelBuffer);
  set(SOL_SOCKET, SO_TIMESTAMPNS, 1);
}

Receiver::~Receiver() { close(fd_); }

void Receiver::hear(const std::string& channel, std::size_t longest) {
  for (Channel& known : channels_)
    if (known.name == channel) {
      known.longest = std::max(known.longest, longest);
      return;
    }
  channels_.push_back({channel, longest});
  std::vector<std::string> names;
  for (const Channel& one : channels_) names.push_back(one.name);
  std::vector<sock_filter> program = filter(names);
  const sock_fprog filter{static_cast<unsigned short>(program.size()), program.data()};
  // Where the kernel has none of this, read() does it alone.
  setsockopt(fd_, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof filter);
}

std::size_t Receiver::longest(std::string_view channel) const noexcept {
  for (const Channel& one : channels_)
    if (one.name == channel) return one.longest;
  return 0;
}

bool Receiver::readable(std::int64_t until) const noexcept {
  const std::int64_t left = until - monotonicNow();
  if (left <= 0) return false;
  pollfd socket{fd_, POLLIN, 0};
  const timespec patience{left / 1'000'000'000, left % 1'000'000'000};
  return ppoll(&socket, 1, &patience, nullptr) > 0;
}

bool Receiver::read(std::optional<Received>& message) noexcept {
  message.reset();
  sockaddr_in from{};
  iovec into{datagram_.data(), datagram_.size()};
  alignas(cmsghdr) std::array<char, 64> control;
  msghdr header{};
  header.msg_name = &from;
  header.msg_namelen = sizeof from;
  header.msg_iov = &into;
  header.msg_iovlen = 1;
  header.msg_control = control.data();
  header.msg_controllen = control.size();
  const ssize_t got = recvmsg(fd_, &header, 0);
  if (got < 0) return false;
  const auto size = static_cast<std::size_t>(got);
  if (size < kWholeHeader) return true;
  const std::uint32_t magic = word(datagram_.data());
  if (magic == kWhole) message = whole(size);
  if (magic == kPart) try {
      message = part(size, std::uint64_t{from.sin_addr.s_addr} << 16 | from.sin_port);
    } catch (const std::bad_alloc&) {
      parts_.clear();  // there is no memory for them
    }
  if (message) {
    const std::int64_t now = monotonicNow();
    message->arrival = arrivalOf(header, now, wallNow() - now, kLongestWait);
  }
  return true;
}

std::optional<Received> Receiver::whole(std::size_t size) const noexcept {
  const std::uint8_t* const begin = datagram_.data() + kWholeHeader;
  const auto channel = nameIn(begin, size - kWholeHeader);
  if (!channel) return {};
  const std::size_t before = kWholeHeader + channel->size() + 1;
  if (size - before > longest(*channel)) return {};
  return Received{*channel, datagram_.data() + before, static_cast<std::uint32_t>(size - before),
                  0};
}

/// Parts count in order: on the networks that this is for none overtakes another, and what is said
/// in parts is said again.
std::optional<Received> Receiver::part(std::size_t size, std::uint64_t sender) {
  if (size < kPartHeader) return {};
  const std::uint32_t sequence = word(&datagram_[4]), length = word(&datagram_[8]),
                      offset = word(&datagram_[12]);
  const bool first = datagram_[16] == 0 && datagram_[17] == 0;
  const std::uint8_t* data = datagram_.data() + kPartHeader;
  std::size_t bytes = size - kPartHeader;
  const auto known = std::find_if(parts_.begin(), parts_.end(),
                                  [&](const Parts& p) { return p.sender == sender; });
  if (first) {
    if (known != parts_.end()) parts_.erase(known);
    const auto channel = nameIn(data, bytes);
    if (!channel || length > longest(*channel)) return {};
    if (parts_.size() == kSenders) parts_.erase(parts_.begin());
    parts_.push_back({sender, sequence, length, std::string(*channel), {}});
    data += channel->size() + 1;
    bytes -= channel->size() + 1;
  } else if (known == parts_.end()) {
    return {};
  }
  Parts& message = first ? parts_.back() : *known;
  if (message.sequence != sequence || message.size != length || message.data.size() != offset ||
      bytes > length - offset) {
    parts_.erase(parts_.begin() + (&message - parts_.data()));
    return {};
  }
  message.data.insert(message.data.end(), data, data + bytes);
  if (message.data.size() < length) return {};
  complete_ = std::move(message);
  parts_.erase(parts_.begin() + (&message - parts_.data()));
  return Received{complete_.channel, complete_.data.data(), complete_.size, 0};
}

}  // namespace ves
