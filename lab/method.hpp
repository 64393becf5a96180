// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/method.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
class Scene;
}

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

/// The truth of a level plane. @param height  [m] at a time [s]; none: it is at 0
inline Truth flat_truth(std::function<double(double t)> height = nullptr) {
  return [height = std::move(height)](const Vec3& p, double t) {
    return TruePoint{p.z() - (height ? height(t) : 0.0), Vec3::UnitZ()};
  };
}

/// Where a method holds the hand back.
struct Contact {
  Vec3 point;   ///< [m] world, on the surface as the method has it
  Vec3 normal;  ///< [-] outward
};

/// Base of the methods written to compare: their parameters, read as they are needed.
///
/// Of a tick, the experiments read `proxy`, `normal`, `force`, `state` (free or not) and `steps`. A
/// method without a proxy reports the point it pushes the hand towards, r_c above the surface.
class LabMethod : public Method {
 public:
  void observe(const Observation& seen) noexcept final {
    clouds_.take(seen.camera, seen.cloud);
    ++frames_;
    frame(clouds_, seen.stamp);
  }
  void seat(const Vec3& /*proxy*/) noexcept override {}  // has no memory
  void set_parameters(const Parameters& parameters) noexcept final {
    parameters_ = parameters;
    parameters_changed();
  }
  /// A tick cannot throw, so `play` asks after each. @throws what went wrong first, if anything did
  virtual void rethrow() const {}

 protected:
  explicit LabMethod(const Parameters& parameters) : parameters_(parameters) {}
  /// Any camera has a new frame.
  /// @param all    what each camera saw last; the same object each time
  /// @param stamp  [s] of the new frame
  virtual void frame(const Cloud& /*all*/, double /*stamp*/) noexcept {}
  /// Called after a change, for members derived from the parameters.
  virtual void parameters_changed() noexcept {}
  [[nodiscard]] const Parameters& parameters() const { return parameters_; }
  /// What each camera saw last; null before the first frame.
  [[nodiscard]] const Cloud* seen() const { return frames_ > 0 ? &clouds_ : nullptr; }
  [[nodiscard]] Tick free(const Vec3& hip, double t) const {
    return free_tick(hip, t, frames_ - 1);
  }
  /// The tick of a method that holds a point of the hand on a surface: a spring pulls the HIP to
  /// that point, and the proxy that the experiments ask for is a sphere of radius r_c upon it.
  [[nodiscard]] Tick held(const Vec3& hip, const Contact& contact, double t) const;

 private:
  Parameters parameters_;
  ObservedClouds clouds_;
  std::int64_t frames_ = 0;
};

/// What makes a method of class `M`, by its parameters and what else its constructor asks for.
template <class M, auto... more>
std::unique_ptr<Method> made(const Parameters& parameters) {
  return std::make_unique<M>(parameters, more...);
}

/// What a method is made from.
struct MethodSetup {
  Parameters parameters;
  Truth truth;  ///< for `ideal`, the ruler; no honest method looks at it
};

/// A method that the lab does not know by name.
struct OwnMethod {
  std::string name;
  /// Called for each case, by any thread. @throws what ends the experiment
  std::function<std::unique_ptr<Method>(const MethodSetup&)> make;
};

/// The library's methods and those of the lab, in the order in which tables show them.
/// @param truth  for `ideal`; without it making that one fails
MethodRegistry methods(const Truth& truth = nullptr);

/// @param name  of one of `own`, of the lab's methods, or `pipe:COMMAND` (lab/pipe_method.hpp)
/// @throws Error for an unknown name, or if the method lacks something in the set-up.
std::unique_ptr<Method> make_method(std::string_view name, const MethodSetup& setup,
                                    const std::vector<OwnMethod>& own = {});

/// The entry of a list that has that `name`.
/// @param noun  what an entry is, such as "experiment"
/// @param what  what is wrong if there is none, such as "there is no such experiment"
/// @param also  another name that may stand there
/// @throws Error for an unknown name, naming the nearest one and listing all.
template <class Entries>
const auto& find_named(const Entries& entries, std::string_view name, const std::string& noun,
                       const std::string& what, std::string_view also = {}) {
  for (const auto& entry : entries)
    if (entry.name == name) return entry;
  std::vector<std::string_view> known = names_of(entries);
  if (!also.empty()) known.push_back(also);
  throw Error(noun + " '" + std::string(name) + "'", what, did_you_mean(name, known));
}

}  // namespace palpate::lab
