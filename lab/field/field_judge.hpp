// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "lab/field/field_cases.hpp"
#include "palpate/kernel/core/method.hpp"

namespace palpate::lab::field {

/// How a method did in a case: docs/field.md has the rules.
struct Verdict {
  bool lost = false;         ///< behind for too long in one go
  bool numb = false;         ///< next to no force for too long where both rulers have one
  bool wrong_side = false;   ///< a force against both rulers' for too long
  double behind = 0.0;       ///< [s] the longest in one go
  double worst_ghost = 0.0;  ///< [N] in free space that is seen to be free
  double worst_step = 0.0;   ///< [N] largest change of the force from tick to tick in contact
  /// [m] The longest way between two corners of the box that holds the proxy while hand and surface
  /// rest; negative: they never rest for long enough.
  double shake = -1.0;

  // How well it knows itself that it is behind: the tick's flag `pop_through_suspected`.
  double time = 0.0;         ///< [s] in all
  double time_behind = 0.0;  ///< [s] behind, where that can be known
  double alarmed = 0.0;      ///< [s] of that with the flag
  double false_alarm = 0.0;  ///< [s] with the flag, and not behind
  int times_behind = 0;      ///< how often it came behind
  int quick_returns = 0;     ///< how often it was in front again within `quick`

  [[nodiscard]] bool ghost() const { return worst_ghost > 0.0; }
  [[nodiscard]] bool right() const { return !lost && !numb && !wrong_side && !ghost(); }
};

/// What the rulers and the camera have of a tick.
struct Ruling {
  Tick now;   ///< of the sphere on the surface as it is
  Tick seen;  ///< of the sphere on the surface as the newest frame showed it
  /// Within the last half second what is touched has been in sight and the rulers agreed.
  bool known = true;
  bool free_in_sight = false;  ///< the hand is seen to be in free space
  bool rests = false;          ///< hand and rulers' proxies have not moved since the tick before
};

/// What a case came to.
struct Outcome {
  /// Why it cannot be known and does not count: "thin", "fast" or "hidden"; empty: it counts.
  std::string unknown;
  std::vector<Verdict> verdicts;  ///< of each method; empty for "thin", which is not played
};

/// Plays a case to several methods at once, beside the rulers.
/// @param tick  called after each tick of the first method, if given
Outcome play_field(
    Stage& stage, const std::vector<Method*>& methods, const Parameters& parameters,
    const std::function<void(const Tick&, const Ruling&, bool behind)>& tick = nullptr);

}  // namespace palpate::lab::field
