// SPDX-License-Identifier: Apache-2.0
// The scenes of `feel` with a plane; feel_friction.cpp has those with friction.
#include "lab/experiments/feel_scenes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "lab/closed_loop.hpp"
#include "lab/statistics.hpp"
#include "palpate/io/sources/synthetic_camera.hpp"

namespace palpate::lab {
namespace {

constexpr double press = 0.008;    // [m] the hand wants to be that far below the surface
constexpr double settled = 1.6;    // [s] the chain's ramp is over
constexpr double close_up = 0.45;  // [m] from the camera
constexpr double middle = 0.7;     // [m]

// Who touches, and by which way.
constexpr std::string_view path = "path";    // a given path: the open loop
constexpr std::string_view light = "light";  // a light grip on a Touch
constexpr std::string_view firm = "firm";    // a firm grip on a Touch
constexpr std::string_view free_handle = "free";
constexpr std::string_view chain = "chain";  // the light grip, or the free handle, by the chain

const DevicePreset& touch() { return device_preset("touch"); }

// The loops of all contestants that touch one scene, and beside each the same loop of the ruler, a
// sphere on the true surface: what an exact surface with the same spring would give.
class Loops {
 public:
  Loops(const FeelOptions& options, const std::shared_ptr<const Scene>& scene)
      : contestants_(options.contestants),
        parameters_(options.parameters),
        truth_(truth_of(scene)) {}

  /// Each contestant gets a loop of this name. That of the chain is compared with the ruler's
  /// without a chain.
  void add(std::string_view name, const std::function<HeldDevice()>& held) {
    const auto ruler = loops.size();
    loops.push_back(straight_loop(make_method("ideal", {parameters_, truth_}), held()));
    names.emplace_back("", name);
    rulers_.push_back(ruler);
    for (const OwnMethod& contestant : contestants_) {
      auto method = contestant.make({parameters_, truth_});
      loops.push_back(name == chain ? safe_loop(std::move(method), held(), parameters_)
                                    : straight_loop(std::move(method), held()));
      names.emplace_back(contestant.name, name);
      rulers_.push_back(ruler);
    }
  }

  /// One on the path, one lightly held, one by the chain; and, if asked for, one firmly held.
  void add_usual(const HipPath& hand, std::uint64_t seed, bool firmly) {
    add(path, [&] { return on_path(hand); });
    add(light, [&] { return in_hand(hand, grip_preset(light), touch(), seed); });
    if (firmly) add(firm, [&] { return in_hand(hand, grip_preset(firm), touch(), seed); });
    add(chain, [&] { return in_hand(hand, grip_preset(light), touch(), seed); });
  }

  /// [N] what a spring on the true surface would give where the hand is.
  [[nodiscard]] double true_force(std::size_t loop, const Felt& felt) const {
    const double depth = std::max(-truth_(felt.hip, felt.t).distance, 0.0);
    const double peak =
        names[loop].second == path ? parameters_.coupling.max_force : touch().limits.max_force;
    return std::min(parameters_.coupling.stiffness * depth, peak);
  }

  [[nodiscard]] bool is_ruler(std::size_t loop) const { return rulers_[loop] == loop; }
  [[nodiscard]] std::size_t ruler_of(std::size_t loop) const { return rulers_[loop]; }

  std::vector<std::unique_ptr<TouchLoop>> loops;
  std::vector<std::pair<std::string, std::string_view>> names;  // method and loop

 private:
  std::vector<OwnMethod> contestants_;
  Parameters parameters_;
  Truth truth_;
  std::vector<std::size_t> rulers_;
};

struct Signal {
  std::vector<double> force;  // [N] magnitude
  std::vector<double> error;  // [N] of it, beside the true force where the hand is
  std::vector<double> ruler;  // [N] magnitude, of the ruler's loop
  std::vector<double> asked;  // [N] magnitude, by the method

