// SPDX-License-Identifier: BSD-3-Clause
//
// The page as a film, or a picture for print: frames through a Chromium without a window.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace ves {

struct FilmOptions {
  double from = 0.0, to = 1e9;     // [s] of the run
  double rate = 25.0;              // [1/s] pictures
  double speed = 1.0;              // [-] of real time
  int width = 1280, height = 720;  // [px]
  std::string look = "iso";        // front, side, top, arm
};

/// Gone, with what is in it, when this is.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// `page` is a file that view --html wrote. The kind of film is the name's ending, as ffmpeg knows
/// them (.mp4, .webm, .gif). `seen` is told how many pictures of how many are done; false ends it.
/// Throws InputError where Chromium or ffmpeg is missing or fails.
void film(const std::filesystem::path& page, const std::filesystem::path& to,
          const FilmOptions& options, const std::function<bool(int, int)>& seen);

/// The page at that time, 300 dots an inch, as the bytes of a PNG.
std::string print(const std::filesystem::path& page, double at, const FilmOptions& options);

}  // namespace ves
