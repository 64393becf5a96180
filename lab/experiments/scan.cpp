// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <functional>
#include <memory>

#include <fmt/format.h>

#include "lab/experiment.hpp"
#include "lab/method.hpp"
#include "lab/play.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/cloud/audit.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/paper/paper.hpp"

namespace palpate::lab {
namespace {

constexpr double scan_speed = 0.05;  // [m/s]

// What is scanned, and how to draw it as a profile.
struct Subject {
  double frame_rate;                            // [Hz]
  double duration;                              // [s]
  std::function<Frame(std::uint64_t k)> frame;  // the k-th
  std::function<Vec3(double t)> hip;            // [m] world
  /// Along the scan and up [m].
  std::function<std::array<double, 2>(const Vec3& point)> profile;
  /// How high the surface is at a place of the profile [m].
  std::function<double(const Vec3& point, const Frame& newest)> surface;
  Truth truth;  // none of a recording
};

// 5.4: over the desk's ramp, down behind it, onto its box and off again, at 0.05 m/s and 10 to 20
// mm below the surface. x and z of the HIP; y stays in the middle of both.
constexpr std::array<std::array<double, 2>, 10> scan_path = {{{-0.27, 0.010},
                                                              {-0.27, -0.010},
                                                              {-0.05, 0.055},
                                                              {0.00, -0.012},
                                                              {0.01, -0.012},
                                                              {0.01, 0.090},
                                                              {0.05, 0.090},
                                                              {0.05, 0.055},
                                                              {0.15, 0.055},
                                                              {0.17, -0.010}}};
constexpr double scan_y = 0.08;

double scan_length(std::size_t legs) {
  double length = 0.0;
  for (std::size_t i = 0; i < legs; ++i)
    length +=
        std::hypot(scan_path[i + 1][0] - scan_path[i][0], scan_path[i + 1][1] - scan_path[i][1]);
  return length;
}

Vec3 scan_hip(double t) {
  const double gone = scan_speed * t;
  for (std::size_t i = 0; i + 1 < scan_path.size(); ++i) {
    const double end = scan_length(i + 1);
    if (gone > end && i + 2 < scan_path.size()) continue;
    const double leg = end - scan_length(i);
    const double share = std::min((gone - scan_length(i)) / leg, 1.0);
    return {scan_path[i][0] + share * (scan_path[i + 1][0] - scan_path[i][0]), scan_y,
            scan_path[i][1] + share * (scan_path[i + 1][1] - scan_path[i][1])};
  }
  return Vec3::Zero();
}

Subject synthetic_desk(std::uint64_t seed) {
  const std::shared_ptr<SyntheticCamera> camera =
      open_synthetic_camera(Uri("synthetic:desk?sensor=kinect&seed=" + std::to_string(seed)));
  const auto scene = std::make_shared<const Scene>(camera->scene());
  return {
      .frame_rate = f_c,
      .duration = scan_length(scan_path.size() - 1) / scan_speed,
      .frame = [=](std::uint64_t k) { return camera->capture(static_cast<double>(k) / f_c, k); },
      .hip = scan_hip,
      .profile =
          [](const Vec3& p) {
            return std::array{p.x(), p.z()};
          },
      .surface =
          [=](const Vec3& p, const Frame&) {
            const auto hit = scene->cast(Vec3(p.x(), scan_y, 1.0), -Vec3::UnitZ(), 0.0);
            return hit ? 1.0 - *hit : 0.0;
          },
      .truth =
          [=](const Vec3& p, double t) {
            const SurfacePoint nearest = scene->nearest(p, t);
            return TruePoint{nearest.distance, nearest.normal};
          }};
}

// What a recording's image measures about a pixel: the median of some seven by seven [m].
std::optional<double> depth_at(const DepthImage& image, int u, int v) {
  const Eigen::Vector2d ray = image.rays().ray(u, v);
  if (!ray.allFinite()) return std::nullopt;
  const Vec3 at = image.world_from_camera() * Vec3(ray.x(), ray.y(), 1.0);
  const auto behind = distance_behind(image, at, 3.5 / image.intrinsics().fx);
  if (!behind) return std::nullopt;
  return 1.0 - *behind;
}

// A stretch of an image's row.
struct Stretch {
  int v = 0;
  int from = 0;  // first column
  int to = 0;    // last column
};

// The longest stretch of a row that is measured without a jump of more than 6 mm in four pixels.
Stretch longest_stretch(const DepthImage& image) {
  constexpr double jump = 6e-3;
  constexpr int columns = 4;
  const Intrinsics& k = image.intrinsics();
  Stretch best;
  for (int v = k.height / 8; v < 7 * k.height / 8; v += 8) {
    Stretch run{v, 0, -1};
    std::optional<double> last;
    for (int u = k.width / 16; u < 15 * k.width / 16; u += columns) {
      const std::optional<double> depth = depth_at(image, u, v);
      if (!depth || !last || std::abs(*depth - *last) > jump) run.from = u;
      if (depth) run.to = u;
      if (depth && run.to - run.from > best.to - best.from) best = run;
      last = depth;
    }
  }
  const int edge = (best.to - best.from) / 8;  // what ends there may be an edge
  return {best.v, best.from + edge, best.to - edge};
}

// Along that stretch at some 0.05 m/s: from 50 mm in front of the measured surface to 10 mm
// behind it. A place each millisecond.
std::vector<Vec3> stroke_along(const DepthImage& image, const std::string& recording) {
  constexpr double hover = 0.05;
  constexpr double press = 0.01;
  constexpr double approach = 0.5;    // [s]
  constexpr double smoothing = 0.02;  // a hand does not jump
  const Intrinsics& k = image.intrinsics();
  const Stretch stretch = longest_stretch(image);
  const int pixels = stretch.to - stretch.from;
  if (pixels < k.width / 10)
    throw Error(recording, "its first frame shows no surface as wide as a seventh of the image",
                "give a recording that begins in front of a surface");
  double smooth = *depth_at(image, stretch.from, stretch.v);
  const double stroke = smooth * pixels / k.fx / scan_speed;  // [s]
  const auto ticks = static_cast<std::size_t>((approach + stroke) * 1e3);
  std::vector<Vec3> hip(ticks);
  for (std::size_t i = 0; i < ticks; ++i) {
    const double t = static_cast<double>(i) * 1e-3;
    const double along = std::max(t - approach, 0.0) / stroke * pixels;
    const int u = stretch.from + static_cast<int>(along);
    if (const auto depth = depth_at(image, u, stretch.v)) smooth += smoothing * (*depth - smooth);
    const double reach = smooth - hover + std::min(t / approach, 1.0) * (hover + press);
    const Eigen::Vector2d here = image.rays().ray(u, stretch.v);
    const Eigen::Vector2d next = image.rays().ray(u + 1, stretch.v);
    const Eigen::Vector2d ray = here + (along - std::floor(along)) * (next - here);
    hip[i] = image.world_from_camera() * (reach * Vec3(ray.x(), ray.y(), 1.0));
  }
  return hip;
}

// A recording's frames at its own rate, forth and back for as long as the scan takes.
Subject recorded(const std::string& recording) {
  const std::unique_ptr<Source> source = open_source(recording);
  constexpr std::size_t enough = 300;
  std::vector<Frame> frames;
  while (frames.size() < enough) {
    std::optional<Frame> frame = source->next();
    if (!frame) break;
    frames.push_back(std::move(*frame));
  }
  const DepthImage* first = frames.empty() ? nullptr : frames.front().cloud->image();
  if (first == nullptr)
    throw Error(recording, "it has no depth image to scan across",
                "give a recording of depth images, such as tum:FOLDER or depth:FOLDER");
  const auto hip = std::make_shared<const std::vector<Vec3>>(stroke_along(*first, recording));
  const Eigen::Isometry3d camera_from_world = first->world_from_camera().inverse();
  const double rate = source->info().frame_rate.value_or(f_c);
  return {.frame_rate = rate,
          .duration = static_cast<double>(hip->size() - 1) * 1e-3,
          .frame =
              [frames = std::move(frames), rate](std::uint64_t k) {
                Frame frame = frames[forth_and_back(k, frames.size())];
                frame.stamp = static_cast<double>(k) / rate;
                return frame;
              },
          .hip = [hip](double t) { return (*hip)[static_cast<std::size_t>(std::lround(t * 1e3))]; },
          .profile =
              [=](const Vec3& p) {
                const Vec3 at = camera_from_world * p;
                return std::array{at.x(), -at.z()};
              },
          .surface =
              [=](const Vec3& p, const Frame& newest) {
                const DepthImage* image = newest.cloud ? newest.cloud->image() : nullptr;
                const auto behind = image ? distance_behind(*image, p, 2e-3) : std::nullopt;
                return behind ? *behind - (camera_from_world * p).z()
                              : std::numeric_limits<double>::quiet_NaN();
              },
          .truth = {}};
}

std::string scan(const std::string& name, const ExperimentOptions& options) {
  const Subject subject =
      options.recording.empty() ? synthetic_desk(options.seed) : recorded(options.recording);
  const auto method = make_method(name, {options.parameters, subject.truth});
  method->seat(subject.hip(0.0));
  std::string rows;
  Frame in_use;
  std::uint64_t next = 0;
  const auto ticks = static_cast<int>(subject.duration * 1e3);
  for (int i = 0; i < ticks; ++i) {
    const double t = i * 1e-3;
    if (static_cast<double>(next) / subject.frame_rate <= t + 1e-9) {
      Frame frame = subject.frame(next++);
      method->observe({*frame.cloud, frame.stamp});
      in_use = std::move(frame);  // only now may the frame before go
    }
    const Vec3 hip = subject.hip(t);
    const Tick tick = method->tick(hip, t);
    if (i % 4 != 0 || i <= 100) continue;
    const auto [hip_y, hip_z] = subject.profile(hip);
    const auto [proxy_y, proxy_z] = subject.profile(tick.proxy);
    rows += csv_row(name, t, hip_y, hip_z, proxy_y, proxy_z, subject.surface(tick.proxy, in_use),
                    tick.force.norm(), tick.steps, tick.state != ContactState::free_motion);
  }
  return rows;
}

std::vector<Cell> scan_cells(const Experiment& experiment, const ExperimentOptions& options) {
  std::vector<Cell> cells;
  for (const std::string& name : methods_of(experiment, options))
    cells.emplace_back([=] { return scan(name, options); });
  return cells;
}

// Proxy steps a second [1/s], by this thread's own clock, along the synthetic scan.
double step_rate() {
  const Subject subject = synthetic_desk(1);
  const Frame frame = subject.frame(0);
  Paper paper;
  paper.observe({*frame.cloud, 0.0});
  const auto now = [] {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
  };
  const auto ticks = static_cast<int>(subject.duration * 1e3);
  double steps = 0.0;
  const double begin = now();
  for (int i = 0; i < ticks; ++i) steps += paper.tick(subject.hip(i * 1e-3), 0.0).steps;
  return steps / (now() - begin);
}

std::vector<Claim> scan_claims(const Table& table) {
  const auto of_paper = [&](std::size_t row) { return table.text(row, "method") == "paper"; };
  std::vector<double> steps = table.numbers("steps", of_paper);
  if (steps.empty()) return {};
  std::sort(steps.begin(), steps.end());
  const double median = steps[steps.size() / 2];
  const double few = static_cast<double>(std::count_if(steps.begin(), steps.end(),
                                                       [](double s) { return s <= 2; })) /
                     static_cast<double>(steps.size());
  const double rate = step_rate();
  return {
      {"5.4", "typically converges in 1-2 proxy steps each time the haptic device moves",
       "1-2 steps",
       fmt::format("median {:g} steps per tick, {:.0f} % of ticks in at most 2", median, 100 * few),
       median <= 2 ? "reproduced"
                   : "differs: theta = 0.1 degrees and gamma = 3/10 need more where noise turns "
                     "the normal from step to step"},
      {"5.4", "runs at a maximum rate of 30 kHz (state, normal vector and step size)", "30 kHz",
       fmt::format("{:.1f} MHz on one core", 1e-6 * rate),
       rate > 30e3 ? fmt::format("reproduced, and {:.0f} times as fast: a newer computer, and only "
                                 "the pixel window around the proxy is read",
                                 rate / 30e3)
                   : "differs: this machine is slower"}};
}

Figure scan_figure(const Table& table) {
  Panel height{.x = {"along the scan y [m]"}, .y = {"z [m]"}};
  Panel force{.x = height.x, .y = {"force [N]"}};
  add_reference(height, table, "surface", "proxy_y", "surface_z", {1.0, 1.0}, Line::solid);
  add_reference(height, table, "HIP", "hip_y", "hip_z");
  add_methods(height, table, "proxy_y", "proxy_z");
  add_methods(force, table, "hip_y", "force_n");
  return {{height, force}};
}

}  // namespace

Experiment scan_experiment() {
  Experiment experiment{"scan",
                        "5.4, Fig. 16: over a ramp and a box seen by a synthetic Kinect",
                        "method,t,hip_y,hip_z,proxy_y,proxy_z,surface_z,force_n,steps,touching",
                        {"paper", "ideal"},
                        false,
                        scan_cells,
                        scan_figure,
                        scan_claims};
  experiment.takes_recording = true;
  return experiment;
}

}  // namespace palpate::lab
