// SPDX-License-Identifier: BSD-3-Clause
//
// A Net F/T sensor whose records go wrong, between the simulated sensor and the controller.
#include <thread>

#include "rows.hpp"
#include "ves/devices/net_ft.hpp"
#include "ves/devices/net_ft_server.hpp"
#include "ves/plant/lockstep.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;
using devices::RdtRecord;
using devices::RdtStream;

const devices::NetFtCalibration kCalibration{1e5, 1e5, "VES00001"};
constexpr int kRecords = 10;         // [-] a tick
constexpr std::int64_t kWait = 200;  // [-] ticks of admittance control before the fault
constexpr std::int64_t kTake = 5;    // [s] a driver may take to see another calibration

/// What is sent of a record; `fault`: it is time. None: lost.
using Spoil = std::function<std::vector<RdtRecord>(RdtRecord record, bool fault)>;

/// The wrench of each sample goes through records and a driver's stream.
class Path {
 public:
  Path(const Experiment& e, Spoil spoil)
      : stream_(kCalibration, e.plant.sensor.S_proc(), e.plant.sensor_window),
        spoil_(std::move(spoil)) {}

  void pass(const Wrench& F_So_S, bool fault, Sample& sample) {
    constexpr std::int64_t kApart = 1'000'000;  // [ns]
    for (int k = 0; k < kRecords; ++k) {
      RdtRecord record;
      record.sequence = sequence_++;
      const Vec6 counts = kCalibration.counts_per_newton * F_So_S.stacked();
      for (int i = 0; i < kWrenchChannels; ++i)
        record.counts[static_cast<std::size_t>(i)] =
            static_cast<std::int32_t>(std::lround(counts(i)));
      for (const RdtRecord& sent : spoil_(record, fault)) {
        const auto bytes = encode(sent);
        stream_.take(bytes.data(), bytes.size(), sample.time - (kRecords - 1 - k) * kApart);
      }
    }
    devices::WrenchReading reading;
    if (!stream_.read(reading)) return;
    std::copy(reading.counts.begin(), reading.counts.end(), sample.adc.begin());
    sample.wrench_time = std::max<std::int64_t>(0, reading.time);
    if (reading.fault) sample.faults |= kSensorPiece;
  }
  const RdtStream::Counters& counters() const { return stream_.counters(); }

 private:
  RdtStream stream_;
  Spoil spoil_;
  std::uint32_t sequence_ = 0xfffffff0u - kRecords * 1100;  // wraps in admittance control
};

struct Ending {
  TickState state;
  std::int64_t ticks = -1;  // [-] from the fault to the first check that tripped
  RdtStream::Counters counters;
};

Ending run(const FaultBench& bench, const Spoil& spoil) {
  const Experiment e = faultScenario(own(bench));
  Lockstep loop(e.controller, e.plant);
  Path path(e, spoil);
  std::int64_t emulating = 0, injected = -1;
  loop.disturb = [&](Sample& sample) {
    path.pass(loop.plant().truth().F_So_S, emulating > kWait, sample);
  };
  Ending out;
  loop.input.order.request = Request::kStart;
  for (std::int64_t tick = 0; tick < 3000; ++tick) {
    const TickState& s = loop.tick();
    if (s.kind == SegmentKind::kAdmittance && ++emulating > kWait && injected < 0) injected = tick;
    if (out.ticks < 0 && injected >= 0 && s.latched.any()) out.ticks = tick - injected;
    out.state = s;
    loop.input.order = {};
    if (s.phase == Phase::kParked || s.phase == Phase::kStopped) break;
    loop.advance();
  }
  out.counters = path.counters();
  return out;
}

FaultOutcome goesOn(const Ending& e, bool seen) {
  const auto& c = e.counters;
  return outcome(e.state.phase == Phase::kParked && seen,
                 fmt::format("{}; {} records, {} lost, {} again, {} late", name(e.state.phase),
                             c.records, c.lost, c.repeated, c.late));
}

FaultOutcome stops(const Ending& e, Check check, std::int64_t within) {
  const bool good = e.state.phase == Phase::kStopped && e.state.cause == check && e.ticks >= 0 &&
                    e.ticks <= within;
  return outcome(good, fmt::format("{}: {}", name(e.state.phase), name(e.state.cause)), e.ticks);
}

