// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <Eigen/Geometry>
#include <nlohmann/json_fwd.hpp>

#include "palpate/kernel/cloud/frame.hpp"
#include "palpate/kernel/core/hand.hpp"
#include "palpate/kernel/core/patch.hpp"
#include "palpate/kernel/tool/tool_shape.hpp"
#include "palpate/servo/cycle.hpp"

namespace palpate {

/// The messages between program and page, as docs/protocol.md lays them out.

/// A message on its way to the pages: a head of its own, then what is shared, not copied.
struct ViewerMessage {
  bool text = false;
  bool is_frame = false;  ///< the camera's next one takes its place
  std::vector<std::byte> head = {};
  std::span<const std::byte> payload = {};
  std::shared_ptr<const void> owner = {};          ///< keeps the payload alive
  std::shared_ptr<const ColourImage> colour = {};  ///< behind the payload; null: nothing is
};

/// A camera's frame: its depth image as it was captured, with holes of 0 and 65535, not copied; or
/// its points, which are, those that are finite, with the faces of a mesh.
/// @param frame   of a DepthImage or a PointCloud
/// @param number  of this camera's frames, from 0
/// @throws Error if the size of the colour is not that of its image.
ViewerMessage frame_message(std::uint8_t camera, std::uint32_t number, const Frame& frame);

/// Where a distorted lens's pixels look: x and y of the ray (x, y, 1), NaN for none.
ViewerMessage rays_message(std::uint8_t camera, const ViewingRays& rays);

/// The path of the hand that was recorded with a camera's frames: t [s from the recording's first
/// frame], x, y, z [m, world] after one another.
ViewerMessage path_message(std::uint8_t camera, std::vector<float> txyz);

/// The surface of the tool in the hand, in its frame; null: a ball.
ViewerMessage tool_message(const ToolShape* tool);

/// A few ticks in one: what the plots show of them.
struct TickSample {
  double t = 0.0;            ///< [s] of the last
  float force = 0.0F;        ///< [N] largest
  float penetration = 0.0F;  ///< [m] largest depth of the HIP below the surface; 0: above it
  float steps = 0.0F;        ///< most
  float tick_time = 0.0F;    ///< [s] longest, of the thread's own time
  float relative = 0.0F;     ///< [J] given to the hand in this contact, relative to the surface
  float absolute = 0.0F;     ///< [J] the same with the surface's own motion
};

/// The newest tick, and what happened since the message before.
struct TickBatch : TickReport {
  std::vector<TickSample> samples =
      {};  ///< oldest first; at most `max_samples` are sent, the newest
  static constexpr std::size_t max_samples = 1024;
};
ViewerMessage ticks_message(const TickBatch& batch);

/// A message in words. Text that is not UTF-8 is sent with replacements.
ViewerMessage text_message(const nlohmann::json& words);

/// The page's hand: where it is to be, or that it was let go.
struct HandMessage {
  bool held = false;
  /// [m] world: where to. None, never of a held hand: it stays where it is.
  std::optional<Vec3> target = {};
  /// world_from_handle; none: as the device.
  std::optional<Rotation> orientation = {};
};
/// The page has drawn a frame and can take another.
struct ShownMessage {
  std::uint8_t camera;
  std::uint32_t number;
};

/// The page asks for a change in words. Values are not checked yet.
struct SetParameter {
  std::string name;
  double value;
};
struct SetSafetyParameter {
  std::string name;
  double value;
};
struct SetPlacement {
  std::string name;
  double value;
};
struct SetMethod {
  std::string name;
};
/// From now on the method touches with another tool; see make_tool.
struct SetTool {
  std::string text;
};
struct SetRecording {
  bool on;
};
/// How recordings are played; see Playback.
struct SetPlayback {
  bool paused;
  bool loop;
  double speed;
};
/// Recordings continue from another place: 0 is the first frame, 1 the last.
struct Seek {
  double share;
};
/// Another scene is to be touched, one of those that *hello* lists.
struct OpenScene {
  std::string uri;
};
/// What is touched is to be opened again, its lengths multiplied: two places of known distance were
/// picked.
struct Rescale {
  double times;
};
/// From now on what is touched is painted with a material; "" erases.
struct SetBrush {
  std::string material;
  double radius;  ///< [m]
};
/// What is touched is no longer painted.
struct DropBrush {};
struct ClearPaint {};
/// What is seen about the place that was touched last becomes a forbidden region.
struct Forbid {
  double size;    ///< [m] edge of the box about that place
  double margin;  ///< [m]
};
/// The stroke of the hand's last contact becomes a guide: a path, or a point if it hardly moved.
struct Guide {
  double slack;  ///< [m] from it within which the hand is free
};
struct RemoveFixture {
  std::string name;
};
struct ResetHand {};
/// Ends a latched fault of the safety chain; see Session::reset_faults.
struct ResetFaults {};
using Command =
    std::variant<SetParameter, SetSafetyParameter, SetPlacement, SetMethod, SetTool, SetRecording,
                 SetPlayback, Seek, OpenScene, Rescale, SetBrush, DropBrush, ClearPaint, Forbid,
                 Guide, RemoveFixture, ResetHand, ResetFaults>;

/// The longest message a page may send [bytes].
constexpr std::size_t max_page_message = 1024;
/// The farthest place a hand can be sent to [m].
constexpr double max_hand_distance = 1000.0;

/// A binary message from a page, or none if it is not one of the protocol's, to the byte.
std::optional<std::variant<HandMessage, ShownMessage>> parse_binary(
    std::span<const std::byte> message);

/// A text message from a page, or none if it is not one of the protocol's.
std::optional<Command> parse_command(std::string_view message);

/// Makes of the servo's ticks what pages are sent: the newest, and the extremes of a few at a time.
class TickBatcher {
 public:
  /// @param ticks_per_sample  at least 1
  explicit TickBatcher(unsigned ticks_per_sample) : ticks_per_sample_(ticks_per_sample) {}

  /// @param contact_radius  [m] r_c: the surface is that far below the proxy
  void add(const ServoTick& record, double contact_radius);
  /// What was added since the last call; none if nothing was. Ticks that do not make a whole sample
  /// yet are part of the next batch's samples.
  std::optional<TickBatch> take();

 private:
  unsigned ticks_per_sample_;
  unsigned pending_ = 0;
  TickSample sample_;
  TickBatch batch_;
  bool any_ = false;
};

}  // namespace palpate
