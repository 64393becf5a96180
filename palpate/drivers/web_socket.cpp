// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/web_socket.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>
#include <utility>

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {
namespace {

constexpr std::size_t largest_message = 1 << 20;  // [byte]
constexpr std::size_t largest_head = 1 << 14;     // [byte] of an answer in HTTP
enum Kind : std::uint8_t { more = 0, text_kind = 1, close_kind = 8, ping = 9, pong = 10 };
constexpr std::uint8_t last_frame = 0x80;
constexpr std::uint8_t is_masked = 0x80;

std::string place_of(const std::string& host, int port) {
  return host + ":" + std::to_string(port);
}

// Waits for up to `timeout` [s] until the socket can be read or written.
bool wait_for_socket(int socket, short events, double timeout) {
  pollfd descriptor{.fd = socket, .events = events, .revents = 0};
  return poll(&descriptor, 1, static_cast<int>(std::max(1e3 * timeout, 0.0) + 0.999)) > 0;
}

// A socket that never blocks, connected.
int connect_to(const std::string& host, int port, double timeout) {
  const std::string place = place_of(host, port);
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (const int error = getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found);
      error != 0)
    throw Error(place, std::string("there is no such host (") + gai_strerror(error) + ")");
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> list(found, freeaddrinfo);
  int reason = ETIMEDOUT;
  for (const addrinfo* one = found; one != nullptr; one = one->ai_next) {
    const int socket =
        ::socket(one->ai_family, one->ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, one->ai_protocol);
    if (socket < 0) continue;
    const int at_once = 1;
    setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &at_once, sizeof at_once);
    if (connect(socket, one->ai_addr, one->ai_addrlen) == 0) return socket;
    reason = errno;
    if (reason == EINPROGRESS && wait_for_socket(socket, POLLOUT, timeout)) {
      socklen_t size = sizeof reason;
      getsockopt(socket, SOL_SOCKET, SO_ERROR, &reason, &size);
      if (reason == 0) return socket;
    }
    close(socket);
  }
  throw Error(place, "nobody answers (" +
                         std::string(std::strerror(reason == EINPROGRESS ? ETIMEDOUT : reason)) +
                         ")");
}

void send_all(int socket, std::string_view data, double timeout, const std::string& place) {
  while (!data.empty()) {
    const ssize_t sent = ::send(socket, data.data(), data.size(), MSG_NOSIGNAL);
    if (sent > 0) {
      data.remove_prefix(static_cast<std::size_t>(sent));
    } else if (errno == EAGAIN || errno == EINTR) {
      if (!wait_for_socket(socket, POLLOUT, timeout))
        throw Error(place, "the service takes no messages");
    } else {
      throw Error(place, std::string("the service went away (") + std::strerror(errno) + ")");
    }
  }
}

// Adds what has come; false at the end of it.
bool receive_into(int socket, std::string& bytes) {
  char part[4096];
  const ssize_t size = recv(socket, static_cast<char*>(part), sizeof part, 0);
  if (size > 0) bytes.append(static_cast<const char*>(part), static_cast<std::size_t>(size));
  return size > 0 || (size < 0 && (errno == EAGAIN || errno == EINTR));
}

}  // namespace

WebSocketClient::WebSocketClient(const std::string& host, int port, double timeout)
    : place_(place_of(host, port)), timeout_(timeout), random_(std::random_device()()) {
  socket_ = connect_to(host, port, timeout);
  try {
    send_all(socket_,
             "GET / HTTP/1.1\r\nHost: " + place_ +
                 "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                 "Sec-WebSocket-Key: cGFscGF0ZSBzcGVha3MuLg==\r\n\r\n",
             timeout, place_);
    const double end = monotonic_now() + timeout;
    std::size_t head = std::string::npos;
    while ((head = bytes_.find("\r\n\r\n")) == std::string::npos) {
      if (bytes_.size() > largest_head || !read_some(end - monotonic_now()))
        throw Error(place_, "the server does not answer as a WebSocket");
    }
    if (bytes_.find(" 101 ") > bytes_.find("\r\n"))
      throw Error(place_, "the server does not support WebSocket (" +
                              bytes_.substr(0, std::min<std::size_t>(bytes_.find("\r\n"), 60)) +
                              ")");
    bytes_.erase(0, head + 4);
  } catch (...) {
    close(socket_);
    throw;
  }
}

