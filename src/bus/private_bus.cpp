// SPDX-License-Identifier: BSD-3-Clause
#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <net/if.h>
#include <net/route.h>
#include <sched.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "ves/bus/bus.hpp"
#include "ves/core/errors.hpp"

namespace ves {
namespace {

/// An open file that goes with its scope.
struct File {
  int descriptor = -1;
  File(const std::string& name, int flags)
      : descriptor(open(name.c_str(), flags | O_CLOEXEC, 0600)) {}
  ~File() {
    if (descriptor >= 0) close(descriptor);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
};

/// Tells networks apart; 0: no such process.
ino_t networkOf(const std::string& process) {
  struct stat info {};
  return stat(("/proc/" + process + "/ns/net").c_str(), &info) == 0 ? info.st_ino : 0;
}

/// Who is on which private bus is kept here, for this user alone.
std::string registry() {
  const char* runtime = std::getenv("XDG_RUNTIME_DIR");
  const std::string folder =
      runtime && *runtime ? std::string(runtime) + "/ves" : fmt::format("/tmp/ves-{}", geteuid());
  struct stat info {};
  if (mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST)
    throw InputError(fmt::format("--join: {}: {}", folder, std::strerror(errno)));
  if (lstat(folder.c_str(), &info) != 0 || !S_ISDIR(info.st_mode) || info.st_uid != geteuid() ||
      (info.st_mode & (S_IRWXG | S_IRWXO)))
    throw InputError(fmt::format("--join: {}: want a folder that only this user can use", folder));
  return folder;
}

void require(bool good, const char* what) {
  if (!good)
    throw InputError(
        fmt::format("private bus: {}: {}; this machine does not let a process have a "
                    "network of its own",
                    what, std::strerror(errno)));
}

void write(const char* file, const std::string& text) {
  std::ofstream out(file);
  out << text;
  out.flush();
  require(out.good(), file);
}

/// Into the network of a process; false when it ended meanwhile.
bool enterNetworkOf(const std::string& process) {
  const File user("/proc/" + process + "/ns/user", O_RDONLY);
  const File network("/proc/" + process + "/ns/net", O_RDONLY);
  if (user.descriptor < 0 || network.descriptor < 0) return false;
  struct stat its;
  struct stat ours;
  const bool own = fstat(user.descriptor, &its) == 0 && stat("/proc/self/ns/user", &ours) == 0 &&
                   its.st_ino == ours.st_ino;
  require(own || setns(user.descriptor, CLONE_NEWUSER) == 0, "its users");
  require(setns(network.descriptor, CLONE_NEWNET) == 0, "its network");
  return true;
}

bool raiseLoopback() {
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return false;
  ifreq lo{};
  std::strncpy(lo.ifr_name, "lo", sizeof lo.ifr_name - 1);
  bool up = ioctl(fd, SIOCGIFFLAGS, &lo) == 0;
  lo.ifr_flags = static_cast<short>(lo.ifr_flags | IFF_UP | IFF_RUNNING | IFF_MULTICAST);
  up = up && ioctl(fd, SIOCSIFFLAGS, &lo) == 0;
  close(fd);
  return up;
}

}  // namespace

void joinPrivateBus(const std::string& name) {
  if (name.empty() || name.size() > 64 ||
      name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-") !=
          std::string::npos)
    throw InputError(fmt::format("--join '{}': want letters, digits, _ and -", name));
  const std::string path = registry() + "/" + name;
  const File lock(path + ".lock", O_RDWR | O_CREAT);
  require(lock.descriptor >= 0 && flock(lock.descriptor, LOCK_EX) == 0, path.c_str());
  // Of those that were here, who still is: a number that another process has now is in another
  // network.
  std::ifstream in(path);
  std::string process, here;
  bool joined = false;
  for (ino_t network; in >> process >> network;) {
    if (networkOf(process) != network) continue;
    here += fmt::format("{} {}\n", process, network);
    joined = joined || enterNetworkOf(process);
  }
  in.close();
  if (!joined) {
    here.clear();
    enterPrivateBus();
  }
  write(path.c_str(), here + fmt::format("{} {}\n", getpid(), networkOf("self")));
}

void enterPrivateBus() {
  const uid_t user = geteuid();
  const gid_t group = getegid();
  // Who may, keeps his own users, and with them the right to real time.
  if (unshare(CLONE_NEWNET) != 0 || !raiseLoopback()) {
    require(unshare(CLONE_NEWUSER | CLONE_NEWNET) == 0, "unshare");
    write("/proc/self/setgroups", "deny");
    write("/proc/self/uid_map", fmt::format("0 {} 1", user));
    write("/proc/self/gid_map", fmt::format("0 {} 1", group));
    require(raiseLoopback(), "lo up");
  }

  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  require(fd >= 0, "socket");
  rtentry route{};
  const auto address = [](sockaddr& to, const char* text) {
    sockaddr_in in{};
    in.sin_family = AF_INET;
    in.sin_addr.s_addr = inet_addr(text);
    std::memcpy(&to, &in, sizeof in);
  };
  char device[] = "lo";
  address(route.rt_dst, "224.0.0.0");
  address(route.rt_genmask, "240.0.0.0");
  route.rt_flags = RTF_UP;
  route.rt_dev = device;
  require(ioctl(fd, SIOCADDRT, &route) == 0, "multicast route");
  close(fd);
}

}  // namespace ves
