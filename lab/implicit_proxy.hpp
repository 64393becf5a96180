// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>

#include "lab/method.hpp"

namespace palpate::lab {

/// An implicit surface near a place.
struct FieldValue {
  double value;   ///< positive outside, 0 on the surface
  Vec3 gradient;  ///< of any length; it points out
};

/// The value at a place [m, world], or none where the field says nothing: outside.
using Field = std::function<std::optional<FieldValue>(const Vec3& at)>;

/// A point that is held on an implicit surface as in [13]: outside, it follows the HIP until a step
/// ends inside; there it slides in the tangent plane, back to the surface after each step; it is
/// free again when the HIP is outside that plane.
class ImplicitProxy {
 public:
  /// @param stride  [m] of a step, and of the search for the surface along it
  /// @param reach   [m] how far a surface that has moved may be climbed in a new frame
  ImplicitProxy(double stride, double reach) : stride_(stride), reach_(reach) {}

  void seat(const Vec3& point);
  /// The surface is another from now on: if it has come over the point, the point climbs it.
  void surface_changed() { changed_ = true; }
  /// One tick. @return  the contact, or none in free motion.
  std::optional<Contact> follow(const Field& field, const Vec3& hip);
  /// [m] world: where the next tick begins.
  [[nodiscard]] Vec3 point_or(const Vec3& hip) const { return point_.value_or(hip); }
  [[nodiscard]] int steps() const { return steps_; }
  void set_reach(double reach) { reach_ = reach; }  ///< [m] as in the constructor

 private:
  void climb(const Field& field);
  bool approach(const Field& field, const Vec3& hip);
  bool slide(const Field& field, const Vec3& hip, const Vec3& normal);
  [[nodiscard]] static Vec3 between(const Field& field, Vec3 outside, Vec3 inside);

  double stride_;
  double reach_;
  std::optional<Vec3> point_;
  bool touching_ = false;
  bool changed_ = false;
  int steps_ = 0;
};

/// A method given by an implicit surface: how a frame changes the field, and its value at a place.
class ImplicitMethod : public LabMethod {
 public:
  void seat(const Vec3& proxy) noexcept final { proxy_.seat(proxy); }
  void frame(const Cloud& cloud, double stamp) noexcept final;
  Tick tick(const Vec3& hip, double t) noexcept final;

 protected:
  /// @param stride, reach  as ImplicitProxy
  ImplicitMethod(const Parameters& parameters, double stride, double reach)
      : LabMethod(parameters), proxy_(stride, reach) {}

  /// A new frame; the cloud lives until the next call.
  virtual void take(const Cloud& cloud, const Vec3& place) = 0;
  /// Before each tick: the field will be asked about places near this one.
  virtual void prepare(const Vec3& place) = 0;
  virtual std::optional<FieldValue> field(const Vec3& at) = 0;
  void set_reach(double reach) { proxy_.set_reach(reach); }  ///< [m] as in the constructor

 private:
  ImplicitProxy proxy_;
};

}  // namespace palpate::lab
