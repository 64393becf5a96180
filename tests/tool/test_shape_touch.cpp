// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/cloud/material_map.hpp"
#include "palpate/kernel/core/vectorise.hpp"
#include "palpate/kernel/tool/shape_touch.hpp"

#include "tests/support/allocations.hpp"
#include "tests/support/sanitized.hpp"

namespace palpate {
namespace {

constexpr double stiffness = 600.0;  // [N/m]
constexpr double frame_time = 1.0 / 30.0;

std::shared_ptr<const ToolShape> tool(const std::string& text) { return make_tool(text, {}); }

HandPose pose(const Vec3& at, const Vec3& turn = Vec3::Zero()) { return {at, rotation_by(turn)}; }

// A tool before a synthetic camera, tick by tick.
class Stage {
 public:
  explicit Stage(Scene scene, const std::string& shape = "box:40x20x5mm",
                 const std::string& sensor = "ideal", double distance = 0.6, double tilt = 0.4)
      : camera_(std::move(scene), setup(distance, tilt), SensorModel::named(sensor)),
        touch_(tool(shape), Parameters{}) {}

  // From where it is for so long [s]; the last tick.
  Tick run(double duration, const std::function<HandPose(double)>& hand,
           const std::function<void(const Tick&)>& see = {}) {
    Tick tick;
    const double end = t_ + duration;
    for (; t_ < end - 1e-9; t_ += 1e-3) {
      if (streams && t_ >= frames_ * frame_time - 1e-9) {
        frame_ = camera_.capture(frames_ * frame_time, static_cast<std::uint64_t>(frames_));
        ++frames_;
        auto image = std::make_unique<DepthImage>(*frame_.cloud->image());
        if (blind)
          *image =
              DepthImage(image->shared_rays(), std::vector<std::uint16_t>(image->depth().size()),
                         image->units_per_metre(), image->world_from_camera());
        image->set_materials(materials);
        if (change) change(*image);
        touch_.observe({*image, frame_.stamp, camera});
        image_ = std::move(image);
      }
      tick = touch_.tick(hand(t_), t_);
      if (see) see(tick);
    }
    return tick;
  }
  // Comes down to a pose from `above` it [m] in a second, and stays for two.
  Tick press(const HandPose& at, double above = 0.03, const Vec3& from = Vec3::UnitZ()) {
    const double begin = t_;
    return run(3.0, [&](double t) {
      const double left = std::max(1.0 - (t - begin), 0.0);
      return HandPose{at.position + left * above * from, at.orientation};
    });
  }
  [[nodiscard]] ShapeTouch& touch() { return touch_; }
  [[nodiscard]] double now() const { return t_; }

  bool streams = true;     // are there new frames?
  bool blind = false;      // do they show nothing?
  std::size_t camera = 0;  // its number
  std::shared_ptr<const MaterialMap> materials;
  std::function<void(DepthImage&)> change;  // what else an image is

