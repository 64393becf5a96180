// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "palpate/kernel/core/sensor.hpp"

namespace palpate {
namespace test_sensor {

constexpr std::array kinds{SensorKind::unknown, SensorKind::stereo, SensorKind::structured_light,
                           SensorKind::time_of_flight};

TEST(SensorKind, IsFoundByItsName) {
  for (const SensorKind kind : kinds) EXPECT_EQ(sensor_named(name_of(kind)), kind);
  EXPECT_EQ(sensor_named("time-of-flight"), SensorKind::time_of_flight);
  for (const char* name : {"", "Stereo", "stereo ", "time_of_flight", "lidar"})
    EXPECT_FALSE(sensor_named(name)) << name;
}

// What others measured of one camera of each kind: a D435 (0.1 px of disparity at a focal length
// of 420 px and a baseline of 50 mm), a Kinect v1 (Khoshelham and Elberink 2012) and a Kinect v2
// (Corti and others 2016).
TEST(SensorKind, HasTheNoiseThatWasMeasuredOfSuchCameras) {
  const auto noise_at = [](SensorKind kind, double distance) {
    const UsualNoise noise = usual_noise(kind);
    return noise.at_1m * (noise.growth == 2 ? distance * distance : distance);
  };
  for (const double z : {0.5, 1.0, 2.0}) {
    const double stereo = 0.1 * z * z / (420.0 * 0.05);
    EXPECT_NEAR(noise_at(SensorKind::stereo, z), stereo, 0.1 * stereo);
    const double light = 1.425e-3 * z * z;
    EXPECT_NEAR(noise_at(SensorKind::structured_light, z), light, 0.1 * light);
  }
  // Of cameras that time light, from megapixel chips to small modules.
  EXPECT_GE(noise_at(SensorKind::time_of_flight, 1.0), 1.5e-3);
  EXPECT_LE(noise_at(SensorKind::time_of_flight, 1.0), 8e-3);
  EXPECT_NEAR(noise_at(SensorKind::time_of_flight, 2.0),
              2.0 * noise_at(SensorKind::time_of_flight, 1.0), 1e-12);
  EXPECT_EQ(noise_text(SensorKind::stereo), "5 mm at 1 m, growing with the square of distance");
  EXPECT_EQ(noise_text(SensorKind::time_of_flight), "5 mm at 1 m, growing with distance");
}

TEST(SensorKind, SetsWhatIsLeftToItAndNothingElse) {
  const auto both = [](const Parameters& p) {
    return std::pair(p.sight.usual_noise, p.sight.noise_growth);
  };
  const Parameters left;
  EXPECT_EQ(both(left), std::pair(0.0, 0));
  EXPECT_EQ(both(for_sensors(left, {})), std::pair(5e-3, 2));
  for (const SensorKind kind : kinds) {
    const auto [at_1m, growth] = usual_noise(kind);
    EXPECT_EQ(both(for_sensors(left, std::array{kind})), std::pair(at_1m, growth));
  }
  // The noisiest of several.
  const std::array two{SensorKind::structured_light, SensorKind::time_of_flight};
  EXPECT_EQ(both(for_sensors(left, two)), std::pair(5e-3, 1));
  const std::array with_unknown{SensorKind::time_of_flight, SensorKind::unknown};
  EXPECT_EQ(both(for_sensors(left, with_unknown)), std::pair(5e-3, 2));
  // What somebody has set stays, also where it is what is usual of another kind.
  Parameters set;
  set_parameter(set, "usual_noise", 5e-3);
  EXPECT_EQ(both(for_sensors(set, two)), std::pair(5e-3, 1));
  set_parameter(set, "noise_growth", 2);
  EXPECT_EQ(both(for_sensors(set, two)), std::pair(5e-3, 2));
}

}  // namespace test_sensor
}  // namespace palpate
