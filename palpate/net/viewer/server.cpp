// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/viewer/server.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <chrono>
#include <deque>
#include <limits>
#include <map>
#include <mutex>
#include <random>
#include <thread>
#include <utility>

#include <boost/asio/ip/host_name.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <nlohmann/json.hpp>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using nlohmann::json;
using Clock = std::chrono::steady_clock;
using Request = http::request<http::empty_body>;
using SharedMessage = std::shared_ptr<const ViewerMessage>;

constexpr std::chrono::milliseconds ticks_interval(33);
constexpr int ticks_per_state = 6;
constexpr std::chrono::seconds handshake_timeout(5);
constexpr std::chrono::seconds idle_timeout(10);  // a ping goes out at half of it
constexpr std::chrono::seconds answer_timeout(10);
constexpr std::chrono::seconds opening_time(60);  // for a browser to open the page by itself
constexpr std::chrono::seconds hand_timeout(2);   // pages repeat a held hand several times a second
constexpr std::size_t max_connections = 64;
constexpr int max_viewers = 16;
constexpr int max_operator_pages = 4;  // besides
constexpr std::size_t shortest_token = 8;
constexpr std::uint32_t max_header = 8192;
constexpr std::size_t max_queue = 32;   // of small messages to one page
constexpr std::uint32_t max_ahead = 2;  // frames sent that a page has not drawn yet

// The part of `HOST:PORT` before the port, in lower case, without brackets.
std::string host_of(std::string_view authority) {
  if (!authority.empty() && authority.front() == '[') {
    authority = authority.substr(1, authority.find(']') - 1);
  } else {
    authority = authority.substr(0, authority.rfind(':'));
  }
  return lower_case(authority);
}

bool is_loopback_name(const std::string& host) {
  if (host == "localhost") return true;
  boost::system::error_code error;
  const auto address = asio::ip::make_address(host, error);
  return !error && address.is_loopback();
}

std::string_view view(beast::string_view text) { return {text.data(), text.size()}; }

// What a request asks for, without its options.
std::string_view path_of(const Request& request) {
  const std::string_view target = view(request.target());
  return target.substr(0, target.find('?'));
}

// The value of an option behind the '?' of a request's target; empty if it is not there.
std::string_view option_of(const Request& request, std::string_view key) {
  const std::string_view target = view(request.target());
  const std::size_t question = target.find('?');
  if (question == std::string_view::npos) return {};
  std::string_view query = target.substr(question + 1);
  while (!query.empty()) {
    const std::string_view option = query.substr(0, query.find('&'));
    const std::size_t equals = std::min(option.find('='), option.size());
    if (option.substr(0, equals) == key) return option.substr(std::min(equals + 1, option.size()));
    query.remove_prefix(std::min(option.size() + 1, query.size()));
  }
  return {};
}

// Whom a connection comes from: an address, of IPv6 the network, as one machine has many.
std::string source_of(const tcp::socket& socket) {
  boost::system::error_code error;
  const auto endpoint = socket.remote_endpoint(error);
  if (error) return {};
  auto address = endpoint.address();
  if (!address.is_v6()) return address.to_string();
  auto bytes = address.to_v6().to_bytes();
  if (address.to_v6().is_v4_mapped())
    return asio::ip::make_address_v4(asio::ip::v4_mapped, address.to_v6()).to_string();
  std::fill(bytes.begin() + 8, bytes.end(), std::uint8_t{0});
  return asio::ip::make_address_v6(bytes).to_string();
}

SharedMessage shared_text(const json& words) {
  return std::make_shared<const ViewerMessage>(text_message(words));
}

// One of a limited number of places, taken from the request on until the page has gone.
using Place = std::shared_ptr<int>;

Place take_place(int& taken, int most) {
  if (taken >= most) return nullptr;
  ++taken;
  return {&taken, [](int* count) { --*count; }};
}

// With what a page comes in.
struct Admission {
  http::status status = http::status::ok;
  Place place = nullptr;
  bool is_operator = false;
  bool needs_token = false;    // it was opened by the program, and does not know the token yet
  bool unknown_token = false;  // it gave one that is nobody's, where none is needed
};

