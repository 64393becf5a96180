// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <nlohmann/json.hpp>

#include "palpate/drivers/channel_hand.hpp"
#include "palpate/drivers/drivers.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace haply {
namespace {

using Json = nlohmann::json;
namespace asio = boost::asio;
namespace beast = boost::beast;
using asio::ip::tcp;

constexpr std::string_view scheme = "haply:";
constexpr double opening_time = 2.0;     // [s] for each step of opening
constexpr double answer_time = 0.015;    // [s] for the answer to a message
constexpr double silence_of_loss = 0.5;  // [s] without an answer: the service is asked anew
constexpr double stale_time = 0.025;     // [s] a state that is older does not count
constexpr double idle_wait = 0.005;      // [s] between two messages while no force comes
constexpr double most_rise = 0.2;        // [N] from message to message
constexpr double clear_force = 0.05;     // [N] that a device must show to have taken
constexpr int answers_of_doubt = 30;     // in a row without that force
constexpr double rest_time = 0.2;        // [s] without a hand after anything went wrong
constexpr auto retry_interval = std::chrono::milliseconds(250);

// Boost.Beast for who wants short texts and no waiting longer than told.

std::string place_of(const std::string& host, int port) {
  return host + ":" + std::to_string(port);
}

std::chrono::nanoseconds time_of(double seconds) {
  return std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * seconds));
}

// Lets what `begin` begins with the handler that it is given end. If it fails, the socket must go
// before the context runs again. @param timeout  [s] @throws boost::system::system_error
template <class Begin>
void finish(asio::io_context& context, double timeout, const Begin& begin) {
  std::optional<beast::error_code> ended;
  begin([&ended](beast::error_code error, const auto&...) { ended = error; });
  context.restart();
  context.run_for(time_of(timeout));
  if (!ended) ended = beast::error::timeout;
  if (*ended) throw boost::system::system_error(*ended);
}

// @param timeout  [s] @throws Error naming the place if there is no such host, or nobody answers
void connect(asio::io_context& context, tcp::socket& socket, const std::string& host, int port,
             double timeout) {
  try {
    tcp::resolver resolver(context);
    const auto addresses = resolver.resolve(host, std::to_string(port));
    finish(context, timeout,
           [&](auto done) { asio::async_connect(socket, addresses, std::move(done)); });
    socket.set_option(tcp::no_delay(true));
  } catch (const boost::system::system_error& error) {
    throw Error(place_of(host, port), "nobody answers (" + error.code().message() + ")");
  }
}

// The body of what `GET target` is answered with. @throws Error as WebSocket
std::string http_get(const std::string& host, int port, const std::string& target, double timeout) {
  namespace http = beast::http;
  asio::io_context context;
  tcp::socket socket(context);
  connect(context, socket, host, port, timeout);
  http::request<http::empty_body> request(http::verb::get, target, 11);
  request.set(http::field::host, place_of(host, port));
  request.set(http::field::accept, "application/json");
  http::response<http::string_body> response;
  try {
    beast::flat_buffer buffer;
    finish(context, timeout,
           [&](auto done) { http::async_write(socket, request, std::move(done)); });
    finish(context, timeout,
           [&](auto done) { http::async_read(socket, buffer, response, std::move(done)); });
  } catch (const boost::system::system_error&) {
    response.result(http::status::unknown);
  }
  if (response.result() != http::status::ok)
    throw Error(place_of(host, port), "it does not tell " + target);
  return response.body();
}

// A client's end of a WebSocket, without TLS. One thread; nothing waits for longer than told.
class WebSocket {
 public:
  // Connects and shakes hands. @param timeout  [s] for each of both, and for each text to be sent
  // @throws Error naming the place if there is no such host, nobody answers, or not as one does
  WebSocket(const std::string& host, int port, double timeout)
      : place_(place_of(host, port)), timeout_(timeout) {
    connect(context_, beast::get_lowest_layer(socket_), host, port, timeout);
    constexpr std::size_t largest_message = std::size_t{1} << 20U;  // [byte]
    socket_.read_message_max(largest_message);
    try {
      finish(context_, timeout,
             [&](auto done) { socket_.async_handshake(place_, "/", std::move(done)); });
    } catch (const boost::system::system_error& error) {
      throw Error(place_,
                  "the server does not answer as a WebSocket (" + error.code().message() + ")");
    }
    context_.restart();
    read();
  }

