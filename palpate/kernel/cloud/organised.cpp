// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/cloud/organised.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "palpate/kernel/core/linear.hpp"

namespace palpate {
namespace {

constexpr int smallest_side = 16;  // [px]
constexpr std::size_t fewest_measured = 100;
constexpr std::size_t largest_side = 16384;  // [px]
constexpr std::size_t most_fitted = 20'000;  // of the points, evenly taken
constexpr double largest_residual = 0.5;     // [px]
constexpr double least_share = 0.999;        // of the points that must fit
// [-] focal length over the image's width: fields of view from 3 to 127 degrees.
constexpr double shortest_focus = 0.25, longest_focus = 20.0;
constexpr double most_skew = 1e-3;          // [-] of the pixels, over the focal length
constexpr double least_determinant = 1e-9;  // [-] over the cube of the size: nothing projects
constexpr double finest_unit = 1e-6;        // [m]
constexpr double coarse_unit = 1e-3;        // [m] what depth cameras themselves have
constexpr double share_of_depth = 1e-3;    // a unit of so much of the depth is finer than any noise
constexpr double largest_reading = 65534;  // 65535 is a hole

struct Sample {
  double u, v;
  Vec3 point;
};

// A straight line y = a x + b through pairs of numbers.
class Line {
 public:
  void add(double x, double y) {
    ++count_;
    x_ += x;
    y_ += y;
    xx_ += x * x;
    xy_ += x * y;
  }
  [[nodiscard]] double slope() const { return (count_ * xy_ - x_ * y_) / (count_ * xx_ - x_ * x_); }
  [[nodiscard]] double offset() const { return (y_ - slope() * x_) / count_; }

 private:
  double count_ = 0.0, x_ = 0.0, y_ = 0.0, xx_ = 0.0, xy_ = 0.0;
};

// Where the camera sees a point of its optical frame, off the pixel (u, v) [px]; infinite behind.
double pixels_off(const Intrinsics& k, const Vec3& p, double u, double v) {
  if (!(p.z() > 0.0)) return std::numeric_limits<double>::infinity();
  return std::max(std::abs(k.fx * p.x() / p.z() + k.cx - u),
                  std::abs(k.fy * p.y() / p.z() + k.cy - v));
}

// The intrinsics of a camera whose pose is known.
std::optional<Intrinsics> fit_intrinsics(const std::vector<Sample>& samples,
                                         const Eigen::Isometry3d& camera_from_world, int width,
                                         int height) {
  Line across, down;
  for (const Sample& sample : samples) {
    const Vec3 p = camera_from_world * sample.point;
    if (!(p.z() > 0.0)) continue;
    across.add(p.x() / p.z(), sample.u);
    down.add(p.y() / p.z(), sample.v);
  }
  const Intrinsics k{.width = width,
                     .height = height,
                     .fx = across.slope(),
                     .fy = down.slope(),
                     .cx = across.offset(),
                     .cy = down.offset()};
  const auto plausible = [&](double f) {
    return f > shortest_focus * width && f < longest_focus * width;
  };
  if (!plausible(k.fx) || !plausible(k.fy) || !std::isfinite(k.cx + k.cy)) return std::nullopt;
  const auto fits =
      static_cast<double>(std::count_if(samples.begin(), samples.end(), [&](const Sample& sample) {
        return pixels_off(k, camera_from_world * sample.point, sample.u, sample.v) <=
               largest_residual;
      }));
  if (fits < least_share * static_cast<double>(samples.size())) return std::nullopt;
  return k;
}

// Of a symmetric matrix that is not negative, the axis of the least eigenvalue: by inverse
// iteration.
Eigen::VectorXd least_axis(Eigen::MatrixXd squares) {
  constexpr double shift = 1e-12;  // [-] of the largest: keeps the matrix regular
  constexpr int most_steps = 200;
  constexpr double settled = 1e-14;
  squares.diagonal().array() += shift * squares.trace();
  Eigen::VectorXd axis = Eigen::VectorXd::LinSpaced(squares.rows(), 1.0, 2.0).normalized();
  for (int i = 0; i < most_steps; ++i) {
    const Eigen::VectorXd before = axis;
    axis = least_squares(squares, before).normalized();
    if ((axis - before).norm() < settled) break;
  }
  return axis;
}

// The pose by direct linear transformation: a projection from space where `centre` is not known (a
// plane alone does not tell it), else one of the directions from there.
std::optional<Eigen::Isometry3d> fit_pose(const std::vector<Sample>& samples, int width,
                                          const std::optional<Vec3>& centre) {
  Vec3 middle = centre.value_or(Vec3::Zero());
  double size = 0.0;
  if (!centre) {
    for (const Sample& sample : samples) middle += sample.point;
    middle /= static_cast<double>(samples.size());
  }
  for (const Sample& sample : samples) size = std::max(size, (sample.point - middle).norm());
  if (!(size > 0.0)) return std::nullopt;
  const int columns = centre ? 3 : 4;
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(3 * columns, 3 * columns);
  for (const Sample& sample : samples) {
    Eigen::VectorXd h = Eigen::VectorXd::Ones(columns);
    h.head<3>() = (sample.point - middle) / size;
    for (const int row : {0, 1}) {
      Eigen::VectorXd a = Eigen::VectorXd::Zero(3 * columns);
      a.segment(row * columns, columns) = h;
      a.tail(columns) = -(row == 0 ? sample.u : sample.v) / width * h;
      squares += a * a.transpose();
    }
  }
  const Eigen::VectorXd best = least_axis(squares);
  Eigen::Matrix3d m;
  for (int row = 0; row < 3; ++row) m.row(row) = best.segment(row * columns, 3).transpose();
  if (m.determinant() < 0.0) m = -m;
  if (!(m.determinant() > least_determinant * m.norm() * m.squaredNorm())) return std::nullopt;
  const Eigen::Matrix3d inverse = m.inverse();
  Vec3 at = middle;
  if (!centre) {
    Vec3 last(best[3], best[7], best[11]);
    if (m.row(0).dot(best.segment<3>(0)) < 0.0) last = -last;
    at -= size * (inverse * last);
  }
  // m = K R: the inverse is R^T K^-1, which Gram and Schmidt take apart.
  Eigen::Matrix3d turn;
  turn.col(0) = inverse.col(0).normalized();
  const double skew = turn.col(0).dot(inverse.col(1));
  const Vec3 down = inverse.col(1) - skew * turn.col(0);
  turn.col(1) = down.normalized();
  turn.col(2) = turn.col(0).cross(turn.col(1));
  if (std::abs(skew) > most_skew * down.norm() || turn.col(2).dot(inverse.col(2)) < 0.0)
    return std::nullopt;
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  world_from_camera.linear() = turn;
  world_from_camera.translation() = at;
  return world_from_camera;
}

// The finest of 1, 2 or 5 times a power of ten that holds a depth [m], as units per metre.
double units_for(double farthest) {
  double unit = finest_unit;
  for (int i = 0; farthest > largest_reading * unit; ++i) unit *= i % 3 == 1 ? 2.5 : 2.0;
  return std::round(1e6 / unit) / 1e6;
}

}  // namespace

std::optional<GridCamera> fit_camera(std::span<const Vec3> points, int width, int height,
                                     const std::optional<Vec3>& viewpoint) {
  if (width < smallest_side || height < smallest_side ||
      points.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height))
    return std::nullopt;
  std::vector<Sample> samples;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto columns = static_cast<std::size_t>(width);
    const std::size_t u = i % columns, v = i / columns;
    if (points[i].allFinite())
      samples.push_back({static_cast<double>(u), static_cast<double>(v), points[i]});
  }
  if (samples.size() < fewest_measured) return std::nullopt;
  const std::size_t step = samples.size() / most_fitted + 1;
  for (std::size_t i = 0; i * step < samples.size(); ++i) samples[i] = samples[i * step];
  samples.resize((samples.size() + step - 1) / step);
  const auto camera_at =
      [&](const std::optional<Eigen::Isometry3d>& pose) -> std::optional<GridCamera> {
    if (!pose) return std::nullopt;
    const auto k = fit_intrinsics(samples, pose->inverse(), width, height);
    if (!k) return std::nullopt;
    return GridCamera{std::make_shared<const ViewingRays>(*k), *pose};
  };
  if (auto camera = camera_at(Eigen::Isometry3d::Identity())) return camera;
  if (auto camera = camera_at(fit_pose(samples, width, viewpoint.value_or(Vec3::Zero()))))
    return camera;
  return camera_at(fit_pose(samples, width, std::nullopt));
}

