// SPDX-License-Identifier: BSD-3-Clause
#include "world.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <fstream>

#include "support/ether.hpp"
#include "ves/bus/bus.hpp"
#include "ves/bus/channels.hpp"
#include "ves/bus/event_log.hpp"
#include "ves/console/command.hpp"
#include "ves/run/replay.hpp"
#include "ves/run/robot_orders.hpp"
#include "ves/run/run.hpp"
#include "ves/run/run_monitor.hpp"
#include "ves/run/vehicle_judge.hpp"

namespace ves::swarm {
namespace {

using test::Ether;
using test::MemoryWire;

/// A file in memory, and whether there is room for more.
class MemoryDisk : public Disk {
 public:
  MemoryDisk(std::vector<std::uint8_t>& file, const bool& full) : file_(file), full_(full) {}
  std::int64_t write(const void* data, std::size_t size) noexcept override {
    if (full_) {
      errno = ENOSPC;
      return -1;
    }
    const auto* bytes = static_cast<const std::uint8_t*>(data);
    file_.insert(file_.end(), bytes, bytes + size);
    return static_cast<std::int64_t>(size);
  }
  void cutTo(std::int64_t size) noexcept override { file_.resize(static_cast<std::size_t>(size)); }

 private:
  std::vector<std::uint8_t>& file_;
  const bool& full_;
};

constexpr std::int64_t kRestart = 200;  // [-] ticks until somebody starts an ended controller again

class World {
 public:
  World(const Life& life, const Experiment& experiment, const Conditions& conditions)
      : life_(life),
        e_(experiment),
        scratch_(conditions.scratch),
        period_(experiment.controller.period),
        laws_(experiment, conditions.only) {
    ether_.fate = [this](const std::string& channel) { return fateOf(channel); };
    out_.hash = 0xcbf29ce484222325u;
  }

  Outcome run() {
    std::size_t next = 0;
    beginMachine(e_.plant, 0);
    beginController();
    next_machine_ = life_.machine_phase;
    for (tick_ = 0; tick_ < life_.ticks && !laws_.finding(); ++tick_) {
      laws_.at(tick_);
      const std::int64_t now = tick_ * period_;
      for (; next_machine_ <= now; next_machine_ += life_.sample_period) stepMachine();
      ether_.now = now;
      for (; next < life_.events.size() && life_.events[next].tick <= tick_; ++next)
        happen(life_.events[next]);
      intrude();
      if (machine_back_ == tick_) restartMachine();
      if (controller_back_ == tick_) beginController();
      disk_full_ = tick_ < disk_until_;
      if (controller_ && tick_ >= stalled_until_) tickController();
    }
    endController();
    out_.finding = laws_.finding();
    out_.seconds = static_cast<double>(tick_ * period_) * 1e-9;
    return out_;
  }

 private:
  struct Machine {
    Identity id;
    Bus bus;
    PlantLink link;
    plant::Plant plant;
    Sample sample;
    RobotOrders robot;
    Machine(Ether& ether, std::int64_t clock, const Experiment& e, const plant::PlantConfig& config,
            Identity who)
        : id(who),
          bus(std::make_unique<MemoryWire>(ether, clock)),
          link(bus, id),
          plant(config),
          robot(e),
          start(bus.now()) {}
    std::int64_t start;  // [ns] of its clock
  };
  struct Controller {
    Identity id;
    Bus bus;
    ControllerLink link;
    TestPlatform platform;
    RunMonitor monitor;
    TickInput in;
    std::vector<std::uint8_t> file;
    std::unique_ptr<LogWriter> log;
    std::int64_t begun;   // [-] tick of the life
    bool spoilt = false;  // the disk was full
    Controller(Ether& ether, const Experiment& e, Identity who, std::int64_t tick)
        : id(who),
          bus(std::make_unique<MemoryWire>(ether, 0)),
          link(bus, id),
          platform(e.controller),
          monitor(e.controller, true),
          begun(tick) {}
  };
  struct Trouble {
    Kind kind;
    std::string what;
    std::int64_t until;   // [-] tick
    std::int64_t amount;  // [-] ticks
  };

