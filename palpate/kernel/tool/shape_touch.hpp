// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "palpate/kernel/core/hand_velocity.hpp"
#include "palpate/kernel/core/method.hpp"
#include "palpate/kernel/core/newest_frame.hpp"
#include "palpate/kernel/core/rotation.hpp"
#include "palpate/kernel/sight/frame_timing.hpp"
#include "palpate/kernel/tool/least_motion.hpp"
#include "palpate/kernel/tool/sliding_side.hpp"
#include "palpate/kernel/tool/tool_feel.hpp"
#include "palpate/kernel/tool/tool_shape.hpp"

namespace palpate {

/// Touches depth images with a tool that has a shape: a proxy with a pose, held outside what the
/// cameras see by Gauss' principle of least constraint, gives force and torque. docs/tools.md.
class ShapeTouch final : public Method {
 public:
  /// Allocates all it will ever need.
  /// @param shape  not null
  /// @throws Error if the parameters do not validate.
  ShapeTouch(std::shared_ptr<const ToolShape> shape, const Parameters& parameters);

  void seat(const Vec3& proxy) noexcept override;
  void observe(const Observation& seen) noexcept override;
  Tick tick(const Vec3& hip, double t) noexcept override { return tick(HandPose{hip}, t); }
  Tick tick(const HandPose& hand, double t) noexcept override;
  void set_parameters(const Parameters& parameters) noexcept override;
  /// @throws Error for points without an image, which have no lines of sight to look along.
  void check(const Cloud& cloud) const override;

 private:
  struct Pose {
    Vec3 at = Vec3::Zero();
    Rotation turn = Rotation::Identity();
  };
  /// One place where tool and surface are near each other.
  struct Contact {
    Vec3 lever;  // [m] from the proxy's origin to the tool's point
    SeenSurface::Fit fit;
    std::size_t camera, patch;
  };
  /// The limits of a step, and the contact of each.
  struct Limits {
    std::array<MotionLimit, most_motion_limits> limit;
    std::array<std::size_t, most_motion_limits> contact;
    std::size_t size = 0;
    void add(const Contact& of, std::size_t number, const Vec3& direction, double length) noexcept;
  };
  static constexpr std::size_t most_cameras = 4;  // those of further ones are not touched
  static constexpr std::size_t most_contacts = ToolShape::most_patches;
  /// The tool's points, patch by patch from coarse to fine; each patch fills whole blocks of
  /// `patch_block` with points that are nowhere.
  struct Shell {
    std::vector<float> x, y, z;                          // [m]
    std::vector<std::uint32_t> point;                    // its number in the tool
    std::array<std::size_t, most_contacts + 1> begin{};  // of each patch
    std::array<std::size_t, most_contacts> size{};       // the same without the rest of a block
  };
  enum Place : std::uint8_t { in_front, behind, slid_over };
  /// Which points are behind what they never were in front of, and which a body slid over.
  struct Behind {
    std::vector<std::uint8_t> is;                         // Place of the shell's points
    std::array<std::uint32_t, most_contacts> in_patch{};  // how many of them are not in front
  };
  /// What the tool's points meet at a pose.
  struct Scan {
    std::size_t inside = 0;   // points within a surface, not deeper than its sides
    std::size_t crossed = 0;  // of these, how many were in front in the last scan that was kept
    float least = 0.0F;       // [m] the smallest gap along the line of sight of all points known
    std::size_t looked = 0, known = 0;  // points, and those of which the surface is known
    std::array<std::uint32_t, most_contacts> point{};  // the nearest of each patch
    std::array<float, most_contacts> gap{};            // [m] its
    std::array<std::uint8_t, most_contacts> camera{};
  };

  void add_point(const Eigen::Vector3f& at, std::uint32_t point);
  [[nodiscard]] Eigen::Isometry3d isometry(const Pose& pose) const noexcept;
  void scan(const Pose& pose, std::size_t most, Scan& scan, Behind* behind) noexcept;
  void find_contacts(const Scan& scan) noexcept;
  void find_sliding_side() noexcept;
  [[nodiscard]] double way_to(const Pose& hand) const noexcept;
  [[nodiscard]] bool can_follow(const Pose& hand) noexcept;
  bool move(const Pose& hand) noexcept;
  void step(const Pose& hand) noexcept;
  void add_friction(std::size_t number, const Motion6& wanted, Limits& limits) noexcept;
  [[nodiscard]] Vec3 motion_at(const Motion6& motion, const Contact& contact) const noexcept;
  [[nodiscard]] Vec3 hand_velocity_at(const Vec3& lever) const noexcept;
  void feel(const Pose& hand, double t, const Vec3& surface, Tick& tick) noexcept;
  [[nodiscard]] double known_share(double t) const noexcept;
  void render(const Pose& hand, double t, Tick& tick) noexcept;
  void release(const Pose& hand) noexcept;

  std::shared_ptr<const ToolShape> shape_;
  Shell shell_;
  std::vector<float> gap_;      // [m] of the patch that is looked at
  Behind behind_, behind_now_;  // at the last scan that was kept, and at the newest
  Parameters parameters_;
  double turn_length_ = 0.0;  // [m] L of (2): the tool's, or what `turn_stiffness` leaves of it
  NewestFrame frame_;
  FrameTiming timing_;
  std::array<SeenSurface, most_cameras> seen_;
  bool placed_ = false;
  bool loose_ = true;  // began inside something, or lost it: nothing is felt until it is free
  bool touching_ = false;
  bool fresh_ = false;           // a frame came since the last scan
  bool taken_in_ = false;        // the last of one was taken in, in this tick
  bool slid_ = false;            // and it shows bodies that slid over cells
  SlidingSide sliding_side_;     // of a body that slid over the tool
  Vec3 support_ = Vec3::Zero();  // [m] world: what pushed in the last step and was no side
  Pose pose_;                    // of the proxy
  Pose kept_;                    // the newest that a scan has shown to be possible
  double stride_ = 0.0;          // [m] that a point may move in a step
  std::size_t moves_ = 1;        // steps of a tick at most
  std::array<Contact, most_contacts + SlidingSide::most_held> contacts_{};
  std::size_t contact_count_ = 0;
  /// The surface under a patch's point, as it was fitted in a tick.
  struct Plane {
    std::uint64_t tick = 0;
    std::uint32_t point = 0;
    Vec3 place = Vec3::Zero();  // [m] world
    std::optional<SeenSurface::Fit> fit = {};
  };
  std::array<Plane, most_contacts> planes_{};
  std::uint64_t ticks_ = 0;
  HeldBy held_;                   // its limits are numbers of contacts
  std::array<Vec3, 6> pushes_{};  // [m] world, of each of these, friction included
  double whole_ = 1.0;            // [-] of the way to the hand, over that of the last step
  ToolFeel feel_;
  ToolFeel::Movement movement_{Vec3::Zero(), Vec3::Zero(), 0.0};  // of the hand
  Pose last_pose_;                                                // of the proxy in the tick before
  Vec3 sliding_ = Vec3::Zero();                                   // [m/s] of the proxy, smoothed
  Vec3 sliding_spin_ = Vec3::Zero();                              // [rad/s] the same
  Vec3 last_hand_ = Vec3::Zero();                                 // [m]
  int steps_ = 0;
  HandVelocity hand_velocity_;
  Rotation last_turn_ = Rotation::Identity();
  Vec3 spin_ = Vec3::Zero();  // [rad/s] world, of the hand, smoothed
  double last_t_ = 0.0;
};

}  // namespace palpate
