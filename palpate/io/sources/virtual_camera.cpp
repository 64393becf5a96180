// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/virtual_camera.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/linear.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace {

constexpr int window_size = 96;           // [px] width and height
constexpr double pixel_size = 1e-3;       // [m] at the surface
constexpr double standoff = 0.25;         // [m] from the surface to the camera
constexpr double last_depth = 0.4;        // [m] far behind where a hand is before the next frame
constexpr double first_depth = 1e-3;      // [m]
constexpr double drawn_units = 1e5;       // [1/m] 10 um
constexpr double most_across = 15e-3;     // [m] by which the place may leave the axis
constexpr double most_along = 30e-3;      // [m] by which it may come nearer or go away
constexpr double least_alike = 0.94;      // of 20 degrees, by which the direction may turn
constexpr double most_pressed = 0.1;      // [m] that a hand is behind a surface it has pressed
constexpr double depth_slack = 2e-3;      // [m] a hand may seem deeper than it has moved
constexpr double touching = 3e-3;         // [m] above a surface, where parts of a rough one are
constexpr double over_surface = 2e-3;     // [m] where space is taken to be free, if it is
constexpr double least_facing = 0.5;      // of 60 degrees, under which a place is seen
constexpr int plane_radius = 6;           // [px] of a plane fitted to the window
constexpr double plane_band = 5e-3;       // [m] of depth that belongs to it
constexpr double height_at_first = 0.05;  // [m] above the body, before a hand is known
constexpr float not_seen = std::numeric_limits<float>::infinity();

Intrinsics window_intrinsics() {
  constexpr double focal = standoff / pixel_size;
  constexpr double centre = 0.5 * (window_size - 1);
  return {.width = window_size,
          .height = window_size,
          .fx = focal,
          .fy = focal,
          .cx = centre,
          .cy = centre};
}

// A camera at `place` that looks along z, its x axis as near to `right` as can be.
Eigen::Isometry3d looking(const Vec3& place, const Vec3& z, const Vec3& right) {
  Vec3 x = right - right.dot(z) * z;
  if (x.norm() < 0.1) x = z.unitOrthogonal();
  x.normalize();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() << x, z.cross(x), z;
  pose.translation() = place;
  return pose;
}

// [m] from a place along a direction to the body.
double free_way(const Body& body, const Vec3& from, const Vec3& along) {
  const Intrinsics one{.width = 1, .height = 1, .fx = 1.0 / pixel_size, .fy = 1.0 / pixel_size};
  float depth = not_seen;
  body.draw({looking(from, along, along.unitOrthogonal()), one, 1e-6, standoff}, {&depth, 1});
  return depth;
}

}  // namespace

SeenSpace::SeenSpace(const Body::View& view) {
  const Intrinsics& k = view.intrinsics;
  const double left = (-0.5 - k.cx) / k.fx;
  const double right = (k.width - 0.5 - k.cx) / k.fx;
  const double top = (-0.5 - k.cy) / k.fy;
  const double bottom = (k.height - 0.5 - k.cy) / k.fy;
  // In the camera's frame.
  planes_ = {Eigen::Vector4d(1.0, 0.0, -left, 0.0),
             Eigen::Vector4d(-1.0, 0.0, right, 0.0),
             Eigen::Vector4d(0.0, 1.0, -top, 0.0),
             Eigen::Vector4d(0.0, -1.0, bottom, 0.0),
             Eigen::Vector4d(0.0, 0.0, 1.0, -view.nearest),
             Eigen::Vector4d(0.0, 0.0, -1.0, view.farthest)};
  for (Eigen::Vector4d& plane : planes_) {
    plane.head<3>() = view.body_from_camera.linear() * plane.head<3>();
    plane.w() -= plane.head<3>().dot(view.body_from_camera.translation());
  }
}

bool SeenSpace::meets(const Box& box) const noexcept {
  return std::all_of(planes_.begin(), planes_.end(), [&](const Eigen::Vector4d& plane) {
    double most = plane.w();  // of the corner that is the farthest along the normal
    for (int i = 0; i < 3; ++i) most += plane[i] * (plane[i] < 0.0 ? box.low[i] : box.high[i]);
    return most >= 0.0;
  });
}

ViewingRays::Window pixels_between(const Intrinsics& k, const Eigen::Array2d& low,
                                   const Eigen::Array2d& high) noexcept {
  const auto end = [](double at, int size) {
    return static_cast<int>(std::clamp(at + 1.0, 0.0, static_cast<double>(size)));
  };
  const auto first = [&](double at, int size) { return size - end(size - 1.0 - at, size); };
  return {first(k.fx * low.x() + k.cx, k.width), end(k.fx * high.x() + k.cx, k.width),
          first(k.fy * low.y() + k.cy, k.height), end(k.fy * high.y() + k.cy, k.height)};
}

