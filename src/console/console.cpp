// SPDX-License-Identifier: BSD-3-Clause
#include "ves/console/console.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <cmath>
#include <ctime>
#include <fstream>

#include "collector.hpp"
#include "texts.hpp"
#include "ves/bus/channels.hpp"
#include "ves/console/command.hpp"
#include "ves/console/form.hpp"
#include "ves/core/coordinates.hpp"
#include "ves/core/lines.hpp"
#include "ves/evaluation/evidence.hpp"
#include "ves/evaluation/identified.hpp"
#include "ves/realtime/realtime.hpp"
#include "ves/run/session.hpp"
#include "ves/series/series.hpp"

namespace ves {
namespace {

constexpr int kTurn = 50;             // [ms] between looks at what happens
constexpr std::size_t kColumns = 80;  // of a terminal

class Console {
 public:
  Console(const Experiment& experiment, const ConsoleOptions& options)
      : experiment_(experiment),
        options_(options),
        terminal_(options.commands.empty() && isatty(STDIN_FILENO) && isatty(STDOUT_FILENO)),
        calibration_(experiment.source.calibration) {
    for (const std::string& line : options.commands) {
      try {
        const std::size_t last = line.find_last_not_of(" \t");
        const bool waits = last == std::string::npos || line[last] != '&';
        script_.push_back({parseCommand(waits ? line : line.substr(0, last), experiment), waits});
      } catch (const InputError& error) {
        throw InputError(fmt::format("--do '{}': {}", line, error.what()));
      }
    }
  }

  RunResult run(bool& failed) {
    Session session(experiment_, options_.launch);
    session_ = &session;
    session.onState([this](const state_t& state) { notice(state); });
    session.onMessage([this](const std::string& channel, const void* data, std::uint32_t size) {
      collect(channel, data, size);
    });
    while (!session.state() && !over()) session.listen(kTurn);
    if (options_.commands.empty())
      ask();
    else
      obeyScript();
    if (session.running()) {
      say("home, and done");
      session.interrupt();
    }
    while (session.running()) session.listen(kTurn);
    if (collector_) say(collector_->outcome());
    failed = failed_;
    return session.result();
  }

 private:
  // --- What the person sees ----------------------------------------------------------------------

  /// A line of news; an open prompt is put back below it.
  void say(const std::string& text) {
    // Not fmt::print: it throws when nobody reads, and that must not end a run.
    if (!prompt_.empty()) std::fputs("\r\033[K", stdout);
    if (!status_.empty()) std::fputs("\033[1A\033[K", stdout);
    std::fputs((text + "\n" + (status_.empty() ? "" : status_ + "\n") + prompt_).c_str(), stdout);
    std::fflush(stdout);
  }

  /// What was asked for does not happen: a script, or a pipe, fails by it.
  void complain(const std::string& text) {
    if (terminal_) return say(text);
    std::fputs((text + "\n").c_str(), stderr);
    failed_ = true;
  }

  void greet() {
    std::string words;
    for (const Item& item : menu())
      words += fmt::format("{}{}", words.empty() ? "" : " ", item.word);
    say(wrapped(words, kColumns));
    say("`help`: what each does. Ctrl-C: home, and done.");
  }

  void help() {
    for (std::size_t i = 0; i < menu().size(); ++i)
      say(fmt::format("  {:>2} {:<13}{}", i + 1, menu()[i].word, menu()[i].what));
    say(
        wrapped("A number, a word or its beginning; lengths in mm, angles in deg. A word alone "
                "asks for the rest; `back` leaves its questions, `hold` and `stop` act at once. In "
                "one line, for example: trajectory 3 z sine 200 0.5, or: move in 4 x 50 beta 4. "
                "Ctrl-C: home, and done.",
                kColumns));
  }

  /// Above the prompt, renewed in its place; what is being typed stays.
  void showStatus(const state_t& s) {
    constexpr std::int64_t kRenewed = 200'000'000;  // [ns]
    if (status_.empty() || monotonicNow() - renewed_ < kRenewed) return;
    renewed_ = monotonicNow();
    status_ = statusLine(s);
    std::fputs(("\0337\033[1A\r\033[K" + status_ + "\0338").c_str(), stdout);
    std::fflush(stdout);
  }

