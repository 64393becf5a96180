// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "lab/experiment.hpp"
#include "palpate/kernel/core/tick.hpp"

namespace palpate::lab {

struct PopCase;

/// The bench's rules for a force on both sides, docs/pop.md, rule 4: none in free space, none on
/// the wrong side, and not next to none where the ruler has one.
class ForceJudge {
 public:
  /// @param r_c        [m] contact radius
  /// @param tick_rate  [Hz]
  /// @param frame      [ticks] from one frame to the next
  ForceJudge(double r_c, double tick_rate, double frame)
      : r_c_(r_c), tick_rate_(tick_rate), frame_(frame) {}

  /// Judges the next tick.
  /// @param ruler  the same tick by the ruler
  /// @param clear  [m] from the hand to the nearest body, now and in the newest frame
  void add(const Tick& tick, const Tick& ruler, double clear);

  [[nodiscard]] bool ghost() const { return worst_ghost_ > 0.0; }
  [[nodiscard]] bool numb() const { return numb_; }
  [[nodiscard]] bool wrong_side() const { return wrong_; }
  [[nodiscard]] bool right() const { return !ghost() && !numb_ && !wrong_; }
  [[nodiscard]] double worst_ghost() const { return worst_ghost_; }  ///< [N]

 private:
  double r_c_;
  double tick_rate_;
  double frame_;
  double worst_ghost_ = 0.0;
  int numb_for_ = 0;   // ticks in a row
  int wrong_for_ = 0;  // ticks in a row
  bool numb_ = false;
  bool wrong_ = false;
};

/// What the bench's rules say of one case.
struct Judgement {
  bool held = false;   ///< rule 2
  bool right = false;  ///< rule 4
};

/// Plays one case.
Judgement judge(const std::string& method, const PopCase& c, const ExperimentOptions& options);

/// A measure of a scene, and the most that it is to be.
struct FidelityMeasure {
  std::string_view scene;
  std::string_view name;
  std::string_view unit;
  std::optional<double> aim;  ///< none: it is only shown
};
std::span<const FidelityMeasure> fidelity_measures();
std::vector<std::string_view> fidelity_scenes();

/// Has a scene no noise, so that every seed gives the same?
bool is_without_chance(std::string_view scene);

/// One case on a recording: a place and a motion drawn at random.
struct RealCase {
  std::string text;  ///< all that was drawn
  std::function<Judgement(const std::string& method, const ExperimentOptions& options)> play;
};

struct RealCases {
  std::string hash;    ///< SHA-256 of the recording's frames
  std::size_t frames;  ///< that are taken of it
  std::vector<RealCase> cases;
};

/// Cases on the recording of a camera at rest: they follow from its frames, the seed and their
/// number alone, the motions composed exactly.
/// @param name  what the recording is called in the cases' texts
/// @throws Error if it cannot be read, its camera moved, or it shows nothing flat.
RealCases draw_real_cases(const std::string& uri, const std::string& name, std::uint64_t seed,
                          std::size_t count);

}  // namespace palpate::lab
