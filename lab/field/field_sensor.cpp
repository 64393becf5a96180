// SPDX-License-Identifier: Apache-2.0
#include "lab/field/field_sensor.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

#include "palpate/kernel/core/mathematics.hpp"

namespace palpate::lab::field {
namespace {

constexpr unsigned table_bits = 14;

// The normal distribution's quantiles at (i + 1/2) / 2^14, by Newton's method from the one before.
const std::vector<double>& normal_quantiles() {
  static const std::vector<double> table = [] {
    constexpr std::size_t size = std::size_t{1} << table_bits;
    std::vector<double> quantiles(size);
    double x = 0.0;
    for (std::size_t i = size / 2; i < size; ++i) {
      const double share = (static_cast<double>(i) + 0.5) / static_cast<double>(size);
      for (int round = 0; round < 8; ++round) {
        const double above = 0.5 * std::erfc(x / std::numbers::sqrt2);
        const double density = math::exp(-0.5 * x * x) / std::sqrt(2.0 * std::numbers::pi);
        x += (share - 1.0 + above) / density;
      }
      quantiles[i] = x;
      quantiles[size - 1 - i] = -x;
    }
    return quantiles;
  }();
  return table;
}

constexpr double farthest = 4.0;       // [m]
constexpr double grazing_pair = 0.26;  // [-] cosine below which two eyes find no match: 75 degrees
constexpr double grazing_flight = 0.12;  // [-] below which too little light comes back: 83 degrees
constexpr double flying_jump = 0.015;    // [m] between neighbours whose light mixes
constexpr double flying_share = 0.6;     // [-] of the pixels at such an edge
constexpr double all_edges = 10.0;       // [px] to both neighbours: a thin thing, not a slope
constexpr double wiggle_period = 0.375;  // [m] a quarter of half the wave of 100 MHz

}  // namespace

double Chance::normal() { return normal_quantiles()[bits() >> (64U - table_bits)]; }

void Chance::fill_normal(std::span<double> out) {
  const std::vector<double>& table = normal_quantiles();
  constexpr std::uint64_t mask = (std::uint64_t{1} << table_bits) - 1;
  std::uint64_t word = 0;
  for (std::size_t i = 0; i < out.size(); ++i) {
    word = i % 4 == 0 ? bits() : word >> 16U;
    out[i] = table[word & mask];
  }
}

const char* to_string(SensorKind kind) {
  constexpr std::array<const char*, sensor_kinds> names = {"stereo", "light", "flight", "coarse",
                                                           "exact"};
  return names[static_cast<std::size_t>(kind)];
}

Sensor::Sensor(const SensorSetup& setup, const Eigen::Isometry3d& world_from_camera)
    : setup_(setup),
      world_from_camera_(world_from_camera),
      sub_(setup.kind == SensorKind::coarse ? 3 : 1),
      chance_(setup.seed) {
  Intrinsics intrinsics;
  intrinsics.width = setup_.width;
  intrinsics.height = setup_.height;
  intrinsics.fx = intrinsics.fy = setup_.focal;
  intrinsics.cx = 0.5 * (setup_.width - 1);
  intrinsics.cy = 0.5 * (setup_.height - 1);
  viewing_rays_ = std::make_shared<const ViewingRays>(intrinsics);
  const auto ray = [&](double u, double v) {
    return Vec3((u - intrinsics.cx) / setup_.focal, (v - intrinsics.cy) / setup_.focal, 1.0);
  };
  for (int v = 0; v < setup_.height * sub_; ++v) {
    for (int u = 0; u < setup_.width * sub_; ++u) {
      const auto within = [this](int i) { return (i + 0.5) / sub_ - 0.5; };
      ways_.emplace_back(world_from_camera_.linear() * ray(within(u), within(v)).normalized());
    }
  }
  for (int v = 0; v < setup_.height; ++v) {
    for (int u = 0; u < setup_.width; ++u) along_.push_back(1.0 / ray(u, v).norm());
  }
  const std::size_t pixels = along_.size();
  clean_.range.resize(pixels);
  clean_.cosine.resize(pixels);
  clean_.disparity.resize(pixels);
  clean_.hole.resize(pixels);
  noise_.assign(pixels, 0.0);
  fresh_.resize(pixels);
}

double Sensor::deviation(double z) const {
  double squared = 1.0 / (12.0 * setup_.units * setup_.units);
  if (triangulates()) {
    const double per_pixel = z * z / (setup_.focal * setup_.baseline);
    squared += per_pixel * per_pixel *
               (setup_.noise * setup_.noise + setup_.quantum * setup_.quantum / 12.0);
  } else {
    squared += setup_.noise * setup_.noise * z * z;
  }
  return std::sqrt(squared);
}

double Sensor::depth_of(const Vec3& place) const {
  return (world_from_camera_.inverse() * place).z();
}

bool Sensor::sees(const Snapshot& scene, const Vec3& place, double margin) const {
  const Vec3 seen = world_from_camera_.inverse() * place;
  if (seen.z() <= 0.0) return false;
  const double u = setup_.focal * seen.x() / seen.z();
  const double v = setup_.focal * seen.y() / seen.z();
  return std::abs(u) <= 0.5 * setup_.width && std::abs(v) <= 0.5 * setup_.height &&
         !scene.between(eye(), place, margin);
}

// The ranges of all rays; what never moves is traced once.
void Sensor::trace_rays(const FieldScene& scene, double t) {
  const Vec3 from = eye();
  if (!traced_) {
    const Snapshot still(scene, t, Snapshot::Which::still);
    still_.assign(ways_.size(), 0.0);
    for (std::size_t i = 0; i < ways_.size(); ++i)
      still_[i] = still.cast(from, ways_[i], farthest).value_or(0.0);
    traced_ = true;
  }
  ranges_ = still_;
  const Snapshot moving(scene, t, Snapshot::Which::moving);
  if (moving.empty()) return;
  for (std::size_t i = 0; i < ways_.size(); ++i) {
    const double reach = still_[i] > 0.0 ? still_[i] : farthest;
    if (const auto met = moving.cast(from, ways_[i], reach)) ranges_[i] = *met;
  }
}

void Sensor::look(const FieldScene& scene, double t) {
  if (looked_) return;
  trace_rays(scene, t);
  looked_ = std::all_of(scene.begin(), scene.end(), [](const Body& body) { return body.still(); });
  const int wide = setup_.width * sub_;
  const std::size_t middle = static_cast<std::size_t>(sub_ / 2);
  const auto centre_ray = [&](int u, int v) {
    return (static_cast<std::size_t>(v * sub_) + middle) * static_cast<std::size_t>(wide) +
           static_cast<std::size_t>(u * sub_) + middle;
  };
  for (int v = 0; v < setup_.height; ++v) {
    for (int u = 0; u < setup_.width; ++u) {
      double sum = 0.0;
      int met = 0;
      for (int j = 0; j < sub_; ++j) {
        for (int i = 0; i < sub_; ++i) {
          const double range =
              ranges_[static_cast<std::size_t>(v * sub_ + j) * static_cast<std::size_t>(wide) +
                      static_cast<std::size_t>(u * sub_ + i)];
          sum += range;
          met += range > 0.0 ? 1 : 0;
        }
      }
      clean_.range[pixel(u, v)] = 2 * met > sub_ * sub_ ? sum / met : 0.0;
    }
  }
  // The surface's slope from the nearer of two neighbours: the other may be across an edge.
  const auto point = [&](int u, int v) {
    return Vec3(clean_.range[pixel(u, v)] * ways_[centre_ray(u, v)]);
  };
  const auto step = [&](int u, int v, int du, int dv) {
    Vec3 shortest = Vec3::Zero();
    for (const int side : {-1, 1}) {
      const int other_u = u + side * du;
      const int other_v = v + side * dv;
      if (other_u < 0 || other_v < 0 || other_u >= setup_.width || other_v >= setup_.height)
        continue;
      const Vec3 to = side * (point(other_u, other_v) - point(u, v));
      if (shortest.isZero(0.0) || to.squaredNorm() < shortest.squaredNorm()) shortest = to;
    }
    return shortest;
  };
  for (int v = 0; v < setup_.height; ++v) {
    for (int u = 0; u < setup_.width; ++u) {
      const std::size_t i = pixel(u, v);
      clean_.cosine[i] = 1.0;
      clean_.hole[i] = clean_.range[i] <= 0.0;
      if (clean_.hole[i]) continue;
      const Vec3 across = step(u, v, 1, 0);
      const Vec3 down = step(u, v, 0, 1);
      const double longest = all_edges * clean_.range[i] / setup_.focal;
      if (across.norm() > longest || down.norm() > longest) continue;
      const Vec3 normal = across.cross(down);
      if (normal.norm() > 0.0)
        clean_.cosine[i] = std::abs(normal.normalized().dot(ways_[centre_ray(u, v)]));
    }
  }
  if (triangulates()) {
    for (std::size_t i = 0; i < along_.size(); ++i) {
      const double z = clean_.range[i] * along_[i];
      clean_.disparity[i] = z > 0.0 ? setup_.focal * setup_.baseline / z : 0.0;
    }
    find_shadows();
    if (setup_.kind == SensorKind::stereo) fatten_edges();
  }
}

// What the second eye (or the projector) does not see of what the first one sees: in its row
// something nearer covers the place.
void Sensor::find_shadows() {
  constexpr double covers = 1.0;  // [px] of disparity
  const double most = *std::max_element(clean_.disparity.begin(), clean_.disparity.end());
  const auto shift = static_cast<int>(most) + 2;
  std::vector<double> seen(static_cast<std::size_t>(setup_.width + shift + 2));
  for (int v = 0; v < setup_.height; ++v) {
    std::fill(seen.begin(), seen.end(), 0.0);
    const auto place = [&](int u) { return u - clean_.disparity[pixel(u, v)] + shift; };
    for (int u = 0; u < setup_.width; ++u) {
      const auto cell = static_cast<std::size_t>(place(u));
      for (const std::size_t next : {cell, cell + 1})
        seen[next] = std::max(seen[next], clean_.disparity[pixel(u, v)]);
    }
    for (int u = 0; u < setup_.width; ++u) {
      const std::size_t i = pixel(u, v);
      if (seen[static_cast<std::size_t>(place(u) + 0.5)] > clean_.disparity[i] + covers)
        clean_.hole[i] = true;
    }
  }
}

// A window of matching that holds an edge finds the nearer side: bodies look wider.
void Sensor::fatten_edges() {
  constexpr double edge = 1.0;  // [px] of disparity
  const int reach = setup_.window / 4;
  if (reach == 0) return;
  for (const bool across : {true, false}) {
    const Image before = clean_.disparity;
    for (int v = 0; v < setup_.height; ++v) {
      for (int u = 0; u < setup_.width; ++u) {
        const std::size_t i = pixel(u, v);
        for (int k = -reach; k <= reach; ++k) {
          const int other_u = std::clamp(across ? u + k : u, 0, setup_.width - 1);
          const int other_v = std::clamp(across ? v : v + k, 0, setup_.height - 1);
          const double other = before[pixel(other_u, other_v)];
          if (other > std::max(clean_.disparity[i], before[i] + edge)) {
            clean_.disparity[i] = other;
            clean_.cosine[i] = 1.0;
            clean_.hole[i] = false;
          }
        }
      }
    }
  }
}

// Noise of deviation 1: the mean of white noise over a square, and a part of the frame before's.
void Sensor::next_noise() {
  const int w = setup_.window;
  if (w <= 1) {
    chance_.fill_normal(fresh_);
  } else {
    const int wide = setup_.width + w - 1;
    const int high = setup_.height + w - 1;
    padded_.resize(static_cast<std::size_t>(wide) * static_cast<std::size_t>(high));
    rows_.resize(static_cast<std::size_t>(setup_.width) * static_cast<std::size_t>(high));
    chance_.fill_normal(padded_);
    for (int v = 0; v < high; ++v) {
      const double* in = padded_.data() + static_cast<std::ptrdiff_t>(v) * wide;
      double* out = rows_.data() + static_cast<std::ptrdiff_t>(v) * setup_.width;
      double sum = 0.0;
      for (int u = 0; u < w - 1; ++u) sum += in[u];
      for (int u = 0; u < setup_.width; ++u) {
        sum += in[u + w - 1];
        out[u] = sum;
        sum -= in[u];
      }
    }
    std::vector<double> sums(static_cast<std::size_t>(setup_.width), 0.0);
    for (int v = 0; v < high; ++v) {
      const double* in = rows_.data() + static_cast<std::ptrdiff_t>(v) * setup_.width;
      for (int u = 0; u < setup_.width; ++u) sums[static_cast<std::size_t>(u)] += in[u];
      if (v < w - 1) continue;
      const double* old = rows_.data() + static_cast<std::ptrdiff_t>(v - w + 1) * setup_.width;
      for (int u = 0; u < setup_.width; ++u) {
        fresh_[pixel(u, v - w + 1)] = sums[static_cast<std::size_t>(u)] / w;
        sums[static_cast<std::size_t>(u)] -= old[u];
      }
    }
  }
  const double keep = remembers_ ? setup_.memory : 0.0;
  const double take = std::sqrt(1.0 - keep * keep);
  for (std::size_t i = 0; i < noise_.size(); ++i) noise_[i] = keep * noise_[i] + take * fresh_[i];
  remembers_ = true;
}

double Sensor::measured_depth(int u, int v) {
  const std::size_t i = pixel(u, v);
  if (clean_.hole[i] || (setup_.holes > 0.0 && chance_.even() < setup_.holes)) return 0.0;
  if (triangulates()) {
    if (clean_.cosine[i] < grazing_pair) return 0.0;
    double disparity = clean_.disparity[i] + setup_.noise * noise_[i];
    if (setup_.quantum > 0.0) {
      const double steps = std::round(disparity / setup_.quantum);
      if (setup_.kind == SensorKind::light && steps > 2047.0) return 0.0;  // 11 bits
      disparity = setup_.quantum * steps;
    }
    return disparity > 0.0 ? setup_.focal * setup_.baseline / disparity : 0.0;
  }
  double range = clean_.range[i];
  if (setup_.kind == SensorKind::exact) return range * along_[i];
  if (clean_.cosine[i] < grazing_flight) return 0.0;
  if (setup_.kind == SensorKind::flight) {
    double farthest_off = 0.0;
    for (const auto& [du, dv] :
         {std::pair{-1, 0}, std::pair{1, 0}, std::pair{0, -1}, std::pair{0, 1}}) {
      const int other_u = std::clamp(u + du, 0, setup_.width - 1);
      const int other_v = std::clamp(v + dv, 0, setup_.height - 1);
      const double other = clean_.range[pixel(other_u, other_v)];
      if (other > 0.0 && std::abs(other - range) > std::abs(farthest_off))
        farthest_off = other - range;
    }
    if (std::abs(farthest_off) > flying_jump && chance_.even() < flying_share)
      range += chance_.even() * farthest_off;
  }
  const double wiggle = setup_.wiggle * math::sin(2.0 * std::numbers::pi * range / wiggle_period);
  return (range + wiggle + setup_.noise * range / std::sqrt(clean_.cosine[i]) * noise_[i]) *
         along_[i];
}

std::shared_ptr<const DepthImage> Sensor::capture(const FieldScene& scene, double t) {
  look(scene, t);
  if (setup_.noise > 0.0) next_noise();
  std::vector<std::uint16_t> depth(along_.size());
  for (int v = 0; v < setup_.height; ++v) {
    for (int u = 0; u < setup_.width; ++u) {
      const double units = std::round(measured_depth(u, v) * setup_.units);
      if (units > 0.0 && units < 65535.0) depth[pixel(u, v)] = static_cast<std::uint16_t>(units);
    }
  }
  return std::make_shared<const DepthImage>(viewing_rays_, std::move(depth), setup_.units,
                                            world_from_camera_);
}

Eigen::Isometry3d camera_pose(const Vec3& target, double distance, double tilt, double azimuth,
                              double roll) {
  const Vec3 back(math::sin(tilt) * math::cos(azimuth), math::sin(tilt) * math::sin(azimuth),
                  math::cos(tilt));
  const Vec3 side = Vec3(-math::sin(azimuth), math::cos(azimuth), 0.0);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  Eigen::Matrix3d axes;
  axes.col(2) = -back;
  axes.col(0) = Eigen::AngleAxisd(roll, back) * side;
  axes.col(1) = axes.col(2).cross(axes.col(0));
  pose.linear() = axes;
  pose.translation() = target + distance * back;
  return pose;
}

}  // namespace palpate::lab::field
