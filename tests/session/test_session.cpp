// SPDX-License-Identifier: Apache-2.0
// A whole session on a free-running clock: what its options promise.
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/devices/devices.hpp"
#include "palpate/io/devices/hip_path.hpp"
#include "palpate/io/devices/mouse_device.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/record/replay.hpp"
#include "palpate/session/session.hpp"

#include "tests/session/fakes.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/sanitized.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_session {

using test::fails_saying;
using test::MadeSource;
using test::wall;
using test::wall_depth;
using test::wall_source;

// Hovers, comes down on the wall at 1 s, and stays `into` [m] behind it.
HipPath pressing(double into = 0.005) {
  const double hover = wall_depth - 0.05;
  const double pressed = wall_depth + into;
  return HipPath({{0.0, {0.0, 0.0, hover}}, {1.0, {0.0, 0.0, hover}}, {1.1, {0.0, 0.0, pressed}}});
}

// A session on the wall.
SessionOptions on_the_wall() {
  SessionOptions options;
  options.cameras.resize(1);
  options.open_cameras.push_back(wall_source());
  options.open_devices[0] = std::make_unique<ScriptedDevice>(pressing(), false);
  options.pace = Pace::free_running;
  return options;
}

struct Outcome {
  std::vector<ServoTick> ticks;
  SessionState state;
};

Outcome play(SessionOptions options, double duration) {
  Session session(std::move(options));
  Outcome outcome;
  session.run(duration, [&](const ServoTick& tick) { outcome.ticks.push_back(tick); });
  outcome.state = session.state();
  return outcome;
}

void expect_the_same(const Outcome& a, const Outcome& b) {
  ASSERT_EQ(a.ticks.size(), b.ticks.size());
  for (std::size_t i = 0; i < a.ticks.size(); ++i) {
    ASSERT_EQ(a.ticks[i].force, b.ticks[i].force) << "tick " << i;
    ASSERT_EQ(a.ticks[i].tick.force, b.ticks[i].tick.force) << "tick " << i;
    ASSERT_EQ(a.ticks[i].tick.proxy, b.ticks[i].tick.proxy) << "tick " << i;
    ASSERT_EQ(a.ticks[i].safety, b.ticks[i].safety) << "tick " << i;
  }
}

TEST(Session, AsksForTheCouplingsForceAndSendsWhatTheLimitAllows) {
  SessionOptions options = on_the_wall();
  options.open_devices[0] = std::make_unique<ScriptedDevice>(pressing(0.02), false);
  const Outcome run = play(std::move(options), 4.0);
  ASSERT_EQ(run.ticks.size(), 4000U);
  const Summary& summary = run.state.hands[0].summary;
  EXPECT_EQ(summary.ticks, 4000U);
  EXPECT_EQ(summary.frames, 120U);
  // 600 N/m times 20 mm.
  EXPECT_NEAR(run.ticks.back().tick.force.norm(), 12.0, 0.1);
  EXPECT_NEAR(summary.largest_asked, 12.0, 0.5);
  EXPECT_NEAR(summary.largest_sent, 3.3, 1e-9);
  for (const ServoTick& tick : run.ticks) EXPECT_LE(tick.force.norm(), 3.3 + 1e-9);
  EXPECT_GT(summary.safety_ticks[2], 1000U) << "force_cut says so";
  EXPECT_EQ(summary.pop_throughs, 0U);
  EXPECT_FALSE(run.state.running);
}

// The hand presses before the reference, a plane 50 m away, is ever seen.
TEST(Session, LimitsTheForceOfDepthWhoseScaleIsInDoubtAndReplaysIt) {
  const test::TemporaryFolder folder;
  for (const bool is_seen : {true, false}) {
    SCOPED_TRACE(is_seen);
    const std::string bag = (folder.path() / (is_seen ? "seen" : "unseen")).string();
    const auto options = [&](const std::string& camera) {
      SessionOptions options;
      options.cameras.push_back({.uri = camera});
      options.open_devices[0] = std::make_unique<ScriptedDevice>(
          HipPath({{0.0, {0, 0, 0.05}}, {1.0, {0, 0, 0.05}}, {1.1, {0, 0, -0.01}}}), false);
      options.pace = Pace::free_running;
      return options;
    };
    SessionOptions first = options("synthetic:plane?size=160x120&scale_reference=plane:0,0,1," +
                                   std::string(is_seen ? "0" : "-50"));
    first.record = bag;
    const Outcome pressed = play(std::move(first), 3.0);
    const bool is_flagged = (pressed.ticks.back().safety & scale_unsure) != 0;
    EXPECT_EQ(is_flagged, !is_seen);
    const double force = pressed.ticks.back().force.norm();
    EXPECT_GT(force, is_seen ? 1.0 : 0.5 - 1e-9);
    EXPECT_LT(force, is_seen ? 3.3 + 1e-9 : 0.5 + 1e-9);
    SessionReader reader(bag);
    const ReplayReport report = replay(reader);
    EXPECT_TRUE(report.identical()) << text_of(report);
    const Outcome again = play(options("recording:" + bag + "?pose=0,0,0.7,1,0,0,0"), 2.9);
    EXPECT_EQ((again.ticks.back().safety & scale_unsure) != 0, !is_seen) << "as recorded";
  }
}

