// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/sources/sensor_model.hpp"
#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/core/error.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_sensor_model {

using test::fails_saying;

constexpr float nothing = std::numeric_limits<float>::infinity();
constexpr int width = 320;
constexpr int height = 240;
constexpr std::size_t pixels = static_cast<std::size_t>(width) * height;

using Readings = std::vector<std::uint16_t>;

Intrinsics camera() { return pinhole(width, height, 1.0); }

std::vector<float> wall(float depth) {
  std::vector<float> depths(pixels, depth);
  return depths;
}

SensorModel fine() {
  SensorModel model;
  model.quantisation = 2e-5;  // well below the noise that is measured here
  return model;
}

// Deviations from the wall's depth [m] in several frames.
std::vector<std::vector<double>> deviations(const SensorModel& model, float depth, int frames) {
  Sensor sensor(model, camera());
  std::vector<std::vector<double>> result;
  for (int k = 0; k < frames; ++k) {
    std::vector<double> field;
    for (const std::uint16_t raw : sensor.measure(wall(depth), k)) {
      field.push_back(raw * model.quantisation - depth);
    }
    result.push_back(std::move(field));
  }
  return result;
}

double standard_deviation(const std::vector<std::vector<double>>& fields) {
  double squares = 0.0;
  for (const auto& field : fields) {
    for (const double value : field) squares += value * value;
  }
  return std::sqrt(squares / static_cast<double>(pixels * fields.size()));
}

// Correlation of pixels (du, dv) apart.
double correlation(const std::vector<std::vector<double>>& fields, int du, int dv) {
  double products = 0.0;
  double squares = 0.0;
  for (const auto& field : fields) {
    for (int v = 0; v + dv < height; ++v) {
      for (int u = 0; u + du < width; ++u) {
        const double a = field[v * width + u];
        const double b = field[(v + dv) * width + u + du];
        products += a * b;
        squares += 0.5 * (a * a + b * b);
      }
    }
  }
  return products / squares;
}

TEST(Sensor, ItsNormalNumbersAreNormal) {
  std::vector<float> numbers(1'000'001);  // odd: the last has no partner
  fill_normal(42, numbers);
  double sum = 0.0;
  double squares = 0.0;
  double fourth = 0.0;
  double neighbours = 0.0;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const double x = numbers[i];
    sum += x;
    squares += x * x;
    fourth += x * x * x * x;
    if (i > 0) neighbours += x * numbers[i - 1];
  }
  const auto n = static_cast<double>(numbers.size());
  // Four standard errors each.
  EXPECT_NEAR(sum / n, 0.0, 4.0e-3);
  EXPECT_NEAR(squares / n, 1.0, 4.0 * std::sqrt(2.0 / n));
  EXPECT_NEAR(fourth / n, 3.0, 4.0 * std::sqrt(96.0 / n));
  EXPECT_NEAR(neighbours / n, 0.0, 4.0e-3);
  std::sort(numbers.begin(), numbers.end());
  double worst = 0.0;  // Kolmogorov and Smirnov's distance; 1.95/sqrt(n) is passed once in a 1000
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const double expected = 0.5 * std::erfc(-numbers[i] / std::numbers::sqrt2);
    worst = std::max(worst, std::abs((static_cast<double>(i) + 0.5) / n - expected));
  }
  EXPECT_LT(worst, 1.95e-3);
  // About 63 lie beyond four standard deviations: the tails are there.
  const auto beyond =
      std::count_if(numbers.begin(), numbers.end(), [](float x) { return std::abs(x) > 4.0F; });
  EXPECT_NEAR(static_cast<double>(beyond), 63.3, 4.0 * std::sqrt(63.3));
}

TEST(Sensor, WhiteNoiseHasItsDeviationAndNoMemory) {
  SensorModel model = fine();
  model.noise = 0.002;
  const auto fields = deviations(model, 1.0F, 4);
  EXPECT_NEAR(standard_deviation(fields), 0.002, 0.002 * 0.01);
  EXPECT_NEAR(correlation(fields, 1, 0), 0.0, 0.01);
  EXPECT_NEAR(correlation(fields, 0, 1), 0.0, 0.01);
  double products = 0.0;
  for (std::size_t i = 0; i < pixels; ++i) products += fields[0][i] * fields[1][i];
  EXPECT_NEAR(products / static_cast<double>(pixels) / 4e-6, 0.0, 4.0 / std::sqrt(pixels));
}

