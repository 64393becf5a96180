// SPDX-License-Identifier: Apache-2.0
#include "lab/experiments/tradeoff.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>

#include <fmt/format.h>

#include "lab/method.hpp"
#include "lab/play.hpp"
#include "lab/signal.hpp"
#include "palpate/sources/synthetic_camera.hpp"

namespace palpate::lab {
namespace {

constexpr double f_c = 30.0;          // [Hz]
constexpr double press = 0.010;       // [m] the hand goes that far below the true surface
constexpr double contact_time = 0.4;  // [s]
constexpr double rest_from = 1.0;     // [s] jitter is measured from here
constexpr double onset = 1.6;         // [s] to here
constexpr double duration = 2.1;      // [s]
constexpr double patience = 0.5;      // [s] behind for longer than this is lost
constexpr int usual_repeats = 12;
constexpr std::array distances = {0.45, 0.7, 0.95};    // [m]
constexpr std::array speeds = {0.02, 0.05, 0.1, 0.2};  // [m/s]
constexpr std::array windows = {1, 2, 4, 8, 16, 32};   // [frames] of the plain means

// The reference: nothing but the mean height of the points within 30 mm over the last frames. It is
// given that the surface is level.
class MeanOfFrames final : public LabMethod {
 public:
  MeanOfFrames(const Parameters& parameters, std::size_t window)
      : LabMethod(parameters), window_(window) {}
  void seat(const Vec3& /*proxy*/) noexcept override {}
  void frame(const Cloud& cloud, double /*stamp*/) noexcept override {
    gather(cloud, Beam{Vec3::Zero(), 0.030, 0.3, -Vec3::UnitZ()}, Patch::capacity, patch_);
    if (patch_.size() == 0) return;
    double sum = 0.0;
    for (std::size_t i = 0; i < patch_.size(); ++i) sum += patch_.z()[i];
    heights_.push_back(sum / static_cast<double>(patch_.size()));
    const std::size_t used = std::min(window_, heights_.size());
    height_ =
        std::accumulate(heights_.end() - static_cast<std::ptrdiff_t>(used), heights_.end(), 0.0) /
        static_cast<double>(used);
  }
  Tick tick(const Vec3& hip, double t) noexcept override {
    const double z = std::max(hip.z(), height_ + parameters().proxy.r_c());
    return {.t = t,
            .hip = hip,
            .proxy = Vec3(hip.x(), hip.y(), z),
            .normal = Vec3::UnitZ(),
            .force = Vec3::Zero(),
            .state = ContactState::contact,
            .steps = 0,
            .surface_velocity = 0.0,
            .frame = 0,
            .flags = 0};
  }

 private:
  std::size_t window_;
  Patch patch_;
  std::vector<double> heights_;
  double height_ = 0.0;
};

// Several methods at once, so that a frame is made but once.
class Chorus final : public Method {
 public:
  explicit Chorus(std::vector<std::unique_ptr<Method>> members)
      : members_(std::move(members)), ticks_(members_.size()) {}
  void seat(const Vec3& proxy) noexcept override {
    for (const auto& member : members_) member->seat(proxy);
  }
  void observe(const Observation& seen) noexcept override {
    for (const auto& member : members_) member->observe(seen);
  }
  Tick tick(const Vec3& hip, double t) noexcept override {
    for (std::size_t i = 0; i < members_.size(); ++i) ticks_[i] = members_[i]->tick(hip, t);
    return ticks_.front();
  }
  void set_parameters(const Parameters& parameters) noexcept override {
    for (const auto& member : members_) member->set_parameters(parameters);
  }
  [[nodiscard]] const std::vector<Tick>& ticks() const { return ticks_; }

