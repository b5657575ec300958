// SPDX-License-Identifier: BSD-3-Clause
//
// Who is let in to a page and its web socket, and what they get: requests and frames written by
// hand, as RFC 9112 and RFC 6455 have them.
#include "ves/page/web_server.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <random>
#include <vector>

namespace ves {
namespace {

/// Pictures are their numbers, a byte each.
struct Counted : LiveSource {
  std::int64_t edition() const override { return now; }
  const std::string& scene() const override { return text; }
  std::int64_t newest() const override { return picture; }
  std::string pictures(std::int64_t after, std::int64_t& last) const override {
    std::string out;
    for (std::int64_t i = after + 1; i <= picture; ++i) out += static_cast<char>(i);
    last = picture;
    return out;
  }
  void take(const PageMessage& message) override { taken.push_back(message); }

  std::int64_t now = 0, picture = 0;
  std::string text = "{\"scene\": 1}";
  std::vector<PageMessage> taken;
};

struct Served {
  explicit Served(bool lives = true)
      : listener(listenOn("127.0.0.1", 0)), server(listener, page(), lives ? &live : nullptr) {}
  /// More than goes at once, every byte of it known.
  static std::string page() {
    std::mt19937 random(5);
    std::string out(100'000, ' ');
    for (char& c : out) c = static_cast<char>('!' + random() % 90);
    return out;
  }
  std::string host() const { return fmt::format("127.0.0.1:{}", listener.port); }

  Counted live;
  Listener listener;
  WebServer server;
};

class Client {
 public:
  explicit Client(Served& served) : served_(served) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(served.listener.port));
    inet_pton(AF_INET, "127.0.0.1", &to.sin_addr);
    EXPECT_EQ(connect(fd_, reinterpret_cast<sockaddr*>(&to), sizeof to), 0);
  }
  ~Client() { close(fd_); }
  Client(const Client&) = delete;

