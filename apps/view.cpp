// SPDX-License-Identifier: BSD-3-Clause
//
// ves view: a run in a browser, as it happens or from its log; or a log as one file.
#include <fmt/format.h>

#include "commands.hpp"
#include "logs.hpp"
#include "options.hpp"
#include "outputs.hpp"
#include "ves/page/film.hpp"
#include "ves/page/live_run.hpp"
#include "ves/page/page.hpp"
#include "ves/page/scene.hpp"
#include "ves/page/still.hpp"
#include "ves/realtime/realtime.hpp"
#include "ves/series/series.hpp"

namespace ves::app {
namespace {

struct ViewOptions {
  std::vector<std::string> logs;
  std::string html, svg, video, png, scenario;
  FilmOptions film;
  double at = 0.0;  // [s] of --png
  MovingOptions moving{0.0, 1e9, 8.0};
  std::optional<double> rate;
  std::string url = kDefaultUrl, join, address = "127.0.0.1";
  std::optional<int> port;
  int listener = -1, ready = -1;
  std::string results;
};

/// What a legend calls it: the run's folder, or the log's own name.
std::string nameOfLog(const std::string& log) {
  const std::filesystem::path path(log);
  return path.filename() == "run.lcmlog" && path.has_parent_path()
             ? path.parent_path().filename().string()
             : path.filename().string();
}

std::string recordedPage(const ViewOptions& options, double rate) {
  std::vector<nlohmann::ordered_json> recordings;
  for (const std::string& log : options.logs) {
    const Series series = seriesOf(log, options.scenario);
    std::vector<std::string> warnings;
    recordings.push_back(recording(series, rate, warnings));
    recordings.back()["scene"]["label"] = nameOfLog(log);
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

/// The page in a file of its own while it is filmed.
class PageFile {
 public:
  explicit PageFile(const std::string& text) { writeGiven("page", path().string(), text); }
  std::filesystem::path path() const { return folder_.path() / "page.html"; }

 private:
  TemporaryFolder folder_;
};

int writeFilm(ViewOptions options) {
  options.film.from = options.moving.from;
  options.film.to = options.moving.to;
  options.film.rate = options.rate.value_or(options.film.rate);
  catchSignals();
  const PageFile page(recordedPage(options, options.film.rate / options.film.speed));
  const std::string ending = std::filesystem::path(options.video).extension();
  requireReplaceable("--video", options.video,
                     ending == ".gif"    ? std::string_view("GIF8")
                     : ending == ".webm" ? std::string_view("\x1A\x45\xDF\xA3")
                                         : std::string_view("\0\0\0", 3));
  const bool terminal = isatty(STDERR_FILENO);
  int done = 0;
  film(page.path(), options.video, options.film, [&](int count, int of) {
    if (terminal) fmt::print(stderr, "\rpicture {} of {}", count, of);
    done = count;
    return stop_requested == 0;
  });
  if (terminal) fmt::print(stderr, "\r{:40}\r", "");
  fmt::print("{}: {} pictures, {:.1f} s ({:.1f} MB)\n", options.video, done,
             done / options.film.rate,
             static_cast<double>(std::filesystem::file_size(options.video)) * 1e-6);
  return kDone;
}

int writePrint(const ViewOptions& options) {
  constexpr double kEveryTick = 1000.0;  // [1/s]
  catchSignals();
  const double end = seriesOf(options.logs.front(), options.scenario).rows.back().t;
  if (options.at > end)
    throw InputError(fmt::format("--at {}: the log ends at {:.6g} s", options.at, end));
  const PageFile page(recordedPage(options, kEveryTick));
  writeGiven("--png", options.png, print(page.path(), options.at, options.film));
  fmt::print("{}: 300 dots an inch\n", options.png);
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
  if (options.logs.empty()) live.emplace(options.url, options.results);
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
          listener.address, listener.port,
          live ? "; can stop it, and push and change it where it is simulated" : "");
    fmt::print(stderr, "open this address in a browser; Ctrl-C ends\n");
    std::fflush(stdout);
  }
  if (live) server.watch(live->descriptor(), [] {});
  int ready = options.ready;
  constexpr std::int64_t kTail = 5'000'000'000;  // [ns] for a slow page to see the end
  std::int64_t asked = 0;
  const auto goesOn = [&] {
    if (!stop_requested) return true;
    if (asked == 0) asked = monotonicNow();
    return live && !server.shownAll() && monotonicNow() - asked < kTail;
  };
  while (goesOn()) {
    server.serve(50);
    if (ready >= 0 && server.pages() > 0) {  // who waits for it may begin
      if (::write(ready, "1", 1) < 0) fmt::print(stderr, "ves view: nobody waits\n");
      close(std::exchange(ready, -1));
    }
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
      "arm, and where the base in free space would be. Further logs are laid over the first.",
      "ves view");
  ViewOptions options;
  asLog(cli.add_option("log", options.logs,
                       "folders or LCM event logs of up to four runs; none: the run on the bus"))
      ->expected(0, 4);
  auto* html = cli.add_option("--html", options.html,
                              "write one file that a browser opens from disk, and serve nothing")
                   ->check(endsWith({".html"}));
  auto* svg =
      cli.add_option("--svg", options.svg, "write a drawing that moves, for a page or a README")
          ->check(endsWith({".svg"}))
          ->excludes(html);
  auto* video = cli.add_option("--video", options.video,
                               "write a film of the page: .mp4, .webm, .gif (Chromium, ffmpeg)")
                    ->check(endsWith({".mp4", ".webm", ".gif"}))
                    ->excludes(html)
                    ->excludes(svg);
  auto* png = cli.add_option("--png", options.png, "write a picture of the page for print, 300 dpi")
                  ->check(endsWith({".png"}))
                  ->excludes(html)
                  ->excludes(svg)
                  ->excludes(video);
  cli.add_option("--at", options.at, "[s] of the log, for --png")
      ->check(inRange(0.0, 1e9))
      ->needs(png);
  cli.add_option("--from", options.moving.from, "[s] of the log, for --svg and --video")
      ->check(inRange(0.0, 1e9));
  cli.add_option("--to", options.moving.to, "[s] of it")->check(inRange(0.0, 1e9));
  cli.add_option("--speed", options.film.speed, "[-] of real time, for --video")
      ->check(inRange(0.01, 100.0))
      ->needs(video);
  cli.add_option("--look", options.film.look, "from where, for --video and --png")
      ->check(CLI::IsMember({"iso", "front", "side", "top", "arm"}));
  cli.add_option("--rate", options.rate,
                 "[1/s] pictures: 60 in a page, 25 in a film, 8 in a drawing, every tick in a "
                 "browser")
      ->check(inRange(0.1, 1000.0));
  addScenarioOfLog(cli, options.scenario);
  addUrl(cli, options.url);
  addJoin(cli, options.join);
  cli.add_option("--port", options.port, "8780 by default, or a free one where that is taken")
      ->check(CLI::Range(0, 65535));
  cli.add_option("--bind", options.address, "address of this machine that browsers connect to")
      ->capture_default_str();
  cli.add_option("--listener", options.listener)->group("");  // for ves run --view
  cli.add_option("--ready", options.ready)->group("");
  cli.add_option("--results", options.results)->group("");
  return run(cli, argc, argv, [&] {
    const CLI::Option* files[] = {html, svg, video, png};
    const auto* file = std::find_if(std::begin(files), std::end(files),
                                    [](const CLI::Option* o) { return o->count() > 0; });
    if (file == std::end(files)) {
      refuse(cli, {"--from", "--to", "--look"}, "in a browser");
      if (options.logs.empty())
        refuse(cli, {"--rate", "--scenario"}, "without a log");
      else
        refuse(cli, {"--url", "--join"}, "beside a log");
      return servePage(options);
    }
    const std::string beside = "beside " + (*file)->get_name();
    if (*file != svg && *file != video) refuse(cli, {"--from", "--to"}, beside);
    if (*file != video && *file != png) refuse(cli, {"--look"}, beside);
    if (*file == png) refuse(cli, {"--rate"}, beside);
    refuse(cli, {"--url", "--join", "--port", "--bind"}, beside);
    if (options.logs.empty() || (*file == svg && options.logs.size() > 1))
      throw InputError(
          fmt::format("{}: want {} log", (*file)->get_name(), *file == svg ? "one" : "a"));
    if (*file == svg) return writeMoving(options);
    return *file == video ? writeFilm(options)
           : *file == png ? writePrint(options)
                          : writePage(options);
  });
}

}  // namespace ves::app
