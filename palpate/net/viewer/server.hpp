// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "palpate/io/sources/virtual_camera.hpp"
#include "palpate/net/viewer/protocol.hpp"
#include "palpate/net/viewer/roles.hpp"

namespace palpate {

/// The program's side of the pages: gives them state and takes their commands.
///
/// All functions are called on the server's thread, never by two at a time.
class ViewerHost {
 public:
  virtual ~ViewerHost() = default;

  /// The first message to a page, as the JSON object of docs/protocol.md.
  virtual nlohmann::json hello() = 0;
  /// The state message that pages get a few times a second, likewise.
  virtual nlohmann::json state() = 0;
  /// The robot that the hand leads, likewise, 30 times a second; null: there is none.
  virtual nlohmann::json robot() = 0;
  /// The hands beside the first, likewise, 30 times a second; null: there are none.
  virtual nlohmann::json more_hands() = 0;
  /// Ticks since the last call; none if there was no tick.
  virtual std::optional<TickBatch> ticks() = 0;
  /// Does a page move the session's device? If not, no page ever holds the hand.
  virtual bool takes_hand() = 0;
  /// The one hand moved, or was let go.
  virtual void hand(const HandMessage& hand) = 0;
  /// A command that `check_allowed` allows the role of the page that asks.
  /// @throws Error to refuse: the page shows it.
  virtual void command(const Command& command, Role role) = 0;
  /// What pages draw of the splat that is felt; empty: there is none.
  virtual std::vector<Body::DrawnGaussian> gaussians() { return {}; }
  /// The operator's page begins to send a file that is to be touched.
  /// @return where it goes @throws Error to refuse: the page shows it.
  virtual std::filesystem::path begin_file(const std::string& name, std::uint64_t size) = 0;
  /// It has arrived, or (not `whole`) never will.
  virtual void end_file(const std::filesystem::path& file, bool whole) = 0;
};

struct ViewerOptions {
  std::string listen = "127.0.0.1";  ///< an address of this machine
  std::uint16_t port = 0;            ///< 0: any that is free
  /// What a page must present; may be empty only on a loopback address. Letters, digits, - and _.
  std::string token = {};
  /// What the operator's page must present, on loopback, too; 8 characters at least. Empty: one is
  /// made.
  std::string operator_token = {};
  double request_timeout = 5.0;  ///< [s] for a request to be there, from the connection's begin on
};

/// Serves the page and, by WebSocket, its sessions, on one thread of its own.
///
/// Several pages can look; the first that takes the hand has it until it releases, falls silent for
/// two seconds or is lost. A page that is slow gets fewer frames and never holds up anything.
/// Requests for another host, from another origin or without the token are refused, malformed
/// messages end their session. What a page may change depends on its Role; see docs/protocol.md.
class ViewerServer {
 public:
  /// Listens at once. @param host  must outlive the server
  /// @throws Error if the address cannot be listened on or the token does not do.
  ViewerServer(const ViewerOptions& options, ViewerHost& host);
  /// Ends all sessions and waits for the thread.
  ~ViewerServer();

  [[nodiscard]] std::uint16_t port() const;
  /// Where a browser finds the page, with the token: to look, and to hold the hand.
  /// @param host  by which it is found, an address or a name; empty: what it listens on
  [[nodiscard]] std::string url(const std::string& host = {}) const;
  /// The same for the operator.
  [[nodiscard]] std::string operator_url() const;
  /// The operator's page, once and within a minute: for a command line, which others may see.
  [[nodiscard]] std::string opening_url() const;

  /// For all pages from now on, until another of its kind comes: a camera's newest frame (pages see
  /// the newest, not each), the rays of its pixels (before its first frame if its lens is
  /// distorted), the path of the hand that was recorded with its frames, or, with the first camera,
  /// the tool in the hand. Any thread; takes a lock, so not the servo's. Of a camera beyond
  /// Patch::max_views nothing is shown.
  void show(std::uint8_t camera, ViewerMessage message);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// A random token of 128 bits.
std::string make_token();

/// A file of the page that the program carries inside itself.
struct PageFile {
  std::string_view path;  ///< as in a request, e.g. "/palpate.js"
  std::string_view type;  ///< as in Content-Type
  std::string_view content;
};

/// All of them; "/" is first. If the page was not built, there is only one that says so.
std::span<const PageFile> page_files();

}  // namespace palpate