TEST(Sensor, CorrelatedNoiseFallsOffAsItsLengthsSay) {
  SensorModel model = fine();
  model.noise = 0.002;
  model.correlation_x = 5.0;
  model.correlation_y = 3.0;
  const auto fields = deviations(model, 1.0F, 8);
  EXPECT_NEAR(standard_deviation(fields), 0.002, 0.002 * 0.02);
  for (const int d : {1, 2, 3, 5, 8}) {
    EXPECT_NEAR(correlation(fields, d, 0), std::exp(-d * d / 25.0), 0.03) << d;
    EXPECT_NEAR(correlation(fields, 0, d), std::exp(-d * d / 9.0), 0.03) << d;
  }
  EXPECT_NEAR(correlation(fields, 3, 2), std::exp(-9.0 / 25.0 - 4.0 / 9.0), 0.03);
}

TEST(Sensor, GrowingNoiseGrowsWithAPowerOfDepth) {
  SensorModel model = fine();
  model.quantisation = 1e-4;
  model.noise = 0.002;
  model.noise_growth = 2;
  EXPECT_NEAR(standard_deviation(deviations(model, 0.5F, 2)), 0.0005, 1e-5);
  EXPECT_NEAR(standard_deviation(deviations(model, 2.0F, 2)), 0.008, 1e-4);
  model.noise_growth = 1;
  EXPECT_NEAR(standard_deviation(deviations(model, 0.5F, 2)), 0.001, 1e-5);
  EXPECT_NEAR(standard_deviation(deviations(model, 2.0F, 2)), 0.004, 1e-4);
}

// The deviations of a RealSense D4xx over a resting table, eight frames, whole-frame shift removed.
TEST(Sensor, LearnedDepthErrsAlikeOverPixelsAndFramesAndDriftsInScale) {
  SensorModel model = SensorModel::named("learned");
  model.quantisation = 2e-5;
  model.drift = 0.0;
  const auto fields = deviations(model, 0.5F, 300);
  EXPECT_NEAR(standard_deviation(fields), 5e-3, 0.5e-3);  // 1 % of depth
  EXPECT_NEAR(correlation(fields, 10, 0), std::exp(-1.0 / 16.0), 0.03);
  EXPECT_NEAR(correlation(fields, 0, 40), std::exp(-1.0), 0.1);
  const auto in_time = [&](std::size_t frames) {
    double products = 0.0, squares = 0.0;
    for (std::size_t k = 0; k + frames < fields.size(); ++k) {
      for (std::size_t i = 0; i < pixels; i += 97) {
        products += fields[k][i] * fields[k + frames][i];
        squares += fields[k][i] * fields[k][i];
      }
    }
    return products / squares;
  };
  EXPECT_GT(in_time(1), 0.99);
  EXPECT_NEAR(in_time(15), 0.6, 0.15);
  EXPECT_NEAR(in_time(60), 0.0, 0.15);

  model = fine();
  model.drift = 0.03;
  Sensor sensor(model, camera());
  const auto scale = [&](int frame) {
    const Readings readings = sensor.measure(wall(0.5F), frame);
    EXPECT_EQ(readings.front(), readings.back());
    return readings.front() * model.quantisation / 0.5;
  };
  constexpr int draws = 60;
  double squares = 0.0, fastest = 0.0;
  for (int k = 0; k < draws; ++k) {
    squares += (scale(300 * k) - 1.0) * (scale(300 * k) - 1.0);
    fastest = std::max(fastest, std::abs(scale(300 * k + 151) - scale(300 * k + 150)));
  }
  EXPECT_NEAR(std::sqrt(squares / draws), 0.03, 4.0 * 0.03 / std::sqrt(2.0 * draws));
  EXPECT_LT(fastest, 2e-3);  // in a frame
}

