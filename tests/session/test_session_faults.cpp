// SPDX-License-Identifier: Apache-2.0
// A fault matrix: whatever fails, in free motion, in contact or on a moving surface, the force is
// gone within the documented age, never grows while a camera is late, comes back when all is well
// again, and the ticks say why. Then two faults at a time, drawn by chance.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <fstream>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <random>
#include <set>
#include <sstream>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/devices/device_guard.hpp"
#include "palpate/io/devices/mouse_device.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/servo/force_watchdog.hpp"
#include "palpate/session/session.hpp"

#include "tests/session/fakes.hpp"
#include "tests/support/sanitized.hpp"

namespace palpate {
namespace test_session_faults {

using test::MadeSource;
using test::wall;
using test::wall_depth;

enum class Fault { off, stuck, garbage, wrong, slow, delayed, intermittent };
enum class Place { first_camera, second_camera, hand, device, method, other_hand };
enum class Motion { free, contact, moving };

constexpr std::array fault_names = {"Off",  "Stuck",   "Garbage",     "Wrong",
                                    "Slow", "Delayed", "Intermittent"};
constexpr std::array place_names = {"FirstCamera", "SecondCamera", "Hand",
                                    "Device",      "Method",       "OtherHand"};
constexpr std::array motion_names = {"Free", "Contact", "Moving"};

const std::vector<Motion> motions =
    test::sanitized ? std::vector{Motion::moving}
                    : std::vector{Motion::free, Motion::contact, Motion::moving};

template <class Enum>
constexpr std::size_t index_of(Enum value) {
  return static_cast<std::size_t>(value);
}

constexpr double touch_down = 1.0, lift_off = 5.0, back_again = 6.0;  // [s] of the hand
constexpr double session_ends = 8.5;                                  // [s]
constexpr double reset_at = lift_off + 0.2;                           // [s] of latched faults
constexpr double frame_interval = 1.0 / 30.0;                         // [s]
constexpr double delay = 0.2;                                         // [s] of what is delayed
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double inf = std::numeric_limits<double>::infinity();

struct Failure {
  Fault fault = Fault::off;
  Place place = Place::first_camera;
  double begins = 3.0, ends = 4.5;  // [s]

  [[nodiscard]] bool is_on(double t) const { return t >= begins && t < ends; }
};

struct Scenario {
  Motion motion = Motion::contact;
  std::vector<Failure> failures;
};

std::string text_of(const Scenario& scenario) {
  std::ostringstream text;
  text << motion_names[index_of(scenario.motion)];
  for (const Failure& failure : scenario.failures) {
    text << ", " << place_names[index_of(failure.place)] << " "
         << fault_names[index_of(failure.fault)] << " from " << failure.begins << " to "
         << failure.ends << " s";
  }
  return text.str();
}

std::vector<Failure> failures_of(const Scenario& scenario, Place place) {
  std::vector<Failure> failures = scenario.failures;
  std::erase_if(failures, [=](const Failure& failure) { return failure.place != place; });
  return failures;
}

const Failure* failure_at(const std::vector<Failure>& failures, double t) {
  for (const Failure& failure : failures) {
    if (failure.is_on(t)) return &failure;
  }
  return nullptr;
}

// [m] by which the surface and the hand are farther away than at the start.
double moved_at(Motion motion, double t) {
  return motion == Motion::moving ? 0.004 * std::sin(std::numbers::pi * t) : 0.0;
}

std::shared_ptr<const DepthImage> wall_at(Motion motion, double t) {
  return wall(static_cast<std::uint16_t>(std::lround(500.0 + 1e3 * moved_at(motion, t))));
}

/// The wall at 30 Hz, with faults; notes the stamps of its good frames.
class FaultyCamera {
 public:
  FaultyCamera(Motion motion, std::vector<Failure> failures,
               std::shared_ptr<std::vector<double>> good)
      : motion_(motion), failures_(std::move(failures)), good_(std::move(good)) {}

