// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "palpate/session/session.hpp"
#include "palpate/viewer/server.hpp"
#include "palpate/viewer/tick_batcher.hpp"

namespace palpate {

/// A session as pages see it: an observer that reads its ticks and frames and sends settings back.
///
/// Made before the session, whose frames it shows; then `attach`, then the server, then `show_on`.
class SessionHost final : public ViewerHost {
 public:
  /// @param version  of the program, for pages
  explicit SessionHost(std::string version) : version_(std::move(version)) {}

  /// Before there is a server. @param session  must outlive the server
  void attach(Session& session);
  /// @param server  shows the frames from now on; null: nobody does, before the server goes
  void show_on(ViewerServer* server) noexcept { server_.store(server, std::memory_order_release); }
  /// A camera's frame, as SessionOptions::on_frame: to all pages. Any camera's thread.
  void show(std::size_t camera, const FedFrame& frame);

  std::string hello() override;
  std::string state() override;
  std::optional<TickBatch> ticks() override;
  void hand(const std::optional<Vec3>& target) override;
  void command(const Command& command) override;

 private:
  void describe(std::uint8_t camera, const ViewingRays& rays);

  std::string version_;
  Session* session_ = nullptr;
  std::atomic<ViewerServer*> server_{nullptr};
  std::array<std::uint32_t, Patch::max_views> numbers_{};  // of each camera's own frames
  MouseDevice* mouse_ = nullptr;
  Vec3 start_ = Vec3::Zero();   // [m] where the mouse's hand began
  Vec3 target_ = Vec3::Zero();  // [m] where it was sent last
  std::optional<TickRing<ServoTick>::Reader> reader_;
  std::optional<TickBatcher> batcher_;
};

}  // namespace palpate