class PageSession;

// What sessions ask of the server they belong to.
class Hub {
 public:
  virtual ~Hub() = default;
  virtual void joined(const std::shared_ptr<PageSession>& page) = 0;
  virtual void left(PageSession& page) = 0;
  virtual void moved_hand(PageSession& page, const HandMessage& hand) = 0;
  virtual void commanded(PageSession& page, const Command& command) = 0;
};

// One page, from the WebSocket handshake on. All on the server's thread.
class PageSession : public std::enable_shared_from_this<PageSession> {
 public:
  PageSession(Hub& hub, beast::tcp_stream stream, Admission admission)
      : hub_(hub), admission_(std::move(admission)), socket_(std::move(stream)) {}

  [[nodiscard]] const Admission& admission() const { return admission_; }

  void start(const Request& request) {
    beast::get_lowest_layer(socket_).expires_never();
    socket_.set_option(websocket::stream_base::timeout{handshake_timeout, idle_timeout, true});
    socket_.read_message_max(max_page_message);
    socket_.async_accept(request, [self = shared_from_this()](beast::error_code error) {
      if (error) return;
      self->open_ = true;
      self->hub_.joined(self->shared_from_this());
      self->read();
    });
  }

  // A message that must arrive, in order.
  void send(SharedMessage message) {
    if (queue_.size() >= max_queue) queue_.pop_front();  // a page that reads nothing
    queue_.push_back(std::move(message));
    pump();
  }

  // Says once why the page's hand is not taken, until `may_explain_again`.
  void explain(std::string_view why) {
    if (std::exchange(explained_, true)) return;
    refuse(why);
  }
  void may_explain_again() { explained_ = false; }

  void refuse(std::string_view why) { send(shared_text(json{{"error", why}})); }

  // What belongs to a camera; its newest frame takes the place of one that has not been sent yet.
  void show(std::size_t camera, const SharedMessage& message) {
    if (!message->is_frame) return send(message);
    cameras_[camera].next = message;
    pump();
  }

 private:
  struct CameraFeed {
    SharedMessage next;
    std::uint32_t ahead = 0;  // frames sent and not drawn yet
  };

  void read() {
    socket_.async_read(buffer_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (error) return self->leave();
      const bool understood = self->take_message();
      self->buffer_.consume(self->buffer_.size());
      if (understood) return self->read();
      self->leave();
      self->socket_.async_close(
          {websocket::close_code::policy_error, "message not understood; see docs/protocol.md"},
          [self](beast::error_code) {});
    });
  }

  bool take_message() {
    const auto* data = static_cast<const std::byte*>(buffer_.cdata().data());
    const std::span<const std::byte> bytes(data, buffer_.size());
    if (socket_.got_text()) {
      const auto command =
          parse_command({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
      if (command) hub_.commanded(*this, *command);
      return command.has_value();
    }
    const auto message = parse_binary(bytes);
    if (!message) return false;
    if (const auto* hand = std::get_if<HandMessage>(&*message)) hub_.moved_hand(*this, *hand);
    if (const auto* shown = std::get_if<ShownMessage>(&*message)) {
      CameraFeed& feed = cameras_[shown->camera];
      if (feed.ahead > 0) --feed.ahead;
      pump();
    }
    return true;
  }

  void leave() {
    if (!open_) return;
    open_ = false;
    admission_.place.reset();
    hub_.left(*this);
  }

  // Sends the next message that is due, unless one is being sent.
  void pump() {
    if (!open_ || writing_) return;
    if (!queue_.empty()) {
      writing_ = std::move(queue_.front());
      queue_.pop_front();
    } else {
      for (std::size_t i = 0; i < cameras_.size() && !writing_; ++i) {
        CameraFeed& feed = cameras_[next_camera_];
        next_camera_ = (next_camera_ + 1) % cameras_.size();
        if (!feed.next || feed.ahead >= max_ahead) continue;
        ++feed.ahead;
        writing_ = std::move(feed.next);
        feed.next.reset();
      }
    }
    if (!writing_) return;
    socket_.text(writing_->text);
    const std::span<const std::uint8_t> colour =
        writing_->colour ? std::span(writing_->colour->rgb) : std::span<const std::uint8_t>{};
    const std::array<asio::const_buffer, 3> buffers = {
        asio::buffer(writing_->head.data(), writing_->head.size()),
        asio::buffer(writing_->payload.data(), writing_->payload.size()),
        asio::buffer(colour.data(), colour.size())};
    socket_.async_write(buffers, [self = shared_from_this()](beast::error_code error, std::size_t) {
      self->writing_.reset();
      if (error) return self->leave();
      self->pump();
    });
  }

  Hub& hub_;
  Admission admission_;
  bool explained_ = false;
  websocket::stream<beast::tcp_stream, false> socket_;  // without compression
  beast::flat_buffer buffer_;
  std::deque<SharedMessage> queue_;
  std::array<CameraFeed, Patch::max_views> cameras_;
  std::size_t next_camera_ = 0;
  SharedMessage writing_;
  bool open_ = false;
};

}  // namespace

