// SPDX-License-Identifier: BSD-3-Clause
//
// ves view: a run in a browser, as it happens or from its log; or a log as one file.
#include "app.hpp"
#include "commands.hpp"
#include "ves/page/live_run.hpp"
#include "ves/page/page.hpp"
#include "ves/page/scene.hpp"
#include "ves/page/still.hpp"
#include "ves/series/series.hpp"

namespace ves::app {
namespace {

struct ViewOptions {
  std::vector<std::string> logs;
  std::string html, svg, scenario;
  MovingOptions moving{0.0, 1e9, 8.0};
  std::optional<double> rate;
  std::string url = kDefaultUrl, join, address = "127.0.0.1";
  std::optional<int> port;
  int listener = -1;
};

std::string recordedPage(const ViewOptions& options, double rate) {
  std::vector<nlohmann::ordered_json> recordings;
  for (const std::string& log : options.logs) {
    const Series series = seriesOf(log, options.scenario);
    std::vector<std::string> warnings;
    recordings.push_back(recording(series, rate, warnings));
    for (const std::string& warning : warnings) fmt::print(stderr, "warning: {}\n", warning);
  }
  return page(recordings);
}

int writePage(const ViewOptions& options) {
  constexpr double kSeen = 60.0;  // [1/s]
  const std::string text = recordedPage(options, options.rate.value_or(kSeen));
  writeGiven("--html", options.html, text);
  fmt::print("{} ({:.1f} MB): open it in a browser\n", options.html,
             static_cast<double>(text.size()) * 1e-6);
  return kDone;
}

int writeMoving(const ViewOptions& options) {
  const Series series = seriesOf(options.logs.front(), options.scenario);
  MovingOptions how = options.moving;
  how.rate = options.rate.value_or(how.rate);
  const std::string text = moving(series, how);
  writeGiven("--svg", options.svg, text);
  fmt::print("{} ({:.0f} kB)\n", options.svg, static_cast<double>(text.size()) * 1e-3);
  return kDone;
}

int servePage(const ViewOptions& options) {
  constexpr double kEveryTick = 1000.0;  // [1/s]
  catchSignals();
  const bool inherited = options.listener >= 0;
  const char* token = std::getenv(kViewToken);
  const Listener listener = inherited ? inheritedListener(options.listener, token ? token : "")
                                      : listenOn(options.address, options.port);
  joinIfNamed(options.join);  // browsers are outside of it
  std::optional<LiveRun> live;
  if (options.logs.empty()) live.emplace(options.url);
  WebServer server(listener,
                   live ? livePage() : recordedPage(options, options.rate.value_or(kEveryTick)),
                   live ? &*live : nullptr);
  if (!inherited) {
    fmt::print("{}\n", listener.url());
    if (listener.address.rfind("127.", 0) != 0)
      fmt::print(
          stderr,
          "warning: open to every machine that reaches {}:{}, not encrypted: whoever has this "
          "address sees the run{}\n",
          listener.address, listener.port, live ? " and can ask it to stop" : "");
    fmt::print(stderr, "open this address in a browser; Ctrl-C ends\n");
    std::fflush(stdout);
  }
  if (live) server.watch(live->descriptor(), [] {});
  while (!stop_requested) {
    server.serve(50);
    if (live && live->listen()) server.show();
  }
  const WebRefusals& refused = server.refusals();
  if (refused.total() > 0)
    fmt::print(
        stderr,
        "ves view: not let in: {} without the token, {} from elsewhere, {} malformed, {} too "
        "many\n",
        refused.token, refused.origin, refused.malformed, refused.full);
  return kDone;
}

}  // namespace

int viewCommand(int argc, char** argv) {
  CLI::App cli(
      "The run on the bus, or a recorded one, in a browser: platform, legs, robot, force, flexible "
      "arm, and where the base in free space would be. A second log is laid over the first.",
      "ves view");
  ViewOptions options;
  asLog(cli.add_option("log", options.logs,
                       "folders or LCM event logs of one run, or two; none: the run on the bus"))
      ->expected(0, 2);
  auto* html = cli.add_option("--html", options.html,
                              "write one file that a browser opens from disk, and serve nothing");
  auto* svg =
      cli.add_option("--svg", options.svg, "write a drawing that moves, for a page or a README")
          ->excludes(html);
  cli.add_option("--from", options.moving.from, "[s] of the log, for --svg")
      ->check(inRange(0.0, 1e9))
      ->needs(svg);
  cli.add_option("--to", options.moving.to, "[s]")->check(inRange(0.0, 1e9))->needs(svg);
  cli.add_option("--rate", options.rate,
                 "[1/s] pictures of a log; 60 in a file, 8 in a drawing, every tick in a browser")
      ->check(inRange(0.1, 1000.0));
  addScenarioOfLog(cli, options.scenario);
  addUrl(cli, options.url);
  addJoin(cli, options.join);
  cli.add_option("--port", options.port, "8780 by default, or a free one where that is taken")
      ->check(CLI::Range(0, 65535));
  cli.add_option("--bind", options.address, "address of this machine that browsers connect to")
      ->capture_default_str();
  cli.add_option("--listener", options.listener)->group("");  // for ves run --view
  return run(cli, argc, argv, [&] {
    if (html->count() + svg->count() == 0) return servePage(options);
    if (options.logs.empty() || (svg->count() > 0 && options.logs.size() > 1))
      throw InputError(svg->count() > 0 ? "--svg: want one log" : "--html: want a log");
    if (svg->count() > 0) return writeMoving(options);
    return writePage(options);
  });
}

}  // namespace ves::app
