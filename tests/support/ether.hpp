// SPDX-License-Identifier: BSD-3-Clause
//
// A bus in memory, its clock in the hands of who uses it.
#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "ves/bus/bus.hpp"

namespace ves::test {

/// Carries messages between the wires of one process, each a while later, some never.
class Ether {
 public:
  struct Fate {
    int copies = 1;
    std::int64_t delay = 0;  // [ns]
  };
  std::int64_t now = 0;  // [ns]
  std::function<Fate(const std::string& channel)> fate;

  void send(const std::string& channel, const void* data, std::size_t size);

 private:
  friend class MemoryWire;
  std::vector<class MemoryWire*> wires_;
};

class MemoryWire : public Wire {
 public:
  MemoryWire(Ether& ether, std::int64_t clock) : ether_(ether), clock_(clock) {
    ether.wires_.push_back(this);
  }
  ~MemoryWire() override { std::erase(ether_.wires_, this); }
  MemoryWire(const MemoryWire&) = delete;
  MemoryWire& operator=(const MemoryWire&) = delete;

  bool send(const std::string& channel, const void* data, std::size_t size) noexcept override {
    ether_.send(channel, data, size);
    return true;
  }
  void hear(const std::string& channel, std::size_t) override { channels_.push_back(channel); }
  bool read(std::optional<Received>& message) noexcept override {
    if (inbox_.empty() || inbox_.begin()->first > ether_.now) return false;
    in_hand_ = std::move(inbox_.extract(inbox_.begin()).mapped());
    message = Received{in_hand_.channel, in_hand_.data.data(),
                       static_cast<std::uint32_t>(in_hand_.data.size()), in_hand_.due + clock_};
    return true;
  }
  bool readable(std::int64_t) const noexcept override { return false; }
  int descriptor() const noexcept override { return -1; }
  std::int64_t now() const noexcept override { return ether_.now + clock_; }

  void take(const std::string& channel, const void* data, std::size_t size, std::int64_t due) {
    if (std::find(channels_.begin(), channels_.end(), channel) == channels_.end()) return;
    const auto* bytes = static_cast<const std::uint8_t*>(data);
    inbox_.emplace(due, Message{due, channel, {bytes, bytes + size}});
  }

 private:
  struct Message {
    std::int64_t due = 0;  // [ns]
    std::string channel;
    std::vector<std::uint8_t> data;
  };
  Ether& ether_;
  std::int64_t clock_;  // [ns] this host's, less the ether's
  std::vector<std::string> channels_;
  std::multimap<std::int64_t, Message> inbox_;
  Message in_hand_;
};

inline void Ether::send(const std::string& channel, const void* data, std::size_t size) {
  const Fate f = fate(channel);
  for (int i = 0; i < f.copies; ++i)
    for (MemoryWire* wire : wires_) wire->take(channel, data, size, now + f.delay * (1 + 3 * i));
}

}  // namespace ves::test
