// SPDX-License-Identifier: BSD-3-Clause
//
// Child processes.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace ves {

/// A child process that ends with us. A Ctrl-C on the terminal does not reach it.
class Process {
 public:
  /// Throws InputError when it cannot be started.
  Process(const std::filesystem::path& program, const std::vector<std::string>& arguments);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  bool running();
  void signal(int number);
  /// Until it has ended; its status.
  int wait();
  /// How an ended child ended: its exit status, or minus the signal.
  int status() const;

 private:
  pid_t pid_ = 0;
  int status_ = 0;
};

}  // namespace ves