TEST(Session, KeepsALowerLimitFromItsSettings) {
  SessionOptions options = on_the_wall();
  options.safety.max_force = 1.25;
  EXPECT_NEAR(play(std::move(options), 4.0).state.hands[0].summary.largest_sent, 1.25, 1e-9);
}

TEST(Session, GivesTheSameForcesBitForBit) {
  for (const char* method : {"sight", "paper"}) {
    const auto on_the_desk = [&] {
      SessionOptions options;
      options.cameras.push_back({.uri = "synthetic:desk?noise=1mm&size=320x240"});
      options.method = method;
      options.pace = Pace::free_running;
      options.stroke_time = 4.0;
      return options;
    };
    const Outcome first = play(on_the_desk(), 4.0);
    EXPECT_GT(first.state.hands[0].summary.contact_ticks, 500U) << method;
    EXPECT_GT(first.state.hands[0].summary.largest_sent, 0.5) << method;
    EXPECT_LE(first.state.hands[0].summary.largest_sent, 3.3 + 1e-9) << method;
    expect_the_same(first, play(on_the_desk(), 4.0));
  }
}

TEST(Session, IsReplayedFromItsRecordingBitForBit) {
  const test::TemporaryFolder folder;
  const std::string bag = (folder.path() / "bag").string();
  SessionOptions options = on_the_wall();
  options.record = bag;
  const Outcome recorded = play(std::move(options), 2.0);
  EXPECT_FALSE(recorded.state.recording.failed) << recorded.state.recording.message;
  EXPECT_FALSE(recorded.state.recording.on);
  expect_the_same(recorded, play(on_the_wall(), 2.0));
  SessionReader reader(bag);
  EXPECT_EQ(reader.ticks(), 2000U);
  const ReplayReport report = replay(reader);
  EXPECT_TRUE(report.identical());
  EXPECT_EQ(report.ticks, 2000U);

  SessionOptions again = on_the_wall();
  again.record = bag;
  EXPECT_TRUE(fails_saying([&] { Session session(std::move(again)); }, "bag", "already"));
}

TEST(Session, AsksWhatFramesAreMadeOfAndKeepsAHandOffOneMaterial) {
  const test::TemporaryFolder folder;
  const auto table = std::make_shared<const MaterialTable>(MaterialTable{
      .materials = {{.name = "bone", .material = {}}, {.name = "nerve", .material = {}}}});
  const auto on_the_wall_at = [&](double x, const std::string& material) {
    // 10 mm before the wall.
    SessionOptions options = on_the_wall();
    options.open_devices[0] = std::make_unique<ScriptedDevice>(
        HipPath({{0.0, {x, 0.0, wall_depth - 0.1}}, {1.0, {x, 0.0, wall_depth - 0.01}}}), false);
    options.materials = [=](std::size_t /*camera*/, const DepthImage& image) {
      std::vector<std::uint8_t> labels(image.depth().size());
      const auto width = static_cast<std::size_t>(image.intrinsics().width);
      for (std::size_t i = 0; i < labels.size(); ++i) labels[i] = i % width < width / 2 ? 1 : 2;
      return std::make_shared<LabelImage>(table, std::move(labels));
    };
    Fixture off{.name = "off", .shape = FixtureShape::seen, .material = material};
    off.world_from_fixture.translation().z() = wall_depth;
    off.size = Vec3::Constant(1.0);
    off.numbers.margin = 0.02;
    options.fixture_set = std::make_shared<const FixtureSet>(std::vector{off});
    return options;
  };
  EXPECT_NEAR(play(on_the_wall_at(0.05, ""), 3.0).ticks.back().force.z(), -3.3, 0.01);
  EXPECT_EQ(play(on_the_wall_at(-0.05, "nerve"), 3.0).state.hands[0].summary.largest_sent, 0.0);
  SessionOptions recorded = on_the_wall_at(0.05, "nerve");
  recorded.record = (folder.path() / "bag").string();
  EXPECT_NEAR(play(std::move(recorded), 3.0).ticks.back().force.z(), -3.3, 0.01);
  SessionReader reader(folder.path() / "bag");
  EXPECT_EQ(reader.commands(0).settings.fixtures->items()[0].fixture.material, "nerve");
  EXPECT_TRUE(replay(reader).identical());

  EXPECT_TRUE(fails_saying([&] { const Session session(on_the_wall_at(0.0, "nerves")); },
                           "fixture 'off'", "'nerves'", "bone, "));
  SessionOptions wrong = on_the_wall_at(0.0, "");
  wrong.materials = [=](std::size_t, const DepthImage&) {
    return std::make_shared<LabelImage>(table, std::vector<std::uint8_t>(3));
  };
  EXPECT_NE(play(std::move(wrong), 0.1).state.cameras[0].doubt.find("3 pixels"), std::string::npos);
  Fixture box{.name = "box", .size = Vec3::Constant(0.1), .material = "nerve"};
  EXPECT_TRUE(fails_saying([&] { validate(box); }, "'box'", "remove material"));
}