class ViewerServer::Impl final : public Hub {
 public:
  Impl(const ViewerOptions& options, ViewerHost& host)
      : token_(options.token),
        operator_token_(options.operator_token.empty() ? make_token() : options.operator_token),
        opening_token_(make_token()),
        opened_until_(Clock::now() + opening_time),
        request_timeout_(
            std::chrono::duration_cast<Clock::duration>(Seconds(options.request_timeout))),
        host_(host) {
    check_token("--token", token_);
    check_token("--operator-token", operator_token_);
    if (operator_token_.size() < shortest_token)
      throw Error("--operator-token", "it must have at least 8 characters",
                  "use a longer one, or none to have one generated");
    if (operator_token_ == token_)
      throw Error("--operator-token", "it is the same as --token", "give another");
    boost::system::error_code error;
    const auto address = asio::ip::make_address(options.listen, error);
    if (error)
      throw Error("--listen " + options.listen, "it is not an IP address",
                  "use 127.0.0.1, or 0.0.0.0 for everybody with the token");
    beyond_loopback_ = !address.is_loopback();
    if (beyond_loopback_ && token_.size() < shortest_token)
      throw Error("--token", "for other computers it must have at least 8 characters",
                  "use a longer one, or none to have one generated");
    listen({address, options.port});
    const std::string host_name = address.is_unspecified() ? asio::ip::host_name()
                                  : address.is_v6()        ? "[" + address.to_string() + "]"
                                                           : address.to_string();
    url_ = base_url(host_name);
    accept();
    wait();
    thread_ = std::thread([this] { context_.run(); });
  }

