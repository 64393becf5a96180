// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <utility>

#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/virtual_camera.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"
#include "palpate/kernel/core/vectorise.hpp"

namespace palpate {
namespace {

constexpr float least_opacity = 0.05F;    // [-] below which a Gaussian is fog
constexpr float carrying_opacity = 0.5F;  // [-] of one that a hand can be near
constexpr double reach_of_sigma = 3.0;    // standard deviations that are drawn
constexpr float thinnest_sigma = 1e-5F;   // [m]
constexpr double widest_sigma = 1e3;      // [m]
constexpr float same_surface = 3e-3F;     // [m] along a ray
constexpr float least_surface = 0.25F;    // [-] of light that ends within that; of less, it is fog
constexpr int least_neighbours = 4;       // whom a Gaussian of a surface touches; floaters do not
constexpr float least_left = 0.02F;       // [-] of light that is followed on
constexpr float least_share = 0.02F;      // [-] of light that a Gaussian takes, where it is drawn
constexpr int lanes = 8;                  // pixels that are drawn at once
constexpr std::size_t often = 256;        // Gaussians, after which rays may all be closed

Eigen::Matrix3d axes_of(const Gaussian& g) { return g.turn.cast<double>().toRotationMatrix(); }

// Half the sides of the box about an ellipsoid of reach_of_sigma.
Vec3 half_sides(const Gaussian& g) {
  const Eigen::Matrix3d scaled = axes_of(g) * g.sigma.cast<double>().asDiagonal();
  return reach_of_sigma * scaled.rowwise().norm();
}

// A Gaussian as a camera sees it. W makes it a ball of radius 1; v = W (x, y, 1) for a ray (x, y,
// 1) which is (a, b) beside the one through the mean, whose v is v_0.
struct SeenGaussian {
  float reach;             // [-] deviations up to which it is drawn
  Eigen::Vector3f mean;    // [m], x and y as of its ray: divided by z
  Eigen::Vector2f half;    // [-] reach in x and y, to first order
  Eigen::Vector3f off;     // |z v_0 x v|^2 / |v_0|^2 = off . (a a, 2 a b, b b)
  Eigen::Vector2f slope;   // v_0 . v / |v_0|^2 = 1 + slope . (a, b)
  Eigen::Vector3f square;  // |v|^2 / |v_0|^2 = 1 + 2 slope . (a, b) + square . (a a, 2 a b, b b)

