// SPDX-License-Identifier: BSD-3-Clause
#include "ves/bus/event_log.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "ves/core/big_endian.hpp"
#include "ves/core/errors.hpp"

namespace ves {
namespace {

constexpr std::uint32_t kSync = 0xEDA1DA01;        // before each event
constexpr std::int64_t kEventHeader = 28;          // [B]
constexpr std::uint32_t kMaxChannel = 63;          // [B] LCM's own limit
constexpr std::uint32_t kMaxData = 16u << 20;      // [B] far above any message of ours
constexpr std::size_t kBuffer = 1u << 16;          // [B]
constexpr std::size_t kRoom = 4096;                // [B] of it for one more message
constexpr std::int64_t kFlushAfter = 500'000'000;  // [ns]

void put(std::vector<std::uint8_t>& to, std::uint64_t value, int bytes) {
  for (int i = bytes - 1; i >= 0; --i) to.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

class FileDisk : public Disk {
 public:
  explicit FileDisk(const std::string& path)
      : file_(open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666)) {
    if (file_ < 0)
      throw InputError(fmt::format("{}: cannot be written: {}", path, strerror(errno)));
  }
  ~FileDisk() override { close(file_); }
  FileDisk(const FileDisk&) = delete;
  FileDisk& operator=(const FileDisk&) = delete;

  std::int64_t write(const void* data, std::size_t size) noexcept override {
    return ::write(file_, data, size);
  }
  void cutTo(std::int64_t size) noexcept override {
    if (ftruncate(file_, size) == 0) lseek(file_, size, SEEK_SET);
  }

 private:
  int file_;
};

}  // namespace

LogWriter::LogWriter(const std::string& path) : LogWriter(std::make_unique<FileDisk>(path)) {}

LogWriter::LogWriter(std::unique_ptr<Disk> disk) : disk_(std::move(disk)) {
  waiting_.reserve(kBuffer);
}

LogWriter::~LogWriter() { flush(); }

void LogWriter::write(const std::string& channel, const void* data, std::int64_t size,
                      std::int64_t time_ns) noexcept {
  // The buffer has room for all but an experiment_t, which comes first.
  if (waiting_.size() + channel.size() + static_cast<std::size_t>(kEventHeader + size) >
      waiting_.capacity())
    try {
      waiting_.reserve(2 * waiting_.capacity() + static_cast<std::size_t>(size));
    } catch (const std::bad_alloc&) {
      error_ = ENOMEM;
      ++lost_;
      return;
    }
  const auto* bytes = static_cast<const std::uint8_t*>(data);
  put(waiting_, kSync, 4);
  put(waiting_, static_cast<std::uint64_t>(events_++), 8);
  put(waiting_, static_cast<std::uint64_t>(time_ns / 1000), 8);
  put(waiting_, channel.size(), 4);
  put(waiting_, static_cast<std::uint64_t>(size), 4);
  waiting_.insert(waiting_.end(), channel.begin(), channel.end());
  waiting_.insert(waiting_.end(), bytes, bytes + size);
  ++waiting_events_;
  if (waiting_.size() < kBuffer - kRoom && time_ns - flushed_at_ < kFlushAfter) return;
  flush();
  flushed_at_ = time_ns;
}

void LogWriter::flush() noexcept {
  std::size_t written = 0;
  while (written < waiting_.size()) {
    const std::int64_t n = disk_->write(waiting_.data() + written, waiting_.size() - written);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    written += static_cast<std::size_t>(n);
  }
  if (written == waiting_.size()) {
    whole_ += static_cast<std::int64_t>(written);
  } else {
    error_ = errno;
    lost_ += waiting_events_;
    // No half event stays; what comes later may find room again.
    disk_->cutTo(whole_);
  }
  waiting_.clear();
  waiting_events_ = 0;
}

std::string LogWriter::trouble() const { return error_ == 0 ? "" : strerror(error_); }

std::string LogEvent::refusal(const std::string& log, const char* type) const {
  return fmt::format(
      "{}: byte {}: this is no {} of schema {}, which this program reads (another version wrote "
      "it, "
      "or it is damaged)",
      log, offset, type, kSchema);
}

void LogEvent::refuse(const std::string& log, const char* type) const {
  throw InputError(refusal(log, type));
}

void Damage::add(const std::string& what) {
  if (count_++ < kFew) first_few_.push_back(what);
}

std::vector<std::string> Damage::lines() const {
  std::vector<std::string> out = first_few_;
  if (count_ > kFew) out.push_back(fmt::format("and {} more such places", count_ - kFew));
  return out;
}

LogReader::LogReader(const std::string& path, Damage* damage) : path_(path), damage_(damage) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) throw InputError(path + ": no such file");
  if (!std::filesystem::is_regular_file(path, error)) throw InputError(path + ": not a file");
  in_.open(path, std::ios::binary);
  if (!in_) throw InputError(path + ": cannot be read");
  size_ = static_cast<std::int64_t>(std::filesystem::file_size(path, error));
  if (size_ == 0) throw InputError(path + ": byte 0: the file is empty, want an LCM event log");
}

