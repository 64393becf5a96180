// SPDX-License-Identifier: Apache-2.0
// The bench `feel`: that its figures of methods with known faults are those faults.
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lab/closed_loop.hpp"
#include "lab/experiments/feel_scenes.hpp"
#include "lab/method.hpp"
#include "lab/runner.hpp"
#include "lab/statistics.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/feel/feel.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/grids.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate::lab {
namespace test_feel {

// An exact plane z = 0, or the truth if it has one, with a spring of Table 2; and what a test adds.
class Plane final : public LabMethod {
 public:
  using Fault = std::function<void(Tick&)>;
  Plane(const MethodSetup& setup, Fault fault)
      : LabMethod(setup.parameters), truth_(setup.truth), fault_(std::move(fault)) {}
  void seat(const Vec3& /*proxy*/) noexcept override {}
  void frame(const Cloud& /*all*/, double /*stamp*/) noexcept override {}
  Tick tick(const Vec3& hip, double t) noexcept override {
    Tick tick;
    tick.t = t;
    tick.hip = hip;
    const double depth = truth_ ? -truth_(hip, t).distance : -hip.z();
    tick.force = parameters().coupling.stiffness * std::max(depth, 0.0) * Vec3::UnitZ();
    tick.normal = depth > 0.0 ? Vec3(Vec3::UnitZ()) : Vec3(Vec3::Zero());
    tick.proxy = hip + (std::max(depth, 0.0) + parameters().proxy.r_c()) * tick.normal;
    if (fault_) fault_(tick);
    return tick;
  }

