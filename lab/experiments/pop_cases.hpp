// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <random>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "lab/experiment.hpp"
#include "lab/method.hpp"
#include "lab/play.hpp"

namespace palpate::lab {

/// Numbers at random, the same on every machine.
class Chance {
 public:
  explicit Chance(std::uint64_t seed) : bits_(seed) {}
  double operator()() { return static_cast<double>(bits_() >> 11U) * 0x1p-53; }
  double operator()(double low, double high) { return low + (high - low) * (*this)(); }

 private:
  std::mt19937_64 bits_;
};

/// The chance of case number `index` of what has this name: from seed, name and index alone.
Chance chance_of(std::string_view name, std::uint64_t seed, std::uint64_t index);

/// A value to three digits, so that a printed case is exactly the one that was played.
double rounded(double value);

/// A value that a family of cases draws at random.
struct PopRange {
  std::string_view key;
  double simple;     ///< the simplest there is: what a failure is shrunk towards
  double low, high;  ///< drawn evenly from here to there
  enum class Draw { even, by_factor, whole } draw = Draw::even;  ///< by_factor: its logarithm is
  double wide = 0.0;  ///< largest value that may be given by hand, if larger than `high`
};

/// One case of the bench: all that it depends on, in SI.
struct PopCase {
  std::string_view family;
  std::map<std::string, double, std::less<>> values;
  std::uint64_t seed = 0;

  [[nodiscard]] double operator[](std::string_view key) const;
  /// `pop:FAMILY?KEY=VALUE&...&seed=N`, which parse_pop_case reads back to the same.
  [[nodiscard]] std::string text() const;
};

/// A case made ready to play.
struct PopStage {
  Scenario scenario;
  Truth truth;
  Vec3 seat = Vec3::Zero();
  /// [s] stamp of the newest frame that was shown
  std::shared_ptr<double> shown = std::make_shared<double>(0.0);
  /// It counts where the proxy is when the scene ends (5.2), and not only what lasts.
  bool judged_at_end = false;
  double steady_from = 1e9;  ///< [s] from then on the true force does not change
  /// The same without what then passes, noise and all: what that changes, and what does not.
  std::shared_ptr<const PopStage> undisturbed = nullptr;
};

/// A family of cases.
struct PopFamily {
  std::string_view name;
  std::string_view summary;
  std::span<const PopRange> ranges;
  PopStage (*stage)(const PopCase&, const Parameters&);
};

/// 5.2: a level grid of points that is lifted with an acceleration under noise, once the hand waits
/// above it, for ten frames. @param c  with its noise [m] and acceleration [m/s^2]
PopStage grid_lift(const PopCase& c, const Parameters& parameters, Noise noise);

/// All families, in the order of the tables.
std::span<const PopFamily> pop_families();

/// @throws Error for an unknown name, naming the nearest and listing all.
const PopFamily& find_pop_family(std::string_view name);

/// Case number `index` of a family: from seed, family and index alone.
PopCase draw_pop_case(const PopFamily& family, std::uint64_t seed, std::uint64_t index);

/// @throws Error for an unknown family or key, or a value that cannot be.
PopCase parse_pop_case(const std::string& text);

}  // namespace palpate::lab
