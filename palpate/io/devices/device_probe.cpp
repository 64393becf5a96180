// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/devices/device_probe.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <memory>
#include <thread>
#include <utility>

#include "palpate/io/devices/device_body.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/method.hpp"
#include "palpate/kernel/core/pose.hpp"
#include "palpate/servo/servo_loop.hpp"

namespace palpate {
namespace {

constexpr double most_force = 0.45;   // [N] below half a newton, whatever is asked for
constexpr double rest_time = 1.0;     // [s] without a force, first
constexpr double settle_time = 0.6;   // [s] back to the start before each stretch
constexpr double hold_spring = 40.0;  // [N/m] keeps the handle where it began: far below any limit
constexpr double half_way = 8e-3;     // [m] to both sides of the start
constexpr double stuck_time = 1.0;    // [s] one way: it does not move
constexpr int swings = 14;            // a stretch
constexpr double ready_time = 5.0;    // [s] until the device gives forces
constexpr double frame_time = 10e-3;  // [s] between two signs of life of the measuring thread
constexpr double pause_time = 0.1;    // [s] without one: the force fades
constexpr std::size_t window = 8;     // ticks of which the speed is the mean
// A force, and where it turns. Several speeds tell friction from damping; a force that is weaker
// for a part of each way tells mass and delay.
struct Level {
  double force;  // [-] of the largest
  double speed;  // [m/s]
  double weak;   // [-] of the force, for every other `weak_time`
};
constexpr std::array levels = {Level{1.0, 0.2, 1.0}, Level{1.0, 0.2, 0.7}, Level{0.8, 0.1, 1.0}};
constexpr double weak_time = 15e-3;  // [s]

// There is nothing to touch: a frame only says that the measuring thread is alive.
class NoPoints final : public Cloud {
 public:
  void gather(const Ball& /*ball*/, std::size_t /*most*/,
              Patch& /*patch*/) const noexcept override {}
  void gather(const Beam& /*beam*/, std::size_t /*most*/,
              Patch& /*patch*/) const noexcept override {}
};

enum class End : int { none, done, too_far, too_fast, too_long, not_finite };

// The force by which the handle is moved, as a method of the servo loop.
class Exciter final : public Method {
 public:
  explicit Exciter(const ProbeOptions& options) : options_(options) {}

  void seat(const Vec3& /*proxy*/) noexcept override {}
  void observe(const Observation& /*seen*/) noexcept override {}
  void set_parameters(const Parameters& /*parameters*/) noexcept override {}

  // [servo]
  Tick tick(const Vec3& hip, double t) noexcept override {
    Tick tick{.t = t, .hip = hip, .proxy = hip};
    if (!begun_.load(std::memory_order_relaxed)) return tick;
    if (!started_) begin(hip, t);
    watch(hip, t);
    if (end() != End::none) return tick;
    Vec3 force = excite(hip, t);
    if (end() != End::none) return tick;
    if (const double size = force.norm(); size > options_.force) force *= options_.force / size;
    constexpr double lever = 0.01;  // [m] shows the chain which way the force acts
    if (const double size = force.norm(); size > 0.0) tick.proxy = hip + lever / size * force;
    tick.force = force;
    return tick;
  }

  void allow() noexcept { begun_.store(true, std::memory_order_relaxed); }
  // Ends it: no force from the next tick on.
  void stop() noexcept { finish(End::done); }
  [[nodiscard]] End end() const noexcept { return end_.load(std::memory_order_relaxed); }

 private:
  void begin(const Vec3& hip, double t) noexcept {
    started_ = true;
    start_ = hip;
    began_ = stretch_began_ = t;
    places_.fill(hip);
    times_.fill(t);
  }

  void finish(End end) noexcept {
    End none = End::none;
    end_.compare_exchange_strong(none, end, std::memory_order_relaxed);
  }

