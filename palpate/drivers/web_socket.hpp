// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <future>
#include <string>
#include <utility>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/use_future.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>

#include "palpate/kernel/core/error.hpp"

// Boost.Beast for who wants short texts and no waiting longer than told. For one file alone: it is
// long to compile.
namespace palpate::web {

namespace asio = boost::asio;
namespace beast = boost::beast;

inline std::string place_of(const std::string& host, int port) {
  return host + ":" + std::to_string(port);
}

inline std::chrono::nanoseconds time_of(double seconds) {
  return std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * seconds));
}

/// Lets what was begun end. @throws boost::system::system_error
template <class Result>
Result finish(asio::io_context& context, std::future<Result> begun) {
  context.restart();
  context.run();
  return begun.get();
}

/// Connects, and bounds what is done next on the stream. @param timeout  [s] for each of both
/// @throws Error naming the place if there is no such host, or nobody answers
inline void connect(asio::io_context& context, beast::tcp_stream& stream, const std::string& host,
                    int port, double timeout) {
  try {
    asio::ip::tcp::resolver resolver(context);
    const auto addresses = resolver.resolve(host, std::to_string(port));
    stream.expires_after(time_of(timeout));
    finish(context, stream.async_connect(addresses, asio::use_future));
    stream.socket().set_option(asio::ip::tcp::no_delay(true));
    stream.expires_after(time_of(timeout));
  } catch (const boost::system::system_error& error) {
    throw Error(place_of(host, port), "nobody answers (" + error.code().message() + ")");
  }
}

/// The body of what `GET target` is answered with. @throws Error as WebSocket
inline std::string http_get(const std::string& host, int port, const std::string& target,
                            double timeout) {
  namespace http = beast::http;
  asio::io_context context;
  beast::tcp_stream stream(context);
  connect(context, stream, host, port, timeout);
  http::request<http::empty_body> request(http::verb::get, target, 11);
  request.set(http::field::host, place_of(host, port));
  request.set(http::field::accept, "application/json");
  http::response<http::string_body> response;
  try {
    beast::flat_buffer buffer;
    finish(context, http::async_write(stream, request, asio::use_future));
    finish(context, http::async_read(stream, buffer, response, asio::use_future));
  } catch (const boost::system::system_error&) {
    response.result(http::status::unknown);
  }
  if (response.result() != http::status::ok)
    throw Error(place_of(host, port), "it does not tell " + target);
  return response.body();
}

/// A client's end of a WebSocket, without TLS. One thread; nothing waits for longer than it is
/// told.
class WebSocket {
 public:
  /// Connects and shakes hands. @param timeout  [s] for each of both, and for each text to be sent
  /// @throws Error naming the place if there is no such host, nobody answers, or not as one does
  WebSocket(const std::string& host, int port, double timeout)
      : place_(place_of(host, port)), timeout_(timeout) {
    connect(context_, beast::get_lowest_layer(socket_), host, port, timeout);
    constexpr std::size_t largest_message = std::size_t{1} << 20U;  // [byte]
    socket_.read_message_max(largest_message);
    try {
      finish(context_, socket_.async_handshake(place_, "/", asio::use_future));
    } catch (const boost::system::system_error& error) {
      throw Error(place_,
                  "the server does not answer as a WebSocket (" + error.code().message() + ")");
    }
    beast::get_lowest_layer(socket_).expires_never();
    context_.restart();
    read();
  }

  /// @throws Error if the other end is gone or takes nothing for the constructor's time-out
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

  /// The newest text that comes within `timeout` [s]; older ones are left out. Empty: none came.
  /// @throws Error if the other end is gone
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
  beast::websocket::stream<beast::tcp_stream, false> socket_{context_};  // without compression
  beast::flat_buffer buffer_;
  std::string newest_;  // that has come and was not asked for yet
  std::string sending_;
  bool is_sent_ = true;
  beast::error_code failure_;
};

}  // namespace palpate::web
