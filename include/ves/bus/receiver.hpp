// SPDX-License-Identifier: BSD-3-Clause
//
// LCM's messages as they come over UDP multicast (LCM, "UDP Multicast Protocol Description"). We
// read the socket ourselves: liblcm's reader is a thread of ordinary priority between the kernel
// and the control loop, and two malformed datagrams end its process (lcm-proj/lcm#628).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace ves {

/// One whole message.
struct Received {
  std::string_view channel;
  const std::uint8_t* data = nullptr;
  std::uint32_t size = 0;    // [bytes]
  std::int64_t arrival = 0;  // [ns] monotonic, when it came to this host
};

/// Whole messages of some channels, and nothing of any other. No call throws, but the constructor.
class Receiver {
 public:
  /// Messages above one datagram's size are put together up to here; longer ones are dropped.
  static constexpr std::size_t kLongest = std::size_t{1} << 22;  // [bytes]

  /// Joins the group at `address` (as "239.255.76.67"). Throws InputError.
  Receiver(const std::string& address, std::uint16_t port);
  ~Receiver();
  Receiver(const Receiver&) = delete;
  Receiver& operator=(const Receiver&) = delete;

  /// From now on this channel's messages too, those of at most `longest` bytes. The kernel drops
  /// those of all others.
  void hear(const std::string& channel, std::size_t longest = kLongest);

  /// Readable when a datagram waits.
  int descriptor() const noexcept { return fd_; }

  /// Waits for a datagram until then [ns, monotonic]; false when none came, or a signal did.
  bool readable(std::int64_t until) const noexcept;

  /// Reads one datagram; false when none waits. `message` is the one that it completes, if any; it
  /// is valid until the next call.
  bool read(std::optional<Received>& message) noexcept;

 private:
  /// A message in parts: its beginning, in order.
  struct Parts {
    std::uint64_t sender = 0;    // address and port
    std::uint32_t sequence = 0;  // LCM's, of the sender
    std::uint32_t size = 0;      // [bytes] of the whole
    std::string channel;
    std::vector<std::uint8_t> data;
  };
  std::optional<Received> whole(std::size_t size) const noexcept;
  std::optional<Received> part(std::size_t size, std::uint64_t sender);
  /// [bytes] of a message on this channel; 0: it is not heard.
  std::size_t longest(std::string_view channel) const noexcept;

  struct Channel {
    std::string name;
    std::size_t longest;
  };
  int fd_ = -1;
  std::vector<Channel> channels_;
  std::vector<std::uint8_t> datagram_;
  std::vector<Parts> parts_;  // one of a sender, the newest last
  Parts complete_;            // that was handed out
};

}  // namespace ves