 private:
  std::vector<std::unique_ptr<Method>> members_;
  std::vector<Tick> ticks_;
};

struct Measured {
  std::vector<double> at_rest;  // [m] contact errors
  std::vector<double> lag;      // [m] by time since the onset, summed over the held cases
  int held = 0;
  int lost = 0;
};

SyntheticCamera camera_above(const Scene& scene, double distance, std::uint64_t seed) {
  constexpr double focal = 589.0;  // [px] as 640 pixels across 57 degrees
  const int pixels = std::min(320, static_cast<int>(0.3 * focal / distance));
  CameraSetup setup;
  setup.intrinsics = pinhole(pixels, pixels, 2.0 * std::atan(0.5 * pixels / focal));
  setup.world_from_camera = looking_at_origin(distance, 0.0, 0.0);
  setup.frame_rate = f_c;
  SensorModel sensor = SensorModel::named("d4xx");
  sensor.seed = seed;
  return {scene, setup, sensor};
}

// The methods asked for and then the plain means.
std::vector<std::string> names_of(const Experiment& experiment, const ExperimentOptions& options) {
  std::vector<std::string> names = methods_of(experiment, options);
  for (const int window : windows) names.push_back(fmt::format("mean-{}", window));
  return names;
}

Chorus chorus_of(const std::vector<std::string>& names, const Parameters& parameters,
                 const Truth& truth) {
  std::vector<std::unique_ptr<Method>> members;
  for (std::size_t i = 0; i + windows.size() < names.size(); ++i)
    members.push_back(make_method(names[i], {parameters, truth}));
  for (const int window : windows)
    members.push_back(std::make_unique<MeanOfFrames>(parameters, static_cast<std::size_t>(window)));
  return Chorus(std::move(members));
}

std::vector<Measured> measure(const std::vector<std::string>& names,
                              const ExperimentOptions& options, double distance,
                              double speed_of_motion) {
  const double r_c = options.parameters.proxy.r_c();
  const int repeats = options.cases.value_or(usual_repeats);
  const auto watched = static_cast<std::size_t>(1000.0 * (duration - onset - 1.0 / f_c));
  std::vector<Measured> measured(names.size());
  for (Measured& one : measured) one.lag.assign(watched, 0.0);
  for (int k = 0; k < repeats; ++k) {
    const double speed = k % 2 == 0 ? speed_of_motion : -speed_of_motion;
    const double start = onset + k / (repeats * f_c);  // another phase of the frames each time
    const auto scene = std::make_shared<const Scene>(
        make_scene(Uri(fmt::format("synthetic:plane?start={}&speed={}", start, speed))));
    const auto height = [&](double t) { return speed * std::max(t - start, 0.0); };
    SyntheticCamera camera =
        camera_above(*scene, distance, options.seed * 1000 + static_cast<std::uint64_t>(k));
    Chorus chorus = chorus_of(names, options.parameters, truth_of(scene));
    const auto above = [&](double t) {
      return height(t) + std::max(0.15 * (contact_time - t), -press);
    };
    chorus.seat(Vec3(0.0, 0.0, above(0.0)));
    struct Seen {
      std::vector<double> at_rest, lag;
      int behind = 0;
      bool lost = false;
    };
    std::vector<Seen> seen(names.size());
    play(chorus,
         {.frame_rate = f_c,
          .duration = duration,
          .cloud = [&](std::uint64_t f, double t) { return camera.capture(t, f).cloud; },
          .hip = [&](double t) { return Vec3(0.0, 0.0, above(t)); }},
         [&](const Tick& tick) {
           for (std::size_t i = 0; i < seen.size(); ++i) {
             Seen& one = seen[i];
             const double now = chorus.ticks()[i].proxy.z() - height(tick.t);
             one.behind = now < 0.0 ? one.behind + 1 : 0;
             one.lost = one.lost || one.behind > patience * 1000.0;
             if (tick.t >= rest_from && tick.t < onset) one.at_rest.push_back(now - r_c);
             if (tick.t >= start && one.lag.size() < watched)
               one.lag.push_back((r_c - now) * (speed > 0.0 ? 1.0 : -1.0));
           }
           return true;
         });
    for (std::size_t i = 0; i < seen.size(); ++i) {
      Measured& all = measured[i];
      if (seen[i].lost) {
        ++all.lost;
        continue;
      }
      ++all.held;
      all.at_rest.insert(all.at_rest.end(), seen[i].at_rest.begin(), seen[i].at_rest.end());
      for (std::size_t j = 0; j < seen[i].lag.size(); ++j) all.lag[j] += seen[i].lag[j];
    }
  }
  return measured;
}

// The largest mean over a frame of what all repeats together lag behind.
double largest_lag(const Measured& measured) {
  const auto frame = static_cast<std::size_t>(std::lround(1000.0 / f_c));
  double largest = 0.0;
  for (std::size_t i = 0; i + frame <= measured.lag.size(); i += frame) {
    const auto begin = measured.lag.begin() + static_cast<std::ptrdiff_t>(i);
    const double sum = std::accumulate(begin, begin + static_cast<std::ptrdiff_t>(frame), 0.0);
    largest = std::max(largest, sum / static_cast<double>(frame) / measured.held);
  }
  return largest;
}

std::string row_of(std::string_view name, double distance, double speed, const Measured& measured) {
  Row row;
  row.add(name).add(distance).add(speed).add(measured.held).add(measured.lost);
  if (measured.held == 0) return row.add("nan").add("nan").add("nan").done();
  const double lag = largest_lag(measured);
  return row.add(1e3 * rms(measured.at_rest)).add(1e3 * lag).add(lag / speed * f_c).done();
}

std::vector<Cell> tradeoff_cells(const Experiment& experiment, const ExperimentOptions& options) {
  std::vector<Cell> cells;
  const std::vector<std::string> names = names_of(experiment, options);
  for (const double distance : distances) {
    for (const double speed : speeds) {
      cells.emplace_back([=] {
        const std::vector<Measured> measured = measure(names, options, distance, speed);
        std::string rows;
        for (std::size_t i = 0; i < names.size(); ++i)
          rows += row_of(names[i], distance, speed, measured[i]);
        return rows;
      });
    }
  }
  return cells;
}

Scores tradeoff_scores(const Table& table) {
  Scores scores;
  scores.columns = {"distance [m]", "method", "lost", "jitter at rest [mm]"};
  for (const double speed : speeds)
    scores.columns.push_back(fmt::format("lag at {} m/s [mm]", speed));
  for (const double distance : distances) {
    for (const std::string& method : methods_in(table)) {
      const auto all = [&](std::size_t row) {
        return table.text(row, "method") == method && table.number(row, "distance_m") == distance;
      };
      const auto figure = [](double value) {
        return std::isnan(value) ? std::string("-") : fmt::format("{:.2f}", value);
      };
      double lost = 0.0;
      double held = 0.0;
      for (const double value : table.numbers("lost", all)) lost += value;
      for (const double value : table.numbers("held", all)) held += value;
      std::vector<std::string> line = {fmt::format("{}", distance), method,
                                       fmt::format("{:g} of {:g}", lost, lost + held)};
      // At rest all speeds are alike: their mean.
      double squares = 0.0;
      const std::vector<double> jitter = table.numbers("jitter_mm", all);
      for (const double value : jitter) squares += value * value;
      line.push_back(figure(std::sqrt(squares / static_cast<double>(jitter.size()))));
      for (const double value : table.numbers("lag_mm", all)) line.push_back(figure(value));
      scores.rows.push_back(std::move(line));
    }
  }
  scores.note =
      "mean-N is a simple mean over the last N frames and 30 mm around the contact, for "
      "comparison. Measures: docs/pop.md.";
  return scores;
}

Figure tradeoff_figure(const Table& table) {
  Panel panel{.x = {.label = "jitter at rest [mm rms]", .log = true},
              .y = {.label = "largest lag behind 0.1 m/s [mm]", .low = 0.0}};
  const auto is_mean = [](std::string_view method) { return method.substr(0, 5) == "mean-"; };
  const auto add = [&](std::string_view method, Line line, Mark mark) {
    for (std::size_t i = 0; i < distances.size(); ++i) {
      const auto keep = [&](std::size_t row) {
        const std::string& name = table.text(row, "method");
        return (line == Line::solid ? is_mean(name) : name == method) &&
               table.number(row, "distance_m") == distances[i] &&
               table.number(row, "speed") == 0.1 && table.number(row, "held") > 0.0;
      };
      panel.series.push_back({fmt::format("{}, {} m", method, distances[i]),
                              points(table, keep, "jitter_mm", "lag_mm"), line, mark,
                              static_cast<int>(i)});
    }
  };
  add("means of 1 to 32 frames", Line::solid, Mark::dot);
  for (const std::string& method : methods_in(table))
    if (!is_mean(method)) add(method, Line::none, mark_of(panel.series.size() / distances.size()));
  return {{panel}};
}

}  // namespace

Experiment tradeoff_experiment() {
  return {"tradeoff",
          "lag behind a surface that begins to move, against noise at rest",
          "method,distance_m,speed,held,lost,jitter_mm,lag_mm,lag_frames",
          {"paper", "sight"},
          false,
          tradeoff_cells,
          tradeoff_figure,
          no_claims,
          tradeoff_scores};
}

}  // namespace palpate::lab
