// SPDX-License-Identifier: BSD-3-Clause
//
// The key of a bus that leaves the machine: who has it may speak there.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

namespace ves {

/// Signs messages with BLAKE2b (RFC 7693), keyed, 128 bits: over the channel's name, its NUL, and
/// the message with its header's signature zero. Every message begins with fingerprint and
/// header_t.
class Key {
 public:
  /// Of a file with 64 hexadecimal digits that nobody but its owner can read. Throws InputError.
  explicit Key(const std::string& file);

  void sign(const std::string& channel, std::uint8_t* message, std::size_t size) const noexcept;
  bool signedBy(const std::string& channel, const std::uint8_t* message,
                std::size_t size) const noexcept;

 private:
  static constexpr std::size_t kHash = 16;  // [B]
  std::array<std::uint8_t, kHash> hash(const std::string& channel, const std::uint8_t* message,
                                       std::size_t size) const noexcept;

  std::array<std::uint8_t, 32> key_{};
};

/// What each sender said last on each channel: nothing older is taken again.
class ReplayGuard {
 public:
  static constexpr std::size_t kSenders =
      256;  // [-] and channels; then the most silent is forgotten

  /// `message` begins with fingerprint and header_t. The newest one may come again, as messages do
  /// that wait for an answer; of orders, which begin a motion each, it may not.
  bool fresh(const std::string& channel, const std::uint8_t* message) noexcept;

 private:
  struct Sender {
    std::size_t channel;  // hash
    std::int64_t source, epoch, sequence;
    std::int64_t heard;  // [-] number of the message
  };
  std::array<Sender, kSenders> senders_;
  std::size_t count_ = 0;
  std::int64_t messages_ = 0;
  std::int64_t forgotten_ = INT64_MIN;  // the latest epoch of those
};

}  // namespace ves
