// SPDX-License-Identifier: BSD-3-Clause
//
// compare_runs BUILD BUILD [FIRST-LETTERS]: lets two builds record everything that record_runs
// knows, and compares the logs byte by byte. Names the first difference of each run; status 1 when
// there is one. A folder of logs may stand in a build's place.
//
// Not compared: VES_EXPERIMENT, which says who made the log, and the fingerprints of the messages,
// which change with a field's name; and what one build's states and orders say behind the end of
// the other's.
#include <fmt/format.h>
#include <unistd.h>

#include <filesystem>
#include <iostream>
#include <memory>
#include <set>

#include "ves/bus/channels.hpp"
#include "ves/bus/event_log.hpp"
#include "ves/bus/fields.hpp"
#include "ves/core/errors.hpp"
#include "ves/run/process.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;

std::string fieldOf(const std::string& channel, std::size_t byte) {
  if (channel == channel::kState) return fieldAt<state_t>(byte);
  if (channel == channel::kLegCommand) return fieldAt<leg_command_t>(byte);
  return fmt::format("{} byte {}", channel, byte);
}

/// The first difference between two events of the same place; empty when there is none.
std::string difference(const LogEvent& a, const LogEvent& b) {
  if (a.channel != b.channel) return fmt::format("{} against {}", a.channel, b.channel);
  if (a.time_us != b.time_us)
    return fmt::format("{} at {} against {} us", a.channel, a.time_us, b.time_us);
  if (a.channel == channel::kExperiment) return {};
  const std::size_t shorter = std::min(a.data.size(), b.data.size());
  for (std::size_t i = kFingerprintSize; i < shorter; ++i)
    if (a.data[i] != b.data[i]) return fieldOf(a.channel, i);
  // A build whose states and orders say more at their end says the same before it.
  if (a.data.size() != b.data.size() && a.channel != channel::kState &&
      a.channel != channel::kOperator)
    return fmt::format("{} of {} against {} bytes", a.channel, a.data.size(), b.data.size());
  return {};
}

std::string difference(const fs::path& a, const fs::path& b) {
  LogReader left(a.string()), right(b.string());
  LogEvent l, r;
  for (std::int64_t event = 0;; ++event) {
    const bool more_left = left.next(l), more_right = right.next(r);
    if (!more_left && !more_right) return {};
    if (more_left != more_right)
      return fmt::format("the {} log ends after {} events", more_left ? "second" : "first", event);
    const std::string what = difference(l, r);
    if (!what.empty())
      return fmt::format("event {}, {:.3f} s: {}", event, 1e-6 * static_cast<double>(l.time_us),
                         what);
  }
}

std::set<std::string> logsIn(const fs::path& folder, const std::string& only) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().extension() == ".lcmlog" && entry.path().stem().string().starts_with(only))
      names.insert(entry.path().filename().string());
  return names;
}

int compareBuilds(const fs::path& first, const fs::path& second, const std::string& only) {
  const fs::path scratch = fs::temp_directory_path() / fmt::format("ves_compare_{}", getpid());
  const auto recorded = [&](const fs::path& place, const char* name) {
    const fs::path program = place / "tests" / "record_runs";
    if (!fs::exists(program)) return std::pair<fs::path, std::unique_ptr<Process>>(place, nullptr);
    const fs::path folder = scratch / name;
    return std::pair<fs::path, std::unique_ptr<Process>>(
        folder,
        std::make_unique<Process>(program, std::vector<std::string>{folder.string(), only}));
  };
  auto [a, recording_a] = recorded(first, "first");
  auto [b, recording_b] = recorded(second, "second");
  for (auto* recording : {&recording_a, &recording_b})
    if (*recording && (*recording)->wait() != 0)
      throw InputError("record_runs did not come to its end");

  const std::set<std::string> names_a = logsIn(a, only), names_b = logsIn(b, only);
  int different = 0, compared = 0;
  std::set<std::string> all = names_a;
  all.insert(names_b.begin(), names_b.end());
  for (const std::string& name : all) {
    const bool in_both = names_a.contains(name) && names_b.contains(name);
    const std::string what =
        in_both ? difference(a / name, b / name)
                : fmt::format("only in the {}", names_a.contains(name) ? "first" : "second");
    ++compared;
    if (what.empty()) continue;
    ++different;
    fmt::print("{}: {}\n", name, what);
  }
  fs::remove_all(scratch);
  fmt::print("{} of {} runs differ\n", different, compared);
  if (compared == 0) throw InputError("nothing to compare");
  return different == 0 ? 0 : 1;
}

}  // namespace
}  // namespace ves

int main(int argc, char** argv) {
  if (argc < 3 || argc > 4) {
    std::cerr << "usage: compare_runs BUILD BUILD [FIRST-LETTERS of the runs' names]\n";
    return 2;
  }
  try {
    return ves::compareBuilds(argv[1], argv[2], argc > 3 ? argv[3] : "");
  } catch (const std::exception& error) {
    std::cerr << "compare_runs: " << error.what() << '\n';
    return 2;
  }
}
