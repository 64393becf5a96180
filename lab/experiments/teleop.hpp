// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "lab/teleop_rig.hpp"

namespace palpate::lab {

/// The scenes of `teleop`: `rest`, a plane that is pressed three times; `bob`, one that moves by 60
/// mm/s at most at 0.5 Hz under a hand at rest; `come`, one that begins to come at 60 mm/s.
/// @param sensor  as in `synthetic:`
/// @throws Error for another name
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

}  // namespace palpate::lab