TEST(Session, RunsTheTicksThatAreDueByACallersClock) {
  const Outcome all = play(on_the_wall(), 1.5);
  Session session(on_the_wall());
  TickRing<ServoTick>::Reader reader = session.ticks();
  for (const double t : {0.0, 0.004, 0.0041, 0.1}) session.advance(t);
  std::vector<ServoTick> ticks;
  for (ServoTick tick{}; reader.try_pop(tick);) ticks.push_back(tick);
  ASSERT_EQ(ticks.size(), 101U);  // each once, from 0 s on
  for (double t = 0.13; t < 1.5; t += 0.03) session.advance(t);
  for (ServoTick tick{}; reader.try_pop(tick);) ticks.push_back(tick);
  for (std::size_t i = 0; i < ticks.size(); ++i)
    ASSERT_EQ(ticks[i].force, all.ticks[i].force) << "tick " << i;
  EXPECT_GT(ticks.back().force.norm(), 0.5);
  session.advance(9.0);  // the caller was away: ticks are left out but for 0.1 s
  std::size_t late = 0;
  for (ServoTick tick{}; reader.try_pop(tick); ++late) EXPECT_GE(tick.tick.t, 8.899);
  EXPECT_EQ(late, 101U);
  session.set_playback({.paused = true});
  EXPECT_TRUE(session.state().cameras.front().playback.paused);
}

TEST(Session, TakesTheNoiseThatIsUsualForTheCamerasKindUnlessItIsSet) {
  const auto on_a = [](SensorKind sensor) {
    SessionOptions options = on_the_wall();
    options.open_cameras[0] = std::make_unique<MadeSource>(
        [](int k) {
          return Frame{k / 30.0, wall()};
        },
        SourceInfo{.uri = "made:", .kind = "made", .sensor = sensor});
    return options;
  };
  const auto noise_of = [](const ServoSettings& settings) {
    const SightParameters& sight = settings.parameters.sight;
    return std::pair(sight.usual_noise, sight.noise_growth);
  };
  for (const SensorKind kind : {SensorKind::unknown, SensorKind::stereo,
                                SensorKind::structured_light, SensorKind::time_of_flight}) {
    Session session(on_a(kind));
    const std::pair usual(usual_noise(kind).at_1m, usual_noise(kind).growth);
    EXPECT_EQ(noise_of(session.settings()), usual);
    EXPECT_EQ(session.state().cameras[0].sensor, kind);
    ServoSettings settings = session.settings();
    settings.parameters.sight.usual_noise = 0.02;
    session.set(settings);
    EXPECT_EQ(noise_of(session.settings()), std::pair(0.02, usual.second));
    settings.parameters.sight.usual_noise = 0.0;
    session.set(settings);
    EXPECT_EQ(noise_of(session.settings()), usual) << "left to the kind again";
  }

  // What it took is in the recording, so that a replay needs to know no kind.
  const test::TemporaryFolder folder;
  SessionOptions options = on_a(SensorKind::time_of_flight);
  options.parameters.sight.usual_noise = 3e-3;
  options.record = (folder.path() / "bag").string();
  const Outcome recorded = play(std::move(options), 1.5);
  EXPECT_EQ(noise_of(recorded.state.settings), std::pair(3e-3, 1)) << "what is set wins";
  SessionReader reader(folder.path() / "bag");
  EXPECT_TRUE(replay(reader).identical());
}

