// SPDX-License-Identifier: BSD-3-Clause
#include "ves/bus/key.hpp"

#include <fmt/format.h>
#include <sodium.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <functional>
#include <iterator>

#include "ves/bus/channels.hpp"
#include "ves/core/big_endian.hpp"
#include "ves/core/errors.hpp"

namespace ves {
namespace {

// [B] into a message: fingerprint, then header_t.
constexpr std::size_t kSequenceAt = 16, kSourceAt = 24, kEpochAt = 32, kSignatureAt = 40;
constexpr std::size_t kShortest = 56;

std::int64_t numberAt(const std::uint8_t* message, std::size_t at) {
  return static_cast<std::int64_t>(bigEndian(message + at, 8));
}

}  // namespace

Key::Key(const std::string& file) {
  const auto fail = [&](const std::string& what) {
    throw InputError(fmt::format("key {}: {}", file, what));
  };
  if (sodium_init() < 0) fail("libsodium does not start");
  struct stat info {};
  std::ifstream in(file);
  if (!in || stat(file.c_str(), &info) != 0) fail(std::strerror(errno));
  if (info.st_mode & (S_IRWXG | S_IRWXO))
    fail(fmt::format("mode {:04o}, want 0600: others must not read it", info.st_mode & 07777u));
  std::string text(std::istreambuf_iterator<char>(in), {});
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
  std::size_t read = 0;
  if (sodium_hex2bin(key_.data(), key_.size(), text.data(), text.size(), nullptr, &read,
                     nullptr) != 0 ||
      read != key_.size())
    fail("want 64 hexadecimal digits, as `openssl rand -hex 32` writes them");
}

std::array<std::uint8_t, Key::kHash> Key::hash(const std::string& channel,
                                               const std::uint8_t* message,
                                               std::size_t size) const noexcept {
  constexpr std::uint8_t kNoSignature[kHash] = {};
  crypto_generichash_state state;
  std::array<std::uint8_t, kHash> out;
  crypto_generichash_init(&state, key_.data(), key_.size(), kHash);
  const auto add = [&](const void* bytes, std::size_t count) {
    crypto_generichash_update(&state, static_cast<const std::uint8_t*>(bytes), count);
  };
  add(channel.c_str(), channel.size() + 1);
  add(message, kSignatureAt);
  add(kNoSignature, kHash);
  add(message + kShortest, size - kShortest);
  crypto_generichash_final(&state, out.data(), kHash);
  return out;
}

void Key::sign(const std::string& channel, std::uint8_t* message, std::size_t size) const noexcept {
  if (size < kShortest) return;
  const auto signature = hash(channel, message, size);
  std::memcpy(message + kSignatureAt, signature.data(), kHash);
}

bool Key::signedBy(const std::string& channel, const std::uint8_t* message,
                   std::size_t size) const noexcept {
  if (size < kShortest) return false;
  const auto signature = hash(channel, message, size);
  return sodium_memcmp(message + kSignatureAt, signature.data(), kHash) == 0;
}

bool ReplayGuard::fresh(const std::string& channel, const std::uint8_t* message) noexcept {
  const Sender now{std::hash<std::string>()(channel), numberAt(message, kSourceAt),
                   numberAt(message, kEpochAt), numberAt(message, kSequenceAt), messages_};
  const bool once = channel == channel::kRobot || channel == channel::kOperator;
  ++messages_;
  for (std::size_t i = 0; i < count_; ++i) {
    Sender& last = senders_[i];
    if (last.channel != now.channel || last.source != now.source) continue;
    const bool newer = now.epoch > last.epoch ||
                       (now.epoch == last.epoch && now.sequence >= last.sequence + (once ? 1 : 0));
    if (newer) last = now;
    return newer;
  }
  // A sender that was forgotten is not let in again: it may be a recording.
  if (now.epoch <= forgotten_) return false;
  if (count_ < kSenders) {
    senders_[count_++] = now;
    return true;
  }
  Sender& silent =
      *std::min_element(senders_.begin(), senders_.end(),
                        [](const Sender& a, const Sender& b) { return a.heard < b.heard; });
  if (now.epoch <= silent.epoch) return false;
  forgotten_ = std::max(forgotten_, silent.epoch);
  silent = now;
  return true;
}

}  // namespace ves
