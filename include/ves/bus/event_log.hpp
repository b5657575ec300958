// SPDX-License-Identifier: BSD-3-Clause
//
// LCM event logs: a writer that keeps the file whole when the disk is full, and a reader that knows
// what to do with damage (LCM 1.3.1's crashes on it).
#pragma once

#include <cstdint>
#include <deque>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "ves/bus/messages.hpp"

namespace ves {

/// Where a log's bytes go: a file, or memory that can be full.
class Disk {
 public:
  virtual ~Disk() = default;
  /// As POSIX write(): the bytes taken, which may be fewer; -1 and errno.
  virtual std::int64_t write(const void* data, std::size_t size) noexcept = 0;
  /// Nothing stays beyond `size` [B], and what is written next follows there.
  virtual void cutTo(std::int64_t size) noexcept = 0;
};

class LogWriter {
 public:
  /// Throws InputError when the file cannot be written.
  explicit LogWriter(const std::string& path);
  explicit LogWriter(std::unique_ptr<Disk> disk);
  ~LogWriter();
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;

  /// Reaches the file within half a second of the events' own time.
  void write(const std::string& channel, const void* data, std::int64_t size,
             std::int64_t time_ns) noexcept;
  void flush() noexcept;

  template <typename Message>
  void write(const std::string& channel, const Message& message, std::int64_t time_ns) {
    buffer_.resize(static_cast<std::size_t>(message.getEncodedSize()));
    const int size = message.encode(buffer_.data(), 0, static_cast<int>(buffer_.size()));
    write(channel, buffer_.data(), size, time_ns);
  }

  /// Events that could not be written. Control does not depend on it; what is in the file is whole.
  std::int64_t lost() const noexcept { return lost_; }
  /// Why events were lost, as `No space left on device`; empty when none was.
  std::string trouble() const;

 private:
  std::unique_ptr<Disk> disk_;
  std::vector<std::uint8_t> buffer_;   // one message
  std::vector<std::uint8_t> waiting_;  // whole events
  std::int64_t waiting_events_ = 0;    // [-]
  std::int64_t events_ = 0;            // [-]
  std::int64_t flushed_at_ = 0;        // [ns] events' time
  std::int64_t whole_ = 0;             // [B] of the file
  std::int64_t lost_ = 0;
  int error_ = 0;
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

  /// The words for bytes that are no such message.
  std::string refusal(const std::string& log, const char* type) const;

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

/// What of a log could not be used, in words that begin with the file's name and the byte.
class Damage {
 public:
  void add(const std::string& what);
  bool any() const { return count_ > 0; }
  /// The first few, and how many more.
  std::vector<std::string> lines() const;
  const std::string& first() const { return first_few_.front(); }

 private:
  static constexpr std::int64_t kFew = 5;
  std::vector<std::string> first_few_;
  std::int64_t count_ = 0;
};

class LogReader {
 public:
  /// Throws InputError when there is no such file. With `damage` the reader passes over what is not
  /// whole, to the next event, and says so there.
  explicit LogReader(const std::string& path, Damage* damage = nullptr);

  /// The next event; nothing at the end. Without `damage` throws InputError, with the byte, where
  /// the file is no log.
  bool next(LogEvent& event);

 private:
  bool read(LogEvent& event);
  void seekNextEvent();
  [[noreturn]] void fail(std::int64_t offset, const std::string& what) const;

  std::string path_;
  Damage* damage_;
  std::ifstream in_;
  std::int64_t size_ = 0;    // [B]
  std::int64_t offset_ = 0;  // [B]
};

}  // namespace ves
