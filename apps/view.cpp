// SPDX-License-Identifier: BSD-3-Clause
//
// ves view: a recorded run to look at, as one file for a browser.
#include <fstream>

#include "app.hpp"
#include "commands.hpp"
#include "ves/results/series.hpp"
#include "ves/view/page.hpp"
#include "ves/view/scene.hpp"

namespace ves::app {

int viewCommand(int argc, char** argv) {
  CLI::App cli(
      "A recorded run in three dimensions: platform, legs, robot, force, and where the base in "
      "free "
      "space would be; as one file that a browser opens from disk. A second log is laid over it.",
      "ves view");
  std::vector<std::string> logs;
  std::string html;
  double rate = 60.0;
  cli.add_option("log", logs, "LCM event logs of one run, or two")->required()->expected(1, 2);
  cli.add_option("--html", html, "file to write; view.html beside the log by default");
  cli.add_option("--rate", rate, "[1/s] pictures")->check(inRange(0.1, 1000.0));
  return run(cli, argc, argv, [&] {
    std::vector<nlohmann::ordered_json> recordings;
    for (const std::string& log : logs) {
      const Series series = readSeries(log);
      printDamage(series.damage);
      recordings.push_back(recording(series, rate));
    }
    const std::string text = page(recordings);
    const std::filesystem::path file =
        html.empty() ? std::filesystem::path(logs.front()).parent_path() / "view.html"
                     : std::filesystem::path(html);
    std::ofstream out(file, std::ios::binary);
    out << text;
    out.close();
    if (!out) throw InputError(fmt::format("--html {}: {}", file.string(), std::strerror(errno)));
    fmt::print("{} ({:.1f} MB): open it in a browser\n", file.string(),
               static_cast<double>(text.size()) * 1e-6);
    return kDone;
  });
}

}  // namespace ves::app
