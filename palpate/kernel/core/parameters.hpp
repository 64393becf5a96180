// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "palpate/kernel/core/pose.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {

/// One row of a table of numbers that can be set: it feeds help texts, configuration files and the
/// page's sliders. `Owner` is the struct that holds them.
template <class Owner>
struct ParameterRow {
  std::string_view name;
  std::string_view symbol;  ///< as in the paper, empty where it has none
  std::string_view unit;    ///< "-" where it has none
  double default_value;
  double min;  ///< smallest value allowed
  double max;  ///< largest value allowed
  std::string_view meaning;
  std::string_view source;  ///< where it is published; "ours"
  double (*get)(const Owner&);
  void (*set)(Owner&, double);
};

/// The owner of the member that a pointer names.
template <class Owner, class Member>
Owner owner_of(Member Owner::*);

/// The row of the member at the end of `path`, pointers to members of one another. Its default is
/// what the member begins with.
template <auto first, auto... path>
constexpr auto row_of(std::string_view name, std::string_view symbol, std::string_view unit,
                      double min, double max, std::string_view meaning,
                      std::string_view source = "ours") {
  using Owner = decltype(owner_of(first));
  constexpr auto get = [](const Owner& owner) {
    return static_cast<double>(((owner.*first).*....*path));
  };
  constexpr auto set = [](Owner& owner, double value) {
    auto& member = ((owner.*first).*....*path);
    member = static_cast<std::remove_reference_t<decltype(member)>>(value);
  };
  return ParameterRow<Owner>{name, symbol, unit, get(Owner{}), min, max, meaning, source, get, set};
}

/// A number as messages show it, to so many digits.
std::string number_text(double value, int digits = 6);
/// The same, to so many decimals: "0.50".
std::string fixed_text(double value, int decimals);

/// @param noun   what a row is, such as "parameter"
/// @param name   empty: the noun says it
/// @param whole  only whole numbers are allowed
/// @throws Error if the value is not finite or not in [min, max].
void check_range(std::string_view noun, std::string_view name, std::string_view unit, double min,
                 double max, double value, bool whole = false);
/// @throws Error naming the nearest of the known names.
[[noreturn]] void refuse_name(std::string_view noun, std::string_view name,
                              std::span<const std::string_view> known);

/// @throws Error naming the first number that is out of its range.
template <class Owner>
void check_ranges(std::span<const ParameterRow<Owner>> table, const Owner& owner,
                  std::string_view noun) {
  for (const auto& row : table)
    check_range(noun, row.name, row.unit, row.min, row.max, row.get(owner));
}

/// The row of that name. @throws Error if there is none.
template <class Owner>
const ParameterRow<Owner>& row_by_name(std::span<const ParameterRow<Owner>> table,
                                       std::string_view name, std::string_view noun) {
  for (const auto& row : table) {
    if (row.name == name) return row;
  }
  refuse_name(noun, name, names_of(table));
}

/// Sets one number by name. @throws Error for an unknown name or a value out of its range.
template <class Owner>
void set_by_name(std::span<const ParameterRow<Owner>> table, Owner& owner, std::string_view name,
                 double value, std::string_view noun) {
  const ParameterRow<Owner>& row = row_by_name(table, name, noun);
  check_range(noun, row.name, row.unit, row.min, row.max, value);
  row.set(owner, value);
}

/// A key of a session: what its file, the command line and the page say of one value. A struct with
/// keys has a function `walk_keys(self, way)`, which calls way(key, member) for each of them, in
/// the order in which they are printed.
struct Key {
  std::string_view name;    ///< in a file
  std::string_view option;  ///< of the command line; empty: none
  std::string_view meaning;
  std::string_view unit = "-";  ///< of a number; "-" where it has none
  double min = 0.0;             ///< smallest number allowed
  double max = 0.0;             ///< largest number allowed
};

/// The key of a number.
constexpr Key key_of(std::string_view name, std::string_view option, std::string_view unit,
                     double min, double max, std::string_view meaning) {
  return {name, option, meaning, unit, min, max};
}