// Hazard: torque
TEST(Session, BoundsAToolsStiffnessInRotationByWhatItsDeviceBears) {
  const auto turn_stiffness = [](const char* device, double asked) {
    SessionOptions options = on_the_wall();
    options.open_devices[0] = open_device(device, pressing());
    options.parameters.coupling.turn_stiffness = asked;
    return Session(std::move(options)).settings().parameters.coupling.turn_stiffness;
  };
  EXPECT_NEAR(turn_stiffness("hand:?device=sigma", 0.0), 1.0, 1e-12);
  EXPECT_EQ(turn_stiffness("hand:?device=sigma", 3.0), 3.0) << "what is set wins";
  EXPECT_EQ(turn_stiffness("hand:?device=omega", 0.0), 0.0) << "it has no motors for a torque";
}

TEST(Session, SwitchesMethodsWhereTheProxyIs) {
  const test::TemporaryFolder folder;
  SessionOptions options = on_the_wall();
  options.record = (folder.path() / "bag").string();
  Session session(std::move(options));
  std::vector<ServoTick> ticks;
  session.run(5.0, [&](const ServoTick& tick) {
    ticks.push_back(tick);
    if (ticks.size() == 3000 || ticks.size() == 4000) {
      ServoSettings settings = session.settings();
      settings.method = ticks.size() == 3000 ? "paper" : "sight";
      session.set(settings);
    }
  });
  ASSERT_EQ(ticks.size(), 5000U);
  for (std::size_t i = 1; i < ticks.size(); ++i) {
    const bool is_switched = (ticks[i].hand & method_switched) != 0;
    EXPECT_EQ(is_switched, i == 3000 || i == 4000) << "tick " << i;
    EXPECT_LE(ticks[i].force.norm(), ticks[i - 1].force.norm() + 0.5 + 1e-9) << "tick " << i;
  }
  // `paper` lets the proxy a little way between points that lie 2.5 mm apart.
  for (const std::size_t i : {2999U, 3999U, 4999U})
    EXPECT_NEAR(ticks[i].force.norm(), i == 3999 ? 2.8 : 3.0, 0.1) << "tick " << i;
  EXPECT_EQ(session.settings().method, "sight");
  SessionReader reader(folder.path() / "bag");
  EXPECT_TRUE(replay(reader).identical());
}

TEST(Session, ChangesParametersFromTheNextTickOn) {
  Session session(on_the_wall());
  std::vector<double> forces;
  session.run(4.0, [&](const ServoTick& tick) {
    forces.push_back(tick.tick.force.norm());
    if (forces.size() != 3500) return;
    ServoSettings settings = session.settings();
    settings.parameters.coupling.stiffness = 300.0;
    session.set(settings);
  });
  EXPECT_NEAR(forces[3499], 3.0, 0.05);
  EXPECT_NEAR(forces[3999], 1.5, 0.05);
}

// Hazard: ros-node
TEST(Session, HoldsTheForceBackUntilTheHandEngagesAnew) {
  const double hover = wall_depth - 0.05;
  const double pressed = wall_depth + 0.005;
  const HipPath twice({{0.0, {0.0, 0.0, hover}},
                       {1.0, {0.0, 0.0, hover}},
                       {1.1, {0.0, 0.0, pressed}},
                       {4.0, {0.0, 0.0, pressed}},
                       {4.1, {0.0, 0.0, hover}},
                       {4.5, {0.0, 0.0, hover}},
                       {4.6, {0.0, 0.0, pressed}}});
  SessionOptions options = on_the_wall();
  options.open_devices[0] = std::make_unique<ScriptedDevice>(twice, false);
  Session session(std::move(options));
  std::vector<double> asked;
  std::vector<double> sent;
  session.run(8.0, [&](const ServoTick& tick) {
    asked.push_back(tick.tick.force.norm());
    sent.push_back(tick.force.norm());
    if (sent.size() == 3000) session.hold(true);
    if (sent.size() == 3200) session.set(session.settings());  // does not end it
    if (sent.size() == 3500) session.hold(false);
  });
  EXPECT_GT(sent[2999], 0.5);
  for (std::size_t i = 3020; i < 3500; ++i) {
    ASSERT_EQ(sent[i], 0.0) << "tick " << i;
    ASSERT_GT(asked[i], 2.5) << "tick " << i;  // the method goes on
  }
  // Released inside the surface: nothing until the hand was away from it.
  for (std::size_t i = 3500; i < 4000; ++i) ASSERT_EQ(sent[i], 0.0) << "tick " << i;
  EXPECT_GT(sent[7999], 0.5);
  // A limit that a session ends with is the user's, not the hold's.
  EXPECT_GT(session.settings().safety.max_force, 0.0);
  EXPECT_FALSE(session.state().held);
}