  // @throws Error if the other end is gone or takes nothing for the constructor's time-out
  void send(std::string text) {
    sending_ = std::move(text);
    is_sent_ = false;
    socket_.async_write(asio::buffer(sending_), [this](beast::error_code error, std::size_t) {
      is_sent_ = true;
      if (error) failure_ = error;
    });
    if (!wait(timeout_, [this] { return is_sent_; }))
      throw Error(place_, "the service takes no messages");
  }

  // The newest text that comes within `timeout` [s]; older ones are left out. Empty: none came.
  // @throws Error if the other end is gone
  std::string receive(double timeout) {
    wait(timeout, [this] { return !newest_.empty(); });
    return std::exchange(newest_, {});
  }

 private:
  // Reads for as long as somebody waits.
  void read() {
    socket_.async_read(buffer_, [this](beast::error_code error, std::size_t) {
      if (error) {
        failure_ = error;
        return;
      }
      if (socket_.got_text()) newest_ = beast::buffers_to_string(buffer_.data());
      buffer_.consume(buffer_.size());
      read();
    });
  }

  // Up to `timeout` [s], and takes what has come by then. @return is it done?
  template <class Done>
  bool wait(double timeout, const Done& is_done) {
    const auto end = std::chrono::steady_clock::now() + time_of(timeout);
    while (!is_done() && !failure_ && context_.run_one_until(end) > 0) {
    }
    context_.poll();
    if (failure_) throw Error(place_, "the service went away (" + failure_.message() + ")");
    return is_done();
  }

  std::string place_;  // "localhost:10001"
  double timeout_;     // [s]
  asio::io_context context_;
  beast::websocket::stream<tcp::socket, false> socket_{context_};  // without compression
  beast::flat_buffer buffer_;
  std::string newest_;  // that has come and was not asked for yet
  std::string sending_;
  bool is_sent_ = true;
  beast::error_code failure_;
};

struct Wanted {
  std::string uri = {}, id = {}, host = "localhost";
  int port = 10001;
  double max_force = 2.0;  // [N]
};

// Where the service is, unless the URI says so: PALPATE_HAPLY=HOST:PORT, or this machine.
Wanted usual_place() {
  Wanted wanted;
  const char* place = std::getenv("PALPATE_HAPLY");
  const std::string text = place == nullptr ? "" : place;
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos) return wanted;
  wanted.host = text.substr(0, colon);
  int port = 0;
  const auto end = std::from_chars(text.data() + colon + 1, text.data() + text.size(), port).ptr;
  if (end != text.data() + text.size() || port < 1 || port > 65535)
    throw Error("PALPATE_HAPLY", "'" + text + "' is not the address of a service",
                "write HOST:PORT, such as localhost:10001");
  wanted.port = port;
  return wanted;
}

const char* remedy() {
  return "start Haply's Inverse Service (systemctl start haply-inverse-service), or name its place "
         "by ?host=NAME&port=NUMBER";
}

std::string version_of(const Wanted& wanted) {
  try {
    return Json::parse(http_get(wanted.host, wanted.port, "/version", 1.0)).value("git_tag", "");
  } catch (const std::exception&) {
    return "";
  }
}

std::unique_ptr<WebSocket> connected(const Wanted& wanted) {
  try {
    return std::make_unique<WebSocket>(wanted.host, wanted.port, opening_time);
  } catch (const Error& error) {
    throw Error(wanted.uri, std::string("no Inverse Service at ") + error.what(), remedy());
  }
}

// The number in front of and behind the first point of a version: "v3.5.2" is 305.
int number_of_version(const std::string& text) {
  const std::size_t begin = text.find_first_of("0123456789");
  if (begin == std::string::npos) return 0;
  int major = 0;
  int minor = 0;
  const char* const end = text.data() + text.size();
  const auto point = std::from_chars(text.data() + begin, end, major);
  if (point.ptr != end && *point.ptr == '.') std::from_chars(point.ptr + 1, end, minor);
  return 100 * std::clamp(major, 0, 99) + std::clamp(minor, 0, 99);
}

