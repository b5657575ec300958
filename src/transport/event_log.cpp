// SPDX-License-Identifier: BSD-3-Clause
#include "ves/transport/event_log.hpp"

#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <lcm/lcm-cpp.hpp>

#include "ves/base/errors.hpp"

namespace ves {
namespace {

constexpr std::uint32_t kSync = 0xEDA1DA01;    // before each event
constexpr std::int64_t kHeaderSize = 28;       // [B]
constexpr std::uint32_t kMaxChannel = 63;      // [B] LCM's own limit
constexpr std::uint32_t kMaxData = 16u << 20;  // [B] far above any message of ours

std::uint64_t bigEndian(const std::uint8_t* bytes, int n) {
  std::uint64_t x = 0;
  for (int i = 0; i < n; ++i) x = x << 8 | bytes[i];
  return x;
}

}  // namespace

LogWriter::LogWriter(const std::string& path) : file_(std::make_unique<lcm::LogFile>(path, "w")) {
  if (!file_->good()) throw InputError(fmt::format("{}: cannot be written", path));
}

LogWriter::~LogWriter() = default;

void LogWriter::write(const std::string& channel, const void* data, std::int64_t size,
                      std::int64_t time_ns) {
  lcm::LogEvent event;
  event.eventnum = 0;  // the file counts
  event.channel = channel;
  event.timestamp = time_ns / 1000;
  event.datalen = static_cast<std::int32_t>(size);
  event.data = const_cast<void*>(data);
  if (file_->writeEvent(&event) != 0) ++lost_;
}

void LogEvent::refuse(const std::string& log, const char* type) const {
  throw InputError(
      fmt::format("{}: byte {}: this is no {} of schema {}, which this program reads (another "
                  "version wrote it, or "
                  "it is damaged)",
                  log, offset, type, kSchema));
}

LogReader::LogReader(const std::string& path) : path_(path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) throw InputError(path + ": no such file");
  if (!std::filesystem::is_regular_file(path, error)) throw InputError(path + ": not a file");
  in_.open(path, std::ios::binary);
  if (!in_) throw InputError(path + ": cannot be read");
  size_ = static_cast<std::int64_t>(std::filesystem::file_size(path, error));
  if (size_ == 0) throw InputError(path + ": byte 0: the file is empty, want an LCM event log");
}

bool LogReader::next(LogEvent& event) {
  const std::int64_t left = size_ - offset_;
  if (left == 0) return false;
  std::array<std::uint8_t, kHeaderSize> header;
  if (left < kHeaderSize)
    fail(offset_, fmt::format("{} bytes left, want an event header of {}", left, kHeaderSize));
  in_.read(reinterpret_cast<char*>(header.data()), kHeaderSize);
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
  if (left - kHeaderSize < static_cast<std::int64_t>(channel) + data)
    fail(offset_ + 24, fmt::format("event of {} bytes, but {} are left: the file is cut short",
                                   static_cast<std::int64_t>(channel) + data, left - kHeaderSize));
  event.channel.resize(channel);
  event.data.resize(data);
  in_.read(event.channel.data(), channel);
  in_.read(reinterpret_cast<char*>(event.data.data()), data);
  if (!in_) fail(offset_, "cannot be read");
  offset_ += kHeaderSize + channel + data;
  return true;
}

void LogReader::fail(std::int64_t offset, const std::string& what) const {
  throw InputError(fmt::format("{}: byte {}: {}", path_, offset, what));
}

}  // namespace ves
