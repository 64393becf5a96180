// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/registration.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <fstream>
#include <mutex>
#include <string_view>
#include <thread>

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "palpate/kernel/core/csv.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/pose.hpp"
#include "palpate/servo/last_gate.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {
namespace {

constexpr double farthest = 1e6;  // [m]

// The named columns of a CSV file, line by line.
template <std::size_t N>
std::vector<std::array<double, N>> read_columns(const std::filesystem::path& file,
                                                const std::array<std::string_view, N>& columns) {
  const std::string name = file.string();
  std::ifstream in(file);
  std::error_code unused;
  if (!in || std::filesystem::is_directory(file, unused))
    throw Error(name, "it cannot be read", "name a CSV file of touched points");
  CsvColumns lines(in, name, columns);
  std::vector<std::array<double, N>> rows;
  for (std::array<double, N> row{}; lines.next(row); rows.push_back(row)) {
    for (std::size_t i = 0; i < N; ++i) {
      if (!(std::abs(row[i]) <= farthest))
        throw Error(lines.where(), std::string(columns[i]) + " is no place",
                    "give a finite number of metres within 1000 km");
    }
  }
  if (rows.empty()) {
    throw Error(name, "it has no points",
                "give the line '" + lines.header() + "' and a line for each");
  }
  return rows;
}

// The height of the points' largest triangle over their longest distance [m].
double height_over_longest_side(std::span<const PointPair> pairs, Vec3 PointPair::*member) {
  double longest = 0.0;
  Vec3 from = Vec3::Zero();
  Vec3 along = Vec3::UnitX();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    for (std::size_t j = i + 1; j < pairs.size(); ++j) {
      const Vec3 side = pairs[j].*member - pairs[i].*member;
      if (side.norm() <= longest) continue;
      longest = side.norm();
      from = pairs[i].*member;
      along = side.normalized();
    }
  }
  double height = 0.0;
  for (const PointPair& pair : pairs)
    height = std::max(height, (pair.*member - from).cross(along).norm());
  return height;
}

std::string millimetres(double metres) { return shortest(std::round(1e4 * metres) / 10.0) + " mm"; }

void check_spread(std::span<const PointPair> pairs, const FitOptions& options) {
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    for (std::size_t j = i + 1; j < pairs.size(); ++j) {
      const double distance = (pairs[i].world - pairs[j].world).norm();
      if (distance >= options.least_distance) continue;
      throw Error(
          "calibration points",
          "points " + std::to_string(i + 1) + " and " + std::to_string(j + 1) + " are only " +
              millimetres(distance) + " apart",
          "choose points at least " + millimetres(options.least_distance) + " apart, better 10 cm");
    }
  }
  const double height = height_over_longest_side(pairs, &PointPair::world);
  if (height >= options.least_height) return;
  throw Error("calibration points",
              "they lie on a line, to within " + millimetres(height) +
                  ": the rotation about it is not determined",
              "choose points that span a triangle or more");
}

struct Rigid {
  Eigen::Matrix3d rotation;
  double scale;
  Vec3 translation;
  double rms;
};

// Umeyama's solution. @param mirrored  of the device's points with their z axis turned round
Rigid best_fit(std::span<const PointPair> pairs, const FitOptions& options, bool mirrored) {
  const double given = options.fit_scale ? 1.0 : options.scale;
  const auto count = static_cast<Eigen::Index>(pairs.size());
  const Vec3 axes(given, given, mirrored ? -given : given);
  Eigen::Matrix3Xd device(3, count);
  Eigen::Matrix3Xd world(3, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const PointPair& pair = pairs[static_cast<std::size_t>(i)];
    device.col(i) = axes.cwiseProduct(pair.device);
    world.col(i) = pair.world;
  }
  const Eigen::Affine3d fit(Eigen::umeyama(device, world, options.fit_scale));
  const double scale = fit.linear().col(0).norm();
  return {.rotation = fit.linear() / scale,
          .scale = options.fit_scale ? scale : options.scale,
          .translation = fit.translation(),
          .rms = std::sqrt((fit * device - world).colwise().squaredNorm().mean())};
}

// The mean distance of the points from their centre [m].
double spread(std::span<const PointPair> pairs, Vec3 PointPair::*member) {
  Vec3 mean = Vec3::Zero();
  for (const PointPair& pair : pairs) mean += pair.*member / static_cast<double>(pairs.size());
  double squares = 0.0;
  for (const PointPair& pair : pairs) squares += (pair.*member - mean).squaredNorm();
  return std::sqrt(squares / static_cast<double>(pairs.size()));
}

constexpr double rest_time = 0.5;     // [s] a device without buttons rests for so long
constexpr double rest_radius = 1e-3;  // [m] within this distance of where the rest began
// [m] from the last point, or from the start, before the next
constexpr double least_travel = 0.01;

}  // namespace

