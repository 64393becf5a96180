// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <nlohmann/json.hpp>
#include <sys/socket.h>
#include <sys/time.h>

namespace palpate {

namespace http = boost::beast::http;
namespace websocket = boost::beast::websocket;

// A connection on which nothing waits for longer than a minute.
inline boost::asio::ip::tcp::socket connect_to(boost::asio::io_context& context,
                                               std::uint16_t port) {
  boost::asio::ip::tcp::socket socket(context);
  socket.connect({boost::asio::ip::address_v4::loopback(), port});
  const timeval patience{60, 0};
  ::setsockopt(socket.native_handle(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  return socket;
}

/// A page's request to begin a session.
inline http::request<http::empty_body> upgrade_request(const std::string& target,
                                                       const std::string& host) {
  http::request<http::empty_body> request(http::verb::get, target, 11);
  request.set(http::field::host, host);
  request.set(http::field::connection, "Upgrade");
  request.set(http::field::upgrade, "websocket");
  request.set(http::field::sec_websocket_version, "13");
  request.set(http::field::sec_websocket_key, "dGhlIHNhbXBsZSBub25jZQ==");
  return request;
}

/// What a server answers to one request.
inline http::response<http::string_body> ask(std::uint16_t port, const std::string& target,
                                             const std::string& host,
                                             const std::string& origin = {},
                                             http::verb method = http::verb::get,
                                             bool upgrade = false) {
  boost::asio::io_context context;
  auto socket = connect_to(context, port);
  http::request<http::empty_body> request(method, target, 11);
  request.set(http::field::host, host);
  if (upgrade) request = upgrade_request(target, host);
  if (!origin.empty()) request.set(http::field::origin, origin);
  http::write(socket, request);
  http::response_parser<http::string_body> parser;
  parser.body_limit(16 << 20);
  parser.skip(method == http::verb::head);
  boost::beast::flat_buffer buffer;
  http::read(socket, buffer, parser);
  return parser.release();
}

/// What a server answers to a file that is sent. @param length  that is announced, if another
inline http::response<http::string_body> send_file(std::uint16_t port, const std::string& target,
                                                   const std::string& content,
                                                   const std::string& origin = {},
                                                   std::optional<std::size_t> length = {}) {
  boost::asio::io_context context;
  auto socket = connect_to(context, port);
  http::request<http::empty_body> request(http::verb::put, target, 11);
  request.set(http::field::host, "localhost");
  if (!origin.empty()) request.set(http::field::origin, origin);
  request.content_length(length.value_or(content.size()));
  http::request_serializer<http::empty_body> serializer(request);
  boost::beast::error_code refused;  // whoever is not welcome need not be read to the end
  http::write_header(socket, serializer, refused);
  boost::asio::write(socket, boost::asio::buffer(content), refused);
  if (length) socket.shutdown(boost::asio::ip::tcp::socket::shutdown_send, refused);
  http::response<http::string_body> answer;
  boost::beast::flat_buffer buffer;
  http::read(socket, buffer, answer);
  return answer;
}

/// A page, as the server sees one.
class Page {
 public:
  explicit Page(std::uint16_t port, const std::string& target = "/session",
                const std::string& host = "localhost", const std::string& origin = {})
      : port_(port),
        target_(target),
        host_(host),
        origin_(origin),
        socket_(connect_to(context_, port)) {
    socket_.set_option(websocket::stream_base::decorator([&](websocket::request_type& request) {
      if (!origin.empty()) request.set(http::field::origin, origin);
    }));
    socket_.read_message_max(64 << 20);
    socket_.handshake(host, target, error_);
  }

  [[nodiscard]] bool accepted() const { return !error_; }
  /// What such a request is answered with; Beast 1.74 does not tell why a handshake failed.
  [[nodiscard]] http::status refusal() const {
    return ask(port_, target_, host_, origin_, http::verb::get, true).result();
  }

  void send_text(const std::string& text) {
    socket_.text(true);
    socket_.write(boost::asio::buffer(text));
  }
  void send_binary(const std::vector<std::byte>& bytes) {
    socket_.binary(true);
    socket_.write(boost::asio::buffer(bytes.data(), bytes.size()));
  }
  void move_hand(bool held, double x, double y, double z) { send_hand(held ? 1 : 0, x, y, z); }
  /// @param grip  0 let go, 1 held, 2 let go and on its way to the place
  void send_hand(std::uint8_t grip, double x, double y, double z) {
    std::vector<std::byte> bytes(32);
    bytes[0] = std::byte{16};
    bytes[1] = std::byte{grip};
    const double place[3] = {x, y, z};
    std::memcpy(bytes.data() + 8, place, sizeof place);
    send_binary(bytes);
  }
  void shown(std::uint8_t camera) {
    send_binary({std::byte{17}, std::byte{camera}, {}, {}, {}, {}, {}, {}});
  }

  /// The next message; none when the session has ended.
  std::optional<std::string> read() {
    boost::beast::flat_buffer buffer;
    socket_.read(buffer, error_);
    if (error_) return std::nullopt;
    return boost::beast::buffers_to_string(buffer.data());
  }
  [[nodiscard]] bool was_text() const { return socket_.got_text(); }
  [[nodiscard]] unsigned close_code() const { return socket_.reason().code; }

  /// Reads on until a text message of that verb; null when the session has ended.
  nlohmann::json until(const std::string& verb) {
    while (const auto message = read()) {
      if (!was_text()) continue;
      const auto json = nlohmann::json::parse(*message);
      if (json.contains(verb)) return json[verb];
    }
    return nullptr;
  }
  /// Reads on until a binary message of that kind; empty when the session has ended.
  std::string until_kind(char kind) {
    while (const auto message = read()) {
      if (!was_text() && !message->empty() && message->front() == kind) return *message;
    }
    return {};
  }

 private:
  std::uint16_t port_;
  std::string target_, host_, origin_;
  boost::asio::io_context context_;
  websocket::stream<boost::asio::ip::tcp::socket> socket_;
  boost::beast::error_code error_;
};

}  // namespace palpate