 private:
  Truth truth_;
  Fault fault_;
};

OwnMethod plane_with(Plane::Fault fault = nullptr, std::string name = "plane") {
  return {std::move(name),
          [fault](const MethodSetup& setup) { return std::make_unique<Plane>(setup, fault); }};
}

double figure_of(const FeelFigures& figures, std::string_view loop, std::string_view measure,
                 std::string_view method = "plane") {
  for (const FeelFigure& figure : figures) {
    if (figure.method == method && figure.loop == loop && figure.measure == measure)
      return figure.value;
  }
  ADD_FAILURE() << "no figure " << loop << ' ' << measure;
  return -1.0;
}

FeelOptions once(std::vector<OwnMethod> contestants) {
  FeelOptions options;
  options.contestants = std::move(contestants);
  options.repeats = options.phases = 1;
  return options;
}

// A stretch without a camera, one loop; what it is at each tick.
std::vector<Felt> played(std::unique_ptr<TouchLoop> loop, double duration) {
  std::vector<std::unique_ptr<TouchLoop>> loops;
  loops.push_back(std::move(loop));
  const auto plane = std::make_shared<PointCloud>(test::flat_grid(), Vec3(0, 0, 1));
  std::vector<Felt> all;
  play_to(loops,
          {.duration = duration,
           .cloud = [&plane](std::uint64_t, double) { return plane; },
           .hip = nullptr},
          [&all](std::size_t, const Felt& felt) { all.push_back(felt); });
  return all;
}

const HipPath pressing({{0.0, {0, 0, 0.03}}, {0.3, {0, 0, -0.008}}});

TEST(Signal, HasTheBandOfAllItsSamples) {
  std::vector<double> signal;
  for (int i = 0; i < 1300; ++i)
    signal.push_back(3.0 + 2.0 * std::sin(2.0 * std::numbers::pi * i / 10.0) +
                     5.0 * std::sin(2.0 * std::numbers::pi * i / 130.0));
  EXPECT_NEAR(felt_rms_of_all(signal), std::numbers::sqrt2, 1e-9) << "100 Hz in, 7.7 Hz out";
}

TEST(TouchLoop, RestsWhereHandAndSurfaceBalance) {
  DevicePreset device = device_preset("touch");
  device.body.friction = 0.0;
  const Grip grip = grip_preset("light");
  const Parameters parameters;
  // Two springs in a row: 8 mm 100 N/m 600 N/m / 700 N/m, but for the resolution and the tremor.
  const double expected = 0.008 * 100.0 * 600.0 / 700.0;
  const std::vector<Felt> alone =
      played(straight_loop(std::make_unique<Plane>(MethodSetup{parameters, {}}, nullptr),
                           in_hand(pressing, grip, device, 1)),
             1.0);
  EXPECT_NEAR(alone.back().force.z(), expected, 0.04);
  EXPECT_LT(alone.back().speed, 0.02);

  const std::vector<Felt> safe =
      played(safe_loop(std::make_unique<Plane>(MethodSetup{parameters, {}}, nullptr),
                       in_hand(pressing, grip, device, 1), parameters),
             2.0);
  EXPECT_NEAR(safe.back().force.z(), expected, 0.04);
  EXPECT_LT(safe[400].force.z(), 0.75 * alone[400].force.z()) << "the chain's ramp";

  const HipPath deep({{0.0, {0, 0, 0.03}}, {0.3, {0, 0, -0.030}}});
  const std::vector<Felt> cut =
      played(straight_loop(std::make_unique<Plane>(MethodSetup{parameters, {}}, nullptr),
                           in_hand(deep, grip_preset("firm"), device, 1)),
             1.0);
  EXPECT_NEAR(cut.back().force.z(), 3.3, 1e-9) << "the motors' peak";
  const std::vector<Felt> open = played(
      straight_loop(std::make_unique<Plane>(MethodSetup{parameters, {}}, nullptr), on_path(deep)),
      1.0);
  EXPECT_NEAR(open.back().force.z(), 18.0, 1e-9) << "no motors";
}

TEST(TouchLoop, LetsGoOfAHandleThatIsPushedNoMore) {
  // No force from 0.5 s on, and 0.5 N from 1 s on.
  const auto fault = [](Tick& tick) {
    if (tick.t > 0.5) tick.force = Vec3(0, 0, tick.t > 1.0 ? 0.5 : 0.0);
  };
  const DevicePreset device = device_preset("touch");
  const std::vector<Felt> felt =
      played(straight_loop(std::make_unique<Plane>(MethodSetup{Parameters{}, {}}, fault),
                           let_go(pressing, device, 0.4)),
             1.1);
  EXPECT_NEAR(felt[499].hip.z(), -0.008, 1e-9) << "held";
  EXPECT_NEAR(felt[999].hip.z(), -0.008, 1e-4) << "at rest by itself";
  // m v' = F - f - b v, from the tick after the first of that force and its delay on.
  const DeviceBody& body = device.body;
  const double gone = 1.1 - 1.002;
  const double speed =
      (0.5 - body.friction) / body.damping * (1.0 - std::exp(-body.damping / body.mass * gone));
  EXPECT_NEAR(felt.back().speed, speed, 0.02 * speed);
}

TEST(Feel, MeasuresARippleAndNothingOfAnExactPlane) {
  const auto ripple = [](Tick& tick) {
    tick.force.z() += 0.020 * std::sin(2.0 * std::numbers::pi * 100.0 * tick.t);
  };
  const FeelFigures figures = play_rest(once({plane_with(), plane_with(ripple, "ripple")}), 0.95);
  EXPECT_LT(figure_of(figures, "path", "felt"), 1e-6);
  EXPECT_LT(figure_of(figures, "light", "felt"), 5.0) << "a count of the device's resolution";
  EXPECT_NEAR(figure_of(figures, "path", "felt", "ripple"), 20.0 / std::numbers::sqrt2, 0.1);
  EXPECT_NEAR(figure_of(figures, "path", "undamped", "ripple"), 20.0 / std::numbers::sqrt2, 0.1);
}

TEST(Feel, MeasuresStepAndErrorOfASlide) {
  // 10 % too much from 2 s on, at once.
  const auto fault = [](Tick& tick) {
    if (tick.t > 2.0) tick.force *= 1.1;
  };
  const FeelFigures figures = play_slide(once({plane_with(fault)}), 0.95);
  EXPECT_NEAR(figure_of(figures, "path", "step"), 0.48, 1e-6);
  EXPECT_NEAR(figure_of(figures, "path", "error"), 10.0, 1e-6);
  EXPECT_NEAR(figure_of(figures, "light", "step"), 0.1 * 0.686, 0.03);
}

TEST(Feel, MeasuresOvershootAndSwingOfAnOnset) {
  // Twice the plane's speed, and a force that drops by 0.5 N for a moment, 0.2 s after the onset.
  const auto fault = [](Tick& tick) {
    tick.surface_velocity = tick.t > 1.7 ? 0.1 : 0.0;
    if (tick.t > 1.8 && tick.t < 1.81) tick.force.z() -= 0.5;
  };
  const FeelFigures figures = play_onset(once({plane_with(), plane_with(fault, "faulty")}));
  EXPECT_NEAR(figure_of(figures, "path", "overshoot", "faulty"), 2.0, 1e-9);
  // The true force rises by 0.03 N a tick in between.
  EXPECT_NEAR(figure_of(figures, "path", "swing", "faulty"), 0.5, 0.031);
  EXPECT_EQ(figure_of(figures, "path", "swing"), 0.0);
  EXPECT_LT(figure_of(figures, "light", "swing"), 1e-9) << "beside the ruler's";
}

TEST(Feel, MeasuresTheKickOfAForceThatComesBack) {
  // Away while no frame comes, and back at once or over five seconds.
  const auto back_over = [](double ramp) {
    return [ramp](Tick& tick) {
      if (tick.t > 2.0) tick.force *= std::clamp((tick.t - 4.0) / ramp, 0.0, 1.0);
    };
  };
  const FeelFigures figures = play_return(
      once({plane_with(), plane_with(back_over(1e-3), "slam"), plane_with(back_over(5.0), "slow")}),
      Unseen::stopped);
  EXPECT_GT(figure_of(figures, "light", "kick", "slam"), 200.0);
  EXPECT_LT(figure_of(figures, "light", "kick", "slow"), 20.0);
  EXPECT_GT(figure_of(figures, "free", "kick", "slam"),
            4.0 * figure_of(figures, "free", "kick", "slow"));
  EXPECT_EQ(figure_of(figures, "free", "kick"), 0.0) << "what stays does not come back";
}

TEST(Feel, MeasuresFrictionThatIsWrongAndHandsThatCreep) {
  // Without a coefficient; with the whole of the static one; and a spring that lets the hand creep
  // by 50 um/s.
  const auto rough = [](const OwnMethod& plane) {
    return OwnMethod{plane.name + "-rough", [plane](const MethodSetup& setup) {
                       return std::make_unique<palpate::Feel>(plane.make(setup), setup.parameters);
                     }};
  };
  const auto half_too_much = [](Tick& tick) {
    if (tick.force.z() > 0.0) tick.force.x() = -0.5 * 1.5 * tick.force.z();
  };
  const OwnMethod right = rough(plane_with());
  const FeelFigures rubs = play_rub(once({right, plane_with(half_too_much)}));
  EXPECT_LT(figure_of(rubs, "path", "ratio", "plane-rough"), 1.0);
  EXPECT_GT(figure_of(rubs, "path", "ratio", "plane"), 50.0);
  const auto creeping = [](Tick& tick) {
    const double anchor = 1.5e-3 + 50e-6 * tick.t;
    if (tick.force.z() > 0.0) tick.force.x() = 600.0 * (anchor - tick.hip.x());
  };
  const FeelFigures sticks = play_stick(once({right, plane_with(creeping)}), 0.0);
  EXPECT_LT(figure_of(sticks, "light", "drift", "plane-rough"), 0.01);
  EXPECT_NEAR(figure_of(sticks, "light", "drift"), 0.5 * 600.0 / 700.0, 0.02);
}

TEST(Feel, CountsTheEnergyThatAMethodGivesBeyondAnExactSurface) {
  // Pushes 0.6 N harder out than in.
  struct Way {
    double height = 0.0;
    bool out = false;
  };
  const OwnMethod pushing{"pushing", [](const MethodSetup& setup) {
                            auto last = std::make_shared<Way>();
                            return std::make_unique<Plane>(setup, [last](Tick& tick) {
                              const double z = tick.hip.z();
                              if (std::abs(z - last->height) > 1e-4) *last = {z, z > last->height};
                              if (last->out && !tick.force.isZero()) tick.force.z() += 0.6;
                            });
                          }};
  const FeelFigures figures = play_energy(once({plane_with(), pushing}), 0.7, "d4xx");
  const auto figure = [&](std::string_view method, std::string_view loop,
                          std::string_view measure) {
    return figure_of(figures, loop, measure, method);
  };
  EXPECT_EQ(figure("plane", "light", "contacts"), 8.0);
  for (const char* loop : {"light", "firm", "omega", "chain"}) {
    EXPECT_LT(std::abs(figure("plane", loop, "above")), 0.02) << loop;
    EXPECT_GT(figure("pushing", loop, "above"), figure("plane", loop, "above")) << loop;
  }
  EXPECT_GT(figure("pushing", "light", "above-median"), 0.5) << "0.6 N over some millimetres";
  EXPECT_EQ(figure("pushing", "light", "over-0.1mJ"), 100.0);
}

TEST(Feel, JudgesTheScenesThatAreAskedFor) {
  const test::TemporaryFolder folder;
  ExperimentOptions options;
  options.methods = {"ideal"};
  options.families = {"onset"};
  options.grid = {1, 1};
  const Experiment& feel = find_experiment("feel");
  const Table table("feel", run_experiment(feel, options, {}, folder.path() / "feel.csv"));
  ASSERT_EQ(table.rows(), 9U);
  const Scores scores = feel.scores(table);
  ASSERT_EQ(scores.rows.size(), 10U);
  EXPECT_EQ(scores.rows.back(), (std::vector<std::string>{"aims met", "", "", "4", "4"}));
  options.families = {"onsets"};
  EXPECT_TRUE(test::fails_saying([&] { return feel.cells(feel, options).size(); },
                                 "--families onsets", "did you mean 'onset'"));
}

TEST(MaterialsExperiment, TellsIceFromRubberAndSandpaper) {
  const Experiment& experiment = find_experiment("materials");
  ExperimentOptions options;
  options.families = {"ice", "rubber", "sandpaper"};
  const test::TemporaryFolder folder;
  const Table table("materials",
                    run_experiment(experiment, options, {}, folder.path() / "materials.csv"));
  const Scores scores = experiment.scores(table);
  ASSERT_EQ(scores.rows.size(), 3U);
  const auto number = [&](std::size_t row, std::size_t column) {
    return std::stod(scores.rows[row][column]);
  };
  // Stiffness, strike, friction, and what shakes in a stroke and at rest.
  EXPECT_NEAR(number(0, 1), 600.0, 6.0);
  EXPECT_NEAR(number(1, 1), 300.0, 6.0);
  EXPECT_NEAR(number(0, 3), 0.03, 0.01);
  EXPECT_NEAR(number(1, 3), 0.85, 0.02);
  EXPECT_NEAR(number(2, 3), 0.76, 0.02);
  EXPECT_LT(number(0, 4), 0.5);
  // The safety chain lets the grain through.
  EXPECT_GT(number(2, 4), 200.0);
  for (std::size_t row = 0; row < 3; ++row) EXPECT_LT(number(row, 5), 0.5) << row;
  options.families = {"rubbr"};
  EXPECT_TRUE(
      test::fails_saying([&] { experiment.cells(experiment, options); }, "rubbr", "", "rubber"));
}

}  // namespace test_feel
}  // namespace palpate::lab