  void watch(const Vec3& hip, double t) noexcept {
    const Vec3 before = places_[next_];
    const double since = t - times_[next_];
    places_[next_] = hip;
    times_[next_] = t;
    next_ = (next_ + 1) % window;
    velocity_ = since > 0.0 ? Vec3((hip - before) / since) : Vec3(Vec3::Zero());
    if (!hip.allFinite()) finish(End::not_finite);
    if (!((hip - start_).norm() <= options_.travel)) finish(End::too_far);
    if (!(velocity_.norm() <= options_.top_speed)) finish(End::too_fast);
    if (!(t - began_ <= options_.time)) finish(End::too_long);
  }

  // Rest, then for each axis and level: back to the start, and back and forth.
  Vec3 excite(const Vec3& hip, double t) noexcept {
    const double since = t - stretch_began_;
    if (stretch_ == 0) {
      if (since < rest_time) return Vec3::Zero();
      next_stretch(t);
    }
    Vec3 hold = -hold_spring * (hip - start_);
    const int number = stretch_ - 1;
    const int axis = number / static_cast<int>(levels.size());
    if (t - stretch_began_ < settle_time) return hold;
    if (!swinging_) {
      swinging_ = true;
      swing_began_ = t;
    }
    const Level& level = levels[static_cast<std::size_t>(number) % levels.size()];
    const double x = hip[axis] - start_[axis];
    const double v = velocity_[axis];
    // A turn at once after a turn would be noise of the velocity.
    constexpr double shortest = 12e-3;  // [s]
    const bool turns = x * side_ > half_way || v * side_ > level.speed;
    if (turns && t - swing_began_ > shortest) {
      side_ = -side_;
      swing_began_ = t;
      ++swings_;
    }
    if (swings_ >= swings || t - swing_began_ > stuck_time) {
      // What the largest force does not move, weaker ones do not either.
      if (swings_ == 0)
        stretch_ += static_cast<int>(levels.size()) - 1 - number % static_cast<int>(levels.size());
      next_stretch(t);
      return end() == End::none ? hold : Vec3(Vec3::Zero());
    }
    Vec3 force = hold;
    force[axis] = 0.0;
    // What holds the other axes is small beside what moves this one.
    const bool weak = std::fmod(t - swing_began_, 2.0 * weak_time) > weak_time;
    const double push = level.force * options_.force * (weak ? level.weak : 1.0);
    const double most_hold = 0.6 * push;  // across: the weight, if it has to be held
    if (const double size = force.norm(); size > most_hold) force *= most_hold / size;
    force[axis] = side_ * std::sqrt(push * push - force.squaredNorm());
    return force;
  }

  void next_stretch(double t) noexcept {
    ++stretch_;
    stretch_began_ = t;
    swinging_ = false;
    swings_ = 0;
    side_ = 1.0;
    if (stretch_ > 3 * static_cast<int>(levels.size())) finish(End::done);
  }