  std::optional<Frame> operator()(int /*k*/) {
    for (;;) {
      const double stamp = frame_interval * number_++;
      const Failure* failure = failure_at(failures_, stamp);
      if (failure == nullptr) return make(stamp, stamp);
      switch (failure->fault) {
        case Fault::off:
          continue;
        case Fault::slow:  // a frame in 0.6 s
          if (number_ % 18 != 0) continue;
          return make(stamp, stamp);
        case Fault::intermittent:
          if (std::fmod(stamp - failure->begins, 0.8) < 0.6) continue;
          return make(stamp, stamp);
        case Fault::stuck:  // the same capture again and again
          return Frame{good_->back(), wall_at(motion_, good_->back())};
        case Fault::garbage: {
          const std::array<double, 3> stamps = {nan, -inf, good_->back() - 0.5};
          return Frame{stamps[static_cast<std::size_t>(number_) % 3], noise()};
        }
        case Fault::wrong:  // good stamps, a picture of anything
          good_->push_back(stamp);
          return Frame{stamp, noise()};
        case Fault::delayed:  // an older picture than its stamp says
          return make(stamp, stamp - delay);
      }
    }
  }

 private:
  Frame make(double stamp, double captured) {
    good_->push_back(stamp);
    return {stamp, wall_at(motion_, captured)};
  }
  std::shared_ptr<const Cloud> noise() {
    const auto seen = wall();
    const DepthImage& image = *seen;
    std::vector<std::uint16_t> depth = image.depth().copy();
    for (std::uint16_t& value : depth) value = static_cast<std::uint16_t>(random_());
    return std::make_shared<DepthImage>(std::make_shared<ViewingRays>(image.intrinsics()), depth,
                                        1000.0);
  }

  Motion motion_;
  std::vector<Failure> failures_;
  std::shared_ptr<std::vector<double>> good_;
  std::minstd_rand random_{7};
  int number_ = 0;
};

bool is_odd(double t) { return static_cast<int>(std::floor(t / 0.02)) % 2 != 0; }

constexpr double max_torque = 0.1;  // [N m]

/// Hovers or presses until 5 s, lets go of the wall, and presses again at 6 s.
class FaultyHand final : public Device {
 public:
  FaultyHand(Motion motion, std::vector<Failure> hand, std::vector<Failure> device)
      : motion_(motion), hand_(std::move(hand)), device_(std::move(device)) {}
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}

  HandState read(double t) noexcept override {
    HandState state{.position = at(t)};
    if (const Failure* failure = failure_at(hand_, t)) fail(*failure, t, state);
    if (const Failure* failure = failure_at(device_, t)) {
      const bool is_bad = failure->fault == Fault::intermittent ? is_odd(t) : true;
      if (is_bad) {
        state.fault = failure->fault == Fault::off ? DeviceFault::disconnected : DeviceFault::other;
      }
      if (failure->fault == Fault::garbage) {
        state.orientation = Eigen::Quaterniond(nan, 0.0, nan, 1e300);
        state.buttons = ~0U;
        state.position = Vec3::Constant(-nan);
      }
    }
    return state;
  }

 private:
  void fail(const Failure& failure, double t, HandState& state) const {
    switch (failure.fault) {
      case Fault::off:
        state.present = false;
        break;
      case Fault::stuck:
        state.position = at(failure.begins);
        break;
      case Fault::garbage:
        state.position = is_odd(t) ? Vec3::Constant(nan) : Vec3::Constant(1e12);
        break;
      case Fault::wrong:  // jumps 0.1 m to and fro
        state.position.x() += is_odd(t) ? 0.1 : 0.0;
        break;
      case Fault::slow:  // is read anew at 50 Hz only
        state.position = at(0.02 * std::floor(t / 0.02));
        break;
      case Fault::delayed:
        state.position = at(t - delay);
        break;
      case Fault::intermittent:
        state.present = is_odd(t);
        break;
    }
  }
  [[nodiscard]] Vec3 at(double t) const {
    const auto ramp = [&](double begin) { return std::clamp((t - begin) / 0.1, 0.0, 1.0); };
    double pressed = ramp(back_again);
    if (motion_ != Motion::free) pressed += ramp(touch_down) - ramp(lift_off);
    return {0.0, 0.0, wall_depth - 0.05 + 0.055 * pressed + moved_at(motion_, t)};
  }

