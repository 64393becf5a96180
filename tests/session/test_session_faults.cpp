// SPDX-License-Identifier: Apache-2.0
// A fault matrix: whatever fails, in free motion or in contact, the force is gone within the
// documented age, never grows while a camera is late, and comes back when all is well again.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/session/session.hpp"

#include "tests/session/fakes.hpp"

namespace palpate {
namespace {

using test::MadeSource;
using test::wall;
using test::wall_depth;

enum class Fault { off, stuck, garbage, wrong, delayed, intermittent };
enum class Place { first_camera, second_camera, hand, device };
enum class Motion { free, contact };

constexpr double fault_begins = 3.0, fault_ends = 4.5;  // [s]
constexpr double lift_off = 5.0, back_again = 6.0;      // [s] of the hand
constexpr double session_ends = 8.5;                    // [s]
constexpr double frame_interval = 1.0 / 30.0;           // [s]
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

bool is_during(double t) {
  return t >= fault_begins && t < fault_ends;
}

/// The wall at 30 Hz, with a fault; notes the stamps of its good frames.
class FaultyCamera {
 public:
  FaultyCamera(std::optional<Fault> fault, std::shared_ptr<std::vector<double>> good)
      : fault_(fault), good_(std::move(good)) {}

  std::optional<Frame> operator()(int /*k*/) {
    double stamp = frame_interval * number_++;
    if (!fault_) return make(stamp);
    while (is_during(stamp) && is_missing(stamp)) stamp = frame_interval * number_++;
    if (!is_during(stamp)) return make(stamp);
    switch (*fault_) {
      case Fault::stuck:  // the same capture again and again
        return Frame{good_->back(), wall()};
      case Fault::garbage: {
        const std::array<double, 3> stamps = {nan, -std::numeric_limits<double>::infinity(),
                                              good_->back() - 0.5};
        return Frame{stamps[static_cast<std::size_t>(number_) % 3], noise()};
      }
      case Fault::wrong:  // good stamps, a picture of anything
        good_->push_back(stamp);
        return Frame{stamp, noise()};
      case Fault::off:
      case Fault::delayed:
      case Fault::intermittent:
        break;
    }
    return make(stamp);
  }

 private:
  [[nodiscard]] bool is_missing(double stamp) const {
    const double since = stamp - fault_begins;
    if (*fault_ == Fault::off) return true;
    if (*fault_ == Fault::delayed) return number_ % 18 != 0;  // a frame in 0.6 s
    return *fault_ == Fault::intermittent && std::fmod(since, 0.8) < 0.6;
  }
  Frame make(double stamp) {
    good_->push_back(stamp);
    return {stamp, wall()};
  }
  std::shared_ptr<const Cloud> noise() {
    const auto seen = wall();
    const DepthImage& image = *seen;
    std::vector<std::uint16_t> depth = image.depth();
    for (std::uint16_t& value : depth) value = static_cast<std::uint16_t>(random_());
    return std::make_shared<DepthImage>(std::make_shared<ViewingRays>(image.intrinsics()), depth,
                                        1000.0);
  }

  std::optional<Fault> fault_;
  std::shared_ptr<std::vector<double>> good_;
  std::minstd_rand random_{7};
  int number_ = 0;
};

/// Hovers or presses until 5 s, lets go of the wall, and presses again at 6 s.
class FaultyHand final : public Device {
 public:
  FaultyHand(Motion motion, std::optional<Fault> hand, std::optional<Fault> device)
      : motion_(motion), hand_(hand), device_(device) {}
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}

  HandState read(double t) noexcept override {
    HandState state{.position = at(t)};
    if (!is_during(t)) return state;
    const bool is_odd = static_cast<int>(std::floor(t / 0.02)) % 2 != 0;
    if (hand_) {
      switch (*hand_) {
        case Fault::off:
          state.present = false;
          break;
        case Fault::stuck:
          state.position = at(fault_begins);
          break;
        case Fault::garbage:
          state.position = is_odd ? Vec3::Constant(nan) : Vec3::Constant(1e12);
          break;
        case Fault::wrong:  // jumps 0.1 m to and fro
          state.position.x() += is_odd ? 0.1 : 0.0;
          break;
        case Fault::delayed:
          state.position = at(t - 0.2);
          break;
        case Fault::intermittent:
          state.present = is_odd;
          break;
      }
    }
    if (device_) {
      const bool is_bad = *device_ != Fault::intermittent || is_odd;
      if (is_bad)
        state.fault = *device_ == Fault::off ? DeviceFault::disconnected : DeviceFault::other;
      if (*device_ == Fault::garbage) {
        state.velocity = Vec3::Constant(nan);
        state.orientation = Eigen::Quaterniond(nan, 0.0, nan, 1e300);
        state.stamp = -nan;
        state.buttons = ~0U;
        state.position = Vec3::Constant(-nan);
      }
    }
    return state;
  }

 private:
  [[nodiscard]] Vec3 at(double t) const {
    const auto ramp = [&](double begin) { return std::clamp((t - begin) / 0.1, 0.0, 1.0); };
    double pressed = ramp(back_again);
    if (motion_ == Motion::contact) pressed += ramp(1.0) - ramp(lift_off);
    return {0.0, 0.0, wall_depth - 0.05 + 0.055 * pressed};
  }