 private:
  static CameraSetup setup(double distance, double tilt) {
    CameraSetup setup;
    setup.world_from_camera = looking_at_origin(distance, tilt, 0.0);
    return setup;
  }
  SyntheticCamera camera_;
  ShapeTouch touch_;
  Frame frame_;
  std::unique_ptr<DepthImage> image_;
  int frames_ = 0;
  double t_ = 0.0;
};

Part part(Shape shape) {
  Part part;
  part.shape = std::move(shape);
  return part;
}

Scene plane() { return Scene({part(HalfSpace{})}); }

// What a spring pulls and turns that holds a tool with one point `lever` from the hand at a plane:
// the least energy of both springs (docs/tools.md, (2)).
struct Wrench6 {
  Vec3 force, torque;
};
Wrench6 one_point(const Vec3& lever, const Vec3& normal, double depth, double reach) {
  const double length = std::sqrt(ToolShape::usual_turning) * reach;
  const Vec3 arm = lever.cross(normal);
  const double push = stiffness * depth / (1.0 + arm.squaredNorm() / (length * length));
  return {push * normal, push * arm};
}

TEST(ShapeTouch, FeelsNothingInFreeSpace) {
  Stage stage(plane());
  double most = 0.0;
  stage.run(
      1.0,
      [](double t) {
        return pose({0.02 * t, 0, 0.02}, {0.3 * t, 0.2, t});
      },
      [&](const Tick& tick) {
        most = std::max(most, tick.force.norm() + tick.torque.norm());
        EXPECT_EQ(tick.proxy, tick.hip);
      });
  EXPECT_EQ(most, 0.0);
}

TEST(ShapeTouch, RestsFlatOnAPlane) {
  Stage stage(plane());
  const Tick tick = stage.press(pose({0, 0, 2.5e-3 - 5e-3}));
  EXPECT_NEAR(tick.force.z(), stiffness * 5e-3, 0.02 * stiffness * 5e-3);
  EXPECT_LT(tick.force.head<2>().norm(), 0.05);
  EXPECT_LT(tick.torque.norm(), 0.05 * stiffness * 5e-3 * 20e-3);
  EXPECT_NEAR(tick.proxy.z(), 2.5e-3, 1e-4);
  EXPECT_EQ(tick.state, ContactState::contact);
  EXPECT_NEAR(tick.normal.z(), 1.0, 1e-3);
}

TEST(ShapeTouch, StandsOnAnEdgeAndOnACorner) {
  const auto shape = tool("box:40x20x5mm");
  for (const Vec3& turn : {Vec3(0, 0.3, 0), Vec3(0.25, 0.3, 0.0), Vec3(0, -0.5, 0.4)}) {
    const Rotation rotation = rotation_by(turn);
    Vec3 lowest = Vec3::Zero();
    int equal = 0;
    for (const ToolShape::Point& point : shape->points()) {
      const Vec3 lever = rotation * point.at;
      if (lever.z() < lowest.z() - 1e-6) lowest = lever, equal = 0;
      equal += std::abs(lever.z() - lowest.z()) < 1e-6 ? 1 : 0;
    }
    if (equal > 1) lowest.y() = 0.0;  // an edge along y: its middle
    const double depth = 5e-3;
    Stage stage(plane());
    const Tick tick = stage.press(pose({0, 0, -lowest.z() - depth}, turn));
    const Wrench6 truth = one_point(lowest, Vec3::UnitZ(), depth, shape->reach());
    const double scale = 0.05 * stiffness * depth;
    EXPECT_LT((tick.force - truth.force).norm(), scale)
        << tick.force.transpose() << " for " << truth.force.transpose();
    EXPECT_LT((tick.torque - truth.torque).norm(), scale * 20e-3)
        << tick.torque.transpose() << " for " << truth.torque.transpose();
  }
}

// The forces and moments that a tick's contacts give together.
Wrench6 pushed_by_contacts(const Tick& tick, const Vec3& about) {
  Wrench6 sum{Vec3::Zero(), Vec3::Zero()};
  std::vector<Vec3> levers;
  EXPECT_LE(tick.contact_count, tick.contacts.size());
  for (std::size_t i = 0; i < tick.contact_count; ++i) {
    const Vec3 lever = tick.contacts[i].lever.cast<double>();
    const Vec3 force = tick.contacts[i].force.cast<double>();
    for (const Vec3& other : levers) EXPECT_GT((other - lever).norm(), 1e-4) << "one of each place";
    levers.push_back(lever);
    sum.force += force;
    sum.torque += (tick.proxy + lever - about).cross(force);
  }
  return sum;
}

void expect_contacts_give_it(const Tick& tick) {
  const Vec3 force = tick.force - tick.transient - tick.vibration;
  EXPECT_GT(force.norm(), 0.1);
  for (const Vec3& about : {tick.proxy, tick.hip}) {
    const Wrench6 sum = pushed_by_contacts(tick, about);
    EXPECT_LT((sum.force - force).norm(), 1e-3 * force.norm())
        << sum.force.transpose() << " for " << force.transpose();
    EXPECT_LT((sum.torque - tick.torque).norm(), 1e-3 * force.norm() * 20e-3)
        << sum.torque.transpose() << " for " << tick.torque.transpose();
  }
}

TEST(ShapeTouch, SaysWhereItIsHeld) {
  const auto shape = tool("box:40x20x5mm");
  for (const Vec3& turn : {Vec3(0, 0, 0), Vec3(0, 0.3, 0), Vec3(0.25, 0.3, 0.0)}) {
    const Rotation rotation = rotation_by(turn);
    Vec3 lowest = Vec3::Zero();
    for (const ToolShape::Point& point : shape->points())
      if (const Vec3 lever = rotation * point.at; lever.z() < lowest.z()) lowest = lever;
    Stage stage(plane());
    const Tick tick = stage.press(pose({0, 0, -lowest.z() - 5e-3}, turn));
    expect_contacts_give_it(tick);
    for (std::size_t i = 0; i < tick.contact_count; ++i) {
      // On the plane, and at the tool's edge or corner.
      EXPECT_NEAR(tick.proxy.z() + tick.contacts[i].lever.z(), 0.0, 0.1e-3);
      EXPECT_NEAR(tick.contacts[i].force.normalized().z(), 1.0, 1e-3);
      if (!turn.isZero()) {
        EXPECT_NEAR(tick.contacts[i].lever.x(), lowest.x(), 1e-3);
      }
    }
    const Tick away = stage.run(0.5, [&](double) { return pose({0, 0, 0.03}, turn); });
    EXPECT_EQ(away.contact_count, 0U);
  }
}

// Two planes at 45 degrees to the vertical, which meet along an axis.
Scene valley(const Vec3& axis) {
  Part left = part(HalfSpace{}), right = left;
  left.world_from_part.linear() = rotation_by(0.25 * std::numbers::pi * axis).toRotationMatrix();
  right.world_from_part.linear() = left.world_from_part.linear().transpose();
  return Scene({left, right});
}

TEST(ShapeTouch, LiesInAConcaveCorner) {
  Stage stage(valley(Vec3::UnitY()), "box:40x20x5mm", "ideal", 0.6, 0.0);
  // 20 mm to either side, its lower edges touch at z = 20 mm.
  const Tick tick = stage.press(pose({0, 0, 22.5e-3 - 5e-3}), 0.04);
  EXPECT_NEAR(tick.force.z(), stiffness * 5e-3, 0.05 * stiffness * 5e-3);
  EXPECT_LT(tick.torque.norm(), 0.05 * stiffness * 5e-3 * 20e-3);
}

TEST(ShapeTouch, LiesInAGrooveThatIsNarrowerThanItIsLong) {
  for (const char* sensor : {"ideal", "d4xx"}) {
    Stage stage(valley(Vec3::UnitX()), "capsule:60x12mm", sensor, 0.45, 0.0);
    const Tick tick = stage.press(pose({0, 0, 6e-3 * std::numbers::sqrt2 - 5e-3}), 0.04);
    EXPECT_NEAR(tick.force.z(), stiffness * 5e-3, 0.05 * stiffness * 5e-3) << sensor;
  }
}

// Hazard: tool-pushes
TEST(ShapeTouch, GoesIntoAHoleAndIsHeldByItsSideAlone) {
  // Four blocks of 40 mm about a square hole, 24 mm wide, and a peg of 20 mm, upright.
  std::vector<Part> parts{part(HalfSpace{})};
  for (const Vec3& at :
       {Vec3(0.062, 0, 0), Vec3(-0.062, 0, 0), Vec3(0, 0.062, 0), Vec3(0, -0.062, 0)}) {
    parts.push_back(
        part(block(Vec3(at.x() != 0.0 ? 0.05 : 0.012, at.y() != 0.0 ? 0.05 : 0.112, 0.02))));
    parts.back().world_from_part.translation() = at + Vec3(0, 0, 0.02);
  }
  for (const char* sensor : {"ideal", "d4xx"}) {
    Stage stage(Scene(parts), "cylinder:60x20mm", sensor, 0.45, 0.0);
    const Vec3 upright(0, std::numbers::pi / 2, 0);
    stage.press(pose({0, 0, 0.055}, upright), 0.04);
    const double begin = stage.now();
    const Tick tick = stage.run(2.0, [&](double t) {
      return pose({std::min(7e-3, 0.01 * (t - begin)), 0, 0.055}, upright);
    });
    EXPECT_NEAR(tick.force.x(), -stiffness * 5e-3, 0.3 * stiffness * 5e-3) << sensor;
    EXPECT_NEAR(tick.force.z(), 0.0, 0.6) << sensor << ": it does not climb";
  }
}

Parameters rough(double friction) {
  Parameters parameters;
  parameters.friction.friction = friction;
  parameters.friction.kinetic_share = 1.0;
  return parameters;
}

// Hazard: material-force
TEST(ToolFriction, APlateOnASlopeSticksBelowTheAngleOfFrictionAndSlidesAboveIt) {
  constexpr double mass = 0.2, damping = 2.0;  // [kg], [N s/m] of the hand
  const double angle = std::atan(0.5);         // of friction
  for (const double off : {-0.03, 0.03}) {     // [rad] 1.7 degrees
    const Rotation slope = rotation_by(Vec3(0, angle + off, 0));
    Part ground = part(HalfSpace{});
    ground.world_from_part.linear() = slope.toRotationMatrix();
    Stage stage(Scene({ground}));
    stage.touch().set_parameters(rough(0.5));
    Vec3 at = slope * Vec3(-0.01, 0, 4e-3), velocity = Vec3::Zero(), resting = at;
    stage.run(
        3.0,
        [&](double) {
          return HandPose{at, slope};
        },
        [&](const Tick& tick) {
          if (tick.t < 0.2) return;  // the first frames
          const Vec3 force = tick.force - mass * Vec3(0, 0, 9.81) - damping * velocity;
          velocity += 1e-3 * force / mass;
          at += 1e-3 * velocity;
          if (tick.t < 1.0) resting = at;
        });
    const double slid = (slope.conjugate() * (at - resting)).x();
    if (off < 0.0) {
      EXPECT_LT(std::abs(slid), 1e-4);
    } else {
      EXPECT_GT(slid, 0.02);
    }
  }
}

// Hazard: material-force
TEST(ToolFriction, DragsWithTheCoefficientTimesTheNormalForce) {
  for (const double share : {1.0, 0.7}) {
    Parameters parameters = rough(0.6);
    parameters.friction.kinetic_share = share;
    Stage stage(plane());
    stage.touch().set_parameters(parameters);
    stage.press(pose({-0.03, 0, -2.5e-3}));
    const double begin = stage.now();
    const Vec3 way = Vec3(0.8, 0.6, 0);  // at 0.1 m/s
    const Tick tick = stage.run(
        0.5, [&](double t) { return pose(Vec3(-0.03, 0, -2.5e-3) + 0.1 * (t - begin) * way); });
    EXPECT_NEAR(tick.force.z(), 3.0, 0.1);
    EXPECT_NEAR(tick.force.dot(way) / tick.force.z(), -0.6 * share, 0.02);
    EXPECT_NEAR(tick.force.dot(Vec3(-0.6, 0.8, 0)), 0.0, 0.1);
  }
}

// Hazard: material-force
TEST(ToolFriction, ResistsATurnAboutTheNormal) {
  Stage stage(plane());
  stage.touch().set_parameters(rough(0.6));
  stage.press(pose({0, 0, -2.5e-3}));
  const double begin = stage.now();
  stage.run(
      2.0,
      [&](double t) {
        return pose({0, 0, -2.5e-3}, {0, 0, 0.2 * (t - begin)});
      },
      [&](const Tick& tick) {
        EXPECT_NEAR(tick.force.z(), 3.0, 0.2);
        if (tick.t < begin + 0.5) return;  // it sticks at first
        // Between the torque of contacts half of its width away and that of its corners.
        EXPECT_LT(tick.torque.z(), -0.6 * 3.0 * 5e-3);
        EXPECT_GT(tick.torque.z(), -1.05 * 0.6 * 3.0 * 22.4e-3);
      });
}

// Hazard: material-force
TEST(ToolFriction, AHeldPlateDoesNotCreep) {
  for (const char* sensor : {"ideal", "d4xx"}) {
    Stage stage(plane(), "box:40x20x5mm", sensor, 0.5, 0.3);
    stage.touch().set_parameters(rough(0.6));
    stage.press(pose({0, 0, -2.5e-3}));
    const Vec3 pulled(1.2e-3, 0.9e-3, -2.5e-3);  // half of 0.6 times 5 mm
    const Vec3 before = stage.run(1.0, [&](double) { return pose(pulled); }).proxy;
    const Tick tick = stage.run(test::sanitized ? 1.0 : 5.0, [&](double) { return pose(pulled); });
    EXPECT_LT((tick.proxy - before).head<2>().norm(), 1e-4) << sensor;
    EXPECT_LT(tick.force.head<2>().norm() / tick.force.z(), 0.6) << sensor;
    EXPECT_GT(tick.force.head<2>().norm(), 0.7) << sensor;
    if (std::string(sensor) == "ideal") expect_contacts_give_it(tick);
  }
}

// Hazard: material-force
TEST(ToolFriction, DragsNoPlateAsideThatASurfaceLifts) {
  // Seen from aside, so that it moves towards the camera and not along its normal alone.
  Stage stage(make_scene(Uri("synthetic:plane?stroke=0.02")), "box:40x20x5mm", "ideal", 0.6, 0.6);
  Parameters parameters;
  parameters.friction.viscosity = 5.0;
  stage.touch().set_parameters(parameters);
  stage.press(pose({0, 0, -15e-3}));
  stage.run(
      1.0,
      [](double) {
        return pose({0, 0, -15e-3});
      },
      [](const Tick& tick) {
        const double push = tick.force.dot(tick.normal);
        EXPECT_LT((tick.force - push * tick.normal).norm(), 0.002 * push) << tick.t;
      });
}

// One material for x < 0.
class LeftHalf final : public MaterialMap {
 public:
  explicit LeftHalf(const Material& material) : MaterialMap(table_of(material)) {}
  [[nodiscard]] std::uint8_t label(std::size_t, const Vec3& point) const noexcept override {
    return point.x() < 0.0 ? 1 : 0;
  }
  [[nodiscard]] std::uint8_t brightness(std::size_t, const Vec3&) const noexcept override {
    return 0;
  }
  [[nodiscard]] bool has_brightness() const noexcept override { return false; }
  [[nodiscard]] bool is_by_pixel() const noexcept override { return false; }

