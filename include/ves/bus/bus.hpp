// SPDX-License-Identifier: BSD-3-Clause
//
// LCM, behind one small door. Handlers store and count; they never act, throw or log.
//
// What carries the messages is a Wire: LCM's multicast, or memory, where one process holds both
// ends, the clock, and all that goes wrong between them.
#pragma once

#include <array>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "ves/bus/key.hpp"
#include "ves/bus/messages.hpp"
#include "ves/bus/receiver.hpp"
#include "ves/realtime/clock_offset.hpp"

namespace ves {

inline constexpr const char* kDefaultUrl = "udpm://239.255.76.67:7667?ttl=0";

/// udpm://ADDRESS:PORT[?ttl=N][&key=FILE]. Throws InputError.
struct BusAddress {
  explicit BusAddress(const std::string& url);

  std::string lcm;    // what LCM understands
  std::string group;  // as "239.255.76.67"
  std::uint16_t port = 0;
  int ttl = 0;           // [-] routers that a message may cross, and one more network
  std::string key_file;  // empty: the bus has no key
};

/// One line where anybody in reach can command the legs: ttl above 0, and no key; else empty.
std::string openBusWarning(const std::string& url);

/// The URL with the scenario's key, unless it names one.
std::string withKey(const std::string& url, const std::string& key_file);

/// Messages that a bus with a key did not hand on.
struct Refused {
  std::int64_t forged = 0;    // [-] not signed with the key, or changed since
  std::int64_t replayed = 0;  // [-] signed, and older than one before of that sender

  /// As "2 messages ignored that the bus's key has not signed, 1 heard before"; empty when none.
  std::string text() const;
};

class Wire {
 public:
  virtual ~Wire() = default;
  virtual bool send(const std::string& channel, const void* data, std::size_t size) noexcept = 0;
  /// From now on this channel's messages, of at most `longest` bytes, are read too. Throws
  /// InputError.
  virtual void hear(const std::string& channel, std::size_t longest) = 0;
  /// Receiver::read, ::readable and ::descriptor; nothing, never and -1 before hear().
  virtual bool read(std::optional<Received>& message) noexcept = 0;
  virtual bool readable(std::int64_t until) const noexcept = 0;
  virtual int descriptor() const noexcept = 0;
  /// [ns] of this host's clock, as in Received::arrival.
  virtual std::int64_t now() const noexcept = 0;
};

class Bus {
 public:
  /// Opens the bus and proves that a message comes back. Throws InputError with the remedy. With a
  /// key it signs what it sends, and hands on only what is signed and has not been before.
  explicit Bus(const std::string& url);
  /// A bus without a key on a wire of one's own.
  explicit Bus(std::unique_ptr<Wire> wire) noexcept;

  /// Encodes on the stack: no heap.
  template <typename Message>
  void publish(const std::string& channel, const Message& message) noexcept {
    std::array<std::uint8_t, 4096> buffer;
    const int size = message.encode(buffer.data(), 0, static_cast<int>(buffer.size()));
    if (size < 0)
      ++failed_;
    else
      send(channel, buffer.data(), static_cast<std::size_t>(size));
  }
  /// For the one message that has no fixed size.
  void publish(const std::string& channel, const experiment_t& message);

  /// Every message of these channels, as bytes. What a handler throws is kept for rethrow().
  using Handler =
      std::function<void(const std::string& channel, const void* data, std::uint32_t size)>;
  void subscribe(const std::vector<std::string>& channels, const Handler& handler);

  /// Hands out what has arrived: all, unless somebody floods the bus.
  void drain() noexcept;
  /// The first exception of a handler, once: not where it came up, in the loop that reads the bus.
  void rethrow();
  /// Readable when a message has arrived. After the first subscription, as wait().
  int descriptor() const noexcept { return wire_->descriptor(); }
  /// Waits for one message; false when none came in time, or a signal did.
  bool wait(int milliseconds) noexcept;
  /// The same, for an answer that may come within microseconds: where there are several processors
  /// it busy-waits for 50 us first, because falling asleep and being woken takes longer.
  bool waitAwake(int milliseconds) noexcept;