// A method in one class: a wall of its own, wherever the camera sees one.
class OwnWall final : public Method {
 public:
  explicit OwnWall(double z) : z_(z) {}
  void seat(const Vec3& /*proxy*/) noexcept override {}
  void observe(const Observation& /*seen*/) noexcept override { ++frame_; }
  Tick tick(const Vec3& hip, double t) noexcept override {
    Tick tick = free_tick(hip, t, frame_);
    if (hip.z() <= z_) return tick;
    tick.state = ContactState::contact;
    tick.normal = -Vec3::UnitZ();
    tick.proxy.z() = z_;
    tick.force = 100.0 * (tick.proxy - hip);
    return tick;
  }
  void set_parameters(const Parameters& /*parameters*/) noexcept override {}
  void check(const Cloud& cloud) const override {
    if (cloud.image() == nullptr)
      throw Error("own-wall", "it touches depth images alone", "choose another method");
  }

 private:
  double z_;
  std::int64_t frame_ = -1;
};

MethodRegistry with_own_wall() {
  MethodRegistry methods = standard_methods();
  methods.add({"own-wall", "a wall of its own",
               [](const Parameters&) { return std::make_unique<OwnWall>(0.48); }});
  return methods;
}

// A device in one class: stays where it is put and keeps what it is told.
class OwnDevice final : public Device {
 public:
  struct Seen {
    int enables = 0, disables = 0;
    Vec3 force = Vec3::Constant(-1.0);
  };
  OwnDevice(std::shared_ptr<Seen> seen, HipPath path)
      : seen_(std::move(seen)), path_(std::move(path)) {}
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double t) noexcept override { return {.position = path_.at(t)}; }
  void write(const Vec3& force, double /*t*/) noexcept override { seen_->force = force; }
  void enable() override { ++seen_->enables; }
  void disable() noexcept override { ++seen_->disables; }

 private:
  std::shared_ptr<Seen> seen_;
  HipPath path_;
  DeviceInfo info_{.uri = "own:", .kind = "own device", .limits = no_motors};
};

TEST(Session, RunsAMethodCameraAndDeviceOfOnesOwn) {
  SessionOptions options;
  options.sources.add({"own", "a wall", [](const Uri&) { return wall_source(); }});
  options.cameras.push_back({.uri = "own:"});
  options.methods = with_own_wall();
  options.method = "own-wall";
  const auto seen = std::make_shared<OwnDevice::Seen>();
  options.devices.add({"own", "a device", [&](const Uri&, const std::optional<HipPath>&) {
                         return std::make_unique<OwnDevice>(seen, pressing());
                       }});
  options.hands[0].device = "own:";
  options.pace = Pace::free_running;
  Session session(std::move(options));
  EXPECT_EQ(session.device().info().kind, "own device");
  Vec3 last = Vec3::Zero();
  session.run(3.5, [&](const ServoTick& tick) { last = tick.force; });
  EXPECT_NEAR(last.z(), -2.5, 1e-9) << "100 N/m times 25 mm";
  EXPECT_EQ(seen->force, Vec3::Zero()) << "the last write is zero";
  EXPECT_EQ(seen->enables, 1);
  EXPECT_GE(seen->disables, 1);
}

TEST(Session, TouchesWhereACameraStands) {
  SessionOptions options = on_the_wall();
  options.cameras[0].world_from_camera = Eigen::Translation3d(0.0, 0.0, 1.0);
  std::vector<HipPath::Sample> samples = pressing().samples();
  for (HipPath::Sample& sample : samples) sample.hip.z() += 1.0;
  options.open_devices[0] = std::make_unique<ScriptedDevice>(HipPath(samples), false);
  const Outcome there = play(std::move(options), 3.5);
  EXPECT_NEAR(there.ticks.back().force.norm(), 3.0, 0.05);

  SessionOptions away = on_the_wall();
  away.cameras[0].world_from_camera = Eigen::Translation3d(0.0, 0.0, 1.0);
  EXPECT_EQ(play(std::move(away), 3.5).state.hands[0].summary.largest_asked, 0.0);
}

