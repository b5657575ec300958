// SPDX-License-Identifier: BSD-3-Clause
//
// swarm: whole lives of controller and machine, drawn from seeds, and the laws of docs/safety.md
// looked at in every tick of each.
//
//   swarm [--lives N | --days D | --seconds S] [--seed FIRST] [--workers W] [--out DIR] [--all]
//   [--whole] [--only LAW] swarm FILE...          lives from files, as a failing one left them
//   swarm --show SEED      the life of a seed
//
// A life that breaks a law is cut down to what matters and written to DIR/swarm-SEED.yaml. Same
// seed, same bytes, whatever the number of workers. Status 1 when a law was broken.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <fstream>
#include <map>
#include <mutex>
#include <thread>

#include "world.hpp"

namespace ves::swarm {
namespace {

namespace fs = std::filesystem;

struct Options : Conditions {
  fs::path out = ".";
  std::uint64_t first = 1;
  std::int64_t lives = 200;
  double days = 0.0, seconds = 0.0;
  unsigned workers = std::max(1u, std::thread::hardware_concurrency());
  bool all = false;    // go on after a find
  bool whole = false;  // finds are not cut down
};

/// Cuts a life down while it still breaks the same law.
class Shrinker {
 public:
  Shrinker(const Options& options, Life life, Finding finding)
      : options_(options), life_(std::move(life)), finding_(std::move(finding)) {}

  Life shrink() {
    life_.ticks = finding_.tick + 1;
    std::erase_if(life_.events, [this](const Event& e) { return e.tick > finding_.tick; });
    if (Life calm = life_; (calm.logged = false, fails(calm))) life_ = calm;
    for (bool smaller = true; smaller;) {
      smaller = false;
      for (std::size_t chunk = std::max<std::size_t>(1, life_.events.size() / 2); chunk > 0;
           chunk /= 2)
        for (std::size_t at = 0; at + chunk <= life_.events.size();) {
          Life less = life_;
          less.events.erase(less.events.begin() + static_cast<std::ptrdiff_t>(at),
                            less.events.begin() + static_cast<std::ptrdiff_t>(at + chunk));
          if (fails(less)) {
            life_ = less;
            smaller = true;
          } else {
            at += chunk;
          }
        }
      for (std::size_t at = 0; at < life_.set.size();) {
        Life less = life_;
        less.set.erase(less.set.begin() + static_cast<std::ptrdiff_t>(at));
        if (fails(less)) {
          life_ = less;
          smaller = true;
        } else {
          ++at;
        }
      }
      // Orders sooner.
      for (std::size_t at = 1; at < life_.events.size(); ++at)
        for (const std::int64_t ticks : {1000, 100, 10}) {
          Life sooner = life_;
          if (sooner.events[at].tick - ticks < sooner.events[at - 1].tick + 1) continue;
          for (std::size_t i = at; i < sooner.events.size(); ++i) sooner.events[i].tick -= ticks;
          sooner.ticks -= ticks;
          if (fails(sooner)) {
            life_ = sooner;
            smaller = true;
          }
        }
    }
    return life_;
  }
  const Finding& finding() const { return finding_; }

 private:
  bool fails(const Life& life) {
    if (++tried_ > kMostTries) return false;
    try {
      const Outcome outcome = live(life, experimentOf(life, options_.config), options_);
      if (!outcome.finding || outcome.finding->law != finding_.law) return false;
      finding_ = *outcome.finding;
      return true;
    } catch (const InputError&) {
      return false;
    }
  }

