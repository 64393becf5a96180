// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/session/registration.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/sanitized.hpp"

namespace palpate {
namespace test_camera_registration {

struct Seen {
  Frame frame;
  [[nodiscard]] const DepthImage& image() const {
    return dynamic_cast<const DepthImage&>(*frame.cloud);
  }
};

Seen seen(const std::string& uri) { return {*open_synthetic_camera(Uri(uri))->next()}; }

// A pose off by some centimetres and degrees, about another axis for each number.
Eigen::Isometry3d off(double metres, double radians, int number) {
  const double a = 2.4 * number;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translate(metres * Vec3(std::cos(a), std::sin(a), 0.5).normalized());
  pose.rotate(Eigen::AngleAxisd(radians, Vec3(std::sin(a), 0.7, std::cos(a)).normalized()));
  return pose;
}

struct Errors {
  double turn, shift;  // [rad] [m] at the centre of what both see
};

Errors errors_of(const CameraFit& fit, const Eigen::Isometry3d& truth) {
  const Eigen::Isometry3d second_from_first = truth.inverse();
  return {Eigen::AngleAxisd(truth.linear().transpose() * fit.first_from_second.linear()).angle(),
          (fit.first_from_second * (second_from_first * fit.centre) - fit.centre).norm()};
}

TEST(CameraRegistration, FindsACameraThatTheSceneWasDrawnFor) {
  const std::string scene = "synthetic:desk?size=320x240&noise=1mm";
  const Seen first = seen(scene);
  for (int number = 0; number < (test::sanitized ? 1 : 2); ++number) {
    const Seen second =
        seen(scene + "&seed=7&distance=0.8m&azimuth=" + std::to_string(20 + 30 * number) + "deg");
    const Eigen::Isometry3d truth =
        first.image().world_from_camera().inverse() * second.image().world_from_camera();
    const CameraFit fit =
        register_cameras(first.image(), second.image(), off(0.08, 0.15, number) * truth);
    const Errors errors = errors_of(fit, truth);
    EXPECT_LT(errors.shift, 1e-3) << number;
    EXPECT_LT(errors.turn, 3e-3) << number;
    EXPECT_LT(errors.shift, 5.0 * fit.shift_deviation() + 1e-3) << "as it says itself";
    EXPECT_LT(fit.shift_deviation(), 1e-3);
    EXPECT_GT(fit.overlap, 0.3);
    EXPECT_NEAR(fit.rms, 1e-3, 0.5e-3) << "the noise that was put in";
  }
}

TEST(CameraRegistration, RefusesWhatASinglePlaneLeavesOpen) {
  const Seen first = seen("synthetic:plane?size=320x240&noise=1mm");
  const Seen second = seen("synthetic:plane?size=320x240&noise=1mm&seed=7&azimuth=20deg");
  const Eigen::Isometry3d truth =
      first.image().world_from_camera().inverse() * second.image().world_from_camera();
  EXPECT_TRUE(
      test::fails_saying([&] { return register_cameras(first.image(), second.image(), truth); },
                         "does not determine", "faces in three directions"));
}

TEST(CameraRegistration, RefusesCamerasThatSeeDifferentThings) {
  const Seen desk = seen("synthetic:desk?size=320x240");
  const Eigen::Isometry3d away(Eigen::Translation3d(5.0, 0.0, 0.0));
  EXPECT_TRUE(test::fails_saying([&] { return register_cameras(desk.image(), desk.image(), away); },
                                 "too little", "initial estimate"));
}

}  // namespace test_camera_registration
}  // namespace palpate