TEST(Session, TouchesWhatSeveralCamerasSee) {
  // The second stands beside the first and sees a wall that is nearer.
  SessionOptions options = on_the_wall();
  options.open_cameras.push_back(std::make_unique<MadeSource>([](int k) {
    return Frame{k / 15.0, wall(480)};
  }));
  options.cameras = {{},
                     {.world_from_camera = Eigen::Isometry3d(Eigen::Translation3d(0.5, 0.0, 0.0))}};
  options.open_devices[0] = std::make_unique<ScriptedDevice>(
      HipPath({{0.0, {0.5, 0.0, 0.43}}, {1.0, {0.5, 0.0, 0.43}}, {1.1, {0.5, 0.0, 0.483}}}), false);
  const Outcome run = play(std::move(options), 3.5);
  EXPECT_NEAR(run.ticks.back().force.norm(), 600.0 * 0.003, 0.1);
  EXPECT_EQ(run.state.hands[0].summary.frames, 105U + 53U);
  ASSERT_EQ(run.state.cameras.size(), 2U);
  EXPECT_EQ(run.state.cameras[1].frames, 53U);
}

TEST(Session, GoesOnWithAPictureOfOneFrameAndARecordingThatEnds) {
  const test::TemporaryFolder folder;
  for (const int frames : {1, 12}) {
    SessionOptions options = on_the_wall();
    options.sources.add({"short", "", [=](const Uri&) -> std::unique_ptr<Source> {
                           return std::make_unique<MadeSource>([=](int k) -> std::optional<Frame> {
                             if (k == frames) return std::nullopt;
                             return Frame{5.0 + k / 30.0, wall()};
                           });
                         }});
    options.cameras.clear();
    options.open_cameras.clear();
    options.cameras.push_back({.uri = "short:"});
    const Outcome run = play(std::move(options), 3.5);
    EXPECT_NEAR(run.ticks.back().force.norm(), 3.0, 0.05) << frames << " frames";
    for (const ServoTick& tick : run.ticks) ASSERT_LT(tick.frame_age, 0.05) << tick.number;
  }
}

// The wall goes away by 30 mm, and the hand after it; where the recording begins again, the wall is
// that far before the hand.
TEST(Session, DoesNotFeelTheJumpWhereARecordingBeginsAgain) {
  constexpr double pass = 2.5;  // [s]
  const auto depth = [](double t) { return wall_depth + 0.012 * std::fmod(t, pass); };
  SessionOptions options = on_the_wall();
  options.sources.add(
      {"leaving", "", [=](const Uri&) -> std::unique_ptr<Source> {
         return std::make_unique<MadeSource>([=](int k) -> std::optional<Frame> {
           const double t = k / 30.0;
           if (t >= pass) return std::nullopt;
           return Frame{t, wall(static_cast<std::uint16_t>(std::lround(1e3 * depth(t))))};
         });
       }});
  options.cameras.clear();
  options.open_cameras.clear();
  options.cameras.push_back({.uri = "leaving:"});
  const auto at = [&](double t, double behind) {
    return HipPath::Sample{t, {0.0, 0.0, depth(t) + behind}};
  };
  options.open_devices[0] =
      std::make_unique<ScriptedDevice>(HipPath({at(0.0, -0.05),
                                                at(1.0, -0.05),
                                                at(1.1, 0.005),
                                                at(2.4999, 0.005),
                                                {3.0, {0.0, 0.0, depth(2.4999)}},
                                                at(3.3, -0.05),
                                                at(3.6, -0.05),
                                                at(3.8, 0.005),
                                                at(4.4, 0.005)}),
                                       false);
  const Outcome run = play(std::move(options), 4.4);
  const double before = run.ticks[2490].force.norm();
  EXPECT_GT(before, 1.5);
  for (std::size_t i = 2490; i < 3600; ++i) {
    ASSERT_LE(run.ticks[i].force.norm(), i < 2600 ? before + 0.2 : 0.0) << i << " ms";
  }
  EXPECT_GT(run.ticks[4390].force.norm(), 1.5) << "the hand has engaged anew";
}

