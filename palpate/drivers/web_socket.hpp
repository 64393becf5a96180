// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <string_view>

namespace palpate {

/// A client's end of a WebSocket (RFC 6455) for short texts, without TLS. One thread; nothing waits
/// for longer than it is told.
class WebSocketClient {
 public:
  /// Connects and shakes hands. @param timeout  [s] for each of both
  /// @throws Error naming the place if there is no such host, nobody answers, or not as one does
  WebSocketClient(const std::string& host, int port, double timeout);
  ~WebSocketClient();
  WebSocketClient(const WebSocketClient&) = delete;
  WebSocketClient& operator=(const WebSocketClient&) = delete;

  /// @throws Error if the other end is gone or takes nothing for the constructor's time-out
  void send(std::string_view text);
  /// The newest text that comes within `timeout` [s]; older ones are left out. Empty: none came.
  /// @throws Error if the other end is gone
  std::string receive(double timeout);

 private:
  void send_frame(std::uint8_t kind, std::string_view data);
  // The next whole text among the bytes that have come; false if there is none.
  bool take_text(std::string& text);
  // Waits for bytes up to `timeout` [s]; false if none came.
  bool read_some(double timeout);

  std::string place_;  // "localhost:10001"
  double timeout_;     // [s]
  int socket_ = -1;
  std::string bytes_;  // that have come and are not used yet
  std::string parts_;  // of a text in several frames
  std::mt19937 random_;
};

/// The body of what `GET target` is answered with. @throws Error as WebSocketClient
std::string http_get(const std::string& host, int port, const std::string& target, double timeout);

}  // namespace palpate