  ProbeOptions options_;
  std::atomic<bool> begun_{false};
  std::atomic<End> end_{End::none};
  // The servo's.
  bool started_ = false;
  Vec3 start_ = Vec3::Zero();
  double began_ = 0.0;
  int stretch_ = 0;  // 0: rest; then axis by axis, level by level
  double stretch_began_ = 0.0;
  bool swinging_ = false;
  double swing_began_ = 0.0;
  int swings_ = 0;
  double side_ = 1.0;
  std::array<Vec3, window> places_{};
  std::array<double, window> times_{};
  std::size_t next_ = 0;
  Vec3 velocity_ = Vec3::Zero();
};

void check(const Device& device, const ProbeOptions& options) {
  const auto number = [](const char* name, double value, double min, double max) {
    if (value >= min && value <= max) return;
    throw Error(std::string("measuring a device: ") + name, shortest(value) + " is out of range",
                "give " + shortest(min) + " to " + shortest(max));
  };
  number("rate", options.rate, 500.0, 10'000.0);
  number("force", options.force, 0.01, most_force);
  number("travel", options.travel, 0.005, 0.1);
  number("top_speed", options.top_speed, 0.05, 1.5);
  number("time", options.time, 1.0, 600.0);
  const DeviceInfo& info = device.info();
  if (!info.limits.motors)
    throw Error(info.uri, "it has no motors that could move its handle",
                "give a haptic device, or a simulated one: hand:?device=touch&grip=none");
}

ServoSettings settings_of(const ProbeOptions& options) {
  ServoSettings settings;
  settings.safety.max_force = options.force;
  settings.safety.ramp_time = 0.05;
  settings.safety.max_speed = 1.5;  // the exciter ends it long before
  settings.safety.fade_age = pause_time;
  settings.safety.lost_age = 0.2;
  return settings;
}

// When the computer was too busy. A tick that takes long may be the driver's doing as well.
class Stalls {
 public:
  void add(const ServoTick& tick) {
    const double gap = tick.tick.t - std::exchange(last_tick_, tick.tick.t);
    if ((tick.safety & stalled) == 0) return;
    const bool was_woken_late = 2e-9 * tick.wake_up_ns > gap;
    keep({tick.tick.t, gap,
          was_woken_late ? "the computer was too busy: the servo loop stood still for "
                         : "the computer was too busy, or the driver too slow: a tick took "});
  }
  // The measuring thread runs again, at `now`, after `time` [s].
  void add_pause(double now, double time) {
    if (time > pause_time)
      keep({now, time, "the computer was too busy: the measurement stood still for "});
  }

  [[nodiscard]] int count() const { return count_; }
  [[nodiscard]] double longest() const { return longest_; }  // [s]
  // Did one end or forbid what ended at t? The force would have been back.
  [[nodiscard]] bool explain(double t) const { return count_ > 0 && t - last_ < memory; }
  [[nodiscard]] std::string text() const {
    return worst_.text + fixed_text(1e3 * worst_.length, 0) + " ms";
  }

 private:
  static constexpr double memory = 1.0;  // [s]
  struct Stall {
    double t;       // [s] when it ended
    double length;  // [s]
    const char* text;
  };

  void keep(const Stall& stall) {
    if (count_++ == 0 || stall.length > worst_.length || stall.t - worst_.t > memory)
      worst_ = stall;
    last_ = stall.t;
    longest_ = std::max(longest_, stall.length);
  }

  Stall worst_{0.0, 0.0, ""};  // lately
  int count_ = 0;
  double last_ = 0.0;       // [s]
  double longest_ = 0.0;    // [s]
  double last_tick_ = 0.0;  // [s]
};

// What came of the ticks so far.
class Watcher {
 public:
  Watcher(Exciter& exciter, Device& device) : exciter_(exciter), device_(device) {}

  // True while it continues.
  bool add(const ServoTick& tick) {
    constexpr std::uint32_t let_go =
        disengaged | input_refused | fault_latched | output_refused | hand_too_fast;
    stalls.add(tick);
    if (!allowed_) {
      if (tick.gain < 1.0 || (tick.safety & let_go) != 0) return true;
      allowed_ = true;
      exciter_.allow();
      return true;
    }
    samples.push_back({tick.tick.t, tick.position, tick.force});
    if (exciter_.end() != End::none) return false;
    if ((tick.safety & let_go) != 0) {
      const DeviceFault fault = fault_of(tick.hand);
      const std::string text = device_.fault_text();
      ended = fault != DeviceFault::none ? (text.empty() ? std::string(describe(fault)) : text)
                                         : "the device disengaged: it reports no hand, or the "
                                           "safety chain set the force to zero";
      if (stalls.explain(tick.tick.t)) ended = stalls.text() + ", and then " + ended;
      exciter_.stop();
      return false;
    }
    return true;
  }

  [[nodiscard]] bool allowed() const { return allowed_; }

  std::vector<HandleSample> samples;
  Stalls stalls;
  std::string ended;

 private:
  Exciter& exciter_;
  Device& device_;
  bool allowed_ = false;
};

[[noreturn]] void never_ready(Device& device, const Stalls& stalls, double now) {
  const std::string text = device.fault_text();
  if (stalls.explain(now))
    throw Error(device.info().uri,
                stalls.text() + ", and then it gives no force" + (text.empty() ? "" : ": " + text),
                "end other programs and measure again; if that does not help, check that the "
                "device is switched on and calibrated");
  throw Error(device.info().uri, "it gives no force" + (text.empty() ? "" : ": " + text),
              "check that it is switched on and calibrated, and that its force is enabled");
}

void run_simulated(Device& device, const ProbeOptions& options,
                   const std::shared_ptr<Exciter>& exciter, Watcher& watcher) {
  Cycle cycle(exciter, device, settings_of(options));
  auto reader = cycle.reader();
  const auto points = std::make_shared<NoPoints>();
  const auto frame_ticks = static_cast<std::int64_t>(std::ceil(frame_time * options.rate));
  for (std::int64_t i = 0;; ++i) {
    const double t = static_cast<double>(i) / options.rate;
    if (i % frame_ticks == 0) {
      if (options.cancelled && options.cancelled()) {
        watcher.ended = "it was cancelled";
        break;
      }
      cycle.put_frame(points, t, t);
    }
    cycle.run({.t = t});
    ServoTick tick;
    if (reader.try_pop(tick) && !watcher.add(tick)) break;
    if (!watcher.allowed() && t > ready_time) never_ready(device, watcher.stalls, t);
  }
  LastGate::write_zero(device, 0.0);
  device.disable();
}

void run_live(Device& device, const ProbeOptions& options, const std::shared_ptr<Exciter>& exciter,
              Watcher& watcher) {
  ServoLoop loop(exciter, device, settings_of(options),
                 {.rate = options.rate, .realtime = options.realtime});
  auto reader = loop.cycle().reader();
  const auto points = std::make_shared<NoPoints>();
  loop.cycle().put_frame(points, monotonic_now(), monotonic_now());
  loop.start();
  // [s] as this thread saw time pass: a computer that stands still makes no device silent
  double waited = 0.0;
  double silent = 0.0;
  double before = monotonic_now();
  for (bool goes_on = true; goes_on;) {
    std::this_thread::sleep_for(std::chrono::duration<double>(frame_time));
    const double now = monotonic_now();
    loop.cycle().put_frame(points, now, monotonic_now());
    watcher.stalls.add_pause(now, now - before);
    const double passed = std::min(now - before, pause_time);
    waited += passed;
    silent += passed;
    before = now;
    ServoTick tick;
    while (goes_on && reader.try_pop(tick)) {
      goes_on = watcher.add(tick);
      silent = 0.0;
    }
    if (!goes_on) break;
    if (options.cancelled && options.cancelled()) {
      watcher.ended = "it was cancelled";
      break;
    }
    if (silent > 1.0) {
      watcher.ended = "its loop stands still";
      break;
    }
    if (!watcher.allowed() && waited > ready_time) {
      loop.stop();
      never_ready(device, watcher.stalls, now);
    }
  }
  exciter->stop();
  loop.stop();
}

std::string text_of(End end, const ProbeOptions& options) {
  switch (end) {
    case End::none:
    case End::done:
      return {};
    case End::too_far:
      return "the handle went more than " + fixed_text(1e3 * options.travel, 0) +
             " mm away: support its weight, or start in the centre of its workspace";
    case End::too_fast:
      return "the handle became faster than " + shortest(options.top_speed) + " m/s";
    case End::too_long:
      return "it took more than " + fixed_text(options.time, 0) + " s";
    case End::not_finite:
      return "the device gave a position that is no number";
  }
  return {};
}

// Noise, resolution, rates and extremes.
void look_at_positions(const std::vector<HandleSample>& samples, DeviceMeasurement& result) {
  if (samples.size() < 2) return;
  result.start = samples.front().position;
  const double begin = samples.front().t;
  result.tick_rate =
      static_cast<double>(samples.size() - 1) / (samples.back().t - samples.front().t);
  Vec3 sum = Vec3::Zero();
  Vec3 squares = Vec3::Zero();
  double count = 0.0;
  constexpr double least_change = 1e-9;  // [m] below is rounding
  double smallest = 1.0;                 // [m]
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Vec3 from_start = samples[i].position - result.start;
    result.largest_force = std::max(result.largest_force, samples[i].force.norm());
    result.farthest = std::max(result.farthest, from_start.norm());
    if (samples[i].t - begin < rest_time) {
      sum += from_start;
      squares += from_start.cwiseAbs2();
      count += 1.0;
      result.rest_drift = std::max(result.rest_drift, from_start.norm());
    }
    if (i == 0) continue;
    for (int axis = 0; axis < 3; ++axis) {
      const double change = std::abs(samples[i].position[axis] - samples[i - 1].position[axis]);
      if (change > least_change) smallest = std::min(smallest, change);
    }
  }
  if (count > 1.0) {
    const Vec3 mean = sum / count;
    result.noise = std::sqrt(std::max((squares / count - mean.cwiseAbs2()).maxCoeff(), 0.0));
  }
  if (smallest < 1.0) result.resolution = smallest;

  // New positions, where the handle is so fast that each tick should bring one.
  double fast = 0.0;
  double fresh = 0.0;
  for (std::size_t i = window; i < samples.size(); ++i) {
    const Vec3 moved = samples[i].position - samples[i - window].position;
    constexpr double counts = 4.0;  // of the resolution, a tick
    if (moved.cwiseAbs().maxCoeff() < counts * smallest * static_cast<double>(window) ||
        moved.norm() < 1e-4)
      continue;
    fast += 1.0;
    if (samples[i].position != samples[i - 1].position) fresh += 1.0;
  }
  if (fast > 20.0) result.update_rate = result.tick_rate * fresh / fast;
}

// Is the mass known to 30 %, and the damping to 0.3 N s/m?
bool tells_mass(const AxisFit& fit) {
  constexpr double most_uncertain = 0.3;  // [-]
  constexpr double most_undamped = 0.3;   // [N s/m]
  return fit.mass.value > 0.0 && fit.mass.error < most_uncertain * fit.mass.value &&
         fit.damping.error < most_undamped;
}

void doubt(DeviceMeasurement& result) {
  constexpr double most_drift = 2e-3;    // [m]
  constexpr double most_misfit = 0.2;    // [-]
  constexpr double least_spring = 15.0;  // [N/m] a light hand's is 100
  int axes = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::string axis(1, "xyz"[i]);
    const auto& fit = result.fit.axes[i];
    if (!fit) continue;
    ++axes;
    if (!tells_mass(*fit))
      result.doubts.push_back("along " + axis + " its mass and damping stay unknown: " +
                              fixed_text(result.largest_force, 2) +
                              " N is hardly more than its friction, or something holds it");
    if (fit->misfit > most_misfit)
      result.doubts.push_back("along " + axis + " it moves otherwise than a mass with friction: " +
                              fixed_text(100.0 * fit->misfit, 0) +
                              " % of the force is not explained");
    if (fit->spring.value > std::max(least_spring, fit->spring.error))
      result.doubts.push_back("along " + axis + " something holds it with " +
                              fixed_text(fit->spring.value, 0) + " N/m: let go of the handle");
  }
  if (axes == 0)
    result.doubts.push_back("it hardly moved under " + fixed_text(result.largest_force, 2) +
                            " N: its friction is higher, or somebody holds it");
  else if (axes < 3)
    result.doubts.push_back("it moved along " + std::to_string(axes) + " of 3 axes only");
  if (result.rest_drift > most_drift)
    result.doubts.push_back("it moved by " + fixed_text(1e3 * result.rest_drift, 1) +
                            " mm before any force was sent");
  if (!result.ended.empty()) result.doubts.push_back("it ended early: " + result.ended);
  if (result.stalls > 0 && !result.doubts.empty())
    result.doubts.push_back(
        "the computer was too busy, which may be why: stalls: " + std::to_string(result.stalls) +
        ", the longest of " + fixed_text(1e3 * result.longest_stall, 0) +
        " ms; end other programs and measure again");
}

}  // namespace

