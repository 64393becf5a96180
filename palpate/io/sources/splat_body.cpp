// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/splat_body.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "palpate/io/sources/point_file.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace {

constexpr float least_opacity = 0.05F;    // [-] below which a Gaussian is fog
constexpr float carrying_opacity = 0.5F;  // [-] of one that a hand can be near
constexpr double reach_of_sigma = 3.0;    // standard deviations that are drawn
constexpr float thinnest_sigma = 1e-5F;   // [m]
constexpr double widest_sigma = 1e3;      // [m]
constexpr double same_surface = 3e-3;     // [m] along a ray

Eigen::Matrix3d axes_of(const Gaussian& g) {
  return g.turn.cast<double>().toRotationMatrix();
}

// Half the sides of the box about an ellipsoid of reach_of_sigma.
Vec3 half_sides(const Gaussian& g) {
  const Eigen::Matrix3d scaled = axes_of(g) * g.sigma.cast<double>().asDiagonal();
  return reach_of_sigma * scaled.rowwise().norm();
}

// A Gaussian as a camera sees it.
struct SeenGaussian {
  Eigen::Matrix3d precision;  // [1/m^2]
  Vec3 towards;               // [1/m] precision * mean
  double at_camera;           // [-] mean * precision * mean
  double depth;               // [m] of the mean
  double opacity;
  ViewingRays::Window window;
};

// What a ray has gathered, front to back.
struct Gathered {
  double left = 1.0;    // [-] share of light that has passed
  double weight = 0.0;  // of the surface met last
  double sum = 0.0;     // [m] weighted depths of it
  bool is_half = false;
};

}  // namespace

SplatBody::SplatBody(std::vector<Gaussian> gaussians, const std::string& name) {
  std::erase_if(gaussians, [](const Gaussian& g) {
    return !(g.mean.allFinite() && g.sigma.allFinite() && g.turn.coeffs().allFinite() &&
             g.turn.norm() > 1e-6F && g.opacity >= least_opacity &&
             g.sigma.maxCoeff() < widest_sigma);
  });
  bool carries = false;
  std::vector<Box> boxes(gaussians.size());
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    Gaussian& g = gaussians[i];
    g.turn.normalize();
    g.sigma = g.sigma.cwiseMax(thinnest_sigma);
    carries = carries || g.opacity >= carrying_opacity;
    const Vec3 mean = g.mean.cast<double>();
    const Vec3 half = half_sides(g);
    boxes[i] = {mean - half, mean + half};
  }
  if (!carries)
    throw Error(name, "none of its Gaussians hides what is behind it",
                "check that its opacities are logits");
  tree_.emplace(boxes, gaussians);
  gaussians_ = std::move(gaussians);
}

// The nearest place of the rectangles of two standard deviations along the two longer axes.
Vec3 SplatBody::nearest(const Vec3& at) const {
  double least = std::numeric_limits<double>::infinity();
  Vec3 nearest = at;
  const auto look = [&](std::uint32_t first, std::uint32_t end) {
    for (std::uint32_t i = first; i < end; ++i) {
      const Gaussian& g = gaussians_[i];
      if (g.opacity < carrying_opacity) continue;
      const Eigen::Matrix3d axes = axes_of(g);
      Vec3 half = 2.0 * g.sigma.cast<double>();
      Eigen::Index thin = 0;
      half.minCoeff(&thin);
      half[thin] = 0.0;
      const Vec3 local = axes.transpose() * (at - g.mean.cast<double>());
      const Vec3 place = g.mean.cast<double>() + axes * local.cwiseMax(-half).cwiseMin(half);
      const double squared = (at - place).squaredNorm();
      if (!(squared < least)) continue;
      least = squared;
      nearest = place;
    }
  };
  tree_->nearest(at, std::numeric_limits<int>::max(), least, look);
  return nearest;
}