  Ether::Fate fateOf(const std::string& channel) {
    Ether::Fate fate{1, life_.latency};
    for (const Trouble& t : troubles_) {
      const bool meant = (t.kind == Kind::kSamples && channel == channel::kSample) ||
                         (t.kind == Kind::kCommands && channel == channel::kLegCommand);
      if (!meant || tick_ >= t.until) continue;
      if (t.what == "lost") fate.copies = 0;
      if (t.what == "late") fate.delay += t.amount * period_;
      if (t.what == "twice") fate.copies = 2;
    }
    return fate;
  }

  void mix(std::uint64_t value) { out_.hash = (out_.hash ^ value) * 0x100000001b3u; }

  // --- The machine -------------------------------------------------------------------------------

  void beginMachine(plant::PlantConfig config, std::int64_t tick) {
    // The faults of this life, by its own clock.
    config.faults.clear();
    for (const Event& event : life_.events) {
      if (event.kind != Kind::kFault) continue;
      for (int i = 0; i < static_cast<int>(plant::Fault::kCount); ++i) {
        const auto fault = static_cast<plant::Fault>(i);
        if (event.what != plant::name(fault)) continue;
        config.faults.push_back({{-1, (event.tick - tick) * period_},
                                 event.ticks * period_,
                                 fault,
                                 event.which,
                                 event.amount});
      }
    }
    machine_.emplace(ether_, life_.clock_offset, e_, config,
                     Identity{1000 + machines_, 1 + machines_});
    ++machines_;
    laws_.machineBegins();
  }

  void restartMachine() {
    plant::PlantConfig config = e_.plant;
    config.initial_pose = pose_;
    config.task.initial_joints = joints_;
    config.seed += static_cast<std::uint32_t>(machines_);
    beginMachine(config, tick_);
  }

  void stepMachine() {
    if (!machine_) return;
    Machine& m = *machine_;
    ether_.now = next_machine_;
    const std::int64_t now = m.bus.now();
    m.bus.drain();
    m.link.setTime(now);
    for (const RobotOrder& order : m.link.takeRobotOrders()) try {
        if (const auto action = m.robot.take(order, m.plant.truth())) m.plant.moveRobot(*action);
        if (const auto planned = m.robot.done(true)) m.plant.moveRobot(*planned);
      } catch (const InputError&) {  // it cannot do that from where it is
      }
    std::optional<Taken> taken;
    if (const auto command = m.link.takeCommand()) {
      m.plant.advance(std::max(m.plant.time(), m.link.lastHeard().time - m.start));
      m.plant.command(command->first);
      taken = Taken{m.link.lastHeard().source, command->second, command->first};
    }
    m.plant.advance(std::max(m.plant.time(), now - m.start));
    m.sample = m.plant.sample();
    const bool closed = (m.sample.switches & kAllSwitchesClosed) == kAllSwitchesClosed;
    laws_.machine(next_machine_, m.plant.truth(), taken, closed);

    Sample s = m.sample;
    const std::int64_t shift = now - m.plant.time();
    for (std::int64_t* time : {&s.time, &s.legs_time, &s.wrench_time, &s.joints_time})
      *time = std::max<std::int64_t>(0, *time + shift);
    sample_t message = toMessage(s, m.id);
    message.command_source = m.link.lastHeard().source;
    message.command_sequence = m.link.lastHeard().sequence;
    message.command_time_ns = m.link.lastHeard().time;
    m.bus.publish(channel::kSample, message);
    pose_ = m.plant.truth().x;
    joints_ = m.plant.truth().joints.q;
  }

  // --- The controller ----------------------------------------------------------------------------

