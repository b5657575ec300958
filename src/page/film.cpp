// SPDX-License-Identifier: BSD-3-Clause
#include "ves/page/film.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>
#include <zlib.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "ves/core/errors.hpp"

namespace ves {
namespace {

using Answer = nlohmann::json;

constexpr int kPatience = 60'000;  // [ms] for an answer

std::string inPath(std::initializer_list<const char*> names) {
  const char* path = std::getenv("PATH");
  std::string folders = path ? path : "/usr/bin:/bin";
  for (std::size_t at = 0; at <= folders.size();) {
    const std::size_t end = std::min(folders.find(':', at), folders.size());
    for (const char* name : names) {
      const std::string file = folders.substr(at, end - at) + "/" + name;
      if (access(file.c_str(), X_OK) == 0) return file;
    }
    at = end + 1;
  }
  throw InputError(
      fmt::format("{}: missing, want it installed: apt install chromium ffmpeg", *names.begin()));
}

std::string bytesOf(const std::string& base64) {
  std::string out;
  std::uint32_t word = 0;
  int bits = 0;
  for (const char c : base64) {
    const int digit = c >= 'A' && c <= 'Z'   ? c - 'A'
                      : c >= 'a' && c <= 'z' ? c - 'a' + 26
                      : c >= '0' && c <= '9' ? c - '0' + 52
                      : c == '+'             ? 62
                      : c == '/'             ? 63
                                             : -1;
    if (digit < 0) break;
    word = word << 6 | static_cast<std::uint32_t>(digit);
    if ((bits += 6) < 8) continue;
    bits -= 8;
    out += static_cast<char>(word >> bits & 255u);
  }
  return out;
}

/// A child with pipes to it; ended with this.
class Child {
 public:
  /// `to` and `from` are its descriptors at the other ends; -1: none.
  Child(const std::vector<std::string>& words, int to, int from) {
    int down[2] = {-1, -1}, up[2] = {-1, -1};
    if (pipe2(down, O_CLOEXEC) != 0 || (from >= 0 && pipe2(up, O_CLOEXEC) != 0))
      throw InputError("no pipe to be had");
    std::vector<char*> argv;
    for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
    argv.push_back(nullptr);
    pid_ = fork();
    if (pid_ == 0) {
      setpgid(0, 0);
      const int nowhere = open("/dev/null", O_RDWR);
      // Out of the way of the numbers that the child wants.
      const int in = fcntl(down[0], F_DUPFD, 10), out = from >= 0 ? fcntl(up[1], F_DUPFD, 10) : -1;
      for (const int fd : {STDIN_FILENO, STDOUT_FILENO}) dup2(nowhere, fd);
      dup2(nowhere, STDERR_FILENO);  // of their complaints one line is ours
      dup2(in, to);
      if (from >= 0) dup2(out, from);
      execv(argv[0], argv.data());
      _exit(127);
    }
    setpgid(pid_, pid_);  // whoever comes first
    ::close(down[0]);
    if (from >= 0) ::close(up[1]);
    to_ = down[1];
    from_ = up[0];
  }
  ~Child() { end(); }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  bool write(const std::string& bytes) const {
    for (std::size_t at = 0; at < bytes.size();) {
      const ssize_t n = ::write(to_, bytes.data() + at, bytes.size() - at);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) return false;
      at += static_cast<std::size_t>(n);
    }
    return true;
  }
  void closeInput() {
    if (to_ >= 0) ::close(to_);
    to_ = -1;
  }
  /// With all that it has started.
  void end() {
    closeInput();
    if (from_ >= 0) ::close(std::exchange(from_, -1));
    if (pid_ <= 0) return;
    kill(-pid_, SIGTERM);
    waitpid(std::exchange(pid_, -1), nullptr, 0);
  }
  /// Its exit status, when it has ended by itself.
  int wait() {
    int status = 0;
    while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  int output() const { return from_; }

 private:
  pid_t pid_ = -1;
  int to_ = -1, from_ = -1;
};

/// Chromium by its DevTools protocol: messages that end with a zero byte, on descriptors 3 and 4.
class Browser {
 public:
  Browser(const std::filesystem::path& page, const FilmOptions& options, double scale)
      // Without a graphics card WebGL is emulated, and charts rastered by that emulator hold the
      // page up.
      : child_({inPath({"chromium", "chromium-browser", "google-chrome"}), "--headless=new",
                "--remote-debugging-pipe", "--no-sandbox", "--use-angle=swiftshader",
                "--enable-unsafe-swiftshader", "--disable-gpu-rasterization",
                "--disable-accelerated-2d-canvas", "--disable-dev-shm-usage", "--hide-scrollbars",
                "--user-data-dir=" + (folder_.path() / "profile").string(), "about:blank"},
               3, 4) {
    const Answer target = call("Target.createTarget", {{"url", "about:blank"}});
    const Answer session =
        call("Target.attachToTarget", {{"targetId", target["targetId"]}, {"flatten", true}});
    session_ = session["sessionId"].get<std::string>();
    call("Emulation.setDeviceMetricsOverride", {{"width", options.width},
                                                {"height", options.height},
                                                {"deviceScaleFactor", scale},
                                                {"mobile", false}});
    call("Page.navigate", {{"url", "file://" + std::filesystem::absolute(page).string()}});
    constexpr int kTries = 600;  // [-] of 0.1 s
    for (int i = 0; evaluate("window.ves !== undefined && ves.count > 0") != true; ++i) {
      if (i == kTries) throw InputError("Chromium does not show the page: it may be without WebGL");
      poll(nullptr, 0, 100);
    }
    if (options.look == "arm" && evaluate("VES_RECORDINGS[0].scene.arm.length > 1") != true)
      throw InputError("--look arm: there is no arm in this run");
    evaluate(
        fmt::format("document.body.classList.add('film'); window.dispatchEvent(new "
                    "Event('resize')); ves.look('{}'); 0",
                    options.look));
  }
  ~Browser() { child_.end(); }  // before its folder goes