void SplatBody::draw(const View& view, std::span<float> depth) const {
  const SeenSpace space(view);
  const Eigen::Isometry3d camera_from_body = view.body_from_camera.inverse();
  const Intrinsics& k = view.intrinsics;
  std::vector<SeenGaussian> seen;
  tree_->walk([&](const Box& box) { return space.meets(box); },
              [&](std::uint32_t first, std::uint32_t end) {
                for (std::uint32_t i = first; i < end; ++i) {
                  const Gaussian& g = gaussians_[i];
                  const Vec3 mean = camera_from_body * g.mean.cast<double>();
                  if (mean.z() < view.nearest || mean.z() > view.farthest) continue;
                  const Eigen::Matrix3d axes = camera_from_body.linear() * axes_of(g);
                  const Eigen::Matrix3d scaled = axes * g.sigma.cast<double>().asDiagonal();
                  const Eigen::Matrix3d whitened =
                      g.sigma.cast<double>().cwiseInverse().asDiagonal() * axes.transpose();
                  // How far the ellipsoid reaches in the image, to first order.
                  const Eigen::Array2d middle = mean.head<2>().array() / mean.z();
                  Eigen::Matrix<double, 2, 3> slope;
                  slope << 1.0, 0.0, -middle.x(), 0.0, 1.0, -middle.y();
                  const Eigen::Array2d half =
                      reach_of_sigma / mean.z() * (slope * scaled).rowwise().norm().array();
                  const auto window = pixels_between(k, middle - half, middle + half);
                  if (window.empty()) continue;
                  const Eigen::Matrix3d precision = whitened.transpose() * whitened;
                  const Vec3 towards = precision * mean;
                  seen.push_back(
                      {precision, towards, mean.dot(towards), mean.z(), double{g.opacity}, window});
                }
              });
  std::vector<std::uint32_t> order(seen.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return seen[a].depth != seen[b].depth ? seen[a].depth < seen[b].depth : a < b;
  });
  std::vector<Gathered> rays(depth.size());
  for (const std::uint32_t i : order) {
    const SeenGaussian& g = seen[i];
    const Eigen::Matrix3d& p = g.precision;
    for (int v = g.window.v_begin; v < g.window.v_end; ++v) {
      // Along a row both are polynomials of the ray's x.
      const double y = (v - k.cy) / k.fy;
      const double ahead_0 = g.towards.y() * y + g.towards.z();
      const double square_0 = (p(1, 1) * y + 2.0 * p(1, 2)) * y + p(2, 2);
      const double square_1 = 2.0 * (p(0, 1) * y + p(0, 2));
      for (int u = g.window.u_begin; u < g.window.u_end; ++u) {
        Gathered& ray = rays[static_cast<std::size_t>(v * k.width + u)];
        if (ray.left < 0.02) continue;
        const double x = (u - k.cx) / k.fx;
        const double ahead = g.towards.x() * x + ahead_0;
        // [m] of the greatest response
        const double along = ahead / ((p(0, 0) * x + square_1) * x + square_0);
        const double off = g.at_camera - ahead * along;  // squared, in deviations
        if (off > reach_of_sigma * reach_of_sigma) continue;
        const double share = g.opacity * std::exp(-0.5 * std::max(off, 0.0));
        if (along < view.nearest || along > view.farthest) continue;
        const bool is_same =
            ray.weight > 0.0 && std::abs(along - ray.sum / ray.weight) < same_surface;
        if (!is_same && ray.is_half) continue;
        if (!is_same) ray.weight = ray.sum = 0.0;
        ray.weight += ray.left * share;
        ray.sum += ray.left * share * along;
        ray.left *= 1.0 - share;
        ray.is_half = ray.left < 0.5;
      }
    }
  }
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (rays[i].is_half) depth[i] = static_cast<float>(rays[i].sum / rays[i].weight);
  }
}

std::unique_ptr<Source> open_splat(const Uri& uri) {
  const BodyOptions options = body_options(uri);
  PointFile file = read_splat(uri.path());
  const Eigen::Quaternionf turn(Eigen::Quaterniond(options.turn).cast<float>());
  std::vector<Gaussian> gaussians(file.points.size());
  for (std::size_t i = 0; i < gaussians.size(); ++i) {
    const SplatColumns& columns = *file.splat;
    const Vec3 sigma = options.scale * columns.log_scales[i].array().exp().matrix();
    const Vec3& tail = columns.rotations[i];
    gaussians[i] = {
        .mean = (options.scale * (options.turn * file.points[i])).cast<float>(),
        .sigma = sigma.cast<float>(),
        .turn = turn * Eigen::Quaternionf(
                           Eigen::Quaterniond(columns.heads[i].x(), tail.x(), tail.y(), tail.z())
                               .cast<float>()),
        .opacity = static_cast<float>(1.0 / (1.0 + std::exp(-columns.heads[i].y())))};
  }
  file = {};
  auto body = std::make_unique<const SplatBody>(std::move(gaussians), uri.path());
  const std::string what = "a splat of " + std::to_string(body->size()) + " Gaussians";
  return open_body(uri, options, std::move(body), what);
}

}  // namespace palpate