  Motion motion_;
  std::optional<Fault> hand_, device_;
  DeviceInfo info_{.uri = "faulty:", .kind = "faulty", .limits = no_motors};
};

/// Does the chain have to take the force off altogether?
bool ends_the_force(Fault fault, Place place) {
  if (fault == Fault::wrong) return place == Place::device;
  if (place == Place::hand) return fault != Fault::stuck && fault != Fault::delayed;
  return true;
}

using Cell = std::tuple<Fault, Place, Motion>;

std::string name_of_cell(const testing::TestParamInfo<Cell>& info) {
  constexpr std::array faults = {"Off", "Stuck", "Garbage", "Wrong", "Delayed", "Intermittent"};
  constexpr std::array places = {"FirstCamera", "SecondCamera", "Hand", "Device"};
  constexpr std::array motions = {"Free", "Contact"};
  const auto index = [](auto value) { return static_cast<std::size_t>(value); };
  return std::string(faults[index(std::get<0>(info.param))]) +
         places[index(std::get<1>(info.param))] + motions[index(std::get<2>(info.param))];
}

class SessionFaults : public testing::TestWithParam<Cell> {};

TEST_P(SessionFaults, TakeTheForceOffAndGiveItBack) {
  const auto fault = std::get<0>(GetParam());
  const auto place = std::get<1>(GetParam());
  const auto motion = std::get<2>(GetParam());
  const auto fault_of = [fault, place](Place here) {
    return place == here ? std::optional(fault) : std::nullopt;
  };
  std::array<std::shared_ptr<std::vector<double>>, 2> good;
  SessionOptions options;
  for (std::size_t i = 0; i < good.size(); ++i) {
    good[i] = std::make_shared<std::vector<double>>();
    options.cameras.push_back(
        {.source = std::make_unique<MadeSource>(FaultyCamera(
             fault_of(i == 0 ? Place::first_camera : Place::second_camera), good[i]))});
  }
  options.device =
      std::make_unique<FaultyHand>(motion, fault_of(Place::hand), fault_of(Place::device));
  options.pace = Pace::free_running;
  const SafetyParameters limits = options.settings.safety;
  Session session(std::move(options));

  // [s] since the newest good frame of the camera that is worst off, known without the session.
  const auto age_at = [&](double t) {
    double age = 0.0;
    for (const auto& stamps : good) {
      const auto next = std::upper_bound(stamps->begin(), stamps->end(), t);
      age = std::max(age, t - *std::prev(next));
    }
    return age;
  };
  constexpr double slack = 2e-3;  // [s] two ticks
  const bool is_camera = place == Place::first_camera || place == Place::second_camera;
  const bool must_end = ends_the_force(fault, place);
  const double gone_within = is_camera ? limits.lost_age : 0.0;
  const double fall_time = limits.max_force / limits.fall_rate;

  std::vector<double> sent;
  session.run(session_ends, [&](const ServoTick& tick) {
    const double t = tick.tick.t;
    const double force = tick.force.norm();
    const double before = sent.empty() ? 0.0 : sent.back();
    sent.push_back(force);
    ASSERT_TRUE(tick.force.allFinite()) << t;
    ASSERT_LE(force, limits.max_force + 1e-9) << t;
    ASSERT_LE(force - before, 1e-3 * limits.rise_rate + 1e-9) << t;
    ASSERT_LE(before - force, 1e-3 * limits.fall_rate + 1e-9) << t;
    if (is_camera) {
      const double age = age_at(t);
      if (age > limits.late_intervals * frame_interval + slack) {
        ASSERT_LE(force, before + 1e-12)
            << t << " s: it grows while a camera is " << age << " late";
      }
      if (age > limits.lost_age + slack) {
        ASSERT_EQ(force, 0.0) << t << " s: a camera has been lost for " << age << " s";
      }
    }
    const bool is_on = is_during(t) && (fault != Fault::delayed && fault != Fault::intermittent);
    if (must_end && is_on && t > fault_begins + gone_within + fall_time + frame_interval + slack) {
      ASSERT_EQ(force, 0.0) << t;
    }
    if (fault == Fault::wrong && place == Place::hand && is_during(t) &&
        t > fault_begins + 0.02 + fall_time + slack) {  // the first jump
      ASSERT_LT(force, 0.05) << t << " s: between two jumps, which are too fast for a hand";
    }
    if (t >= lift_off + 0.2 && t < lift_off + 0.201) session.reset_faults();
  });

  ASSERT_EQ(sent.size(), static_cast<std::size_t>(1000.0 * session_ends));
  const auto at = [&](double t) { return sent[static_cast<std::size_t>(1000.0 * t)]; };
  if (motion == Motion::contact) {
    EXPECT_GT(at(fault_begins - 0.001), 2.0);
  } else {
    EXPECT_EQ(*std::max_element(sent.begin(), sent.begin() + 6000), 0.0);
  }
  // Once the force was gone in contact it does not come back while the hand presses.
  if (must_end && motion == Motion::contact) {
    EXPECT_EQ(at(fault_ends - 0.001), 0.0);
  }
  EXPECT_GT(sent.back(), 2.0) << "all is well again";
}

INSTANTIATE_TEST_SUITE_P(Matrix, SessionFaults,
                         testing::Combine(testing::Values(Fault::off, Fault::stuck, Fault::garbage,
                                                          Fault::wrong, Fault::delayed,
                                                          Fault::intermittent),
                                          testing::Values(Place::first_camera, Place::second_camera,
                                                          Place::hand, Place::device),
                                          testing::Values(Motion::free, Motion::contact)),
                         name_of_cell);

}  // namespace
}  // namespace palpate
