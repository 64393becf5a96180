// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "lab/field/field_cases.hpp"
#include "palpate/kernel/core/mathematics.hpp"
#include "palpate/kernel/core/patch.hpp"
#include "palpate/kernel/core/uri.hpp"

namespace palpate::lab::field {

/// A scripted hand: one action after another, each with the least jerk; positions in metres, world.
class Script {
 public:
  explicit Script(const Vec3& start) : end_(start), start_(start) {}

  Script& wait(double seconds);
  /// Straight to a place. @param speed  [m/s] the fastest on the way
  Script& reach(const Vec3& to, double speed);
  /// Along straight pieces from place to place, the whole way as one movement.
  Script& stroke(const std::vector<Vec3>& places, double speed);
  /// Whatever else. @param place  where the hand is at a time [s] of the script
  Script& follow(double seconds, std::function<Vec3(double t)> place);

  [[nodiscard]] double duration() const { return now_; }  ///< [s] so far
  [[nodiscard]] const Vec3& end() const { return end_; }  ///< [m] where the hand is then
  [[nodiscard]] Vec3 at(double t) const;

 private:
  struct Action {
    double begin, end;
    std::function<Vec3(double t)> place;
  };
  std::vector<Action> actions_;
  double now_ = 0.0;
  Vec3 end_;
  Vec3 start_;
};

// What the sets of cases make their scenes and hands of.

constexpr double pi = std::numbers::pi;
constexpr double ease_peak = 1.875;  ///< [-] of ease(): the fastest over the mean

std::uint64_t hash_of(std::string_view text, std::uint64_t hash);

/// The values of a case, by name.
class Draw {
 public:
  explicit Draw(const FieldCase& c) : uri_(c.text()), seed_(c.seed) {}

  double even(std::string_view key, double low, double high);
  double by_factor(std::string_view key, double low, double high);
  /// One of 0 to count - 1.
  int whole(std::string_view key, int count);
  /// Random numbers for what has no name of its own.
  [[nodiscard]] std::uint64_t seed_of(std::string_view what) const { return hash_of(what, seed_); }

  /// @throws Error if a value was set that is none of them
  void check() const;
  /// All values, sorted by name.
  [[nodiscard]] std::string text() const;

 private:
  struct Value {
    double value;
    double low, high;  // that it may have
  };
  [[nodiscard]] double chance_of(std::string_view key) const {
    return Chance(hash_of(key, seed_)).even();
  }
  double given(std::string_view key, double drawn, double low, double high);

  Uri uri_;
  std::uint64_t seed_;
  std::map<std::string_view, Value> values_;
};

inline Eigen::Isometry3d at(const Vec3& place) {
  return Eigen::Isometry3d(Eigen::Translation3d(place));
}
inline Eigen::Isometry3d at(double x, double y, double z) { return at(Vec3(x, y, z)); }
inline Eigen::Isometry3d turned(double angle, const Vec3& axis = Vec3::UnitZ()) {
  return Eigen::Isometry3d(Eigen::AngleAxisd(angle, axis));
}
inline Body still(ShapePtr shape, const Eigen::Isometry3d& place = Eigen::Isometry3d::Identity()) {
  return {std::move(shape), place, nullptr};
}
inline Body moving(ShapePtr shape, std::function<Eigen::Isometry3d(double)> motion) {
  return {std::move(shape), Eigen::Isometry3d::Identity(), std::move(motion)};
}
inline Vec3 toward(double heading) { return {math::cos(heading), math::sin(heading), 0.0}; }

/// Where the camera may be.
struct View {
  double azimuth = 0.0;       ///< [rad] to which side it may be tilted
  double azimuth_range = pi;  ///< [rad] to both sides of it
  double least_tilt = 0.0;    ///< [rad] off straight above
};

/// A class fills this in; the camera is put before it afterwards.
struct Setting {
  FieldScene scene;
  std::function<Vec3(double t)> hip;
  double duration = 0.0;  ///< [s]
  View view;
  double most_tilt = 0.0;  ///< [rad] as View's; the class has set it
  double feature = std::numeric_limits<double>::infinity();
  /// Adds what depends on where the camera is [m]; may be none.
  std::function<void(FieldScene&, const Vec3& eye)> before_camera{};
};

struct Place {
  Vec3 point;   ///< [m] on the surface
  Vec3 normal;  ///< [-]
};

/// The first surface below a place, at a time.
Place below(const FieldScene& scene, double x, double y, double t = 0.0, double from = 0.5);

/// [s] of a way [m, rad] with the least jerk, whose highest speed is `fastest`.
inline double seconds_for(double way, double fastest) { return ease_peak * way / fastest; }

void play_script(Setting& setting, const Script& script);

/// Turned by an angle about z with the least jerk.
std::function<Eigen::Isometry3d(double)> turning(const Vec3& axis_at, double angle, double begin,
                                                 double seconds, const Eigen::Isometry3d& on_it);

/// An arm with a hand, its fingertips at the origin of `pose` and the arm towards its -x.
void add_arm(FieldScene& scene, const std::function<Eigen::Isometry3d(double)>& pose);

/// Of an image `wide` [m] about the place that is touched is taken, with at most `most_pixels` a
/// side: near it a camera runs at a lower resolution.
void crop(SensorSetup& setup, double distance, double wide, int most_pixels);

}  // namespace palpate::lab::field
