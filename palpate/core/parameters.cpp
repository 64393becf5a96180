// SPDX-License-Identifier: Apache-2.0
#include "palpate/core/parameters.hpp"

#include <array>
#include <numbers>
#include <string>

#include "palpate/core/error.hpp"

namespace palpate {
namespace {

constexpr double pi = std::numbers::pi;

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
    ParameterInfo{"r_1", "r_1", "m", 4.99e-3, 1e-4, 0.05,
                  "a point nearer than this entrenches the proxy", "4.1, Table 2",
                  [](const Parameters& p) { return p.proxy.r_1; },
                  [](Parameters& p, double v) { p.proxy.r_1 = v; }},
    ParameterInfo{"r_2", "r_2", "m", 5.01e-3, 1e-4, 0.05,
                  "a point nearer than this is in contact with the proxy", "4.1, Table 2",
                  [](const Parameters& p) { return p.proxy.r_2; },
                  [](Parameters& p, double v) { p.proxy.r_2 = v; }},
    ParameterInfo{"r_3", "r_3", "m", 10.0e-3, 1e-4, 0.05,
                  "points nearer than this shape the normal", "4.1, Table 2",
                  [](const Parameters& p) { return p.proxy.r_3; },
                  [](Parameters& p, double v) { p.proxy.r_3 = v; }},
    ParameterInfo{"theta", "θ", "rad", 0.1 * pi / 180.0, 1e-6, 0.5,
                  "angle between -u and n at which the proxy has converged", "(8), Table 2",
                  [](const Parameters& p) { return p.proxy.theta; },
                  [](Parameters& p, double v) { p.proxy.theta = v; }},
    ParameterInfo{"gamma", "γ", "-", 0.3, 0.01, 1.0,
                  "step scale in contact, closer than r_1 to the ideal position", "(11), Table 2",
                  [](const Parameters& p) { return p.proxy.gamma; },
                  [](Parameters& p, double v) { p.proxy.gamma = v; }},
    ParameterInfo{"xi", "ξ", "-", 0.1, 0.001, 0.99,
                  "step scale in contact, farther than r_1 from the ideal position",
                  "(12), Table 2", [](const Parameters& p) { return p.proxy.xi; },
                  [](Parameters& p, double v) { p.proxy.xi = v; }},
    ParameterInfo{"step_budget", "", "steps/tick", 64, 1, 10000,
                  "largest number of proxy steps in a tick; the rest follows in the next tick",
                  "4.6", [](const Parameters& p) { return double{1} * p.proxy.step_budget; },
                  [](Parameters& p, double v) { p.proxy.step_budget = static_cast<int>(v); }},
    ParameterInfo{"stiffness", "k_s", "N/m", 600.0, 0.0, 1e5, "spring of the virtual coupling",
                  "(16), Table 2", [](const Parameters& p) { return p.coupling.stiffness; },
                  [](Parameters& p, double v) { p.coupling.stiffness = v; }},
    ParameterInfo{"damping", "k_d", "N s/m", 0.0, 0.0, 1e3, "damper of the virtual coupling",
                  "(16), Table 2", [](const Parameters& p) { return p.coupling.damping; },
                  [](Parameters& p, double v) { p.coupling.damping = v; }},
    ParameterInfo{"max_force", "", "N", 20.0, 0.0, 1e3,
                  "limit of the rendered force; the device's and the user's may be lower", "ours",
                  [](const Parameters& p) { return p.coupling.max_force; },
                  [](Parameters& p, double v) { p.coupling.max_force = v; }},
    ParameterInfo{"frame_rate", "f_c", "Hz", 30.0, 0.1, 1000.0,
                  "frame rate assumed until there are two timestamps", "(3), (13)",
                  [](const Parameters& p) { return p.motion.frame_rate; },
                  [](Parameters& p, double v) { p.motion.frame_rate = v; }},
    ParameterInfo{"max_extrapolation", "", "s", 0.1, 0.0, 10.0,
                  "longest extrapolation of a surface velocity", "ours",
                  [](const Parameters& p) { return p.motion.max_extrapolation; },
                  [](Parameters& p, double v) { p.motion.max_extrapolation = v; }},
    ParameterInfo{"hidden_hold", "", "s", 0.4, 0.0, 10.0,
                  "the force of an occluded surface is kept in full for this long", "ours (sight)",
                  [](const Parameters& p) { return p.sight.hidden_hold; },
                  [](Parameters& p, double v) { p.sight.hidden_hold = v; }},
    ParameterInfo{"hidden_fade", "", "s", 0.3, 0.01, 10.0,
                  "time over which the force of an occluded surface then fades out", "ours (sight)",
                  [](const Parameters& p) { return p.sight.hidden_fade; },
                  [](Parameters& p, double v) { p.sight.hidden_fade = v; }},
    ParameterInfo{
        "hardest_strike", "", "m/s^2", 90.0, 1.0, 1e4,
        "largest acceleration of a touched surface; a jump that needs more is an occluder",
        "ours (sight)", [](const Parameters& p) { return p.sight.hardest_strike; },
        [](Parameters& p, double v) { p.sight.hardest_strike = v; }},
    ParameterInfo{"return_speed", "", "m/s", 0.01, 1e-3, 10.0,
                  "speed at which a surface returns to a HIP inside it, after it was occluded, "
                  "lost or too old; a released handle is pushed out at twice that at most",
                  "ours (sight)", [](const Parameters& p) { return p.sight.return_speed; },
                  [](Parameters& p, double v) { p.sight.return_speed = v; }},
    ParameterInfo{"side_depth", "", "m", 0.1, 0.0, 1.0,
                  "depth of the side faces synthesised behind visible edges; 0: none",
                  "ours (sight)", [](const Parameters& p) { return p.sight.side_depth; },
                  [](Parameters& p, double v) { p.sight.side_depth = v; }},
    ParameterInfo{"usual_noise", "", "m", 0.0, 0.0, 0.1,
                  "depth noise (standard deviation) at 1 m until it has been measured; 0: default "
                  "of the sensor type. Smaller: motion is detected earlier, but noise is more "
                  "often mistaken for motion",
                  "ours (sight)", [](const Parameters& p) { return p.sight.usual_noise; },
                  [](Parameters& p, double v) { p.sight.usual_noise = v; }},
    ParameterInfo{"noise_growth", "", "-", 0, 0, 2,
                  "power of the distance with which usual_noise grows: 2 for triangulation, 1 for "
                  "time of flight; 0: default of the sensor type",
                  "ours (sight)",
                  [](const Parameters& p) { return double{1} * p.sight.noise_growth; },
                  [](Parameters& p, double v) { p.sight.noise_growth = static_cast<int>(v); }},
    ParameterInfo{
        "confidence", "", "-", 3.0, 1.0, 10.0,
        "standard deviations that noise explains; less finds a change sooner, more averages more",
        "ours (sight)", [](const Parameters& p) { return p.sight.confidence; },
        [](Parameters& p, double v) { p.sight.confidence = v; }},
    ParameterInfo{"least_share", "", "-", 0.3, 0.05, 0.9,
                  "minimum fraction of the points in the viewing cone that makes a surface. "
                  "Smaller: finer objects are felt, but also outliers",
                  "ours (sight)", [](const Parameters& p) { return p.sight.least_share; },
                  [](Parameters& p, double v) { p.sight.least_share = v; }},
    ParameterInfo{"widest_disc", "", "m", 85e-3, 11e-3, 85e-3,
                  "maximum radius of the fitted area. Smaller: more noise, but small objects are "
                  "correct earlier",
                  "ours (sight)", [](const Parameters& p) { return p.sight.widest_disc; },
                  [](Parameters& p, double v) { p.sight.widest_disc = v; }},
    ParameterInfo{"averaged_frames", "", "frames", 64, 1, 64,
                  "frames that a fit is averaged over at most; fewer are noisier", "ours (sight)",
                  [](const Parameters& p) { return double{1} * p.sight.averaged_frames; },
                  [](Parameters& p, double v) { p.sight.averaged_frames = static_cast<int>(v); }},
    ParameterInfo{"rest_odds", "", "-", 4.0, 0.0, 20.0,
                  "logarithm of the odds of rest against a motion; more is quieter at rest, and "
                  "later at an onset",
                  "ours (sight)", [](const Parameters& p) { return p.sight.rest_odds; },
                  [](Parameters& p, double v) { p.sight.rest_odds = v; }},
    ParameterInfo{"motion_memory", "", "-", 0.85, 0.3, 0.99,
                  "forgetting factor of the motion estimate, per frame. Larger: smoother motion, "
                  "but a change of direction is followed later",
                  "ours (sight)", [](const Parameters& p) { return p.sight.motion_memory; },
                  [](Parameters& p, double v) { p.sight.motion_memory = v; }},
    ParameterInfo{"curvature_sd", "", "1/m", 15.0, 1.0, 1e6,
                  "spread of curvatures that is expected; less invents fewer from noise, and "
                  "flattens small bodies",
                  "ours (sight)", [](const Parameters& p) { return p.sight.curvature_sd; },
                  [](Parameters& p, double v) { p.sight.curvature_sd = v; }},
    ParameterInfo{"blend", "", "intervals", 0.85, 0.01, 1.0,
                  "fraction of the frame interval over which the force follows a correction. "
                  "Smaller: more accurate in motion; larger: smoother",
                  "ours (sight)", [](const Parameters& p) { return p.sight.blend; },
                  [](Parameters& p, double v) { p.sight.blend = v; }},
    ParameterInfo{
        "evidence_frames", "", "frames", 2, 1, 10,
        "consecutive frames that must show a proxy behind the surface before it is moved back to "
        "the front. Fewer: earlier correction, but more false corrections from noise",
        "ours (sight)", [](const Parameters& p) { return double{1} * p.sight.evidence_frames; },
        [](Parameters& p, double v) { p.sight.evidence_frames = static_cast<int>(v); }},
    ParameterInfo{"friction", "μ_s", "-", 0.0, 0.0, 2.0,
                  "static coefficient of friction of every surface; 0: none", "ours (feel)",
                  [](const Parameters& p) { return p.friction.friction; },
                  [](Parameters& p, double v) { p.friction.friction = v; }},
    ParameterInfo{"kinetic_share", "", "-", 0.8, 0.1, 1.0,
                  "ratio of kinetic to static friction. Smaller: more stick-slip", "ours (feel)",
                  [](const Parameters& p) { return p.friction.kinetic_share; },
                  [](Parameters& p, double v) { p.friction.kinetic_share = v; }},
    ParameterInfo{"viscosity", "", "s/m", 0.0, 0.0, 5.0,
                  "increase of the friction coefficient with the sliding speed, as in honey",
                  "ours (feel)", [](const Parameters& p) { return p.friction.viscosity; },
                  [](Parameters& p, double v) { p.friction.viscosity = v; }},
    ParameterInfo{"stribeck_speed", "v_s", "m/s", 0.02, 1e-3, 1.0,
                  "sliding speed at which friction changes from static to kinetic", "ours (feel)",
                  [](const Parameters& p) { return p.friction.stribeck_speed; },
                  [](Parameters& p, double v) { p.friction.stribeck_speed = v; }},
    ParameterInfo{"bristle_stiffness", "σ_0", "N/m", 600.0, 10.0, 1e5,
                  "stiffness of the static friction. Larger: harder sticking; the device must be "
                  "able to render it",
                  "ours (feel)", [](const Parameters& p) { return p.friction.bristle_stiffness; },
                  [](Parameters& p, double v) { p.friction.bristle_stiffness = v; }},
    ParameterInfo{"bristle_damping", "σ_1", "N s/m", 1.0, 0.0, 1e3,
                  "damper of that spring; more rings less, and shows the noise of the device's "
                  "positions",
                  "ours (feel)", [](const Parameters& p) { return p.friction.bristle_damping; },
                  [](Parameters& p, double v) { p.friction.bristle_damping = v; }},
    ParameterInfo{
        "cushion", "λ", "s/m", 0.0, 0.0, 5.0,
        "relative increase of the force for each m/s of inward speed. Larger: less bouncing",
        "Hunt and Crossley 1975", [](const Parameters& p) { return p.contact.cushion; },
        [](Parameters& p, double v) { p.contact.cushion = v; }},
    ParameterInfo{"tap", "A", "N s/m", 0.0, 0.0, 50.0,
                  "force of an impact's ringing for each m/s of its speed, up to 1 N; 0: none",
                  "Okamura et al. 2001", [](const Parameters& p) { return p.tap.tap; },
                  [](Parameters& p, double v) { p.tap.tap = v; }},
    ParameterInfo{"tap_frequency", "f", "Hz", 100.0, 5.0, 400.0, "of an impact's ringing",
                  "Okamura et al. 2001", [](const Parameters& p) { return p.tap.tap_frequency; },
                  [](Parameters& p, double v) { p.tap.tap_frequency = v; }},
    ParameterInfo{"tap_decay", "B", "1/s", 80.0, 50.0, 1000.0, "decay rate of the impact vibration",
                  "Okamura et al. 2001", [](const Parameters& p) { return p.tap.tap_decay; },
                  [](Parameters& p, double v) { p.tap.tap_decay = v; }},
    ParameterInfo{"grain", "", "-", 0.0, 0.0, 0.3,
                  "vibration while stroking, rms, as a share of the normal force; 0: none",
                  "ours (feel)", [](const Parameters& p) { return p.texture.grain; },
                  [](Parameters& p, double v) { p.texture.grain = v; }},
    ParameterInfo{"grain_length", "", "m", 1e-3, 1e-4, 0.02,
                  "of the grains: the vibration's frequency is the speed over it", "ours (feel)",
                  [](const Parameters& p) { return p.texture.grain_length; },
                  [](Parameters& p, double v) { p.texture.grain_length = v; }},
    ParameterInfo{"relief", "", "m", 0.0, -5e-3, 5e-3,
                  "height of white above black in the camera image; 0: flat", "ours (feel)",
                  [](const Parameters& p) { return p.texture.relief; },
                  [](Parameters& p, double v) { p.texture.relief = v; }},
};

constexpr std::string_view noun = "parameter";

}  // namespace

std::span<const ParameterInfo> parameter_table() {
  return table;
}

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
