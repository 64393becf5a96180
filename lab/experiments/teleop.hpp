// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "lab/teleop_rig.hpp"

namespace palpate::lab {

/// The scenes of `teleop`: `rest`, a plane that is pressed three times; `bob`, one that moves by 60
/// mm/s at most at 0.5 Hz under a hand at rest; `come`, one that begins to come at 60 mm/s.
/// @param sensor  as in `synthetic:`
TeleopScene teleop_scene(std::string_view name, std::string_view sensor, std::uint64_t seed);

/// What a run of a case comes to.
struct TeleopFigures {
  double force = 0.0;       ///< [N] median that the hand feels while it presses
  double most_force = 0.0;  ///< [N]
  double shake = 0.0;       ///< [m] rms above 20 Hz of the hand, at most, once it is engaged
  double energy = 0.0;      ///< [J] made in a contact, at most
  double depth = 0.0;       ///< [m] of the tool in the true surface, at most
  double contact = 0.0;     ///< [N] of the surface on the tool, at most
  double swing = 0.0;       ///< [m] rms of the tool's motion while the hand presses at rest
};
TeleopFigures play_teleop_case(const TeleopScene& scene, const TeleopCase& one);

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