  Answer evaluate(const std::string& script) {
    const Answer answer =
        call("Runtime.evaluate", {{"expression", script}, {"returnByValue", true}});
    return answer["result"].value("value", Answer());
  }
  std::string shot(double t, const char* format) {
    evaluate(fmt::format("ves.film({})", t));
    Answer how = {{"format", format}};
    if (format == std::string("jpeg")) how["quality"] = 92;
    return bytesOf(call("Page.captureScreenshot", how)["data"].get<std::string>());
  }

 private:
  Answer call(const char* method, const Answer& parameters) {
    Answer message = {{"id", ++asked_}, {"method", method}, {"params", parameters}};
    if (!session_.empty()) message["sessionId"] = session_;
    if (!child_.write(message.dump() + '\0')) throw InputError("Chromium has ended");
    for (;;) {
      const Answer answer = Answer::parse(next(), nullptr, false);
      if (answer.is_discarded() || answer.value("id", -1) != asked_) continue;
      if (answer.contains("error"))
        throw InputError(fmt::format("Chromium: {}: {}", method,
                                     answer["error"].value("message", std::string())));
      return answer["result"];
    }
  }
  std::string next() {
    for (;;) {
      if (const std::size_t end = heard_.find('\0'); end != std::string::npos) {
        std::string out = heard_.substr(0, end);
        heard_.erase(0, end + 1);
        return out;
      }
      pollfd wait{child_.output(), POLLIN, 0};
      std::array<char, 65536> piece;
      const int ready = poll(&wait, 1, kPatience);
      if (ready < 0 && errno == EINTR) continue;  // the picture in hand is finished first
      const ssize_t n = ready > 0 ? read(child_.output(), piece.data(), piece.size()) : 0;
      if (n <= 0) throw InputError("Chromium does not answer");
      heard_.append(piece.data(), static_cast<std::size_t>(n));
    }
  }

  TemporaryFolder folder_;
  Child child_;
  std::string session_, heard_;
  int asked_ = 0;
};

void put(std::string& out, std::uint32_t number) {
  for (int shift = 24; shift >= 0; shift -= 8) out += static_cast<char>(number >> shift & 255u);
}

/// A PNG that says how large a dot is (chunk pHYs, behind the header of 33 bytes).
std::string withResolution(const std::string& png, double dots_per_inch) {
  constexpr std::size_t kHeader = 33;
  const auto per_metre = static_cast<std::uint32_t>(std::lround(dots_per_inch / 0.0254));
  std::string chunk = "pHYs";
  put(chunk, per_metre);
  put(chunk, per_metre);
  chunk += '\1';  // metres
  std::string framed;
  put(framed, 9);
  framed += chunk;
  put(framed, static_cast<std::uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(chunk.data()),
                                               static_cast<uInt>(chunk.size()))));
  return png.substr(0, kHeader) + framed + png.substr(kHeader);
}

}  // namespace

TemporaryFolder::TemporaryFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "ves-XXXXXX").string();
  if (!mkdtemp(name.data())) throw InputError("no folder for temporary files");
  path_ = name;
}
TemporaryFolder::~TemporaryFolder() {
  std::error_code error;
  std::filesystem::remove_all(path_, error);
}

void film(const std::filesystem::path& page, const std::filesystem::path& to,
          const FilmOptions& options, const std::function<bool(int, int)>& seen) {
  const std::filesystem::path folder = to.has_parent_path() ? to.parent_path() : ".";
  const std::string kind = to.extension();
  if (kind != ".mp4" && kind != ".webm" && kind != ".gif")
    throw InputError(
        fmt::format("{}: want a name that ends with .mp4, .webm or .gif", to.string()));
  if (access(folder.c_str(), W_OK) != 0)
    throw InputError(fmt::format("{}: cannot be written", to.string()));
  const std::string ffmpeg = inPath({"ffmpeg"});
  Browser browser(page, options, 1.0);
  const double end = std::min(options.to, browser.evaluate("ves.end()").get<double>());
  if (!(end > options.from))
    throw InputError(fmt::format("nothing between {} and {} s", options.from, end));
  const int count =
      1 + static_cast<int>((end - options.from) / options.speed * options.rate + 1e-9);
  std::vector<std::string> words = {
      ffmpeg, "-loglevel",  "error",      "-y",
      "-f",   "image2pipe", "-framerate", fmt::format("{}", options.rate),
      "-c:v", "mjpeg",      "-i",         "pipe:0"};
  if (kind == ".mp4")  // players that know one kind of colours
    words.insert(words.end(), {"-pix_fmt", "yuv420p", "-movflags", "+faststart"});
  words.push_back(to.string());
  Child encoder(words, STDIN_FILENO, -1);
  for (int i = 0; i < count; ++i) {
    const double t = options.from + i / options.rate * options.speed;
    if (!encoder.write(browser.shot(t, "jpeg"))) break;
    if (!seen(i + 1, count)) break;
  }
  encoder.closeInput();
  if (encoder.wait() != 0) throw InputError(fmt::format("{}: ffmpeg failed", to.string()));
}

std::string print(const std::filesystem::path& page, double at, const FilmOptions& options) {
  constexpr double kPrinted = 300.0, kSeen = 96.0;  // [1/inch] dots, and pixels of a style sheet
  Browser browser(page, options, kPrinted / kSeen);
  return withResolution(browser.shot(at, "png"), kPrinted);
}

}  // namespace ves