TEST(Sensor, D4xxNoiseIsWhatWasMeasuredOnARestingTable) {
  struct Row {
    float near, far;
    double sigma;
    std::vector<double> along_x, along_y;  // at 1, 2, 3, 5, 8 and 12 pixels
  };
  const std::vector<Row> table{{0.3F,
                                0.6F,
                                1.7e-3,
                                {0.92, 0.86, 0.82, 0.73, 0.60, 0.42},
                                {0.84, 0.76, 0.67, 0.50, 0.26, 0.05}},
                               {0.6F,
                                0.8F,
                                3.1e-3,
                                {0.93, 0.89, 0.85, 0.75, 0.60, 0.40},
                                {0.93, 0.88, 0.83, 0.72, 0.56, 0.36}},
                               {0.8F,
                                1.0F,
                                5.2e-3,
                                {0.96, 0.93, 0.90, 0.83, 0.72, 0.57},
                                {0.96, 0.92, 0.87, 0.77, 0.59, 0.36}}};
  SensorModel model = fine();
  model.d4xx_noise = true;
  for (const Row& row : table) {
    const auto fields = deviations(model, 0.5F * (row.near + row.far), 24);
    EXPECT_NEAR(standard_deviation(fields) / row.sigma, 1.0, 0.05) << row.near;
    const int lags[] = {1, 2, 3, 5, 8, 12};
    for (int i = 0; i < 6; ++i) {
      EXPECT_NEAR(correlation(fields, lags[i], 0), row.along_x[i], 0.07) << row.near << lags[i];
      EXPECT_NEAR(correlation(fields, 0, lags[i]), row.along_y[i], 0.07) << row.near << lags[i];
    }
  }
}

TEST(Sensor, AReadingDependsOnSeedAndFrameAlone) {
  for (const char* name : {"ideal", "d4xx", "kinect", "tof"}) {
    SensorModel model = SensorModel::named(name);
    model.noise = 0.003;
    model.correlation_x = 2.0;
    model.dropouts = 0.05;
    Sensor once(model, camera());
    Sensor again(model, camera());
    const Readings third = once.measure(wall(0.7F), 3);
    static_cast<void>(again.measure(wall(0.9F), 7));
    EXPECT_EQ(again.measure(wall(0.7F), 3), third) << name;
    EXPECT_NE(again.measure(wall(0.7F), 4), third) << name;
    model.seed = 2;
    EXPECT_NE(Sensor(model, camera()).measure(wall(0.7F), 3), third) << name;
  }
}

TEST(Sensor, PointNoiseActsOnEachCoordinateAlike) {
  std::vector<Vec3> points(100'000, Vec3(1.0, 2.0, 3.0));
  add_point_noise(points, 0.005, 9, 1);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Vec3& p : points) {
    const Vec3 offset = p - Vec3(1.0, 2.0, 3.0);
    covariance += offset * offset.transpose() / static_cast<double>(points.size());
  }
  EXPECT_LT((covariance / 2.5e-5 - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(), 0.02);
  std::vector<Vec3> again(100'000, Vec3(1.0, 2.0, 3.0));
  add_point_noise(again, 0.005, 9, 1);
  EXPECT_EQ(points, again);
}

TEST(Sensor, RoundsToTheNearestUnitAndLosesWhatDoesNotFit) {
  SensorModel model;
  model.quantisation = 1e-3;
  Sensor sensor(model, camera());
  std::vector<float> depth = wall(1.0F);
  depth[0] = 0.7004F;
  depth[1] = 0.7006F;
  depth[2] = nothing;
  depth[3] = 65.534F;
  depth[4] = 65.536F;
  depth[5] = 0.0004F;
  const Readings readings = sensor.measure(depth, 0);
  EXPECT_EQ(readings[0], 700);
  EXPECT_EQ(readings[1], 701);
  EXPECT_EQ(readings[2], 0);
  EXPECT_EQ(readings[3], 65534);
  EXPECT_EQ(readings[4], 0);
  EXPECT_EQ(readings[5], 0);
  EXPECT_EQ(readings[6], 1000);
}

TEST(Sensor, CountsDisparitiesInStepsThatGrowWithTheSquareOfDepth) {
  SensorModel model = fine();
  model.disparity_step = 2.85e-3;
  Sensor sensor(model, camera());
  for (const double depth : {0.5, 1.0}) {
    std::vector<float> ramp(pixels);
    for (std::size_t i = 0; i < pixels; ++i) {
      ramp[i] = static_cast<float>(depth + 1e-6 * (static_cast<double>(i) - 0.5 * pixels));
    }
    const Readings readings = sensor.measure(ramp, 0);
    const std::set<std::uint16_t> levels(readings.begin(), readings.end());
    const double step = (*levels.rbegin() - *levels.begin()) * model.quantisation /
                        (static_cast<double>(levels.size()) - 1.0);
    EXPECT_NEAR(step / (2.85e-3 * depth * depth), 1.0, 0.05) << depth;
  }
}

TEST(Sensor, DropsTheShareOfPixelsAskedForAndChangesNoOther) {
  SensorModel model;
  model.noise = 0.001;
  const Readings whole = Sensor(model, camera()).measure(wall(1.0F), 5);
  model.dropouts = 0.1;
  const Readings holed = Sensor(model, camera()).measure(wall(1.0F), 5);
  int holes = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    holes += holed[i] == 0 ? 1 : 0;
    EXPECT_TRUE(holed[i] == 0 || holed[i] == whole[i]);
  }
  EXPECT_NEAR(holes, 0.1 * pixels, 4.0 * std::sqrt(0.09 * pixels));
}

TEST(Sensor, PixelsFlyOnlyBesideEdgesAndOnlyBetweenBothDepths) {
  std::vector<float> step = wall(0.8F);
  for (int v = 0; v < height; ++v) std::fill_n(step.begin() + v * width, 100, 0.6F);
  SensorModel model;
  model.flying = 0.4;
  const Readings readings = Sensor(model, camera()).measure(step, 0);
  int flying = 0;
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const std::uint16_t raw = readings[v * width + u];
      if (u != 99 && u != 100) {
        EXPECT_EQ(raw, u < 100 ? 6000 : 8000);
      } else {
        EXPECT_GE(raw, 6000);
        EXPECT_LE(raw, 8000);
        flying += raw != (u < 100 ? 6000 : 8000) ? 1 : 0;
      }
    }
  }
  EXPECT_NEAR(flying, 0.4 * 2 * (height - 2), 4.0 * std::sqrt(0.24 * 2 * height));
}