  static constexpr int kMostTries = 500;
  const Options& options_;
  Life life_;
  Finding finding_;
  int tried_ = 0;
};

Outcome liveSeed(std::uint64_t seed, const Options& options) {
  try {
    const Life life = draw(seed, options.config);
    return live(life, experimentOf(life, options.config), options);
  } catch (const InputError& error) {
    Outcome out;  // every setting that is drawn is one that a person may choose
    out.finding = Finding{"configuration", 0, error.what()};
    return out;
  }
}

void tell(const Life& life, const Finding& finding, const std::string& file) {
  fmt::print("seed {}, tick {}: {}: {}\n  {}: {} event(s), {} setting(s), {} ticks\n", life.seed,
             finding.tick, finding.law, finding.what, file, life.events.size(), life.set.size(),
             life.ticks);
  std::fflush(stdout);
}

int runSeeds(const Options& options) {
  using Clock = std::chrono::steady_clock;
  const auto begin = Clock::now();
  const auto elapsed = [&] { return std::chrono::duration<double>(Clock::now() - begin).count(); };
  std::mutex mutex;
  std::map<std::uint64_t, Outcome> ended;  // by seed, until those before are counted
  std::uint64_t next = options.first, counted = options.first, hash = 0;
  Outcome sum;
  std::int64_t lives = 0, finds = 0;
  bool over = false;
  double said = 0.0;
  // In the order of the seeds: what is printed does not depend on who was quicker.
  const auto count = [&] {
    for (auto at = ended.find(counted); at != ended.end() && !over; at = ended.find(counted)) {
      const Outcome o = at->second;
      ended.erase(at);
      const std::uint64_t seed = counted++;
      ++lives;
      sum.seconds += o.seconds;
      sum.ticks += o.ticks;
      sum.stops += o.stops;
      sum.emulated += o.emulated;
      sum.compensated += o.compensated;
      hash = (hash ^ o.hash) * 0x100000001b3u;
      if (o.finding && o.finding->law == "configuration") {
        ++finds;
        over = !options.all;
        fmt::print("seed {}: configuration: {}\n", seed, o.finding->what);
      } else if (o.finding) {
        ++finds;
        Shrinker shrinker(options, draw(seed, options.config), *o.finding);
        const Life small = options.whole ? draw(seed, options.config) : shrinker.shrink();
        const fs::path file = options.out / fmt::format("swarm-{}.yaml", seed);
        std::ofstream(file) << write(
            small, fmt::format("{}: {}", shrinker.finding().law, shrinker.finding().what));
        fmt::print("found in tick {} of the life\n", o.finding->tick);
        tell(small, shrinker.finding(), file.string());
        over = !options.all;
      }
      const bool days = options.days > 0.0, wall = options.seconds > 0.0;
      if (days ? sum.seconds >= options.days * 86400.0
               : (wall ? elapsed() >= options.seconds : lives >= options.lives))
        over = true;
    }
    if (isatty(STDERR_FILENO) || elapsed() - said > 60.0) {
      said = elapsed();
      fmt::print(stderr, "{}{} lives, {:.3f} machine-days, {:.0f} x real time{}",
                 isatty(STDERR_FILENO) ? "\r  " : "  ", lives, sum.seconds / 86400.0,
                 sum.seconds / elapsed(), isatty(STDERR_FILENO) ? "" : "\n");
    }
  };
  const auto work = [&] {
    std::unique_lock lock(mutex);
    while (!over) {
      const std::uint64_t seed = next++;
      lock.unlock();
      const Outcome now = liveSeed(seed, options);
      lock.lock();
      ended[seed] = now;
      count();
    }
  };
  std::vector<std::thread> workers;
  for (unsigned w = 0; w < options.workers; ++w) workers.emplace_back(work);
  for (std::thread& worker : workers) worker.join();
  if (isatty(STDERR_FILENO)) fmt::print(stderr, "\n");
  fmt::print(
      "{} lives, {:.3f} machine-days, {:.2f} million ticks ({:.0f} % in admittance control, {:.0f} "
      "% "
      "of that compensated), {} stops; {} broke a law; hash "
      "{:016x}\n",
      lives, sum.seconds / 86400.0, 1e-6 * static_cast<double>(sum.ticks),
      100.0 * static_cast<double>(sum.emulated) / std::max(1.0, static_cast<double>(sum.ticks)),
      100.0 * static_cast<double>(sum.compensated) /
          std::max(1.0, static_cast<double>(sum.emulated)),
      sum.stops, finds, hash);
  return finds == 0 ? 0 : 1;
}

int runFiles(const std::vector<std::string>& files, const Options& options) {
  int broken = 0;
  for (const std::string& file : files) {
    const Life life = read(file);
    const Outcome o = live(life, experimentOf(life, options.config), options);
    if (o.finding) {
      ++broken;
      tell(life, *o.finding, file);
    } else {
      fmt::print("{}: no law broken in {} ticks\n", file, life.ticks);
    }
  }
  return broken == 0 ? 0 : 1;
}

}  // namespace
}  // namespace ves::swarm

int main(int argc, char** argv) {
  using namespace ves;
  swarm::Options options;
  std::vector<std::string> files;
  std::uint64_t show = 0;
  std::string config = VES_TEST_CONFIG_DIR;
  CLI::App cli("Whole lives of controller and machine, drawn from seeds, every law in every tick.",
               "swarm");
  cli.add_option("files", files, "lives to run, as a failing one left them");
  cli.add_option("--lives", options.lives, "so many");
  cli.add_option("--days", options.days, "or until so many days are simulated");
  cli.add_option("--seconds", options.seconds, "or for so long");
  cli.add_option("--seed", options.first, "the first");
  cli.add_option("--workers", options.workers)->check(CLI::Range(1, 256));
  cli.add_option("--out", options.out, "folder for lives that break a law");
  cli.add_option("--show", show, "the life of this seed");
  cli.add_option("--only", options.only, "look at this law alone");
  cli.add_flag("--all", options.all, "go on after a find");
  cli.add_flag("--whole", options.whole, "do not cut finds down");
  CLI11_PARSE(cli, argc, argv);
  options.config = config;
  options.scratch = std::filesystem::temp_directory_path() / fmt::format("ves-swarm-{}", getpid());
  std::filesystem::create_directories(options.scratch);
  std::filesystem::create_directories(options.out);
  int status = 2;
  try {
    if (show > 0) {
      fmt::print("{}", swarm::write(swarm::draw(show, config), ""));
      status = 0;
    } else {
      status = files.empty() ? swarm::runSeeds(options) : swarm::runFiles(files, options);
    }
  } catch (const std::exception& error) {
    fmt::print(stderr, "swarm: {}\n", error.what());
  }
  std::filesystem::remove_all(options.scratch);
  return status;
}