  /// [ns] monotonic, when the message that a handler has in hand came to this host.
  std::int64_t arrival() const noexcept { return arrival_; }
  std::int64_t now() const noexcept { return wire_->now(); }  // [ns] of the same clock
  bool keyed() const noexcept { return key_.has_value(); }
  const Refused& refused() const noexcept { return refused_; }
  std::int64_t failed() const noexcept { return failed_; }  // [-] messages not sent

 private:
  struct Subscription {
    std::string channel;
    Handler handler;
  };
  void send(const std::string& channel, std::uint8_t* message, std::size_t size) noexcept;
  bool waitUntil(std::int64_t until, std::int64_t awake) noexcept;
  bool handOut(const Received& message) noexcept;
  bool lets(const Received& message, const std::string& channel) noexcept;

  std::unique_ptr<Wire> wire_;
  std::optional<Key> key_;
  std::vector<Subscription> subscriptions_;
  ReplayGuard guard_;
  std::exception_ptr failure_;
  Refused refused_;
  std::int64_t arrival_ = 0;  // [ns]
  std::int64_t failed_ = 0;
  bool several_processors_;  // are ours
};

/// True when multicast messages of this machine reach this machine.
bool busWorks(const std::string& url);

/// Moves this process (and what it starts) to a network of its own, where loopback carries
/// multicast: nothing leaks out or in. Call before any thread starts. Throws InputError.
void enterPrivateBus();

/// The same network for all programs of this user that name it: the first begins it, and it is gone
/// with the last. Throws InputError.
void joinPrivateBus(const std::string& name);

/// A driver's side: what the controller says of the configuration.
class SetupLink {
 public:
  SetupLink(Bus& bus, const Identity& self);

  /// The newest; nothing before the first.
  const std::optional<MachineSetup>& setup() const noexcept { return setup_; }
  /// Waits for it, and asks for it once a second; false when none came in time, or a signal did.
  bool wait(int milliseconds) noexcept;

 private:
  Bus& bus_;
  Identity self_;
  std::optional<MachineSetup> setup_;
  std::int64_t asked_ = INT64_MIN, queries_ = 0;  // [ns], [-]
};

/// Samples that were not let in, by cause.
struct Rejections {
  std::int64_t malformed = 0;     // [-] no message of this schema
  std::int64_t out_of_range = 0;  // [-] a value out of range, or not a number
  std::int64_t of_another = 0;    // [-] of another machine, or an earlier one (epoch)
  std::int64_t old = 0;           // [-] of an earlier sequence than one before

  std::int64_t total() const { return malformed + out_of_range + of_another + old; }
  /// As "3 samples not let in: 2 malformed, 1 old"; empty when all were.
  std::string text() const;
};

/// Whose samples a controller takes: of one machine, and of a newer one while nothing is engaged.
class MachineHeard {
 public:
  enum class Verdict { kSame, kRenewed, kAnother };
  /// `alive`: it is no recording (on a bus with a key: it names a command of this controller).
  Verdict judge(const header_t& from, bool alive, bool engaged) const noexcept {
    if (from.source == machine_.source && from.epoch == machine_.epoch) return Verdict::kSame;
    return !engaged && alive && from.epoch > machine_.epoch ? Verdict::kRenewed : Verdict::kAnother;
  }
  void take(const header_t& from) noexcept { machine_ = {from.source, from.epoch}; }
  std::int64_t source() const noexcept { return machine_.source; }  // [-] 0: none yet

 private:
  Identity machine_;
};

/// The controller's side: the newest sample, the operator's orders, whether somebody else is there.
///
/// On a bus with a key a machine is taken only when its sample names a command of this controller:
/// so it is alive, and no recording. A machine that was started anew takes the place of the old one
/// while nothing is engaged. From then on the machine is the machine: samples of another are not
/// let in and count as a conflict.
class ControllerLink {
 public:
  ControllerLink(Bus& bus, const Identity& self);