  SeenGaussian(const Gaussian& g, const Eigen::Vector3f& at, const Eigen::Quaternionf& turn)
      : reach(std::min(static_cast<float>(reach_of_sigma),
                       std::sqrt(2.0F * std::log(g.opacity / least_share)))),
        mean(at.x() / at.z(), at.y() / at.z(), at.z()) {
    const Eigen::Matrix3f axes = (turn * g.turn).toRotationMatrix();
    const Eigen::Matrix3f scaled = axes * g.sigma.asDiagonal();
    half = reach / mean.z() *
           Eigen::Vector2f((scaled.row(0) - mean.x() * scaled.row(2)).norm(),
                           (scaled.row(1) - mean.y() * scaled.row(2)).norm());
    const Eigen::Matrix3f whitened = g.sigma.cwiseInverse().asDiagonal() * axes.transpose();
    const Eigen::Vector3f x = whitened.col(0);
    const Eigen::Vector3f y = whitened.col(1);
    const Eigen::Vector3f middle = mean.x() * x + mean.y() * y + whitened.col(2);
    const float scale = 1.0F / middle.squaredNorm();
    const Eigen::Vector3f across_x = mean.z() * middle.cross(x);
    const Eigen::Vector3f across_y = mean.z() * middle.cross(y);
    off = scale *
          Eigen::Vector3f(across_x.squaredNorm(), across_x.dot(across_y), across_y.squaredNorm());
    slope = scale * Eigen::Vector2f(middle.dot(x), middle.dot(y));
    square = scale * Eigen::Vector3f(x.squaredNorm(), x.dot(y), y.squaredNorm());
  }
};

// What rays have gathered, front to back, of a window row by row.
struct Gathered {
  explicit Gathered(std::size_t size)
      : left(size + lanes, 1.0F), ended(size + lanes), weight(size + lanes), sum(size + lanes) {}
  std::vector<float> left;    // [-] share of light that has passed
  std::vector<float> ended;   // [-] share that has ended at the surface met last
  std::vector<float> weight;  // [-] opacities along the ray of those that belong to it
  std::vector<float> sum;     // [m] depths of it, weighted by these
};

// Pixels [u_begin, u_end) x [v_begin, v_end), and the ray of the first, from the mean's.
struct Pixels {
  int u_begin, u_end, v_begin, v_end, width;
  float a, b, step_a, step_b;
};

PALPATE_VECTORISED
void add_to_rays(const SeenGaussian& g, float opacity, float nearest, float farthest, Pixels pixels,
                 float* left, float* ended, float* weight, float* sum) {
  const float reach_squared = g.reach * g.reach;
  for (int v = pixels.v_begin; v < pixels.v_end; ++v) {
    const float b = pixels.b + static_cast<float>(v - pixels.v_begin) * pixels.step_b;
    const float ahead_0 = g.slope.y() * b;
    const float off_0 = g.off.z() * b * b;
    const float off_1 = 2.0F * g.off.y() * b;
    const float square_0 = 1.0F + 2.0F * ahead_0 + g.square.z() * b * b;
    const float square_1 = 2.0F * (g.slope.x() + g.square.y() * b);
    const float off_2 = g.off.x(), square_2 = g.square.x(), ahead_1 = g.slope.x(), z = g.mean.z();
    for (int u = pixels.u_begin; u < pixels.u_end; u += lanes) {
      const int first = v * pixels.width + u;
      const int count = pixels.u_end - u;
      const float a_0 = pixels.a + static_cast<float>(u - pixels.u_begin) * pixels.step_a;
#pragma omp simd
      for (int lane = 0; lane < lanes; ++lane) {
        const float a = a_0 + static_cast<float>(lane) * pixels.step_a;
        const float square = square_0 + a * (square_1 + a * square_2);
        // [m] of the greatest response, and how far off it is, in deviations, squared
        const float along = z * (1.0F + ahead_0 + ahead_1 * a) / square;
        const float off = (off_0 + a * (off_1 + a * off_2)) / square;
        const float passed = left[first + lane];
        const float surface = weight[first + lane];
        const float depths = sum[first + lane];
        const bool same = std::abs(along * surface - depths) < same_surface * surface;
        const bool counts = (lane < count) & (passed >= least_left) & (off <= reach_squared) &
                            (along >= nearest) & (along <= farthest) & (same | (passed >= 0.5F));
        // e^(-off / 2), to 4e-4 of it, by the series of its eighth root
        const float x = off * (-1.0F / 16.0F);
        float e = 1.0F + x * (1.0F + x * (1.0F / 2 + x * (1.0F / 6 + x * (1.0F / 24 + x / 120))));
        e *= e;
        e *= e;
        e *= e;
        const float share = counts ? opacity * e : 0.0F;
        const float gain = passed * share;
        const bool begins = counts & !same;
        ended[first + lane] = (begins ? 0.0F : ended[first + lane]) + gain;
        weight[first + lane] = (begins ? 0.0F : surface) + share;
        sum[first + lane] = (begins ? 0.0F : depths) + (counts ? share * along : 0.0F);
        left[first + lane] = passed - gain;
      }
    }
  }
}

// What is in sight, and how far away, in the order of depth by steps of 1/4095 of the range.
struct Near {
  Eigen::Vector3f at;  // [m] in the camera's frame
  std::uint32_t number;
};
std::vector<Near> sorted(const std::vector<Near>& seen, double nearest, double farthest) {
  constexpr std::size_t steps = 4096;
  const auto step = [&, scale = static_cast<float>((steps - 1) / (farthest - nearest)),
                     from = static_cast<float>(nearest)](const Near& each) {
    return std::min(static_cast<std::size_t>(scale * std::max(each.at.z() - from, 0.0F)), steps);
  };
  std::array<std::uint32_t, steps + 2> begins{};
  for (const Near& each : seen) ++begins[step(each) + 1];
  std::partial_sum(begins.begin(), begins.end(), begins.begin());
  std::vector<Near> order(seen.size());
  for (const Near& each : seen) order[begins[step(each)]++] = each;
  return order;
}

}  // namespace

SplatBody::SplatBody(std::vector<Gaussian> gaussians, const std::string& name) {
  std::erase_if(gaussians, [](const Gaussian& g) {
    return !(g.mean.allFinite() && g.sigma.allFinite() && g.turn.coeffs().allFinite() &&
             g.turn.norm() > 1e-6F && g.opacity >= least_opacity &&
             g.sigma.maxCoeff() < widest_sigma);
  });
  for (Gaussian& g : gaussians) {
    g.turn.normalize();
    g.sigma = g.sigma.cwiseMax(thinnest_sigma);
  }
  gaussians_ = std::move(gaussians);
  const std::size_t all = gaussians_.size();
  if (all > 0) build_tree();
  std::vector<Gaussian> rooted;
  std::copy_if(gaussians_.begin(), gaussians_.end(), std::back_inserter(rooted),
               [&](const Gaussian& g) { return touches_others(g); });
  floaters_ = all - rooted.size();
  gaussians_ = std::move(rooted);
  if (std::none_of(gaussians_.begin(), gaussians_.end(),
                   [](const Gaussian& g) { return g.opacity >= carrying_opacity; }))
    throw Error(name, "none of its Gaussians hides what is behind it and has others beside it",
                "check that its opacities are logits");
  if (floaters_ > 0) build_tree();
}

void SplatBody::build_tree() {
  std::vector<Box> boxes;
  boxes.reserve(gaussians_.size());
  for (const Gaussian& g : gaussians_) {
    const Vec3 mean = g.mean.cast<double>();
    const Vec3 half = half_sides(g);
    boxes.push_back({mean - half, mean + half});
  }
  tree_.emplace(boxes, gaussians_);
}

bool SplatBody::touches_others(const Gaussian& g) const {
  const auto reach_of = [](const Gaussian& of) {
    return static_cast<float>(reach_of_sigma) * of.sigma.maxCoeff();
  };
  const float reach = reach_of(g);
  const Vec3 at = g.mean.cast<double>();
  int touched = -1;  // itself
  tree_->walk(
      [&](const Box& box) {
        return touched < least_neighbours && box.squared_distance(at) <= reach * reach;
      },
      [&](std::uint32_t first, std::uint32_t end) {
        for (std::uint32_t i = first; i < end; ++i) {
          const float touching = reach + reach_of(gaussians_[i]);
          touched += (gaussians_[i].mean - g.mean).squaredNorm() <= touching * touching ? 1 : 0;
        }
      });
  return touched >= least_neighbours;
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
  const Eigen::Isometry3f pose = camera_from_body.cast<float>();
  const Eigen::Quaternionf turn(pose.linear());
  const Intrinsics& k = view.intrinsics;
  const auto nearest = static_cast<float>(view.nearest);
  const auto farthest = static_cast<float>(view.farthest);
  std::vector<Near> seen;
  seen.reserve(often * often);
  tree_->walk([&](const Box& box) { return space.meets(box); },
              [&](std::uint32_t first, std::uint32_t end) {
                for (std::uint32_t i = first; i < end; ++i) {
                  const Eigen::Vector3f at = pose * gaussians_[i].mean;
                  if (at.z() >= nearest && at.z() <= farthest) seen.push_back({at, i});
                }
              });
  Gathered rays(depth.size());
  const auto closed = [&] {
    return std::none_of(rays.left.begin(), rays.left.end() - lanes,
                        [](float left) { return left >= least_left; });
  };
  std::size_t drawn = 0;
  for (const Near& each : sorted(seen, view.nearest, view.farthest)) {
    if (++drawn % often == 0 && closed()) break;
    const Gaussian& of = gaussians_[each.number];
    const SeenGaussian g(of, each.at, turn);
    const Eigen::Array2d middle = g.mean.head<2>().cast<double>().array();
    const Eigen::Array2d half = g.half.cast<double>().array();
    const auto window = pixels_between(k, middle - half, middle + half);
    vectorised<add_to_rays>(g, of.opacity, nearest, farthest,
                            {.u_begin = window.u_begin,
                             .u_end = window.u_end,
                             .v_begin = window.v_begin,
                             .v_end = window.v_end,
                             .width = k.width,
                             .a = static_cast<float>((window.u_begin - k.cx) / k.fx - middle.x()),
                             .b = static_cast<float>((window.v_begin - k.cy) / k.fy - middle.y()),
                             .step_a = static_cast<float>(1.0 / k.fx),
                             .step_b = static_cast<float>(1.0 / k.fy)},
                            rays.left.data(), rays.ended.data(), rays.weight.data(),
                            rays.sum.data());
  }
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if (rays.left[i] < 0.5F && rays.ended[i] >= least_surface)
      depth[i] = rays.sum[i] / rays.weight[i];
  }
}

