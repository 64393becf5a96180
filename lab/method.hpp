// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/core/renderer.hpp"
#include "palpate/sources/scene.hpp"

namespace palpate::lab {

/// The true surface near a point at one time.
struct TruePoint {
  double distance;  ///< [m] from the surface to the asked point; negative inside
  Vec3 normal;      ///< [-] outward
};

/// What really is there: the surface nearest to a place [m, world] at a time [s].
using Truth = std::function<TruePoint(const Vec3& point, double t)>;

/// The truth of an analytic scene.
Truth truth_of(const std::shared_ptr<const Scene>& scene);

/// A method under test: what the lab knows of it. Frames and HIPs in, ticks out.
///
/// Of a tick, the experiments read `proxy`, `normal`, `force`, `state` (free or not) and `steps`.
/// A method without a proxy reports the point it pushes the hand towards, r_c above the surface.
class TouchMethod {
 public:
  virtual ~TouchMethod() = default;
  /// Puts the proxy at `proxy` [m, world] before the first tick.
  virtual void seat(const Vec3& proxy) = 0;
  /// A new frame, captured at `stamp` [s]; the cloud lives until the next call.
  virtual void frame(const Cloud& cloud, double stamp) = 0;
  /// One cycle, as Renderer::tick.
  virtual Tick tick(const Vec3& hip, double t) = 0;
};

/// What a method may be given to start with.
struct MethodSetup {
  Parameters parameters;  ///< its `method` is set by make_method where the kernel has it
  Truth truth;            ///< for `ideal`, the ruler; no honest method looks at it
};

/// A method that can be asked for by name.
struct MethodInfo {
  std::string_view name;
  std::string_view summary;  ///< what it is and where it is published, one line
  std::unique_ptr<TouchMethod> (*make)(const MethodSetup&);
};

/// All methods, in the order in which tables show them.
const std::vector<MethodInfo>& known_methods();

/// @throws Error for an unknown name, naming the nearest and listing all.
const MethodInfo& find_method(std::string_view name);

/// @throws Error as find_method, or if the method lacks something in the set-up.
std::unique_ptr<TouchMethod> make_method(std::string_view name, const MethodSetup& setup);

}  // namespace palpate::lab
