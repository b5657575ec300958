// SPDX-License-Identifier: BSD-3-Clause
#include "ves/devices/force_stream.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>
#include <zlib.h>

#include <bit>
#include <cerrno>
#include <charconv>
#include <cstring>

#include "ves/core/errors.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves::devices {
namespace {

using Checksum = StreamSource::Checksum;
using Value = StreamSource::Value;

/// With the lowest bit first, as both sums of 16 bits have it.
std::uint32_t crc16(const std::uint8_t* data, int size, std::uint32_t crc, std::uint32_t poly) {
  for (int i = 0; i < size; ++i) {
    crc ^= data[i];
    for (int bit = 0; bit < 8; ++bit) crc = crc & 1 ? crc >> 1 ^ poly : crc >> 1;
  }
  return crc;
}

/// Of `size` bytes, and how many bytes it takes in a frame.
std::pair<std::uint32_t, int> checksumOf(Checksum kind, const std::uint8_t* data, int size) {
  std::uint32_t sum = 0;
  switch (kind) {
    case Checksum::kNone: return {0, 0};
    case Checksum::kSum8:
      for (int i = 0; i < size; ++i) sum += data[i];
      return {sum & 0xff, 1};
    case Checksum::kXor8:
      for (int i = 0; i < size; ++i) sum ^= data[i];
      return {sum, 1};
    case Checksum::kCrc16Modbus: return {crc16(data, size, 0xffff, 0xa001), 2};
    case Checksum::kCrc16X25: return {crc16(data, size, 0xffff, 0x8408) ^ 0xffff, 2};
    case Checksum::kCrc32:
      return {static_cast<std::uint32_t>(crc32(0, data, static_cast<uInt>(size))), 4};
  }
  return {0, 0};
}

std::uint32_t bits(const std::uint8_t* at, int bytes, bool big_endian) {
  std::uint32_t out = 0;
  for (int i = 0; i < bytes; ++i)
    out |= std::uint32_t{at[big_endian ? bytes - 1 - i : i]} << (8 * i);
  return out;
}

[[noreturn]] void refuse(const StreamSource& source, const std::string& why) {
  throw InputError(fmt::format("force sensor {}: {}", source.path, why));
}

int openSerial(const StreamSource& source) {
  constexpr std::pair<int, speed_t> kSpeeds[] = {
      {9600, B9600},       {19200, B19200},     {38400, B38400},    {57600, B57600},
      {115200, B115200},   {230400, B230400},   {460800, B460800},  {921600, B921600},
      {1000000, B1000000}, {2000000, B2000000}, {4000000, B4000000}};
  const auto* speed = std::find_if(std::begin(kSpeeds), std::end(kSpeeds),
                                   [&](const auto& one) { return one.first == source.baud; });
  if (speed == std::end(kSpeeds))
    refuse(source, fmt::format("{} baud is no usual rate", source.baud));
  const int fd = open(source.path.c_str(), O_RDONLY | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  termios line{};
  if (fd < 0) refuse(source, std::strerror(errno));
  if (tcgetattr(fd, &line) != 0) {
    const int why = errno;
    close(fd);
    refuse(source, fmt::format("is no serial line: {}", std::strerror(why)));
  }
  cfmakeraw(&line);
  cfsetspeed(&line, speed->second);
  line.c_cflag |= CLOCAL | CREAD;
  tcsetattr(fd, TCSANOW, &line);
  return fd;
}

int openUdp(const StreamSource& source) {
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  sockaddr_in here{};
  here.sin_family = AF_INET;
  here.sin_port = htons(static_cast<std::uint16_t>(source.port));
  if (fd < 0 || bind(fd, reinterpret_cast<sockaddr*>(&here), sizeof here) != 0) {
    const int why = errno;
    if (fd >= 0) close(fd);
    refuse(source, std::strerror(why));
  }
  return fd;
}

int openSource(const StreamSource& source) {
  switch (source.from) {
    case StreamSource::From::kSerial: return openSerial(source);
    case StreamSource::From::kUdp: return openUdp(source);
    case StreamSource::From::kPipe: break;
  }
  const int fd = open(source.path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) refuse(source, std::strerror(errno));
  return fd;
}

}  // namespace

bool StreamParser::next(std::size_t& used, Vec6& wrench) {
  return source_.value == Value::kText ? nextLine(used, wrench) : nextFrame(used, wrench);
}

bool StreamParser::nextLine(std::size_t& used, Vec6& wrench) {
  for (;;) {
    const std::size_t end = buffer_.find('\n', used);
    if (end == std::string::npos) return false;
    const char *at = buffer_.data() + used, *const last = buffer_.data() + end;
    used = end + 1;
    int column = 0;
    while (at != last && column < source_.first + 6) {
      const bool between = std::isspace(static_cast<unsigned char>(*at)) ||
                           source_.separators.find(*at) != std::string::npos;
      if (between || *at == '+') {
        ++at;
        continue;
      }
      double number = 0.0;
      const auto [next, error] = std::from_chars(at, last, number);
      if (error != std::errc() || !std::isfinite(number)) break;
      if (column >= source_.first) put(column - source_.first, number, wrench);
      ++column;
      at = next;
    }
    if (column == source_.first + 6) return true;
    ++malformed_;
  }
}

bool StreamParser::nextFrame(std::size_t& used, Vec6& wrench) {
  const auto length = static_cast<std::size_t>(source_.length);
  for (; buffer_.size() - used >= length; ++used) {
    const auto* frame = reinterpret_cast<const std::uint8_t*>(buffer_.data()) + used;
    if (!std::equal(source_.sync.begin(), source_.sync.end(), frame)) continue;
    const auto whole = [&] {
      const auto [sum, bytes] = checksumOf(source_.checksum, frame + source_.checksum_from,
                                           source_.checksum_to - source_.checksum_from);
      return source_.checksum_at + bytes <= source_.length &&
             bits(frame + source_.checksum_at, bytes, source_.big_endian) == sum;
    };
    if (source_.checksum != Checksum::kNone && !whole()) {
      ++malformed_;
      continue;
    }
    const int size = source_.value == Value::kInt16 ? 2 : 4;
    bool finite = true;
    for (int k = 0; k < 6; ++k) {
      const std::uint32_t raw = bits(frame + source_.first + k * size, size, source_.big_endian);
      const double number =
          source_.value == Value::kFloat32 ? static_cast<double>(std::bit_cast<float>(raw))
          : source_.value == Value::kInt16 ? static_cast<double>(static_cast<std::int16_t>(raw))
                                           : static_cast<double>(static_cast<std::int32_t>(raw));
      finite = finite && std::isfinite(number);
      put(k, number, wrench);
    }
    used += length;
    if (finite) return true;
    ++malformed_;
    --used;
  }
  return false;
}

ForceStream::ForceStream(const StreamSource& source, const Mat6& S_proc, std::int64_t window)
    : parser_(source),
      window_(S_proc, window),
      datagrams_(source.from == StreamSource::From::kUdp),
      fd_(openSource(source)) {}

ForceStream::~ForceStream() { close(fd_); }

bool ForceStream::read(WrenchReading& out) noexcept {
  for (std::uint8_t data[2048];;) {
    const ssize_t got = ::read(fd_, data, sizeof data);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0 && errno != EAGAIN) gone_ = true;
    if (got < 0 || (got == 0 && !datagrams_)) break;  // nothing more, or a pipe without a writer
    const std::int64_t now = monotonicNow();
    parser_.take(data, static_cast<std::size_t>(got),
                 [&](const Vec6& wrench) { window_.take(wrench, false, now); });
  }
  if (!window_.read(out)) return false;
  out.fault = out.fault || gone_;
  return true;
}

}  // namespace ves::devices
