// SPDX-License-Identifier: BSD-3-Clause
#include "ves/page/web_server.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <libwebsockets.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include "ves/core/errors.hpp"

namespace ves {
namespace {

constexpr std::size_t kPiece = 16384;      // [B]
constexpr std::size_t kPacket = 1u << 20;  // [B] written at once; by default as little as is read

std::string newToken() {
  std::random_device random;
  return fmt::format("{:08x}{:08x}{:08x}{:08x}", random(), random(), random(), random());
}

std::string header(lws* wsi, lws_token_indexes which) {
  std::array<char, 256> text;
  const int n = lws_hdr_copy(wsi, text.data(), text.size(), which);
  return n > 0 ? std::string(text.data(), static_cast<std::size_t>(n)) : std::string();
}

}  // namespace

std::optional<PageMessage> parsePageMessage(std::string_view text) {
  if (text == "drawn") return PageMessage{};
  const auto word = [&]() -> std::string_view {
    const std::size_t end = std::min(text.find(' '), text.size());
    const std::string_view out = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    return out;
  };
  const auto as = [](std::string_view from, auto& number) {
    const auto [end, error] = std::from_chars(from.data(), from.data() + from.size(), number);
    return error == std::errc() && end == from.data() + from.size();
  };
  if (text.empty() || text.back() == ' ') return {};
  const std::string_view kind = word();
  PageMessage out;
  if (!as(word(), out.edition) || out.edition < 1) return {};
  bool good = true;
  const auto number = [&] {
    double x = NAN;
    good = as(word(), x) && std::isfinite(x) && good;
    return x;
  };
  const auto vector = [&] {
    Vec3 v;
    for (double& x : v) x = number();
    return v;
  };
  if (kind == "stop") {
    out.what = PageMessage::Stop{};
  } else if (kind == "push") {
    PushOrder push;
    const auto on = std::find(std::begin(kPushedNames), std::end(kPushedNames), word());
    if (on == std::end(kPushedNames)) return {};
    push.on = static_cast<PushOrder::On>(on - std::begin(kPushedNames));
    push.force_I = vector();
    push.duration = number();
    push.point = vector();
    good = good && plausible(RobotOrder(push));
    out.what = push;
  } else if (kind == "vehicle") {
    Order order;
    order.request = Request::kVehicle;
    order.id.sequence = 0;
    order.vehicle.to.mass = number();
    order.vehicle.to.damping = number();
    order.vehicle.to.stiffness = number();
    order.vehicle.over = number();
    good = good && plausible(order);
    out.what = order.vehicle;
  } else if (kind == "pace") {
    const double rate = number();
    good = good && (rate == 0.0 || (rate >= kLeastPace && rate <= kMostPace));
    out.what = PageMessage::Pace{rate};
  } else {
    return {};
  }
  if (!good || !text.empty()) return {};
  return out;
}

std::string Listener::url() const {
  return fmt::format("http://{}:{}/?token={}", address, port, token);
}

Listener listenOn(const std::string& address, std::optional<int> port) {
  constexpr int kUsualPort = 8780;
  sockaddr_in to{};
  to.sin_family = AF_INET;
  if (inet_pton(AF_INET, address.c_str(), &to.sin_addr) != 1)
    throw InputError(fmt::format("--bind {}: want an IPv4 address of this machine", address));
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  const int yes = 1;
  setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  const auto bindTo = [&](int number) {
    to.sin_port = htons(static_cast<std::uint16_t>(number));
    return bind(fd, reinterpret_cast<sockaddr*>(&to), sizeof to) == 0;
  };
  const bool bound =
      bindTo(port.value_or(kUsualPort)) || (!port && errno == EADDRINUSE && bindTo(0));
  if (!bound || listen(fd, 16) != 0) {
    const int why = errno;
    close(fd);
    throw InputError(fmt::format("--bind {}, port {}: {}", address, port.value_or(kUsualPort),
                                 std::strerror(why)));
  }
  return inheritedListener(fd, newToken());
}

Listener inheritedListener(int descriptor, const std::string& token) {
  sockaddr_in to{};
  socklen_t size = sizeof to;
  int listens = 0;
  socklen_t length = sizeof listens;
  if (getsockname(descriptor, reinterpret_cast<sockaddr*>(&to), &size) != 0 ||
      to.sin_family != AF_INET ||
      getsockopt(descriptor, SOL_SOCKET, SO_ACCEPTCONN, &listens, &length) != 0 || !listens)
    throw InputError(fmt::format("--listener {}: no socket that listens", descriptor));
  std::array<char, INET_ADDRSTRLEN> text{};
  inet_ntop(AF_INET, &to.sin_addr, text.data(), text.size());
  return {descriptor, text.data(), ntohs(to.sin_port), token};
}

class WebServer::Impl {
 public:
  Impl(Listener listener, std::string page, LiveSource* live)
      : listener_(std::move(listener)), page_(std::move(page)), live_(live) {
    lws_set_log_level(0, nullptr);
    protocols_ = {lws_protocols{"http", &Impl::onHttp, sizeof(Download), 0, 0, nullptr, kPacket},
                  lws_protocols{"ves", &Impl::onPage, 0, kLongestMessage, 0, nullptr, kPacket},
                  lws_protocols{"file", &Impl::onFile, 0, 0, 0, nullptr, 0},
                  lws_protocols{nullptr, nullptr, 0, 0, 0, nullptr, 0}};
    lws_context_creation_info info{};
    info.port = CONTEXT_PORT_NO_LISTEN_SERVER;
    info.protocols = protocols_.data();
    info.gid = info.uid = -1;  // as it is
    info.timeout_secs = 10;
    info.fd_limit_per_thread = kMostConnections + 32;  // ours, the bus, what lws needs
    info.user = this;
    context_ = lws_create_context(&info);
    if (!context_) throw InputError("view: libwebsockets does not start");
    vhost_ = lws_get_vhost_by_name(context_, "default");
    watch(listener_.descriptor, [this] { accept(); });
  }
  ~Impl() {
    lws_context_destroy(context_);
    close(listener_.descriptor);
  }