  ~Impl() override {
    context_.stop();
    thread_.join();
  }

  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] std::string url(const std::string& host) const {
    const std::string base = host.empty() ? url_ : base_url(host);
    return token_.empty() ? base : base + "?token=" + token_;
  }
  [[nodiscard]] std::string operator_url() const { return link(operator_token_); }
  [[nodiscard]] std::string opening_url() const { return link(opening_token_); }

  // What was shown of a camera last, by its kind: the frame comes last, as it needs the others.
  using Camera = std::map<std::byte, SharedMessage, std::greater<>>;

  void show(std::uint8_t camera, ViewerMessage message) {
    if (camera >= Patch::max_views) return;
    const std::byte kind = message.head.front();
    auto shared = std::make_shared<const ViewerMessage>(std::move(message));
    const std::lock_guard lock(mutex_);
    arrived_[camera][kind] = std::move(shared);
    if (std::exchange(posted_, true)) return;  // the thread has not come to it yet
    asio::post(context_, [this] { distribute(); });
  }

  // A page of another site can make a browser come here under that site's name, or from it.
  [[nodiscard]] bool is_from_here(const Request& request) const {
    const std::string_view authority = view(request[http::field::host]);
    if (!beyond_loopback_ && !is_loopback_name(host_of(authority))) return false;
    if (request.find(http::field::origin) == request.end()) return true;
    const std::string_view origin = view(request[http::field::origin]);
    const std::size_t slashes = origin.find("://");
    return slashes != std::string_view::npos && origin.substr(slashes + 3) == authority;
  }

  // Is a request answered, and if it begins a page's session, as whose?
  Admission judge(const Request& request, const std::string& source) {
    if (request.method() != http::verb::get && request.method() != http::verb::head)
      return {http::status::method_not_allowed};
    if (!is_from_here(request)) return {http::status::forbidden};
    // A page that was refused asks once more without an upgrade: browsers do not tell it why.
    const bool upgrades = websocket::is_upgrade(request);
    const std::string_view path = path_of(request);
    if (path == "/splat" && !upgrades) return judge_token(request, source, false);
    if (path != "/session") return {upgrades ? http::status::not_found : http::status::ok};
    Admission admission = judge_token(request, source, upgrades);
    if (admission.status != http::status::ok) return admission;
    if (admission.is_operator) admission.place = take_place(operator_pages_, max_operator_pages);
    if (!admission.place) admission.place = take_place(viewer_pages_, max_viewers);
    if (!admission.place) admission.status = http::status::service_unavailable;
    return admission;
  }

  // May whoever asks send a file? Only the operator's page may, one at a time.
  http::status judge_file(const Request& request, const std::string& source) {
    if (!is_from_here(request)) return http::status::forbidden;
    if (path_of(request) != "/file") return http::status::not_found;
    const Admission admission = judge_token(request, source, false);
    if (admission.status != http::status::ok) return admission.status;
    if (!admission.is_operator) return http::status::unauthorized;
    return receiving_ ? http::status::conflict : http::status::ok;
  }

  void joined(const std::shared_ptr<PageSession>& page) override {
    pages_.push_back(page);
    json hello = host_.hello();
    hello["role"] = to_string(role_of(*page));
    if (page->admission().needs_token) hello["operator_token"] = operator_token_;
    if (page->admission().unknown_token) hello["token"] = "unknown";
    page->send(shared_text(json{{"hello", std::move(hello)}}));
    send_state({page});
    for (std::size_t camera = 0; camera < cameras_.size(); ++camera)
      for (const auto& [kind, message] : cameras_[camera]) page->show(camera, message);
    tell_presence(false);
  }

  void left(PageSession& page) override {
    const bool had_hand = hand_owner_ == &page;
    if (had_hand) release_hand();
    std::erase_if(pages_, [&](const auto& other) { return other.get() == &page; });
    tell_presence(had_hand);
  }

  void moved_hand(PageSession& page, const HandMessage& hand) override {
    if (!host_.takes_hand()) {
      if (hand.held) page.explain("hand: this session's device is not controlled by a page");
      return;
    }
    if (hand_owner_ != nullptr && hand_owner_ != &page) {
      if (hand.held) page.explain("hand: another page controls the HIP; wait until it releases");
      return;
    }
    if (!hand.held) {
      if (hand_owner_ == nullptr) return;
      release_hand(hand);
      return tell_presence(true);
    }
    hand_heard_ = Clock::now();
    host_.hand(hand);
    if (std::exchange(hand_owner_, &page) == nullptr) tell_presence(true);
  }

  void commanded(PageSession& page, const Command& command) override {
    try {
      const Role role = role_of(page);
      check_allowed(command, role);
      if (std::holds_alternative<ResetHand>(command) && hand_owner_ != nullptr &&
          hand_owner_ != &page)
        throw Error("hand", "another page controls the HIP", "wait until it releases");
      host_.command(command, role);
      send_state(pages_);
    } catch (const std::exception& error) {
      page.refuse(error.what());
    }
  }

 private:
  class HttpSession;
  static void check_token(const char* option, const std::string& token) {
    const auto well_formed = [](unsigned char c) {
      return std::isalnum(c) || c == '-' || c == '_';
    };
    if (!std::all_of(token.begin(), token.end(), well_formed) || token.size() > longest_token)
      throw Error(option, "it has other characters than letters, digits, - and _, or over 128",
                  "give a simpler one");
  }

  [[nodiscard]] std::string base_url(const std::string& host) const {
    return "http://" + host + ":" + std::to_string(port()) + "/";
  }

  [[nodiscard]] std::string link(const std::string& token) const {
    return url_ + "?token=" + token;
  }

  // Whose token is it? On a loopback address that asks for none, a wrong one lets in who looks,
  // such as a page left open from an earlier session; it counts as a guess all the same.
  // @param enters  whether a session begins: that uses up the token with which a page is opened
  Admission judge_token(const Request& request, const std::string& source, bool enters) {
    const std::string_view given = option_of(request, "token");
    if (given.empty()) return {token_.empty() ? http::status::ok : http::status::unauthorized};
    const double t = Seconds(Clock::now().time_since_epoch()).count();
    if (guesses_.pause(source, t) > 0.0) return {http::status::too_many_requests};
    // All are compared, whichever it is.
    const bool is_opening = is_token(given, opening_token_);
    const bool is_operator = is_token(given, operator_token_);
    const bool is_viewer = is_token(given, token_);
    Admission admission;
    if (is_opening && Clock::now() < opened_until_) {
      if (enters) opening_token_.clear();  // other accounts see the browser's command line
      admission.is_operator = admission.needs_token = true;
    } else if (is_operator) {
      admission.is_operator = true;
    } else if (!is_viewer) {
      guesses_.wrong(source, given, t);
      admission.unknown_token = true;
      if (!token_.empty()) admission.status = http::status::unauthorized;
    }
    return admission;
  }

  [[nodiscard]] Role role_of(const PageSession& page) const {
    return page.admission().is_operator ? Role::operating
           : hand_owner_ == &page       ? Role::holding
                                        : Role::looking;
  }

  void listen(const tcp::endpoint& endpoint) {
    const std::string subject =
        "--listen " + endpoint.address().to_string() + " --port " + std::to_string(endpoint.port());
    beast::error_code error;
    acceptor_.open(endpoint.protocol(), error);
    if (!error) acceptor_.set_option(asio::socket_base::reuse_address(true), error);
    if (!error) acceptor_.bind(endpoint, error);
    if (!error) acceptor_.listen(asio::socket_base::max_listen_connections, error);
    if (error == asio::error::address_in_use)
      throw Error(subject, "another program listens there",
                  "use another port, or --port 0 for any free port");
    if (error == asio::error::access_denied)
      throw Error(subject, "this account may not listen there",
                  "use a port from 1024 on, or --port 0 for any free port");
    if (error) throw Error(subject, error.message(), "use an address of this computer");
    port_ = acceptor_.local_endpoint().port();
  }

  void accept();
  void make_room();

  void wait() {
    timer_.expires_after(ticks_interval);
    timer_.async_wait([this](beast::error_code error) {
      if (error) return;
      beat();
      wait();
    });
  }

  void beat() {
    if (hand_owner_ != nullptr && Clock::now() - hand_heard_ > hand_timeout) {
      release_hand();
      tell_presence(true);
    }
    const std::optional<TickBatch> batch = host_.ticks();  // also when nobody looks: it drains
    if (pages_.empty()) return;
    const auto tell = [this](const SharedMessage& message) {
      for (const auto& page : pages_) page->send(message);
    };
    if (batch) tell(std::make_shared<const ViewerMessage>(ticks_message(*batch)));
    if (const json robot = host_.robot(); !robot.is_null())
      tell(shared_text(json{{"robot", robot}}));
    if (const json hands = host_.more_hands(); !hands.is_null())
      tell(shared_text(json{{"more_hands", hands}}));
    if (++beats_ % ticks_per_state == 0) send_state(pages_);
  }

  // @param farewell  where the hand goes without a force
  void release_hand(const HandMessage& farewell = {}) {
    hand_owner_ = nullptr;
    host_.hand(farewell);
  }

  // To all. @param hand_changed  then roles have changed, too, which are part of the state
  void tell_presence(bool hand_changed) {
    for (const auto& page : pages_) {
      const char* hand = hand_owner_ == nullptr      ? "free"
                         : hand_owner_ == page.get() ? "you"
                                                     : "other";
      const json presence = {{"hand", hand}, {"viewers", pages_.size()}};
      page->send(shared_text(json{{"presence", presence}}));
      if (hand_changed) page->may_explain_again();
    }
    if (hand_changed) send_state(pages_);
  }

  // The state with each page's role; one message for all of a role.
  void send_state(const std::vector<std::shared_ptr<PageSession>>& pages) {
    if (pages.empty()) return;
    json words = {{"state", host_.state()}};
    std::map<Role, SharedMessage> messages;
    for (const auto& page : pages) {
      const Role role = role_of(*page);
      SharedMessage& message = messages[role];
      words["state"]["role"] = to_string(role);
      if (!message) message = shared_text(words);
      page->send(message);
    }
  }

  // Brings what other threads have published to the pages.
  void distribute() {
    std::array<Camera, Patch::max_views> arrived;
    {
      const std::lock_guard lock(mutex_);
      std::swap(arrived, arrived_);
      posted_ = false;
    }
    for (std::size_t i = 0; i < arrived.size(); ++i) {
      for (const auto& [kind, message] : arrived[i]) {
        cameras_[i][kind] = message;
        for (const auto& page : pages_) page->show(i, message);
      }
    }
  }

  using Seconds = std::chrono::duration<double>;

  std::string token_, operator_token_;
  std::string opening_token_;        // good once; empty: used
  Clock::time_point opened_until_;   // and until then
  Clock::duration request_timeout_;  // from a connection's begin, or its last answer
  GuessLimit guesses_;
  ViewerHost& host_;
  bool beyond_loopback_ = false;
  std::string url_;
  std::uint16_t port_ = 0;
  // These outlive the context, and so all sessions.
  std::vector<HttpSession*> connections_;  // without pages, oldest first
  int viewer_pages_ = 0, operator_pages_ = 0;
  bool receiving_ = false;  // a file

  std::mutex mutex_;
  std::array<Camera, Patch::max_views> arrived_;  // guarded by mutex_
  bool posted_ = false;                           // guarded by mutex_

  asio::io_context context_{1};
  tcp::acceptor acceptor_{context_};
  asio::steady_timer timer_{context_};
  asio::steady_timer accept_again_{context_};
  std::vector<std::shared_ptr<PageSession>> pages_;
  std::array<Camera, Patch::max_views> cameras_;  // newest frames
  PageSession* hand_owner_ = nullptr;
  Clock::time_point hand_heard_;
  int beats_ = 0;
  std::thread thread_;
};