/// "Hz, 100 to 100000" of the key or row of a number.
template <class Row>
std::string range_text(const Row& row) {
  const std::string unit = row.unit == "-" ? "" : std::string(row.unit) + ", ";
  return unit + number_text(row.min) + " to " + number_text(row.max);
}

/// @param noun, name  what messages call the key
/// @throws Error if a number is out of its range or a pose is not rigid.
template <class Value>
void check(const Key& key, const Value& value, std::string_view noun, std::string_view name) {
  if constexpr (std::is_same_v<Value, double> || std::is_same_v<Value, int>) {
    check_range(noun, name, key.unit, key.min, key.max, value, std::is_same_v<Value, int>);
  } else if constexpr (std::is_same_v<Value, Eigen::Isometry3d>) {
    check_rigid(value, std::string(name));
  } else if constexpr (requires { value.has_value(); }) {
    if (value) check(key, *value, noun, name);
  }
}

/// The same for all keys of `owner`.
template <class Owner>
void check_keys(const Owner& owner) {
  Owner::walk_keys(
      owner, [](const Key& key, const auto& value) { check(key, value, "setting", key.name); });
}

/// The proxy's regions and the constants of its movement. Section 4.1, 4.3, 4.4; Table 2.
struct ProxyParameters {
  double r_1 = 4.99e-3;  ///< [m] a point nearer than this entrenches the proxy
  double r_2 = 5.01e-3;  ///< [m] a point nearer than this is in contact
  double r_3 = 10.0e-3;  ///< [m] points nearer than this shape the normal
  double theta = 0.1 * 3.14159265358979323846 / 180.0;  ///< [rad] convergence angle of (8)
  double gamma = 0.3;    ///< [-] step scale of (11), closer than r_1 to the ideal position
  double xi = 0.1;       ///< [-] step scale of (12), farther than r_1 from it
  int step_budget = 64;  ///< [steps/tick] bound on the work of a tick

  /// Contact radius r_c = (r_1 + r_2) / 2 [m]. Section 4.1.
  [[nodiscard]] double r_c() const { return 0.5 * (r_1 + r_2); }
};

/// The virtual coupling between HIP and proxy. Section 4.6.
struct Coupling {
  double stiffness = 600.0;  ///< [N/m] k_s of (16)
  double damping = 0.0;      ///< [N s/m] k_d of (16)
  double max_force = 20.0;   ///< [N] a force is never longer; a device's own limit may be lower
  /// [N m/rad] of a tool with a shape, at most. 0: a session sets what its device's motors for a
  /// torque bear; without such motors there is no limit.
  double turn_stiffness = 0.0;
};

/// What is assumed about time between frames. Section 4.5.
struct MotionParameters {
  double frame_rate = 30.0;        ///< [Hz] f_c: used as printed, and before two stamps are known
  double max_extrapolation = 0.1;  ///< [s] longest time over which a velocity is trusted
};

/// What sightline tracking assumes. docs/sight.md.
struct SightParameters {
  double hidden_hold = 0.4;      ///< [s] the force of an occluded surface is kept in full this long
  double hidden_fade = 0.3;      ///< [s] and then fades out over this
  double oldest_frame = 0.5;     ///< [s] a frame that is older when it arrives is not touched
  double hardest_strike = 90.0;  ///< [m/s^2] a faster jump is treated as an occluder
  double return_speed = 0.01;    ///< [m/s] at which a surface returns after it was occluded or lost
  double side_depth = 0.1;       ///< [m] depth of the side faces synthesised behind visible edges

