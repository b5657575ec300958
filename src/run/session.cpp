// SPDX-License-Identifier: BSD-3-Clause
#include "ves/run/session.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <signal.h>

#include "ves/bus/channels.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves {
namespace {

constexpr std::int64_t kFirstState = 15'000'000'000;  // [ns]

}  // namespace

Session::Session(const Experiment& experiment, const LaunchOptions& options)
    : experiment_(experiment),
      paced_(options.process.pace),
      bus_(options.process.url),
      start_(monotonicNow()) {
  const ProcessOptions& process = options.process;
  if (!process.log.empty() && !process.lockstep) {
    log_file_ = process.log;
    log_ = std::make_unique<LogWriter>(process.log);
    log_->write(channel::kExperiment, describe(experiment, {}, 0), wallNow());
  }
  bus_.subscribe(channel::kRecorded, [this](const std::string& channel, const void* data,
                                            std::uint32_t size) { receive(channel, data, size); });
  std::vector<std::string> shared = {"plant", options.scenario.string(), "--url", process.url};
  if (process.lockstep) shared.push_back("--lockstep");
  if (process.realtime) shared.push_back("--realtime");
  std::vector<std::string> arguments = shared;
  arguments.front() = "controller";
  arguments.push_back(process.start ? "--start" : "--no-menu");
  if (process.lockstep && !process.log.empty())
    arguments.insert(arguments.end(), {"--log", process.log});
  if (!process.log.empty())
    arguments.insert(arguments.end(),
                     {"--flight", std::filesystem::path(process.log).parent_path().string()});
  if (process.pace) shared.insert(shared.end(), {"--pace", fmt::format("{}", *process.pace)});
  if (options.plant) plant_ = std::make_unique<Process>(options.program, shared);
  controller_ = std::make_unique<Process>(options.program, arguments);
}

void Session::receive(const std::string& channel, const void* data, std::uint32_t size) {
  if (!wellFormed(channel, data, size)) {
    ++result_.malformed;
    return;
  }
  if (log_) {
    const bool whole = log_->lost() == 0;
    log_->write(channel, data, size, wallNow());
    if (whole && log_->lost() > 0)
      std::fputs(fmt::format("warning: {}: {}; events of the log are being lost, the run goes on\n",
                             log_file_, log_->trouble())
                     .c_str(),
                 stderr);
  }
  if (channel == channel::kSample) {
    const auto sample = decode<sample_t>(data, size);
    machine_ = sample->header.source;
    robot_orders_ = {sample->robot_orders_taken, sample->robot_orders_refused};
  }
  if (on_message_) on_message_(channel, data, size);
  if (channel != channel::kState) return;
  const auto state = decode<state_t>(data, size);
  if (!state || state->header.sequence < 0 || state->header.sequence > kMaxSequence) return;
  // Ours is the first that began after us.
  if (!state_ && state->header.epoch < self_.epoch) return;
  if (state_ && state->header.source != state_->header.source) return;
  state_ = state;
  ++heard_;
  if (asking_) asking_->hear(*state);
  result_.ticks = state->count + 1;
  result_.simulated =
      static_cast<double>((state->header.sequence + 1) * experiment_.controller.period) *
      kSecondPerNanosecond;
  result_.phase = static_cast<Phase>(state->phase);
  result_.cause = result_.phase == Phase::kDisarmed
                      ? Tripped(static_cast<std::uint32_t>(state->tripped)).first()
                      : static_cast<Check>(state->cause);
  result_.cause_tick = state->cause_tick;
  result_.aborted = state->aborted != 0;
  result_.aborted_by = static_cast<Refusal>(state->aborted_by);
  if (on_state_) on_state_(*state);
}

bool Session::listen(int milliseconds, int descriptor) {
  pollfd wait[2] = {{bus_.descriptor(), POLLIN, 0}, {descriptor, POLLIN, 0}};
  poll(wait, descriptor < 0 ? 1 : 2, milliseconds);
  bus_.drain();
  bus_.rethrow();
  if (plant_ && !plant_->running() && controller_->running()) {
    interrupt();
    throw InputError(fmt::format("ves plant ended early, status {}", plant_->status()));
  }
  return descriptor >= 0 && wait[1].revents != 0;
}

std::optional<Refusal> Session::order(const Order& order, int descriptor) {
  const std::int64_t until = monotonicNow() + kFirstState;
  while (!state_ && running() && monotonicNow() < until) listen(200);
  if (!state_) return {};
  Order addressed = order;
  addressed.controller = state_->header.source;
  asking_.emplace(addressed, self_, orders_++);
  while (asking_->underWay() && running()) {
    asking_->say(bus_, monotonicNow());
    if (listen(10, descriptor)) return Refusal::kChecking;
  }
  return asking_->answer();
}

void Session::orderRobot(const RobotOrder& order) {
  robot_command_t message = toMessage(order, header(self_, orders_++, monotonicNow()));
  message.machine = machine_;
  bus_.publish(channel::kRobot, message);
}

void Session::interrupt() {
  if (std::exchange(interrupted_, true)) return;
  controller_->signal(SIGINT);
  if (paced_)  // time that is held would keep the platform from going home
    bus_.publish(channel::kPace,
                 pace_t{header(self_, orders_++, monotonicNow()), machine_, kMostPace});
}

RunResult Session::result() {
  bus_.drain();
  RunResult result = result_;
  result.wall = static_cast<double>(monotonicNow() - start_) * kSecondPerNanosecond;
  const int status = controller_->status();
  if (status != 0 && status != 1)
    throw InputError(
        status < 0 ? fmt::format("ves controller was ended by signal {}; the legs hold", -status)
                   : fmt::format("ves controller ended with status {}", status));
  // The last state may be lost on the way; the exit status is not.
  if (status == 0 && result.phase == Phase::kDisarmed) result.let_go = true;
  if (status == 0 && !result.let_go) result.phase = Phase::kParked;
  if (status == 1 && result.phase == Phase::kParked && !result.aborted)
    result.phase = Phase::kStopped;
  result.lost = bus_.failed() + (log_ ? result.ticks - heard_ : 0);
  if (log_) {
    log_->flush();
    result.log_lost = log_->lost();
    result.log_trouble = log_->trouble();
  }
  return result;
}

}  // namespace ves