  std::string statusLine(const state_t& s) const {
    std::string out =
        fmt::format("[{} {:.1f} s{}] x {:+.1f} y {:+.1f} z {:+.1f} mm, {:+.2f} {:+.2f} {:+.2f} deg",
                    name(static_cast<Phase>(s.phase)),
                    static_cast<double>(s.header.sequence * experiment_.controller.period) *
                        kSecondPerNanosecond,
                    s.latched ? ", latched" : "", s.x[0] / kMillimetre, s.x[1] / kMillimetre,
                    s.x[2] / kMillimetre, s.x[3] / kDegree, s.x[4] / kDegree, s.x[5] / kDegree);
    if (out.size() >= kColumns) out.resize(kColumns - 1);  // it must stay one line
    return out;
  }

  void notice(const state_t& s) {
    showStatus(s);
    const auto phase = static_cast<Phase>(s.phase);
    const auto kind = static_cast<SegmentKind>(s.kind);
    if (phase != phase_ || kind != kind_ || s.segment != segment_) {
      // What follows a segment within it is how it comes to rest.
      const bool brakes = kind == SegmentKind::kMove && phase == phase_ && s.segment == segment_;
      const std::string_view what = brakes ? "braking" : name(kind);
      phase_ = phase;
      kind_ = kind;
      segment_ = s.segment;
      switch (phase) {
        case Phase::kDisarmed:
          say(s.tripped ? fmt::format("disarmed; cannot arm: {}", failing(s.tripped)) : "disarmed");
          break;
        case Phase::kArmed: say("holding  " + poseText(s.x)); break;
        case Phase::kRunning:
          say(s.segment < 0 ? fmt::format("running: {}", what)
                            : fmt::format("running: {} ({} of {})", what, s.segment + 1,
                                          experiment_.controller.program.size));
          break;
        case Phase::kReturning: say("going home"); break;
        case Phase::kParked: say("parked, legs at home"); break;
        case Phase::kStopping: say(fmt::format("stopping: {}", failing(s.latched))); break;
        case Phase::kStopped:
          say(fmt::format("STOPPED in tick {} by: {}. The legs hold; `reset` when it is gone.",
                          s.cause_tick, failing(s.latched)));
          break;
        case Phase::kCount: break;
      }
    }
    const auto status = static_cast<CalibrationStatus>(s.calibration);
    if (status != calibration_status_) {
      calibration_status_ = status;
      if (status == CalibrationStatus::kDone) keepCalibration(s);
      if (status == CalibrationStatus::kRefused) {
        complain(fmt::format("calibration refused: {}; the bias is as before",
                             stillnessViolation(s, experiment_)));
      }
    }
  }

  void keepCalibration(const state_t& s) {
    const CalibrationRecord record = calibrationOf(s, experiment_.source.calibrated(), temperature_);
    calibration_ = record;
    std::string table = "calibrated  bias          of a sample  standard error [count]\n";
    for (int i = 0; i < 6; ++i)
      table += fmt::format("      {}  {:10.2f}    {:10.2f}    {:10.3f}\n", wrenchComponent(i).name,
                           s.bias[i], s.deviation[i], s.standard_error[i]);
    std::error_code error;
    std::filesystem::create_directories(options_.calibration.parent_path(), error);
    std::ofstream file(options_.calibration);
    file << write(record);
    file.flush();
    say(table + (file ? "  kept in " : "  could NOT be written to ") +
        options_.calibration.string());
  }

  // --- What the person says ----------------------------------------------------------------------

  bool over() { return options_.stop() || !session_->running(); }

  /// One line of input; nothing at its end, after Ctrl-C, or when the controller has ended.
  std::optional<std::string> line(const std::string& prompt) {
    prompt_ = terminal_ ? prompt : "";
    if (terminal_ && session_->state()) status_ = statusLine(*session_->state());
    if (!status_.empty()) std::fputs((status_ + "\n").c_str(), stdout);
    std::fputs(prompt_.c_str(), stdout);
    std::fflush(stdout);
    std::optional<std::string> out;
    while (!over()) {
      const std::size_t end = input_.find('\n');
      if (end != std::string::npos) {
        out = input_.substr(0, end);
        input_.erase(0, end + 1);
        break;
      }
      if (!session_->listen(kTurn, STDIN_FILENO)) continue;
      char buffer[512];
      const ssize_t n = read(STDIN_FILENO, buffer, sizeof buffer);
      if (n <= 0) break;
      input_.append(buffer, static_cast<std::size_t>(n));
    }
    if (!out && terminal_) std::fputs("\n", stdout);
    prompt_.clear();
    status_.clear();
    return out;
  }