std::vector<Body::DrawnGaussian> SplatBody::gaussians(
    const Eigen::Isometry3d& world_from_body) const {
  const Eigen::Isometry3f pose = world_from_body.cast<float>();
  std::vector<DrawnGaussian> drawn;
  drawn.reserve(gaussians_.size());
  for (const Gaussian& g : gaussians_) {
    const Eigen::Vector3f mean = pose * g.mean;
    const Eigen::Matrix3f half = pose.linear() * g.turn.toRotationMatrix() * g.sigma.asDiagonal();
    const Eigen::Matrix3f c = half * half.transpose();
    const auto [red, green, blue] = g.colour;
    drawn.push_back({mean.x(), mean.y(), mean.z(),
                     static_cast<float>(65536 * red + 256 * green + blue), c(0, 0), c(0, 1),
                     c(0, 2), c(1, 1), c(1, 2), c(2, 2), g.opacity, 0.0F});
  }
  return drawn;
}

std::unique_ptr<Source> open_splat(const Uri& uri) {
  const std::filesystem::path path = uri.path();
  const bool as_gltf = is_gltf(path);
  const bool as_spz = lower_case(path.extension().string()) == ".spz";
  const BodyOptions options = body_options(uri, as_spz || as_gltf, as_gltf);
  PointFile file =
      as_gltf ? read_gltf(path, true) : read_by(as_spz ? parse_spz : parse_splat, path);
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
    if (!file.colours.empty()) std::copy_n(&file.colours[3 * i], 3, gaussians[i].colour.begin());
  }
  file = {};
  auto body = std::make_shared<const SplatBody>(std::move(gaussians), uri.path());
  std::string what = "a splat of " + std::to_string(body->size()) + " Gaussians";
  if (body->floaters() > 0) what += " and " + std::to_string(body->floaters()) + " floaters";
  return open_body(uri, options, std::move(body), what);
}

}  // namespace palpate