TEST(Session, StrokesARecordingBeforeItBeginsAgain) {
  SessionOptions options;
  const SourceInfo info{.uri = "made:", .kind = "made", .frames = 90, .frame_rate = 30.0};
  options.sources.add({"made", "", [=](const Uri&) -> std::unique_ptr<Source> {
                         return std::make_unique<MadeSource>(
                             [](int k) -> std::optional<Frame> {
                               if (k == 90) return std::nullopt;
                               return Frame{k / 30.0, wall()};
                             },
                             info);
                       }});
  options.cameras.push_back({.uri = "made:"});
  options.pace = Pace::free_running;
  const Outcome run = play(std::move(options), 3.5);
  EXPECT_GT(run.state.hands[0].summary.contact_ticks, 1000U);
  for (std::size_t i = 2950; i < run.ticks.size(); ++i) {
    ASSERT_EQ(run.ticks[i].tick.state, ContactState::free_motion) << i;
  }
}

TEST(Session, StopsAndTakesTheForceOffWhereASourceThrows) {
  SessionOptions options;
  options.open_cameras.push_back(std::make_unique<MadeSource>([](int k) -> Frame {
    if (k == 90) throw Error("made:", "frame 90 is damaged", "mend it");
    return {k / 30.0, wall()};
  }));
  const auto seen = std::make_shared<OwnDevice::Seen>();
  options.open_devices[0] = std::make_unique<OwnDevice>(seen, pressing());
  options.pace = Pace::free_running;
  Session session(std::move(options));
  Vec3 last = Vec3::Zero();
  EXPECT_TRUE(fails_saying(
      [&] { session.run(5.0, [&](const ServoTick& tick) { last = tick.force; }); }, "frame 90"));
  EXPECT_GT(last.norm(), 1.0);
  EXPECT_EQ(seen->force, Vec3::Zero());
  EXPECT_GE(seen->disables, 1);
}

TEST(Session, EndsWhenItIsAskedTo) {
  Session session(on_the_wall());
  int ticks = 0;
  session.run(5.0, [&](const ServoTick&) {
    if (++ticks == 100) session.request_stop();
  });
  EXPECT_EQ(ticks, 100);
  EXPECT_EQ(session.state().hands[0].summary.ticks, 100U);
  EXPECT_TRUE(fails_saying([&] { session.run(1.0); }, "session", "stopped"));
  session.stop();
}

TEST(Session, ShowsItsFramesToWhoeverWatches) {
  std::vector<double> stamps;
  SessionOptions options = on_the_wall();
  options.on_frame = [&](std::size_t camera, const FedFrame& fed) {
    EXPECT_EQ(camera, 0U);
    stamps.push_back(fed.frame.stamp);
  };
  Session session(std::move(options));
  EXPECT_EQ(session.newest_clouds().at(0), nullptr);
  session.run(1.0);
  ASSERT_EQ(stamps.size(), 30U);
  EXPECT_NEAR(stamps.back(), 29.0 / 30.0, 1e-12);
  EXPECT_NE(session.newest_clouds().at(0), nullptr);
}

TEST(Session, StartsAMouseBeforeWhatTheCameraSees) {
  SessionOptions options = on_the_wall();
  options.open_devices[0] = nullptr;
  options.hands[0].device = "mouse:?max_speed=0.5";
  Session session(std::move(options));
  ASSERT_NE(session.mouse(), nullptr);
  EXPECT_NEAR(session.mouse()->start_position().z(), wall_depth - 0.05, 0.002);
  SessionOptions placed = on_the_wall();
  placed.open_devices[0] = nullptr;
  placed.hands[0].device = "mouse:?z=0.3";
  EXPECT_NEAR(Session(std::move(placed)).mouse()->start_position().z(), 0.3, 1e-12);
}

// What each error has to name: the thing, and what to do about it.
template <class Change, class... Parts>
testing::AssertionResult refuses(const Change& change, const Parts&... parts) {
  SessionOptions options = on_the_wall();
  change(options);
  return fails_saying([&] { const Session session(std::move(options)); }, parts...);
}

