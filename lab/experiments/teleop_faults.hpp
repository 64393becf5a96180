// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "lab/teleop_rig.hpp"

namespace palpate::lab {

/// An episode: a scene before a noisy or an exact camera, a hand, a link, and what fails.
struct TeleopEpisode {
  TeleopScene scene;
  TeleopCase one;
  Fixture region;                     ///< forbidden, at both ends
  std::optional<double> failed = {};  ///< [s] when the robot is no longer led; none: it always is
  std::optional<double> back = {};    ///< [s] when it is again
  bool moves = false;                 ///< surfaces do
  std::string_view sensor = {};       ///< of the camera
  bool dark = false;  ///< the camera fails, so that a surface that moves is not seen
};
/// @param fault  `none`, `link`, `camera`, `operator` or `robot`
/// @throws Error for another one
TeleopEpisode teleop_episode(std::string_view fault, std::uint64_t seed);

/// What an episode comes to.
struct EpisodeFigures {
  double breach = 0.0;   ///< [m] of the tool's place in the forbidden region, at most
  double contact = 0.0;  ///< [N] of a surface on the tool, at most
  double unseen = 0.0;   ///< [N] the same while the camera is dark and things move
  double rise = 0.0;     ///< [N/ms] of the force on the hand, at most, after what failed is back
  double force = 0.0;    ///< [N] on the hand, at most
  /// [s] from the failure until the tool is slower than 10 mm/s; none: it was slow
  std::optional<double> stop = {};
};
EpisodeFigures play_episode(const TeleopEpisode& episode);

}  // namespace palpate::lab
