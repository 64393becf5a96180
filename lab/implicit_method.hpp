// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "lab/method.hpp"

namespace palpate::lab {

/// An implicit surface near a place.
struct FieldValue {
  double value;   ///< positive outside, 0 on the surface
  Vec3 gradient;  ///< of any length; it points out
};

/// A method given by an implicit surface: how a frame changes the field, and its value at a place.
///
/// A point is held on the surface as in [13]: outside, it follows the HIP until a step ends inside;
/// there it slides in the tangent plane, back to the surface after each step; it is free again when
/// the HIP is outside that plane. If a new frame's surface has come over it, it climbs that.
class ImplicitMethod : public LabMethod {
 public:
  void seat(const Vec3& proxy) noexcept final;
  void frame(const Cloud& cloud, double stamp) noexcept final;
  Tick tick(const Vec3& hip, double t) noexcept final;

 protected:
  /// @param stride  [m] of a step, and of the search for the surface along it
  /// @param reach   [m] how far a surface that has moved may be climbed in a new frame
  ImplicitMethod(const Parameters& parameters, double stride, double reach)
      : LabMethod(parameters), stride_(stride), reach_(reach) {}

  /// A new frame; the cloud lives until the next call.
  virtual void take(const Cloud& cloud, const Vec3& place) = 0;
  /// Before each tick: the field will be asked about places near this one.
  virtual void prepare(const Vec3& place) = 0;
  /// The value at a place [m, world], or none where the field says nothing: outside.
  virtual std::optional<FieldValue> field(const Vec3& at) = 0;
  void set_reach(double reach) { reach_ = reach; }  ///< [m] as in the constructor

 private:
  [[nodiscard]] bool inside(const Vec3& at);
  [[nodiscard]] std::optional<Vec3> normal_at(const Vec3& at);
  [[nodiscard]] Vec3 between(Vec3 outer, Vec3 inner);
  void climb();
  bool approach(const Vec3& hip);
  bool slide(const Vec3& hip, const Vec3& normal);
  std::optional<Contact> follow(const Vec3& hip);

  double stride_;
  double reach_;
  std::optional<Vec3> point_;
  bool touching_ = false;
  bool changed_ = false;
  int steps_ = 0;
};

}  // namespace palpate::lab