TEST(Session, RefusesWhatItCannotRun) {
  using Options = SessionOptions;
  EXPECT_TRUE(refuses(
      [](Options& o) {
        o.cameras.clear();
        o.open_cameras.clear();
      },
      "camera", "synthetic:desk"));
  EXPECT_TRUE(refuses(
      [](Options& o) {
        while (o.cameras.size() <= Patch::max_views)
          o.cameras.push_back({.uri = "synthetic:plane"});
      },
      "camera", "at most " + std::to_string(Patch::max_views)));
  EXPECT_TRUE(refuses(
      [](Options& o) {
        o.cameras.clear();
        o.open_cameras.clear();
        o.cameras.push_back({.uri = "synthetic:plane?pose=0,0,0,0,0,0,1",
                             .world_from_camera = Eigen::Isometry3d::Identity()});
      },
      "?pose=", "world_from_camera", "twice"));
  EXPECT_TRUE(refuses([](Options& o) { o.method = "sigth"; }, "sigth", "'sight'"));
  EXPECT_TRUE(refuses(
      [](Options& o) {
        o.cameras.clear();
        o.open_cameras.clear();
        o.cameras.push_back({.uri = "sinthetic:desk"});
      },
      "sinthetic", "'synthetic:'"));
  EXPECT_TRUE(refuses(
      [](Options& o) {
        o.open_devices[0] = nullptr;
        o.hands[0].device = "hnad:";
      },
      "hnad", "'hand:'"));
  EXPECT_TRUE(refuses(
      [](Options& o) {
        o.open_cameras[0] = std::make_unique<MadeSource>(
            [](int k) {
              return Frame{k / 30.0, wall()};
            },
            SourceInfo{.uri = "camera:1", .kind = "camera", .live = true});
      },
      "camera:1", "real time"));
  EXPECT_TRUE(refuses(
      [](Options& o) {
        o.open_cameras[0] =
            std::make_unique<MadeSource>([](int) -> std::optional<Frame> { return std::nullopt; });
      },
      "made:", "no frames"));
  EXPECT_TRUE(refuses([](Options& o) { o.safety.max_force = -1.0; }, "max_device_force"));
  EXPECT_TRUE(refuses([](Options& o) { o.parameters.coupling.stiffness = -1.0; }, "stiffness"));
  EXPECT_TRUE(refuses([](Options& o) { o.rate = 0.0; }, "servo rate", "1 to 100000"));
  EXPECT_TRUE(refuses(
      [](Options& o) {
        o.pace = Pace::real_time;
        o.rate = 10.0;
      },
      "servo rate", "500 to 10000"));
  EXPECT_TRUE(fails_saying([] { Session(on_the_wall()).start(); }, "free-running", "run"));
}

TEST(Session, TakesAProxyThatSparsePointsCarryUnlessOneIsChosen) {
  const auto radius = [](bool chosen) {
    SessionOptions options = on_the_wall();
    options.open_cameras[0] = std::make_unique<MadeSource>([](int k) {
      std::vector<Vec3> sheet;
      for (int i = 0; i < 400; ++i) sheet.emplace_back(0.01 * (i % 20), 0.01 * (i / 20), 0.5);
      return Frame{k / 30.0, std::make_shared<PointCloud>(sheet)};
    });
    options.radii_chosen = chosen;
    Session session(std::move(options));
    session.change([](ServoSettings& settings) { settings.parameters.coupling.stiffness = 500.0; });
    return session.settings().parameters.proxy.r_c();
  };
  EXPECT_GT(radius(false), 0.01);
  EXPECT_EQ(radius(true), ProxyParameters{}.r_c());
}

TEST(Session, RefusesAMethodThatCannotTouchWhatTheCamerasSee) {
  const auto points = [] {
    return std::make_unique<MadeSource>([](int k) {
      const std::vector<Vec3> two = {{0.0, 0.0, 0.5}, {0.01, 0.0, 0.5}};
      return Frame{k / 30.0, std::make_shared<PointCloud>(two, Vec3::Zero())};
    });
  };
  EXPECT_TRUE(refuses(
      [&](SessionOptions& o) {
        o.open_cameras[0] = points();
        o.methods = with_own_wall();
        o.method = "own-wall";
      },
      "own-wall", "depth images", "another method"));

  // In mid-session everything stays as it was.
  SessionOptions options = on_the_wall();
  options.open_cameras[0] = points();
  options.methods = with_own_wall();
  Session session(std::move(options));
  session.run(0.1, [&](const ServoTick& tick) {
    if (tick.number != 50) return;
    ServoSettings settings = session.settings();
    settings.method = "own-wall";
    settings.parameters.coupling.stiffness = 100.0;
    EXPECT_TRUE(fails_saying([&] { session.set(settings); }, "own-wall"));
    settings.method = "papr";
    EXPECT_TRUE(fails_saying([&] { session.set(settings); }, "papr", "'paper'"));
    settings = session.settings();
    settings.safety.ramp_time = -1.0;
    EXPECT_TRUE(fails_saying([&] { session.set(settings); }, "ramp_time"));
  });
  EXPECT_EQ(session.settings().method, "sight");
  EXPECT_EQ(session.settings().parameters.coupling.stiffness, 600.0);
}

}  // namespace test_session
}  // namespace palpate
