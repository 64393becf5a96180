// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "palpate/io/bag/bag_reader.hpp"
#include "palpate/io/sources/bag_camera.hpp"
#include "palpate/record/session.hpp"

namespace palpate {

/// Reads what SessionWriter wrote, also of a session that was killed. Used on one thread.
class SessionReader {
 public:
  /// Of a hand after the first this reads the frames from the recording that holds it.
  /// @throws Error if it is no bag, not of palpate's, or damaged.
  explicit SessionReader(const std::filesystem::path& path);

  [[nodiscard]] const SessionInfo& info() const { return info_; }
  /// As BagReader::check().
  [[nodiscard]] BagCheck check() { return bag_.check(); }
  [[nodiscard]] std::size_t ticks() const { return ticks_.size(); }
  /// @param index  from 0, in the order of the session  @throws Error if it is damaged.
  [[nodiscard]] ServoTick tick(std::size_t index);
  /// Which columns its ticks have.
  [[nodiscard]] const TickRows& rows() const { return rows_; }
  /// @throws Error if they are not in the recording.
  [[nodiscard]] const ServoCommands& commands(std::uint64_t number) const;

  /// A frame as the renderer got it.
  struct PutFrame {
    double stamp = 0.0;  ///< [s]
    /// Which camera's which image; none if the frame was left out of the recording.
    std::optional<std::pair<std::size_t, std::size_t>> image;
  };
  /// By their number.
  [[nodiscard]] const std::map<std::uint64_t, PutFrame>& frames() const {
    return parent_ ? parent_->frames() : frames_;
  }
  /// How frames were taken into use, by their number.
  [[nodiscard]] const std::map<std::uint64_t, AdoptedFrame>& adopted() const { return adopted_; }
  /// What the cycle remembered before the first tick; none of a session from its start, or of
  /// another version's state.
  [[nodiscard]] const std::optional<CycleState>& state() const { return state_; }
  /// The numbers of the frames that a tick took into use.
  [[nodiscard]] std::span<const std::uint64_t> taken_in(const ServoTick& tick) const;
  /// What was seen, and by which camera. @throws Error if it is damaged or was left out.
  [[nodiscard]] FrameInUse seen(std::uint64_t number);

 private:
  struct Camera {
    std::optional<BagCamera> camera;
    std::size_t number = 0;  // of `cloud`
    std::shared_ptr<const Cloud> cloud;
  };

  static std::unique_ptr<SessionReader> parent_of(const std::filesystem::path& path);
  std::shared_ptr<const Cloud> cloud(std::size_t camera, std::size_t number);
  template <class Message, class Take>
  void read_all(std::string_view topic, const Take& take);

  BagReader bag_;
  SessionInfo info_;
  TickRows rows_;
  std::unique_ptr<SessionReader> parent_;  // of the first hand, if it has the frames
  std::vector<BagReader::Place> ticks_;
  std::map<std::uint64_t, ServoCommands> commands_;
  std::map<std::uint64_t, PutFrame> frames_;
  std::map<std::uint64_t, AdoptedFrame> adopted_;
  std::map<std::uint64_t, std::vector<std::uint64_t>> taken_;  // numbers of frames, by tick
  std::optional<CycleState> state_;
  std::map<std::size_t, Camera> cameras_;
};

/// The path of the hand in a recording: evenly spaced ticks, the last included.
/// @param most  of them, at least 2
/// @throws Error if it is no recording of palpate's, or damaged.
std::vector<Tick> recorded_hand(const std::filesystem::path& recording, std::size_t most);

}  // namespace palpate