/// Over real sockets: the driver's own thread is to see it.
FaultOutcome otherCalibration(const FaultBench& bench) {
  const Experiment e = faultScenario(own(bench));
  devices::NetFtServer::Options options{"127.0.0.1", 0, 0, 1000, kCalibration};
  devices::NetFtServer server(options);
  std::atomic<bool> changed{false};
  std::jthread serving([&](std::stop_token stop) {
    for (; !stop.stop_requested(); std::this_thread::sleep_for(std::chrono::milliseconds(1))) {
      if (changed) server.calibrate({1e5, 1e5, "VES00002"});
      server.serve(monotonicNow());
    }
  });
  devices::NetFt driver({"127.0.0.1", server.port(), server.httpPort()}, e.plant.sensor.S_proc(),
                        e.plant.sensor_window);
  const auto faulty = [&](std::int64_t seconds) {
    devices::WrenchReading reading;
    const std::int64_t end = monotonicNow() + seconds * 1'000'000'000;
    for (bool any = false; monotonicNow() < end;
         std::this_thread::sleep_for(std::chrono::milliseconds(2))) {
      any = driver.read(reading) || any;
      if (any && (reading.fault || seconds == 1)) return reading.fault;
    }
    return false;
  };
  const bool before = faulty(1);
  changed = true;
  const bool after = faulty(kTake);
  const Ending end = run(bench, [](RdtRecord r, bool fault) {
    if (fault) r.status = 0x80000000;
    return std::vector{r};
  });
  const FaultOutcome stopped = stops(end, Check::kDevice, 1);
  return outcome(!before && after && stopped.as_expected,
                 fmt::format("the driver says {}; {}", after ? "a fault" : "NOTHING", stopped.what),
                 stopped.ticks);
}

}  // namespace

std::vector<FaultRow> sensorRows(const FaultBench& bench) {
  using Records = std::vector<RdtRecord>;
  return {
      {"F40", "Net F/T: every third record is lost", "the run goes on", false,
       [=] {
         const Ending e = run(bench, [](const RdtRecord& r, bool fault) {
           return fault && r.sequence % 3 == 0 ? Records() : Records{r};
         });
         return goesOn(e, e.counters.lost > 3000);
       }},
      {"F41", "Net F/T: records twice, and each older one again", "the run goes on with the newest",
       false,
       [=] {
         const Ending e = run(bench, [](const RdtRecord& r, bool fault) {
           if (!fault) return Records{r};
           RdtRecord old = r;
           old.sequence -= 7;
           old.counts.fill(1'000'000'000);
           return Records{r, r, old};
         });
         return goesOn(e, e.counters.repeated > 9000 && e.counters.late > 9000);
       }},
      {"F42", "Net F/T: its sequence wraps", "the run goes on", false,
       [=] {
         bool wrapped = false;
         std::uint32_t last = 0;
         const Ending e = run(bench, [&](const RdtRecord& r, bool fault) {
           wrapped = wrapped || (fault && r.sequence < last);
           last = r.sequence;
           return Records{r};
         });
         return goesOn(e, wrapped && e.counters.lost == 0);
       }},
      {"F43", "Net F/T: its status says an error", "controlled stop: device fault", false,
       [=] {
         return stops(run(bench,
                          [](RdtRecord r, bool fault) {
                            if (fault) r.status = 0x80020000;
                            return Records{r};
                          }),
                      Check::kDevice, 1);
       }},
      {"F44", "Net F/T: silent", "controlled stop: sample age", false,
       [=] {
         const int most = faultScenario(own(bench)).controller.safety.stale_ticks;
         return stops(run(bench, [](const RdtRecord& r,
                                    bool fault) { return fault ? Records() : Records{r}; }),
                      Check::kStale, most + 1);
       }},
      {"F45", "Net F/T: switched off and on, counts from one", "controlled stop: sample age", false,
       [=] {
         const int most = faultScenario(own(bench)).controller.safety.stale_ticks;
         return stops(run(bench,
                          [&](RdtRecord r, bool fault) {
                            if (fault) r.sequence -= 1'000'000;
                            return Records{r};
                          }),
                      Check::kStale, most + 1);
       }},
      {"F46", "Net F/T: another calibration was chosen", "controlled stop: device fault", false,
       [=] { return otherCalibration(bench); }}};
}

}  // namespace ves