  Motion motion_;
  std::vector<Failure> hand_, device_;
  DeviceInfo info_{.uri = "faulty:",
                   .kind = "faulty",
                   .limits = {.max_force = no_motors.max_force,
                              .continuous_force = no_motors.continuous_force,
                              .motors = false,
                              .max_torque = max_torque}};
};

/// The default method with a torque, as of a tool, and with faults in what it returns.
class FaultyMethod final : public Method {
 public:
  FaultyMethod(const Parameters& parameters, std::vector<Failure> failures)
      : method_(make_method(default_method, parameters)), failures_(std::move(failures)) {}
  void seat(const Vec3& proxy) noexcept override { method_->seat(proxy); }
  void observe(const Observation& seen) noexcept override { method_->observe(seen); }
  void set_parameters(const Parameters& parameters) noexcept override {
    method_->set_parameters(parameters);
  }

  Tick tick(const Vec3& hip, double t) noexcept override {
    Tick good = method_->tick(hip, t);
    good.torque = 0.02 * Vec3(good.force.z(), good.force.x(), good.force.y());
    past_.push_back(good);
    if (past_.size() > 200) past_.pop_front();
    const Failure* failure = failure_at(failures_, t);
    if (failure == nullptr) {
      held_ = good;
      return good;
    }
    Tick bad = good;
    switch (failure->fault) {
      case Fault::off:
        return free_tick(hip, t, good.frame);
      case Fault::stuck:
        bad = held_;
        break;
      case Fault::garbage:
        spoil(bad);
        break;
      case Fault::wrong:  // through the surface
        bad.force = -good.force;
        bad.torque = -good.torque;
        bad.normal = -good.normal;
        break;
      case Fault::slow:  // a new force in 50 ms
        if (std::fmod(t - failure->begins, 0.05) < 1e-3) held_ = good;
        bad = held_;
        break;
      case Fault::delayed:
        bad = past_.front();
        break;
      case Fault::intermittent:
        if (is_odd(t)) spoil(bad);
        break;
    }
    bad.t = t;
    bad.hip = hip;
    return bad;
  }

 private:
  void spoil(Tick& tick) noexcept {
    constexpr std::array values = {nan, inf, -1e300, 1e300};
    const double value = values[++spoiled_ % values.size()];
    (spoiled_ % 2 == 0 ? tick.torque : tick.force) = Vec3(value, 1.0, value);
    tick.normal = tick.proxy = Vec3::Constant(value);
    tick.surface_velocity = value;
  }

