// SPDX-License-Identifier: BSD-3-Clause
//
// One page over HTTP, and one stream of pictures over a web socket, for a few browsers that have
// the token. One thread, nothing blocks.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "ves/contract/plausible.hpp"

namespace ves {

/// What a page may send: "drawn", when it has shown a picture; and for the run of that edition of
/// the scene "stop EDITION", "push EDITION platform|tool|target FX FY FZ SECONDS X Y Z" (N, m),
/// "vehicle EDITION MASS DAMPING STIFFNESS SECONDS" (factors), "pace EDITION RATE".
struct PageMessage {
  struct Drawn {};
  struct Stop {};
  struct Pace {
    double rate;  // [-] of real time
  };
  std::int64_t edition = 0;
  std::variant<Drawn, Stop, PushOrder, VehicleOrder, Pace> what;
};
/// Nothing where it is none of these, or a number is out of range.
std::optional<PageMessage> parsePageMessage(std::string_view text);

/// What a page shows while it happens.
class LiveSource {
 public:
  virtual ~LiveSource() = default;
  virtual std::int64_t edition() const = 0;      // of the scene; 0: none yet
  virtual const std::string& scene() const = 0;  // JSON
  virtual std::int64_t newest() const = 0;       // number of the newest picture
  /// Those that came after that number, as far as they are kept and fit into a message, as bytes;
  /// `last` becomes the number of the last one.
  virtual std::string pictures(std::int64_t after, std::int64_t& last) const = 0;
  virtual void take(const PageMessage& message) = 0;
};

/// A socket that browsers connect to.
struct Listener {
  int descriptor = -1;
  std::string address;
  int port = 0;
  std::string token;  // that every request must carry

  std::string url() const;  // http://ADDRESS:PORT/?token=...
};

/// Without a port: 8780, or any free one where that is taken. Throws InputError when the address is
/// none of this machine, or the port is taken.
Listener listenOn(const std::string& address, std::optional<int> port);

/// One that another process has made and left open to us.
Listener inheritedListener(int descriptor, const std::string& token);

/// What was not let in.
struct WebRefusals {
  std::int64_t token = 0;      // [-] requests without the token
  std::int64_t origin = 0;     // [-] from another page, or by another name of this machine
  std::int64_t malformed = 0;  // [-] messages of no meaning, too long, too many, no HTTP
  std::int64_t full = 0;       // [-] connections above the most

  std::int64_t total() const { return token + origin + malformed + full; }
};

class WebServer {
 public:
  static constexpr int kMostConnections = 32;          // [-]
  static constexpr int kMostMessages = 200;            // [1/s] of one page
  static constexpr std::size_t kLongestMessage = 256;  // [B]

  /// `page` is what GET / answers; `live` may be none. Takes the listener's descriptor.
  WebServer(Listener listener, std::string page, LiveSource* live);
  ~WebServer();

  const WebRefusals& refusals() const;
  int pages() const;  // [-] that watch now

  /// Calls `readable` when the descriptor can be read.
  void watch(int descriptor, std::function<void()> readable);
  /// Whether every page that watches has drawn all there is.
  bool shownAll() const;
  /// Waits for something to do, at most so long, and does it.
  void serve(int milliseconds);
  /// Sends what is new to every page that has drawn what it got.
  void show();
  /// A connection as if it had been accepted. Takes the descriptor.
  void adopt(int descriptor);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ves