// One connection, until it becomes a page's session.
class ViewerServer::Impl::HttpSession : public std::enable_shared_from_this<HttpSession> {
 public:
  HttpSession(Impl& server, tcp::socket socket)
      : server_(server), source_(source_of(socket)), stream_(std::move(socket)) {
    server_.connections_.push_back(this);
  }
  ~HttpSession() {
    end_file(false);
    std::erase(server_.connections_, this);
  }

  void read() {
    parser_.emplace();
    parser_->header_limit(max_header);
    // Only a file has a body, whose size its receiver limits; boost::none would allow none.
    parser_->body_limit(std::numeric_limits<std::uint64_t>::max());
    stream_.expires_after(server_.request_timeout_);
    http::async_read_header(stream_, buffer_, *parser_,
                            [self = shared_from_this()](beast::error_code error, std::size_t) {
                              if (error) return;
                              if (self->parser_->get().method() == http::verb::put)
                                return self->receive();
                              if (self->parser_->is_done()) self->answer(self->parser_->release());
                            });
  }

  [[nodiscard]] const std::string& source() const { return source_; }
  void close() { stream_.close(); }

 private:
  using Response = http::response<http::span_body<const char>>;

  // A file, if it is welcome.
  void receive() {
    Request request = parser_->get();
    request.keep_alive(false);
    const http::status status = server_.judge_file(request, source_);
    if (status != http::status::ok) return say(request, status, std::string(explanation(status)));
    const auto size = parser_->content_length();
    if (!size)
      return say(request, http::status::length_required, "The file's length is missing.\n");
    beast::error_code error;
    try {
      const std::string name(option_of(request, "name"));
      file_ = server_.host_.begin_file(name, *size);
    } catch (const std::exception& refusal) {
      return say(request, http::status::unprocessable_entity, refusal.what());
    }
    server_.receiving_ = true;
    file_parser_.emplace(std::move(*parser_));
    file_parser_->body_limit(*size);
    file_parser_->get().body().open(file_.c_str(), beast::file_mode::write_new, error);
    if (error) return fail_file(error);
    receive_more();
  }