VirtualCamera::VirtualCamera(std::shared_ptr<const Body> body, double frame_rate, SourceInfo info)
    : NumberedSource(std::move(info)),
      body_(std::move(body)),
      rays_(std::make_shared<const ViewingRays>(window_intrinsics())),
      frame_rate_(frame_rate) {
  info_.frame_rate = frame_rate;
  const Box& bounds = body_->bounds();
  hand_ = 0.5 * (bounds.low + bounds.high);
  hand_.z() = bounds.high.z() + height_at_first;
  hand_before_ = hand_;
  view_.intrinsics = window_intrinsics();
  view_.farthest = last_depth;
}

std::optional<Frame> VirtualCamera::next(double /*timeout*/) {
  if (const Aim wanted = aim(); !shows(wanted)) look(wanted);
  depth_.assign(std::size_t{window_size} * window_size, not_seen);
  body_->draw(view_, depth_);
  std::vector<std::uint16_t> readings(depth_.size());
  std::transform(depth_.begin(), depth_.end(), readings.begin(), [](float depth) {
    return std::isfinite(depth) ? static_cast<std::uint16_t>(std::lround(depth * drawn_units)) : 0;
  });
  const double stamp = static_cast<double>(next_++) / frame_rate_;
  return Frame{stamp,
               std::make_shared<const DepthImage>(rays_, std::move(readings), drawn_units,
                                                  world_from_body_ * view_.body_from_camera)};
}

void VirtualCamera::follow(const Vec3& hand) {
  if (hand.allFinite()) hand_ = world_from_body_.inverse() * hand;
}

bool VirtualCamera::place(const Eigen::Isometry3d& world_from_body, const std::string& uri) {
  world_from_body_ = world_from_body;
  if (!uri.empty()) info_.uri = uri;
  return true;
}

// The surface of the window before, where the hand is at it or has come through it.
std::optional<VirtualCamera::Aim> VirtualCamera::pressed() {
  const bool was_pressed = std::exchange(was_pressed_, false);
  if (depth_.empty()) return std::nullopt;
  const Vec3 hand = view_.body_from_camera.inverse() * hand_;
  const Intrinsics& k = view_.intrinsics;
  if (hand.z() < view_.nearest) return std::nullopt;
  const int u = static_cast<int>(std::lround(k.fx * hand.x() / hand.z() + k.cx));
  const int v = static_cast<int>(std::lround(k.fy * hand.y() / hand.z() + k.cy));
  const auto place = [&](int column, int row, double depth) {
    return Vec3(depth * (column - k.cx) / k.fx, depth * (row - k.cy) / k.fy, depth);
  };
  if (u < 0 || v < 0 || u >= window_size || v >= window_size) return std::nullopt;
  std::vector<Eigen::Vector3f> about;  // (column, row, depth)
  for (int row = std::max(v - plane_radius, 0); row <= std::min(v + plane_radius, window_size - 1);
       ++row) {
    for (int column = std::max(u - plane_radius, 0);
         column <= std::min(u + plane_radius, window_size - 1); ++column)
      about.emplace_back(column, row, depth_[static_cast<std::size_t>(row * window_size + column)]);
  }
  double middle = depth_[static_cast<std::size_t>(v * window_size + u)];
  if (was_pressed && !(middle < hand.z())) {  // through a hole in what is pressed
    const auto half = about.begin() + static_cast<std::ptrdiff_t>(about.size() / 2);
    std::nth_element(about.begin(), half, about.end(),
                     [](const auto& a, const auto& b) { return a.z() < b.z(); });
    middle = half->z();
  }
  if (!std::isfinite(middle)) return std::nullopt;
  const Vec3 centre = place(u, v, middle);
  Vec3 sum = Vec3::Zero();
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  int count = 0;
  for (const Eigen::Vector3f& pixel : about) {
    const Vec3 point =
        place(static_cast<int>(pixel.x()), static_cast<int>(pixel.y()), pixel.z()) - centre;
    if (!(std::abs(point.z()) < plane_band)) continue;
    sum += point;
    products += point * point.transpose();
    ++count;
  }
  Vec3 mean = Vec3::Zero();
  Vec3 normal = -Vec3::UnitZ();
  if (count > 2 * plane_radius) {
    mean = sum / count;
    normal = axes_of(products - count * mean * mean.transpose()).vectors.col(0);
    if (normal.z() > 0.0) normal = -normal;
  }
  const double depth = (centre + mean - hand).dot(normal);  // [m] of the hand behind that plane
  const double moved = (hand_ - hand_before_).norm();
  is_hidden_ = depth > (was_pressed ? most_pressed : moved + depth_slack);
  if (is_hidden_ || depth < -touching) return std::nullopt;
  was_pressed_ = depth > 0.0;
  const Vec3 outward = view_.body_from_camera.linear() * normal;
  const Vec3 surface = hand_ + depth * outward;
  double height = over_surface;
  // Parts of a rough surface may lie above that.
  for (int i = 0; i < 2; ++i, height *= 2.0) {
    const Vec3 at = surface + height * outward;
    if ((at - body_->nearest(at)).norm() > 0.5 * height) break;
  }
  return aim_from(surface, surface + height * outward);
}

