// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "palpate/kernel/core/observed_clouds.hpp"
#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/registry.hpp"
#include "palpate/kernel/core/tick.hpp"

namespace palpate {

/// A method of haptic rendering: frames and HIPs in, proxy and force out.
///
/// Values in, values out: no thread, clock or file, so the same calls give the same ticks, bit for
/// bit, on the same machine. Not thread-safe: one thread calls all functions.
///
/// Methods are switched by making another one, seating it where the proxy is and handing it
/// what each camera saw last: what the old one remembered ends with it.
class Method {
 public:
  virtual ~Method() = default;

  /// Puts the proxy at `proxy` [m, world] in free motion and forgets contact and velocity.
  /// Without it the first tick starts the proxy at its HIP. A place that is not finite is ignored.
  virtual void seat(const Vec3& proxy) noexcept = 0;

  /// Takes what a camera saw into use, once; what other cameras saw stays as it is.
  ///
  /// [servo] No allocation, lock, system call; see MethodInfo::bounded.
  /// @param seen  its stamp is on the clock of `tick`; its cloud lives as long as Observation says,
  ///              or as long as the method
  virtual void observe(const Observation& seen) noexcept = 0;

  /// Moves the proxy towards the HIP and renders the force.
  ///
  /// [servo] Bounded work; no allocation, lock, system call; see MethodInfo::bounded.
  /// @param hip  [m] world
  /// @param t    [s] now, on the clock of the frames' stamps
  virtual Tick tick(const Vec3& hip, double t) noexcept = 0;
  /// The same of a hand that is turned. For a ball this is all that there is to do; a method of
  /// tools with another shape overrides this.
  virtual Tick tick(const HandPose& hand, double t) noexcept {
    Tick tick = this->tick(hand.position, t);
    tick.orientation = tick.proxy_orientation = hand.orientation;
    return tick;
  }

  /// Changes parameters between two ticks; the proxy and its contact stay.
  ///
  /// [servo] No allocation, lock, system call; see MethodInfo::bounded.
  /// @param parameters  must validate()
  virtual void set_parameters(const Parameters& parameters) noexcept = 0;

  /// The patch that the last tick saw, for drawing and measuring; null if there is none.
  [[nodiscard]] virtual const Patch* patch() const noexcept { return nullptr; }

  /// Can the method touch such a cloud? Asked once, before a session begins.
  /// @throws Error if not, such as a method of meshes for points that nothing joins.
  virtual void check(const Cloud& /*cloud*/) const {}
};

/// A method that can be made by name.
struct MethodInfo {
  std::string name;     ///< such as "sight"
  std::string summary;  ///< what it is and where it is published, one line
  /// @throws Error if the parameters do not validate or the method cannot be made.
  std::function<std::unique_ptr<Method>(const Parameters&)> make;
  /// Does it keep the promises of [servo]? Those written to compare need not: they may allocate
  /// and take as long as they take.
  bool bounded = true;
};

using MethodRegistry = Registry<MethodInfo>;

}  // namespace palpate