// What the service says first. @throws Error if it does not
Json inventory_of(WebSocket& service, const Wanted& wanted) {
  const std::string text = service.receive(opening_time);
  if (text.empty())
    throw Error(wanted.uri, "the service does not speak first, as an Inverse Service does",
                remedy());
  return Json::parse(text);
}

// All that follows throws a Json::exception where a message is not as the service writes it.

// What is left out keeps its value in `fallback`.
Vec3 vector_of(const Json& object, const char* name, const Vec3& fallback) {
  const Json vector = object.value(name, Json::object());
  return {vector.value("x", fallback.x()), vector.value("y", fallback.y()),
          vector.value("z", fallback.z())};
}

Json devices_in(const Json& message) { return message.value("inverse3", Json::array()); }

// The device of that id in a message, or the first if `id` is empty; null if there is none.
Json device_in(const Json& message, const std::string& id) {
  for (const Json& device : devices_in(message)) {
    if (id.empty() || device.value("device_id", "") == id) return device;
  }
  return nullptr;
}

DeviceFault fault_of_status(const Json& status) {
  if (!status.value("calibrated", true)) return DeviceFault::not_calibrated;
  if (!status.value("power_supply", true) || !status.value("ready", true))
    return DeviceFault::other;
  return DeviceFault::none;
}

// Bits of all grips' buttons, and the orientation of the first that tells one.
void read_grips(const Json& message, HandState& state) {
  std::optional<std::uint32_t> buttons;
  for (const char* kind : {"verse_grip", "wireless_verse_grip"}) {
    const Json grips = message.value(kind, Json::array());
    if (grips.empty()) continue;
    const Json grip = grips.front().value("state", Json::object());
    std::uint32_t pressed = grip.value("button", false) ? 1U : 0U;
    const Json several = grip.value("buttons", Json::object());
    for (unsigned i = 0; i < 3; ++i)
      if (several.value(std::string(1, "abc"[i]), false)) pressed |= 1U << i;
    buttons = buttons.value_or(0) | pressed;
    const Json turn = grip.value("orientation", Json::object());
    const Eigen::Quaterniond q(turn.value("w", 0.0), turn.value("x", 0.0), turn.value("y", 0.0),
                               turn.value("z", 0.0));
    if (q.coeffs().allFinite() && q.norm() > 0.5) state.orientation = q.normalized();
  }
  if (buttons) state.buttons = buttons;
}

class Inverse final : public ChannelHand {
 public:
  explicit Inverse(Wanted wanted) : ChannelHand(stale_time), wanted_(std::move(wanted)) {
    std::promise<void> opened;
    std::future<void> result = opened.get_future();
    thread_ = std::thread(&Inverse::run, this, std::move(opened));
    try {
      result.get();
    } catch (...) {
      end();
      throw;
    }
  }
  ~Inverse() override {
    disable();
    end();
  }

  [[nodiscard]] std::string fault_text() const override {
    const std::lock_guard lock(mutex_);
    return trouble_;
  }

 private:
  void end() {
    begin_end();
    thread_.join();
  }

  void set_trouble(const std::string& text) {
    const std::lock_guard lock(mutex_);
    trouble_ = text;
  }

  // ---- All below: the channel's thread.
  void run(std::promise<void> opened) {
    std::promise<void>* waiting = &opened;
    while (!is_ending()) {
      try {
        try {
          converse(waiting);
        } catch (const Json::exception&) {
          throw Error(wanted_.uri, "what the service says is not understood",
                      "use an Inverse Service from 3.1 on");
        }
      } catch (const std::exception& error) {
        if (waiting != nullptr) {
          waiting->set_exception(std::current_exception());
          return;
        }
        set_trouble(error.what());
        let_go(DeviceFault::disconnected);
        std::this_thread::sleep_for(retry_interval);
      }
    }
  }