std::shared_ptr<const DepthImage> depth_image_of(std::span<const Vec3> points,
                                                 const GridCamera& camera) {
  const Intrinsics& k = camera.rays->intrinsics();
  const auto columns = static_cast<std::size_t>(k.width);
  if (points.size() != columns * static_cast<std::size_t>(k.height)) return nullptr;
  const Eigen::Isometry3d camera_from_world = camera.world_from_camera.inverse();
  std::vector<double> depth(points.size(), 0.0);
  std::vector<double> measured;
  std::size_t finite = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) continue;
    ++finite;
    const Vec3 p = camera_from_world * points[i];
    const std::size_t u = i % columns, v = i / columns;
    if (pixels_off(k, p, static_cast<double>(u), static_cast<double>(v)) > largest_residual)
      continue;
    depth[i] = p.z();
    measured.push_back(p.z());
  }
  if (finite < fewest_measured ||
      static_cast<double>(measured.size()) < least_share * static_cast<double>(finite))
    return nullptr;
  const double units = units_for(*std::max_element(measured.begin(), measured.end()));
  const auto middle = measured.begin() + static_cast<std::ptrdiff_t>(measured.size() / 2);
  std::nth_element(measured.begin(), middle, measured.end());
  if (1.0 / units > 1.001 * std::max(coarse_unit, share_of_depth * *middle)) return nullptr;
  std::vector<std::uint16_t> raw;
  raw.reserve(depth.size());
  for (const double d : depth) raw.push_back(static_cast<std::uint16_t>(std::lround(d * units)));
  return std::make_shared<DepthImage>(camera.rays, std::move(raw), units, camera.world_from_camera);
}

std::shared_ptr<const DepthImage> OrganisedClouds::image(std::span<const Vec3> points,
                                                         std::size_t width, std::size_t height,
                                                         const std::optional<Vec3>& viewpoint,
                                                         const Eigen::Isometry3d& pose) {
  if (width < 2 || height < 2 || std::max(width, height) > largest_side) return nullptr;
  std::shared_ptr<const DepthImage> image;
  if (camera_) image = depth_image_of(points, *camera_);
  if (!image) {
    camera_ = fit_camera(points, static_cast<int>(width), static_cast<int>(height), viewpoint);
    if (camera_) image = depth_image_of(points, *camera_);
  }
  if (!image || pose.matrix().isIdentity(0.0)) return image;
  return std::make_shared<DepthImage>(camera_->rays, image->depth(), image->units_per_metre(),
                                      pose * camera_->world_from_camera);
}

}  // namespace palpate
