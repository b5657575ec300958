// SPDX-License-Identifier: BSD-3-Clause
//
// LCM event logs. Writing is LCM's; reading is ours, because LCM 1.3.1's reader crashes on damaged
// files.
#pragma once

#include <cstdint>
#include <deque>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "ves/transport/messages.hpp"

namespace lcm {
class LogFile;
}

namespace ves {

class LogWriter {
 public:
  /// Throws InputError when the file cannot be written.
  explicit LogWriter(const std::string& path);
  ~LogWriter();

  void write(const std::string& channel, const void* data, std::int64_t size, std::int64_t time_ns);

  template <typename Message>
  void write(const std::string& channel, const Message& message, std::int64_t time_ns) {
    buffer_.resize(static_cast<std::size_t>(message.getEncodedSize()));
    const int size = message.encode(buffer_.data(), 0, static_cast<int>(buffer_.size()));
    write(channel, buffer_.data(), size, time_ns);
  }

  /// Events that could not be written, a full disk for example. Control does not depend on it.
  std::int64_t lost() const noexcept { return lost_; }

 private:
  std::unique_ptr<lcm::LogFile> file_;
  std::vector<std::uint8_t> buffer_;
  std::int64_t lost_ = 0;
};

struct LogEvent {
  std::int64_t offset = 0;   // [B] of the event in the file
  std::int64_t time_us = 0;  // [us]
  std::string channel;
  std::vector<std::uint8_t> data;

  template <typename Message>
  std::optional<Message> as() const {
    return decode<Message>(data.data(), static_cast<std::int64_t>(data.size()));
  }
  /// The same, or InputError: `log` is the file's name.
  template <typename Message>
  Message require(const std::string& log) const {
    if (auto message = as<Message>()) return *std::move(message);
    refuse(log, Message::getTypeName());
  }

 private:
  [[noreturn]] void refuse(const std::string& log, const char* type) const;
};

/// The last messages of a log by their sequence: what a tick refers to stands shortly before it.
template <typename T>
class Recent {
 public:
  void put(std::int64_t sequence, const T& value) {
    if (!by_sequence_.insert_or_assign(sequence, value).second) return;
    order_.push_back(sequence);
    if (order_.size() <= kKept) return;
    by_sequence_.erase(order_.front());
    order_.pop_front();
  }
  const T* find(std::int64_t sequence) const {
    const auto at = by_sequence_.find(sequence);
    return at == by_sequence_.end() ? nullptr : &at->second;
  }

 private:
  static constexpr std::size_t kKept = 4096;  // [-] messages
  std::unordered_map<std::int64_t, T> by_sequence_;
  std::deque<std::int64_t> order_;
};

class LogReader {
 public:
  /// Throws InputError when there is no such file.
  explicit LogReader(const std::string& path);

  /// The next event; nothing at the end. Throws InputError, with the byte, where the file is no
  /// log.
  bool next(LogEvent& event);

 private:
  [[noreturn]] void fail(std::int64_t offset, const std::string& what) const;

  std::string path_;
  std::ifstream in_;
  std::int64_t size_ = 0;    // [B]
  std::int64_t offset_ = 0;  // [B]
};

}  // namespace ves
