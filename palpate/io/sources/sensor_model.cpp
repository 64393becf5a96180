// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/sensor_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/vectorise.hpp"

namespace palpate {
namespace {

constexpr float nothing = std::numeric_limits<float>::infinity();

// Keys of the random streams, one for each use: switching one on leaves the others unchanged.
enum class Salt : std::uint64_t { white = 1, window, nugget, dropout, flying, point, drift };

constexpr std::uint64_t drift_frames = 300;  // in which the scale becomes another: 10 s at 30 Hz

constexpr std::uint64_t golden = 0x9e3779b97f4a7c15;

// SplitMix64's mixing function (Steele, Lea, Flood 2014): a counter in, random bits out.
constexpr std::uint64_t mix(std::uint64_t x) {
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111eb;
  return x ^ (x >> 31U);
}

constexpr std::uint64_t key_of(std::uint64_t seed, std::uint64_t frame, Salt salt) {
  return mix(mix(mix(seed + golden) + frame) + golden * static_cast<std::uint64_t>(salt));
}

constexpr std::uint64_t bits(std::uint64_t key, std::uint64_t index) {
  return mix(key + golden * index);
}

constexpr double share(std::uint32_t random) { return (random + 0.5) * 0x1p-32; }

// Acklam's rational approximation of the inverse normal distribution; relative error 1.2e-9. This
// is its central part; beyond that it still increases with p, but is not accurate.
constexpr double tail = 0.02425;      // [-] probability on each side
constexpr float middle_ends = 1.97F;  // just inside the central part's values at its ends
double middle_quantile(double p) {
  constexpr std::array a{-3.969683028665376e+01, 2.209460984245205e+02,  -2.759285104469687e+02,
                         1.383577518672690e+02,  -3.066479806614716e+01, 2.506628277459239e+00};
  constexpr std::array b{-5.447609879822406e+01, 1.615858368580409e+02, -1.556989798598866e+02,
                         6.680131188771972e+01, -1.328068155288572e+01};
  const double q = p - 0.5;
  const double r = q * q;
  return (((((a[0] * r + a[1]) * r + a[2]) * r + a[3]) * r + a[4]) * r + a[5]) * q /
         (((((b[0] * r + b[1]) * r + b[2]) * r + b[3]) * r + b[4]) * r + 1.0);
}

double normal_quantile(double p) {
  constexpr std::array c{-7.784894002430293e-03, -3.223964580411365e-01, -2.400758277161838e+00,
                         -2.549732539343734e+00, 4.374664141464968e+00,  2.938163982698783e+00};
  constexpr std::array d{7.784695709041462e-03, 3.224671290700398e-01, 2.445134137142996e+00,
                         3.754408661907416e+00};
  if (p >= tail && p <= 1.0 - tail) return middle_quantile(p);
  const double q = std::sqrt(-2.0 * std::log(std::min(p, 1.0 - p)));
  const double x = (((((c[0] * q + c[1]) * q + c[2]) * q + c[3]) * q + c[4]) * q + c[5]) /
                   ((((d[0] * q + d[1]) * q + d[2]) * q + d[3]) * q + 1.0);
  return p < 0.5 ? x : -x;
}

double normal(std::uint64_t random) {
  return normal_quantile(share(static_cast<std::uint32_t>(random >> 32U)));
}

// Where a frame is between two of the independent draws that follow one another every `frames`, and
// how much of each is in it: squares sum to 1, so that the variance stays.
struct Between {
  std::uint64_t draw;  // number of the one before
  double before, after;
  Between(std::uint64_t frame, std::uint64_t frames) : draw(frame / frames) {
    const double share = static_cast<double>(frame % frames) / static_cast<double>(frames);
    const double angle = 0.5 * std::numbers::pi * share * share * (3.0 - 2.0 * share);
    before = std::cos(angle);
    after = std::sin(angle);
  }
};

// Two values share 64 random bits.
constexpr std::uint32_t bits_of_value(std::uint64_t key, std::uint64_t index) {
  const std::uint64_t random = bits(key, index & ~std::uint64_t{1});
  return static_cast<std::uint32_t>((index & 1U) != 0 ? random : random >> 32U);
}

PALPATE_VECTORISED
void fill_middle(std::uint64_t key, float* out, std::uint64_t count) {
#pragma omp simd
  for (std::uint64_t i = 0; i < count; ++i)
    out[i] = static_cast<float>(middle_quantile(share(bits_of_value(key, i))));
}

// exp(-(d/length)^2) is the autocorrelation of white noise behind a Gaussian of sd length/2.
std::vector<float> gaussian_kernel(double correlation) {
  const int reach = static_cast<int>(std::ceil(2.0 * correlation));
  std::vector<double> taps;
  double squares = 0.0;
  for (int i = -reach; i <= reach; ++i) {
    taps.push_back(reach == 0 ? 1.0 : std::exp(-2.0 * i * i / (correlation * correlation)));
    squares += taps.back() * taps.back();
  }
  std::vector<float> kernel;
  for (const double tap : taps) kernel.push_back(static_cast<float>(tap / std::sqrt(squares)));
  return kernel;
}

PALPATE_VECTORISED
void add_scaled(float factor, const float* in, float* out, int count) {
#pragma omp simd
  for (int i = 0; i < count; ++i) out[i] += factor * in[i];
}

// With a ray (x, y, 1) and p, q the slopes of depth across a pixel's width and height as shares of
// depth, the surface's normal is along (-p fx, -q fy, 1 + p fx x + q fy y), and its product with
// the ray is 1.
PALPATE_VECTORISED
void blank_grazing_row(const Intrinsics& camera, double least_cosine, int v, const float* truth,
                       std::uint16_t* readings) {
  const std::ptrdiff_t width = camera.width;
  const double fx = camera.fx;
  const double fy = camera.fy;
  const double cx = camera.cx;
  const double y = (v - camera.cy) / fy;
  const double limit = 1.0 / (least_cosine * least_cosine);
#pragma omp simd
  for (std::ptrdiff_t i = 1; i < width - 1; ++i) {
    const float z = truth[i];
    // The smaller of both differences: beside an edge the surface continues to one side only.
    const float left = z - truth[i - 1];
    const float right = truth[i + 1] - z;
    const float above = z - truth[i - width];
    const float below = truth[i + width] - z;
    const float across = std::abs(left) < std::abs(right) ? left : right;
    const float down = std::abs(above) < std::abs(below) ? above : below;
    const double x = (static_cast<double>(i) - cx) / fx;
    const double a = fx * double{across} / double{z};
    const double b = fy * double{down} / double{z};
    const double c = 1.0 + a * x + b * y;
    const bool seen = (a * a + b * b + c * c) * (x * x + y * y + 1.0) <= limit;
    readings[i] = seen ? readings[i] : std::uint16_t{0};
  }
}

// The D4xx's noise is what a block matcher makes: an average over a window, which correlates as a
// triangle, and a little of each pixel's own. Fitted to eight frames of a resting table, by depth.
struct D4xxNoise {
  double depth;               // [m]
  double sigma;               // [m]
  double window_x, window_y;  // [px]
  double own;                 // [-] share of the variance that is the pixel's own
};
constexpr std::array d4xx_table{D4xxNoise{0.45, 1.7e-3, 22.0, 11.0, 0.06},
                                D4xxNoise{0.70, 3.1e-3, 21.0, 19.0, 0.025},
                                D4xxNoise{0.90, 5.2e-3, 28.0, 19.0, 0.005}};

D4xxNoise d4xx_noise(double depth) {
  const D4xxNoise& front = d4xx_table.front();
  const D4xxNoise& back = d4xx_table.back();
  const auto beyond = [depth](D4xxNoise end) {
    end.sigma *= depth * depth / (end.depth * end.depth);
    return end;
  };
  if (depth <= front.depth) return beyond(front);
  if (depth >= back.depth) return beyond(back);
  const std::size_t i = depth < d4xx_table[1].depth ? 0 : 1;
  const D4xxNoise& a = d4xx_table[i];
  const D4xxNoise& b = d4xx_table[i + 1];
  const double w = (depth - a.depth) / (b.depth - a.depth);
  // A power law between two rows; the windows in proportion.
  const double power = std::log(depth / a.depth) / std::log(b.depth / a.depth);
  return {depth, a.sigma * std::pow(b.sigma / a.sigma, power),
          a.window_x + w * (b.window_x - a.window_x), a.window_y + w * (b.window_y - a.window_y),
          a.own + w * (b.own - a.own)};
}

// The same per pixel: whole windows, and factors for their sum and for the pixel's own noise.
struct WindowNoise {
  int before_x, after_x, before_y, after_y;  // [px] window: from -before to +after
  float of_sum, of_own;
};
constexpr int largest_window = 32;        // [px]
constexpr double d4xx_depth_step = 5e-3;  // [m]
constexpr std::size_t d4xx_depth_steps = 2000;

std::vector<WindowNoise> d4xx_by_depth() {
  std::vector<WindowNoise> rows;
  for (std::size_t i = 0; i < d4xx_depth_steps; ++i) {
    const D4xxNoise noise = d4xx_noise(d4xx_depth_step * (static_cast<double>(i) + 0.5));
    const int x = static_cast<int>(std::lround(noise.window_x));
    const int y = static_cast<int>(std::lround(noise.window_y));
    rows.push_back({x / 2, x - 1 - x / 2, y / 2, y - 1 - y / 2,
                    static_cast<float>(noise.sigma * std::sqrt((1.0 - noise.own) / (x * y))),
                    static_cast<float>(noise.sigma * std::sqrt(noise.own))});
  }
  return rows;
}

}  // namespace

SensorModel SensorModel::named(std::string_view name) {
  constexpr double grazing = 80.0 * std::numbers::pi / 180.0;
  if (name == "ideal") return {};
  if (name == "d4xx")
    return {.d4xx_noise = true, .quantisation = 1e-3, .grazing = grazing, .flying = 0.3};
  // Khoshelham and Elberink, Sensors 12 (2012), 1437: noise and step at 1 m.
  if (name == "kinect")
    return {.noise = 1.425e-3,
            .noise_growth = 2,
            .disparity_step = 2.85e-3,
            .quantisation = 1e-3,
            .grazing = grazing,
            .flying = 0.3};
  // Of a Kinect v2 1.5 mm and more have been measured (Corti and others, Robotics and Autonomous
  // Systems 75 (2016), 584), growing with depth.
  if (name == "tof")
    return {.noise = 2.0e-3,
            .noise_growth = 1,
            .quantisation = 1e-3,
            .grazing = grazing,
            .flying = 0.5};
  // An assumption, not fitted to a network: no holes, sharp edges, errors of 1 % of depth that are
  // alike over 40 pixels and a second, and a scale that is off by some percent.
  if (name == "learned")
    return {.noise = 0.01,
            .noise_growth = 1,
            .correlation_x = 40.0,
            .correlation_y = 40.0,
            .noise_frames = 30,
            .drift = 0.03,
            .quantisation = 1e-3};
  throw Error("sensor '" + std::string(name) + "'", "there is no such sensor",
              "choose one of: ideal, d4xx, kinect, tof, learned");
}

void validate(const SensorModel& model) {
  check_range("sensor", "noise", "m", 0.0, 1.0, model.noise);
  check_range("sensor", "correlation_x", "px", 0.0, 100.0, model.correlation_x);
  check_range("sensor", "correlation_y", "px", 0.0, 100.0, model.correlation_y);
  check_range("sensor", "noise_frames", "-", 1.0, 1e6, static_cast<double>(model.noise_frames));
  check_range("sensor", "drift", "-", 0.0, 0.2, model.drift);
  check_range("sensor", "disparity_step", "m", 0.0, 0.1, model.disparity_step);
  check_range("sensor", "quantisation", "m", 1e-6, 0.1, model.quantisation);
  check_range("sensor", "dropouts", "-", 0.0, 1.0, model.dropouts);
  check_range("sensor", "grazing", "rad", 0.0, 1.5707963267948967, model.grazing);
  check_range("sensor", "flying", "-", 0.0, 1.0, model.flying);
}

void fill_normal(std::uint64_t key, std::span<float> out) {
  vectorised<fill_middle>(key, out.data(), out.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (std::abs(out[i]) < middle_ends) continue;
    out[i] = static_cast<float>(normal_quantile(share(bits_of_value(key, i))));
  }
}

void add_point_noise(std::span<Vec3> points, double sigma, std::uint64_t seed,
                     std::uint64_t frame) {
  const std::uint64_t key = key_of(seed, frame, Salt::point);
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis)
      points[i][axis] += sigma * normal(bits(key, 3 * i + static_cast<std::uint64_t>(axis)));
  }
}