// Hazard: probe
DeviceMeasurement measure_device(Device& device, const ProbeOptions& options) {
  check(device, options);
  const auto exciter = std::make_shared<Exciter>(options);
  Watcher watcher(*exciter, device);
  watcher.samples.reserve(static_cast<std::size_t>(options.time * options.rate) + 1);
  if (device.info().simulated)
    run_simulated(device, options, exciter, watcher);
  else
    run_live(device, options, exciter, watcher);
  DeviceMeasurement result;
  result.ended = watcher.ended.empty() ? text_of(exciter->end(), options) : watcher.ended;
  result.stalls = watcher.stalls.count();
  result.longest_stall = watcher.stalls.longest();
  look_at_positions(watcher.samples, result);
  result.fit = fit_handle(watcher.samples);
  doubt(result);
  return result;
}

std::optional<DeviceProposal> propose(const DeviceInfo& device,
                                      const DeviceMeasurement& measurement) {
  constexpr double most_late = 1e-3;       // [s] of the delay
  constexpr double margin = 0.8;           // [-]
  constexpr double stiff_enough = 1000.0;  // [N/m]: harder is hardly told from it with 3 N
  constexpr double usual_damping = 2.0;    // [N s/m]: more makes counts of an encoder felt
  constexpr double stiffest = 20'000.0;    // [N/m]
  constexpr double least_load = 0.03;      // [N]
  const HandleFit& fit = measurement.fit;
  if (!fit.delay || fit.delay->error > most_late) return std::nullopt;
  SampledWall wall{.handle = {.mass = 0.0, .damping = 1e9, .stiffness = 0.0},
                   .delay = fit.delay->value + fit.delay->error};
  Vec3 load = Vec3::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    const auto& along = fit.axes[static_cast<std::size_t>(axis)];
    if (!along) continue;
    if (!tells_mass(*along)) return std::nullopt;
    const double damping = std::max(along->damping.value - along->damping.error, 0.0);
    if (damping < wall.handle.damping) {
      wall.handle.damping = damping;
      wall.handle.mass = along->mass.value;
    }
    if (std::abs(along->load.value) > along->load.error) load[axis] = along->load.value;
  }
  if (wall.handle.mass == 0.0) return std::nullopt;

  DeviceProposal proposal;
  // As often as the device has a new position; what this loop could not see it may state.
  const double seen = measurement.update_rate.value_or(measurement.tick_rate);
  constexpr double whole = 100.0;  // [Hz]
  const double rate = device.rate.value_or(std::round(seen / whole) * whole);
  proposal.rate = std::clamp(rate, 500.0, 4000.0);
  wall.period = 1.0 / proposal.rate;
  const auto capped = [](double value, const std::optional<double>& most) {
    return most ? std::min(value, *most) : value;
  };
  const auto stiffness_with = [&](double damping) {
    wall.damping = damping;
    return capped(margin * linear_stiffness(wall, stiffest), device.limits.max_stiffness);
  };
  proposal.undamped = stiffness_with(0.0);
  proposal.damping =
      proposal.undamped >= stiff_enough ? 0.0 : capped(usual_damping, device.limits.max_damping);
  proposal.stiffness = stiffness_with(proposal.damping);
  if (load.norm() > least_load) proposal.load = load;
  return proposal;
}

}  // namespace palpate