  void beginController() {
    controller_back_ = -1;
    endController();
    const std::int64_t source = 1 + controllers_++;
    controller_.emplace(ether_, e_, Identity{source, 1000 + controllers_}, tick_);
    Controller& c = *controller_;
    if (life_.logged) {
      c.log = std::make_unique<LogWriter>(std::make_unique<MemoryDisk>(c.file, disk_full_));
      c.log->write(channel::kExperiment, describe(e_, c.id, 0), 0);
      c.log->flush();  // what the disk has no room for later does not matter to it
      c.spoilt = disk_full_;
      c.bus.subscribe({channel::kSample, channel::kOperator},
                      [&c](const std::string& from, const void* data, std::uint32_t size) {
                        c.log->write(from, data, size, c.link.sampleTime());
                      });
    }
    laws_.controllerBegins(source);
  }

  void tickController() {
    Controller& c = *controller_;
    c.bus.drain();
    c.in.tick = tick_ - c.begun;
    if (c.link.sample().sequence < 0) {
      c.link.send(toMessage(LegCommand(), header(c.id, -1, ether_.now)));
      return;
    }
    c.in.sample = c.link.sample();
    c.in.conflicting_node = c.link.takeConflict() || c.in.conflicting_node;
    c.in.time =
        c.link.clock().known() ? ether_.now + c.link.clock().offset(ether_.now) : c.in.sample.time;
    const TickState& state = c.platform.tick(c.in);
    const header_t h = header(c.id, c.in.tick, ether_.now);
    const leg_command_t command = toMessage(state.command, h);
    c.link.send(command);
    if (c.log) {
      c.log->write(channel::kState, toMessage(state, h), ether_.now);
      c.log->write(channel::kLegCommand, command, ether_.now);
      c.spoilt = c.spoilt || disk_full_;
    }
    laws_.ticked(c.in, state);
    note(state);
    c.in.order = judged(c.link.takeOrder(), e_, state);
    c.in.conflicting_node = c.link.takeConflict();
    if (!c.monitor.reached(state, c.in.order.request)) return;
    const RunResult result = c.monitor.result(0);
    laws_.controllerEnds(result.good() || result.cause != Check::kCount || result.aborted,
                         std::string(name(result.phase)));
    endController();
    controller_back_ = tick_ + kRestart;
  }

  void note(const TickState& s) {
    ++out_.ticks;
    out_.stops += s.cause_tick == s.tick;
    out_.emulated += s.kind == SegmentKind::kAdmittance;
    out_.compensated += s.kind == SegmentKind::kAdmittance && s.compensation_share > 0.0;
    for (const std::int32_t count : s.command.counts) mix(static_cast<std::uint64_t>(count));
    mix(static_cast<std::uint64_t>(s.phase));
  }

  void endController() {
    if (!controller_) return;
    Controller& c = *controller_;
    laws_.controllerSilent();
    if (c.log) {
      c.log.reset();
      if (!laws_.finding()) judgeLog(c);
    }
    controller_.reset();
  }

  /// What is in a log is whole, and what is whole replays bit for bit.
  void judgeLog(const Controller& c) {
    if (c.spoilt && c.file.empty()) return;  // there never was room for it
    const std::string file = (scratch_ / fmt::format("{}.lcmlog", life_.seed)).string();
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char*>(c.file.data()),
               static_cast<std::streamsize>(c.file.size()));
    try {
      LogReader reader(file);
      LogEvent event;
      std::int64_t states = 0;
      while (reader.next(event)) states += event.channel == channel::kState;
      if (states > 0 && !c.spoilt) {
        const ReplayResult r = replay(file, {}, nullptr);
        if (r.different > 0)
          laws_.broken(
              "log", fmt::format("{} of {} messages replay otherwise, first tick {}: {} {} for {}",
                                 r.different, r.messages, r.first->tick, r.first->field,
                                 r.first->replayed, r.first->recorded));
      }
    } catch (const InputError& error) {
      laws_.broken("log", error.what());
    }
    std::filesystem::remove(file);
  }

  // --- What happens ------------------------------------------------------------------------------

