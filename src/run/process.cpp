// SPDX-License-Identifier: BSD-3-Clause
#include "ves/run/process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "ves/core/errors.hpp"

namespace ves {

Process::Process(const std::filesystem::path& program, const std::vector<std::string>& arguments) {
  std::vector<char*> argv;
  std::string name = program.string();
  argv.push_back(name.data());
  std::vector<std::string> copies = arguments;
  for (std::string& argument : copies) argv.push_back(argument.data());
  argv.push_back(nullptr);
  const pid_t parent = getpid();
  pid_ = fork();
  if (pid_ < 0) throw InputError(fmt::format("{}: cannot be started: {}", name, strerror(errno)));
  if (pid_ > 0) return;
  setpgid(0, 0);  // a Ctrl-C on the terminal is ours to interpret
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(1);
  const int nothing = open("/dev/null", O_RDONLY);
  if (nothing >= 0) dup2(nothing, STDIN_FILENO);
  execv(name.c_str(), argv.data());
  fmt::print(stderr, "{}: cannot be started: {}\n", name, strerror(errno));
  _exit(127);
}

Process::~Process() {
  if (running()) {
    signal(SIGTERM);
    wait();
  }
}

int Process::wait() {
  if (pid_ > 0) waitpid(pid_, &status_, 0);
  pid_ = 0;
  return status();
}

bool Process::running() {
  if (pid_ > 0 && waitpid(pid_, &status_, WNOHANG) == pid_) pid_ = 0;
  return pid_ > 0;
}

void Process::signal(int number) {
  if (pid_ > 0) kill(pid_, number);
}

int Process::status() const {
  return WIFEXITED(status_) ? WEXITSTATUS(status_) : -WTERMSIG(status_);
}

}  // namespace ves
