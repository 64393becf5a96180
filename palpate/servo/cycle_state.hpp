// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/hand.hpp"
#include "palpate/kernel/core/patch.hpp"
#include "palpate/servo/freshness.hpp"

namespace palpate {

/// A frame as a cycle took it into use: what a replay has to put.
struct AdoptedFrame {
  std::uint64_t number = 0;  ///< as ServoTick::frame_number
  double stamp = 0.0;        ///< [s] as the method got it
  double put_at = 0.0;       ///< [s] on the loop's clock: when it was handed over
  /// The first `camera_count` count: the camera that captured it, then the others.
  std::array<CameraFrame, Freshness::max_cameras> cameras{};
  std::uint64_t camera_count = 0;
  std::uint64_t tick = 0;  ///< number of the cycle that took it, as ServoTick::number
};

/// State of a Cycle between two ticks as an array of numbers, without method and settings: safety
/// chain, workspace, fixtures, energy observer and frame ages. The method is not included, because
/// the state is saved when a new method takes over.
struct CycleState {
  static constexpr std::size_t capacity = 1024;
  std::array<double, capacity> numbers{};  ///< the first `count` count; see cycle_state_names()
  std::uint64_t count = 0;
};

// Visitors of an object's values, as numbers. Each class has a `walk(way, self)` that calls
// `way(name, value)` for each value in turn, so that names, writing and reading cannot differ.

/// Writes the values, as many as there is room for. [servo]
class PutNumbers {
 public:
  explicit PutNumbers(std::span<double> numbers) noexcept : numbers_(numbers) {}

  template <class T>
  void operator()(std::string_view /*name*/, const T& v) noexcept {
    if constexpr (std::is_same_v<T, Vec3>) {
      for (const double number : v) put(number);
    } else if constexpr (std::is_same_v<T, Rotation>) {
      for (const double number : v.coeffs()) put(number);
    } else if constexpr (std::is_same_v<T, std::optional<double>>) {
      put(v.value_or(std::numeric_limits<double>::quiet_NaN()));
    } else {
      put(static_cast<double>(v));  // whole numbers are far below 2^53
    }
  }
  [[nodiscard]] std::size_t count() const noexcept { return count_; }

 private:
  void put(double number) noexcept {
    if (count_ < numbers_.size()) numbers_[count_++] = number;
  }
  std::span<double> numbers_;
  std::size_t count_ = 0;
};

/// Collects the names of the numbers.
class NameNumbers {
 public:
  template <class T>
  void operator()(std::string_view name, const T& /*v*/) {
    constexpr std::string_view axes = std::is_same_v<T, Vec3>       ? "xyz"
                                      : std::is_same_v<T, Rotation> ? "xyzw"
                                                                    : "";
    if (axes.empty()) names.emplace_back(name);
    for (const char axis : axes) names.push_back(std::string(name) + "_" + axis);
  }
  std::vector<std::string> names;
};

/// Reads the values back; each call throws Error about `what` for a number that its value cannot
/// have.
class GetNumbers {
 public:
  GetNumbers(std::span<const double> numbers, std::string what)
      : numbers_(numbers), what_(std::move(what)) {}

  template <class T>
  void operator()(std::string_view name, T& v) {
    if constexpr (std::is_same_v<T, Vec3>) {
      for (double& number : v) number = next();
    } else if constexpr (std::is_same_v<T, Rotation>) {
      for (double& number : v.coeffs()) number = next();
    } else if constexpr (std::is_same_v<T, std::optional<double>>) {
      const double number = next();
      v = std::isnan(number) ? std::nullopt : std::optional(number);
    } else if constexpr (std::is_enum_v<T>) {
      v = static_cast<T>(whole<int>(name, 0.0, 2.0));
    } else if constexpr (std::is_integral_v<T>) {
      using Limits = std::numeric_limits<T>;
      v = whole<T>(name, static_cast<double>(Limits::min()), static_cast<double>(Limits::max()));
    } else {
      v = next();
    }
  }
  /// A whole number of these limits.
  template <class T>
  T whole(std::string_view name, double least, double most) {
    constexpr double exact = 9007199254740992.0;  // 2^53
    const double number = next();
    if (!(number >= std::max(least, -exact) && number <= std::min(most, exact) &&
          number == std::floor(number)))
      throw Error(what_, "has a " + std::string(name) + " of " + std::to_string(number),
                  "it may be damaged, or of another version of palpate");
    return static_cast<T>(number);
  }

  [[nodiscard]] bool at_end() const { return at_ == numbers_.size(); }

 private:
  double next() {
    if (at_end())
      throw Error(what_, "has " + std::to_string(at_) + " numbers, too few",
                  "it may be damaged, or of another version of palpate");
    return numbers_[at_++];
  }
  std::span<const double> numbers_;
  std::string what_;
  std::size_t at_ = 0;
};

}  // namespace palpate