bool LogReader::next(LogEvent& event) {
  if (!damage_) return read(event);
  for (;;) {
    const std::int64_t before = offset_;
    try {
      return read(event);
    } catch (const InputError& error) {
      seekNextEvent();
      damage_->add(fmt::format("{}; {} bytes left out", error.what(), offset_ - before));
    }
  }
}

/// To the next sync word after offset_, or the end.
void LogReader::seekNextEvent() {
  constexpr std::int64_t kChunk = 1 << 16;
  std::vector<char> chunk(kChunk);
  std::array<char, 4> sync;
  for (int i = 0; i < 4; ++i)
    sync[static_cast<std::size_t>(i)] = static_cast<char>(kSync >> (24 - 8 * i));
  for (std::int64_t at = offset_ + 1; at < size_; at += kChunk - 3) {
    in_.clear();
    in_.seekg(at);
    in_.read(chunk.data(), kChunk);
    const auto end = chunk.begin() + in_.gcount();
    const auto found = std::search(chunk.begin(), end, sync.begin(), sync.end());
    if (found == end) continue;
    offset_ = at + (found - chunk.begin());
    in_.clear();
    in_.seekg(offset_);
    return;
  }
  offset_ = size_;
}

bool LogReader::read(LogEvent& event) {
  const std::int64_t left = size_ - offset_;
  if (left == 0) return false;
  std::array<std::uint8_t, kEventHeader> header;
  if (left < kEventHeader)
    fail(offset_, fmt::format("{} bytes left, want an event header of {}", left, kEventHeader));
  in_.read(reinterpret_cast<char*>(header.data()), kEventHeader);
  if (!in_) fail(offset_, "cannot be read");
  if (bigEndian(header.data(), 4) != kSync)
    fail(offset_, fmt::format("sync word {:08x}, want {:08x}", bigEndian(header.data(), 4), kSync));
  event.offset = offset_;
  event.time_us = static_cast<std::int64_t>(bigEndian(header.data() + 12, 8));
  const auto channel = static_cast<std::uint32_t>(bigEndian(header.data() + 20, 4));
  const auto data = static_cast<std::uint32_t>(bigEndian(header.data() + 24, 4));
  if (channel == 0 || channel > kMaxChannel)
    fail(offset_ + 20, fmt::format("channel name of {} bytes, want 1 to {}", channel, kMaxChannel));
  if (data > kMaxData)
    fail(offset_ + 24, fmt::format("message of {} bytes, want at most {}", data, kMaxData));
  if (left - kEventHeader < static_cast<std::int64_t>(channel) + data)
    fail(offset_ + 24, fmt::format("event of {} bytes, but {} are left: the file is cut short",
                                   static_cast<std::int64_t>(channel) + data, left - kEventHeader));
  event.channel.resize(channel);
  event.data.resize(data);
  in_.read(event.channel.data(), channel);
  in_.read(reinterpret_cast<char*>(event.data.data()), data);
  if (!in_) fail(offset_, "cannot be read");
  offset_ += kEventHeader + channel + data;
  return true;
}

void LogReader::fail(std::int64_t offset, const std::string& what) const {
  throw InputError(fmt::format("{}: byte {}: {}", path_, offset, what));
}

}  // namespace ves
