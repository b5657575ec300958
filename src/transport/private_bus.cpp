// SPDX-License-Identifier: BSD-3-Clause
#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <net/if.h>
#include <net/route.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "ves/base/errors.hpp"
#include "ves/transport/bus.hpp"

namespace ves {
namespace {

void require(bool good, const char* what) {
  if (!good)
    throw InputError(
        fmt::format("--private-bus: {}: {}; this machine does not let a process have a "
                    "network of its own",
                    what, std::strerror(errno)));
}

void write(const char* file, const std::string& text) {
  std::ofstream out(file);
  out << text;
  out.flush();
  require(out.good(), file);
}

}  // namespace

void enterPrivateBus() {
  const uid_t user = geteuid();
  const gid_t group = getegid();
  require(unshare(CLONE_NEWUSER | CLONE_NEWNET) == 0, "unshare");
  write("/proc/self/setgroups", "deny");
  write("/proc/self/uid_map", fmt::format("0 {} 1", user));
  write("/proc/self/gid_map", fmt::format("0 {} 1", group));

  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  require(fd >= 0, "socket");
  ifreq lo{};
  std::strncpy(lo.ifr_name, "lo", sizeof lo.ifr_name - 1);
  require(ioctl(fd, SIOCGIFFLAGS, &lo) == 0, "lo");
  lo.ifr_flags = static_cast<short>(lo.ifr_flags | IFF_UP | IFF_RUNNING | IFF_MULTICAST);
  require(ioctl(fd, SIOCSIFFLAGS, &lo) == 0, "lo up");

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
