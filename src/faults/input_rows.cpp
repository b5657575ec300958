// SPDX-License-Identifier: BSD-3-Clause
#include <unistd.h>

#include <fstream>

#include "rows.hpp"
#include "ves/bus/channels.hpp"
#include "ves/bus/event_log.hpp"
#include "ves/run/run.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::uint8_t>;
using Tries = std::vector<std::function<void()>>;

template <typename Message>
Bytes encoded(const Message& m) {
  Bytes bytes(static_cast<std::size_t>(m.getEncodedSize()));
  m.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

template <typename Message>
bool decodes(const Bytes& bytes) {
  return decode<Message>(bytes.data(), static_cast<std::int64_t>(bytes.size())).has_value();
}

/// How many are refused, and the first line that one was refused with.
FaultOutcome refusals(const Tries& tries) {
  std::size_t refused = 0;
  std::string line;
  for (const auto& attempt : tries) {
    try {
      attempt();
    } catch (const InputError& error) {
      if (refused++ == 0) line = error.what();
    }
  }
  return outcome(refused == tries.size(),
                 fmt::format("{} of {} refused, the first with '{}'", refused, tries.size(), line));
}

FaultOutcome hostileStrings(const FaultBench& bench) {
  const Bytes good = encoded(describe(faultScenario(own(bench)), {1, 2}, 0));
  constexpr std::size_t kFirstLength = 60;  // [B] after fingerprint, header and schema
  int taken = 0, tries = 0;
  for (const std::uint32_t length : {0x7fffffffu, 0xffffffffu, 0u, 0x40000000u}) {
    Bytes bad = good;
    for (std::size_t i = 0; i < 4; ++i)
      bad[kFirstLength + i] = static_cast<std::uint8_t>(length >> (24 - 8 * i));
    taken += decodes<experiment_t>(bad);
    ++tries;
  }
  return outcome(taken == 0 && decodes<experiment_t>(good),
                 fmt::format("{} of {} taken", taken, tries));
}

FaultOutcome otherVersion() {
  const Bytes good = encoded(sample_t{});
  int taken = 0;
  for (std::size_t bit = 0; bit < 64; ++bit) {
    Bytes other = good;
    other[bit / 8] = static_cast<std::uint8_t>(other[bit / 8] ^ (1u << (bit % 8)));
    taken += decodes<sample_t>(other);
  }
  return outcome(taken == 0 && decodes<sample_t>(good), fmt::format("{} of 64 taken", taken));
}

FaultOutcome damagedLogs() {
  const fs::path file = fs::temp_directory_path() / fmt::format("ves_faults_{}_log", getpid());
  const auto reading = [&](const std::function<void(std::vector<char>&)>& edit) {
    return [=] {
      {
        LogWriter writer(file.string());
        for (int i = 0; i < 3; ++i) writer.write(channel::kSample, sample_t{}, i * 1000);
      }
      std::ifstream in(file, std::ios::binary);
      std::vector<char> bytes{std::istreambuf_iterator<char>(in), {}};
      edit(bytes);
      std::ofstream(file, std::ios::binary)
          .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
      LogReader reader(file.string());
      LogEvent event;
      while (reader.next(event)) {
      }
    };
  };
  FaultOutcome out = refusals(
      {reading([](auto& b) { b.clear(); }), reading([](auto& b) { b.resize(b.size() - 5); }),
       reading([](auto& b) { b.resize(13); }), reading([](auto& b) { b[0] ^= 1; }),
       reading([](auto& b) { b[24] = 0x7f; }), reading([](auto& b) { b[20] = 0x7f; }),
       [] { LogReader reader("/"); }});
  fs::remove(file);
  return out;
}

FaultOutcome wrongConfigurations(const FaultBench& bench) {
  Tries tries;
  for (const char* set :
       {"legs.tau_s=nan", "legs.tau_s=-1", "controller.period_ns=0", "nonsense=1",
        "base.mass_diagonal=[1,1,1,1,1,-1]", "robot.joints_deg_or_m=[0]", "program=[]",
        "safety.leg_min_m=inf", "sensor.gain=[0,0,0,0,0,0]", "seed=x", "gravity_m_per_s2={}"})
    tries.push_back([=] { faultScenario(own(bench), {set}); });
  tries.push_back([] { loadExperiment("/no/such/file.yaml"); });
  tries.push_back([] { parseDocument("a: [", "x.yaml"); });
  return refusals(tries);
}

FaultOutcome fullDisk(const FaultBench& bench) {
  const Experiment e = faultScenario(own(bench));
  LogWriter log("/dev/full");
  const RunResult with = runLockstep(e, &log, nullptr), without = runLockstep(e, nullptr, nullptr);
  return outcome(with.good() && with.log_lost > 0 && with.ticks == without.ticks,
                 fmt::format("{} after {} ticks, {} events lost; {} ticks without a log",
                             name(with.phase), with.ticks, with.log_lost, without.ticks));
}

}  // namespace

std::vector<FaultRow> inputRows(const FaultBench& bench) {
  return {{"F22", "strings of hostile length in a message", "not decoded", false,
           [=] { return hostileStrings(bench); }},
          {"F23", "a message of another version", "not decoded", false, otherVersion},
          {"F24", "logs that are empty, cut short, out of step, absurd, or a folder",
           "one line with the byte", false, damagedLogs},
          {"F25", "configurations that are wrong", "one line with file and line", false,
           [=] { return wrongConfigurations(bench); }},
          {"F35", "the disk is full", "control unaffected, loss counted", false,
           [=] { return fullDisk(bench); }}};
}

}  // namespace ves
