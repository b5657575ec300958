// SPDX-License-Identifier: BSD-3-Clause
//
// The menu as a person has it: on a terminal, with a prompt, a line that tells where the platform
// is, and news between the two.
#include <fmt/format.h>
#include <poll.h>
#include <pty.h>
#include <sys/syscall.h>

#include <regex>

#include "support/programs.hpp"
#include "support/robots.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves {
namespace {

/// Where a line may be typed; the status may be renewed at once.
constexpr const char* kPrompt = R"(> (\x1b7|$))";

/// A program on a pseudo-terminal, and what it has shown so far.
class Terminal {
 public:
  explicit Terminal(const std::string& command) {
    winsize size{24, 80, 0, 0};
    pid_ = forkpty(&fd_, nullptr, nullptr, &size);
    if (pid_ != 0) return;
    setenv("TERM", "xterm", 1);
    execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
    _exit(127);
  }
  ~Terminal() {
    if (fd_ >= 0) close(fd_);
    if (pid_ > 0) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
  }
  Terminal(const Terminal&) = delete;

  void type(const std::string& text) {
    asked_ = shown_.size();
    ASSERT_EQ(::write(fd_, text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  /// The first match in what has come since the last typing; waits for it.
  std::string until(const std::string& pattern) {
    const std::regex wanted(pattern);
    const std::int64_t patience = monotonicNow() + 60'000'000'000;
    while (monotonicNow() < patience) {
      std::smatch found;
      const std::string since = shown_.substr(asked_);
      if (std::regex_search(since, found, wanted)) return found.str();
      pollfd one{fd_, POLLIN, 0};
      if (poll(&one, 1, 100) <= 0) continue;
      char buffer[4096];
      const ssize_t n = read(fd_, buffer, sizeof buffer);
      if (n <= 0) break;
      shown_.append(buffer, static_cast<std::size_t>(n));
    }
    ADD_FAILURE() << "no " << pattern << " in\n" << shown_.substr(asked_);
    return "";
  }
  /// Its exit status, once it has shown all that it will.
  int status() {
    char buffer[4096];
    for (ssize_t n; (n = read(fd_, buffer, sizeof buffer)) > 0;)
      shown_.append(buffer, static_cast<std::size_t>(n));
    int out = 0;
    waitpid(std::exchange(pid_, -1), &out, 0);
    return WIFEXITED(out) ? WEXITSTATUS(out) : -1;
  }
  const std::string& shown() const { return shown_; }
  /// Ctrl-C from elsewhere while the program waits in a write, which Ctrl-S has stopped.
  void interruptAWrite() {
    type("\x13help\n");
    const std::string writing = fmt::format("{} {:#x} ", SYS_write, STDOUT_FILENO);
    const std::string path = fmt::format("/proc/{}/syscall", pid_);
    const std::int64_t patience = monotonicNow() + 60'000'000'000;
    while (test::readText(path).rfind(writing, 0) != 0)
      ASSERT_LT(monotonicNow(), patience) << test::readText(path);
    ASSERT_EQ(kill(pid_, SIGINT), 0);
    type("\x11");
  }

 private:
  int fd_ = -1;
  pid_t pid_ = -1;
  std::string shown_;
  std::size_t asked_ = 0;
};

class OnATerminal : public test::Programs {
 protected:
  std::string session(const std::string& more) {
    return "cd " + folder_.string() + " && exec " + app("controller") +
           "puma_on_table_4_1 --plant --private-bus --no-plots " + patient() + more;
  }
};

TEST_F(OnATerminal, TheMenuShowsWhereThePlatformIsWhileAPersonTypes) {
  Terminal person(session("--out a"));
  person.until("`help`: what each does");
  person.until(kPrompt);
  const std::string status = R"(\[(\w+) (\d+\.\d) s\] x ([+-]\d+\.\d) y [^\r\n\x1b]*)";
  const auto statusNow = [&](const std::string& phase) {
    const std::string line = person.until(R"(\[)" + phase + R"( \d+\.\d s\] x [^\r\n\x1b]* deg)");
    EXPECT_LT(line.size(), 80u) << line;
    std::smatch parts;
    EXPECT_TRUE(std::regex_search(line, parts, std::regex(status))) << line;
    return std::pair(std::stod(parts[2]), std::stod(parts[3]));
  };
  person.type("arm\n");
  person.until("holding  x [+-]0.0");
  // Renewed in its place while a line is being typed, and so is the line.
  person.type("mov");
  const auto [t, x] = statusNow("armed");
  EXPECT_NEAR(x, 0.0, 0.11);
  person.until(R"(\x1b7\x1b\[1A\r\x1b\[K\[armed [^\x1b]*\x1b8)");
  person.type("e x 5 in 1\n");
  person.until("running: move");
  person.until("holding  x \\+5.0");
  person.type("\n");
  const auto [later, there] = statusNow("armed");
  EXPECT_NEAR(there, 5.0, 0.11);
  EXPECT_GT(later, t + 1.0);
  EXPECT_LT(later, t + 60.0);
  // A sine that ends in motion is braked, which is no move.
  person.type("trajectory 0.3 z sine 20 0.5\n");
  person.until("running: trajectory");
  person.until("running: braking");
  person.until("holding");
  // What is not understood, or not taken, is told, and the menu goes on.
  person.type("dance\n");
  person.until("dance");
  person.type("reset\n");
  person.until("not taken: ");
  // A word alone asks for the rest.
  person.type("trajectory\n");
  person.until("seconds");
  person.type("back\n");
  person.until(kPrompt);
  person.type("status\n");
  person.until("bias       none: not calibrated");
  person.type("calibration\n");
  person.until("calibrated  bias");
  person.until("holding");
  person.type("status\n");
  person.until(
      R"(bias       of \d{4}-\d\d-\d\dT[^ ]*, 0\.0 h old, at [-0-9.]+ C; now [-0-9.]+ C\s)");
  person.type("quit\n");
  EXPECT_EQ(person.status(), 0) << person.shown();
  EXPECT_NE(person.shown().find("home, and done"), std::string::npos);
  EXPECT_EQ(summary(folder_ / "a")["ended"], "parked");
}

TEST_F(OnATerminal, CtrlCBringsThePlatformHome) {
  Terminal person(session("--out a"));
  person.until(kPrompt);
  person.type("arm\n");
  person.until("holding");
  person.type("move in 1 x 5\n");
  person.until("holding  x \\+5.0");
  person.type("\x03");
  EXPECT_EQ(person.status(), 0) << person.shown();
  EXPECT_NE(person.shown().find("parked, legs at home"), std::string::npos) << person.shown();
}

TEST_F(OnATerminal, CtrlCLosesNothingThatIsBeingWritten) {
  if (test::readText("/proc/self/syscall").empty())
    GTEST_SKIP() << "the kernel does not tell what a process waits for";
  Terminal person(session("--out a"));
  person.until(kPrompt);
  person.interruptAWrite();
  EXPECT_EQ(person.status(), 0) << person.shown();
  EXPECT_NE(person.shown().find("see it: "), std::string::npos) << person.shown();
}

TEST_F(OnATerminal, AStopIsNamedWithItsTick) {
  Terminal person(
      session("--out a --set 'program=[{calibration: {}}, {move: {duration_s: 30}, "
              "faults: [{at_s: 0.5, duration_s: 60, fault: wrench_rail, which: 3}]}]'"));
  person.until(kPrompt);
  person.type("program\n");
  const std::string stopped = person.until("STOPPED in tick \\d+ by: [a-z ]+");
  person.type("\n");
  person.until(R"(\[stopped \d+\.\d s, latched\])");
  person.type("quit\n");
  EXPECT_EQ(person.status(), 1) << person.shown();
  const auto s = summary(folder_ / "a");
  EXPECT_EQ(stopped, fmt::format("STOPPED in tick {} by: {}", s["first_cause_tick"].get<long>(),
                                 s["first_cause"].get<std::string>()));
}

}  // namespace
}  // namespace ves
