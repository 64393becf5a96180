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
  /// Number of the cycle that took it, as ServoTick::number; none in an old recording.
  std::optional<std::uint64_t> tick{};
};

/// State of a Cycle between two ticks as an array of numbers, without method and settings: safety
/// chain, workspace, fixtures, energy observer and frame ages. The method is not included, because
/// the state is saved when a new method takes over.
struct CycleState {
  static constexpr std::size_t capacity = 1024;
  std::array<double, capacity> numbers{};  ///< the first `count` count; see cycle_state_names()
  std::uint64_t count = 0;
};

// Visitors of the state of an object. Each class has a `walk(way, self)` that calls `way(name,
// value)` for each value in turn, so that names, writing and reading cannot differ.

/// Writes the values as numbers. [servo]
class PutState {
 public:
  explicit PutState(CycleState& state) noexcept : state_(state) { state_.count = 0; }

  void operator()(std::string_view /*name*/, const Vec3& v) noexcept {
    for (int axis = 0; axis < 3; ++axis) put(v[axis]);
  }
  void operator()(std::string_view /*name*/, const std::optional<double>& v) noexcept {
    put(v.value_or(std::numeric_limits<double>::quiet_NaN()));
  }
  template <class T>
  requires std::is_arithmetic_v<T>
  void operator()(std::string_view /*name*/, const T& v) noexcept {
    put(static_cast<double>(v));  // whole numbers are far below 2^53
  }

 private:
  void put(double number) noexcept {
    if (state_.count < CycleState::capacity) state_.numbers[state_.count++] = number;
  }
  CycleState& state_;
};

/// Collects the names of the numbers.
class NameState {
 public:
  void operator()(std::string_view name, const Vec3& /*v*/) {
    for (const char* axis : {"_x", "_y", "_z"}) names.push_back(std::string(name) + axis);
  }
  template <class T>
  void operator()(std::string_view name, const T& /*v*/) {
    names.emplace_back(name);
  }
  std::vector<std::string> names;
};

/// Reads the values back; each call throws Error for a number that its value cannot have.
class GetState {
 public:
  explicit GetState(const CycleState& state) : state_(state) {}

  void operator()(std::string_view /*name*/, Vec3& v) {
    for (int axis = 0; axis < 3; ++axis) v[axis] = next();
  }
  void operator()(std::string_view /*name*/, std::optional<double>& v) {
    const double number = next();
    v = std::isnan(number) ? std::nullopt : std::optional(number);
  }
  void operator()(std::string_view /*name*/, double& v) { v = next(); }
  template <class T>
  requires std::is_integral_v<T>
  void operator()(std::string_view name, T& v) {
    constexpr double exact = 9007199254740992.0;  // 2^53
    const double most = std::min(exact, static_cast<double>(std::numeric_limits<T>::max()));
    const double number = next();
    if (!(number >= 0.0 && number <= most && number == std::floor(number)))
      throw Error("state of the cycle",
                  "has a " + std::string(name) + " of " + std::to_string(number),
                  "it may be damaged, or of another version of palpate");
    v = static_cast<T>(number);
  }

  [[nodiscard]] bool at_end() const { return at_ == state_.count; }

 private:
  double next() {
    if (at_ >= state_.count || at_ >= CycleState::capacity)
      throw Error("state of the cycle", "has too few numbers",
                  "it may be damaged, or of another version of palpate");
    return state_.numbers[at_++];
  }
  const CycleState& state_;
  std::size_t at_ = 0;
};

}  // namespace palpate