  [[nodiscard]] double largest_step() const {
    double largest = 0.0;
    for (std::size_t i = 1; i < error.size(); ++i)
      largest = std::max(largest, std::abs(error[i] - error[i - 1]));
    return largest;
  }
  /// [%] of the ruler's mean force
  [[nodiscard]] double largest_error() const {
    double largest = 0.0;
    for (std::size_t i = 0; i < force.size(); ++i)
      largest = std::max(largest, std::abs(force[i] - ruler[i]));
    return 100.0 * largest / mean(ruler);
  }
  [[nodiscard]] double mean_error() const {
    return 100.0 * std::abs(mean(force) / mean(ruler) - 1.0);
  }
  /// [%] of what the method asks for, in the mean
  [[nodiscard]] double share() const { return 100.0 * mean(force) / std::max(mean(asked), 1e-9); }
};

// Plays a camera to loops and keeps their signals from `from` to the end, rulers' left out.
std::vector<std::pair<std::size_t, Signal>> signals(
    const Loops& loops, const Scenario& scenario,
    const std::function<double(std::string_view loop)>& from) {
  std::vector<Signal> all(loops.loops.size());
  std::vector<double> now(loops.loops.size(), 0.0);
  play_to(loops.loops, scenario, [&](std::size_t loop, const Felt& felt) {
    now[loop] = felt.force.norm();  // the ruler's before those that are compared with it
    if (felt.t <= from(loops.names[loop].second) + 1e-9) return;
    all[loop].force.push_back(now[loop]);
    all[loop].error.push_back(now[loop] - loops.true_force(loop, felt));
    all[loop].ruler.push_back(now[loops.ruler_of(loop)]);
    all[loop].asked.push_back(felt.asked.norm());
  });
  std::vector<std::pair<std::size_t, Signal>> result;
  for (std::size_t loop = 0; loop < all.size(); ++loop) {
    if (!loops.is_ruler(loop)) result.emplace_back(loop, std::move(all[loop]));
  }
  return result;
}

// Waits 60 mm above the surface and goes to `press` below it in half a second, from a time on.
HipPath coming_down(double from) {
  const Vec3 above(0.0, 0.0, 0.060);
  std::vector<HipPath::Sample> samples = {{0.0, above}};
  if (from > 0.0) samples.push_back({from, above});
  samples.push_back({from + 0.5, {0.0, 0.0, -press}});
  return HipPath(std::move(samples));
}

// Between the two in the middle of an even number.
double middle_of(std::span<const double> repeats) {
  std::vector<double> values(repeats.begin(), repeats.end());
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

std::shared_ptr<const Scene> covered_plane(double from, double to) {
  constexpr double half = 0.3;    // [m] half of the board, along its way
  constexpr double above = 0.15;  // [m] the surface
  const double speed = 2.0 * half / (to - from);
  Motion motion;
  motion.direction = Vec3::UnitX();
  motion.start = 0.5;
  motion.speed = speed;
  const double x = -half - speed * (from - motion.start);
  return std::make_shared<const Scene>(
      std::vector<Part>{{HalfSpace{}, Eigen::Isometry3d::Identity(), Motion{}},
                        {block(Vec3(half, half, 0.005)),
                         Eigen::Isometry3d(Eigen::Translation3d(x, 0.0, above)), motion}});
}

}  // namespace

FeelStage::FeelStage(const std::string& uri)
    : camera(open_synthetic_camera(Uri(uri))), scene(std::make_shared<Scene>(camera->scene())) {}

FeelStage::FeelStage(const std::shared_ptr<const Scene>& its_scene, const std::string& options)
    : camera(camera_before(*its_scene, options)), scene(its_scene) {}

Scenario FeelStage::scenario(double duration) const {
  return {
      .frame_rate = camera->setup().frame_rate,
      .duration = duration,
      .cloud = [this](std::uint64_t frame, double t) { return camera->capture(t, frame).cloud; },
      .hip = nullptr};
}

void FeelRepeats::add(const std::pair<std::string, std::string_view>& name,
                      std::string_view measure, double value) {
  auto entry = std::find_if(entries_.begin(), entries_.end(), [&](const Entry& one) {
    return one.name == name && one.measure == measure;
  });
  if (entry == entries_.end()) entry = entries_.insert(entry, {name, measure, {}});
  entry->values.push_back(value);
}

FeelFigures FeelRepeats::figures(const std::vector<Figure>& asked) const {
  FeelFigures figures;
  for (const Figure& figure : asked) {
    for (const auto& [name, measure, values] : entries_) {
      if (measure != figure.measure) continue;
      figures.push_back({name.first, name.second,
                         std::string(figure.as.empty() ? measure : figure.as), figure.of(values)});
    }
  }
  return figures;
}

HipPath sliding_hand() {
  constexpr double half = 0.1;  // [m] of the way
  return HipPath({{0.0, {-half, 0.0, 0.060}},
                  {0.5, {-half, 0.0, -press}},
                  {1.0, {-half, 0.0, -press}},
                  {3.0, {half, 0.0, -press}}});
}

std::string camera_options(double distance, double across, std::string_view sensor,
                           std::uint64_t seed) {
  constexpr double focal = 589.0;  // [px]
  const int pixels = static_cast<int>(across * focal / distance);
  return fmt::format("size={0}x{0}&fov={1}rad&distance={2}m&sensor={3}&seed={4}", pixels,
                     2.0 * std::atan(0.5 * pixels / focal), distance, sensor, seed);
}

std::shared_ptr<SyntheticCamera> camera_before(const Scene& scene, const std::string& options) {
  const auto plain = open_synthetic_camera(Uri("synthetic:plane?" + options));
  return std::make_shared<SyntheticCamera>(scene, plain->setup(), plain->sensor().model());
}

FeelFigures play_slide(const FeelOptions& options, double distance) {
  constexpr double from = 1.2;
  const HipPath hand = sliding_hand();
  FeelRepeats repeats;
  for (int k = 0; k < options.repeats; ++k) {
    const std::uint64_t seed = options.seed_of(k);
    const FeelStage stage(
        fmt::format("synthetic:plane?distance={}m&sensor=d4xx&seed={}", distance, seed));
    Loops loops(options, stage.scene);
    loops.add_usual(hand, seed, true);
    for (const auto& [i, signal] : signals(loops, stage.scenario(3.0), [&](std::string_view loop) {
           return loop == chain ? settled : from;
         })) {
      repeats.add(loops.names[i], "felt", 1e3 * felt_rms_of_all(signal.error));
      repeats.add(loops.names[i], "step", signal.largest_step());
      repeats.add(loops.names[i], "error", signal.largest_error());
    }
  }
  return repeats.figures({{"felt", middle_of}, {"step", largest}, {"error", largest}});
}

FeelFigures play_onset(const FeelOptions& options) {
  constexpr double speed = 0.05;   // [m/s]
  constexpr double watched = 0.4;  // [s]
  FeelRepeats repeats;
  for (int k = 0; k < options.phases; ++k) {
    const double start = settled + k / (options.phases * f_c);
    const FeelStage stage(fmt::format("synthetic:plane?start={}&speed={}&{}", start, speed,
                                      camera_options(middle, 0.3, "ideal", 1)));
    Loops loops(options, stage.scene);
    loops.add_usual(coming_down(0.0), options.seed * 100 + static_cast<std::uint64_t>(k), false);
    struct Seen {
      double fastest = 0.0;  // [m/s] as the method has it
      double most = 0.0;     // [N] force so far
      double fall = 0.0;     // [N] largest below that
    };
    std::vector<Seen> seen(loops.loops.size());
    play_to(loops.loops, stage.scenario(start + watched), [&](std::size_t loop, const Felt& felt) {
      if (felt.t < start) return;
      Seen& one = seen[loop];
      one.fastest = std::max(one.fastest, felt.surface_velocity);
      const double force = felt.force.norm();
      one.most = std::max(one.most, force);
      one.fall = std::max(one.fall, one.most - force);
    });
    for (std::size_t i = 0; i < seen.size(); ++i) {
      if (loops.is_ruler(i)) continue;
      repeats.add(loops.names[i], "overshoot", seen[i].fastest / speed);
      repeats.add(loops.names[i], "swing",
                  std::max(seen[i].fall - seen[loops.ruler_of(i)].fall, 0.0));
    }
  }
  return repeats.figures(
      {{"overshoot", largest}, {"swing", middle_of, "swing-median"}, {"swing", largest}});
}

FeelFigures play_return(const FeelOptions& options, Unseen why) {
  constexpr double gone = 2.0;  // [s]
  const double back = why == Unseen::dropped ? gone + 10.0 / f_c : gone + 2.0;
  // From when on a speed counts: the handle has come to rest by then, if there is time.
  const double from = why == Unseen::dropped ? back : back - 0.5;
  FeelRepeats repeats;
  for (int k = 0; k < options.repeats; ++k) {
    const std::uint64_t seed = options.seed_of(k);
    const std::string camera = camera_options(middle, 0.3, "d4xx", seed);
    const FeelStage stage = why == Unseen::covered ? FeelStage(covered_plane(gone, back), camera)
                                                   : FeelStage("synthetic:plane?" + camera);
    Scenario scenario = stage.scenario(back + 2.0);
    if (why != Unseen::covered) {
      scenario.delay = [=](std::uint64_t frame) -> std::optional<double> {
        const double t = static_cast<double>(frame) / f_c + 1e-6;
        return t < gone || t > back ? std::optional(0.0) : std::nullopt;
      };
    }
    Loops loops(options, stage.scene);
    const HipPath hand = coming_down(0.0);
    loops.add(free_handle, [&] { return let_go(hand, touch(), gone); });
    loops.add(light, [&] { return in_hand(hand, grip_preset(light), touch(), seed); });
    loops.add(chain, [&] { return let_go(hand, touch(), gone); });
    std::vector<double> fastest(loops.loops.size(), 0.0);
    play_to(loops.loops, scenario, [&](std::size_t loop, const Felt& felt) {
      if (felt.t > from) fastest[loop] = std::max(fastest[loop], felt.speed);
    });
    for (std::size_t i = 0; i < fastest.size(); ++i) {
      if (!loops.is_ruler(i)) repeats.add(loops.names[i], "kick", 1e3 * fastest[i]);
    }
  }
  return repeats.figures({{"kick", largest}});
}

FeelFigures play_rest(const FeelOptions& options, double distance) {
  FeelOptions damped = options;
  damped.parameters.coupling.damping = 2.0;
  FeelOptions undamped = options;
  undamped.parameters.coupling.damping = 0.0;
  const HipPath hand = coming_down(0.0);
  const auto from = [](std::string_view) { return settled; };
  FeelRepeats repeats;
  for (int k = 0; k < options.repeats; ++k) {
    const std::uint64_t seed = options.seed_of(k);
    const FeelStage stage("synthetic:plane?" + camera_options(distance, 0.3, "d4xx", seed));
    Loops loops(damped, stage.scene);
    loops.add_usual(hand, seed, true);
    for (const auto& [i, signal] : signals(loops, stage.scenario(settled + 2.0), from))
      repeats.add(loops.names[i], "felt", 1e3 * felt_rms_of_all(signal.force));
    Loops without(undamped, stage.scene);
    without.add(path, [&] { return on_path(hand); });
    for (const auto& [i, signal] : signals(without, stage.scenario(settled + 2.0), from))
      repeats.add(without.names[i], "undamped", 1e3 * felt_rms_of_all(signal.force));
  }
  return repeats.figures({{"felt", middle_of}, {"undamped", middle_of}});
}

FeelFigures play_rate(const FeelOptions& options, double rate) {
  constexpr std::array latencies = {0.0, 0.1, 0.15, 0.3, 0.5};  // [s]
  FeelRepeats repeats;
  FeelFigures figures;
  for (const double latency : latencies) {
    const std::uint64_t seed = options.seed_of(0);
    const FeelStage stage(fmt::format("synthetic:plane?fps={}Hz&{}", rate,
                                      camera_options(close_up, 0.3, "d4xx", seed)));
    const double down = latency + 2.0 / rate + 0.1;
    const double from = down + settled;
    Scenario scenario = stage.scenario(from + 2.0);
    scenario.delay = [latency](std::uint64_t) { return std::optional(latency); };
    Loops loops(options, stage.scene);
    loops.add_usual(coming_down(down), seed, false);
    for (const auto& [i, signal] :
         signals(loops, scenario, [=](std::string_view) { return from; })) {
      const double buzz = 1e3 * felt_rms_of_all(signal.force);
      const double error = signal.mean_error();
      const auto& [method, loop] = loops.names[i];
      figures.push_back({method, loop, fmt::format("buzz-{}s", latency), buzz});
      figures.push_back({method, loop, fmt::format("mean-error-{}s", latency), error});
      figures.push_back({method, loop, fmt::format("share-{}s", latency), signal.share()});
      repeats.add(loops.names[i], "buzz", buzz);
      repeats.add(loops.names[i], "mean-error", error);
    }
  }
  const FeelFigures worst = repeats.figures({{"buzz", largest}, {"mean-error", largest}});
  figures.insert(figures.end(), worst.begin(), worst.end());
  return figures;
}

}  // namespace palpate::lab