TEST(Sensor, GrazingSightlinesFindNothing) {
  // A plane that the camera sees at 60 degrees in its middle, more above, less below.
  const Vec3 normal(0.0, std::sin(1.0472), -std::cos(1.0472));
  const Vec3 on_plane(0.0, 0.0, 1.0);
  const Intrinsics intrinsics = camera();
  std::vector<float> depth(pixels);
  std::vector<double> off_normal(pixels);
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const Vec3 ray((u - intrinsics.cx) / intrinsics.fx, (v - intrinsics.cy) / intrinsics.fy, 1.0);
      depth[v * width + u] = static_cast<float>(normal.dot(on_plane) / normal.dot(ray));
      off_normal[v * width + u] = std::acos(std::abs(normal.dot(ray)) / ray.norm());
    }
  }
  SensorModel model = fine();
  model.quantisation = 1e-4;
  model.grazing = 1.1;
  const Readings readings = Sensor(model, intrinsics).measure(depth, 0);
  int holes = 0;
  for (int v = 1; v + 1 < height; ++v) {
    for (int u = 1; u + 1 < width; ++u) {
      const std::size_t i = v * width + u;
      if (std::abs(off_normal[i] - model.grazing) < 0.01) continue;
      EXPECT_EQ(readings[i] == 0, off_normal[i] > model.grazing) << u << ' ' << v;
      holes += readings[i] == 0 ? 1 : 0;
    }
  }
  EXPECT_GT(holes, 1000);
}

TEST(Sensor, AnEdgeSeenSquarelyIsNotGrazing) {
  std::vector<float> step = wall(0.8F);
  for (int v = 0; v < height; ++v) std::fill_n(step.begin() + v * width, 100, 0.6F);
  SensorModel model;
  model.grazing = 1.4;
  const Readings readings = Sensor(model, camera()).measure(step, 0);
  EXPECT_EQ(std::count(readings.begin(), readings.end(), 0), 0);
}

TEST(Sensor, RefusesValuesThatCannotBe) {
  const auto refuses = [](auto change, const char* field) {
    SensorModel model;
    change(model);
    return fails_saying([&] { return Sensor(model, camera()); }, field, "out of range");
  };
  EXPECT_TRUE(refuses([](SensorModel& m) { m.noise = -1.0; }, "noise"));
  EXPECT_TRUE(refuses([](SensorModel& m) { m.noise = std::nan(""); }, "noise"));
  EXPECT_TRUE(refuses([](SensorModel& m) { m.correlation_x = 1e9; }, "correlation_x"));
  EXPECT_TRUE(refuses([](SensorModel& m) { m.quantisation = 0.0; }, "quantisation"));
  EXPECT_TRUE(refuses([](SensorModel& m) { m.dropouts = 1.1; }, "dropouts"));
  EXPECT_TRUE(refuses([](SensorModel& m) { m.grazing = 2.0; }, "grazing"));
  EXPECT_TRUE(fails_saying([] { return SensorModel::named("xtion"); }, "xtion", "kinect"));
  EXPECT_TRUE(
      fails_saying([] { return Sensor(SensorModel{}, camera()).measure(std::vector<float>(7), 0); },
                   "7 values"));
}

}  // namespace test_sensor_model
}  // namespace palpate