Sensor::Sensor(const SensorModel& model, const Intrinsics& intrinsics)
    : model_(model), camera_(intrinsics) {
  validate(model);
  validate(intrinsics);
  kernel_x_ = gaussian_kernel(model.correlation_x);
  kernel_y_ = gaussian_kernel(model.correlation_y);
}

// White noise over the image and a margin of the kernel's reach, then one pass along rows and one
// along columns. The field has unit variance until it is scaled and added to the depth.
void Sensor::add_gaussian_noise(std::uint64_t frame) {
  const int width = camera_.width;
  const int height = camera_.height;
  const int taps_x = static_cast<int>(kernel_x_.size());
  const int taps_y = static_cast<int>(kernel_y_.size());
  const int wide = width + taps_x - 1;
  const int high = height + taps_y - 1;
  field_.resize(static_cast<std::size_t>(wide) * high);
  const Between between(frame, model_.noise_frames);
  fill_normal(key_of(model_.seed, between.draw, Salt::white), field_);
  if (between.after > 0.0) {
    next_field_.resize(field_.size());
    fill_normal(key_of(model_.seed, between.draw + 1, Salt::white), next_field_);
    for (float& value : field_) value *= static_cast<float>(between.before);
    vectorised<add_scaled>(static_cast<float>(between.after), next_field_.data(), field_.data(),
                           static_cast<int>(field_.size()));
  }
  const float* smooth = field_.data();
  if (taps_x > 1) {
    rows_.assign(static_cast<std::size_t>(width) * high, 0.0F);
    for (int v = 0; v < high; ++v) {
      const float* in = field_.data() + static_cast<std::ptrdiff_t>(v) * wide;
      float* out = rows_.data() + static_cast<std::ptrdiff_t>(v) * width;
      for (int i = 0; i < taps_x; ++i) vectorised<add_scaled>(kernel_x_[i], in + i, out, width);
    }
    smooth = rows_.data();
  }
  const auto sigma = static_cast<float>(model_.noise);
  std::vector<float> row(width);
  for (int v = 0; v < height; ++v) {
    std::fill(row.begin(), row.end(), 0.0F);
    for (int i = 0; i < taps_y; ++i)
      vectorised<add_scaled>(kernel_y_[i], smooth + static_cast<std::ptrdiff_t>(v + i) * width,
                             row.data(), width);
    float* depth = depth_.data() + static_cast<std::ptrdiff_t>(v) * width;
    if (model_.noise_growth == 2) {
      for (int u = 0; u < width; ++u) depth[u] += sigma * depth[u] * depth[u] * row[u];
    } else if (model_.noise_growth == 1) {
      for (int u = 0; u < width; ++u) depth[u] += sigma * depth[u] * row[u];
    } else {
      vectorised<add_scaled>(sigma, row.data(), depth, width);
    }
  }
}