  // No hand for long enough that the safety chain lets go, whatever the next answer says.
  void let_go(DeviceFault fault) {
    newest_.state.fault = rest_fault_ = fault;
    newest_.time = monotonic_now();
    rest_until_ = newest_.time + rest_time;
    asked_ = Vec3::Zero();
    seen_.put(newest_);
  }

  // One connection, to its end.
  void converse(std::promise<void>*& waiting) {
    const std::unique_ptr<WebSocket> service = connected(wanted_);
    WebSocket& channel = *service;
    const Json inventory = inventory_of(channel, wanted_);
    if (waiting != nullptr) {
      identify(inventory);
      waiting->set_value();
      waiting = nullptr;
    } else if (device_in(inventory, id_).is_null()) {
      throw Error(wanted_.uri, "the device is not plugged in");
    }
    channel.send(first_message());
    double heard = monotonic_now();
    while (!is_ending()) {
      const std::string answer = channel.receive(answer_time);
      const double now = monotonic_now();
      if (!answer.empty()) {
        heard = now;
        take(Json::parse(answer), now);
        word_.wait(idle_wait);
        channel.send(message_with(next_force()));
        continue;
      }
      if (now - heard > silence_of_loss)
        throw Error(wanted_.uri, "the service does not answer", remedy());
      // An answer is overdue or lost: let go, and ask again.
      let_go(DeviceFault::disconnected);
      channel.send(message_with(Vec3::Zero()));
    }
    channel.send(message_with(Vec3::Zero()));
    channel.receive(answer_time);
  }

  void identify(const Json& inventory) {
    const Json device = device_in(inventory, wanted_.id);
    if (device.is_null()) {
      std::string ids;
      for (const Json& one : devices_in(inventory)) add_to_list(ids, one.value("device_id", ""));
      if (ids.empty())
        throw Error(wanted_.uri, "the service sees no Inverse3", "check its power and its cable");
      throw Error(wanted_.uri, "there is no device '" + wanted_.id + "'", "there are: " + ids);
    }
    id_ = device.value("device_id", "");
    switch (fault_of_status(device.value("status", Json::object()))) {
      case DeviceFault::not_calibrated:
        throw Error(wanted_.uri, "the device " + id_ + " is not calibrated",
                    "calibrate it in Haply's Hub");
      case DeviceFault::other:
        throw Error(wanted_.uri, "the device " + id_ + " has no power or is not ready",
                    "plug in its power supply");
      default:
        break;
    }
    key_ = number_of_version(version_of(wanted_)) >= 305 ? "vector" : "values";
    const std::string type = device.value("config", Json::object()).value("type", "inverse3");
    info_.uri = wanted_.uri;
    info_.kind = type + " by Haply's Inverse Service";
    info_.limits = {.max_force = wanted_.max_force,
                    .continuous_force = wanted_.max_force,
                    .max_stiffness = 800.0,
                    .max_damping = 3.0};
    info_.reach = DeviceReach::ball(type == "minverse" ? 0.04 : 0.10);
    info_.serial = id_;
  }

  [[nodiscard]] std::string first_message() const {
    Json message = Json::parse(message_with(Vec3::Zero()));
    message["session"]["configure"] = {{"profile", {{"name", "org.palpate:palpate"}}},
                                       {"basis", {{"permutation", "XYZ"}}}};
    message["inverse3"][0]["configure"] = {{"preset", {{"preset", "arm_front_centered"}}}};
    return message.dump();
  }

  [[nodiscard]] std::string message_with(const Vec3& force) const {
    std::array<char, 256> text{};
    const int length =
        std::snprintf(text.data(), text.size(),
                      R"("commands":{"set_cursor_force":{"%s":{"x":%.5f,"y":%.5f,"z":%.5f}}}}]})",
                      key_, force.x(), force.y(), force.z());
    return R"({"inverse3":[{"device_id":)" + Json(id_).dump() + "," +
           std::string(text.data(), static_cast<std::size_t>(length));
  }

  Vec3 next_force() {
    // A channel that is late misses the beginning of a force: it must not begin with a step.
    const Vec3 force = newest_force(std::min(wanted_.max_force, asked_.norm() + most_rise));
    return asked_ = newest_.state.fault == DeviceFault::none ? force : Vec3::Zero();
  }

