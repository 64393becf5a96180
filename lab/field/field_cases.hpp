// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "lab/field/field_hand.hpp"
#include "lab/field/field_scene.hpp"
#include "lab/field/field_sensor.hpp"

namespace palpate::lab::field {

/// One case: a class, a seed, and the values that are set by hand. Each other value is drawn from
/// the seed and its own name alone: setting one changes no other.
struct FieldCase {
  std::string_view name;  ///< of the class
  std::uint64_t seed = 0;
  std::string fixed{};  ///< KEY=VALUE&..., may be empty

  /// `field:CLASS?seed=N&KEY=VALUE...`, which parse_field_case reads back to the same.
  [[nodiscard]] std::string text() const;
};

/// One capture on its way: times [s].
struct Shot {
  double captured = 0.0;  ///< in truth
  double stamp = 0.0;     ///< as the camera says
  double arrives = 0.0;   ///< not before the shot before
};

/// A case made ready to play.
struct Stage {
  FieldScene scene;
  std::shared_ptr<Sensor> sensor;
  std::vector<Shot> shots;  ///< without what was dropped
  std::function<Vec3(double t)> hip;
  double duration = 0.0;  ///< [s]
  /// [m] narrowest thing that a method must make out, such as a rod; infinite: none is narrow
  double feature = std::numeric_limits<double>::infinity();
  double interval = 0.0;  ///< [s] from one capture to the next
  std::string values;     ///< all that was drawn, KEY=VALUE&...
};

/// A class: a geometry and what happens.
struct FieldClass {
  std::string_view name;
  std::string_view summary;
};
std::span<const FieldClass> field_classes();

/// @throws Error for an unknown name, naming the nearest and listing all.
const FieldClass& find_field_class(std::string_view name);

/// Case number `index` of a class: from seed, name and index alone.
FieldCase draw_field_case(const FieldClass& of, std::uint64_t seed, std::uint64_t index);

/// @throws Error for an unknown class, or what is no case.
FieldCase parse_field_case(const std::string& text);

/// @throws Error for a fixed value that the class does not draw, or that cannot be.
Stage make_stage(const FieldCase& c);

}  // namespace palpate::lab::field
