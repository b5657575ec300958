// SPDX-License-Identifier: BSD-3-Clause
//
// What a browser sends: HTTP (first byte even), or frames of a web socket behind a good handshake.
// Another page goes on getting every picture.
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <string>

#include "bytes.hpp"
#include "ves/page/web_server.hpp"

namespace {

struct Pictures : ves::LiveSource {
  std::int64_t edition() const override { return 1; }
  const std::string& scene() const override { return scene_; }
  std::int64_t newest() const override { return number; }
  std::string pictures(std::int64_t, std::int64_t&) const override { return std::string(100, 'x'); }
  void take(const ves::PageMessage&) override {}
  std::int64_t number = 1;
  std::string scene_ = "{}";
};

class Rig {
 public:
  Rig() : listener_(ves::listenOn("127.0.0.1", 0)), server(listener_, "page", &pictures) {}

  std::string handshake() const {
    const std::string host = listener_.address + ":" + std::to_string(listener_.port);
    return "GET /?token=" + listener_.token + " HTTP/1.1\r\nHost: " + host +
           "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
           "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: ves\r\n"
           "Origin: http://" +
           host + "\r\n\r\n";
  }
  int connect() {
    int pair[2];
    ves::fuzz::require(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair) == 0);
    server.adopt(pair[0]);
    return pair[1];
  }
  void write(int fd, const std::string& bytes) {
    for (std::size_t at = 0; at < bytes.size(); at += 4096) {
      const std::size_t n = std::min<std::size_t>(4096, bytes.size() - at);
      if (::send(fd, bytes.data() + at, n, MSG_NOSIGNAL) < 0) break;
      for (int i = 0; i < 3; ++i) server.serve(0);
    }
    for (int i = 0; i < 4; ++i) server.serve(0);
  }
  static std::string heard(int fd) {
    std::string out;
    char buffer[4096];
    for (ssize_t n; (n = ::recv(fd, buffer, sizeof buffer, 0)) > 0;)
      out.append(buffer, static_cast<std::size_t>(n));
    return out;
  }

  Pictures pictures;
  ves::Listener listener_;
  ves::WebServer server;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Rig rig;
  if (size == 0) return 0;
  const std::string bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  const int good = rig.connect(), fd = rig.connect();
  rig.write(good, rig.handshake());
  if (data[0] % 2 == 1) rig.write(fd, rig.handshake());
  rig.write(fd, bytes);
  close(fd);
  rig.heard(good);
  ++rig.pictures.number;
  rig.write(good, std::string("\x81\x85\0\0\0\0drawn", 11));
  rig.server.show();
  for (int i = 0; i < 4; ++i) rig.server.serve(0);
  ves::fuzz::require(rig.heard(good).find("xxx") != std::string::npos);
  ves::fuzz::require(rig.server.pages() <= 2);
  close(good);
  for (int i = 0; i < 4; ++i) rig.server.serve(0);
  return 0;
}
