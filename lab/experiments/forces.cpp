// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "lab/experiment.hpp"
#include "lab/grid_cloud.hpp"
#include "lab/method.hpp"
#include "lab/play.hpp"
#include "lab/statistics.hpp"

namespace palpate::lab {
namespace {

constexpr double pi = std::numbers::pi;

constexpr std::array hold_levels = {0.0, 0.5, 1.0, 1.5, 2.5, 3.5, 5.0};  // [mm]

// One minute: --grid NxM takes the first N noise levels and M repeats of it.
std::vector<Cell> hold_cells(const Experiment& experiment, const ExperimentOptions& options) {
  const auto [levels, repeats] = options.grid.value_or(std::pair{7, 1});
  const bool quick = options.grid.has_value();
  const double seconds = quick ? 2.0 : 60.0;
  std::vector<Cell> cells;
  for (const std::string& name : methods_of(experiment, options)) {
    for (const Noise noise : {Noise::white, Noise::correlated}) {
      for (int level = 0; level < std::min<int>(levels, hold_levels.size()); ++level) {
        for (int k = 0; k < repeats; ++k) {
          cells.emplace_back([=] {
            const double r_c = options.parameters.proxy.r_c();
            const std::uint64_t seed = options.seed * 1000 + static_cast<std::uint64_t>(k);
            GridCloud grid = level_grid(r_c, 12.0 * r_c);
            grid.sigma = 1e-3 * hold_levels[static_cast<std::size_t>(level)];
            grid.noise = noise;
            grid.seed = seed * 7919 + static_cast<std::uint64_t>(level);
            const auto method = make_method(name, {options.parameters, flat_truth()});
            const Vec3 above(0.1 * r_c, 0.1 * r_c, 4.0 * r_c);
            method->seat(above);
            int popped = 0;
            int behind = 0;
            std::vector<double> heights;  // of the contact, once a frame
            std::vector<double> forces;
            std::int64_t frame = -1;
            double largest_step = 0.0;
            double settle_until = 0.5;
            play(*method,
                 {.duration = seconds,
                  .cloud = [&](std::uint64_t f, double) { return grid.capture(f, 0.0); },
                  .hip = [&](double) { return Vec3(0.1 * r_c, 0.1 * r_c, -6.0 * r_c); }},
                 [&](const Tick& tick) {
                   // Lost: behind the true surface for more than one frame.
                   behind = tick.proxy.z() < 0.0 ? behind + 1 : 0;
                   if (behind > 1000.0 / f_c) {
                     ++popped;
                     behind = 0;
                     method->seat(above);
                     settle_until = tick.t + 0.5;
                   }
                   if (tick.t < settle_until || tick.proxy.z() < 0.0) {
                     frame = tick.frame;
                     return true;
                   }
                   if (!forces.empty())
                     largest_step =
                         std::max(largest_step, std::abs(tick.force.z() - forces.back()));
                   forces.push_back(tick.force.z());
                   if (tick.frame != frame) heights.push_back(tick.proxy.z() - r_c);
                   frame = tick.frame;
                   return true;
                 });
            double mean = 0.0;
            for (const double h : heights) mean += h / static_cast<double>(heights.size());
            for (double& h : heights) h -= mean;
            return csv_row(name, noise == Noise::white ? "white" : "correlated", 1e3 * grid.sigma,
                           seed, seconds, popped, 1e3 * mean, 1e3 * rms(heights), largest_step,
                           felt_rms(forces));
          });
        }
      }
    }
  }
  return cells;
}

std::vector<Claim> hold_claims(const Table& table) {
  double white = 0.0;
  double lost = 0.0;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    if (table.text(row, "method") != "paper") continue;
    const double popped = table.number(row, "popped");
    if (table.text(row, "noise") == "white" && table.number(row, "sigma_mm") <= 5.0)
      white += popped;
    if (table.text(row, "noise") == "correlated") lost += popped;
  }
  return {{"6.2", "pop through never occurred without acceleration up to 2 r_c (white noise)", "0",
           fmt::format("{:g} in the minutes held", white), white == 0 ? "reproduced" : "differs"},
          {"not in the paper", "the noise of real cameras is correlated over some pixels", "-",
           fmt::format("{:g} pop-throughs of a static plane", lost),
           "the white noise of section 5 is the easy case"}};
}

Figure hold_figure(const Table& table) {
  Panel panel{.x = {"noise sigma [mm]"}, .y = {"contact error [mm]"}};
  int colour = 0;
  for (const std::string& method : methods_in(table)) {
    const auto of = [&](std::string_view noise, std::string_view y) {
      return points(table, {{"method", method}, {"noise", noise}}, "sigma_mm", y);
    };
    panel.series.push_back(
        {method + " bias, white", of("white", "bias_mm"), Line::solid, Mark::disc, colour});
    panel.series.push_back(
        {method + " jitter, white", of("white", "jitter_mm"), Line::dashed, Mark::ring, colour});
    panel.series.push_back({method + " jitter, correlated", of("correlated", "jitter_mm"),
                            Line::dotted, Mark::square, colour++});
  }
  return {{panel}};
}

std::vector<Cell> force_cells(const Experiment& experiment, const ExperimentOptions& options) {
  std::vector<Cell> cells;
  for (const std::string& name : methods_of(experiment, options))
    cells.emplace_back([=] {
      const double r_c = options.parameters.proxy.r_c();
      std::string rows;
      push_by_sine(name, options, [&](const Tick& tick, double height, double ideal) {
        rows += csv_row(name, tick.t, tick.force.z(), ideal, tick.proxy.z() - r_c, height);
      });
      return rows;
    });
  return cells;
}

struct FeltForce {
  double error = 0.0;  // [N] rms against the ideal
  double step = 0.0;   // [N] largest in a millisecond
  double band = 0.0;   // [N] rms in 20 to 400 Hz
};

FeltForce felt(const Table& table, std::string_view method) {
  const auto rows = [&](std::size_t row) { return table.text(row, "method") == method; };
  const std::vector<double> force = table.numbers("force_n", rows);
  std::vector<double> error = table.numbers("ideal_n", rows);
  FeltForce result;
  for (std::size_t i = 0; i < force.size(); ++i) {
    error[i] -= force[i];
    if (i > 0) result.step = std::max(result.step, std::abs(force[i] - force[i - 1]));
  }
  result.error = rms(error);
  result.band = felt_rms(error);
  return result;
}

std::vector<Claim> force_claims(const Table& table) {
  const FeltForce corrected = felt(table, "paper");
  const FeltForce printed = felt(table, "paper-as-printed");
  if (corrected.error == 0.0 || printed.error == 0.0) return {};
  return {
      {"4.6, (15)", "smoothens the force with moving point clouds", "no number",
       fmt::format("corrected: {:.2f} N rms error ({:.2f} N of it in 20 to 400 Hz), largest step "
                   "{:.2f} N/ms; as printed: {:.2f} N ({:.2f} N), {:.2f} N/ms",
                   corrected.error, corrected.band, corrected.step, printed.error, printed.band,
                   printed.step),
       printed.error > corrected.error
           ? "reproduced with the sign of (15) corrected; the printed sign doubles the stutter"
           : "differs"}};
}

Figure force_figure(const Table& table) {
  Panel panel{.x = {.label = "time [s]", .low = 2.0, .high = 3.0}, .y = {"force [N]"}};
  add_reference(panel, table, "ideal", "t", "ideal_n");
  add_methods(panel, table, "t", "force_n");
  return {{panel}};
}

// Into a resting plane and half out again, 5 mm back and forth at 5 Hz, never leaving it; with more
// and more damping.
std::vector<Cell> damping_cells(const Experiment& experiment, const ExperimentOptions& options) {
  std::vector<Cell> cells;
  for (const std::string& name : methods_of(experiment, options)) {
    for (const double damping : {0.0, 0.5, 1.0, 1.5, 2.0}) {
      cells.emplace_back([=] {
        const double r_c = options.parameters.proxy.r_c();
        constexpr double rate = 5.0;  // [Hz]
        constexpr double cycles = 5.0;
        GridCloud grid = level_grid(r_c, 0.06);
        Parameters parameters = options.parameters;
        parameters.coupling.damping = damping;
        parameters.coupling.max_force = 100.0;
        const auto method = make_method(name, {parameters, flat_truth()});
        method->seat(Vec3(0.1 * r_c, 0.1 * r_c, 4.0 * r_c));
        double work = 0.0;  // [J] of the device on the hand
        std::optional<Tick> last;
        play(*method,
             {.duration = 1.0 + cycles / rate,
              .cloud = [&](std::uint64_t f, double) { return grid.capture(f, 0.0); },
              .hip =
                  [&](double t) {
                    const double swing = std::cos(2.0 * pi * rate * std::max(t - 1.0, 0.0));
                    return Vec3(0.1 * r_c, 0.1 * r_c, -0.005 + 0.0025 * swing);
                  }},
             [&](const Tick& tick) {
               if (last) work += 0.5 * (last->force + tick.force).dot(tick.hip - last->hip);
               if (tick.t >= 1.0 - 1e-9) last = tick;
               return true;
             });
        return csv_row(name, damping, 1e3 * work / cycles);
      });
    }
  }
  return cells;
}

std::vector<Claim> damping_claims(const Table& table) {
  const auto most = [&](std::string_view method) {
    const std::vector<double> work = table.numbers("work_mj", [&](std::size_t row) {
      return table.text(row, "method") == method && table.number(row, "damping") == 2.0;
    });
    return work.empty() ? 0.0 : work.front();
  };
  const double corrected = most("paper");
  const double printed = most("paper-as-printed");
  if (corrected == 0.0 || printed == 0.0) return {};
  return {
      {"4.6, (16)", "k_d is a damping coefficient", "no number",
       fmt::format("at k_d = 2 N s/m a cycle takes {:.2f} mJ from the hand; as printed it gives "
                   "{:.2f} mJ",
                   -corrected, printed),
       corrected < 0.0 && printed > 0.0
           ? "reproduced with the sign of k_d corrected; as printed, it generates energy"
           : "differs"}};
}

Figure damping_figure(const Table& table) {
  Panel panel{.x = {"damping k_d [N s/m]"}, .y = {"work on the hand in a cycle [mJ]"}};
  add_methods(panel, table, "damping", "work_mj", {1.0, 1.0}, true);
  return {{panel}};
}

}  // namespace

Experiment hold_experiment() {
  return {"hold",
          "a static plane for a minute, new noise in every frame",
          "method,noise,sigma_mm,seed,seconds,popped,bias_mm,jitter_mm,force_step_n,felt_n",
          {"paper", "ideal"},
          true,
          hold_cells,
          hold_figure,
          hold_claims};
}

Experiment force_experiment() {
  return {"force",
          "4.6: the force of a plane that moves by 20 mm at 1 Hz",
          "method,t,force_n,ideal_n,contact_z,true_z",
          {"paper", "paper-as-printed"},
          false,
          force_cells,
          force_figure,
          force_claims};
}

Experiment damping_experiment() {
  return {"damping",
          "4.6: the work of a static plane on a hand that moves back and forth",
          "method,damping,work_mj",
          {"paper", "paper-as-printed"},
          false,
          damping_cells,
          damping_figure,
          damping_claims};
}

}  // namespace palpate::lab