  std::unique_ptr<Method> method_;
  std::vector<Failure> failures_;
  std::deque<Tick> past_;
  Tick held_;
  std::size_t spoiled_ = 0;
};

bool is_camera(Place place) {
  return place == Place::first_camera || place == Place::second_camera;
}

/// Does the chain have to take the force off altogether?
bool ends_the_force(const Failure& failure) {
  const Fault fault = failure.fault;
  switch (failure.place) {
    case Place::first_camera:
    case Place::second_camera:
      return fault != Fault::wrong && fault != Fault::delayed;
    case Place::hand:
      return fault == Fault::off || fault == Fault::garbage || fault == Fault::intermittent;
    case Place::device:
    case Place::other_hand:
      return true;
    case Place::method:
      return fault == Fault::off || fault == Fault::garbage || fault == Fault::wrong ||
             fault == Fault::intermittent;
  }
  return true;
}

/// All the time? Else there is a force now and then.
bool ends_the_force_throughout(const Failure& failure) {
  if (!ends_the_force(failure) || failure.fault == Fault::intermittent) return false;
  return !is_camera(failure.place) || failure.fault != Fault::slow;
}

/// Of these flags a tick has to raise at least one, to tell people why there is no force.
std::uint32_t flags_that_tell(Place place) {
  switch (place) {
    case Place::first_camera:
    case Place::second_camera:
      return std::uint32_t{frame_lost} | frame_fading;
    case Place::hand:
      return std::uint32_t{disengaged} | input_refused | fault_latched;
    case Place::device:
      return std::uint32_t{disengaged} | input_refused | fault_latched;
    case Place::method:
      return std::uint32_t{input_refused} | direction_refused | fault_latched;
    case Place::other_hand:
      return disengaged;
  }
  return 0;
}

/// The steps of a force in tests/gate/stop.pml, in tenths of the limit: see servo() there.
struct StopModel {
  enum Cause { none, hand_lost, disengaged_only, latched, frames_stale, number_fails };
  static Cause cause_of(const ServoTick& tick) {
    if ((tick.safety & (input_refused | direction_refused)) != 0) return number_fails;
    if ((tick.safety & fault_latched) != 0) return latched;
    if ((tick.safety & frame_lost) != 0) return frames_stale;
    if ((tick.hand & hand_present) == 0 || (tick.hand & hand_fault) != 0) return hand_lost;
    return (tick.safety & disengaged) != 0 ? disengaged_only : none;
  }
  static int tenths(double share) { return static_cast<int>(std::ceil(10.0 * share - 1e-6)); }
  static int most_after(Cause cause, int sent) {
    return cause == none ? 10 : std::max(sent - 1, 0);
  }