  void ask() {
    if (terminal_) greet();
    while (!over()) {
      auto text = line("> ");
      if (!text) return;
      if (text->find_first_not_of(" \t\r") == std::string::npos) continue;
      try {
        if (terminal_ && text->find(' ') == std::string::npos) {
          text = fillForm(*text, experiment_, person_);
          if (!text) return;
          if (text->empty()) continue;
        }
        if (!terminal_ && text->back() == '&') text->pop_back();  // here nothing waits anyway
        const Command command = parseCommand(*text, experiment_);
        if (!obey(command)) return;
        // What comes through a pipe does not see when it is armed.
        if (!terminal_ && command.verb == Verb::kArm) settle(true);
      } catch (const InputError& error) {
        complain(error.what());
      }
    }
  }

  // --- What is done about it ---------------------------------------------------------------------

  void pass(double seconds) {
    const std::int64_t until = monotonicNow() + static_cast<std::int64_t>(seconds * 1e9);
    while (monotonicNow() < until && !over()) session_->listen(kTurn);
  }

  /// False for the end.
  bool obey(const Command& command) {
    switch (command.verb) {
      case Verb::kHelp: help(); break;
      case Verb::kStatus:
        say(session_->state()
                ? statusText({*session_->state(), timing_, calibration_, temperature_})
                : "nothing heard of the controller yet");
        break;
      case Verb::kCollect:
        if (collector_) say(collector_->outcome());
        collector_.emplace(experiment_, command.collection);
        break;
      case Verb::kWait: pass(command.wait); break;
      case Verb::kRobot:
      case Verb::kTool:
      case Verb::kGrasp:
      case Verb::kRelease:
      case Verb::kPush: askRobot(command.robot); break;
      case Verb::kQuit: return false;
      default: return give(command);
    }
    return true;
  }

  /// At a terminal the answer is news, whenever it comes.
  void askRobot(const RobotOrder& order) {
    const std::int64_t before = session_->robotOrders().answered();
    session_->orderRobot(order);
    if (terminal_) return;
    const std::int64_t patience = monotonicNow() + kPatience;
    const auto answered = [&] { return session_->robotOrders().answered() != before; };
    while (!answered() && !over() && monotonicNow() < patience) session_->listen(kTurn);
    if (answered() || over()) return;
    complain("the robot does not answer");
  }

  /// A program is run under attendance: it ends holding at home, and the menu goes on.
  bool armFirst() {
    Order arm;
    arm.request = Request::kArm;
    const auto refusal = session_->order(arm);
    if (refusal && *refusal != Refusal::kNone)
      complain(fmt::format("not taken: {}{}", name(*refusal), advice(*refusal)));
    const std::int64_t patience = monotonicNow() + kPatience;
    while (refusal == Refusal::kNone && phase_ == Phase::kDisarmed && !over() &&
           monotonicNow() < patience)
      session_->listen(kTurn);
    if (phase_ == Phase::kArmed) return true;
    complain("not armed");
    return false;
  }

  bool give(const Command& command) {
    if (command.verb == Verb::kProgram && phase_ == Phase::kDisarmed && !armFirst()) return true;
    // The stability check takes seconds: who types meanwhile, a hold perhaps, is not kept waiting.
    const bool waits = command.verb != Verb::kVehicle || !terminal_;
    const auto refusal = session_->order(command.order, waits ? -1 : STDIN_FILENO);
    if (!refusal) {
      complain("the controller does not answer");
    } else if (*refusal == Refusal::kChecking) {
      say("still asked of the stability check");
    } else if (*refusal != Refusal::kNone) {
      complain(fmt::format("not taken: {}{}", name(*refusal), advice(*refusal)));
    } else if (command.verb == Verb::kTare) {
      say(fmt::format("taking {} samples; then the bias slides over {} s", kCalibrationSamples,
                      experiment_.controller.tare_ramp));
    }
    return true;
  }

  std::string advice(Refusal refusal) const {
    switch (refusal) {
      case Refusal::kNotArmed: return phase_ == Phase::kStopped ? "; reset first" : "; arm first";
      case Refusal::kBusy: return "; hold first";
      case Refusal::kCauseRemains: return ": " + failing(session_->state()->tripped);
      default: return "";
    }
  }

  /// Whether the platform moves until it is over.
  static bool moves(Verb verb) {
    switch (verb) {
      case Verb::kArm:
      case Verb::kProgram:
      case Verb::kAdmittance:
      case Verb::kTrajectory:
      case Verb::kMove:
      case Verb::kCalibration:
      case Verb::kHold:
      case Verb::kStop: return true;
      default: return false;
    }
  }

