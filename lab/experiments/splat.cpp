// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <random>
#include <string>

#include "lab/experiment.hpp"
#include "lab/implicit_method.hpp"
#include "lab/method.hpp"
#include "lab/play.hpp"
#include "lab/statistics.hpp"
#include "palpate/io/sources/scene.hpp"
#include "palpate/io/sources/virtual_camera.hpp"

namespace palpate::lab {
namespace {

constexpr double splat_depth = 5e-3;      // [m] of the hand behind the surface
constexpr double splat_height = 30e-3;    // [m] above it, where the hand begins
constexpr double splat_spacing = 2e-3;    // [m] between Gaussians
constexpr double splat_down = 0.5;        // [s] until the hand is there
constexpr double splat_rest_from = 1.0;   // [s] from when on it is measured at rest
constexpr double splat_round_from = 2.0;  // [s] when it goes round
constexpr double splat_end = 5.0;         // [s] once round
constexpr double splat_rate = 60.0;       // [Hz] of the virtual camera

constexpr std::array<std::string_view, 5> splat_kinds{"clean", "floaters", "haze", "holes",
                                                      "rough"};

struct SplatShape {
  std::string_view name;
  Shape shape;
  Vec3 half;  // [m] of a box about it
};

std::vector<SplatShape> splat_shapes() {
  return {{"ball", Sphere{0.05}, Vec3::Constant(0.05)},
          {"rod", Capsule{0.02, 0.05}, {0.02, 0.07, 0.02}}};
}

// Flat Gaussians, on average one for each square of splat_spacing: the places of a lattice that are
// near the surface, moved onto it.
std::vector<Gaussian> covered(const SplatShape& of, std::string_view kind, std::uint64_t seed) {
  constexpr double wide = 0.75;            // [spacing] standard deviation along the surface
  constexpr float thin = 1e-4F;            // [m]
  constexpr double floater_height = 0.02;  // [m]
  constexpr double haze_height = 0.01;     // [m]
  constexpr double hole_radius = 4e-3;     // [m]
  constexpr double rough = 1e-3;           // [m] standard deviation of depth
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  std::vector<Gaussian> all;
  std::vector<Vec3> holes;
  const auto add = [&](const Nearest& at, double height, const Eigen::Vector3f& sigma,
                       float opacity) {
    all.push_back(
        {(at.point + height * at.normal).cast<float>(), sigma,
         Eigen::Quaternionf::FromTwoVectors(Eigen::Vector3f::UnitZ(), at.normal.cast<float>()),
         opacity});
  };
  const auto flat = static_cast<float>(wide * splat_spacing);
  const Vec3 low = -of.half - Vec3::Constant(splat_spacing);
  for (double x = low.x(); x <= -low.x(); x += splat_spacing) {
    for (double y = low.y(); y <= -low.y(); y += splat_spacing) {
      for (double z = low.z(); z <= -low.z(); z += splat_spacing) {
        const Nearest at = nearest(of.shape, {x, y, z});
        if (!(std::abs(at.distance) < 0.5 * splat_spacing)) continue;
        const double chance = uniform(random);
        if (kind == "holes" && chance < 2e-3) holes.push_back(at.point);
        if (kind == "floaters" && chance < 0.02)
          add(at, (1.0 + uniform(random)) * floater_height, {2e-3F, 2e-3F, 2e-3F}, 0.9F);
        if (kind == "haze" && chance < 0.25)
          add(at, (1.0 + uniform(random)) * haze_height, {3e-3F, 3e-3F, 3e-3F}, 0.08F);
        add(at, kind == "rough" ? rough * normal(random) : 0.0, {flat, flat, thin}, 0.95F);
      }
    }
  }
  std::erase_if(all, [&](const Gaussian& g) {
    return std::any_of(holes.begin(), holes.end(), [&](const Vec3& hole) {
      return (g.mean.cast<double>() - hole).norm() < hole_radius;
    });
  });
  return all;
}

// What is published of splats and haptics follows the gradient of their density: here a point is
// held outside of where the Gaussians' responses, each times its opacity, add up to one half.
class Density final : public ImplicitMethod {
 public:
  Density(const Parameters& parameters, const std::vector<Gaussian>& gaussians)
      : ImplicitMethod(parameters, stride, stride) {
    std::vector<Box> boxes;
    for (const Gaussian& g : gaussians) {
      const Eigen::Matrix3d axes = g.turn.cast<double>().toRotationMatrix();
      const Vec3 sigma = g.sigma.cast<double>();
      const Vec3 mean = g.mean.cast<double>();
      const Vec3 half = reach * (axes * sigma.asDiagonal()).rowwise().norm();
      boxes.push_back({mean - half, mean + half});
      fields_.push_back({mean, sigma.cwiseInverse().asDiagonal() * axes.transpose(), g.opacity});
    }
    tree_.emplace(boxes, fields_);
  }

 private:
  static constexpr double stride = 0.05e-3;  // [m] shorter than the thinnest is thick
  static constexpr double reach = 3.0;       // standard deviations
  struct One {
    Vec3 mean;
    Eigen::Matrix3d whitened;  // makes it a ball of radius 1
    double opacity;
  };