  const WebRefusals& refusals() const { return refusals_; }
  int pages() const { return static_cast<int>(pages_.size()); }

  void watch(int descriptor, std::function<void()> readable) {
    lws_sock_file_fd_type fd;
    fd.filefd = dup(descriptor);  // closed with the context
    lws* wsi = lws_adopt_descriptor_vhost(vhost_, LWS_ADOPT_RAW_FILE_DESC, fd, "file", nullptr);
    if (!wsi) throw InputError("view: libwebsockets takes no more descriptors");
    watched_[wsi] = std::move(readable);
  }

  void serve(int milliseconds) {
    lws_sul_schedule(
        context_, 0, &timer_, [](lws_sorted_usec_list_t*) {}, milliseconds * LWS_US_PER_MS);
    lws_service(context_, milliseconds > 0 ? 0 : -1);
  }

  void show() {
    for (auto& [wsi, page] : pages_)
      if (wants(page)) lws_callback_on_writable(wsi);
  }

  bool shownAll() const {
    return std::all_of(pages_.begin(), pages_.end(), [&](const auto& one) {
      const Page& page = one.second;
      return page.drawn && page.edition == live_->edition() && page.picture == live_->newest();
    });
  }

  void adopt(int descriptor) {
    if (connections_ >= kMostConnections) {
      ++refusals_.full;
      close(descriptor);
      return;
    }
    lws_adopt_socket_vhost(vhost_, descriptor);
  }

 private:
  struct Download {
    std::size_t sent;  // [B]
  };
  /// One browser that watches.
  struct Page {
    bool drawn = true;         // what it got
    std::int64_t edition = 0;  // of the scene that it has
    std::int64_t picture = 0;  // the last that it got
    lws_usec_t second = 0;     // [us] in which its messages are counted
    int messages = 0;
    std::string message;  // as far as it has come
  };

  static Impl& of(lws* wsi) { return *static_cast<Impl*>(lws_context_user(lws_get_context(wsi))); }

  void accept() {
    for (;;) {
      const int fd = accept4(listener_.descriptor, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
      if (fd < 0) return;
      const int yes = 1;
      setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);  // a picture is worth a packet
      adopt(fd);
    }
  }

  bool wants(const Page& page) const {
    return live_ && live_->edition() > 0 &&
           (page.edition != live_->edition() || (page.drawn && page.picture != live_->newest()));
  }