void Sensor::drift(std::uint64_t frame) {
  const Between between(frame, drift_frames);
  const auto drawn = [&](std::uint64_t draw) {
    return normal(bits(key_of(model_.seed, draw, Salt::drift), 0));
  };
  const double off = between.before * drawn(between.draw) + between.after * drawn(between.draw + 1);
  for (float& depth : depth_) depth *= static_cast<float>(1.0 + model_.drift * off);
}

// The sum over any window is four look-ups in the table of sums from the corner.
void Sensor::add_d4xx_noise(std::uint64_t frame) {
  static const std::vector<WindowNoise> by_depth = d4xx_by_depth();
  constexpr int border = largest_window / 2;
  const int width = camera_.width;
  const int height = camera_.height;
  const int wide = width + 2 * border;
  const int high = height + 2 * border;
  field_.resize(static_cast<std::size_t>(wide) * high);
  fill_normal(key_of(model_.seed, frame, Salt::window), field_);
  const std::ptrdiff_t pitch = wide + 1;
  sums_.assign(static_cast<std::size_t>(pitch) * (high + 1), 0.0);
  for (int v = 0; v < high; ++v) {
    const float* in = field_.data() + static_cast<std::ptrdiff_t>(v) * wide;
    const double* above = sums_.data() + v * pitch + 1;
    double* out = sums_.data() + (v + 1) * pitch + 1;
    double row = 0.0;
    for (int u = 0; u < wide; ++u) {
      row += in[u];
      out[u] = above[u] + row;
    }
  }
  rows_.resize(static_cast<std::size_t>(width) * height);
  fill_normal(key_of(model_.seed, frame, Salt::nugget), rows_);
  for (int v = 0; v < height; ++v) {
    float* depth = depth_.data() + static_cast<std::ptrdiff_t>(v) * width;
    const float* own = rows_.data() + static_cast<std::ptrdiff_t>(v) * width;
    for (int u = 0; u < width; ++u) {
      if (!(depth[u] > 0.0F && depth[u] < nothing)) continue;
      const auto step = static_cast<std::size_t>(depth[u] / static_cast<float>(d4xx_depth_step));
      const WindowNoise& noise = by_depth[std::min(step, by_depth.size() - 1)];
      const double* low = sums_.data() + (v + border - noise.before_y) * pitch + u + border;
      const double* high_row = sums_.data() + (v + border + noise.after_y + 1) * pitch + u + border;
      const double sum = high_row[noise.after_x + 1] - high_row[-noise.before_x] -
                         low[noise.after_x + 1] + low[-noise.before_x];
      depth[u] += noise.of_sum * static_cast<float>(sum) + noise.of_own * own[u];
    }
  }
}