 private:
  static std::shared_ptr<const MaterialTable> table_of(const Material& material) {
    auto table = std::make_shared<MaterialTable>();
    table->materials = {{.name = "left", .material = material}};
    return table;
  }
};

// Hazard: material-force
TEST(ToolFriction, EachContactHasTheMaterialUnderIt) {
  Material soft;
  soft.stiffness = 150.0;
  Stage stage(plane());
  stage.materials = std::make_shared<LeftHalf>(soft);
  const Tick on_soft = stage.press(pose({-0.04, 0, -2.5e-3}));
  EXPECT_NEAR(on_soft.force.z(), 150.0 * 5e-3, 0.05);
  EXPECT_NEAR(on_soft.hardness, 0.25, 1e-6);
  expect_contacts_give_it(on_soft);
  // What becomes harder under a hand that rests, the tank does not pay for.
  Material harder;
  harder.stiffness = 400.0;
  Stage hardened(plane());
  hardened.materials = stage.materials;
  hardened.press(pose({-0.04, 0, -2.5e-3}));
  hardened.materials = std::make_shared<LeftHalf>(harder);
  const Tick unpaid = hardened.run(0.3, [](double) { return pose({-0.04, 0, -2.5e-3}); });
  EXPECT_LT(unpaid.hardness, 0.5);
  expect_contacts_give_it(unpaid);
  stage.run(0.2, [](double) { return pose({0, 0, 0.02}); });
  EXPECT_NEAR(stage.press(pose({0.04, 0, -2.5e-3})).force.z(), 3.0, 0.1);
  // Two fingers, the left one on the soft half: each gives half of 3 N, and that a quarter of it.
  Stage both(plane(), "gripper:40x30x8mm");
  both.materials = stage.materials;
  const Tick on_both = both.press(pose({0, 0, -1e-3}, {0, 0, std::numbers::pi / 2}));
  EXPECT_NEAR(on_both.force.z(), 1.5 + 0.25 * 1.5, 0.1);
  EXPECT_LT(on_both.torque.y(), -(1.5 - 0.375) * 14e-3) << "about the fingers' inner edges";
  EXPECT_GT(on_both.torque.y(), -(1.5 - 0.375) * 24e-3) << "about their outer edges";
  expect_contacts_give_it(on_both);
}

// Hazard: material-force
TEST(ToolFriction, RingsAndRattlesAsTheBallDoes) {
  Parameters parameters;
  parameters.tap.tap = 5.0;
  parameters.texture.grain = 0.2;
  Stage stage(plane());
  stage.touch().set_parameters(parameters);
  double ringing = 0.0, rattling = 0.0, resting = 0.0;
  const auto hand = [](double t) {
    return pose({0.05 * std::clamp(t - 1.0, 0.0, 1.0), 0, std::max(0.05 - 0.2 * t, -2.5e-3)});
  };
  stage.run(3.0, hand, [&](const Tick& tick) {
    ringing = std::max(ringing, tick.transient.norm());
    (tick.t < 2.05 ? rattling : resting) += tick.vibration.norm();
    EXPECT_LE(tick.force.norm(), Parameters{}.coupling.max_force * (1.0 + 1e-12));
  });
  EXPECT_GT(ringing, 0.3);
  EXPECT_GT(rattling, 50.0);  // [N] summed over a second
  EXPECT_EQ(resting, 0.0);
}

// Hazard: tool-pushes
TEST(ShapeTouch, BeginsInsideAndFeelsNothingUntilItIsFree) {
  Stage stage(plane());
  const Tick inside = stage.run(0.5, [](double) { return pose({0, 0, -4e-3}); });
  EXPECT_EQ(inside.force.norm() + inside.torque.norm(), 0.0);
  stage.run(0.5, [](double) { return pose({0, 0, 10e-3}); });
  EXPECT_GT(stage.press(pose({0, 0, -2.5e-3})).force.z(), 2.5);
}

// Hazard: tool-pushes
TEST(ShapeTouch, IsNeverBehindASurfaceThatComes) {
  Part rising = part(HalfSpace{});
  rising.motion.start = 1.0;
  rising.motion.speed = 0.5;
  const Scene coming({rising});
  for (const double tilt : {0.0, 0.4}) {
    Stage stage(coming, "box:40x20x5mm", "ideal", 0.7, 0.0);
    double behind = 0.0;
    double most = 0.0;
    stage.run(
        1.4,
        [&](double) {
          return pose({0, 0, 0.03}, {tilt, tilt, 0});
        },
        [&](const Tick& tick) {
          const double height = 0.5 * std::max(tick.t - 1.0, 0.0);
          const double below = height - (tick.proxy.z() + 0.02 * std::sin(tilt) + 2.5e-3);
          behind = below > 5e-3 ? behind + 1e-3 : 0.0;
          most = std::max(most, behind);
        });
    EXPECT_LT(most, 0.1);
  }
}

// Hazard: tool-pushes
TEST(ShapeTouch, DoesNotGoBackWhereAFrameOfASurfaceThatComesShowsNothing) {
  Part rising = part(HalfSpace{});
  rising.motion = {.start = 1.0, .speed = 0.5};
  Stage stage(Scene({rising}), "box:40x20x5mm", "ideal", 0.7, 0.0);
  const auto hand = [](double) { return pose({0, 0, 0.0}); };
  double highest = 0.0, back = 0.0;
  const auto see = [&](const Tick& tick) {
    highest = std::max(highest, tick.proxy.z());
    back = std::max(back, highest - tick.proxy.z());
  };
  stage.run(1.2, [](double t) { return pose({0, 0, std::max(0.03 - 0.05 * t, 0.0)}); });
  stage.blind = true;
  stage.run(frame_time, hand, see);
  EXPECT_GT(highest, 0.08);
  EXPECT_LT(back, 1e-3);
}

// A tool that comes nearer spans more pixels: its cells become coarser, with the frame that shows
// where the surface is by now.
TEST(SeenSurface, KnowsWhereASurfaceThatComesIsWhenItsCellsBecomeCoarser) {
  Part rising = part(HalfSpace{});
  rising.motion = {.start = 0.1, .speed = 0.5};
  CameraSetup setup;
  setup.world_from_camera = looking_at_origin(0.6, 0.0, 0.0);
  SyntheticCamera camera(Scene({rising}), setup, SensorModel::named("ideal"));
  const SightParameters parameters;
  SeenSurface seen;
  Frame frame;
  double t = 0.0;
  for (int i = 0; i < 15; ++i) {
    const double radius = i < 14 ? 0.03 : 0.08;
    const Frame before = frame;  // it lives until the next one is taken
    frame = camera.capture(i * frame_time, static_cast<std::uint64_t>(i));
    seen.observe(*frame.cloud->image(), {Vec3::Zero(), radius}, frame.stamp, frame_time,
                 parameters);
    for (; t < (i + 0.99) * frame_time; t += 1e-3) {
      seen.start_tick({Vec3::Zero(), radius}, t, parameters);
      if (t < 12 * frame_time) continue;
      const double height = 0.5 * (t - 0.1);
      const auto fit = seen.fit({0, 0, height}, -Vec3::UnitZ(), 0.1);
      ASSERT_TRUE(fit) << t;
      EXPECT_NEAR(fit->gap, 0.0, 2e-3) << t;
    }
  }
}

// Hazard: tool-pushes
TEST(ShapeTouch, HoldsAHandThatIsFarBehindASurfaceFromOneTickToTheNext) {
  for (const double depth : {0.05, 0.15}) {  // [m] less and more than the sides of bodies
    Stage stage(plane());
    stage.run(0.5, [](double) { return pose({0, 0, 0.02}); });
    const Tick tick = stage.run(0.1, [&](double) { return pose({0, 0, -depth}); });
    EXPECT_NEAR(tick.proxy.z(), 2.5e-3, 1e-3) << depth;
    EXPECT_GT(tick.force.z(), 19.0) << depth;
  }
}

// Hazard: tool-pushes
TEST(ShapeTouch, IsStoppedByTheSideOfABodyOfWhichTheEdgeAloneIsSeen) {
  // A block 60 mm high beside the tool, seen from straight above.
  Part block_ = part(block(Vec3(0.05, 0.05, 0.03)));
  block_.world_from_part.translation() = Vec3(0.05, 0, 0.03);
  Stage stage(Scene({part(HalfSpace{}), block_}), "box:20x20x20mm", "ideal", 0.5, 0.0);
  stage.run(0.5, [](double) { return pose({-0.04, 0, 0.02}); });
  const double begin = stage.now();
  const Tick tick = stage.run(2.0, [&](double t) {
    return pose({-0.04 + std::min(0.035, 0.05 * (t - begin)), 0, 0.02});
  });
  EXPECT_NEAR(tick.proxy.x(), -0.01, 1.5e-3);
  EXPECT_LT(tick.force.x(), -1.5);
  EXPECT_NEAR(tick.force.z(), 0.0, 0.5);
}

TEST(ShapeTouch, TouchesNothingJustAboveASurfaceThatItTouched) {
  Stage stage(plane());
  Parameters parameters;
  parameters.coupling.damping = 5.0;
  stage.touch().set_parameters(parameters);
  stage.press(pose({0, 0, -2.5e-3}));
  const double begin = stage.now();
  const auto above = [&](double t) {
    return pose({0.1 * (t - begin), 0, std::min(2.8e-3, -2.5e-3 + 0.1 * (t - begin))});
  };
  stage.run(0.08, above);
  stage.run(0.1, above, [](const Tick& tick) {
    EXPECT_EQ(tick.force.norm(), 0.0) << tick.t;
    EXPECT_EQ(tick.state, ContactState::free_motion) << tick.t;
  });
}

// Hazard: tool-pushes
TEST(ShapeTouch, IsPushedAsideByABoxThatSlidesIn) {
  for (const char* sensor : {"ideal", "d4xx"}) {
    for (const double speed : {0.1, 0.3}) {
      Part box = part(block(Vec3(0.03, 0.04, 0.02)));
      box.world_from_part.translation() = Vec3(-0.12, 0, 0.02);
      box.motion = {.direction = Vec3::UnitX(), .start = 3.0, .speed = speed};
      Stage stage(Scene({part(HalfSpace{}), box}), "box:40x20x5mm", sensor, 0.5, 0.2);
      const HandPose at = pose({0, 0, -2.5e-3});
      stage.press(at);
      double in_it = 0.0, longest = 0.0, before_it = 0.0, aside = 0.0;
      const Tick last = stage.run(
          0.12 / speed, [&](double) { return at; },
          [&](const Tick& tick) {
            const double side = -0.09 + speed * (tick.t - 3.0);
            if (side < -0.02) return;
            const double gap = tick.proxy.x() - 0.02 - side;
            // A frame is up to an interval old, and its rows take half of one.
            in_it = gap < -1.5 * speed * frame_time - 3e-3 ? in_it + 1e-3 : 0.0;
            longest = std::max(longest, in_it);
            before_it = std::max(before_it, gap);
            aside = std::max(aside, std::abs(tick.proxy.y()));
          });
      EXPECT_LT(longest, 0.05) << sensor << speed;
      EXPECT_LT(before_it, 0.012) << sensor << speed;
      EXPECT_LT(aside, 0.02) << sensor << speed;
      EXPECT_GT(last.force.x(), 12.0) << sensor << speed;
    }
  }
}

// Hazard: tool-pushes
// Seen from aside, a box of 58 mm is 66 mm nearer than the plane behind it.
TEST(ShapeTouch, IsPushedAsideByAHighBoxThatIsSeenFromAside) {
  for (const char* sensor : {"ideal", "d4xx"}) {
    Part box = part(block(Vec3(0.03, 0.04, 0.029)));
    box.world_from_part.translation() = Vec3(-0.12, 0, 0.029);
    box.motion = {.direction = Vec3::UnitX(), .start = 1.0, .speed = 0.3};
    Stage stage(Scene({part(HalfSpace{}), box}), "box:40x20x5mm", sensor, 0.5, 0.5);
    const HandPose at = pose({0, 0, -2.5e-3});
    stage.run(1.0, [&](double t) {
      return HandPose{at.position + std::max(0.6 - t, 0.0) * 0.1 * Vec3::UnitZ(), at.orientation};
    });
    double in_it = 0.0, longest = 0.0, change = 0.0;
    Vec3 before = stiffness * 5e-3 * Vec3::UnitZ();
    stage.run(
        0.4, [&](double) { return at; },
        [&](const Tick& tick) {
          const double inside = -0.09 + 0.3 * (tick.t - 1.0) - (tick.proxy.x() - 0.02);
          in_it = inside > 0.45 * frame_time + 3e-3 ? in_it + 1e-3 : 0.0;
          longest = std::max(longest, in_it);
          change = std::max(change, (tick.force - before).norm());
          before = tick.force;
        });
    EXPECT_LT(longest, 0.05) << sensor;
    EXPECT_LT(change, 2.0) << sensor;
  }
}

// Hazard: tool-pushes
TEST(ShapeTouch, HardlyFeelsAnArmThatPassesBeforeTheCamera) {
  Part arm = part(Capsule{.radius = 0.03, .half_length = 0.4});
  arm.world_from_part.translation() = Vec3(-0.25, 0, 0.15);
  arm.motion = {.direction = Vec3::UnitX(), .start = 3.0, .speed = 0.35};
  for (const char* sensor : {"ideal", "d4xx"}) {
    Stage stage(Scene({part(HalfSpace{}), arm}), "box:40x20x5mm", sensor, 0.45, 0.0);
    const HandPose at = pose({0, 0, -2.5e-3});
    const Vec3 before = stage.press(at).force;
    bool is_hidden = false;
    double most = 0.0;
    stage.run(
        1.6, [&](double) { return at; },
        [&](const Tick& tick) {
          is_hidden = is_hidden || (tick.flags & surface_hidden) != 0;
          most = std::max(most, (tick.force - before).norm());
        });
    EXPECT_TRUE(is_hidden) << sensor;
    EXPECT_LT(most, 0.4) << sensor;
  }
}

// Hazard: tool-pushes
TEST(ShapeTouch, KeepsThePartsOfOneWrenchAtItsLimit) {
  Parameters soft;
  soft.coupling.max_force = 1.0;
  Stage stage(plane());
  stage.touch().set_parameters(soft);
  const Tick tick = stage.press(pose({0, 0, 2e-3}, {0, 0.3, 0}));
  EXPECT_NEAR(tick.force.norm(), 1.0, 1e-9);
  EXPECT_TRUE((tick.flags & force_saturated) != 0);
  EXPECT_NEAR(tick.torque.norm(), 1.0 * 19e-3, 2e-3);
  expect_contacts_give_it(tick);
}

// Hazard: tool-pushes
TEST(ShapeTouch, LetsGoWhereFramesDoNotCome) {
  Stage stage(plane());
  const HandPose at = pose({0, 0, 0}, {0, 0.3, 0});
  const Tick pressed = stage.press(at);
  stage.streams = false;
  const auto hand = [&](double) { return at; };
  EXPECT_LT((stage.run(0.05, hand).force - pressed.force).norm(), 1e-9)
      << "one that is late takes nothing";
  const Tick fading = stage.run(0.09, hand);
  EXPECT_LT(fading.torque.norm(), 0.9 * pressed.torque.norm());
  expect_contacts_give_it(fading);
  const Tick gone = stage.run(0.2, hand);
  EXPECT_TRUE(gone.force.isZero(0.0) && gone.torque.isZero(0.0));
  EXPECT_EQ(gone.contact_count, 0U);
  stage.streams = true;
  EXPECT_TRUE(stage.run(0.5, hand).force.isZero(0.0)) << "until it has been free";
}

// Hazard: tool-pushes
TEST(ShapeTouch, FadesWhereItsSurfaceIsNotMeasured) {
  Stage stage(plane());
  const HandPose at = pose({0, 0, 0});
  const double pressed = stage.press(at).force.z();
  stage.blind = true;
  const auto hand = [&](double) { return at; };
  const Tick held = stage.run(0.3, hand);
  EXPECT_NEAR(held.force.z(), pressed, 0.05 * pressed);
  EXPECT_TRUE((held.flags & surface_hidden) != 0);
  const double fading = stage.run(0.25, hand).force.z();
  EXPECT_GT(fading, 0.1 * pressed);
  EXPECT_LT(fading, 0.9 * pressed);
  EXPECT_TRUE(stage.run(0.3, hand).force.isZero(0.0));
}

TEST(ShapeTouch, TouchesAScanAsLongAsOneLikes) {
  Stage stage(plane());
  stage.run(1e-3, [](double) { return pose({0, 0, 0.03}); });
  stage.streams = false;
  EXPECT_NEAR(stage.press(pose({0, 0, -2.5e-3})).force.z(), stiffness * 5e-3, 0.1);
}

TEST(ShapeTouch, FeelsNothingWithoutAFrameAndOfCamerasThatItDoesNotTouch) {
  ShapeTouch touch(tool("box:40x20x5mm"), Parameters{});
  EXPECT_EQ(touch.tick(pose({0, 0, 0.02}), 0.0).flags, std::uint32_t{no_frame});
  Stage seen(plane());
  seen.camera = Patch::max_views - 1;
  EXPECT_TRUE(seen.press(pose({0, 0, 0})).force.isZero(0.0));
}

// Hazard: tool-pushes
TEST(ShapeTouch, LetsGoOfAHandThatIsFarAway) {
  Stage stage(plane());
  stage.press(pose({0, 0, 0}));
  const double begin = stage.now();
  bool lets_go = false;
  const Tick tick = stage.run(
      0.5,
      [&](double t) {
        return pose({0, 0, -(t - begin)});
      },
      [&](const Tick& each) {
        lets_go = lets_go || (each.flags & proxy_let_go) != 0;
        EXPECT_LT((each.proxy - each.hip).norm(), 0.302);
        EXPECT_EQ(each.contact_count > 0, !each.force.isZero(0.0));
      });
  EXPECT_TRUE(lets_go);
  EXPECT_TRUE(tick.force.isZero(0.0));
}

// What a damper adds to the wrench at the end of a path of the hand's, for 5 N s/m.
Wrench6 damped_part(const Scene& scene, double duration,
                    const std::function<HandPose(double)>& hand) {
  Wrench6 part{Vec3::Zero(), Vec3::Zero()};
  for (const double damping : {5.0, 0.0}) {
    Parameters parameters;
    parameters.coupling.damping = damping;
    Stage stage(scene);
    stage.touch().set_parameters(parameters);
    stage.run(1.0, [](double) { return pose({0, 0, 0.02}); });
    const Tick tick = stage.run(duration, hand);
    part.force = tick.force - part.force;
    part.torque = tick.torque - part.torque;
  }
  return {-part.force, -part.torque};
}

TEST(ShapeTouch, DampsWhatTheHandMovesAgainstTheSurface) {
  const Vec3 down(0, 0, -2.5e-3);
  const double length = std::sqrt(ToolShape::usual_turning) * tool("box:40x20x5mm")->reach();
  // Down at 0.1 m/s, and a turn that begins 20 ms before the end, at 1 rad/s.
  const auto pressing = [&](double t) {
    return pose({0, 0, std::max(0.02 - 0.1 * (t - 1.0), down.z())});
  };
  EXPECT_NEAR(damped_part(plane(), 0.22, pressing).force.z(), 0.5, 0.05);
  const auto turning = [&](double t) {
    return HandPose{pressing(t).position, rotation_by(Vec3(std::max(t - 1.48, 0.0), 0, 0))};
  };
  EXPECT_NEAR(damped_part(plane(), 0.5, turning).torque.x(), -5.0 * length * length,
              0.5 * length * length);
  // After a gap, differences are no velocity.
  const auto jumping = [&](double t) {
    return HandPose{pressing(t).position, rotation_by(Vec3(t < 1.4 ? 0.0 : 0.05, 0, 0))};
  };
  Parameters damped;
  damped.coupling.damping = 5.0;
  Stage stage(plane());
  stage.touch().set_parameters(damped);
  stage.run(1.0, [](double) { return pose({0, 0, 0.02}); });
  stage.run(0.39, pressing);
  const double t = stage.now() + 0.05;
  const double jumped = stage.touch().tick(jumping(t), t).torque.x();
  EXPECT_NEAR(jumped, stage.touch().tick(jumping(t), t + 1e-3).torque.x(), 2.5 * length * length);
}

TEST(ShapeTouch, IsCarriedByASurfaceThatRises) {
  Part rising = part(HalfSpace{});
  rising.motion = {.start = 1.5, .speed = 0.05};
  const auto hand = [](double t) {
    const double height = 0.05 * std::max(t - 1.5, 0.0);
    return pose({0, 0, height + std::max(0.02 - 0.1 * (t - 1.0), -2.5e-3)});
  };
  EXPECT_NEAR(damped_part(Scene({rising}), 1.5, hand).force.z(), 0.0, 0.05);
  Stage stage(Scene({rising}));
  stage.run(1.0, [](double) { return pose({0, 0, 0.02}); });
  const Tick tick = stage.run(1.5, hand);
  EXPECT_NEAR(tick.surface_velocity, 0.05, 5e-3);
  EXPECT_LT((tick.surface_motion - tick.surface_velocity * tick.normal).norm(), 1e-12);
}

// Hazard: tool-pushes, not-a-number
TEST(ShapeTouch, FeelsNothingForAHandThatIsNowhere) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  Stage stage(plane());
  const HandPose at = pose({0, 0, 0});
  const double pressed = stage.press(at).force.z();
  const double t = stage.now();
  const std::pair<HandPose, double> nowhere[] = {
      {{Vec3(0, nan, 0), at.orientation}, t},     {{Vec3(1e9, 0, 0), at.orientation}, t},
      {{at.position, Rotation(0.4, 0, 0, 0)}, t}, {{at.position, Rotation(2.1, 0, 0, 0)}, t},
      {{at.position, Rotation(nan, 0, 0, 0)}, t}, {at, nan}};
  for (const auto& [hand, when] : nowhere) {
    const Tick tick = stage.touch().tick(hand, when);
    EXPECT_TRUE(tick.force.isZero(0.0) && tick.torque.isZero(0.0));
    EXPECT_TRUE((tick.flags & non_finite_input) != 0);
    EXPECT_TRUE(tick.proxy.allFinite());
  }
  EXPECT_NEAR(stage.run(0.1, [&](double) { return at; }).force.z(), pressed, 0.05);
}

// Hazard: tool-pushes
TEST(ShapeTouch, PushesAndNeverPullsAHandThatIsTakenAway) {
  Parameters damped;
  damped.coupling.damping = 20.0;
  Stage stage(plane());
  stage.touch().set_parameters(damped);
  stage.press(pose({0, 0, 0}, {0, 0.3, 0}));
  const double begin = stage.now();
  stage.run(
      0.1,
      [&](double t) {
        return pose({0, 0, 0.3 * (t - begin)}, {0, 0.3 - 5.0 * (t - begin), 0});
      },
      [](const Tick& tick) { EXPECT_GE(tick.force.z(), -1e-9); });
}

TEST(ShapeTouch, AllocatesNothing) {
  if (!test::memory_is_counted) GTEST_SKIP() << "a sanitizer counts";
  Stage stage(plane());
  Parameters felt = rough(0.5);
  felt.texture.grain = 0.1;
  stage.touch().set_parameters(felt);
  stage.press(pose({0, 0, 0}));
  const std::function<HandPose(double)> hand = [](double t) {
    return pose({0.5 * t, 0, 0}, {0, 0.1, 0});
  };
  ShapeTouch& touch = stage.touch();
  const test::MemoryCalls calls;
  double force = 0.0;
  for (int i = 0; i < 20; ++i)
    force += touch.tick(hand(i * 1e-3), stage.now() + i * 1e-3).force.z();
  EXPECT_EQ(calls.count(), 0u);
  EXPECT_GT(force, 0.0);
}

// Makes readings ten times as noisy in the right half of an image; says so.
class HalfNoisy {
 public:
  explicit HalfNoisy(bool is_told) : is_told_(is_told) {}
  void operator()(DepthImage& image) {
    constexpr double sigma = 0.4e-3;  // [m]
    const int width = image.intrinsics().width;
    std::vector<std::uint16_t> depth = image.depth().copy();
    std::vector<float> noise;
    for (std::size_t i = 0; i < depth.size(); ++i) {
      const bool is_right = static_cast<int>(i) % width >= width / 2;
      noise.push_back(
          static_cast<float>((is_right ? 10.0 : 1.0) * sigma * image.units_per_metre()));
      depth[i] = static_cast<std::uint16_t>(depth[i] + noise.back() * normal_(random_) + 0.5);
    }
    image = DepthImage(image.shared_rays(), std::move(depth), image.units_per_metre(),
                       image.world_from_camera());
    if (is_told_) image.set_noise(noise);
  }

