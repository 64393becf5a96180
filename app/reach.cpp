// SPDX-License-Identifier: Apache-2.0
#include "app/reach.hpp"

#include <algorithm>
#include <array>
#include <memory>

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <qrencode.h>
#include <sys/socket.h>
#include <unistd.h>

namespace palpate::app {
namespace {

// Empty for what no other machine can use, and for families other than IP.
std::string ip_text(const sockaddr& address) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (address.sa_family == AF_INET) {
    const auto& ip = reinterpret_cast<const sockaddr_in&>(address).sin_addr;
    const std::uint32_t number = ntohl(ip.s_addr);
    if (number >> 24U == 127U || number >> 16U == 0xa9feU) return {};  // 169.254.x: link-local
    return inet_ntop(AF_INET, &ip, text.data(), text.size());
  }
  if (address.sa_family == AF_INET6) {
    const auto& ip = reinterpret_cast<const sockaddr_in6&>(address).sin6_addr;
    if (IN6_IS_ADDR_LOOPBACK(&ip) || IN6_IS_ADDR_LINKLOCAL(&ip)) return {};
    return "[" + std::string(inet_ntop(AF_INET6, &ip, text.data(), text.size())) + "]";
  }
  return {};
}

// The machine's address on the way to the rest of the world; empty: there is no such way. A
// datagram socket that is connected sends nothing.
std::string default_address() {
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (socket < 0) return {};
  sockaddr_in far{};
  far.sin_family = AF_INET;
  far.sin_port = htons(9);
  far.sin_addr.s_addr = htonl(0xc0000201U);  // 192.0.2.1, for documentation: nobody has it
  sockaddr_in own{};
  socklen_t size = sizeof(own);
  const bool known = connect(socket, reinterpret_cast<sockaddr*>(&far), sizeof(far)) == 0 &&
                     getsockname(socket, reinterpret_cast<sockaddr*>(&own), &size) == 0;
  close(socket);
  return known ? ip_text(reinterpret_cast<const sockaddr&>(own)) : "";
}

}  // namespace

std::vector<std::string> reachable_addresses(std::string_view listen) {
  const bool all_families = listen == "::";
  if (listen != "0.0.0.0" && !all_families) {
    const bool is_v6 = listen.find(':') != std::string_view::npos;
    return {is_v6 ? "[" + std::string(listen) + "]" : std::string(listen)};
  }
  ifaddrs* found = nullptr;
  if (getifaddrs(&found) != 0) return {};
  const std::unique_ptr<ifaddrs, decltype(&freeifaddrs)> owner(found, freeifaddrs);
  std::vector<std::string> addresses;
  for (const ifaddrs* i = found; i != nullptr; i = i->ifa_next) {
    if (i->ifa_addr == nullptr || (i->ifa_flags & IFF_UP) == 0) continue;
    if (i->ifa_addr->sa_family != AF_INET && !all_families) continue;
    const std::string text = ip_text(*i->ifa_addr);
    if (!text.empty()) addresses.push_back(text);
  }
  const std::string first = default_address();
  std::stable_partition(addresses.begin(), addresses.end(),
                        [](const std::string& address) { return address.front() != '['; });
  std::stable_partition(addresses.begin(), addresses.end(),
                        [&](const std::string& address) { return address == first; });
  return addresses;
}

std::string qr_code(const std::string& text) {
  const std::unique_ptr<QRcode, decltype(&QRcode_free)> code(
      QRcode_encodeString8bit(text.c_str(), 0, QR_ECLEVEL_L), QRcode_free);
  if (!code) return {};
  constexpr int quiet = 4;  // [modules] at each side, as ISO 18004 asks for
  const int width = code->width;
  const auto is_light = [&](int row, int column) {
    if (row < 0 || row >= width || column < 0 || column >= width) return true;
    return (code->data[row * width + column] & 1U) == 0;
  };
  std::string drawn;
  for (int row = -quiet; row < width + quiet; row += 2) {
    drawn += "\x1b[97;40m";  // what is light is drawn, whatever the terminal's own colours
    for (int column = -quiet; column < width + quiet; ++column) {
      const bool upper = is_light(row, column);
      const bool lower = is_light(row + 1, column);
      drawn += upper ? (lower ? "█" : "▀") : (lower ? "▄" : " ");
    }
    drawn += "\x1b[0m\n";
  }
  return drawn;
}

}  // namespace palpate::app
