// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/kernel/core/method.hpp"
#include "palpate/kernel/core/newest_frame.hpp"
#include "palpate/kernel/paper/coupling.hpp"
#include "palpate/kernel/paper/point_mover.hpp"

namespace palpate {

/// The paper's method: F. Rydén and H. J. Chizeck, IEEE Transactions on Haptics 6(3), 2013,
/// sections 4.1 to 4.6. docs/method.md goes through it equation by equation.
class Paper final : public Method {
 public:
  enum class Variant {
    corrected,   ///< with the errata of docs/method.md corrected
    as_printed,  ///< to the letter: signs of (15) and (16), 1/f_c in (3) and (13)
    fixed_step,  ///< the 2011 method [1]: every step 0.1 r_1, no velocity estimate
  };

  /// Allocates all it will ever need. @throws Error if the parameters do not validate.
  explicit Paper(const Parameters& parameters = {}, Variant variant = Variant::corrected);

  void seat(const Vec3& proxy) noexcept override;
  /// Movement step 1 of section 4.3, Eq. (3). [servo] O(1)
  void observe(const Observation& seen) noexcept override;
  /// Movement steps 2 to 7 of section 4.3 until the proxy rests, and the force (4.6). [servo] At
  /// most step_budget steps over at most Patch::capacity points each.
  Tick tick(const Vec3& hip, double t) noexcept override;
  void set_parameters(const Parameters& parameters) noexcept override;

  [[nodiscard]] const Patch* patch() const noexcept override { return &mover_.patch(); }

 private:
  Vec3 render_force(const Vec3& hip, double t, std::uint32_t& flags) noexcept;

  Variant variant_;
  Parameters parameters_;
  PointMover mover_;
  NewestFrame frame_;
  Proxy proxy_;

  // The surface's motion along n: section 4.5.
  double velocity_ = 0.0;             // [m/s] v_j
  bool velocity_update_due_ = false;  // (13) waits for the first step after (3)
  DistanceRate distance_rate_;        // of (16)
};

}  // namespace palpate