  void take(const Json& message, double now) {
    const Json device = device_in(message, id_);
    if (!device.contains("state")) return let_go(DeviceFault::disconnected);
    const Json& told = device.at("state");
    HandState& state = newest_.state;
    state.position = vector_of(told, "cursor_position", state.position);
    read_grips(message, state);
    if (device.contains("status")) status_ = fault_of_status(device.at("status"));
    state.fault = status_;
    if (state.fault == DeviceFault::none && now < rest_until_) state.fault = rest_fault_;
    newest_.time = now;
    seen_.put(newest_);
    doubt(vector_of(told, "current_cursor_force", Vec3::Zero()));
    if (state.fault == DeviceFault::none) set_trouble("");
  }

  // The service says which force it gives. If it gives none although one is asked for, the command
  // may have another form in its version: that is tried once.
  void doubt(const Vec3& given) {
    if (asked_.norm() < clear_force) return;
    if (given.norm() > 1e-6) {
      doubts_ = 0;
      confirmed_ = true;
      return;
    }
    if (confirmed_ || ++doubts_ < answers_of_doubt) return;
    doubts_ = 0;
    let_go(DeviceFault::refused_command);
    if (std::exchange(changed_, true)) {
      set_trouble(
          "the service takes no force, neither by 'values' nor by 'vector'; use a "
          "version of it from 3.1 on");
      return;
    }
    key_ = std::string_view(key_) == "values" ? "vector" : "values";
  }

  Wanted wanted_;
  mutable std::mutex mutex_;  // of trouble_; the servo never takes it
  std::string trouble_;
  // Of the channel's thread:
  std::string id_;
  const char* key_ = "values";  // in which the service wants a force
  Seen newest_;
  Vec3 asked_ = Vec3::Zero();  // [N] in the message that was sent last
  DeviceFault status_ = DeviceFault::none;
  int doubts_ = 0;
  bool confirmed_ = false, changed_ = false;
  double rest_until_ = 0.0;  // [s] no hand until then
  DeviceFault rest_fault_ = DeviceFault::none;
  std::thread thread_;
};

Wanted wanted_by(const Uri& uri) {
  uri.allow_only(std::to_array<std::string_view>({"host", "port", "max_force"}));
  Wanted wanted = usual_place();
  wanted.uri = uri.text();
  wanted.id = uri.path();
  wanted.host = uri.text_option("host", wanted.host);
  wanted.port = static_cast<int>(uri.number_option("port", wanted.port, 1, 65535, "-"));
  wanted.max_force = uri.number_option("max_force", wanted.max_force, 0.1, 10.0, "N");
  return wanted;
}

std::unique_ptr<Device> open_inverse(const Uri& uri) {
  return std::make_unique<Inverse>(wanted_by(uri));
}

DriverReport look() {
  Wanted wanted = usual_place();
  wanted.uri = scheme;
  const std::unique_ptr<WebSocket> service = connected(wanted);
  DriverReport report{.library = "ws://" + place_of(wanted.host, wanted.port),
                      .version = version_of(wanted)};
  for (const Json& device : devices_in(inventory_of(*service, wanted))) {
    const std::string id = device.value("device_id", "");
    PluggedIn one{.uri = std::string(scheme) + id, .name = "Inverse3", .serial = id};
    const Json status = device.value("status", Json::object());
    if (!status.value("calibrated", true)) one.note = "not calibrated: calibrate it in Haply's Hub";
    if (!status.value("power_supply", true)) one.note = "no power: plug in its power supply";
    report.found.push_back(one);
  }
  return report;
}

}  // namespace
}  // namespace haply

/// docs/devices.md describes it. What the service does with the last force when it is not spoken to
/// any more is not documented with a time, so a program holds it by a guard (open_guarded).
Driver haply_driver() {
  return {.name = "haply",
          .summary = "Haply's Inverse3, Inverse3x and Minverse, by their Inverse Service",
          .tried = "only an emulator of the service",
          .open_device = haply::open_inverse,
          .look = reporting(haply::look),
          .needs_guard = true};
}

}  // namespace palpate