  void happen(const Event& event) {
    switch (event.kind) {
      case Kind::kDo: order(event.what); break;
      case Kind::kSamples:
      case Kind::kCommands:
        std::erase_if(troubles_, [this](const Trouble& t) { return tick_ >= t.until; });
        troubles_.push_back(
            {event.kind, event.what, tick_ + event.ticks, static_cast<std::int64_t>(event.amount)});
        break;
      case Kind::kStall:
        stalled_until_ = tick_ + event.ticks;
        laws_.controllerSilent();
        break;
      case Kind::kController:
        endController();
        controller_back_ = tick_ + event.ticks;
        break;
      case Kind::kMachine:
        if (!machine_) break;
        machine_.reset();
        machine_back_ = tick_ + event.ticks;
        break;
      case Kind::kIntruder: beginIntruder(event); break;
      case Kind::kDisk: disk_until_ = tick_ + event.ticks; break;
      case Kind::kFault:  // the machine's own
      case Kind::kCount: break;
    }
  }

  void order(const std::string& line) {
    if (!controller_ || controller_->link.sample().sequence < 0) return;
    Command command;
    try {
      command = parseCommand(line, e_);
    } catch (const InputError& error) {
      laws_.broken("menu", fmt::format("{}: {}", line, error.what()));
      return;
    }
    std::array<std::uint8_t, 1024> buffer;
    const header_t h = header({kOperator, 1}, orders_, ether_.now);
    const auto send = [&](const std::string& channel, const auto& message) {
      const int size = message.encode(buffer.data(), 0, static_cast<int>(buffer.size()));
      ether_.send(channel, buffer.data(), static_cast<std::size_t>(size));
    };
    if (command.verb == Verb::kRobot || command.verb == Verb::kTool ||
        command.verb == Verb::kGrasp || command.verb == Verb::kRelease ||
        command.verb == Verb::kPush) {
      robot_command_t message = toMessage(command.robot, h);
      message.machine = machine_ ? machine_->id.source : 0;
      send(channel::kRobot, message);
      return;
    }
    if (tick_ >= stalled_until_) laws_.ordered({kOperator, orders_});
    ++orders_;
    Order order = command.order;
    order.controller = controller_->id.source;
    send(channel::kOperator, toMessage(order, h));
  }

  void beginIntruder(const Event& event) {
    if (!machine_) return;
    intruder_until_ = tick_ + event.ticks;
    intruder_ = {};
    const bool ghost = event.what == "ghost";
    intruder_.header = header({ghost ? kGhost : kSecond, ghost ? 1 : 1'000'000}, 0, 0);
    intruder_.machine = machine_->id.source;
    intruder_.engaged = 1;
    intruder_.segment = -1;
    for (std::size_t i = 0; i < 6; ++i)
      intruder_.counts[i] = intruder_.rest[i] = machine_->sample.legs[i] + 40;
    if (ghost) laws_.ghost(kGhost);
  }

  void intrude() {
    if (tick_ >= intruder_until_) return;
    ++intruder_.header.sequence;
    std::array<std::uint8_t, 512> buffer;
    const int size = intruder_.encode(buffer.data(), 0, static_cast<int>(buffer.size()));
    ether_.send(channel::kLegCommand, buffer.data(), static_cast<std::size_t>(size));
  }

  static constexpr std::int64_t kOperator = 500, kGhost = 501, kSecond = 502;  // who

  const Life& life_;
  const Experiment& e_;
  const std::filesystem::path& scratch_;
  std::int64_t period_;  // [ns]
  Laws laws_;
  Ether ether_;
  std::optional<Machine> machine_;
  std::optional<Controller> controller_;
  std::int64_t tick_ = 0, next_machine_ = 0;
  std::int64_t machines_ = 0, controllers_ = 0, orders_ = 0;                   // [-] so far
  std::int64_t machine_back_ = -1, controller_back_ = -1, stalled_until_ = 0;  // [-] ticks
  std::int64_t intruder_until_ = 0, disk_until_ = 0;
  leg_command_t intruder_{};
  bool disk_full_ = false;
  std::vector<Trouble> troubles_;
  Pose pose_;  // of the platform, and the robot's joints, should the machine's process end
  JointVector joints_ = JointVector::Zero();
  Outcome out_;
};

}  // namespace

Outcome live(const Life& life, const Experiment& experiment, const Conditions& conditions) {
  return World(life, experiment, conditions).run();
}

}  // namespace ves::swarm
