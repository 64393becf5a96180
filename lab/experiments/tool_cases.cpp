// SPDX-License-Identifier: Apache-2.0
// Tools with a shape that must not be lost, and not pulled: seeded cases with their bounds.
#include "lab/experiments/tool_cases.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <string>

#include <fmt/format.h>

#include "lab/experiment.hpp"
#include "lab/experiments/pop_cases.hpp"
#include "lab/experiments/tool_bench.hpp"
#include "lab/play.hpp"
#include "lab/statistics.hpp"

namespace palpate::lab {
namespace {

constexpr double period = 1e-3;            // [s] of a tick
constexpr std::size_t truth_points = 200;  // of a tool: less than 8 mm from one to the next
constexpr int truth_every = 2;             // [ticks]
constexpr double margin = 1e-3;            // [m] beside the noise
constexpr double behind_after = 0.1;       // [s] in one go; from `patience` on it is lost
constexpr double pulled_after = 0.02;      // [s] in one go
constexpr double felt_force = 0.05;        // [N] a pull, or this times the tool's reach
constexpr double jump = 0.5;               // [N] within `jump_time`, that an arm must not cause
constexpr int jump_time = 10;              // [ticks]
constexpr double turn = 2.0 * std::numbers::pi;

// [m] of one reading of a D4xx: SensorModel::d4xx_noise.
double reading_sigma(double depth) {
  const double power = depth < 0.7 ? std::log(3.1 / 1.7) / std::log(0.7 / 0.45)
                                   : std::log(5.2 / 3.1) / std::log(0.9 / 0.7);
  return 3.1e-3 * std::pow(depth / 0.7, power);
}

// [m] Where a tool, held so at a place, first touches bodies as it comes down.
double touching_height(const Scene& bodies, const ToolShape& tool, HandPose pose) {
  double low = -0.1, high = 0.2;
  for (int i = 0; i < 30; ++i) {
    pose.position.z() = 0.5 * (low + high);
    (clearance(bodies, tool, pose, 0.0) < 0.0 ? low : high) = pose.position.z();
  }
  return high;
}

std::shared_ptr<const ToolShape> draw_tool(Chance& chance) {
  const auto mm = [&](double low, double high) { return std::lround(chance(low, high)); };
  const double kind = chance(0.0, 3.0);
  const long a = mm(40, 80), b = mm(30, 60), c = mm(3, 6), d = mm(8, 20);
  if (kind < 1.0) return make_tool(fmt::format("box:{}x{}x{}mm", a, b, c), {});
  if (kind < 2.0) return make_tool(fmt::format("capsule:{}x{}mm", a, d), {});
  return make_tool(fmt::format("box:{}x{}x{}mm", a / 2, b / 2, d), {});
}

struct ToolVerdict {
  double behind = 0.0;  // [s] the longest in one go
  int pulls = 0;        // of forces in free space
  double step = 0.0;    // [N] largest change of the force within `jump_time`
};

class ToolJudge {
 public:
  explicit ToolJudge(const ToolCase& one) : one_(one), bodies_(one.bodies) {}
  /// @param seen  [s] when the newest frame was captured
  void add(const Tick& tick, const HandPose& hand, double t, double seen) {
    const std::size_t now = ticks_++ % forces_.size();
    if (t >= one_.rests + period * jump_time)
      verdict_.step = std::max(verdict_.step, (tick.force - forces_[now]).norm());
    forces_[now] = tick.force;
    if (ticks_ % truth_every != 0) return;
    constexpr double passed = truth_every * period;
    const HandPose held{tick.proxy, tick.proxy_orientation};
    const double least = -margin - one_.sigma;
    const bool is_behind = clearance(bodies_, *one_.tool, held, t) < least &&
                           clearance(bodies_, *one_.tool, held, seen) < least;
    behind_ = is_behind ? behind_ + passed : 0.0;
    verdict_.behind = std::max(verdict_.behind, behind_);
    const bool is_felt =
        tick.force.norm() > felt_force || tick.torque.norm() > felt_force * one_.tool->reach();
    const bool is_pulled =
        is_felt && clearance(bodies_, *one_.tool, hand, t) > margin + 3.0 * one_.sigma;
    const double before = pulled_;
    pulled_ = is_pulled ? pulled_ + passed : 0.0;
    verdict_.pulls += before <= pulled_after && pulled_ > pulled_after ? 1 : 0;
  }
  [[nodiscard]] const ToolVerdict& verdict() const { return verdict_; }

