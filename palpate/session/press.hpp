// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include <Eigen/Core>

#include "palpate/io/devices/hip_path.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/proposed_view.hpp"
#include "palpate/kernel/core/tick.hpp"
#include "palpate/session/frame_sequence.hpp"

namespace palpate {

/// A pixel of a depth image: column u and row v, from 0 at the top left.
struct Pixel {
  int u = 0;
  int v = 0;

  bool operator==(const Pixel&) const = default;
};

/// Reads "U,V". @param subject  the option concerned, for messages
/// @throws Error unless there are two whole numbers.
Pixel parse_pixel(std::string_view text, const std::string& subject);

/// Depth along the optical axis at a pixel [m]: the median of the measured pixels of the 7x7 about
/// it; none if there are none. O(1), allocates nothing.
std::optional<double> median_depth(const DepthImage& image, Pixel pixel) noexcept;

/// The surface at a pixel [m, world], by median_depth.
/// @throws Error for a pixel outside the image, or where nothing was measured (naming the nearest
///         pixel where something was).
Vec3 surface_at(const DepthImage& image, Pixel pixel);

/// How a surface is pressed and stroked.
struct PressOptions {
  double depth = 8e-3;     ///< [m] of the HIP behind the surface, along the line of sight
  double speed = 0.05;     ///< [m/s] of the HIP, down, along and up
  double approach = 0.02;  ///< [m] in front of the surface, where the hand begins and ends
  double hold = 0.5;       ///< [s] to be felt after pressing, and to stay before lifting
  double patience = 10.0;  ///< [s] in which it must have been felt; after that the hand lifts
  std::optional<Pixel> slide_to = {};  ///< stroke the surface to there, in between
};

/// A hand that presses what a pixel sees, led by the newest frame.
///
/// Until it is near, it follows what the pixel sees, frame by frame: the line of sight of the
/// newest frame's camera. At a hole, and where
/// pressing it was not felt, it takes the nearest pixel that shows a surface and no edge. From
/// `commits` in front of the surface on it keeps to that place, in the world, and follows the
/// surface there along the line of sight; it gives way to what is pressed too deep. Where the
/// frames know no poses, the world is the camera's own frame, and the hand goes with the camera.
/// Where nothing is felt, it goes back and tries again. What is no image gets the pixels of
/// proposed_view(). The same calls give the same places, bit for bit.
class Press {
 public:
  static constexpr double commits = 0.01;  ///< [m] in front of the surface
  static constexpr double travel = 1.0;    ///< [m/s] fastest in the air
  static constexpr double follows = 0.1;   ///< [m/s] fastest along the line, after a surface

  /// @param first  what the camera sees first
  /// @throws Error for a pixel outside the image, if nothing was measured at all, for options out
  ///         of range, or for what is neither an image nor points.
  Press(const Cloud& first, Pixel at, const PressOptions& options = {});

  /// The newest frame of the same camera. It must live until the next.
  void frame(const Cloud& cloud);
  /// Where the HIP is at `t` [s], which increases. @param last  the tick before; null: none yet
  const Vec3& step(double t, const Tick* last);
  /// Where it is now [m, world].
  [[nodiscard]] const Vec3& hip() const { return hip_; }
  /// It has lifted: nothing follows.
  [[nodiscard]] bool done() const { return phase_ == Phase::done; }
  /// The pixel that is pressed: the one asked for, or the nearest that measured something.
  [[nodiscard]] Pixel pixel() const { return line_.pixel; }

 private:
  enum class Phase : std::uint8_t { down, hold, slide, stay, lift, done };
  struct Line {  // of sight
    Vec3 from, along;
    double range = 0.0;  // [m] from there to the surface
    Pixel pixel;
    [[nodiscard]] Vec3 at(double behind) const { return from + (range + behind) * along; }
  };
  [[nodiscard]] std::optional<Line> look(double u, double v);
  [[nodiscard]] std::optional<Line> look_on_the_way();
  void lead(const Line& line);
  void follow();
  void begin_again();
  void give_way(double dt, const Tick* last);
  void advance(double dt, const Tick* last);

  PressOptions options_;
  Pixel asked_;
  const Cloud* cloud_;                // the newest
  std::optional<ProposedView> view_;  // of what is no image
  std::optional<SeenPoints> seen_{};  // in that view, of the newest frame, once it was looked at
  std::shared_ptr<const DepthImage> drawn_{};  // the same
  Line line_;
  double goal_range_ = 0.0;  // [m] where the newest frame has the surface
  double behind_;            // [m] the HIP is to be behind the surface
  Vec3 hip_;
  Phase phase_ = Phase::down;
  bool committed_ = false;
  bool missed_once_ = false;      // it must not be the pixel itself any more
  std::optional<double> rest_{};  // [m] from HIP to proxy where a force begins
  double slid_ = 0.0;             // [-] share of the way
  double way_ = 0.0;              // [m]
  Pixel slides_from_{};
  std::optional<double> t_{};         // [s] of the last step
  double spent_ = 0.0;                // [s] since the beginning
  double felt_ = 0.0, missed_ = 0.0;  // [s] in this phase; without a force, in a row
  std::shared_ptr<Patch> patch_ = std::make_shared<Patch>();
};

/// A path that strokes what an image shows: it comes down on the surface, presses into it and
/// strokes it in circles, following its relief, and comes up again. It is lifted over edges, behind
/// which a camera sees nothing.
///
/// Circles have a third of the image's height as diameter; one takes four seconds. The path keeps
/// `press` behind the measured surface along the camera's lines of sight.
/// @param duration  [s] of the whole path, at least 2
/// @param press     [m]
/// @throws Error if the middle of the image measures nothing.
HipPath stroke_path(const DepthImage& image, double duration, double press);

/// Where a hand can hover at first [m, world]: 50 mm before the middle of what a camera sees.
Vec3 hover_place(const Cloud& cloud);

/// Presses what cameras saw, tick by tick, each frame taken into use at the first tick at or after
/// its stamp; the proxy starts where the hand does. The same arguments give the same ticks, bit for
/// bit.
/// @param press    led by the first camera
/// @param rate     [Hz] ticks a second
/// @param on_tick  sees each tick; false ends the run
/// @throws Error as touch_along.
void touch_along(FrameSequence& frames, Method& method, Press& press, double rate,
                 const std::function<bool(const Tick&)>& on_tick);

}  // namespace palpate