VirtualCamera::Aim VirtualCamera::aim() {
  is_hidden_ = false;
  const std::optional<Aim> behind = pressed();
  hand_before_ = hand_;
  return behind ? *behind : aim_from(body_->nearest(hand_), hand_);
}

// Walks from a place in free space to where more of it is: that way nothing is in the way of seeing
// walls and floor of a corner.
VirtualCamera::Aim VirtualCamera::aim_from(const Vec3& place, const Vec3& from) const {
  const Vec3 before =
      depth_.empty() ? Vec3(Vec3::UnitZ()) : Vec3(-view_.body_from_camera.linear().col(2));
  Vec3 at = from;
  for (const double step : {0.01, 0.02, 0.04}) {
    const Vec3 away = at - body_->nearest(at);
    at += away.norm() > 1e-6 ? Vec3(step * away.normalized()) : Vec3(step * before);
  }
  Vec3 outward = (at - place).norm() > 1e-6 ? Vec3((at - place).normalized()) : before;
  const Vec3 facing = from - place;
  if (facing.norm() > 1e-6 && outward.dot(facing) < least_facing * facing.norm())
    outward = facing.normalized();
  const double height = std::max((from - place).dot(outward), over_surface);
  const double way = free_way(*body_, place + height * outward, outward);
  return {place, outward, std::isfinite(way) ? height + 0.5 * way : standoff};
}

bool VirtualCamera::shows(const Aim& aim) const {
  if (depth_.empty() || is_hidden_) return false;
  const Vec3 place = view_.body_from_camera.inverse() * aim.place;
  return place.head<2>().norm() <= most_across && std::abs(place.z() - standoff) <= most_along &&
         -view_.body_from_camera.linear().col(2).dot(aim.outward) >= least_alike;
}

void VirtualCamera::look(const Aim& aim) {
  const Vec3 right =
      depth_.empty() ? Vec3(Vec3::UnitX()) : Vec3(view_.body_from_camera.linear().col(0));
  view_.body_from_camera = looking(aim.place + standoff * aim.outward, -aim.outward, right);
  view_.nearest = std::max(standoff - aim.free, first_depth);
}

BodyOptions body_options(const Uri& uri, bool y_up, bool in_metres) {
  constexpr std::array<std::string_view, 3> known{"scale", "up", "fps"};
  constexpr std::array<std::string_view, 6> axes{"x", "y", "z", "-x", "-y", "-z"};
  uri.allow_only(known);
  BodyOptions options{.scale = uri.number_option("scale", 1.0, 1e-9, 1e9, "m"),
                      .turn = {},
                      .frame_rate = uri.number_option("fps", 60.0, 1.0, 1000.0, "Hz"),
                      .assumed = {}};
  const std::string up = uri.text_option("up", y_up ? "y" : "z");
  const auto* const found = std::find(axes.begin(), axes.end(), up);
  if (found == axes.end())
    throw Error(uri.text() + ": option 'up'", "'" + up + "' is no axis",
                "give x, y, z, -x, -y or -z");
  const auto number = found - axes.begin();
  const Vec3 axis = (number < 3 ? 1.0 : -1.0) * Vec3::Unit(number % 3);
  // The shortest turn of it onto z. Eigen's FromTwoVectors would need a decomposition.
  const Vec3 across = axis.cross(Vec3::UnitZ());
  const double twice = std::sqrt(2.0 * (1.0 + axis.z()));  // the cosine of half the angle
  options.turn = (twice > 0.0 ? Eigen::Quaterniond(0.5 * twice, across.x() / twice,
                                                   across.y() / twice, across.z() / twice)
                              : Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0))  // of -z, round x
                     .toRotationMatrix();
  if (!uri.has("scale") && !in_metres) options.assumed = "its unit is assumed to be 1 m (?scale=)";
  if (!uri.has("up") && !y_up)
    options.assumed +=
        (options.assumed.empty() ? "its" : ", its") + std::string(" z axis to be up (?up=)");
  return options;
}

std::unique_ptr<Source> open_body(const Uri& uri, const BodyOptions& options,
                                  std::shared_ptr<const Body> body, const std::string& what) {
  const Vec3 size = body->bounds().high - body->bounds().low;
  SourceInfo info{.uri = uri.text(),
                  .kind = "virtual camera on " + what + ", " + number_text(size.x()) + " x " +
                          number_text(size.y()) + " x " + number_text(size.z()) + " m",
                  .assumed = options.assumed,
                  .body = body};
  return std::make_unique<VirtualCamera>(std::move(body), options.frame_rate, std::move(info));
}

}  // namespace palpate