WebSocketClient::~WebSocketClient() {
  close(socket_);
}

void WebSocketClient::send(std::string_view text) {
  send_frame(text_kind, text);
}

void WebSocketClient::send_frame(std::uint8_t kind, std::string_view data) {
  std::string frame;
  frame.push_back(static_cast<char>(last_frame | kind));
  if (data.size() < 126) {
    frame.push_back(static_cast<char>(is_masked | data.size()));
  } else {
    if (data.size() > 0xFFFF) throw Error(place_, "a message is too long to be sent");
    frame.push_back(static_cast<char>(is_masked | 126U));
    frame.push_back(static_cast<char>(data.size() >> 8U));
    frame.push_back(static_cast<char>(data.size() & 0xFFU));
  }
  const auto mask = static_cast<std::uint32_t>(random_());
  char key[4];
  std::memcpy(static_cast<char*>(key), &mask, sizeof key);
  frame.append(static_cast<const char*>(key), sizeof key);
  for (std::size_t i = 0; i < data.size(); ++i)
    frame.push_back(static_cast<char>(data[i] ^ key[i % 4]));
  send_all(socket_, frame, timeout_, place_);
}

bool WebSocketClient::read_some(double timeout) {
  if (!wait_for_socket(socket_, POLLIN, timeout)) return false;
  if (!receive_into(socket_, bytes_)) throw Error(place_, "the service went away");
  return true;
}

bool WebSocketClient::take_text(std::string& text) {
  const auto byte = [this](std::size_t i) { return static_cast<std::uint8_t>(bytes_[i]); };
  for (;;) {
    if (bytes_.size() < 2) return false;
    std::size_t size = byte(1) & 0x7FU;
    std::size_t begin = 2;
    if (size >= 126) {
      const std::size_t length = size == 126 ? 2 : 8;
      if (bytes_.size() < 2 + length) return false;
      begin += length;
      size = 0;
      for (std::size_t i = 0; i < length; ++i) size = (size << 8U) | byte(2 + i);
    }
    if (size > largest_message || parts_.size() + size > largest_message)
      throw Error(place_, "the service sends a message of more than 1 MB");
    if (bytes_.size() < begin + size) return false;
    const std::uint8_t head = byte(0);
    const std::string data = bytes_.substr(begin, size);
    bytes_.erase(0, begin + size);
    switch (head & 0x0FU) {
      case more:
      case text_kind:
        parts_ += data;
        if ((head & last_frame) == 0) break;
        text = std::exchange(parts_, {});
        return true;
      case ping:
        send_frame(pong, data);
        break;
      case close_kind:
        throw Error(place_, "the service has ended the conversation");
      default:
        break;  // binary and pong: nothing that is asked for
    }
  }
}

std::string WebSocketClient::receive(double timeout) {
  const double end = monotonic_now() + timeout;
  std::string newest;
  for (;;) {
    while (take_text(newest)) {
    }
    // What is on its way behind a text is newer; it is not waited for.
    if (!read_some(newest.empty() ? end - monotonic_now() : 0.0)) return newest;
  }
}

std::string http_get(const std::string& host, int port, const std::string& target, double timeout) {
  const std::string place = place_of(host, port);
  const int socket = connect_to(host, port, timeout);
  const std::unique_ptr<const int, void (*)(const int*)> closing(&socket,
                                                                 [](const int* s) { close(*s); });
  send_all(socket,
           "GET " + target + " HTTP/1.1\r\nHost: " + place +
               "\r\nAccept: application/json\r\nConnection: close\r\n\r\n",
           timeout, place);
  const double end = monotonic_now() + timeout;
  std::string bytes;
  while (bytes.size() < largest_message && wait_for_socket(socket, POLLIN, end - monotonic_now()) &&
         receive_into(socket, bytes)) {
  }
  const std::size_t head = bytes.find("\r\n\r\n");
  if (head == std::string::npos || bytes.find(" 200 ") > bytes.find("\r\n"))
    throw Error(place, "it does not tell " + target);
  return bytes.substr(head + 4);
}

}  // namespace palpate