  void receive_more() {
    if (file_parser_->is_done()) return file_received();
    stream_.expires_after(answer_timeout);
    http::async_read_some(stream_, buffer_, *file_parser_,
                          [self = shared_from_this()](beast::error_code error, std::size_t) {
                            if (error) return self->fail_file(error);
                            self->receive_more();
                          });
  }

  void fail_file(beast::error_code error) {
    end_file(false);
    say({}, http::status::insufficient_storage, "The file was not received: " + error.message());
  }

  // The page hears that it arrived before its session ends.
  void file_received() {
    file_parser_->get().body().close();
    say({}, http::status::ok, "");
  }

  void end_file(bool whole) {
    if (file_.empty()) return;
    server_.receiving_ = false;
    server_.host_.end_file(std::exchange(file_, {}), whole);
  }

  // An answer made here, after which the connection ends.
  void say(Request request, http::status status, std::string text) {
    said_ = std::move(text);
    drains_ = true;
    request.keep_alive(false);
    write(request, status, "text/plain; charset=utf-8", said_);
  }

  // Reads what is left of a file until the answer's time is over: a connection that is closed
  // before takes its answer with it.
  void drain() {
    buffer_.clear();
    stream_.async_read_some(buffer_.prepare(max_header),
                            [self = shared_from_this()](beast::error_code error, std::size_t) {
                              if (!error) self->drain();
                            });
  }