 private:
  const ToolCase& one_;
  Scene bodies_;
  std::array<Vec3, jump_time> forces_{};  // [N] of the last ticks
  std::size_t ticks_ = 0;
  double behind_ = 0.0, pulled_ = 0.0;  // [s]
  ToolVerdict verdict_;
};

// Plays a case to several methods, which see the same frames.
std::vector<ToolVerdict> play_tool_case(const ToolCase& one,
                                        std::span<const std::string_view> methods) {
  std::vector<Part> seen = one.bodies;
  seen.insert(seen.end(), one.arms.begin(), one.arms.end());
  SensorModel model = SensorModel::named("d4xx");
  model.seed = one.noise_seed;
  SyntheticCamera camera(Scene(seen), one.camera, model);
  const HipPath path(one.hand);
  std::vector<std::unique_ptr<Method>> played;
  std::vector<ToolJudge> judges(methods.size(), ToolJudge(one));
  for (const std::string_view method : methods)
    played.push_back(make_tool_method(method, one.tool));
  std::uint64_t frames = 0;
  Frame frame;
  for (int i = 0; i < static_cast<int>(std::lround(one.ends / period)); ++i) {
    const double t = i * period;
    const HandPose hand = path.pose_at(t);
    const double due = static_cast<double>(frames) / one.camera.frame_rate;
    const bool is_new = t >= due - 1e-9;
    const Frame before = frame;  // it lives until all have the next
    if (is_new) frame = camera.capture(due, frames++);
    for (std::size_t m = 0; m < played.size(); ++m) {
      if (is_new) played[m]->observe({*frame.cloud, frame.stamp});
      judges[m].add(played[m]->tick(hand, t), hand, t, frame.stamp);
    }
  }
  std::vector<ToolVerdict> verdicts;
  for (const ToolJudge& judge : judges) verdicts.push_back(judge.verdict());
  return verdicts;
}

constexpr int block_of = 10;     // cases of a row
constexpr int peers_every = 10;  // blocks: peers cost more than what they are compared with

std::string block_rows(std::string_view family, std::uint64_t first, int cases, bool has_peers) {
  const std::span methods = std::span(tool_methods).first(has_peers ? tool_methods.size() : 1);
  struct Sum {
    int behind = 0, lost = 0, pulled = 0, jumped = 0;
    double longest = 0.0, step = 0.0;
    std::string seeds;
  };
  std::vector<Sum> sums(methods.size());
  int lifts = 0;
  for (int i = 0; i < cases; ++i) {
    const std::uint64_t seed = first + static_cast<std::uint64_t>(i);
    const ToolCase one = draw_tool_case(family, seed);
    lifts += one.lifts;
    const std::vector<ToolVerdict> verdicts = play_tool_case(one, methods);
    for (std::size_t m = 0; m < methods.size(); ++m) {
      const ToolVerdict& verdict = verdicts[m];
      Sum& sum = sums[m];
      const bool is_behind = verdict.behind > behind_after;
      const bool jumps = !one.arms.empty() && verdict.step > jump;
      sum.behind += is_behind ? 1 : 0;
      sum.lost += verdict.behind > patience ? 1 : 0;
      sum.pulled += verdict.pulls;
      sum.jumped += jumps ? 1 : 0;
      sum.longest = std::max(sum.longest, verdict.behind);
      sum.step = std::max(sum.step, verdict.step);
      if (is_behind || jumps || verdict.pulls > 0)
        sum.seeds += (sum.seeds.empty() ? "" : " ") + std::to_string(seed);
    }
  }
  std::string rows;
  for (std::size_t m = 0; m < methods.size(); ++m) {
    const Sum& sum = sums[m];
    rows += csv_row(family, methods[m], first, cases, sum.behind, sum.lost, sum.longest, lifts,
                    sum.pulled, sum.jumped, sum.step, sum.seeds);
  }
  return rows;
}

std::vector<Cell> tool_case_cells(const Experiment& /*experiment*/,
                                  const ExperimentOptions& options) {
  check_families(options, "tool-cases has no such family", tool_families);
  const int cases = options.cases.value_or(block_of);
  std::vector<Cell> cells;
  for (const std::string_view family : tool_families) {
    if (!options.wants(family)) continue;
    for (int i = 0; i < cases; i += block_of)
      cells.emplace_back([=, first = options.seed + static_cast<std::uint64_t>(i)] {
        return block_rows(family, first, std::min(block_of, cases - i),
                          i / block_of % peers_every == 0);
      });
  }
  return cells;
}

Scores tool_case_scores(const Table& table) {
  const auto total = [](std::string title, std::string_view column) {
    return shown(std::move(title), {column}, "{:.0f}", 1.0, sum);
  };
  const auto bound = [](std::string_view found, std::string_view of) {
    return Column{"at most [%]", [=](const Table& group) {
                    const auto all = static_cast<std::size_t>(sum(group.numbers(of)));
                    const auto some = static_cast<std::size_t>(sum(group.numbers(found)));
                    return all == 0 ? "-" : fmt::format("{:.3g}", 100.0 * wilson(some, all).high);
                  }};
  };
  return scores_by(
      table, {"family", "method"},
      {total("cases", "cases"), total("behind", "behind"), bound("behind", "cases"),
       total("lost", "lost"), shown("longest [ms]", {"longest"}, "{:.0f}", 1e3, largest),
       total("lifts", "lifts"), total("pulled", "pulled"), bound("pulled", "lifts"),
       total("jumps", "jumps"), shown("step [N]", {"step"}, "{:.2f}", 1.0, largest)},
      "'At most': the upper bound of the share, with 95 % confidence (Wilson). docs/tools.md.");
}

}  // namespace

double clearance(const Scene& bodies, const ToolShape& tool, const HandPose& pose, double t) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < std::min(truth_points, tool.points().size()); ++k)
    least = std::min(
        least, bodies.signed_distance(pose.position + pose.orientation * tool.points()[k].at, t));
  return least;
}

