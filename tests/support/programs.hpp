// SPDX-License-Identifier: BSD-3-Clause
//
// The programs as a person or a script meets them.
#pragma once

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "ves/bus/bus.hpp"
#include "ves/bus/channels.hpp"
#include "ves/bus/event_log.hpp"
#include "ves/run/process.hpp"

namespace ves::test {

namespace fs = std::filesystem;

struct Output {
  int status;
  std::string text;  // both streams
};

inline Output sh(const std::string& command) {
  Output out{-1, ""};
  std::FILE* pipe = popen(("( " + command + " ) 2>&1 </dev/null").c_str(), "r");
  std::array<char, 4096> buffer;
  while (std::size_t n = fread(buffer.data(), 1, buffer.size(), pipe))
    out.text.append(buffer.data(), n);
  const int status = pclose(pipe);
  out.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return out;
}

class Programs : public testing::Test {
 protected:
  void SetUp() override {
    setenv("VES_CONFIG_DIR", VES_TEST_CONFIG_DIR, 1);
    folder_ =
        fs::temp_directory_path() / ("ves_programs_" + std::to_string(getpid()) +
                                     testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  static std::string app(const std::string& name) {
    return std::string("'") + VES_TEST_APP_DIR + "/ves' " + name + " ";
  }
  Output run(const std::string& arguments) { return sh(app("run") + arguments); }
  std::string out(const std::string& name) { return " --out " + (folder_ / name).string() + " "; }
  std::string file(const std::string& name) const { return (folder_ / name).string(); }
  /// Status 2, and one line with this in it.
  static void expectRefusal(const std::string& command, const std::string& in_line) {
    const Output refused = sh(command);
    EXPECT_EQ(refused.status, 2) << command;
    EXPECT_EQ(std::count(refused.text.begin(), refused.text.end(), '\n'), 1) << refused.text;
    EXPECT_NE(refused.text.find(in_line), std::string::npos) << refused.text;
  }

  static nlohmann::json summary(const fs::path& folder) {
    std::ifstream in(folder / "summary.json");
    return nlohmann::json::parse(in);
  }
  /// A program that runs beside the test.
  static Process start(const std::string& name, std::vector<std::string> arguments) {
    if (name == "controller" || name == "run")
      arguments.insert(arguments.end(), patience().begin(), patience().end());
    arguments.insert(arguments.begin(), name);
    return {std::string(VES_TEST_APP_DIR) + "/ves", arguments};
  }
  /// A script in the source tree; of what it sends a share of `loss` never arrives.
  static Process python(const std::string& script, std::vector<std::string> arguments,
                        const std::string& loss = "0") {
    const std::string source = VES_TEST_SOURCE_DIR;
    setenv("PYTHONPATH",
           (source + "/tests/support/python:" + VES_TEST_APP_DIR + "/../python").c_str(), 1);
    setenv("PYTHONDONTWRITEBYTECODE", "1", 1);
    setenv("VES_TEST_LOSS", loss.c_str(), 1);
    arguments.insert(arguments.begin(), source + "/" + script);
    return {"/usr/bin/python3", arguments};
  }
  /// Commands of a log, in order.
  static std::vector<std::array<std::int32_t, 8>> commands(const fs::path& folder) {
    std::vector<std::array<std::int32_t, 8>> all;
    LogReader reader((folder / "run.lcmlog").string());
    LogEvent event;
    while (reader.next(event))
      if (event.channel == channel::kLegCommand) {
        const auto m = event.as<leg_command_t>();
        all.push_back({m->counts[0], m->counts[1], m->counts[2], m->counts[3], m->counts[4],
                       m->counts[5], m->engaged, m->segment});
      }
    return all;
  }
  // On a loaded machine processes sleep through samples, and sockets overflow. Neither is what
  // these tests are about: the controller waits longer, and a log with holes is recorded once more.
  static const std::vector<std::string>& patience() {
    static const std::vector<std::string> sets = {
        "--set", "safety.stale_ticks=1000",         "--set", "safety.stall_ticks=1000",
        "--set", "safety.overruns_per_second=1000", "--set", "safety.position_error_still_m=0.1",
        "--set", "safety.reading_jump_m=1"};
    return sets;
  }
  static constexpr const char* kShortProgram =
      "program=[{calibration: {}},{trajectory: {duration_s: 1, z: {sine: {amplitude_m: 0.02, "
      "frequency_hz: 1}}}}]";
  static std::string patient() {
    std::string line;
    for (const std::string& word : patience()) line += word + " ";
    return line;
  }

  static void untilNothingIsLost(const std::function<std::string()>& record) {
    for (int i = 0; i < 4; ++i) {
      const Output again = sh(app("replay") + record() + " --check");
      if (again.text.find("are missing") != std::string::npos ||
          again.text.find("not in this log") != std::string::npos)
        continue;
      EXPECT_EQ(again.status, 0) << again.text;
      EXPECT_NE(again.text.find("0 of "), std::string::npos) << again.text;
      return;
    }
    ADD_FAILURE() << "four logs with holes";
  }
  fs::path folder_;
};

}  // namespace ves::test