  void answer(Request request) {
    Admission admission = server_.judge(request, source_);
    if (admission.status == http::status::ok && websocket::is_upgrade(request)) {
      std::make_shared<PageSession>(server_, std::move(stream_), std::move(admission))
          ->start(request);
      return;
    }
    http::status status = admission.status;
    if (status == http::status::ok) {
      const std::string_view path = path_of(request);
      if (path == "/splat" && request.method() == http::verb::get) {
        splat_ = server_.host_.gaussians();
        const std::string_view bytes(reinterpret_cast<const char*>(splat_.data()),
                                     splat_.size() * sizeof(splat_.front()));
        if (!bytes.empty()) {
          request.keep_alive(false);
          return write(request, status, "application/octet-stream", bytes);
        }
      }
      for (const PageFile& file : page_files())
        if (file.path == path) return write(request, status, file.type, file.content);
      status = http::status::not_found;
    }
    write(request, status, "text/plain; charset=utf-8", explanation(status));
  }

  static std::string_view explanation(http::status status) {
    static const std::map<http::status, std::string_view> texts = {
        {http::status::method_not_allowed, "Only GET and HEAD are answered.\n"},
        {http::status::forbidden, "Not from this host or origin.\n"},
        {http::status::unauthorized, "The token is missing or wrong.\n"},
        {http::status::conflict, "Another file is being sent.\n"},
        {http::status::too_many_requests,
         "Too many wrong tokens came from this address; wait five minutes.\n"},
        {http::status::service_unavailable, "Too many pages are open.\n"}};
    const auto found = texts.find(status);
    return found == texts.end() ? "There is no such page.\n" : found->second;
  }

