// SPDX-License-Identifier: BSD-3-Clause
//
// A force sensor that sends frames of bytes or lines of text by itself, over a serial line, UDP or
// a pipe: StreamSource (config/experiment.hpp) says how they look. docs/machine.md has examples.
#pragma once

#include <string>

#include "ves/config/experiment.hpp"
#include "ves/devices/wrench_window.hpp"

namespace ves::devices {

/// Takes bytes as they come, in pieces of any size, and finds the frames or lines in them.
class StreamParser {
 public:
  explicit StreamParser(const StreamSource& source) : source_(source) {}

  /// f(wrench) [N, N m] in {S} of each that is whole. Allocates nothing once its buffer has grown.
  template <typename F>
  void take(const std::uint8_t* data, std::size_t size, F f) {
    buffer_.append(reinterpret_cast<const char*>(data), size);
    Vec6 wrench;
    std::size_t used = 0;
    while (next(used, wrench)) f(wrench);
    buffer_.erase(0, used);
    if (buffer_.size() > kLongest) buffer_.clear();  // no frame and no line is that long
  }
  std::int64_t malformed() const noexcept { return malformed_; }  // [-] frames or lines

 private:
  static constexpr std::size_t kLongest = 4096;  // [B]

  /// The next whole one from byte `used` on, which goes behind it; what is none is passed over.
  bool next(std::size_t& used, Vec6& wrench);
  bool nextLine(std::size_t& used, Vec6& wrench);
  bool nextFrame(std::size_t& used, Vec6& wrench);
  void put(int value, double number, Vec6& wrench) const {
    const int channel = source_.channels[static_cast<std::size_t>(value)];
    wrench(channel) = number * source_.scale(value);
  }

  StreamSource source_;
  std::string buffer_;
  std::int64_t malformed_ = 0;
};

class ForceStream : public ForceSensor {
 public:
  /// Opens it. `S_proc` [count/N | count/(N m)] and `window` [ns] as for a NetFt. Throws
  /// InputError.
  ForceStream(const StreamSource& source, const Mat6& S_proc, std::int64_t window);
  ~ForceStream() override;
  ForceStream(const ForceStream&) = delete;
  ForceStream& operator=(const ForceStream&) = delete;

  /// Takes in what has come, by the time at which it is read. A device that was pulled out is a
  /// fault.
  bool read(WrenchReading& out) noexcept override;
  const StreamParser& parser() const noexcept { return parser_; }

 private:
  StreamParser parser_;
  WrenchWindow window_;
  bool datagrams_;
  int fd_ = -1;
  bool gone_ = false;
};

}  // namespace ves::devices
