// SPDX-License-Identifier: Apache-2.0
#include "app/remarks.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/cloud/proposed_touch.hpp"
#include "palpate/session/summary.hpp"

namespace palpate::app {

std::string length_text(double metres) {
  return metres < 1.0 ? fmt::format("{:.3g} mm", 1e3 * metres) : fmt::format("{:.4g} m", metres);
}

std::string radius_remark(const Cloud& cloud, double r_c) {
  const auto* points = cloud.point_cloud();
  const double usual = ProxyParameters{}.r_c();
  if (points == nullptr || r_c <= usual) return {};
  return fmt::format(
      "its points are {} apart, so the proxy has r_c = {} and cannot fall between them; "
      "--set r_c={:.3g} sets the default",
      length_text(proposed_touch(*points).spacing), length_text(r_c), usual);
}

std::string sparse_remark(const Cloud& cloud, const std::string& uri, double r_c) {
  const auto* points = cloud.point_cloud();
  if (points == nullptr) return {};
  const ProposedTouch proposed = proposed_touch(*points);
  if (proposed.spacing == 0.0)
    return fmt::format("{} points are too few for a surface; use a file with more points",
                       points->size());
  if (proposed.scale == 1.0 && proposed.radius <= r_c) return {};
  const bool has_proxy = proposed.scale == 1.0;
  const std::string what = fmt::format(
      "it is {} long with points {} apart, too {} for {}; ", length_text(proposed.extent),
      length_text(proposed.spacing), proposed.scale > 1.0 ? "small" : "sparse",
      has_proxy ? "a proxy with r_c = " + length_text(r_c) : "any proxy");
  if (has_proxy)
    return what + fmt::format("give --set r_c={:.2g}, or leave r_c out", proposed.radius);
  const std::string larger = rescaled(uri, proposed.scale);
  if (larger.empty()) return what + "press where they are denser";
  return what + fmt::format("give --camera '{}' to touch it {} long", larger,
                            length_text(proposed.scale * proposed.extent));
}

namespace {

constexpr std::size_t enough_points = 20000;  // of each camera, for a distance
constexpr double precision = 0.01;            // [-] of the least distance
constexpr double grace = 0.1;                 // [s] that the last frame may be in use, at least
constexpr double felt_force = 1.0;            // [N] that anybody feels
constexpr int least_felt = 100;               // [ticks] of it that make a press
constexpr int enough_about = 8;               // points within two r_c of a proxy that rests
constexpr double margin = 0.05;               // [m] around a cloud, within which a path is near it

std::string box_text(const Eigen::AlignedBox3d& box) {
  const Vec3& low = box.min();
  const Vec3& high = box.max();
  return fmt::format("({:.3g}, {:.3g}, {:.3g}) to ({:.3g}, {:.3g}, {:.3g}) m", low.x(), low.y(),
                     low.z(), high.x(), high.y(), high.z());
}

// Adds every `step`-th pixel, in both directions, or every `step`-th point.
void add_points(const DepthImage& image, int step, std::vector<Vec3>& points) {
  for (int v = 0; v < image.intrinsics().height; v += step) {
    for (int u = 0; u < image.intrinsics().width; u += step) {
      if (const auto point = image.deproject(u, v)) points.push_back(*point);
    }
  }
}

void add_points(const Cloud& cloud, std::vector<Vec3>& points) {
  if (const DepthImage* image = cloud.image()) {
    const auto pixels = static_cast<double>(image->depth().size());
    const int step = static_cast<int>(std::ceil(std::sqrt(pixels / enough_points)));
    const std::size_t before = points.size();
    add_points(*image, std::max(step, 1), points);
    // An image of holes with few readings between them.
    if (step > 1 && points.size() - before < enough_points / 100) {
      points.resize(before);
      add_points(*image, 1, points);
    }
  } else if (const PointCloud* unordered = cloud.point_cloud()) {
    const std::size_t step = unordered->size() / enough_points + 1;
    for (std::size_t i = 0; i < unordered->size(); i += step) points.push_back(unordered->point(i));
  }
}

// The nearest point of an unorganised cloud within `radius` [m]; none: there is none.
std::optional<double> nearest_within(const PointCloud& cloud, const Vec3& at, double radius) {
  Patch patch;
  gather(cloud, Ball{at, radius}, patch);
  std::optional<double> least;
  for (std::size_t i = 0; i < patch.size(); ++i) {
    const double distance =
        Eigen::Vector3f(patch.x()[i], patch.y()[i], patch.z()[i]).cast<double>().norm();
    if (!least || distance < *least) least = distance;
  }
  return least;
}

// Would the path lie about the cloud if its numbers were so many times as large?
bool fits_scaled(const Eigen::AlignedBox3d& path, double scale, const Eigen::AlignedBox3d& cloud) {
  const Vec3 around = Vec3::Constant(margin * std::max(scale, 1.0));
  const Eigen::AlignedBox3d scaled(scale * path.min(), scale * path.max());
  return scaled.intersects(Eigen::AlignedBox3d(cloud.min() - around, cloud.max() + around));
}

}  // namespace

void TraceRemarks::count(const Tick& tick, std::span<const std::shared_ptr<const Cloud>> cameras) {
  const bool has_frame = tick.frame >= 0;
  if (!any_tick_) {
    any_tick_ = true;
    first_t_ = tick.t;
    first_without_frame_ = !has_frame;
  }
  last_t_ = tick.t;
  path_.extend(tick.hip);
  if (!has_frame) return;
  if (measured_frame_ < 0) look_at_start(tick, cameras);
  touched_ = touched_ || tick.state != ContactState::free_motion;
  const double force = tick.force.norm();
  felt_ += force > felt_force ? 1 : 0;
  largest_ = std::max(largest_, force);
  if (tick.state != ContactState::free_motion) {
    stale_ += (tick.flags & frame_stale) != 0 ? 1 : 0;
    ++contact_;
    if (is_press_ && points_about_ < 0) count_points(tick, cameras);
  }
  if (!touched_) measure(tick, cameras);
  measured_frame_ = tick.frame;
}

void TraceRemarks::look_at_start(const Tick& tick,
                                 std::span<const std::shared_ptr<const Cloud>> cameras) {
  const std::string where =
      first_without_frame_ ? fmt::format("at the first frame, t = {:.3f} s, the path was", tick.t)
                           : "the path began";
  std::optional<double> before;  // [m] of the surface
  if (const auto behind = least_behind(cameras, tick.hip, r_c_)) {
    if (*behind > 0.0) {
      start_ = fmt::format(
          "{} inside, {} behind the visible surface; begin in free space in front of it", where,
          length_text(*behind));
      return;
    }
    before = -*behind;
  } else {
    for (const auto& cloud : cameras) {
      const PointCloud* unordered = cloud ? cloud->point_cloud() : nullptr;
      if (unordered == nullptr) continue;
      const auto distance = nearest_within(*unordered, tick.hip, r_c_);
      if (distance && (!before || *distance < *before)) before = distance;
    }
  }
  if (before && *before < r_c_)
    start_ =
        fmt::format("{} in contact, {} from the surface, less than r_c = {}; begin farther away",
                    where, length_text(*before), length_text(r_c_));
}

void TraceRemarks::measure(const Tick& tick,
                           std::span<const std::shared_ptr<const Cloud>> cameras) {
  if (tick.frame != measured_frame_) {
    points_.clear();
    extent_.setEmpty();
    distance_.reset();
    for (const auto& cloud : cameras) {
      if (cloud) add_points(*cloud, points_);
    }
    for (const Vec3& point : points_) extent_.extend(point);
  }
  if (points_.empty()) return;
  if (distance_ && *distance_ - (tick.hip - measured_at_).norm() >= (1.0 - precision) * nearest_)
    return;
  double least = std::numeric_limits<double>::infinity();
  for (const Vec3& point : points_) least = std::min(least, (point - tick.hip).squaredNorm());
  distance_ = std::sqrt(least);
  measured_at_ = tick.hip;
  if (*distance_ >= nearest_) return;
  nearest_ = *distance_;
  nearest_t_ = tick.t;
  nearest_extent_ = extent_;
}

std::string TraceRemarks::nothing_met() const {
  if (nearest_ == std::numeric_limits<double>::infinity())
    return "nothing was touched: the frames have no points";
  std::string text = fmt::format(
      "nothing was touched: the path came no nearer than {} to a point, at t = {:.3f} s; the "
      "points then extended from {}, the path extends from {}",
      length_text(nearest_), nearest_t_, box_text(nearest_extent_), box_text(path_));
  if (fits_scaled(path_, 1.0, nearest_extent_)) return text;
  if (fits_scaled(path_, 1e-3, nearest_extent_))
    return text + "; is the path in millimetres? use metres";
  if (fits_scaled(path_, 1e3, nearest_extent_))
    return text + "; is the cloud in millimetres? set ?scale=1mm, or units= for depth images";
  return text + "; are both in metres and in the world frame?";
}

// How many points carry a proxy where it touched first; only of clouds that are no images.
void TraceRemarks::count_points(const Tick& tick,
                                std::span<const std::shared_ptr<const Cloud>> cameras) {
  points_about_ = 0;
  for (const auto& cloud : cameras) {
    if (!cloud || cloud->point_cloud() == nullptr) {
      points_about_ = enough_about;
      return;
    }
    Patch patch;
    gather(*cloud, Ball{tick.proxy, 2.0 * r_c_}, patch);
    points_about_ += static_cast<int>(patch.size());
  }
}

// The one reason why a touch gave no force, or too little.
std::string TraceRemarks::hardly_felt(std::span<const ShownFrames> shown) const {
  const std::string begin =
      fmt::format("the surface was touched with hardly any force, {:.2f} N at most: ", largest_);
  // A single frame is a static image of any age.
  std::size_t frames = 0;
  for (const ShownFrames& each : shown) frames += each.count;
  if (frames > 1 && 2 * stale_ > contact_)
    return begin + "the frames had stopped, and the force ends soon after a camera's last frame";
  if (is_press_ && points_about_ < enough_about)
    return begin + fmt::format(
                       "its points are too sparse for a proxy with r_c = {}: only {} were within "
                       "twice that radius; use a smaller ?scale, or a larger proxy",
                       length_text(r_c_), points_about_);
  return begin +
         "the proxy slid off an edge or an object narrower than the proxy; press farther inside";
}

std::vector<std::string> TraceRemarks::lines(std::span<const ShownFrames> shown,
                                             std::span<const std::string> uris) const {
  std::vector<std::string> lines;
  if (!any_tick_) return lines;
  if (first_without_frame_) {
    double first = std::numeric_limits<double>::infinity();
    for (const ShownFrames& frames : shown) first = std::min(first, frames.first);
    if (first > last_t_) {
      lines.push_back(
          fmt::format("nothing was touched: the first frame is at t = {:.3f} s, the path ended at "
                      "{:.3f} s; use the times of the frames in the path",
                      first, last_t_));
      return lines;
    }
    lines.push_back(
        fmt::format("there was no frame before t = {:.3f} s: the path began {:.3f} s earlier, "
                    "without a surface",
                    first, first - first_t_));
  }
  if (!is_press_ && !start_.empty()) lines.push_back(start_);
  for (std::size_t i = 0; i < shown.size(); ++i) {
    const ShownFrames& frames = shown[i];
    if (!frames.ended || frames.count < 2) continue;  // one frame is a still image
    const double interval = (frames.last - frames.first) / static_cast<double>(frames.count - 1);
    const double left = last_t_ - frames.last;
    if (left > std::max(2.0 * interval, grace))
      lines.push_back(
          fmt::format("{}: its frames ended at t = {:.3f} s, {:.3f} s before the path; the rest of "
                      "the path used the last frame as a static image",
                      uris[i], frames.last, left));
  }
  const bool is_felt = is_press_ ? felt_ >= least_felt : largest_ > 0.0;
  if (!is_felt && is_press_ && !sparse_.empty())
    lines.push_back((touched_ ? "it was hardly felt: " : "nothing was touched: ") + sparse_);
  else if (!touched_)
    lines.push_back(nothing_met());
  else if (!is_felt)
    lines.push_back(hardly_felt(shown));
  return lines;
}

}  // namespace palpate::app