  /// [s] that something else lasts.
  static double lasts(const Command& command) {
    switch (command.verb) {
      case Verb::kRobot: return std::get<RobotMove>(command.robot).duration;
      case Verb::kTool: return std::get<ToolOrder>(command.robot).duration;
      case Verb::kPush: return std::get<PushOrder>(command.robot).duration;
      case Verb::kThrust: return command.order.thrust.maxCoeff();
      case Verb::kVehicle: return command.order.vehicle.over;
      default: return 0.0;
    }
  }

  /// What was begun is over, or never will begin.
  bool settled(bool arms) {
    const auto& s = session_->state();
    if (!s) return false;
    const auto phase = static_cast<Phase>(s->phase);
    if (phase == Phase::kStopped || phase == Phase::kParked) return true;
    return phase == Phase::kArmed || (phase == Phase::kDisarmed && !arms);
  }

  /// A controller that cannot arm says why, and is not waited for.
  void settle(bool arms) {
    const std::int64_t patience = monotonicNow() + kPatience;
    while (!over() && !settled(arms)) {
      session_->listen(kTurn);
      if (arms && phase_ == Phase::kDisarmed && monotonicNow() > patience) {
        return complain("not armed");
      }
    }
  }

  /// One after the other; each waits until what it started is over, unless it ends in `&`.
  void obeyScript() {
    bool arms = false, quits = false;
    std::size_t i = 0;
    while (i < script_.size() && !over() && !failed_ && phase_ != Phase::kParked) {
      const auto& [command, waits] = script_[i];
      say("> " + options_.commands[i++]);
      quits = !obey(command);
      if (quits) break;
      arms = arms || command.verb == Verb::kArm;
      if (waits && !failed_) pass(lasts(command));
      if ((waits && moves(command.verb)) || i == script_.size()) settle(arms);
      if (phase_ == Phase::kStopped) failed_ = true;
    }
    // After a stop the controller lets go, and ends.
    if (i < script_.size() && options_.stop()) failed_ = true;
    for (; i < script_.size(); ++i) say("left out: " + options_.commands[i]);
    while (collector_ && !quits && !over() && phase_ != Phase::kParked) session_->listen(kTurn);
  }

  void collect(const std::string& channel, const void* data, std::uint32_t size) {
    const auto* bytes = static_cast<const std::uint8_t*>(data);
    if (channel == channel::kSample) {
      if (const auto sample = decode<sample_t>(data, size)) temperature_ = sample->temperature;
      const std::int64_t refused = session_->robotOrders().refused;
      if (refused > std::exchange(refused_, refused)) {
        complain("the robot does not do that; the plant says why");
      }
    } else if (channel == channel::kTiming) {
      timing_ = decode<timing_t>(data, size);
    }
    if (!collector_) return;
    event_.channel = channel;
    event_.data.assign(bytes, bytes + size);
    try {
      if (collector_->add(event_)) return;
      say(collector_->outcome());
    } catch (const InputError& error) {
      complain(error.what());
    }
    collector_.reset();
  }

  static constexpr std::int64_t kPatience = 5'000'000'000;  // [ns]

  const Experiment& experiment_;
  const ConsoleOptions& options_;
  Session* session_ = nullptr;
  const Questioner person_{[this](const std::string& prompt) { return line(prompt); },
                           [this](const std::string& text) { say(text); },
                           [this](int i) {
                             const auto& state = session_->state();
                             return state ? coordinateText(i, state->x[i]) : "?";
                           }};
  bool terminal_;
  struct Line {
    Command command;
    bool waits = true;
  };
  std::vector<Line> script_;
  std::int64_t refused_ = 0;  // [-] orders, by the robot
  bool failed_ = false;
  std::string prompt_, input_;
  std::string status_;        // the line above an open prompt
  std::int64_t renewed_ = 0;  // [ns]
  Phase phase_ = Phase::kParked;
  SegmentKind kind_ = SegmentKind::kCount;
  std::int32_t segment_ = -1;
  CalibrationStatus calibration_status_ = CalibrationStatus::kNone;
  std::optional<CalibrationRecord> calibration_;
  double temperature_ = NAN;  // [C]
  std::optional<timing_t> timing_;
  std::optional<Collector> collector_;
  LogEvent event_;
};

}  // namespace

RunResult runConsole(const Experiment& experiment, const ConsoleOptions& options, bool& failed) {
  return Console(experiment, options).run(failed);
}

}  // namespace ves
