// SPDX-License-Identifier: BSD-3-Clause
#include "ves/transport/bus.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "ves/base/errors.hpp"
#include "ves/transport/channels.hpp"

namespace ves {
namespace {

// Ten samples wait at each tick in the worst case; a stalled controller must still find the newest.
constexpr int kQueue = 4096;  // [-] messages

/// Refuses what LCM would print about, or take part of an address from.
void check(const std::string& url) {
  unsigned a, b, c, d, port;
  int end = 0;
  const int read =
      std::sscanf(url.c_str(), "udpm://%3u.%3u.%3u.%3u:%5u%n", &a, &b, &c, &d, &port, &end);
  const std::string rest = url.substr(static_cast<std::size_t>(end));
  if (read != 5 || end == 0 || a < 224 || a > 239 || b > 255 || c > 255 || d > 255 || port < 1 ||
      port > 65535 || !(rest.empty() || rest.rfind("?ttl=", 0) == 0))
    throw InputError(fmt::format(
        "--url {}: want udpm://MULTICAST-ADDRESS:PORT[?ttl=N], for example {}", url, kDefaultUrl));
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

const std::string& reachable(const std::string& url) {
  check(url);
  if (!hasRoute()) refuse(url);
  return url;
}

/// One message to ourselves, within two seconds.
bool echoes(lcm::LCM& lcm) {
  const std::string channel = "VES_ECHO";
  struct Heard {
    bool yes = false;
    void receive(const lcm::ReceiveBuffer*, const std::string&) { yes = true; }
  } heard;
  lcm::Subscription* const subscription = lcm.subscribe(channel, &Heard::receive, &heard);
  if (!subscription) return false;
  for (int i = 0; i < 20 && !heard.yes; ++i) {
    if (lcm.publish(channel, "?", 1) != 0) break;
    lcm.handleTimeout(100);
  }
  lcm.unsubscribe(subscription);
  return heard.yes;
}

}  // namespace

Bus::Bus(const std::string& url) : lcm_(reachable(url)) {
  if (!lcm_.good()) throw InputError(fmt::format("--url {}: not a bus that LCM can open", url));
  if (!echoes(lcm_)) refuse(url);
}

void Bus::publish(const std::string& channel, const experiment_t& message) {
  lcm_.publish(channel, &message);
}

void Bus::subscribe(const std::string& channel, Handler handler) {
  subscribers_.push_back(std::make_unique<Subscriber>(Subscriber{std::move(handler)}));
  lcm_.subscribe(channel, &Subscriber::receive, subscribers_.back().get())
      ->setQueueCapacity(kQueue);
}

void Bus::drain() noexcept {
  while (lcm_.handleTimeout(0) > 0) {
  }
}

bool Bus::wait(int milliseconds) noexcept { return lcm_.handleTimeout(milliseconds) > 0; }

bool busWorks(const std::string& url) {
  check(url);
  if (!hasRoute()) return false;
  lcm::LCM lcm(url);
  return lcm.good() && echoes(lcm);
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
  bus.subscribe(channel::kSample, [this](const std::string&, const void* data, std::uint32_t size) {
    const auto message = decode<sample_t>(data, size);
    const auto sample = message ? fromMessage(*message) : std::nullopt;
    const bool same =
        message && message->header.source == plant_.source && message->header.epoch == plant_.epoch;
    const bool renewed = message && !same && !engaged_ && message->header.epoch > plant_.epoch;
    if (sample && !same && !renewed) conflict_ = true;
    const bool newer = same && sample && sample->sequence >= sample_.sequence;
    if (!sample || !(renewed || newer)) {
      ++rejected_;
      ++(!message  ? samples_rejected_.malformed
         : !sample ? samples_rejected_.out_of_range
         : !same   ? samples_rejected_.of_another
                   : samples_rejected_.old);
      return;
    }
    plant_ = {message->header.source, message->header.epoch};
    sample_ = *sample;
    answers_ = message->answers;
    sample_time_ = message->header.time_ns;
  });
  bus.subscribe(channel::kLegCommand,
                [this](const std::string&, const void* data, std::uint32_t size) {
                  const auto message = decode<leg_command_t>(data, size);
                  if (!message) ++rejected_;
                  if (message && message->header.source != self_.source && message->engaged)
                    conflict_ = true;
                });
  bus.subscribe(channel::kOperator,
                [this](const std::string&, const void* data, std::uint32_t size) {
                  if (const auto message = decode<operator_t>(data, size))
                    receiveOrder(*message);
                  else
                    ++rejected_;
                });
}

void ControllerLink::receiveOrder(const operator_t& message) noexcept {
  const auto order = fromMessage(message);
  if (!order || message.controller != self_.source) {
    ++rejected_;
    return;
  }
  for (const OrderId& id : known_)
    if (id.source == order->id.source && id.sequence == order->id.sequence) return;
  if (order->request == Request::kStop || order->request == Request::kHold) waiting_ = 0;
  if (waiting_ == kOrders) {
    ++rejected_;
    return;
  }
  orders_[waiting_++] = *order;
  known_[next_known_++ % kOrders] = order->id;
}

Order ControllerLink::takeOrder() noexcept {
  if (waiting_ == 0) return {};
  const Order oldest = orders_[0];
  std::move(orders_.begin() + 1, orders_.begin() + static_cast<std::ptrdiff_t>(waiting_--),
            orders_.begin());
  return oldest;
}

void ControllerLink::send(const leg_command_t& command) noexcept {
  engaged_ = command.engaged != 0;
  bus_.publish(channel::kLegCommand, command);
}

PlantLink::PlantLink(Bus& bus) {
  bus.subscribe(channel::kLegCommand,
                [this](const std::string&, const void* data, std::uint32_t size) {
                  const auto message = decode<leg_command_t>(data, size);
                  const auto command = message ? fromMessage(*message) : std::nullopt;
                  if (!command || !mayCommand(message->header, command->engaged)) {
                    ++rejected_;
                    return;
                  }
                  command_ = {*command, message->header.sequence};
                });
  bus.subscribe(channel::kRobot, [this](const std::string&, const void* data, std::uint32_t size) {
    const auto message = decode<robot_command_t>(data, size);
    const auto order = message ? fromMessage(*message) : std::nullopt;
    if (!order) {
      ++rejected_;
      return;
    }
    robot_orders_.push_back(*order);
  });
}

bool PlantLink::mayCommand(const header_t& from, bool engaged) noexcept {
  const bool master = from.source == master_.source && from.epoch == master_.epoch;
  if (!master) {
    // Others wait until the master lets go or falls silent. A controller that is not engaged asks
    // for nothing, and takes nothing over from one that is.
    if (engaged_ && now_ - heard_ < kSilence) return false;
    if (from.epoch < master_.epoch) return false;  // a ghost: a log played, a process left behind
    master_ = {from.source, from.epoch};
    sequence_ = -2;
  }
  if (from.sequence < sequence_) return false;
  sequence_ = from.sequence;
  engaged_ = engaged;
  heard_ = now_;
  return true;
}

}  // namespace ves
