// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

#include "app/playback.hpp"
#include "palpate/core/renderer.hpp"

namespace palpate::app {

/// What a run amounted to: counted tick by tick, printed for people or for programs.
class Summary {
 public:
  /// @param playback  to judge where the proxy is with respect to what the cameras measured
  void count(const Tick& tick, const Playback& playback, double r_c);

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
