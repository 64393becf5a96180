// SPDX-License-Identifier: Apache-2.0
// A peg into a hole over a link with delay, by an operator who goes by what is felt.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "tests/robot/task.hpp"

namespace palpate::robot {
namespace test_peg {

const Eigen::Vector2d hole_place{-0.13, -0.16};  // [m]
constexpr double top = 0.03;                     // [m] of the board
constexpr double wanted_depth = 0.02;            // [m] of the peg's end below the board

// The end of a hand that goes where it wants and yields to what it feels sideways: comes down on
// the board beside the hole, slides towards where it takes the hole to be until the board gives
// way, then pushes down. What it missed it tries again, farther to a side.
class Searcher final : public Device {
 public:
  explicit Searcher(double aside) : aside_(aside) {
    info_.kind = "an operator who searches";
    info_.limits = no_motors;
    begin_try();
    place_ = {start_.x(), start_.y(), above};
  }
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double t) noexcept override {
    const double dt = began_ ? t - t_ : 0.0;
    if (!began_) since_ = t;
    began_ = true;
    t_ = t;
    move(dt);
    return {.position = place_};
  }
  void write(const Vec3& force, double /*t*/) noexcept override {
    felt_ += 0.02 * (force - felt_);  // 50 ms
  }

  enum class Doing : std::uint8_t { waits, lowers, slides, pushes, lifts };
  [[nodiscard]] Doing doing() const { return doing_; }
  [[nodiscard]] int tries() const { return tries_; }

 private:
  static constexpr double above = top + 0.04;  // [m]
  static constexpr double pressed = 4e-3;      // [m] that the hand goes into the board
  static constexpr double speed = 0.01;        // [m/s]
  static constexpr double before = 0.03;       // [m] beside the hole

  void begin_try() {
    // 0, +3, -3, +6, -6 mm beside where it began.
    const int n = (tries_ + 1) / 2 * (tries_ % 2 == 0 ? -1 : 1);
    start_ = hole_place + Eigen::Vector2d(before, aside_ + 3e-3 * n);
    ++tries_;
  }
  void turn_to(Doing doing) {
    doing_ = doing;
    since_ = t_;
  }
  void move(double dt) {
    const double upwards = felt_.z();
    switch (doing_) {
      case Doing::waits:
        place_ = {start_.x(), start_.y(), above};
        if (t_ - since_ > 2.5) turn_to(Doing::lowers);
        break;
      case Doing::lowers:
        place_.z() -= 2.0 * speed * dt;
        if (upwards > 1.0) {
          board_ = place_.z();
          turn_to(Doing::slides);
        }
        break;
      case Doing::slides:
        place_.z() = std::max(place_.z() - 2.0 * speed * dt, board_ - pressed);
        place_.x() -= speed * dt;
        if (t_ - since_ > 0.5 && upwards < 0.3) turn_to(Doing::pushes);
        if (place_.x() < hole_place.x() - before) turn_to(Doing::lifts);
        break;
      case Doing::pushes: {
        const Vec3 sideways(felt_.x(), felt_.y(), 0.0);
        place_ += 0.02 * dt * sideways;  // 20 mm/s a newton
        if (upwards < 2.0) place_.z() = std::max(place_.z() - speed * dt, board_ - 0.03);
        // Still on the board after all.
        if (t_ - since_ > 1.0 && place_.z() > board_ - 6e-3) turn_to(Doing::lifts);
        break;
      }
      case Doing::lifts:
        place_.z() = std::min(place_.z() + 4.0 * speed * dt, above);
        if (place_.z() >= above) {
          begin_try();
          turn_to(Doing::waits);
        }
        break;
    }
  }

  DeviceInfo info_;
  double aside_;
  Eigen::Vector2d start_ = Eigen::Vector2d::Zero();
  Vec3 place_ = Vec3::Zero(), felt_ = Vec3::Zero();
  double board_ = top, t_ = 0.0, since_ = 0.0;
  bool began_ = false;
  int tries_ = 0;
  Doing doing_ = Doing::waits;
};

struct Outcome {
  double depth = 0.0;               // [m] of the peg's end below the board, at its deepest
  double hardest = 0.0;             // [N] of what the peg touches
  std::optional<double> time = {};  // [s] from the first touch until it is in as deep as wanted
  int tries = 0;
};

struct Attempt {
  double hole = 0.025;  // [m] its side
  double delay = 0.0;   // [s] of the link, one way
  double aside = 3e-3;  // [m] by which the operator is wrong
  std::string sensor = exact;
};

Outcome put_in(const Attempt& attempt) {
  Searcher hand(attempt.aside);
  Task task("&tilt=20deg&arm=remembered&hole=" + std::to_string(attempt.hole) + attempt.sensor,
            hand, attempt.delay);
  const double radius = task.simulation().info().tool_radius;
  Outcome out;
  double t = 0.0;
  std::optional<double> began;
  const auto look = [&](const ServoTick&) {
    const Truth truth = task.simulation().truth();
    t += tick;
    if (!began && hand.doing() == Searcher::Doing::slides) began = t;
    const Eigen::Vector2d beside = truth.tip.head<2>() - hole_place;
    if (beside.lpNorm<Eigen::Infinity>() < 0.5 * attempt.hole)
      out.depth = std::max(out.depth, top - (truth.tip.z() - radius));
    out.hardest = std::max(out.hardest, truth.tip_force.norm());
    if (!out.time && out.depth > wanted_depth) out.time = t - *began;
  };
  while (t < 20.0 && !out.time) task.run(0.5, look);
  out.tries = hand.tries();
  return out;
}

class Peg : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Delays, Peg, ::testing::Values(0.0, 0.25),
                         [](const auto& one) { return one.param > 0.0 ? "Far" : "Near"; });

TEST_P(Peg, GoesIntoAHole) {
  const Outcome out = put_in({.delay = GetParam()});
  ASSERT_TRUE(out.time) << out.depth;
  EXPECT_LT(*out.time, 6.0);
  EXPECT_EQ(out.tries, 1);
  EXPECT_LT(out.hardest, 5.0);
}

// The table of docs/teleop.md; three minutes.
TEST(PegTable, DISABLED_OfHolesDelaysAndSensors) {
  for (const std::string& sensor : {exact, std::string("&sensor=d4xx")}) {
    for (const double hole : {12e-3, 15e-3, 18e-3, 20e-3, 22e-3, 25e-3, 30e-3}) {
      for (const double delay : {0.0, 0.125, 0.25}) {
        std::printf("%s %2.0f mm, round trip %3.0f ms:", sensor.c_str(), 1e3 * hole, 2e3 * delay);
        for (const double aside : {-3e-3, 0.0, 3e-3}) {
          const Outcome out = put_in({hole, delay, aside, sensor});
          std::printf("  %s %4.1f mm %5.1f N %4.1f s %d tries", out.time ? "in " : "not",
                      1e3 * out.depth, out.hardest, out.time.value_or(-1.0), out.tries);
        }
        std::printf("\n");
        std::fflush(stdout);
      }
    }
  }
}

}  // namespace test_peg
}  // namespace palpate::robot
