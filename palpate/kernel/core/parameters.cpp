// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/core/parameters.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <string>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {

std::string number_text(double value, int digits) {
  std::array<char, 32> text{};
  const auto format = std::chars_format::general;
  return {text.data(), std::to_chars(text.begin(), text.end(), value, format, digits).ptr};
}

std::string fixed_text(double value, int decimals) {
  std::array<char, 320> text{};
  const auto format = std::chars_format::fixed;
  return {text.data(), std::to_chars(text.begin(), text.end(), value, format, decimals).ptr};
}

void check_range(std::string_view noun, std::string_view name, std::string_view unit, double min,
                 double max, double value, bool whole) {
  if (std::isfinite(value) && value >= min && value <= max &&
      (!whole || std::floor(value) == value))
    return;
  const std::string shown = unit == "-" ? "" : " " + std::string(unit);
  throw Error(std::string(noun) + (name.empty() ? "" : " '" + std::string(name) + "'"),
              number_text(value) + shown + " is out of range",
              std::string("give a ") + (whole ? "whole number" : "value") + " from " +
                  number_text(min) + " to " + number_text(max) + shown);
}

void refuse_name(std::string_view noun, std::string_view name,
                 std::span<const std::string_view> known) {
  const std::string_view near = nearest_name(name, known);
  throw Error(std::string(noun) + " '" + std::string(name) + "'",
              "there is no such " + std::string(noun),
              near.empty() ? "see 'palpate parameters' for their names"
                           : "did you mean '" + std::string(near) + "'?");
}
namespace {

using P = Parameters;
using Proxy = ProxyParameters;
using Motion = MotionParameters;
using Sight = SightParameters;
using Friction = FrictionParameters;
using Texture = TextureParameters;

void scale_radii(Parameters& p, double r_c) {
  const double factor = r_c / p.proxy.r_c();
  p.proxy.r_1 *= factor;
  p.proxy.r_2 *= factor;
  p.proxy.r_3 *= factor;
}

constexpr std::array table = {
    ParameterInfo{"r_c", "r_c", "m", 5.0e-3, 1e-4, 0.05,
                  "contact radius; setting it scales r_1, r_2 and r_3 together", "4.1, Table 2",
                  [](const Parameters& p) { return p.proxy.r_c(); }, scale_radii},
    row_of<&P::proxy, &Proxy::r_1>("r_1", "r_1", "m", 1e-4, 0.05,
                                   "a point nearer than this entrenches the proxy", "4.1, Table 2"),
    row_of<&P::proxy, &Proxy::r_2>("r_2", "r_2", "m", 1e-4, 0.05,
                                   "a point nearer than this is in contact with the proxy",
                                   "4.1, Table 2"),
    row_of<&P::proxy, &Proxy::r_3>("r_3", "r_3", "m", 1e-4, 0.05,
                                   "points nearer than this shape the normal", "4.1, Table 2"),
    row_of<&P::proxy, &Proxy::theta>("theta", "θ", "rad", 1e-6, 0.5,
                                     "angle between -u and n at which the proxy has converged",
                                     "(8), Table 2"),
    row_of<&P::proxy, &Proxy::gamma>("gamma", "γ", "-", 0.01, 1.0,
                                     "step scale in contact, closer than r_1 to the ideal position",
                                     "(11), Table 2"),
    row_of<&P::proxy, &Proxy::xi>("xi", "ξ", "-", 0.001, 0.99,
                                  "step scale in contact, farther than r_1 from the ideal position",
                                  "(12), Table 2"),
    row_of<&P::proxy, &Proxy::step_budget>(
        "step_budget", "", "steps/tick", 1, 10000,
        "largest number of proxy steps in a tick; the rest follows in the next tick", "4.6"),
    row_of<&P::coupling, &Coupling::stiffness>("stiffness", "k_s", "N/m", 0.0, 1e5,
                                               "spring of the virtual coupling", "(16), Table 2"),
    row_of<&P::coupling, &Coupling::damping>("damping", "k_d", "N s/m", 0.0, 1e3,
                                             "damper of the virtual coupling", "(16), Table 2"),
    row_of<&P::coupling, &Coupling::max_force>(
        "max_force", "", "N", 0.0, 1e3,
        "limit of the rendered force; the device's and the user's may be lower", "ours"),
    row_of<&P::coupling, &Coupling::turn_stiffness>(
        "turn_stiffness", "", "N m/rad", 0.0, 1e3,
        "largest stiffness of a tool with a shape in rotation; 0: full torque at 0.4 rad, if the "
        "device has motors for a torque, else no limit",
        "ours (tools)"),
    row_of<&P::motion, &Motion::frame_rate>("frame_rate", "f_c", "Hz", 0.1, 1000.0,
                                            "frame rate assumed until there are two timestamps",
                                            "(3), (13)"),
    row_of<&P::motion, &Motion::max_extrapolation>("max_extrapolation", "", "s", 0.0, 10.0,
                                                   "longest extrapolation of a surface velocity",
                                                   "ours"),
    row_of<&P::sight, &Sight::hidden_hold>(
        "hidden_hold", "", "s", 0.0, 10.0,
        "the force of an occluded surface is kept in full for this long", "ours (sight)"),
    row_of<&P::sight, &Sight::hidden_fade>(
        "hidden_fade", "", "s", 0.01, 10.0,
        "time over which the force of an occluded surface then fades out", "ours (sight)"),
    row_of<&P::sight, &Sight::oldest_frame>(
        "oldest_frame", "", "s", 0.01, 10.0,
        "a frame that is older when it arrives is history, not a surface to touch; frames half as "
        "far apart tell no motion",
        "ours (sight)"),
    row_of<&P::sight, &Sight::hardest_strike>(
        "hardest_strike", "", "m/s^2", 1.0, 1e4,
        "largest acceleration of a touched surface; a jump that needs more is an occluder",
        "ours (sight)"),
    row_of<&P::sight, &Sight::return_speed>(
        "return_speed", "", "m/s", 1e-3, 10.0,
        "speed at which a surface returns to a HIP inside it, after it was occluded, "
        "lost or too old; a released handle is pushed out at twice that at most",
        "ours (sight)"),
    row_of<&P::sight, &Sight::side_depth>(
        "side_depth", "", "m", 0.0, 1.0,
        "depth of the side faces synthesised behind visible edges; 0: none", "ours (sight)"),
    row_of<&P::sight, &Sight::usual_noise>(
        "usual_noise", "", "m", 0.0, 0.1,
        "depth noise (standard deviation) at 1 m until it has been measured; 0: default "
        "of the sensor type. Smaller: motion is detected earlier, but noise is more "
        "often mistaken for motion",
        "ours (sight)"),
    row_of<&P::sight, &Sight::noise_growth>(
        "noise_growth", "", "-", 0, 2,
        "power of the distance with which usual_noise grows: 2 for triangulation, 1 for "
        "time of flight; 0: default of the sensor type",
        "ours (sight)"),
    row_of<&P::sight, &Sight::confidence>(
        "confidence", "", "-", 1.0, 10.0,
        "standard deviations that noise explains; less finds a change sooner, more averages more",
        "ours (sight)"),
    row_of<&P::sight, &Sight::least_share>(
        "least_share", "", "-", 0.05, 0.9,
        "minimum fraction of the points in the viewing cone that makes a surface. "
        "Smaller: finer objects are felt, but also outliers",
        "ours (sight)"),
    row_of<&P::sight, &Sight::detail>(
        "detail", "", "m", 1e-4, 0.1,
        "the smallest thing that is told apart; all lengths of the tracker are multiples of it. "
        "For scenes that are much smaller or larger than what hands touch",
        "ours (sight)"),
    row_of<&P::sight, &Sight::widest_fit>("widest_fit", "", "-", 2.2, 17.0,
                                          "maximum radius of the fitted area, in multiples of "
                                          "detail. Smaller: more noise, but small objects are "
                                          "correct earlier",
                                          "ours (sight)"),
    row_of<&P::sight, &Sight::averaged_frames>(
        "averaged_frames", "", "frames", 1, 64,
        "frames that a fit is averaged over at most; fewer are noisier", "ours (sight)"),
    row_of<&P::sight, &Sight::rest_odds>(
        "rest_odds", "", "-", 0.0, 20.0,
        "logarithm of the odds of rest against a motion; more is quieter at rest, and "
        "later at an onset",
        "ours (sight)"),
    row_of<&P::sight, &Sight::motion_memory>(
        "motion_memory", "", "-", 0.3, 0.99,
        "forgetting factor of the motion estimate, per frame. Larger: smoother motion, "
        "but a change of direction is followed later",
        "ours (sight)"),
    row_of<&P::sight, &Sight::curvature_sd>(
        "curvature_sd", "", "1/m", 1.0, 1e6,
        "spread of curvatures that is expected; less invents fewer from noise, and "
        "flattens small bodies",
        "ours (sight)"),
    row_of<&P::sight, &Sight::blend>(
        "blend", "", "intervals", 0.01, 1.0,
        "fraction of the frame interval over which the force follows a correction. "
        "Smaller: more accurate in motion; larger: smoother",
        "ours (sight)"),
    row_of<&P::sight, &Sight::evidence_frames>(
        "evidence_frames", "", "frames", 1, 10,
        "consecutive frames that must show a proxy behind the surface before it is moved back to "
        "the front. Fewer: earlier correction, but more false corrections from noise",
        "ours (sight)"),
    row_of<&P::friction, &Friction::friction>(
        "friction", "μ_s", "-", 0.0, 2.0,
        "static coefficient of friction of every surface; 0: none", "ours (feel)"),
    row_of<&P::friction, &Friction::kinetic_share>(
        "kinetic_share", "", "-", 0.1, 1.0,
        "ratio of kinetic to static friction. Smaller: more stick-slip", "ours (feel)"),
    row_of<&P::friction, &Friction::viscosity>(
        "viscosity", "", "s/m", 0.0, 5.0,
        "increase of the friction coefficient with the sliding speed, as in honey", "ours (feel)"),
    row_of<&P::friction, &Friction::stribeck_speed>(
        "stribeck_speed", "v_s", "m/s", 1e-3, 1.0,
        "sliding speed at which friction changes from static to kinetic", "ours (feel)"),
    row_of<&P::friction, &Friction::bristle_stiffness>(
        "bristle_stiffness", "σ_0", "N/m", 10.0, 1e5,
        "stiffness of the static friction. Larger: harder sticking; the device must be "
        "able to render it",
        "ours (feel)"),
    row_of<&P::friction, &Friction::bristle_damping>(
        "bristle_damping", "σ_1", "N s/m", 0.0, 1e3,
        "damper of that spring; more rings less, and shows the noise of the device's "
        "positions",
        "ours (feel)"),
    row_of<&P::contact, &ContactParameters::cushion>(
        "cushion", "λ", "s/m", 0.0, 5.0,
        "relative increase of the force for each m/s of inward speed. Larger: less bouncing",
        "Hunt and Crossley 1975"),
    row_of<&P::tap, &TapParameters::tap>(
        "tap", "A", "N s/m", 0.0, 50.0,
        "force of an impact's ringing for each m/s of its speed, up to 1 N; 0: none",
        "Okamura et al. 2001"),
    row_of<&P::tap, &TapParameters::tap_frequency>("tap_frequency", "f", "Hz", 5.0, 400.0,
                                                   "of an impact's ringing", "Okamura et al. 2001"),
    row_of<&P::tap, &TapParameters::tap_decay>("tap_decay", "B", "1/s", 50.0, 1000.0,
                                               "decay rate of the impact vibration",
                                               "Okamura et al. 2001"),
    row_of<&P::texture, &Texture::grain>(
        "grain", "", "-", 0.0, 0.3,
        "vibration while stroking, rms, as a share of the normal force; 0: none", "ours (feel)"),
    row_of<&P::texture, &Texture::grain_length>(
        "grain_length", "", "m", 1e-4, 0.02,
        "of the grains: the vibration's frequency is the speed over it", "ours (feel)"),
    row_of<&P::texture, &Texture::relief>(
        "relief", "", "m", -5e-3, 5e-3, "height of white above black in the camera image; 0: flat",
        "ours (feel)"),
};

constexpr std::string_view noun = "parameter";

}  // namespace

std::span<const ParameterInfo> parameter_table() { return table; }

void set_parameter(Parameters& parameters, std::string_view name, double value) {
  set_by_name(parameter_table(), parameters, name, value, noun);
}

void validate(const Parameters& parameters) {
  check_ranges(parameter_table(), parameters, noun);
  const ProxyParameters& proxy = parameters.proxy;
  if (!(proxy.r_1 < proxy.r_2 && proxy.r_2 < proxy.r_3)) {
    throw Error("parameters r_1, r_2, r_3",
                "the radii " + number_text(proxy.r_1) + ", " + number_text(proxy.r_2) + " and " +
                    number_text(proxy.r_3) + " m do not increase",
                "give r_1 < r_2 < r_3, or set r_c to scale all three");
  }
}

}  // namespace palpate