void Sensor::let_edges_fly(std::span<const float> truth, std::uint64_t frame) {
  const int width = camera_.width;
  const int height = camera_.height;
  const std::uint64_t key = key_of(model_.seed, frame, Salt::flying);
  constexpr float edge =
      0.03F;  // [-] of the depth: a surface would need an angle of incidence of 87 degrees
  for (int v = 1; v + 1 < height; ++v) {
    for (int u = 1; u + 1 < width; ++u) {
      const std::ptrdiff_t i = static_cast<std::ptrdiff_t>(v) * width + u;
      const float here = truth[i];
      if (!(here < nothing)) continue;
      float other = here;
      for (const std::ptrdiff_t step : {-1, 1, -width, width}) {
        const float there = truth[i + step];
        if (there < nothing && std::abs(there - here) > std::abs(other - here)) other = there;
      }
      if (std::abs(other - here) <= edge * here) continue;
      const std::uint64_t random = bits(key, i);
      if (share(static_cast<std::uint32_t>(random)) >= model_.flying) continue;
      depth_[i] +=
          (other - here) * static_cast<float>(share(static_cast<std::uint32_t>(random >> 32U)));
    }
  }
}

void Sensor::blank_grazing(std::span<const float> truth,
                           std::vector<std::uint16_t>& readings) const {
  for (int v = 1; v + 1 < camera_.height; ++v) {
    const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(v) * camera_.width;
    vectorised<blank_grazing_row>(camera_, std::cos(model_.grazing), v, truth.data() + row,
                                  readings.data() + row);
  }
}