 private:
  bool is_told_;
  std::mt19937 random_{7};
  std::normal_distribution<double> normal_;
};

TEST(ShapeTouch, LeansOnTheHalfOfAnImageThatSaysItIsQuiet) {
  std::array<double, 2> off{}, aside{};  // [N^2] of the force: summed over ticks
  for (const bool is_told : {false, true}) {
    Stage stage(plane(), "capsule:30x10mm", "ideal", 0.6, 0.0);  // across the border of both
    stage.change = HalfNoisy(is_told);
    stage.press(pose({0, 0, 0}));
    stage.run(
        2.0,
        [](double) {
          return pose({0, 0, 0});
        },
        [&](const Tick& tick) {
          const std::size_t which = is_told ? 1 : 0;
          off[which] += (tick.force - Vec3(0, 0, stiffness * 5e-3)).squaredNorm();
          aside[which] += tick.force.head<2>().squaredNorm();
        });
  }
  EXPECT_LT(std::sqrt(off[1]), 0.3 * std::sqrt(off[0])) << off[1] << ' ' << off[0];
  EXPECT_LT(std::sqrt(aside[1]), 0.3 * std::sqrt(aside[0])) << aside[1] << ' ' << aside[0];
}

// What is left of a signal above 20 Hz, rms.
class Rms {
 public:
  void add(const Vec3& value) {
    constexpr double share = 2.0 * std::numbers::pi * 20.0 * 1e-3;
    if (count_++ == 0) slow_ = value;
    slow_ += share / (1.0 + share) * (value - slow_);
    sum_ += (value - slow_).squaredNorm();
  }
  [[nodiscard]] double value() const { return std::sqrt(sum_ / count_); }