  const Sample& sample() const noexcept { return sample_; }
  std::int64_t answers() const noexcept { return answers_; }  // lockstep: tick the sample answers
  std::int64_t sampleTime() const noexcept { return sample_time_; }  // [ns] sender's clock
  std::int64_t samples() const noexcept { return samples_; }         // [-] taken, repeated ones too
  /// The oldest order that waits; none when none does. An order that is repeated, because its
  /// sender saw no answer, counts once; a hold and a stop go before what waits, which is overtaken.
  Order takeOrder() noexcept;
  bool takeConflict() noexcept { return std::exchange(conflict_, false); }
  std::int64_t rejected() const noexcept { return rejected_; }  // [-] messages not let in
  const Rejections& samplesRejected() const noexcept { return samples_rejected_; }
  /// [-] header.source of the machine that samples come from; 0 before the first.
  std::int64_t machine() const noexcept { return machine_.source(); }
  /// Of the machine's clock, from commands and the samples that name them.
  const ClockOffset& clock() const noexcept { return clock_; }

  /// To the machine that was heard.
  void send(leg_command_t command) noexcept;

 private:
  Bus& bus_;
  Identity self_;
  Sample sample_;
  std::int64_t answers_ = -2;
  std::int64_t sample_time_ = 0;
  std::int64_t samples_ = 0;
  MachineHeard machine_;
  bool engaged_ = false;
  void receiveSample(const void* data, std::uint32_t size) noexcept;
  void receiveOrder(const operator_t& message) noexcept;

  struct Sent {
    std::int64_t sequence = -2;
    std::int64_t time = 0;  // [ns]
  };
  std::array<Sent, 64> sent_{};  // the last commands, by sequence
  ClockOffset clock_;

  static constexpr std::size_t kOrders = 16;  // [-] that wait; of holds and stops so many more
  std::array<Order, 2 * kOrders> orders_{};   // oldest first
  std::size_t waiting_ = 0;
  std::array<OrderId, 4 * kOrders> known_{};  // taken before, in a ring
  std::size_t next_known_ = 0;
  bool conflict_ = false;
  std::int64_t rejected_ = 0;
  Rejections samples_rejected_;
};

/// The machine's side: the newest command of the one controller that has the legs.
class PlantLink {
 public:
  /// A controller keeps the legs until it lets go or is silent for so long.
  static constexpr std::int64_t kSilence = 500'000'000;  // [ns]
  static constexpr std::size_t kRobotOrders = 16;        // [-]

  /// Commands and orders that name another machine than `self` are not for this one; on a bus with
  /// a key they have to name it: those of an earlier machine are recordings. The driver of one
  /// piece, which is not the machine that they name, has no `self`.
  PlantLink(Bus& bus, const std::optional<Identity>& self);

  /// The plant's clock, by which silence counts.
  void setTime(std::int64_t now) noexcept { now_ = now; }

  /// The newest command since the last call; its sequence is the controller's tick.
  std::optional<std::pair<LegCommand, std::int64_t>> takeCommand() noexcept {
    return std::exchange(command_, std::nullopt);
  }
  /// The last command that came, for the samples to name; clocks are compared by it.
  struct Heard {
    std::int64_t source = 0;
    std::int64_t sequence = 0;
    std::int64_t time = 0;  // [ns] of arrival
  };
  const Heard& lastHeard() const noexcept { return last_heard_; }
  /// At most kRobotOrders wait; what comes then is not let in.
  std::vector<RobotOrder> takeRobotOrders() { return std::exchange(robot_orders_, {}); }
  /// For this machine, and not let in: implausible, or too many.
  std::int64_t refusedRobotOrders() const noexcept { return refused_robot_orders_; }
  std::int64_t rejected() const noexcept { return rejected_; }

 private:
  bool mayCommand(const header_t& from, std::int64_t machine, bool engaged) noexcept;
  bool means(std::int64_t machine) const noexcept;

  Bus& bus_;
  std::optional<Identity> self_;
  Heard last_heard_;
  std::int64_t now_ = 0;  // [ns]
  Identity master_;       // who has the legs
  bool engaged_ = false;
  std::int64_t heard_ = 0;      // [ns]
  std::int64_t sequence_ = -2;  // of the master's last command
  std::optional<std::pair<LegCommand, std::int64_t>> command_;
  std::vector<RobotOrder> robot_orders_;
  std::int64_t refused_robot_orders_ = 0;
  std::int64_t rejected_ = 0;
};

}  // namespace ves
