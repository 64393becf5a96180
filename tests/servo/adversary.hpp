// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/feel/feel.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/kernel/tool/shape_touch.hpp"
#include "palpate/servo/cycle.hpp"

#include "tests/servo/fake_device.hpp"
#include "tests/support/grids.hpp"

namespace palpate::test {

/// Everything that can go wrong around a cycle, at random and from a seed: hands that press, shake,
/// jump and are no number; devices that fail; frames that move, flicker, are empty, come from
/// another clock or not at all; a method or tool that asks for nonsense now and then; ticks that
/// stall, repeat and run backwards; settings and methods that change; another hand. After each
/// cycle it holds what the device got against the promises of the safety chain, by its own
/// book-keeping.
class Adversary {
 public:
  explicit Adversary(std::uint64_t seed) : random_(seed), cycle_(spoiled(wall()), device_) {
    constexpr int width = 40, height = 30;
    auto rays = std::make_shared<const ViewingRays>(
        Intrinsics{.width = width, .height = height, .fx = 35, .fy = 35, .cx = 19.5, .cy = 14.5});
    Eigen::Isometry3d looking_down = Eigen::Isometry3d::Identity();
    looking_down.linear() = Vec3(1, -1, -1).asDiagonal();
    looking_down.translation() = Vec3(0, 0, 0.15);
    for (int i = 0; i < 24; ++i) {
      std::vector<std::uint16_t> depth(width * height);
      for (auto& reading : depth) {
        const double z = 0.15 + 0.004 * std::sin(i) + between(-0.003, 0.003);
        const int fate = i % 6 == 5 ? 0 : static_cast<int>(random_() % 50);
        reading = fate == 0   ? std::uint16_t{0}
                  : fate == 1 ? static_cast<std::uint16_t>(random_())
                              : static_cast<std::uint16_t>(z * 10'000.0);
      }
      clouds_.push_back(std::make_shared<DepthImage>(rays, depth, 10'000.0, looking_down));
    }
    for (int i = 0; i < 8; ++i) {
      const bool many = i == 0;  // a tick takes as long as there are points
      std::vector<Vec3> points = flat_grid(0.002 * i - 0.006, many ? 1.5e-3 : 3e-3, many ? 30 : 8);
      points.emplace_back(nan, 0, 0);
      for (int k = 0; k < (many ? 300 : 30); ++k) points.push_back(place(0.02));
      clouds_.push_back(std::make_shared<PointCloud>(points, Vec3(0, 0, 1)));
    }
    clouds_.push_back(std::make_shared<PointCloud>(std::vector<Vec3>{}));
    clouds_.push_back(std::make_shared<CloudSet>(
        std::vector<std::shared_ptr<const Cloud>>{clouds_[0], clouds_[25], clouds_[26]}));
    device_.hand.position = {0, 0, 0.02};
  }

  /// As two hands of one session: neither may push while the other is in trouble. Before any step.
  static void link(Adversary& one, Adversary& two) {
    for (auto [hand, other] : {std::pair(&one, &two), std::pair(&two, &one)}) {
      hand->other_ =
          std::shared_ptr<const CycleStatistics>(std::shared_ptr<void>{}, &other->statistics());
      hand->cycle_.link({hand->other_}, inf);
    }
  }

  /// Runs one more cycle; empty if every promise was kept, else what was broken and when.
  std::string step() {
    if (ticks_ % 2048 == 0) choose();
    ++ticks_;
    move_hand();
    t_ += tick_interval();
    feed();
    if (random_() % 20'000 == 0) cycle_.set_settings(settings());
    if (one_in(touches_with_tool_ ? 1000 : 5000)) switch_method();
    if (touches_with_tool_) ++tool_ticks_;
    if (latched_ && one_in(500)) cycle_.reset_faults();
    const double given = one_in(50'000) ? nan : t_;
    const bool alone = other_ == nullptr || !is_in_trouble(*other_, given, inf);
    cycle_.run({.t = given});
    ServoTick record{};
    if (!ticks_seen_.try_pop(record)) return "a tick that does not come out of the ring";
    if (!record.tick.proxy.allFinite()) return "a proxy that is nowhere";
    latched_ = cycle_.statistics().latched_by != 0;
    if (latched_ != ((record.safety & fault_latched) != 0)) return "a latched fault without a flag";
    last_safety_ = record.safety;
    rings_ = !record.tick.transient.isZero();
    const Vec3 away = record.tick.hip - device_.hand.position;
    if (away.allFinite() && away.norm() < 1e3) clutched_away_ = away;
    const double since_last = given - last_given_;
    if (std::isfinite(given)) last_given_ = given;
    return verdict(given, since_last, alone);
  }

  [[nodiscard]] std::uint64_t ticks() const { return ticks_; }
  [[nodiscard]] double strongest() const { return strongest_; }
  [[nodiscard]] double strongest_torque() const { return strongest_torque_; }
  [[nodiscard]] std::uint64_t forceful_ticks() const { return forceful_ticks_; }
  [[nodiscard]] std::uint64_t turning_ticks() const { return turning_ticks_; }
  [[nodiscard]] std::uint64_t tool_ticks() const { return tool_ticks_; }
  [[nodiscard]] const CycleStatistics& statistics() const { return cycle_.statistics(); }

 private:
  static constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  static constexpr double inf = std::numeric_limits<double>::infinity();
  static constexpr double max_torque = 0.1;          // [N m]
  static constexpr double lever = max_torque / 3.3;  // [m]

  // A plane that each frame puts elsewhere and that moves between frames, hard or soft, late to
  // follow the hand or not: as much to the chain as any method, and a tick costs nearly nothing.
  class Wall final : public Method {
   public:
    explicit Wall(std::uint64_t seed) : random_(seed) {}
    void seat(const Vec3& /*proxy*/) noexcept override { felt_ = 0.0; }
    void observe(const Observation& /*seen*/) noexcept override {
      if (random_() % 4 != 0) return;
      height_ = 0.006 * share();
      speed_ = random_() % 2 == 0 ? 0.0 : 0.1 * share();
      pull_ = (random_() % 8 == 0 ? 3.0 : 0.0) * Vec3(share(), share(), share());
      sees_inside_out_ = random_() % 40 == 0;
      if (random_() % 30 != 0) return;
      normal_ = Vec3(0.7 * share(), 0.7 * share(), 1.0).normalized();
      lag_ = random_() % 2 == 0 ? 1.0 : 0.05 + 0.4 * std::abs(share());
      hardness_ = random_() % 3 == 0 ? 0.3 : 1.0;
    }
    void set_parameters(const Parameters& p) noexcept override { coupling_ = p.coupling; }
    Tick tick(const Vec3& hip, double t) noexcept override {
      const double dt = std::clamp(t - last_t_, 0.0, 1e-3);
      if (std::isfinite(t)) last_t_ = t;
      if (std::isfinite(dt)) height_ = std::clamp(height_ + speed_ * dt, -0.01, 0.01);
      Tick tick = free_tick(hip, t, 0);
      const double depth = height_ - normal_.dot(hip);
      if (!is_place(hip) || depth <= 0.0) {
        felt_ = 0.0;
        if (!is_place(hip)) tick.proxy = Vec3::Zero();
        return tick;
      }
      felt_ += lag_ * (depth - felt_);
      tick.proxy = hip + depth * normal_;
      tick.normal = sees_inside_out_ ? Vec3(-normal_) : normal_;
      tick.state = ContactState::contact;
      const double size = hardness_ * coupling_.stiffness * felt_ + coupling_.damping * speed_;
      tick.force = std::clamp(size, 0.0, coupling_.max_force) * normal_ + pull_;
      tick.surface_velocity = speed_;
      tick.surface_motion = speed_ * normal_;
      tick.hardness = hardness_;
      return tick;
    }

   private:
    double share() { return static_cast<double>(random_() >> 11) * 0x1p-52 - 1.0; }  // -1 to 1
    std::mt19937_64 random_;
    Coupling coupling_;
    Vec3 normal_ = Vec3::UnitZ();
    double height_ = 0.0, felt_ = 0.0;  // [m]
    Vec3 pull_ = Vec3::Zero();          // [N]
    bool sees_inside_out_ = false;
    double speed_ = 0.0;                 // [m/s]
    double lag_ = 1.0, hardness_ = 1.0;  // [-]
    double last_t_ = 0.0;                // [s]
  };

  // A method, but one force in a thousand is wrong; with a torque like a tool's.
  class Spoiled final : public Method {
   public:
    Spoiled(std::unique_ptr<Method> method, std::uint64_t seed)
        : method_(std::move(method)), random_(seed) {}
    void seat(const Vec3& proxy) noexcept override { method_->seat(proxy); }
    void observe(const Observation& seen) noexcept override { method_->observe(seen); }
    void set_parameters(const Parameters& p) noexcept override { method_->set_parameters(p); }
    Tick tick(const Vec3& hip, double t) noexcept override { return tick(HandPose{hip}, t); }
    Tick tick(const HandPose& hand, double t) noexcept override {
      Tick tick = method_->tick(hand, t);
      if (random_() % 3000 == 0) arm_ = any_arm();
      const bool is_ball = tick.torque.isZero(0.0);
      if (is_ball) tick.torque = arm_ * Vec3(tick.force.z(), tick.force.x(), -tick.force.y());
      switch (random_() % 6000) {
        case 0:
          tick.force.x() = nan;
          break;
        case 1:
          tick.force.y() = -inf;
          break;
        case 2:
          tick.force *= -100.0;
          break;
        case 3:
          tick.normal.z() = nan;
          break;
        case 4:
          tick.force = Vec3::Constant(1e308);
          break;
        case 5:
          tick.normal = -tick.normal;
          tick.force = -tick.force;
          break;
        case 6:
          tick.transient = Vec3::Constant(nan);
          break;
        case 7:
          rings_ = 400;
          break;
        case 8:
          tick.torque.y() = random_() % 2 == 0 ? nan : 1e308;
          break;
        case 9:
          tick.torque *= -100.0;
          break;
        case 10:
          tick.torque = Vec3(0.0, 0.0, 0.3);
          break;
        default:
          break;
      }
      if (rings_ > 0) {  // longer and stronger than any impact, and up to one after the other
        --rings_;
        tick.transient = Vec3(0, 0, rings_ % 3 == 0 ? -4.0 : 4.0);
        tick.force += tick.transient;
      }
      return tick;
    }

   private:
    int rings_ = 0;
    double any_arm() { return 0.025 * static_cast<double>(random_() % 4); }  // [m]
    std::unique_ptr<Method> method_;
    std::mt19937_64 random_;
    double arm_ = any_arm();
  };

  std::shared_ptr<Method> spoiled(std::unique_ptr<Method> method) {
    return std::make_shared<Spoiled>(std::move(method), random_());
  }

  double between(double low, double high) {
    return low + (high - low) * static_cast<double>(random_() >> 11) * 0x1p-53;
  }
  Vec3 place(double size) {
    return {between(-size, size), between(-size, size), between(-size, size)};
  }
  bool one_in(std::uint64_t n) { return random_() % n == 0; }

  // How the next two seconds go: mostly a hand that touches a live surface, or nothing would be
  // at stake.
  void choose() {
    hand_mode_ = one_in(4) ? static_cast<int>(random_() % 7) : one_in(6) ? 5 : 0;
    camera_mode_ = !one_in(4) ? 0 : static_cast<int>(random_() % 7);
    time_mode_ = !one_in(4) ? 0 : static_cast<int>(random_() % 4);
    swing_ = between(0.5e-3, 5e-3);
    swing_rate_ = between(2.0, 40.0);
    aim_ = Vec3(between(-0.02, 0.02), between(-0.02, 0.02), between(-0.015, 0.015));
  }

  void move_hand() {
    Vec3& hand = device_.hand.position;
    Vec3 aim = aim_ - clutched_away_;
    // Whoever feels nothing for a while comes out, as one has to, to engage again.
    if (ticks_ - last_forceful_ > 50 && ticks_ % 512 < 256) aim.z() += 0.05;
    if (!hand.allFinite() || (hand - aim).norm() > 1.0) hand = aim;
    switch (hand_mode_) {
      case 0:
        hand += 0.003 * (aim - hand);
        break;  // presses
      case 1:
        hand += 2e-4 * place(1.0);
        break;  // wanders
      case 2:
        hand = aim + 0.003 * place(1.0);
        break;  // shakes
      case 3:
        if (one_in(50)) hand = aim + place(0.05);
        break;  // jumps
      case 4:
        hand += 4e-3 * (aim - hand).normalized();
        break;  // 4 m/s
      case 5:
        hand = aim + Vec3(0, 0, swing_ * std::sin(6.283 * swing_rate_ * t_));
        break;  // swings
      default:  // is no number
        if (one_in(30)) hand = Vec3(one_in(2) ? nan : inf, one_in(2) ? 1e300 : 0.0, 0);
    }
    if (one_in(3000)) device_.hand.present = !device_.hand.present;
    if (!device_.hand.present && one_in(100)) device_.hand.present = true;
    if (one_in(5000)) device_.hand.clutched = !device_.hand.clutched;
    if (device_.hand.clutched && one_in(100)) device_.hand.clutched = false;
    if (one_in(30'000)) device_.hand.fault = DeviceFault::disconnected;
    if (one_in(100)) device_.hand.fault = DeviceFault::none;
    if (one_in(100)) device_.hand.orientation = Eigen::Quaterniond(rotation_by(place(0.5)));
  }

  double tick_interval() {
    switch (time_mode_) {
      case 1:
        return between(0.0, 4e-3);
      case 2:
        return one_in(200) ? between(0.005, 0.2) : 1e-3;
      case 3:
        return one_in(200) ? 0.0 : one_in(400) ? between(-0.01, 0.0) : 1e-3;
      default:
        return 1e-3;
    }
  }

  void feed() {
    if (camera_mode_ == 1 || (camera_mode_ != 2 && t_ < next_frame_)) return;
    next_frame_ = t_ + 1.0 / 30.0;
    double stamp = t_ - between(0.0, 0.02);
    if (camera_mode_ == 3 && one_in(3)) stamp = one_in(2) ? nan : inf;
    if (camera_mode_ == 4) stamp = stuck_;
    if (camera_mode_ == 5 && one_in(4)) stamp -= between(0.0, 2.0);
    if (camera_mode_ == 6 && one_in(4)) stamp += between(0.1, 1e6);
    stuck_ = stamp;
    // A surface at rest for a while, or another at every frame.
    if (one_in(3)) cloud_ = random_() % clouds_.size();
    cycle_.put_frame(clouds_[cloud_], stamp, t_);
    // The chain may not trust a stamp that repeats or runs backwards, or is from the future. One
    // that is no number says nothing, also of the next.
    if (!std::isfinite(stamp)) return;
    if ((!any_frame_ || stamp > last_stamp_) && stamp <= t_ + 0.05) {
      fresh_at_ = t_;
      fresh_stamp_ = stamp;
    }
    last_stamp_ = stamp;
    any_frame_ = true;
  }

  ServoSettings settings() {
    ServoSettings settings;
    settings.parameters.coupling.stiffness = between(0.0, 1e4);
    settings.parameters.coupling.damping = one_in(2) ? 0.0 : between(0.0, 50.0);
    settings.parameters.coupling.max_force = between(0.0, 1000.0);
    settings.parameters.proxy.step_budget = one_in(4) ? 2 : 64;
    settings.parameters.tap.tap = one_in(2) ? 0.0 : between(0.0, 50.0);
    settings.parameters.texture.grain = one_in(2) ? 0.0 : between(0.0, 0.3);
    settings.parameters.friction.friction = one_in(2) ? 0.0 : between(0.0, 2.0);
    if (one_in(2)) settings.fixtures = fixtures();
    settings.safety.ramp_time = between(0.01, 0.3);
    return settings;
  }

  // A region, a guide that needs no consent and a viscous region, where the hand is about.
  std::shared_ptr<const FixtureSet> fixtures() {
    Fixture region{.name = "region", .shape = FixtureShape::sphere, .radius = between(0.01, 0.03)};
    region.world_from_fixture.translation() = place(0.02);
    region.numbers.stiffness = between(100.0, 3000.0);
    Fixture guide{
        .name = "guide", .kind = FixtureKind::guide, .shape = FixtureShape::point, .consent = true};
    guide.world_from_fixture.translation() = place(0.02);
    Fixture honey{.name = "honey",
                  .kind = FixtureKind::viscous,
                  .shape = FixtureShape::box,
                  .size = Vec3::Constant(0.05)};
    return std::make_shared<FixtureSet>(std::vector<Fixture>{region, guide, honey});
  }

  std::unique_ptr<Method> wall() {
    return std::make_unique<Feel>(std::make_unique<Wall>(random_()), Parameters{});
  }

  // Mostly the plane: methods that look at a cloud have tests of their own, and take ten times as
  // long; a tool takes a hundred times as long, and does not stay.
  std::unique_ptr<Method> any_method() {
    touches_with_tool_ = one_in(10);
    if (touches_with_tool_)
      return std::make_unique<ShapeTouch>(make_tool("box:20x10x5mm?points=100", {}), Parameters{});
    if (!one_in(4)) return wall();
    const auto& methods = standard_methods().entries();
    return make_method(methods[random_() % methods.size()].name);
  }

  void switch_method() {
    cycle_.command([&](ServoCommands& told) { told.settings = settings(); }, spoiled(any_method()));
  }

  // The same promises of the torque, but that nothing rings.
  std::string torque_verdict(bool growing, double rise, double fall) {
    const double length = device_.torque.norm();
    const double grown = length - last_torque_.norm();
    const double change = (device_.torque - last_torque_).norm();
    last_torque_ = device_.torque;
    strongest_torque_ = std::max(strongest_torque_, length);
    if (!device_.torque.allFinite()) return "a torque that is not finite";
    if (length > max_torque + 1e-9) return "a torque above the limit";
    if (grown > rise || (change > rise + fall && length > 0.0))
      return "a torque that rises too fast";
    if (!growing && grown > 0.0) return "a torque that grows while a frame is late";
    if (idle_time_ > 3e-3 && length > 0.0) return "a torque without fresh data or without a hand";
    return {};
  }

  std::string verdict(double t, double since_last, bool alone) {
    const Vec3& force = device_.force;
    const double length = force.norm();
    const double credit = std::min(std::isfinite(since_last) ? since_last : 0.0, 1e-3);
    const double rise = 500.0 * std::max(credit, 0.0) + 1e-9;
    const double fall = 2000.0 * 1e-3 + 1e-9;
    const double age = std::max(t_ - fresh_at_, t_ - fresh_stamp_);
    const bool allowed = any_frame_ && age <= 0.5 && device_.hand.present &&
                         !device_.hand.clutched && !latched_ &&
                         device_.hand.fault == DeviceFault::none && alone;
    const double elapsed = std::isfinite(since_last) ? std::max(since_last, 0.0) : 0.0;
    const double warms = std::max(last_.norm(), last_torque_.norm() / lever);  // [N]
    heat_ += -std::expm1(-elapsed / 20.0) * (warms * warms - heat_);

    std::string broken;
    if (!force.allFinite()) broken = "a force that is not finite";
    if (length > 3.3 + 1e-9) broken = "a force above the limit";
    const double change = (force - last_).norm();
    // A stop is at once: the last gate makes one where the clock stands or jumps.
    if (length - last_.norm() > rise || (change > rise + fall && length > 0.0)) {
      // An impact rings: by up to 1 N to both sides, for up to 60 ms of any 100 ms.
      if (!ringing_.empty() && !(t >= ringing_.back().t)) ringing_.clear();
      ringing_.push_back({t, std::clamp(elapsed, 0.0, 5e-3)});
      while (!(t - ringing_.front().t < 0.1)) ringing_.pop_front();
      double rang_for = 0.0;
      for (const Ringing& tick : ringing_) rang_for += tick.lasted;
      if (rang_for > 0.066) broken = "a force that rises too fast";
      if (!rings_ && !rang_) broken = "a force that rises too fast without an impact";
      if (change > 2.0 + rise + fall) broken = "a force that changes too fast";
    }
    rang_ = rings_;
    if (heat_ > 0.88 * 0.88 * 1.001) broken = "more than the motors bear for long";
    if ((last_safety_ & frame_late) != 0 && length > last_.norm())
      broken = "a force that grows while a frame is late";
    if ((last_safety_ & output_refused) != 0) broken = "a chain that had to refuse its own result";
    // The step of a closed gate in tests/gate/stop.pml: a tenth of the limit at least, or zero.
    if ((last_safety_ & (disengaged | fault_latched | frame_lost)) != 0) {
      const double step = 330.0 * std::clamp(elapsed, 1e-4, 1e-3);
      if (length > std::max(last_.norm() - step, 0.0) + 1e-5)
        broken = "a closed gate that takes off too little";
    }
    // Its step where the clock fails.
    if (!(since_last >= 1e-7 && since_last <= 5e-3) && length > 0.0)
      broken = "a force while the clock stands or jumps";
    // 3.3 N are gone in two milliseconds of time; ticks without time take none off.
    idle_time_ = allowed ? 0.0 : idle_time_ + std::max(credit, 0.0);
    if (!allowed && idle_time_ > 3e-3 && length > 0.0)
      broken = "a force without fresh data or without a hand";
    const std::string torque_broken =
        torque_verdict((last_safety_ & frame_late) == 0, lever * rise, lever * fall);
    if (!torque_broken.empty()) broken = torque_broken;
    last_forceful_ = length > 0.0 ? ticks_ : last_forceful_;
    if (ticks_ - last_forceful_ > 500'000) broken = "a loop that never recovers";
    if (!broken.empty()) {
      std::ostringstream text;
      text << broken << " at tick " << ticks_ << ", t " << t << ": " << force.transpose()
           << " N after " << last_.transpose() << " N; frame age " << age;
      broken = text.str();
    }
    strongest_ = std::max(strongest_, length);
    if (length > 0.0) ++forceful_ticks_;
    if (!device_.torque.isZero(0.0)) ++turning_ticks_;
    last_ = force;
    return broken;
  }

  std::mt19937_64 random_;
  FakeDevice device_{DeviceLimits{.max_torque = max_torque}};
  Cycle cycle_;
  std::shared_ptr<const CycleStatistics> other_;
  TickRing<ServoTick>::Reader ticks_seen_ = cycle_.reader();
  std::vector<std::shared_ptr<const Cloud>> clouds_;
  int hand_mode_ = 0, camera_mode_ = 0, time_mode_ = 0;
  Vec3 aim_ = Vec3::Zero();
  double swing_ = 0.0, swing_rate_ = 0.0;  // [m], [Hz]
  Vec3 clutched_away_ = Vec3::Zero();      // from the hand to the HIP
  double t_ = 100.0, next_frame_ = 0.0, stuck_ = 100.0;
  std::size_t cloud_ = 0;
  double last_given_ = 100.0;  // [s] the time that a cycle was told last, if it was one
  bool latched_ = false;
  bool rings_ = false, rang_ = false;  // in this tick, and in the one before
  struct Ringing {
    double t, lasted;  // [s]
  };
  std::deque<Ringing> ringing_;  // ticks of the last 100 ms in which only an impact was in time
  std::uint32_t last_safety_ = 0;
  bool any_frame_ = false;
  double last_stamp_ = 0.0, fresh_at_ = 0.0, fresh_stamp_ = 0.0;
  bool touches_with_tool_ = false;
  std::uint64_t ticks_ = 0, forceful_ticks_ = 0, turning_ticks_ = 0, tool_ticks_ = 0,
                last_forceful_ = 0;
  Vec3 last_ = Vec3::Zero(), last_torque_ = Vec3::Zero();
  double heat_ = 0.0, idle_time_ = 0.0, strongest_ = 0.0, strongest_torque_ = 0.0;
};

}  // namespace palpate::test