 private:
  Vec3 slow_ = Vec3::Zero();
  double sum_ = 0.0;
  int count_ = 0;
};

TEST(ShapeTouch, IsQuietBeforeANoisyCamera) {
  for (const double distance : {0.45, 0.7}) {
    if (test::sanitized && distance > 0.5) continue;
    Stage stage(plane(), "box:40x20x5mm", "d4xx", distance, 0.3);
    stage.press(pose({0, 0, -2.5e-3}));
    Rms force, torque;
    const Tick last = stage.run(
        3.0,
        [](double) {
          return pose({0, 0, -2.5e-3});
        },
        [&](const Tick& tick) {
          force.add(tick.force);
          torque.add(tick.torque);
        });
    EXPECT_NEAR(last.force.z(), 3.0, 0.6);
    EXPECT_LT(force.value(), 10e-3);
    EXPECT_LT(torque.value(), 1.5e-3);  // [N m]
  }
}

// The bits of a path: the image, the path and the tool are made without the mathematical library.
std::uint64_t hash_of_path(const Parameters& parameters) {
  Intrinsics k{.width = 160, .height = 120, .fx = 180.0, .fy = 181.0, .cx = 79.3, .cy = 60.1};
  const auto rays = std::make_shared<const ViewingRays>(k);
  ShapeTouch touch(tool("box:40x20x10mm?points=500"), parameters);
  std::uint64_t hash = 0xcbf29ce484222325U;
  std::unique_ptr<DepthImage> image;
  double force = 0.0;
  for (int i = 0; i < 600; ++i) {
    const double t = i * 1e-3;
    if (i % 33 == 0) {
      std::vector<std::uint16_t> depth;
      for (int pixel = 0; pixel < k.width * k.height; ++pixel)
        depth.push_back(
            static_cast<std::uint16_t>(500 + (pixel % k.width) / 16 + (pixel * 7 + i) % 3));
      auto next = std::make_unique<DepthImage>(rays, std::move(depth), 1000.0);
      touch.observe({*next, t});
      image = std::move(next);
    }
    const double z = 0.47 + std::min(0.035, 1e-4 * i);
    const Tick tick =
        touch.tick(HandPose{{1e-5 * i, 0, z}, Rotation(1.0, 0.1, 1e-4 * i, 0.05).normalized()}, t);
    force = tick.force.norm();
    for (const Vec3* v : {&tick.proxy, &tick.force, &tick.torque})
      for (int axis = 0; axis < 3; ++axis)
        hash = (hash ^ std::bit_cast<std::uint64_t>((*v)[axis])) * 0x100000001b3U;
  }
  EXPECT_GT(force, 0.5);
  return hash;
}

// No compiler, processor or vector set may change them.
TEST(ShapeTouch, GivesTheSameBitsEverywhere) {
  const std::string usual(vector_set_in_use());
  for (const std::string_view set : vector_sets()) {
    use_vector_set(set);
    EXPECT_EQ(hash_of_path({}), 18110266615602991260U) << set;
    EXPECT_EQ(hash_of_path(rough(0.4)), 3715831178932447453U) << set;
  }
  use_vector_set(usual);
}

}  // namespace
}  // namespace palpate
