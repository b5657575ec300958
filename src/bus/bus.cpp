// SPDX-License-Identifier: BSD-3-Clause
#include "ves/bus/bus.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <sched.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <lcm/lcm-cpp.hpp>

#include "ves/bus/channels.hpp"
#include "ves/core/errors.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves {
namespace {

// More than wait after any stall that a run survives: a stalled controller finds the newest.
constexpr int kAtOnce = 4096;                     // [-] datagrams
constexpr std::size_t kLongestFixed = 4096;       // [B] of the messages that have one size
constexpr std::int64_t kMillisecond = 1'000'000;  // [ns]
constexpr std::int64_t kAwake = 50'000;           // [ns]

bool severalProcessors() noexcept {
  cpu_set_t ours;
  return sched_getaffinity(0, sizeof ours, &ours) == 0 && CPU_COUNT(&ours) > 1;
}

/// True when the kernel knows where multicast should go; LCM prints a page when it does not.
bool hasRoute() {
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(7667);
  to.sin_addr.s_addr = inet_addr("239.255.76.67");
  const bool found = connect(fd, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0;
  close(fd);
  return found;
}

[[noreturn]] void refuse(const std::string& url) {
  throw InputError(fmt::format(
      "bus {}: no message comes back; multicast needs a route on some interface (for one "
      "machine: ip link set lo multicast on; ip route add 224.0.0.0/4 dev lo), or use "
      "--private-bus",
      url));
}

const std::string& reachable(const BusAddress& address) {
  if (!hasRoute()) refuse(address.lcm);
  return address.lcm;
}

/// UDP multicast: liblcm sends, the Receiver reads.
class Multicast : public Wire {
 public:
  explicit Multicast(const BusAddress& address) : address_(address), lcm_(reachable(address_)) {}

  bool good() { return lcm_.good(); }
  /// One message to ourselves, within two seconds.
  bool echoes();

  bool send(const std::string& channel, const void* data, std::size_t size) noexcept override {
    return lcm_.publish(channel, data, static_cast<unsigned>(size)) == 0;
  }
  void hear(const std::string& channel, std::size_t longest) override {
    if (!receiver_) receiver_.emplace(address_.group, address_.port);
    receiver_->hear(channel, longest);
  }
  bool read(std::optional<Received>& message) noexcept override {
    return receiver_ && receiver_->read(message);
  }
  bool readable(std::int64_t until) const noexcept override {
    return receiver_ && receiver_->readable(until);
  }
  int descriptor() const noexcept override { return receiver_ ? receiver_->descriptor() : -1; }
  std::int64_t now() const noexcept override { return monotonicNow(); }

 private:
  BusAddress address_;
  lcm::LCM lcm_;
  std::optional<Receiver> receiver_;  // who only speaks has none
};

bool Multicast::echoes() {
  const std::string channel = "VES_ECHO";
  Receiver receiver(address_.group, address_.port);
  receiver.hear(channel);
  std::optional<Received> heard;
  for (int i = 0; i < 20; ++i) {
    if (lcm_.publish(channel, "?", 1) != 0) return false;
    const std::int64_t until = monotonicNow() + 100'000'000;
    do {
      while (receiver.read(heard))
        if (heard) return true;
    } while (receiver.readable(until));
  }
  return false;
}

}  // namespace

BusAddress::BusAddress(const std::string& url) {
  // LCM would print about what it does not understand, or take part of an address.
  unsigned a, b, c, d, number;
  int end = 0;
  const int read =
      std::sscanf(url.c_str(), "udpm://%3u.%3u.%3u.%3u:%5u%n", &a, &b, &c, &d, &number, &end);
  bool good = read == 5 && a >= 224 && a <= 239 && b < 256 && c < 256 && d < 256 && number > 0 &&
              number < 65536;
  std::string rest = url.substr(static_cast<std::size_t>(end));
  lcm = url.substr(0, static_cast<std::size_t>(end));
  for (char lead = '?'; good && !rest.empty(); lead = '&') {
    const std::size_t next = std::min(rest.find('&', 1), rest.size());
    const std::string option = rest.substr(0, next);
    int taken = 0;
    if (option.rfind(lead + std::string("key="), 0) == 0 && option.size() > 5)
      key_file = option.substr(5);
    else
      good = option[0] == lead && std::sscanf(option.c_str() + 1, "ttl=%3d%n", &ttl, &taken) == 1 &&
             static_cast<std::size_t>(taken) + 1 == option.size() && ttl >= 0 && ttl < 256;
    rest.erase(0, next);
  }
  if (!good)
    throw InputError(fmt::format(
        "--url {}: want udpm://MULTICAST-ADDRESS:PORT[?ttl=N][&key=FILE], for example {}", url,
        kDefaultUrl));
  group = fmt::format("{}.{}.{}.{}", a, b, c, d);
  port = static_cast<std::uint16_t>(number);
  lcm += fmt::format("?ttl={}", ttl);
}

std::string withKey(const std::string& url, const std::string& key_file) {
  if (key_file.empty() || !BusAddress(url).key_file.empty()) return url;
  return fmt::format("{}{}key={}", url, url.find('?') == std::string::npos ? '?' : '&', key_file);
}

std::string openBusWarning(const std::string& url) {
  const BusAddress address(url);
  if (address.ttl == 0 || !address.key_file.empty()) return {};
  return fmt::format(
      "{}: anybody in reach can command the legs; &key=FILE has messages signed (docs/machine.md)",
      url);
}

Bus::Bus(const std::string& url) : several_processors_(severalProcessors()) {
  const BusAddress address(url);
  auto wire = std::make_unique<Multicast>(address);
  if (!address.key_file.empty()) key_.emplace(address.key_file);
  if (!wire->good()) throw InputError(fmt::format("--url {}: not a bus that LCM can open", url));
  if (!wire->echoes()) refuse(url);
  wire_ = std::move(wire);
}

Bus::Bus(std::unique_ptr<Wire> wire) noexcept
    : wire_(std::move(wire)), several_processors_(false) {}

void Bus::publish(const std::string& channel, const experiment_t& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  send(channel, bytes.data(), bytes.size());
}

void Bus::send(const std::string& channel, std::uint8_t* message, std::size_t size) noexcept {
  if (key_) key_->sign(channel, message, size);
  if (!wire_->send(channel, message, size)) ++failed_;
}

/// Signed, and not heard before; anything on a bus without a key.
bool Bus::lets(const Received& message, const std::string& channel) noexcept {
  if (!key_) return true;
  if (!key_->signedBy(channel, message.data, message.size)) {
    ++refused_.forged;
    return false;
  }
  if (!guard_.fresh(channel, message.data)) {
    ++refused_.replayed;
    return false;
  }
  return true;
}

void Bus::subscribe(const std::vector<std::string>& channels, const Handler& handler) {
  for (const std::string& channel : channels) {
    wire_->hear(channel, channel == channel::kExperiment ? Receiver::kLongest : kLongestFixed);
    subscriptions_.push_back({channel, handler});
  }
}

/// To all that subscribed to its channel; false when nobody did, or it is not let in.
bool Bus::handOut(const Received& message) noexcept {
  bool let = false;
  for (const Subscription& s : subscriptions_) {
    if (s.channel != message.channel) continue;
    // It is looked at once: the second time it would be a replay.
    let = let || lets(message, s.channel);
    if (!let) return false;
    arrival_ = message.arrival;
    try {
      s.handler(s.channel, message.data, message.size);
    } catch (...) {
      if (!failure_) failure_ = std::current_exception();
    }
  }
  return let;
}

void Bus::rethrow() {
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
}

void Bus::drain() noexcept {
  std::optional<Received> message;
  for (int i = 0; i < kAtOnce && wire_->read(message); ++i)
    if (message) handOut(*message);
}

bool Bus::wait(int milliseconds) noexcept {
  return waitUntil(now() + milliseconds * kMillisecond, 0);
}

bool Bus::waitAwake(int milliseconds) noexcept {
  const std::int64_t now = this->now();
  return waitUntil(now + milliseconds * kMillisecond, several_processors_ ? now + kAwake : 0);
}

bool Bus::waitUntil(std::int64_t until, std::int64_t awake) noexcept {
  std::optional<Received> message;
  do {
    for (int i = 0; i < kAtOnce && wire_->read(message); ++i)
      if (message && handOut(*message)) return true;
  } while (now() < awake || wire_->readable(until));
  return false;
}

bool busWorks(const std::string& url) {
  const BusAddress address(url);
  try {
    Bus bus(address.lcm);
    return true;
  } catch (const InputError&) {
    return false;
  }
}

SetupLink::SetupLink(Bus& bus, const Identity& self) : bus_(bus), self_(self) {
  bus.subscribe({channel::kSetup},
                [this](const std::string&, const void* data, std::uint32_t size) {
                  const auto message = decode<setup_t>(data, size);
                  if (const auto setup = message ? fromMessage(*message) : std::nullopt)
                    setup_ = setup;
                });
}

bool SetupLink::wait(int milliseconds) noexcept {
  constexpr std::int64_t kAgain = 1'000'000'000;  // [ns]
  const std::int64_t until = bus_.now() + milliseconds * kMillisecond;
  do {
    if (setup_) return true;
    if (bus_.now() >= asked_ + kAgain || asked_ == INT64_MIN) {
      asked_ = bus_.now();
      query_t query{};
      query.header = header(self_, queries_++, asked_);
      bus_.publish(channel::kQuery, query);
    }
  } while (bus_.wait(std::min(milliseconds, 1000)) && bus_.now() < until);
  return setup_.has_value();
}

std::string Refused::text() const {
  if (forged + replayed == 0) return {};
  return fmt::format("{} messages ignored that are not signed with the bus's key, {} heard before",
                     forged, replayed);
}

std::string Rejections::text() const {
  if (total() == 0) return {};
  std::string causes;
  for (const auto& [count, cause] : {std::pair{malformed, "malformed or of another schema"},
                                     {out_of_range, "with a value out of range or not a number"},
                                     {of_another, "of another or an earlier machine (epoch)"},
                                     {old, "of an earlier sequence"}})
    if (count > 0) causes += fmt::format("{}{} {}", causes.empty() ? "" : ", ", count, cause);
  return fmt::format("{} samples not let in: {}", total(), causes);
}

ControllerLink::ControllerLink(Bus& bus, const Identity& self) : bus_(bus), self_(self) {
  bus.subscribe({channel::kSample}, [this](const std::string&, const void* data,
                                           std::uint32_t size) { receiveSample(data, size); });
  bus.subscribe({channel::kLegCommand},
                [this](const std::string&, const void* data, std::uint32_t size) {
                  const auto message = decode<leg_command_t>(data, size);
                  if (!message) ++rejected_;
                  if (message && message->header.source != self_.source && message->engaged)
                    conflict_ = true;
                });
  bus.subscribe({channel::kOperator},
                [this](const std::string&, const void* data, std::uint32_t size) {
                  if (const auto message = decode<operator_t>(data, size))
                    receiveOrder(*message);
                  else
                    ++rejected_;
                });
}

void ControllerLink::receiveSample(const void* data, std::uint32_t size) noexcept {
  const auto message = decode<sample_t>(data, size);
  const auto sample = message ? fromMessage(*message) : std::nullopt;
  const bool answers_us = message && message->command_source == self_.source;
  const bool alive = answers_us || !bus_.keyed();
  const auto verdict =
      message ? machine_.judge(message->header, alive, engaged_) : MachineHeard::Verdict::kAnother;
  const bool same = verdict == MachineHeard::Verdict::kSame,
             renewed = verdict == MachineHeard::Verdict::kRenewed;
  if (sample && !same && !renewed && alive) conflict_ = true;
  const bool newer = same && sample && sample->sequence >= sample_.sequence;
  if (!sample || !(renewed || newer)) {
    ++rejected_;
    ++(!message  ? samples_rejected_.malformed
       : !sample ? samples_rejected_.out_of_range
       : !same   ? samples_rejected_.of_another
                 : samples_rejected_.old);
    return;
  }
  if (!same) clock_ = ClockOffset();
  machine_.take(message->header);
  ++samples_;
  sample_ = *sample;
  answers_ = message->answers;
  sample_time_ = message->header.time_ns;
  if (!answers_us || message->command_sequence < -1) return;
  const Sent& sent = sent_[static_cast<std::size_t>(message->command_sequence + 1) % sent_.size()];
  if (sent.sequence == message->command_sequence)
    clock_.take(sent.time, message->command_time_ns, sample_time_, bus_.arrival());
}

void ControllerLink::receiveOrder(const operator_t& message) noexcept {
  const auto order = fromMessage(message);
  if (!order || message.controller != self_.source) {
    ++rejected_;
    return;
  }
  for (const OrderId& id : known_)
    if (id.source == order->id.source && id.sequence == order->id.sequence) return;
  const bool at_once = order->request == Request::kStop || order->request == Request::kHold;
  if (waiting_ >= (at_once ? 2 * kOrders : kOrders)) {
    ++rejected_;
    return;
  }
  if (at_once) {
    // At once; what waits is only answered.
    for (std::size_t i = 0; i < waiting_; ++i) orders_[i].request = Request::kOvertaken;
    std::move_backward(orders_.begin(), orders_.begin() + static_cast<std::ptrdiff_t>(waiting_),
                       orders_.begin() + static_cast<std::ptrdiff_t>(waiting_ + 1));
    orders_[0] = *order;
    ++waiting_;
  } else {
    orders_[waiting_++] = *order;
  }
  known_[next_known_++ % known_.size()] = order->id;
}

Order ControllerLink::takeOrder() noexcept {
  if (waiting_ == 0) return {};
  const Order oldest = orders_[0];
  std::move(orders_.begin() + 1, orders_.begin() + static_cast<std::ptrdiff_t>(waiting_--),
            orders_.begin());
  return oldest;
}

void ControllerLink::send(leg_command_t command) noexcept {
  engaged_ = command.engaged != 0;
  command.machine = machine_.source();
  const std::int64_t sequence = command.header.sequence;
  sent_[static_cast<std::size_t>(sequence + 1) % sent_.size()] = {sequence, bus_.now()};
  bus_.publish(channel::kLegCommand, command);
}

PlantLink::PlantLink(Bus& bus, const std::optional<Identity>& self) : bus_(bus), self_(self) {
  bus.subscribe(
      {channel::kLegCommand}, [this](const std::string&, const void* data, std::uint32_t size) {
        const auto message = decode<leg_command_t>(data, size);
        const auto command = message ? fromMessage(*message) : std::nullopt;
        if (!command || !mayCommand(message->header, message->machine, command->engaged)) {
          ++rejected_;
          return;
        }
        command_ = {*command, message->header.sequence};
      });
  bus.subscribe({channel::kRobot},
                [this](const std::string&, const void* data, std::uint32_t size) {
                  const auto message = decode<robot_command_t>(data, size);
                  const auto order = message ? fromMessage(*message) : std::nullopt;
                  const bool ours = message && means(message->machine);
                  if (!order || !ours || robot_orders_.size() >= kRobotOrders) {
                    ++rejected_;
                    refused_robot_orders_ += ours;
                    return;
                  }
                  robot_orders_.push_back(*order);
                });
}

/// A command for this machine. Without a key one that names none is for everybody.
bool PlantLink::means(std::int64_t machine) const noexcept {
  return !self_ || machine == self_->source || (machine == 0 && !bus_.keyed());
}

bool PlantLink::mayCommand(const header_t& from, std::int64_t machine, bool engaged) noexcept {
  const bool master = from.source == master_.source && from.epoch == master_.epoch;
  if (!master) {
    // Others wait until the master lets go or falls silent. A controller that is not engaged asks
    // for nothing, and takes nothing over from one that is.
    if (engaged_ && now_ - heard_ < kSilence) return false;
    last_heard_ = {from.source, from.sequence,
                   bus_.arrival()};  // who says hello, and does not know us
    if (!means(machine)) return false;
    if (from.epoch < master_.epoch) return false;  // a ghost: a log played, a process left behind
    master_ = {from.source, from.epoch};
    sequence_ = -2;
  }
  if (from.sequence < sequence_ || !means(machine)) return false;
  // Only lockstep repeats a command, and has no key: with a key a repeated one is a recording, and
  // must not feed the watchdog.
  if (bus_.keyed() && from.sequence == sequence_ && from.sequence >= 0) return false;
  last_heard_ = {from.source, from.sequence, bus_.arrival()};
  sequence_ = from.sequence;
  engaged_ = engaged;
  heard_ = now_;
  return true;
}

}  // namespace ves