ToolCase draw_tool_case(std::string_view family, std::uint64_t seed) {
  Chance chance = chance_of(family, seed, 0);
  ToolCase one;
  one.noise_seed = seed;
  // The part of a camera's image that a tool looks at, 128 cells of two pixels; or to where it may
  // be pushed.
  Intrinsics& image = one.camera.intrinsics;
  image.fx = image.fy = CameraSetup{}.intrinsics.fx;
  image.width = image.height = family == "coming" || family == "sliding" ? 400 : 256;
  image.cx = image.cy = 0.5 * (image.width - 1);
  const double distance = chance(0.45, 0.95);
  const double tilt = chance(0.0, 0.5);
  one.camera.world_from_camera = looking_at_origin(distance, tilt, chance(0.0, turn));
  one.sigma = reading_sigma(distance);
  one.tool = draw_tool(chance);
  const double leans = chance(0.0, turn);
  const double spin = chance(0.0, turn);
  const Vec3 across(std::cos(leans), std::sin(leans), 0.0);
  const Rotation held = rotation_by(chance(0.0, 0.6) * across) * rotation_by({0.0, 0.0, spin});
  one.bodies = {part(HalfSpace{})};
  const double heading = chance(0.0, turn);
  const Vec3 ahead(std::cos(heading), std::sin(heading), 0.0);
  const double reach = one.tool->reach();

  // Drawn one after the other, whatever the compiler's order of arguments.
  const auto between = [&](const Vec3& low, const Vec3& high) {
    Vec3 drawn;
    for (int axis = 0; axis < 3; ++axis) drawn[axis] = chance(low[axis], high[axis]);
    return drawn;
  };
  // Waits clear of everything, comes down and presses; `depth` below 0: it stays above.
  constexpr double waits = 0.25, comes_down = 0.2, high = 0.03, settles = 0.3;
  const auto press = [&](double depth) {
    HandPose at{between({-0.01, -0.01, 0.0}, {0.01, 0.01, 0.0}), held};
    at.position.z() = touching_height(Scene(one.bodies), *one.tool, at) - depth;
    const Vec3 above = at.position + (high + std::max(depth, 0.0)) * Vec3::UnitZ();
    one.hand = {{0.0, above, held}, {waits, above, held}, {waits + comes_down, at.position, held}};
    one.rests = waits + comes_down + settles + chance(0.0, 1.0 / 30.0);
    return at.position;
  };
  if (family == "coming") {
    press(chance(-0.02, 8e-3));
    one.bodies[0].motion = {.start = one.rests, .speed = 0.5};
    one.ends = one.rests + 0.36;
  } else if (family == "sliding") {
    const Vec3 at = press(chance(2e-3, 8e-3));
    const double speed = chance(0.1, 0.4);
    // Lower than what may strike a surface, and higher than what noise explains.
    const double lowest = 0.01 + 3.0 * one.sigma;
    const Vec3 half = between({0.02, 0.015, 0.5 * lowest}, {0.05, 0.05, 0.03});
    const double gap = reach + chance(0.03, 0.06);
    Vec3 from = at - (gap + half.x()) * ahead + chance(-0.015, 0.015) * ahead.cross(Vec3::UnitZ());
    from.z() = half.z();
    one.bodies.push_back(part(block(half), from, {0, 0, heading}));
    one.bodies[1].motion = {.direction = ahead, .start = one.rests, .speed = speed};
    one.ends = one.rests + (gap + reach + 0.05) / speed;
  } else if (family == "passing") {
    const Vec3 at = press(chance(2e-3, 8e-3));
    const double radius = chance(0.02, 0.035);
    const double height = radius + chance(0.12, 0.18);
    const double hidden = chance(0.1, 0.5);
    const Vec3 eye = one.camera.world_from_camera.translation();
    const double share = height / eye.z();  // of the line of sight
    const double speed = 2.0 * (radius + (1.0 - share) * reach) / hidden;
    const double way = (1.0 - share) * 0.45 * distance + radius + 0.02;  // to beyond the image
    const Vec3 over = Vec3(at.x(), at.y(), 0.0) + share * (eye - Vec3(at.x(), at.y(), 0.0));
    one.arms = {part(Capsule{radius, 0.4}, over - way * ahead, {0, 0, heading})};
    one.arms[0].motion = {.direction = ahead, .start = one.rests, .speed = speed};
    one.ends = one.rests + 2.0 * way / speed + 0.1;
  } else {
    if (chance() < 0.5) {
      const Vec3 half = between({0.015, 0.015, 2.5e-3}, {0.04, 0.04, 0.02});
      const Vec3 place = between({-0.04, -0.04, half.z()}, {0.04, 0.04, half.z()});
      one.bodies.push_back(part(block(half), place, {0, 0, heading}));
    }
    one.lifts = 8;
    const Scene bodies(one.bodies);
    const double clear = 3.0 * one.sigma + margin;
    HandPose at{Vec3::Zero(), held};
    double t = 0.0;
    const auto to = [&](const Vec3& place, double speed) {
      t += std::max((place - one.hand.back().hip).norm() / speed, 0.02);
      one.hand.push_back({t, place, held});
    };
    for (int i = 0; i < one.lifts; ++i) {
      at.position = between({-0.025, -0.025, 0.0}, {0.025, 0.025, 0.0});
      at.position.z() = touching_height(bodies, *one.tool, at);
      const double above = clear + chance(0.01, 0.03);
      const Vec3 aside = between({-0.015, -0.015, above}, {0.015, 0.015, above});
      // Above where it comes down, so that nothing is met on the way there.
      Vec3 start = at.position + above * Vec3::UnitZ();
      if (one.hand.empty()) {
        one.hand.push_back({0.0, start, held});
        t = waits;
        one.hand.push_back({t, start, held});
      } else {
        start.z() = std::max(start.z(), one.hand.back().hip.z());
        to(start, 0.5);
      }
      const Vec3 deep = at.position - chance(2e-3, 8e-3) * Vec3::UnitZ();
      to(deep, chance(0.15, 0.6));
      t += chance(0.03, 0.1);
      one.hand.push_back({t, deep, held});
      to(at.position + aside, chance(0.15, 0.6));
      t += 0.03;
      one.hand.push_back({t, one.hand.back().hip, held});
    }
    one.rests = waits;
    one.ends = t;
  }
  return one;
}

Experiment tool_cases_experiment() {
  return {.name = "tool-cases",
          .summary = "seeded cases in which tools with a shape must not be lost, and not pulled",
          .header = "family,method,seed,cases,behind,lost,longest,lifts,pulled,jumps,step,seeds",
          .cells = tool_case_cells,
          .scores = tool_case_scores};
}

}  // namespace palpate::lab
