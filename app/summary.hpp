// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include "palpate/core/cloud.hpp"
#include "palpate/core/tick.hpp"

namespace palpate::app {

/// How far the proxy is behind what was measured [m], by the camera that sees it least so; none if
/// no camera with a depth image tells.
std::optional<double> least_behind(std::span<const Cloud* const> cameras, const Vec3& proxy,
                                   double r_c);

/// What a run amounted to: counted tick by tick, printed for people or for programs.
class Summary {
 public:
  /// @param frames  handed over so far
  /// @param behind  as `least_behind` says, or none where nobody has looked
  void count(const Tick& tick, std::size_t frames, const std::optional<double>& behind, double r_c);
  /// How many ticks came too late, in all.
  void set_late_ticks(std::size_t late_ticks) { late_ticks_ = late_ticks; }

  [[nodiscard]] std::size_t pop_throughs() const { return pop_throughs_; }

  [[nodiscard]] std::string text() const;
  [[nodiscard]] std::string json() const;

 private:
  std::size_t ticks_ = 0;
  std::size_t contact_ticks_ = 0;
  std::size_t steps_ = 0;
  std::size_t budget_hits_ = 0;
  std::size_t thinned_ = 0;
  std::size_t frames_ = 0;
  std::size_t late_ticks_ = 0;
  double max_force_ = 0.0;
  double first_t_ = 0.0;
  double last_t_ = 0.0;

  // Pop-throughs: the proxy touched, and is then more than its own radius behind what every camera
  // that sees it measured, for longer than one frame.
  std::size_t pop_throughs_ = 0;
  bool was_in_front_ = false;
  std::int64_t behind_since_frame_ = -1;
};

}  // namespace palpate::app