PlacementFit fit_placement(std::span<const PointPair> pairs, const FitOptions& options) {
  if (pairs.size() < 3) {
    throw Error("calibration points", std::to_string(pairs.size()) + " are too few",
                "touch three points or more");
  }
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!pairs[i].device.allFinite() || !pairs[i].world.allFinite())
      throw Error("calibration points", "point " + std::to_string(i + 1) + " is not finite",
                  "give finite metres");
  }
  check_spread(pairs, options);
  const double ratio = spread(pairs, &PointPair::world) / spread(pairs, &PointPair::device);
  constexpr double most_off = 1.5;
  const double off = options.fit_scale ? 1.0 : ratio / options.scale;
  if (!(off < most_off && off > 1.0 / most_off)) {
    throw Error("calibration points",
                "distances in the scene are " + shortest(std::round(1e3 * ratio) / 1e3) +
                    " times those on the device, not " + shortest(options.scale),
                "use metres for both and check the order of the points, or fit the scale");
  }
  const Rigid fit = best_fit(pairs, options, false);
  constexpr double noticeable = 5e-3;  // [m] more than a good calibration leaves
  const Rigid mirrored = best_fit(pairs, options, true);
  if (fit.rms > noticeable && mirrored.rms < 0.3 * fit.rms) {
    throw Error("calibration points",
                "they fit within " + millimetres(mirrored.rms) + " if the device's frame is " +
                    "mirrored, but only within " + millimetres(fit.rms) + " as it is",
                "check the signs and the order of the device's axes");
  }
  PlacementFit result;
  result.placement.world_from_device.linear() = fit.rotation;
  result.placement.world_from_device.translation() = fit.translation;
  result.placement.workspace_scale = fit.scale;
  result.rms = fit.rms;
  for (const PointPair& pair : pairs) {
    const Vec3 fitted = result.placement.world_from_device * Vec3(fit.scale * pair.device);
    result.residuals.push_back((pair.world - fitted).norm());
  }
  validate(result.placement);
  return result;
}

std::vector<PointPair> read_pairs(const std::filesystem::path& file) {
  constexpr std::array<std::string_view, 6> columns{"dx", "dy", "dz", "wx", "wy", "wz"};
  std::vector<PointPair> pairs;
  for (const auto& row : read_columns(file, columns))
    pairs.push_back({{row[0], row[1], row[2]}, {row[3], row[4], row[5]}});
  return pairs;
}

std::vector<Vec3> read_points(const std::filesystem::path& file) {
  constexpr std::array<std::string_view, 3> columns{"x", "y", "z"};
  std::vector<Vec3> points;
  for (const auto& row : read_columns(file, columns)) points.emplace_back(row[0], row[1], row[2]);
  return points;
}

std::optional<Vec3> PointCapture::add(const HandState& hand, double t) noexcept {
  if (!hand.present || hand.fault != DeviceFault::none || !hand.position.allFinite()) {
    rest_began_.reset();
    return std::nullopt;
  }
  const Vec3& position = hand.position;
  if (hand.buttons) {
    const std::uint32_t before = buttons_.value_or(*hand.buttons);
    buttons_ = hand.buttons;
    if ((*hand.buttons & ~before) == 0) return std::nullopt;
    return position;
  }
  if (!reference_) reference_ = position;
  travelled_ = travelled_ || (position - *reference_).norm() >= least_travel;
  if (!rest_began_ || (position - rest_at_).norm() > rest_radius) {
    rest_began_ = t;
    rest_at_ = position;
    sum_.setZero();
    count_ = 0.0;
  }
  sum_ += position;
  count_ += 1.0;
  if (!travelled_ || t - *rest_began_ < rest_time) return std::nullopt;
  const Vec3 point = sum_ / count_;
  reference_ = point;
  travelled_ = false;
  rest_began_.reset();
  return point;
}

std::vector<Vec3> capture_points(Device& device, std::size_t count, double timeout,
                                 const std::function<void(const Vec3&)>& captured) {
  constexpr double period = 1e-3;  // [s]
  std::mutex mutex;                // a device's callback may be on a thread of its own
  PointCapture capture;
  std::vector<Vec3> points;
  HandState last;
  const auto read = [&](double t) {
    const HandState hand = device.read(t);
    LastGate::write_zero(device, t);
    const std::lock_guard lock(mutex);
    last = hand;
    if (points.size() >= count) return;
    if (const auto point = capture.add(hand, t)) points.push_back(*point);
  };
  std::size_t told = 0;
  // Tells of new points; true when there are enough.
  const auto done = [&] {
    std::vector<Vec3> now;
    HandState hand;
    {
      const std::lock_guard lock(mutex);
      now = points;
      hand = last;
    }
    for (; told < now.size(); ++told) {
      if (captured) captured(now[told]);
    }
    if (hand.fault != DeviceFault::none) {
      const std::string text = device.fault_text();
      throw Error(device.info().uri, text.empty() ? std::string(describe(hand.fault)) : text);
    }
    return now.size() >= count;
  };
  const auto give_up = [&] {
    throw Error(device.info().uri,
                "only " + std::to_string(told) + " of " + std::to_string(count) +
                    " points were touched in time",
                "touch each point and rest there for half a second, or press a button of the "
                "device");
  };
  if (device.info().simulated) {
    for (double t = 0.0; !done(); t += period) {
      if (t > timeout) give_up();
      read(t);
    }
    return points;
  }
  const double end = monotonic_now() + timeout;
  if (device.drives()) {
    struct Stop {
      Device& device;
      ~Stop() { device.stop(); }
    } stop{device};
    device.start([&] { read(monotonic_now()); });
    while (!done()) {
      if (monotonic_now() > end) give_up();
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    device.stop();
    return points;
  }
  while (!done()) {
    if (monotonic_now() > end) give_up();
    read(monotonic_now());
    std::this_thread::sleep_for(std::chrono::duration<double>(period));
  }
  return points;
}

}  // namespace palpate