  /// By its own name and with the token; a web socket from our page, too.
  bool mayCome(lws* wsi, bool socket) {
    const std::string host = header(wsi, WSI_TOKEN_HOST);
    const std::string port = fmt::format(":{}", listener_.port);
    // Another name for the loopback is somebody's trick with a name server.
    const bool ours = listener_.address.rfind("127.", 0) != 0 || host == listener_.address + port ||
                      host == "localhost" + port;
    if (host.empty() || !ours || (socket && header(wsi, WSI_TOKEN_ORIGIN) != "http://" + host)) {
      ++refusals_.origin;
      return false;
    }
    std::array<char, 64> given{};
    const char* token = lws_get_urlarg_by_name(wsi, "token=", given.data(), given.size() - 1);
    if (!token || std::strlen(token) != listener_.token.size() ||
        lws_timingsafe_bcmp(token, listener_.token.data(),
                            static_cast<std::uint32_t>(listener_.token.size())) != 0) {
      ++refusals_.token;
      return false;
    }
    return true;
  }

  int answer(lws* wsi, unsigned status, const char* what) {
    if (lws_return_http_status(wsi, status, what) != 0) return -1;
    return lws_http_transaction_completed(wsi) ? -1 : 0;
  }

  int beginPage(lws* wsi, const char* path) {
    if (lws_hdr_total_length(wsi, WSI_TOKEN_GET_URI) <= 0) {
      ++refusals_.malformed;
      return answer(wsi, HTTP_STATUS_METHOD_NOT_ALLOWED, "GET only");
    }
    if (!mayCome(wsi, false))
      return answer(wsi, HTTP_STATUS_FORBIDDEN,
                    "the address with its token is what ves view prints");
    if (std::string_view(path) != "/") return answer(wsi, HTTP_STATUS_NOT_FOUND, nullptr);
    std::array<unsigned char, LWS_PRE + 2048> buffer;
    unsigned char *start = buffer.data() + LWS_PRE, *at = start,
                  *end = buffer.data() + buffer.size();
    const auto add = [&](const char* name, const std::string& value) {
      return lws_add_http_header_by_name(wsi, reinterpret_cast<const unsigned char*>(name),
                                         reinterpret_cast<const unsigned char*>(value.data()),
                                         static_cast<int>(value.size()), &at, end);
    };
    if (lws_add_http_common_headers(wsi, HTTP_STATUS_OK, "text/html; charset=utf-8", page_.size(),
                                    &at, end) ||
        add("content-security-policy:",
            "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
            "img-src data:; connect-src 'self'; frame-ancestors 'none'") ||
        add("referrer-policy:", "no-referrer") || add("cache-control:", "no-store") ||
        add("x-content-type-options:", "nosniff") ||
        lws_finalize_write_http_header(wsi, start, &at, end))
      return -1;
    lws_callback_on_writable(wsi);
    return 0;
  }

  int sendPage(lws* wsi, Download& download) {
    const std::size_t n = std::min(kPiece, page_.size() - download.sent);
    std::vector<unsigned char> buffer(LWS_PRE + n);
    std::memcpy(buffer.data() + LWS_PRE, page_.data() + download.sent, n);
    download.sent += n;
    const bool last = download.sent == page_.size();
    if (lws_write(wsi, buffer.data() + LWS_PRE, n, last ? LWS_WRITE_HTTP_FINAL : LWS_WRITE_HTTP) !=
        static_cast<int>(n))
      return -1;
    if (last) return lws_http_transaction_completed(wsi) ? -1 : 0;
    lws_callback_on_writable(wsi);
    return 0;
  }

  static int onHttp(lws* wsi, lws_callback_reasons reason, void* user, void* in, std::size_t) {
    Impl& self = of(wsi);
    switch (reason) {
      case LWS_CALLBACK_SERVER_NEW_CLIENT_INSTANTIATED: ++self.connections_; return 0;
      case LWS_CALLBACK_WSI_DESTROY:
        if (!self.watched_.count(wsi)) --self.connections_;
        return 0;
      case LWS_CALLBACK_HTTP: return self.beginPage(wsi, static_cast<const char*>(in));
      case LWS_CALLBACK_HTTP_WRITEABLE: return self.sendPage(wsi, *static_cast<Download*>(user));
      case LWS_CALLBACK_HTTP_BODY:
      case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION: ++self.refusals_.malformed; return -1;
      default: return 0;
    }
  }