  std::set<std::pair<Cause, bool>> seen;  // what began with a force, or without
};

/// Runs a session and says which promise was broken first, and when; empty: none.
std::string violation_of(const Scenario& scenario, StopModel* model = nullptr) {
  std::array<std::shared_ptr<std::vector<double>>, 2> good;
  SessionOptions options;
  for (std::size_t i = 0; i < good.size(); ++i) {
    good[i] = std::make_shared<std::vector<double>>();
    const Place place = i == 0 ? Place::first_camera : Place::second_camera;
    options.open_cameras.push_back(std::make_unique<MadeSource>(
        FaultyCamera(scenario.motion, failures_of(scenario, place), good[i])));
  }
  options.open_devices[0] = std::make_unique<FaultyHand>(
      scenario.motion, failures_of(scenario, Place::hand), failures_of(scenario, Place::device));
  if (const auto of_other = failures_of(scenario, Place::other_hand); !of_other.empty()) {
    options.open_devices.push_back(
        std::make_unique<FaultyHand>(scenario.motion, std::vector<Failure>{}, of_other));
    options.hands.resize(2);
  }
  options.methods.add(
      {.name = "faulty", .summary = "", .make = [&scenario](const Parameters& parameters) {
         return std::make_unique<FaultyMethod>(parameters, failures_of(scenario, Place::method));
       }});
  options.method = "faulty";
  options.pace = Pace::free_running;
  const SafetyParameters limits = options.safety;
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
  const double fall_time = limits.max_force / limits.fall_rate;
  const bool has_faulty_camera =
      std::any_of(scenario.failures.begin(), scenario.failures.end(),
                  [](const Failure& failure) { return is_camera(failure.place); });
  const bool is_one = scenario.failures.size() == 1;

  std::string violation;
  std::vector<double> sent;
  std::vector<std::uint32_t> told(scenario.failures.size());  // SafetyFlag bits during each
  std::uint32_t telling = 0;  // those of which one is enough: a fault may hide another
  for (const Failure& failure : scenario.failures) telling |= flags_that_tell(failure.place);
  double before = 0.0, torque_before = 0.0;
  const double lever = max_torque / limits.max_force;  // [m]
  session.run(session_ends, [&](const ServoTick& tick) {
    const double t = tick.tick.t;
    const double force = tick.force.norm();
    const auto demand = [&](bool promise, const std::string& text) {
      if (promise || !violation.empty()) return;
      std::ostringstream what;
      what << "at " << t << " s, " << before << " N, then " << force << " N: " << text;
      violation = what.str();
    };
    demand(tick.force.allFinite(), "it is not finite");
    demand(force <= limits.max_force + 1e-9, "it is larger than the limit");
    demand(force - before <= 1e-3 * limits.rise_rate + 1e-9, "it rises too fast");
    demand(before - force <= 1e-3 * limits.fall_rate + 1e-9, "it falls too fast");
    const double torque = tick.torque.norm();
    demand(tick.torque.allFinite() && torque <= max_torque + 1e-9, "its torque is too large");
    demand(torque - torque_before <= 1e-3 * lever * limits.rise_rate + 1e-9,
           "its torque rises too fast");
    demand(force > 0.0 || torque <= std::max(torque_before - 0.5 * max_torque, 0.0) + 1e-9,
           "its torque stays without a force");
    torque_before = torque;
    const StopModel::Cause cause = StopModel::cause_of(tick);
    const int sent_before = StopModel::tenths(before / limits.max_force);
    demand(StopModel::tenths(force / limits.max_force) <= StopModel::most_after(cause, sent_before),
           "tests/gate/stop.pml has no such step");
    if (model != nullptr) model->seen.insert({cause, before > 0.0});
    if (has_faulty_camera) {
      const double age = age_at(t);
      const double late_age = limits.late_intervals * frame_interval + slack;
      demand(age <= late_age || force <= before + 1e-12, "it grows while a camera is late");
      demand(age <= limits.lost_age + slack || force == 0.0, "a camera is lost");
    }
    for (std::size_t i = 0; i < scenario.failures.size(); ++i) {
      const Failure& failure = scenario.failures[i];
      if (!failure.is_on(t)) continue;
      told[i] |= tick.safety;
      const double gone_within = is_camera(failure.place) ? limits.lost_age + frame_interval : 0.0;
      if (ends_the_force_throughout(failure)) {
        demand(t <= failure.begins + gone_within + fall_time + slack || force == 0.0,
               "the fault has lasted for too long");
      }
      if (failure.place == Place::device && tick.safety != 0)
        demand(failure.fault == Fault::intermittent || (tick.hand & hand_fault) != 0,
               "the device's fault is not told");
      if (is_one && failure.fault == Fault::wrong && failure.place == Place::hand &&
          t > failure.begins + 0.02 + fall_time + slack) {  // the first jump
        demand(force < 0.05, "between two jumps, which are too fast for a hand");
      }
    }
    if (t >= reset_at && t < reset_at + 1e-3) session.reset_faults();
    sent.push_back(force);
    before = force;
  });

  const auto at = [&](double t) { return sent.at(static_cast<std::size_t>(1000.0 * t)); };
  const auto expect = [&](bool promise, const char* text) {
    if (!promise && violation.empty()) violation = text;
  };
  expect(sent.size() == static_cast<std::size_t>(1000.0 * session_ends), "ticks are missing");
  for (std::size_t i = 0; i < scenario.failures.size(); ++i) {
    const Failure& failure = scenario.failures[i];
    // A method that asks for no force is no fault that anything could tell.
    const bool is_silent = failure.place == Place::method && failure.fault == Fault::off;
    // A force of nothing has no direction.
    const bool is_idle = failure.place == Place::method && failure.fault == Fault::wrong &&
                         scenario.motion == Motion::free;
    if (ends_the_force(failure) && !is_silent && !is_idle &&
        failure.ends - failure.begins > limits.lost_age) {
      expect((told[i] & telling) != 0, "nobody is told why");
    }
  }
  if (scenario.motion == Motion::free) {
    if (is_one) {
      expect(*std::max_element(sent.begin(), sent.begin() + 6000) == 0.0, "there is nothing there");
    }
  } else if (is_one) {
    const Failure& failure = scenario.failures.front();
    expect(at(failure.begins - 0.001) > 2.0, "there was no contact");
    // Once the force was gone in contact it does not come back while the hand presses.
    const bool is_interrupted = failure.place == Place::method && failure.fault == Fault::off;
    if (ends_the_force(failure) && !is_interrupted)
      expect(at(failure.ends - 0.001) == 0.0, "it came back while the hand pressed");
  }
  expect(sent.back() > 2.0, "it does not come back when all is well again");
  return violation;
}

// Every cell of the matrix below is held to it, too.
// Hazard: chain-wrong
TEST(StopModel, HasEveryStepOfSessionsWithFaults) {
  StopModel model;
  for (const auto& [fault, place] :
       {std::pair(Fault::off, Place::hand), std::pair(Fault::off, Place::device),
        std::pair(Fault::off, Place::first_camera), std::pair(Fault::garbage, Place::method),
        std::pair(Fault::intermittent, Place::hand), std::pair(Fault::intermittent, Place::method)})
    EXPECT_EQ(violation_of({Motion::contact, {{.fault = fault, .place = place}}}, &model), "");
  using enum StopModel::Cause;
  for (const auto cause : {none, hand_lost, frames_stale, number_fails})
    EXPECT_TRUE(model.seen.contains({cause, true})) << cause << ": never with a force";
  for (const auto cause : {none, hand_lost, disengaged_only, latched, frames_stale, number_fails})
    EXPECT_TRUE(model.seen.contains({cause, false})) << cause << ": never without a force";
}

TEST(StopModel, HasTheTimesOfTheCode) {
  std::ifstream file(PALPATE_STOP_MODEL);
  std::map<std::string, double> ms;
  for (std::string line, word, name; std::getline(file, line);) {
    std::istringstream words(line);
    if (double value = 0.0; words >> word >> name >> value && word == "#define") ms[name] = value;
  }
  EXPECT_EQ(ms["FORCE_TIME"], 1e3 * ForceWatchdog::Limits().force_time);
  EXPECT_EQ(ms["WATCH_TIME"], 1e3 * ForceWatchdog::Limits().watch_time);
  EXPECT_EQ(ms["BEAT_TIME"], 1e3 * GuardLimits().beat_time);
  EXPECT_EQ(ms["LATE"], 1e3 * SafetyParameters().stall_time);
}

using Cell = std::tuple<Fault, Place, Motion>;

std::string name_of_cell(const testing::TestParamInfo<Cell>& info) {
  return std::string(fault_names[index_of(std::get<0>(info.param))]) +
         place_names[index_of(std::get<1>(info.param))] +
         motion_names[index_of(std::get<2>(info.param))];
}

class SessionFaults : public testing::TestWithParam<Cell> {};

// Hazard: lost-camera, nobody-holds, not-a-number, torque, another-hand
TEST_P(SessionFaults, TakeTheForceOffAndGiveItBack) {
  const Scenario scenario{std::get<2>(GetParam()),
                          {{.fault = std::get<0>(GetParam()), .place = std::get<1>(GetParam())}}};
  EXPECT_EQ(violation_of(scenario), "");
}

INSTANTIATE_TEST_SUITE_P(
    Matrix, SessionFaults,
    testing::Combine(testing::Values(Fault::off, Fault::stuck, Fault::garbage, Fault::wrong,
                                     Fault::slow, Fault::delayed, Fault::intermittent),
                     testing::Values(Place::first_camera, Place::second_camera, Place::hand,
                                     Place::device, Place::method, Place::other_hand),
                     testing::ValuesIn(motions)),
    name_of_cell);

/// A page leads the hand, 20 times a second. A page that falls silent and a server whose thread
/// hangs are the same to the session: no word comes.
class FaultyPage final : public Device {
 public:
  FaultyPage(Fault fault, std::shared_ptr<double> heard)
      : fault_(fault), heard_(std::move(heard)) {}
  [[nodiscard]] const DeviceInfo& info() const override { return mouse_.info(); }
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}
  HandState read(double t) noexcept override {
    if (t >= next_) speak(t);
    return mouse_.read(t);
  }