  void take(const Cloud& /*cloud*/, const Vec3& /*place*/) override {}
  void prepare(const Vec3& /*place*/) override {}
  std::optional<FieldValue> field(const Vec3& at) override {
    FieldValue result{0.5, Vec3::Zero()};
    tree_->walk([&](const Box& box) { return box.squared_distance(at) <= 0.0; },
                [&](std::uint32_t first, std::uint32_t end) {
                  for (std::uint32_t i = first; i < end; ++i) {
                    const One& one = fields_[i];
                    const Vec3 off = one.whitened * (at - one.mean);
                    const double density = one.opacity * std::exp(-0.5 * off.squaredNorm());
                    result.value -= density;
                    result.gradient += density * (one.whitened.transpose() * off);
                  }
                });
    return result;
  }

  std::vector<One> fields_;  // in the order of the tree
  std::optional<BoxTree> tree_;
};

// Down onto the top, at rest there, and once round the y axis.
Vec3 splat_hand(const Shape& shape, double t) {
  constexpr double far = 0.2;  // [m] from the middle
  const double angle =
      2.0 * std::numbers::pi *
      std::clamp((t - splat_round_from) / (splat_end - splat_round_from), 0.0, 1.0);
  const Nearest at = nearest(shape, far * Vec3(std::sin(angle), 0.0, std::cos(angle)));
  const double down = std::min(t / splat_down, 1.0);
  return at.point + (splat_height - down * (splat_height + splat_depth)) * at.normal;
}

std::vector<Vec3> splat_forces(const SplatShape& of, std::shared_ptr<const Body> body,
                               std::unique_ptr<Method> method) {
  VirtualCamera camera(std::move(body), splat_rate, {});  // looks where this hand is
  std::vector<Vec3> forces;
  method->seat(splat_hand(of.shape, 0.0));
  play(*method,
       {.frame_rate = splat_rate,
        .duration = splat_end,
        .cloud =
            [&](std::uint64_t, double t) {
              camera.follow(splat_hand(of.shape, t));
              return camera.next()->cloud;
            },
        .hip = [&](double t) { return splat_hand(of.shape, t); }},
       [&](const Tick& tick) {
         forces.push_back(tick.force);
         return true;
       });
  return forces;
}

std::string splat_row(const SplatShape& of, std::string_view kind, const std::string& name,
                      const ExperimentOptions& options) {
  const std::vector<Gaussian> gaussians = covered(of, kind, options.seed);
  const auto body = std::make_shared<const SplatBody>(gaussians, std::string(of.name));
  const auto scene =
      std::make_shared<const Scene>(std::vector<Part>{{.shape = of.shape, .motion = {}}});
  const MethodSetup setup{options.parameters, truth_of(scene)};
  const std::vector<Vec3> truth = splat_forces(of, body, make_method("ideal", setup));
  const std::vector<Vec3> forces =
      splat_forces(of, body,
                   name == "density" ? std::make_unique<Density>(options.parameters, gaussians)
                                     : make_method(name, setup, options.own_methods));
  const auto at = [](double t) { return static_cast<std::size_t>(std::lround(1e3 * t)); };
  std::vector<double> errors, angles, rest, round;
  double held = 0.0;
  for (std::size_t i = at(splat_rest_from); i < forces.size(); ++i) {
    const double due = truth[i].norm();
    const double force = forces[i].norm();
    (i < at(splat_round_from) ? rest : round).push_back(force - due);
    errors.push_back(std::abs(force - due) / due);
    if (force < 0.5 * due) continue;
    held += 1.0;
    angles.push_back(std::acos(std::clamp(forces[i].dot(truth[i]) / (force * due), -1.0, 1.0)));
  }
  const auto most = [](std::vector<double> values) {
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
    std::sort(values.begin(), values.end());
    return values[values.size() * 95 / 100];
  };
  return csv_row(of.name, kind, name, held / static_cast<double>(errors.size()), median(errors),
                 most(errors), most(angles) * 180.0 / std::numbers::pi, felt_rms_of_all(rest),
                 felt_rms_of_all(round));
}

std::vector<Cell> splat_cells(const Experiment& experiment, const ExperimentOptions& options) {
  check_families(options, "splat has no such kind", splat_kinds);
  std::vector<Cell> cells;
  for (const SplatShape& of : splat_shapes())
    for (const std::string_view kind : splat_kinds)
      for (const std::string& name : methods_of(experiment, options))
        if (options.wants(kind))
          cells.emplace_back([=] { return splat_row(of, kind, name, options); });
  return cells;
}

Scores splat_scores(const Table& table) {
  return scores_by(
      table, {"body", "splat", "method"},
      {shown("held [%]", {"held"}, "{:.1f}", 100.0),
       shown("force error [%]", {"error"}, "{:.1f}", 100.0),
       shown("95 % [%]", {"error_95"}, "{:.1f}", 100.0),
       shown("angle 95 % [deg]", {"angle_95"}, "{:.1f}"),
       shown("rest [mN]", {"rest_n"}, "{:.1f}", 1e3),
       shown("round [mN]", {"round_n"}, "{:.1f}", 1e3)},
      "Against `ideal` on the analytic body along the same path; force at rest and once round in "
      "20 to 400 Hz. docs/sources.md.");
}

}  // namespace

Experiment splat_experiment() {
  return {
      .name = "splat",
      .summary = "bodies made of Gaussians, touched all round by a virtual camera, against truth",
      .header = "body,splat,method,held,error,error_95,angle_95,rest_n,round_n",
      .default_methods = {"sight", "paper", "tsdf", "density"},
      .cells = splat_cells,
      .scores = splat_scores};
}

}  // namespace palpate::lab