  void send(const std::string& bytes) {
    std::size_t sent = 0;
    for (int i = 0; i < 2000 && sent < bytes.size(); ++i) {
      const ssize_t n =
          ::send(fd_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
      sent += static_cast<std::size_t>(std::max<ssize_t>(0, n));
      pump();
    }
  }
  /// Until so much has come, or the other end has closed.
  bool until(const std::function<bool()>& done) {
    for (int i = 0; i < 2000 && !done(); ++i) pump();
    return done();
  }
  bool ended() {
    return until([&] { return closed; });
  }
  std::string request(const std::string& path, const std::string& host, const char* method = "GET",
                      const std::string& more = "") {
    send(fmt::format("{} {} HTTP/1.1\r\nHost: {}\r\n{}\r\n", method, path, host, more));
    until([&] {
      const std::size_t head = got.find("\r\n\r\n"), size = got.find("content-length: ");
      return closed || (head != std::string::npos && size != std::string::npos &&
                        got.size() >= head + 4 + std::stoul(got.substr(size + 16)));
    });
    return got;
  }

  std::string got;
  bool closed = false;

  void pump() {
    served_.server.serve(1);
    char buffer[4096];
    for (ssize_t n; !closed && (n = recv(fd_, buffer, sizeof buffer, MSG_DONTWAIT)) != -1;) {
      closed = n == 0;
      got.append(buffer, static_cast<std::size_t>(n));
    }
  }

 private:
  Served& served_;
  int fd_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
};

/// What a handshake says beside the request's first lines.
std::string upgrade(const std::string& origin) {
  return (origin.empty() ? "" : "Origin: " + origin + "\r\n") +
         "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
         "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: ves\r\n";
}

/// A frame of RFC 6455, 5.2, with a mask of zeros.
std::string frame(const std::string& text, int opcode = 1, bool last = true) {
  std::string out(1, static_cast<char>((last ? 0x80 : 0) | opcode));
  if (text.size() < 126) {
    out += static_cast<char>(0x80 | text.size());
  } else {
    out += static_cast<char>(0x80 | 126);
    out += static_cast<char>(text.size() >> 8);
    out += static_cast<char>(text.size() & 255);
  }
  return out + std::string(4, '\0') + text;
}

/// A page's web socket, open.
struct Page : Client {
  explicit Page(Served& served) : Client(served) {
    send(fmt::format("GET /?token={} HTTP/1.1\r\nHost: {}\r\n{}\r\n", served.listener.token,
                     served.host(), upgrade("http://" + served.host())));
    until([&] { return got.find("\r\n\r\n") != std::string::npos; });
    EXPECT_EQ(got.rfind("HTTP/1.1 101", 0), 0u) << got;
    EXPECT_NE(got.find("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="), std::string::npos) << got;  // RFC 6455, 1.3
    got.erase(0, got.find("\r\n\r\n") + 4);
  }
  /// The next message: its opcode and what is in it.
  std::pair<int, std::string> read() {
    const auto size = [&] { return static_cast<std::size_t>(got[1] & 127); };
    if (!until([&] { return got.size() >= 2 && got.size() >= 2 + size(); })) return {-1, ""};
    const std::pair<int, std::string> out = {got[0] & 15, got.substr(2, size())};
    got.erase(0, 2 + size());
    return out;
  }
  /// Nothing comes in many rounds of the server's.
  bool quiet() {
    for (int i = 0; i < 50; ++i) pump();
    return got.empty();
  }
};

TEST(WebServer, ThePageGoesToWhoHasTheToken) {
  Served s;
  const std::string good = "/?token=" + s.listener.token;
  const std::string page = Client(s).request(good, s.host());
  EXPECT_EQ(page.rfind("HTTP/1.1 200", 0), 0u) << page.substr(0, 200);
  for (const char* line : {"default-src 'none'", "referrer-policy: no-referrer",
                           "cache-control: no-store", "x-content-type-options: nosniff",
                           "content-length: 100000", "content-type: text/html; charset=utf-8"})
    EXPECT_NE(page.find(line), std::string::npos) << line;
  EXPECT_EQ(page.substr(page.find("\r\n\r\n") + 4), Served::page());
  EXPECT_EQ(Client(s)
                .request(good, fmt::format("localhost:{}", s.listener.port))
                .rfind("HTTP/1.1 200", 0),
            0u);
  EXPECT_EQ(s.server.refusals().total(), 0);

  std::string other = s.listener.token;
  other.back() = other.back() == '0' ? '1' : '0';
  for (const std::string& path : {std::string("/"), "/?token=" + other, good + "0",
                                  good.substr(0, good.size() - 1), std::string("/?token=")})
    EXPECT_EQ(Client(s).request(path, s.host()).rfind("HTTP/1.1 403", 0), 0u) << path;
  EXPECT_EQ(s.server.refusals().token, 5);
  for (const std::string& host :
       {fmt::format("evil.example:{}", s.listener.port), std::string("127.0.0.1:1"),
        std::string("127.0.0.1"), std::string()})
    EXPECT_EQ(Client(s).request(good, host).rfind("HTTP/1.1 403", 0), 0u) << host;
  EXPECT_EQ(s.server.refusals().origin, 4);
  EXPECT_EQ(Client(s).request("/x?token=" + s.listener.token, s.host()).rfind("HTTP/1.1 404", 0),
            0u);
  EXPECT_EQ(s.server.refusals().malformed, 0);
  EXPECT_EQ(Client(s).request(good, s.host(), "POST", "Content-Length: 3\r\n").find("200 OK"),
            std::string::npos);
  EXPECT_GE(s.server.refusals().malformed, 1);
}

TEST(WebServer, ItsSocketIsOfItsOwnPageAlone) {
  const auto asked = [](Served& s, const std::string& token, const std::string& origin) {
    Client c(s);
    c.send(fmt::format("GET /?token={} HTTP/1.1\r\nHost: {}\r\n{}\r\n", token, s.host(),
                       upgrade(origin)));
    c.until([&] { return c.closed || c.got.find("\r\n\r\n") != std::string::npos; });
    return c.got.substr(0, 12);
  };
  Served s;
  const auto status = [&](const std::string& token, const std::string& origin) {
    return asked(s, token, origin);
  };
  const std::string own = "http://" + s.host();
  EXPECT_EQ(status(s.listener.token, own), "HTTP/1.1 101");
  for (const std::string& origin :
       {std::string("http://example.com"), std::string("http://127.0.0.1:1"), std::string(),
        "https://" + s.host(), own + "0"})
    EXPECT_NE(status(s.listener.token, origin), "HTTP/1.1 101") << origin;
  EXPECT_EQ(s.server.refusals().origin, 5);
  EXPECT_NE(status("0", own), "HTTP/1.1 101");
  EXPECT_EQ(s.server.refusals().token, 1);
  Served still(false);  // of a recorded run: nothing happens there
  EXPECT_NE(asked(still, still.listener.token, "http://" + still.host()), "HTTP/1.1 101");
  EXPECT_EQ(still.server.pages(), 0);
}

// A scene, then all pictures since; the next ones when it has drawn what it got.
TEST(WebServer, APageGetsWhatItHasDrawnTheLastOf) {
  Served s;
  Page page(s);
  EXPECT_EQ(s.server.pages(), 1);
  s.server.show();
  EXPECT_TRUE(page.quiet());  // there is no scene yet
  s.live.now = 1;
  s.live.picture = 3;
  s.server.show();
  EXPECT_EQ(page.read(), std::pair(1, s.live.text));
  EXPECT_TRUE(page.quiet());  // what is older than its scene
  s.live.picture = 5;
  EXPECT_FALSE(s.server.shownAll());
  s.server.show();
  EXPECT_EQ(page.read(), std::pair(2, std::string("\x04\x05")));
  EXPECT_FALSE(s.server.shownAll());  // sent, and not drawn
  s.live.picture = 9;
  s.server.show();
  EXPECT_TRUE(page.quiet());
  page.send(frame("drawn"));
  EXPECT_EQ(page.read(), std::pair(2, std::string("\x06\x07\x08\x09")));
  page.send(frame("drawn"));
  EXPECT_TRUE(page.quiet());
  EXPECT_TRUE(s.server.shownAll());
  s.live.now = 2;  // another run
  s.live.text = "{\"scene\": 2}";
  s.server.show();
  EXPECT_EQ(page.read(), std::pair(1, s.live.text));
  EXPECT_TRUE(s.live.taken.empty());
  {
    const Page another(s);
    EXPECT_EQ(s.server.pages(), 2);
  }
  EXPECT_TRUE(page.until([&] { return s.server.pages() == 1; }));
}

TEST(WebServer, OrdersArePassedOnWhereverTheyAreCut) {
  Served s;
  Page page(s);
  page.send(frame("stop 7"));
  for (const char c : frame("pace", 1, false) + frame(" 7 ", 0, false) + frame("2.5", 0))
    page.send(std::string(1, c));
  ASSERT_TRUE(page.until([&] { return s.live.taken.size() == 2; }));
  EXPECT_EQ(s.live.taken[0].edition, 7);
  EXPECT_TRUE(std::holds_alternative<PageMessage::Stop>(s.live.taken[0].what));
  EXPECT_EQ(std::get<PageMessage::Pace>(s.live.taken[1].what).rate, 2.5);
  EXPECT_EQ(s.server.refusals().total(), 0);
}

TEST(WebServer, AMessageOfNoMeaningEndsItsPage) {
  Served s;
  std::string flood;
  for (int i = 0; i <= WebServer::kMostMessages; ++i) flood += frame("drawn");
  std::string pieces = frame("drawn", 1, false);
  for (int i = 0; i < 60; ++i) pieces += frame("drawn", 0, false);
  int n = 0;
  for (const std::string& bytes : {frame("hello"), frame("drawn", 2), frame(std::string(300, 'x')),
                                   frame(""), flood, pieces}) {
    Page page(s);
    page.send(bytes);
    EXPECT_EQ(page.read(), std::pair(8, std::string("\x03\xf0"))) << n;  // 1008
    EXPECT_EQ(s.server.refusals().malformed, ++n);
  }
  EXPECT_TRUE(s.live.taken.empty());
  Page page(s);  // and as many as that are let pass
  page.send(flood.substr(frame("drawn").size()));
  EXPECT_TRUE(page.quiet());
}

TEST(WebServer, NoMoreThanSoManyAtATime) {
  Served s;
  std::vector<std::unique_ptr<Client>> crowd;
  for (int i = 0; i < WebServer::kMostConnections + 5; ++i) {
    crowd.push_back(std::make_unique<Client>(s));
    crowd.back()->send("G");
  }
  EXPECT_EQ(s.server.refusals().full, 5);
  for (int i = 0; i < 5; ++i) {
    EXPECT_TRUE(crowd.back()->ended());
    crowd.pop_back();
  }
  crowd.clear();
  for (int i = 0; i < 50; ++i) s.server.serve(1);
  // When they have gone there is room again.
  EXPECT_EQ(Client(s).request("/?token=" + s.listener.token, s.host()).rfind("HTTP/1.1 200", 0),
            0u);
  EXPECT_EQ(s.server.refusals().full, 5);
}

TEST(WebServer, TellsWhenAWatchedDescriptorCanBeRead) {
  Served s;
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  int told = 0;
  s.server.watch(ends[0], [&] {
    char c;
    told += ::read(ends[0], &c, 1) == 1;
  });
  s.server.serve(0);
  EXPECT_EQ(told, 0);
  ASSERT_EQ(::write(ends[1], "x", 1), 1);
  for (int i = 0; i < 100 && told == 0; ++i) s.server.serve(1);
  EXPECT_EQ(told, 1);
  close(ends[0]);
  close(ends[1]);
}

}  // namespace
}  // namespace ves