 private:
  void speak(double t) noexcept {
    const double interval = Failure{}.is_on(t) && fault_ == Fault::slow ? 0.8 : 0.05;
    next_ = t + interval;
    const double pressed = t >= back_again || (t >= touch_down && t < lift_off) ? 0.055 : 0.0;
    MouseTarget target{.position = {0.0, 0.0, wall_depth - 0.05 + pressed}, .present = true};
    if (Failure{}.is_on(t)) {
      if (fault_ == Fault::off) return;
      if (fault_ == Fault::intermittent && std::fmod(t, 1.0) < 0.8) return;
      if (fault_ == Fault::garbage) target.position.x() = is_odd(t) ? nan : 1e9;
    }
    try {
      mouse_.aim(target);
      *heard_ = t;
    } catch (const Error&) {  // refused
    }
  }

  Fault fault_;
  std::shared_ptr<double> heard_;  // [s] when a word came that was understood
  double next_ = 0.0;              // [s]
  MouseDevice mouse_{{0.0, 0.0, wall_depth - 0.05}};
};

// Hazard: silent-page
TEST(SessionFaults, TakeTheForceOfAPageAwayThatFallsSilent) {
  constexpr double silence = 0.5;  // [s] as docs/devices.md has it
  for (const Fault fault : {Fault::off, Fault::garbage, Fault::slow, Fault::intermittent}) {
    SCOPED_TRACE(fault_names[index_of(fault)]);
    const auto heard = std::make_shared<double>(0.0);
    SessionOptions options;
    options.open_cameras.push_back(test::wall_source());
    options.open_devices[0] = std::make_unique<FaultyPage>(fault, heard);
    options.safety.initial_heat = 0.0;
    options.pace = Pace::free_running;
    const double fall_time = options.safety.max_force / options.safety.fall_rate;
    Session session(std::move(options));
    std::vector<double> sent;
    std::uint32_t told = 0;
    double late = 0.0;  // [N] largest force although nothing was heard for too long
    session.run(session_ends, [&](const ServoTick& tick) {
      const double silent = tick.tick.t - *heard;
      sent.push_back(tick.force.norm());
      if (Failure{}.is_on(tick.tick.t)) told |= tick.safety;
      if (silent > silence + fall_time + 2e-3) late = std::max(late, sent.back());
    });
    EXPECT_EQ(late, 0.0);
    EXPECT_TRUE(told & disengaged);
    EXPECT_GT(sent.at(2990), 2.0) << "before the fault";
    EXPECT_EQ(sent.at(4900), 0.0) << "the hand has to let go first";
    EXPECT_GT(sent.back(), 2.0) << "all is well again";
  }
}

// Hazard: lost-camera, nobody-holds, not-a-number
TEST(SessionFaultsByChance, TwoAtATimeBreakNoPromise) {
  std::mt19937 random(2026);
  const auto draw = [&](std::size_t n) {
    return std::uniform_int_distribution<std::size_t>(0, n - 1)(random);
  };
  const auto draw_time = [&](double low, double high) {
    return 0.01 * std::round(100.0 * std::uniform_real_distribution<double>(low, high)(random));
  };
  constexpr int scenarios = test::sanitized ? 4 : 40;
  for (int k = 0; k < scenarios; ++k) {
    Scenario scenario{static_cast<Motion>(draw(motion_names.size())), {}};
    for (int i = 0; i < 2; ++i) {
      const double begins = draw_time(2.8, 3.8);
      scenario.failures.push_back({.fault = static_cast<Fault>(draw(fault_names.size())),
                                   .place = static_cast<Place>(draw(place_names.size())),
                                   .begins = begins,
                                   .ends = begins + draw_time(0.05, 1.0)});
    }
    EXPECT_EQ(violation_of(scenario), "") << text_of(scenario);
  }
}

}  // namespace test_session_faults
}  // namespace palpate