  void write(const Request& request, http::status status, std::string_view type,
             std::string_view content) {
    Response& response = response_.emplace(status, request.version());
    response.set(http::field::content_type, {type.data(), type.size()});
    response.set(http::field::cache_control, "no-store");
    response.set("Content-Security-Policy",
                 "default-src 'self'; img-src 'self' data:; style-src 'self' 'unsafe-inline'; "
                 "base-uri 'none'; form-action 'none'; frame-ancestors 'none'");
    response.set("X-Content-Type-Options", "nosniff");
    response.set("Referrer-Policy", "no-referrer");  // the address holds the token
    response.set("Cross-Origin-Resource-Policy", "same-origin");
    response.keep_alive(request.keep_alive());
    response.content_length(content.size());
    if (request.method() != http::verb::head) response.body() = {content.data(), content.size()};
    serializer_.emplace(response);
    stream_.expires_after(answer_timeout);
    write_more();
  }

  // As much as the connection takes. A splat may be large: there is time again for each part.
  void write_more() {
    http::async_write_some(stream_, *serializer_,
                           [self = shared_from_this()](beast::error_code error, std::size_t) {
                             if (!error && !self->serializer_->is_done()) {
                               if (!self->splat_.empty())
                                 self->stream_.expires_after(answer_timeout);
                               return self->write_more();
                             }
                             self->written(error);
                           });
  }

  void written(beast::error_code error) {
    if (file_parser_ && response_->result() == http::status::ok) end_file(true);
    if (error) return;
    if (response_->keep_alive()) return read();
    stream_.socket().shutdown(tcp::socket::shutdown_send, error);
    if (drains_) drain();
  }

  Impl& server_;
  std::string source_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{max_header};
  std::optional<http::request_parser<http::empty_body>> parser_;
  std::optional<Response> response_;
  std::vector<Body::DrawnGaussian> splat_;
  std::optional<http::response_serializer<http::span_body<const char>>> serializer_;
  std::string said_;     // what the response says, if it is made here
  bool drains_ = false;  // after the response, what is left of the request
  // Of a file that is being received; the path is empty once its end was told.
  std::optional<http::request_parser<http::file_body>> file_parser_;
  std::filesystem::path file_;
};

// Closes the oldest connection of the address that has the most, if there are too many.
void ViewerServer::Impl::make_room() {
  if (connections_.size() < max_connections) return;
  std::map<std::string, int> counts;
  for (const HttpSession* connection : connections_) ++counts[connection->source()];
  const auto busiest =
      std::max_element(counts.begin(), counts.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  const auto oldest = std::find_if(
      connections_.begin(), connections_.end(),
      [&](const HttpSession* connection) { return connection->source() == busiest->first; });
  HttpSession* closed = *oldest;
  connections_.erase(oldest);
  closed->close();
}

void ViewerServer::Impl::accept() {
  acceptor_.async_accept([this](beast::error_code error, tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    if (error) {  // out of files, most likely: some may be closed in a while
      accept_again_.expires_after(std::chrono::milliseconds(100));
      accept_again_.async_wait([this](beast::error_code stopped) {
        if (!stopped) accept();
      });
      return;
    }
    make_room();
    socket.set_option(tcp::no_delay(true), error);
    std::make_shared<HttpSession>(*this, std::move(socket))->read();
    accept();
  });
}

ViewerServer::ViewerServer(const ViewerOptions& options, ViewerHost& host)
    : impl_(std::make_unique<Impl>(options, host)) {}
ViewerServer::~ViewerServer() = default;

std::uint16_t ViewerServer::port() const { return impl_->port(); }
std::string ViewerServer::url(const std::string& host) const { return impl_->url(host); }
std::string ViewerServer::operator_url() const { return impl_->operator_url(); }
std::string ViewerServer::opening_url() const { return impl_->opening_url(); }
void ViewerServer::show(std::uint8_t camera, ViewerMessage message) {
  impl_->show(camera, std::move(message));
}

std::string make_token() {
  constexpr std::string_view digits = "0123456789abcdef";
  std::random_device random;  // the system's own generator on Linux
  std::uniform_int_distribution<std::size_t> digit(0, digits.size() - 1);
  std::string token(32, '0');
  for (char& c : token) c = digits[digit(random)];
  return token;
}

}  // namespace palpate