std::vector<std::uint16_t> Sensor::measure(std::span<const float> depth, std::uint64_t frame) {
  const std::size_t pixels = static_cast<std::size_t>(camera_.width) * camera_.height;
  if (depth.size() != pixels)
    throw Error("depth",
                std::to_string(depth.size()) + " values for " + std::to_string(pixels) + " pixels");
  depth_.assign(depth.begin(), depth.end());
  if (model_.flying > 0.0) let_edges_fly(depth, frame);
  if (model_.noise > 0.0) add_gaussian_noise(frame);
  if (model_.drift > 0.0) drift(frame);
  if (model_.d4xx_noise) add_d4xx_noise(frame);
  if (model_.disparity_step > 0.0) {
    const auto step = static_cast<float>(model_.disparity_step);
    for (float& z : depth_) z = 1.0F / (std::nearbyint(1.0F / (z * step)) * step);
  }
  std::vector<std::uint16_t> readings(pixels);
  const auto units_per_metre = static_cast<float>(1.0 / model_.quantisation);
  for (std::size_t i = 0; i < pixels; ++i) {
    const float units = depth_[i] * units_per_metre + 0.5F;
    // 65535 means saturated; 0 means no reading, also where noise moved it behind the camera.
    readings[i] = units >= 1.0F && units < 65535.0F
                      ? static_cast<std::uint16_t>(static_cast<std::int32_t>(units))
                      : std::uint16_t{0};
  }
  if (model_.grazing < 0.5 * std::numbers::pi) blank_grazing(depth, readings);
  if (model_.dropouts > 0.0) {
    const std::uint64_t key = key_of(model_.seed, frame, Salt::dropout);
    for (std::size_t i = 0; i < pixels; ++i) {
      if (share(static_cast<std::uint32_t>(bits(key, i) >> 32U)) < model_.dropouts) readings[i] = 0;
    }
  }
  return readings;
}

}  // namespace palpate
