// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/core/box_tree.hpp"

namespace palpate {

/// What a virtual camera looks at: a mesh, a splat. At rest, in a frame of its own [m]; immutable.
class Body {
 public:
  /// A pinhole camera without distortion, and between which depths it sees.
  struct View {
    Eigen::Isometry3d body_from_camera;  ///< optical frame
    Intrinsics intrinsics;
    double nearest, farthest;  ///< [m] along the optical axis, > 0
  };

  virtual ~Body() = default;
  [[nodiscard]] virtual const Box& bounds() const = 0;
  /// The place of its surface that is nearest to `at`.
  [[nodiscard]] virtual Vec3 nearest(const Vec3& at) const = 0;
  /// Draws the depth [m, along the optical axis] that each pixel sees, row by row; infinite where
  /// there is nothing. @param depth  of width * height
  virtual void draw(const View& view, std::span<float> depth) const = 0;
  /// Twelve numbers of a Gaussian in the world, as pages draw it: mean [m], colour (65536 red + 256
  /// green + blue), covariance [m^2] (xx xy xz yy yz zz), opacity, and 0.
  using DrawnGaussian = std::array<float, 12>;
  /// All that are felt; empty: it has none.
  [[nodiscard]] virtual std::vector<DrawnGaussian> gaussians(
      const Eigen::Isometry3d& /*world_from_body*/) const {
    return {};
  }
};

/// Triangles, closed or not, seen from both sides. Of any number: depth is drawn of those alone
/// that are in sight, found by a tree of boxes.
class MeshBody final : public Body {
 public:
  /// Triangles with a corner that is not finite are left out.
  /// @param points  [m]
  /// @param name    for messages
  /// @throws Error if no triangle is left, or an index is out of range.
  MeshBody(const std::vector<Vec3>& points,
           const std::vector<std::array<std::uint32_t, 3>>& triangles, const std::string& name);

  [[nodiscard]] const Box& bounds() const override { return tree_->bounds(); }
  [[nodiscard]] Vec3 nearest(const Vec3& at) const override;
  void draw(const View& view, std::span<float> depth) const override;

 private:
  using Corners = std::array<Eigen::Vector3f, 3>;
  std::vector<Corners> triangles_;  // in the order of the tree
  std::optional<BoxTree> tree_;
};

/// One Gaussian of a splat.
struct Gaussian {
  Eigen::Vector3f mean;   ///< [m]
  Eigen::Vector3f sigma;  ///< [m] along the axes of `turn`
  Eigen::Quaternionf turn;
  float opacity;                                      ///< [-] 0 to 1, at the mean
  std::array<std::uint8_t, 3> colour{128, 128, 128};  ///< red, green, blue
};

/// A splat: depth is where the opacity gathered along a ray passes one half (docs/sources.md). What
/// hides a Gaussian does not count, or whatever sticks out of a rough surface would be its place.
class SplatBody final : public Body {
 public:
  /// Gaussians that are not finite or hide less than 5 % at their centre are left out, and those
  /// that touch fewer than four others: floaters.
  /// @param name  for messages
  /// @throws Error if none is left that hides half.
  SplatBody(std::vector<Gaussian> gaussians, const std::string& name);

  [[nodiscard]] std::size_t size() const { return gaussians_.size(); }
  [[nodiscard]] std::size_t floaters() const { return floaters_; }
  [[nodiscard]] const Box& bounds() const override { return tree_->bounds(); }
  [[nodiscard]] Vec3 nearest(const Vec3& at) const override;
  void draw(const View& view, std::span<float> depth) const override;
  [[nodiscard]] std::vector<DrawnGaussian> gaussians(
      const Eigen::Isometry3d& world_from_body) const override;

 private:
  void build_tree();
  [[nodiscard]] bool touches_others(const Gaussian& g) const;

  std::vector<Gaussian> gaussians_;  // in the order of the tree
  std::optional<BoxTree> tree_;
  std::size_t floaters_ = 0;
};

/// The part of space that a view sees, in the body's frame.
class SeenSpace {
 public:
  explicit SeenSpace(const Body::View& view);
  /// May it hold part of a box? Also true of some boxes that it just misses.
  [[nodiscard]] bool meets(const Box& box) const noexcept;

 private:
  std::array<Eigen::Vector4d, 6> planes_;  // (n, d): seen where n . place + d >= 0
};

/// The pixels whose rays (x, y, 1) have x and y within these bounds.
ViewingRays::Window pixels_between(const Intrinsics& k, const Eigen::Array2d& low,
                                   const Eigen::Array2d& high) noexcept;

/// A depth camera that looks at a body where the hand is, from outside: a window of 96 x 96 pixels
/// of 1 mm, seen from 0.25 m, in units of 10 um, without noise (docs/sources.md). Windows depend on
/// the places of the hand alone, so the same path gives the same frames.
class VirtualCamera final : public NumberedSource {
 public:
  /// @param frame_rate  [Hz] > 0
  VirtualCamera(std::shared_ptr<const Body> body, double frame_rate, SourceInfo info);

  /// Frame k is stamped k / frame_rate. Before a hand is known, the body is seen from above.
  std::optional<Frame> next(double timeout = no_timeout) override;
  void follow(const Vec3& hand) override;
  bool place(const Eigen::Isometry3d& world_from_body, const std::string& uri) override;

 private:
  // A place of the surface, and the unit vector from there to where the camera is to be.
  struct Aim {
    Vec3 place, outward;
    double free;  // [m] above the place, up to which nothing hides it
  };
  [[nodiscard]] std::optional<Aim> pressed();
  [[nodiscard]] Aim aim();
  [[nodiscard]] Aim aim_from(const Vec3& place, const Vec3& from) const;
  [[nodiscard]] bool shows(const Aim& aim) const;
  void look(const Aim& aim);

  std::shared_ptr<const Body> body_;
  std::shared_ptr<const ViewingRays> rays_;
  double frame_rate_;
  Eigen::Isometry3d world_from_body_ = Eigen::Isometry3d::Identity();
  // All in the body's frame.
  Vec3 hand_, hand_before_;
  bool was_pressed_ = false;
  bool is_hidden_ = false;
  Body::View view_;
  std::vector<float> depth_;  // as seen last; empty before
};

/// What a URI says of a body's files: `scale` of a unit [m], `up`, the axis which is the world's z.
struct BodyOptions {
  double scale;
  Eigen::Matrix3d turn;  ///< world_from_file
  double frame_rate;     ///< [Hz]
  std::string assumed;   ///< as SourceInfo::assumed
};

/// Options scale=1m up=z fps=60Hz. @throws Error for others, or values out of range
/// @param y_up       the file's format says that y is up: the default of `up`
/// @param in_metres  it says that its unit is 1 m
BodyOptions body_options(const Uri& uri, bool y_up = false, bool in_metres = false);

/// A virtual camera on a body, said to look at `what`, "a mesh of 12 triangles".
std::unique_ptr<Source> open_body(const Uri& uri, const BodyOptions& options,
                                  std::shared_ptr<const Body> body, const std::string& what);

}  // namespace palpate
