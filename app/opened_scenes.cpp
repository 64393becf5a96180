// SPDX-License-Identifier: Apache-2.0
#include "app/opened_scenes.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <system_error>
#include <utility>

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <qrencode.h>
#include <sys/socket.h>
#include <unistd.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/uri.hpp"

namespace palpate::app {

namespace {

namespace fs = std::filesystem;

fs::path state_file() {
  const char* state = std::getenv("XDG_STATE_HOME");
  if (state != nullptr && *state == '/') return fs::path(state) / "palpate/opened";
  const char* home = std::getenv("HOME");
  if (home != nullptr && *home == '/') return fs::path(home) / ".local/state/palpate/opened";
  return {};
}

bool is_within(const fs::path& file, const fs::path& folder) {
  return !folder.empty() && file.string().rfind(folder.string(), 0) == 0;
}

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

std::string absolute_uri(std::string_view text) {
  const Uri uri(text);
  const std::array<std::string_view, 7> of_files = {"tum", "depth", "pcd",      "ply",
                                                    "map", "splat", "recording"};
  if (std::find(of_files.begin(), of_files.end(), uri.scheme()) == of_files.end()) return {};
  std::error_code error;
  const fs::path path = fs::absolute(uri.path(), error).lexically_normal();
  if (error || uri.path().empty()) return {};
  const std::string_view options = text.substr(uri.scheme().size() + 1 + uri.path().size());
  return uri.scheme() + ":" + path.string() + std::string(options);
}

OpenedScenes::OpenedScenes(fs::path temporary)
    : temporary_(std::move(temporary)), file_(state_file()) {
  std::ifstream in(file_);
  for (std::string line; uris_.size() < most && std::getline(in, line);) {
    try {
      if (absolute_uri(line) == line) uris_.push_back(line);
    } catch (const Error&) {  // somebody else's line
      continue;
    }
  }
}

void OpenedScenes::add(std::string_view uri) {
  const std::string absolute = absolute_uri(uri);
  if (absolute.empty()) return;
  std::erase(uris_, absolute);
  uris_.insert(uris_.begin(), absolute);
  if (uris_.size() > most) uris_.resize(most);
  save();
}

void OpenedScenes::remove(std::string_view uri) {
  if (std::erase(uris_, absolute_uri(uri)) > 0) save();
}

std::vector<std::string> OpenedScenes::uris() const {
  std::vector<std::string> there;
  std::error_code unused;
  for (const std::string& uri : uris_) {
    if (fs::exists(Uri(uri).path(), unused)) there.push_back(uri);
  }
  return there;
}

void OpenedScenes::save() const {
  if (file_.empty()) return;
  std::error_code error;
  fs::create_directories(file_.parent_path(), error);
  const fs::path written = file_.string() + "~";
  std::ofstream out(written);
  for (const std::string& uri : uris_) {
    if (!is_within(Uri(uri).path(), temporary_)) out << uri << '\n';
  }
  out.close();
  if (out) fs::rename(written, file_, error);
}

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