  static int onPage(lws* wsi, lws_callback_reasons reason, void*, void* in, std::size_t size) {
    Impl& self = of(wsi);
    switch (reason) {
      case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
        return self.live_ && self.mayCome(wsi, true) ? 0 : -1;
      case LWS_CALLBACK_ESTABLISHED:
        self.pages_[wsi] = {};
        if (self.wants(self.pages_[wsi])) lws_callback_on_writable(wsi);
        return 0;
      case LWS_CALLBACK_CLOSED: self.pages_.erase(wsi); return 0;
      case LWS_CALLBACK_SERVER_WRITEABLE: return self.send(wsi);
      case LWS_CALLBACK_RECEIVE: return self.receive(wsi, {static_cast<const char*>(in), size});
      default: return 0;
    }
  }

  static int onFile(lws* wsi, lws_callback_reasons reason, void*, void*, std::size_t) {
    if (reason != LWS_CALLBACK_RAW_RX_FILE) return 0;
    const auto found = of(wsi).watched_.find(wsi);
    if (found != of(wsi).watched_.end()) found->second();
    return 0;
  }

  int send(lws* wsi) {
    Page& page = pages_[wsi];
    if (!wants(page)) return 0;
    const bool scene = page.edition != live_->edition();
    std::int64_t last = live_->newest();
    const std::string what = scene ? live_->scene() : live_->pictures(page.picture, last);
    page.picture = last;  // of a new scene one comes next
    if (scene)
      page.edition = live_->edition();
    else if (what.empty())
      return 0;
    else
      page.drawn = false;
    std::vector<unsigned char> buffer(LWS_PRE + what.size());
    std::memcpy(buffer.data() + LWS_PRE, what.data(), what.size());
    if (lws_write(wsi, buffer.data() + LWS_PRE, what.size(),
                  scene ? LWS_WRITE_TEXT : LWS_WRITE_BINARY) < 0)
      return -1;
    if (wants(page)) lws_callback_on_writable(wsi);
    return 0;
  }

  /// A message may come in pieces, wherever the network or its sender cuts it.
  int receive(lws* wsi, std::string_view piece) {
    Page& page = pages_[wsi];
    page.message += piece;
    const bool whole = lws_is_final_fragment(wsi) && lws_remaining_packet_payload(wsi) == 0;
    if (!whole && page.message.size() <= kLongestMessage) return 0;
    const std::string text = std::exchange(page.message, {});
    const lws_usec_t now = lws_now_usecs();
    if (now - page.second > LWS_US_PER_SEC) {
      page.second = now;
      page.messages = 0;
    }
    const auto message = whole && !lws_frame_is_binary(wsi) ? parsePageMessage(text) : std::nullopt;
    if (!message || ++page.messages > kMostMessages) {
      ++refusals_.malformed;
      lws_close_reason(wsi, LWS_CLOSE_STATUS_POLICY_VIOLATION, nullptr, 0);
      return -1;
    }
    if (!std::holds_alternative<PageMessage::Drawn>(message->what)) {
      live_->take(*message);
      return 0;
    }
    page.drawn = true;
    if (wants(page)) lws_callback_on_writable(wsi);
    return 0;
  }

  Listener listener_;
  std::string page_;
  LiveSource* live_;
  WebRefusals refusals_;
  int connections_ = 0;
  std::map<lws*, Page> pages_;
  std::map<lws*, std::function<void()>> watched_;
  std::array<lws_protocols, 4> protocols_;
  lws_sorted_usec_list_t timer_{};
  lws_context* context_ = nullptr;
  lws_vhost* vhost_ = nullptr;
};

WebServer::WebServer(Listener listener, std::string page, LiveSource* live)
    : impl_(std::make_unique<Impl>(std::move(listener), std::move(page), live)) {}
WebServer::~WebServer() = default;
const WebRefusals& WebServer::refusals() const { return impl_->refusals(); }
int WebServer::pages() const { return impl_->pages(); }
void WebServer::watch(int descriptor, std::function<void()> readable) {
  impl_->watch(descriptor, std::move(readable));
}
void WebServer::serve(int milliseconds) { impl_->serve(milliseconds); }
void WebServer::show() { impl_->show(); }
bool WebServer::shownAll() const { return impl_->shownAll(); }
void WebServer::adopt(int descriptor) { impl_->adopt(descriptor); }

}  // namespace ves
