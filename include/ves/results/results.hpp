// SPDX-License-Identifier: BSD-3-Clause
//
// The folder that a run leaves, and the line that shows how far it is.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "ves/run/run.hpp"

namespace ves {

/// Where a run leaves what it found. Throws InputError when the folder cannot be made.
std::filesystem::path makeFolder(const std::filesystem::path& folder);
/// The same, and this process's alone until it ends. Throws InputError while another one has it.
std::filesystem::path claimFolder(const std::filesystem::path& folder);
/// A folder of this name that did not exist before; or NAME-2, NAME-3, ... Claimed.
std::filesystem::path claimNewFolder(const std::filesystem::path& folder);

/// From folder/run.lcmlog: series.csv, summary.json, and the plots when wanted. Returns the table.
std::string writeResults(const std::filesystem::path& folder, const RunResult& result, bool plots);

/// One line that tells how far a run is; empty when nothing has changed since the last call.
class Progress {
 public:
  explicit Progress(const Experiment& experiment) : experiment_(experiment) {}
  void show(Phase phase, int segment, std::int64_t tick, const double (&x)[6]);
  void end();

 private:
  const Experiment& experiment_;
  std::int64_t shown_at_ = -1;  // [ns] wall clock
  Phase phase_ = Phase::kDisarmed;
  int segment_ = -1;
  bool open_ = false;    // a line without its end stands on the terminal
  bool headed_ = false;  // the columns have been named
};

}  // namespace ves
