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

#include "lab/field/field_scene.hpp"
#include "lab/field/field_sensor.hpp"

namespace palpate::lab::field {

struct CaseSet;

/// One case: a class, a seed, and the values that are set by hand. Each other value is drawn from
/// the seed and its own name alone: setting one changes no other.
struct FieldCase {
  const CaseSet* set = nullptr;
  std::string_view name;  ///< of the class
  std::uint64_t seed = 0;
  std::string fixed{};  ///< KEY=VALUE&..., may be empty

  /// `SET:CLASS?seed=N&KEY=VALUE...`, which parse_field_case reads back to the same.
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

class Draw;
struct Setting;

/// A class: a geometry and what happens.
struct FieldClass {
  std::string_view name;
  std::string_view summary;
  /// Fills in the setting. @param start  [s] when the camera has shown the scene
  void (*make)(Draw&, Setting&, double start);
  /// [rad] of the camera off straight above, if `make` does not set it; 70 degrees
  double most_tilt = 1.22;
};

/// A camera, how far from the hand it is, and when it sees.
struct CameraPlan {
  SensorSetup setup;
  double distance = 0.0;  ///< [m]
  double rate = 0.0;      ///< [Hz]
  double latency = 0.0;   ///< [s]
  double dropped = 0.0;   ///< [-] share of the frames
  double jitter = 0.0;    ///< [s] deviation of stamps and arrivals
};

/// Classes that are drawn together, and their cameras.
struct CaseSet {
  std::string_view name;  ///< of the experiment, with which the text of a case begins
  std::uint64_t stream;   ///< other random numbers than those of any other set for the same seed
  std::span<const FieldClass> classes;
  int usual_cases;  ///< of each class, unless asked for otherwise
  CameraPlan (*camera)(Draw&);
};

/// Geometries and motions of all kinds: docs/field.md.
const CaseSet& field_set();
/// What comes, goes and moves around a hand that rests or works: docs/field.md.
const CaseSet& visits_set();

/// @throws Error for an unknown name, naming the nearest and listing all.
const FieldClass& find_field_class(std::string_view name, const CaseSet& set = field_set());

/// Case number `index` of a class: from seed, name and index alone.
FieldCase draw_field_case(const FieldClass& of, std::uint64_t seed, std::uint64_t index,
                          const CaseSet& set = field_set());

/// @throws Error for an unknown class, or what is no case of the set.
FieldCase parse_field_case(const std::string& text, const CaseSet& set = field_set());

/// @throws Error for a fixed value that the class does not draw, or that cannot be.
Stage make_stage(const FieldCase& c);

}  // namespace palpate::lab::field
