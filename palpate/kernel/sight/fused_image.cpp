// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/sight/fused_image.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/kernel/cloud/implied_points.hpp"
#include "palpate/kernel/sight/monitor.hpp"
#include "palpate/kernel/sight/relief.hpp"

namespace palpate {
namespace {

constexpr std::size_t most_frames = 64;  // in a mean, as in a fit's
// [frames] in a row without a measurement make a hole; flicker at an edge is shorter.
constexpr float most_missed = 3.0F;
constexpr std::size_t least_pixels = 8;  // that measure a level
// The spread is that of a region wider than the one that measures the level, as noise correlates.
constexpr double spread_region = 3.0;
// [-] Where fewer of the pixels are near the level, another surface came in beside the first, and
// none is common to both.
constexpr float least_share = 0.7F;
constexpr int most_across = 16;         // pixels that are looked at, along either axis
constexpr double farthest_pixel = 1e6;  // [px] beyond any image

// A place in a camera's axes.
Vec3 seen_from(const DepthImage& image, const Vec3& place) {
  return image.world_from_camera().linear().transpose() *
         (place - image.world_from_camera().translation());
}

int nearest_pixel(double centre, double focal_length, double slope) {
  return static_cast<int>(
      std::lround(std::clamp(centre + focal_length * slope, -farthest_pixel, farthest_pixel)));
}

}  // namespace

void FusedImage::restart(const DepthImage& image, int u, int v) noexcept {
  camera_ = image.intrinsics();
  pose_ = image.world_from_camera();
  u_ = u - side / 2;
  v_ = v - side / 2;
  window_[0].frames.fill(0.0F);
  window_[0].missed.fill(0.0F);
  frames_ = 0;
  newest_ = spread_ = 0.0F;
  level_ = velocity_ = 0.0;
}

// Moves the window with the contact. What it leaves is forgotten.
void FusedImage::move_to(int u, int v) noexcept {
  const int from_u = u_;
  const int from_v = v_;
  const auto moves = [](int centre, int first) {
    return std::abs(centre - side / 2 - first) > side / 4;
  };
  if (!moves(u, u_) && !moves(v, v_)) return;
  u_ = u - side / 2;
  v_ = v - side / 2;
  for (int y = v_; y < v_ + side; ++y) {
    for (int x = u_; x < u_ + side; ++x) {
      const bool known = x >= from_u && y >= from_v && x < from_u + side && y < from_v + side;
      if (!known) window_[0].frames[index(x, y)] = window_[0].missed[index(x, y)] = 0.0F;
    }
  }
}

// The newest frame's level, of the pixels within `radius` [px] of (u, v). False if there are too
// few.
bool FusedImage::find_level(int u, int v, double radius) noexcept {
  std::array<float, std::size_t{most_across + 2} * (most_across + 2)> values;
  double noise = 0.0;
  const auto look = [&](double within) {
    noise = 0.0;
    const int reach = std::max(1, static_cast<int>(within));
    const int stride = 1 + 2 * reach / most_across;
    std::size_t size = 0;
    for (int y = v - reach; y <= v + reach; y += stride) {
      for (int x = u - reach; x <= u + reach; x += stride) {
        const int squared = (x - u) * (x - u) + (y - v) * (y - v);
        if (squared > reach * reach || !holds(x, y) || x < 0 || y < 0 || x >= camera_.width ||
            y >= camera_.height)
          continue;
        const auto z = static_cast<float>(image_->depth_at(x, y));
        if (!(z > 0.0F && window_[0].frames[index(x, y)] > 0.0F)) continue;
        values[size++] = z - window_[0].relief[index(x, y)];
        noise += image_->noise_at(x, y, 1.0);
      }
    }
    return std::span(values.data(), size);
  };
  const std::span<float> near = look(radius);
  if (near.size() < least_pixels) return false;
  const Level level = level_of(near, spread_);
  if (level.share < least_share) return false;
  newest_ = level.height;
  const std::span<float> wide = look(spread_region * radius);
  if (wide.size() < least_pixels) return false;
  spread_ = next_spread(spread_, newest_, wide, image_->units_per_metre());
  mean_noise_ = noise / static_cast<double>(wide.size());
  return true;
}

// Takes the newest reading [m], 0 for none, into a pixel's relief.
// @param spread  [m] standard deviation of the reading
void FusedImage::update(std::size_t i, float z, float spread) noexcept {
  Window& known = window_[0];
  if (z == 0.0F) {
    known.missed[i] += 1.0F;
    if (known.missed[i] > most_missed) known.frames[i] = 0.0F;
    return;
  }
  known.missed[i] = 0.0F;
  follow_relief(z - newest_, spread, most_frames, known.relief[i], known.drift[i], known.frames[i]);
}

void FusedImage::update() noexcept {
  // The spread is measured; how it differs from pixel to pixel is what the image says.
  const double per_noise = spread_ / mean_noise_;
  for (int v = std::max(v_, 0); v < std::min(v_ + side, camera_.height); ++v) {
    for (int u = std::max(u_, 0); u < std::min(u_ + side, camera_.width); ++u)
      update(index(u, v), static_cast<float>(image_->depth_at(u, v)),
             static_cast<float>(per_noise * image_->noise_at(u, v, mean_noise_)));
  }
}

void FusedImage::observe(const DepthImage& image, const Look& look,
                         const SightParameters& parameters) noexcept {
  const bool goes_on = frames_ > 0 && camera_ == image.intrinsics() && look.stamp > stamp_ &&
                       pose_.matrix() == image.world_from_camera().matrix();
  image_ = &image;
  stamp_ = look.stamp;
  interval_ = look.interval;
  const Vec3 p = seen_from(image, look.place);
  const Vec3 ray = p / std::max(p.z(), look.radius);  // never at the camera itself
  ray_ = image.world_from_camera().linear() * ray;
  const Intrinsics& k = image.intrinsics();
  const int u = nearest_pixel(k.cx, k.fx, ray.x());
  const int v = nearest_pixel(k.cy, k.fy, ray.y());
  if (goes_on) move_to(u, v);
  const double pitch = image.spacing(look.place);
  const float before = newest_;
  // A level that jumps farther than a surface moves is of another one.
  if (!goes_on || !(pitch > 0.0) || !find_level(u, v, look.radius / pitch) ||
      std::abs(double{newest_} - double{before}) > farthest_strike * parameters.detail)
    restart(image, u, v);
  update();
  frames_ = std::min(frames_ + 1, most_frames);
  std::copy_backward(levels_.begin(), levels_.begin() + most_frames - 1,
                     levels_.begin() + most_frames);
  levels_[0] = {look.stamp, double{newest_}};
  const HeightTrack track =
      track_height(std::span(levels_.data(), frames_), look.sd, look.interval, parameters);
  correction_ = frames_ > 1 ? track.height - level_ : 0.0;
  level_ = track.height;
  velocity_ = track.velocity;
}

bool FusedImage::is_in_front(const Vec3& place) const noexcept {
  const Vec3 p = seen_from(*image_, place);
  if (!(p.z() > 0.0)) return false;
  const int u = nearest_pixel(camera_.cx, camera_.fx, p.x() / p.z());
  const int v = nearest_pixel(camera_.cy, camera_.fy, p.y() / p.z());
  return holds(u, v) && window_[0].frames[index(u, v)] > 0.0F && depth(u, v) > p.z();
}

void FusedImage::gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept {
  const Vec3 centre = seen_from(*image_, ball.centre);
  const ViewingRays::Window window = image_->rays().window(centre, ball.radius);
  if (window.stride(max_points) > 1) {  // far more than is averaged
    image_->gather(ball, max_points, patch);
    return;
  }
  const Eigen::Isometry3d& pose = image_->world_from_camera();
  patch.start_view(Vec3(pose.translation()));
  for (int v = window.v_begin; v < window.v_end; ++v) {
    for (int u = window.u_begin; u < window.u_end; ++u) {
      const double z = depth(u, v);
      const Eigen::Vector2d ray = image_->rays().ray(u, v);
      const Vec3 p = Vec3(z * ray.x(), z * ray.y(), z) - centre;
      // Written so that a NaN (a pixel without a ray) is outside.
      if (!(z > 0.0 && p.squaredNorm() <= ball.radius * ball.radius)) continue;
      const Float3 q = narrow(pose.linear() * p);
      patch.push(q.x, q.y, q.z);
    }
  }
}

void FusedImage::gather_sides(const Ball& ball, const Sides& sides, std::size_t max_points,
                              Patch& patch) const noexcept {
  palpate::gather_sides(
      *image_, [this](int u, int v) { return depth(u, v); }, ball, sides, max_points, patch);
}

void FusedImage::gather_sheet(const Ball& ball, const Sheet& sheet, std::size_t max_points,
                              Patch& patch) const noexcept {
  palpate::gather_sheet(
      *image_, [this](int u, int v) { return depth(u, v); }, ball, sheet, max_points, patch);
}

}  // namespace palpate