  // Parameters of the surface estimator; docs/sight.md, 4 and 11, describes their trade-offs. The
  // next two describe the depth noise until it has been measured. 0: for_sensors sets the value of
  // the sensor type; without it, unknown_noise and unknown_growth are used.
  double usual_noise = 0.0;     ///< [m] standard deviation at 1 m
  int noise_growth = 0;         ///< [-] power of the distance with which it grows: 1 or 2
  double confidence = 3.0;      ///< [-] standard deviations that noise explains
  double least_share = 0.3;     ///< [-] of the points in the viewing cone: fewer are no surface
  double detail = 5e-3;         ///< [m] unit of the tracker's lengths, whatever the proxy's radius
  double widest_fit = 17.0;     ///< [detail] radius that a fit is averaged over at most
  int averaged_frames = 64;     ///< that a fit is averaged over at most
  double rest_odds = 4.0;       ///< [-] logarithm, of rest against any motion, before a measurement
  double motion_memory = 0.85;  ///< [-] forgetting factor of the motion estimate, per frame
  double curvature_sd = 15.0;   ///< [1/m] spread of curvatures that is expected
  double blend = 0.85;          ///< [intervals] over which the force follows a frame's correction
  int evidence_frames = 2;      ///< in a row that show a proxy behind its surface

  static constexpr double unknown_noise = 5e-3;  ///< [m] at 1 m
  static constexpr int unknown_growth = 2;
  /// [m] Standard deviation of the depth `distance` [m] away from the camera.
  [[nodiscard]] double usual_noise_at(double distance) const noexcept {
    const int growth = noise_growth > 0 ? noise_growth : unknown_growth;
    return (usual_noise > 0.0 ? usual_noise : unknown_noise) *
           (growth == 1 ? distance : distance * distance);
  }
};

/// Friction along the surface, around any method. docs/friction.md.
struct FrictionParameters {
  double friction = 0.0;         ///< [-] static coefficient; 0: none
  double kinetic_share = 0.8;    ///< [-] of it that is left in fast sliding
  double viscosity = 0.0;        ///< [s/m] by which the coefficient grows with the sliding speed
  double stribeck_speed = 0.02;  ///< [m/s] at which most of that has gone
  double bristle_stiffness = 600.0;  ///< [N/m] of what holds a hand where it sticks
  double bristle_damping = 1.0;      ///< [N s/m] of the same
};

/// How a surface gives way, beside the coupling's spring. docs/materials.md.
struct ContactParameters {
  /// [s/m] Hunt and Crossley's damping: the share by which the force grows for each m/s at which
  /// the hand presses in, and shrinks at which it comes out.
  double cushion = 0.0;
};

/// What an impact feels like: tap * speed * exp(-tap_decay t) cos(2 pi tap_frequency t).
/// docs/materials.md.
struct TapParameters {
  double tap = 0.0;              ///< [N s/m] force for each m/s of the impact; 0: none
  double tap_frequency = 100.0;  ///< [Hz]
  double tap_decay = 80.0;       ///< [1/s]
};

/// What stroking a surface feels like. docs/materials.md.
struct TextureParameters {
  double grain = 0.0;          ///< [-] vibration, rms, as a share of the normal force; 0: none
  double grain_length = 1e-3;  ///< [m] of the grains: speed over frequency
  double relief = 0.0;         ///< [m] height of white above black; 0: brightness is not felt
};

/// Everything that can be set on a method. Defaults are the paper's Table 2 where it has them.
struct Parameters {
  ProxyParameters proxy;
  Coupling coupling;
  MotionParameters motion;
  SightParameters sight;
  FrictionParameters friction;
  ContactParameters contact;
  TapParameters tap;
  TextureParameters texture;
};

using ParameterInfo = ParameterRow<Parameters>;

/// All numeric parameters, in the order in which they are shown.
/// The row `r_c` is derived: setting it scales r_1, r_2 and r_3 together (section 5).
std::span<const ParameterInfo> parameter_table();

/// Sets one parameter by name.
/// @throws Error for an unknown name (naming the nearest known one) or a value out of its range.
void set_parameter(Parameters& parameters, std::string_view name, double value);

/// Checks every range and that 0 < r_1 < r_2 < r_3.
/// @throws Error naming the first parameter that does not hold.
void validate(const Parameters& parameters);

}  // namespace palpate
