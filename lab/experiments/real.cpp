// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>

#include <fmt/format.h>

#include "lab/experiment.hpp"
#include "lab/experiments/pop.hpp"
#include "lab/experiments/pop_cases.hpp"
#include "lab/method.hpp"
#include "lab/play.hpp"
#include "lab/sha256.hpp"
#include "lab/statistics.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/audit.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/linear.hpp"

namespace palpate::lab {
namespace {

constexpr double press_depth = 0.008;  // [m] how far below the surface the hand goes
constexpr double contact_time = 0.4;   // [s]
constexpr double flat_radius = 0.025;  // [m] a place is flat as far as that
constexpr double patch_radius = 0.06;  // [m] of the patch that is cut out and moved
constexpr std::size_t most_places = 8;
constexpr std::size_t most_frames = 60;
constexpr double nearest = 0.2, farthest = 1.5;  // [m] from the camera, of places
// Where nothing is recorded: the desk before a D4xx, eight frames.
constexpr std::string_view stand_in = "synthetic:desk?sensor=d4xx&frames=8";

// A place on the recorded surface: a flat one, in the camera's frame, or one that is followed, in
// the world.
struct Place {
  Vec3 at;      // [m]
  Vec3 normal;  // [-] towards the camera
};

struct Recording {
  std::vector<std::shared_ptr<const DepthImage>> frames;
  double rate = 30.0;  // [Hz]
  bool at_rest = true;
  std::vector<Place> places;

  [[nodiscard]] const std::shared_ptr<const DepthImage>& frame(std::uint64_t k) const {
    return frames[forth_and_back(k, frames.size())];
  }
};

// The mean of all frames, pixel by pixel, in tenths of a millimetre and in the camera's frame.
DepthImage mean_of(const std::vector<std::shared_ptr<const DepthImage>>& frames) {
  const DepthImage& first = *frames.front();
  const std::size_t pixels = first.depth().size();
  std::vector<double> sum(pixels, 0.0);
  std::vector<int> count(pixels, 0);
  for (const auto& frame : frames) {
    for (std::size_t i = 0; i < pixels; ++i) {
      if (!is_measured(frame->depth()[i])) continue;
      sum[i] += frame->depth()[i];
      ++count[i];
    }
  }
  constexpr double fine = 1e4;  // [1/m]
  std::vector<std::uint16_t> depth(pixels, 0);
  for (std::size_t i = 0; i < pixels; ++i) {
    if (4 * count[i] < 3 * static_cast<int>(frames.size())) continue;
    const double value = sum[i] / count[i] / first.units_per_metre() * fine;
    if (value < 65534.0) depth[i] = static_cast<std::uint16_t>(std::lround(value));
  }
  return {first.shared_rays(), std::move(depth), fine};
}

// The plane about a point of an image; if it must be `flat`, only one that is flat, whole and seen
// at less than 60 degrees, in the camera's frame.
std::optional<Place> plane_about(const DepthImage& image, const Vec3& point, double radius,
                                 bool flat) {
  Patch patch;
  gather(image, Ball{point, radius}, patch);
  if (patch.size() < (flat ? 50U : 12U)) return std::nullopt;
  Eigen::Matrix3Xd points(3, static_cast<Eigen::Index>(patch.size()));
  for (std::size_t i = 0; i < patch.size(); ++i)
    points.col(static_cast<Eigen::Index>(i)) = Vec3(patch.x()[i], patch.y()[i], patch.z()[i]);
  const Vec3 mean = points.rowwise().mean();
  const Eigen::Matrix3Xd centred = points.colwise() - mean;
  const Axes axes = axes_of(centred * centred.transpose());
  Vec3 normal = axes.vectors.col(0);
  if (normal.dot(point - image.world_from_camera().translation()) > 0.0) normal = -normal;
  const Place place{point + normal * normal.dot(mean), normal};
  if (!flat) return place;
  const double cosine = -normal.dot(point.normalized());
  const double spread = std::sqrt(axes.values[0] / static_cast<double>(patch.size()));
  const double pixels =
      std::numbers::pi * cosine * std::pow(radius * image.intrinsics().fx / point.z(), 2);
  if (cosine < 0.5 || spread > 2.5e-3 || static_cast<double>(patch.size()) < 0.8 * pixels)
    return std::nullopt;
  return place;
}

Recording read_frames(const std::string& uri) {
  const std::unique_ptr<Source> source = open_source(uri);
  Recording recording;
  while (recording.frames.size() < most_frames) {
    const std::optional<Frame> frame = source->next();
    if (!frame) break;
    std::shared_ptr<const DepthImage> image(frame->cloud, frame->cloud->image());
    if (!image)
      throw Error(uri, "it has no depth images",
                  "give a recording of depth images, such as tum:FOLDER or depth:FOLDER");
    recording.frames.push_back(std::move(image));
  }
  if (recording.frames.empty()) throw Error(uri, "it has no frames", "give another recording");
  recording.rate = source->info().frame_rate.value_or(30.0);
  return recording;
}

// @param most  places; of more, so many are taken evenly
Recording open_recording(const std::string& uri, std::size_t most = most_places) {
  Recording recording = read_frames(uri);
  const DepthImage& first = *recording.frames.front();
  // At rest: half of what the last frame measured is within 8 mm of what the first did.
  const auto& a = first.depth();
  const auto& b = recording.frames.back()->depth();
  std::vector<double> change;
  for (std::size_t i = 0; i < a.size(); i += 7) {
    if (is_measured(a[i]) && is_measured(b[i])) change.push_back(std::abs(int{a[i]} - int{b[i]}));
  }
  if (change.empty()) throw Error(uri, "its frames do not overlap", "give another recording");
  recording.at_rest = median(change) <= 0.008 * first.units_per_metre();

  const DepthImage image =
      recording.at_rest ? mean_of(recording.frames) : mean_of({recording.frames.front()});
  std::vector<Place> all;
  const Intrinsics& k = image.intrinsics();
  for (int v = k.height / 8; v < 7 * k.height / 8; v += 20) {
    for (int u = k.width / 8; u < 7 * k.width / 8; u += 20) {
      const auto point = image.deproject(u, v);
      if (!point || point->z() < nearest || point->z() > farthest) continue;
      if (const auto place = plane_about(image, *point, flat_radius, true)) all.push_back(*place);
    }
  }
  if (all.empty())
    throw Error(uri, "it shows nothing flat between 0.2 and 1.5 m",
                "give a recording of a room or a table");
  for (std::size_t i = 0; i < std::min(most, all.size()); ++i)
    recording.places.push_back(all[i * all.size() / std::min(most, all.size())]);
  return recording;
}

enum class Action { hold, slide, moving, sweep, press, stroke };
constexpr std::array action_names = {"hold", "slide", "moving", "sweep", "press", "stroke"};
constexpr std::size_t drawn_actions = 4;  // the first of them
std::string_view name_of(Action action) { return action_names[static_cast<std::size_t>(action)]; }

constexpr double onset = 0.9;          // [s] of what moves
constexpr double lift = 1.9;           // [s] when `press` and `stroke` leave the surface
constexpr double hand_speed = 0.15;    // [m/s] towards the surface, and away from it
constexpr double stroke_speed = 0.05;  // [m/s] along the surface

// How it moves; what `palpate eval real` plays unless it is drawn.
struct PatchMotion {
  Action action = Action::hold;
  double stroke = 0.020;    // [m] of `moving`
  double frequency = 0.5;   // [Hz] of it
  double nearer = 0.75;     // the sweeping patch's distance, as a share of the contact's
  double speed = 0.25;      // [m/s] of it
  std::uint64_t first = 0;  // the recording's frame that is shown first
};

bool is_followed(Action action) { return action == Action::press || action == Action::stroke; }

double duration_of(Action action) {
  if (is_followed(action)) return lift + 0.3;
  return action == Action::hold ? contact_time + 2.5 : action == Action::slide ? 1.9 : 2.9;
}

// How far from the camera the place is, as a share of where it was recorded. Scaled about the
// camera, every point stays on its line of sight.
double scale_at(const PatchMotion& motion, const Place& place, double t) {
  if (motion.action != Action::moving || t < onset) return 1.0;
  const double phase = 2.0 * std::numbers::pi * motion.frequency * (t - onset);
  const double shift = 0.5 * motion.stroke * (1.0 - std::cos(phase));
  return 1.0 - shift / place.at.norm();
}

// A recorded frame with the patch about the place moved, or with a copy of it that sweeps by.
std::shared_ptr<const DepthImage> composed(const DepthImage& frame, const Place& place,
                                           const PatchMotion& motion, double t) {
  const Intrinsics& k = frame.intrinsics();
  std::vector<std::uint16_t> depth = frame.depth().copy();
  const double cu = k.fx * place.at.x() / place.at.z() + k.cx;
  const double cv = k.fy * place.at.y() / place.at.z() + k.cy;
  const double radius = patch_radius * k.fx / place.at.z();  // [px]
  const bool sweeps = motion.action == Action::sweep;
  const double scale = sweeps ? motion.nearer : scale_at(motion, place, t);
  // From one side to the other in two seconds, over the place after one, at the patch's distance.
  const int by = sweeps ? static_cast<int>(std::lround(motion.speed * (t - onset - 1.0) * k.fx /
                                                       (motion.nearer * place.at.z())))
                        : 0;
  const int v_begin = std::max(static_cast<int>(cv - radius), 0);
  const int v_end = std::min(static_cast<int>(cv + radius) + 1, k.height);
  const int u_begin = std::max(static_cast<int>(cu - radius), 0);
  const int u_end = std::min(static_cast<int>(cu + radius) + 1, k.width);
  for (int v = v_begin; v < v_end; ++v) {
    for (int u = u_begin; u < u_end; ++u) {
      if ((u - cu) * (u - cu) + (v - cv) * (v - cv) > radius * radius) continue;
      const std::uint16_t raw = frame.depth()[static_cast<std::size_t>(v) * k.width + u];
      if (!is_measured(raw) || u + by < 0 || u + by >= k.width) continue;
      depth[static_cast<std::size_t>(v) * k.width + u + by] =
          static_cast<std::uint16_t>(std::lround(raw * scale));
    }
  }
  return std::make_shared<const DepthImage>(std::make_shared<const ViewingRays>(k),
                                            std::move(depth), frame.units_per_metre(),
                                            frame.world_from_camera());
}

struct Outcome {
  ForceJudge force;
  bool lost = false;
  int suspected = 0;    // how often a proxy was behind the measured surface for over a frame
  double error = 0.0;   // [m] rms, of the contact against the plane
  double felt = 0.0;    // [N]
  double step = 0.0;    // [N] largest change in a tick
  double change = 0.0;  // [N] between the largest and the smallest force
};

// Plays one place of a recording. @param told  what moves, and the hand
Outcome judged(const std::string& name, const ExperimentOptions& options, Action action,
               const Truth& truth, const Scenario& told) {
  const double r_c = options.parameters.proxy.r_c();
  const auto method = make_method(name, {options.parameters, truth}, options.own_methods);
  const auto ruler = make_method("ideal", {options.parameters, truth});
  double shown = 0.0;
  std::shared_ptr<const Cloud> cloud;
  Scenario scenario = told;
  scenario.cloud = [&](std::uint64_t k, double t) {
    shown = t;
    return cloud = told.cloud(k, t);
  };
  const double watched_from = action == Action::hold ? contact_time + 0.5 : onset;
  int behind = 0;
  int numb = 0;
  int suspected = 0;
  bool touched = false;
  Vec3 last_force = Vec3::Zero();
  std::vector<double> error;
  std::vector<double> force;
  const double frame = scenario.tick_rate / scenario.frame_rate;
  Outcome outcome{.force = {r_c, scenario.tick_rate, frame}};
  play(*method, scenario, [&](const Tick& tick) {
    const auto [now, normal] = truth(tick.proxy, tick.t);
    behind = now < 0.0 && truth(tick.proxy, shown).distance < 0.0 ? behind + 1 : 0;
    // Half of r_c: about what a plane and a surface differ by before a Kinect.
    const bool inside = is_followed(action) && truth(tick.hip, tick.t).distance < -0.5 * r_c;
    numb = inside && tick.force.isZero() ? numb + 1 : 0;
    if (behind > patience * scenario.tick_rate || numb > 3.0 * frame) outcome.lost = true;
    // The audit knows nothing of the plane; an occluder before the contact means nothing.
    const auto seen =
        action == Action::sweep ? std::nullopt : distance_behind(*cloud->image(), tick.proxy, r_c);
    suspected = tick.t > contact_time && seen && *seen > r_c ? suspected + 1 : 0;
    if (suspected == static_cast<int>(frame) + 1) ++outcome.suspected;
    const double felt = tick.force.dot(normal);
    // What else stands about the place may be touched on the way: no force is judged as a ghost.
    outcome.force.add(tick, ruler->tick(tick.hip, tick.t), 0.0);
    const double step = is_followed(action) ? (tick.force - last_force).norm()
                                            : std::abs(felt - last_force.dot(normal));
    if (touched) outcome.step = std::max(outcome.step, step);
    touched = touched || tick.t > contact_time;
    last_force = tick.force;
    if (tick.t >= watched_from && (tick.t <= lift || !is_followed(action))) {
      error.push_back(now - r_c);
      force.push_back(felt);
    }
    return !outcome.lost;
  });
  outcome.error = rms(error);
  outcome.felt = felt_rms(force);
  if (!force.empty()) {
    const auto [least, most] = std::minmax_element(force.begin(), force.end());
    outcome.change = *most - *least;
  }
  return outcome;
}

Outcome touch(const std::string& name, const ExperimentOptions& options, const Recording& recording,
              const Place& place, const PatchMotion& motion) {
  const Action action = motion.action;
  // Where the camera moves, the place stays where the first frame had it in the world.
  const Eigen::Isometry3d world_from_camera = recording.frames.front()->world_from_camera();
  const Vec3 normal = world_from_camera.linear() * place.normal;
  const Vec3 slide_along = normal.unitOrthogonal();
  const Vec3 eye = world_from_camera.translation();
  const Vec3 arm = world_from_camera.linear() * place.at;
  double shown = 0.0;
  const auto truth = [&](const Vec3& p, double t) {
    return TruePoint{normal.dot(p - eye - scale_at(motion, place, t) * arm), normal};
  };
  const auto hip = [&](double t) {
    const double above = std::max(hand_speed * (contact_time - t), -press_depth);
    const double along = action == Action::slide ? 0.02 * std::clamp(t - onset, 0.0, 1.0) : 0.0;
    return Vec3(eye + scale_at(motion, place, shown) * arm + above * normal + along * slide_along);
  };
  const bool moves = action == Action::moving || action == Action::sweep;
  const auto cloud = [&](std::uint64_t k, double t) {
    shown = t;
    const auto image = recording.frame(k + motion.first);
    return moves && t >= onset ? composed(*image, place, motion, t) : image;
  };
  return judged(
      name, options, action, truth,
      {.frame_rate = recording.rate, .duration = duration_of(action), .cloud = cloud, .hip = hip});
}

// Where each frame, in the order of play, shows the surface at one place: that of a pixel of the
// first frame. In the world the place stays, or strokes along the surface.
// @return none: a frame does not show it, or it jumps there, as where an edge passes by
std::optional<std::vector<Place>> follow(const Recording& recording, Action action, double u,
                                         double v) {
  constexpr double fit_radius = 0.015;  // [m]
  constexpr double fastest = 1.0;       // [m/s] of the surface
  std::vector<Place> seen;
  for (std::uint64_t k = 0; static_cast<double>(k) <= duration_of(action) * recording.rate; ++k) {
    const DepthImage& image = *recording.frame(k);
    if (k > 0) {
      const double t = std::clamp(static_cast<double>(k) / recording.rate, onset, lift);
      const double along = action == Action::stroke ? stroke_speed * (t - onset) : 0.0;
      const Vec3 place = image.world_from_camera().inverse() *
                         (seen[0].at + along * seen[0].normal.unitOrthogonal());
      if (place.z() < nearest || place.z() > farthest) return std::nullopt;
      u = image.intrinsics().fx * place.x() / place.z() + image.intrinsics().cx;
      v = image.intrinsics().fy * place.y() / place.z() + image.intrinsics().cy;
    }
    std::optional<Vec3> about =
        image.deproject(static_cast<int>(std::lround(u)), static_cast<int>(std::lround(v)));
    if (!about && k > 0) about = seen.back().at;  // a hole: what is seen beside it
    const auto plane = about ? plane_about(image, *about, fit_radius, false) : std::nullopt;
    if (!plane || (k > 0 && (plane->at - seen.back().at).norm() > fastest / recording.rate))
      return std::nullopt;
    seen.push_back(*plane);
  }
  return seen;
}

// Presses or strokes where the newest frame shows the surface.
// @param depth  [m] of the hand below it
Outcome touch_followed(const std::string& name, const ExperimentOptions& options,
                       const Recording& recording, const std::vector<Place>& seen, Action action,
                       double depth) {
  std::uint64_t newest = 0;
  const auto truth = [&](const Vec3& p, double /*t*/) {
    return TruePoint{seen[newest].normal.dot(p - seen[newest].at), seen[newest].normal};
  };
  const auto hip = [&](double t) {
    // Over a frame the hand moves to where that frame shows the place.
    const double share = std::clamp(t * recording.rate - static_cast<double>(newest), 0.0, 1.0);
    const Place& from = seen[std::max<std::uint64_t>(newest, 1) - 1];
    const Vec3 normal = (from.normal + share * (seen[newest].normal - from.normal)).normalized();
    const double above =
        std::max({hand_speed * (contact_time - t), -depth, hand_speed * (t - lift) - depth});
    return Vec3(from.at + share * (seen[newest].at - from.at) + above * normal);
  };
  const auto cloud = [&](std::uint64_t k, double /*t*/) { return recording.frame(newest = k); };
  return judged(
      name, options, action, truth,
      {.frame_rate = recording.rate, .duration = duration_of(action), .cloud = cloud, .hip = hip});
}

std::string row_of(const std::string& name, Action action, long long place, double distance,
                   const Outcome& outcome) {
  return csv_row(name, name_of(action), place, distance, outcome.lost, outcome.suspected,
                 1e3 * outcome.error, outcome.felt, outcome.step, outcome.change);
}

// With --cases: `press` and `stroke` at places that can be followed, evenly over the image by the
// sequence R2 of Roberts.
std::vector<Cell> followed_cells(const std::vector<std::string>& methods,
                                 const ExperimentOptions& options, const std::string& uri) {
  const auto recording = std::make_shared<const Recording>(read_frames(uri));
  const DepthImage& first = *recording->frames.front();
  std::vector<Cell> cells;
  for (const Action action : {Action::press, Action::stroke}) {
    int place = 0;
    for (int i = 1; i <= 50 * *options.cases && place < *options.cases; ++i) {
      const double u = std::fmod(0.5 + 0.7548776662466927 * i, 1.0) * first.intrinsics().width;
      const double v = std::fmod(0.5 + 0.5698402909980532 * i, 1.0) * first.intrinsics().height;
      const auto seen = follow(*recording, action, u, v);
      if (!seen) continue;
      const double distance = (seen->front().at - first.world_from_camera().translation()).norm();
      const double depth = (1 + place % 3) * options.parameters.proxy.r_c();
      for (const std::string& name : methods)
        cells.emplace_back([=] {
          return row_of(name, action, place, distance,
                        touch_followed(name, options, *recording, *seen, action, depth));
        });
      ++place;
    }
  }
  if (cells.empty())
    throw Error(uri, "it shows no place between 0.2 and 1.5 m all the time",
                "give a part in which the camera moves less, as ?start=30&frames=30");
  return cells;
}

std::vector<Cell> real_cells(const Experiment& experiment, const ExperimentOptions& options) {
  const std::string uri = options.recording.empty() ? std::string(stand_in) : options.recording;
  if (options.cases) return followed_cells(methods_of(experiment, options), options, uri);
  const auto recording = std::make_shared<const Recording>(open_recording(uri));
  std::vector<Cell> cells;
  for (const std::string& name : methods_of(experiment, options)) {
    for (const Action action : {Action::hold, Action::slide, Action::moving, Action::sweep}) {
      const bool moves = action == Action::moving || action == Action::sweep;
      if (moves && !recording->at_rest) continue;  // then nobody knows what would be exact
      for (std::size_t i = 0; i < recording->places.size(); ++i)
        cells.emplace_back([=] {
          const Place& place = recording->places[i];
          return row_of(name, action, static_cast<long long>(i), place.at.z(),
                        touch(name, options, *recording, place, {action}));
        });
    }
  }
  return cells;
}

Scores real_scores(const Table& table) {
  Scores scores;
  scores.columns = {"action",     "method",   "places",           "lost",           "suspected",
                    "error [mm]", "felt [N]", "largest step [N]", "force range [N]"};
  for (const std::string& action : texts_in(table, "action")) {
    for (const std::string& method : texts_in(table, "method")) {
      const Table all = table.where({{"method", method}, {"action", action}});
      const Table held = all.where({{"lost", "0"}});
      const auto of_held = [&](std::string_view column) {
        const double value = median(held.numbers(column));
        return std::isnan(value) ? std::string("-") : fmt::format("{:.3g}", value);
      };
      scores.rows.push_back(
          {action, method, std::to_string(all.rows()), std::to_string(all.rows() - held.rows()),
           fmt::format("{:g}", sum(all.numbers("suspected"))), of_held("error_mm"),
           of_held("felt_n"), of_held("step_n"), of_held("range_n")});
    }
  }
  scores.note =
      "Medians over the positions without pop-through. Actions and measures: docs/pop.md.";
  return scores;
}

// Everything that the cases of a recording depend on.
std::string hash_of(const Recording& recording) {
  Sha256 hash;
  for (const auto& frame : recording.frames) {
    const Intrinsics& k = frame->intrinsics();
    hash.add(fmt::format("{}x{} {} {} {} {} {} {} {}\n", k.width, k.height, k.fx, k.fy, k.cx, k.cy,
                         fmt::join(k.distortion, " "), frame->units_per_metre(), recording.rate));
    for (const std::uint16_t depth : frame->depth()) {
      const std::array bytes = {static_cast<char>(depth & 0xffU), static_cast<char>(depth >> 8U)};
      hash.add({bytes.data(), bytes.size()});
    }
  }
  return hash.digest();
}

}  // namespace

RealCases draw_real_cases(const std::string& uri, const std::string& name, std::uint64_t seed,
                          std::size_t count) {
  const auto recording =
      std::make_shared<const Recording>(open_recording(uri, std::numeric_limits<int>::max()));
  if (!recording->at_rest)
    throw Error(uri, "its camera moved, so no motion can be composed exactly",
                "give a recording of a camera at rest, or the part in which it was, as ?frames=8");
  RealCases result{.hash = hash_of(*recording), .frames = recording->frames.size(), .cases = {}};
  for (std::size_t i = 0; i < count; ++i) {
    Chance chance = chance_of(result.hash, seed, i);
    const auto at = static_cast<std::size_t>(
        std::floor(chance(0.0, static_cast<double>(recording->places.size()))));
    // Each action as often as the others.
    const PatchMotion motion{.action = static_cast<Action>(i % drawn_actions),
                             .stroke = rounded(chance(0.010, 0.030)),
                             .frequency = rounded(chance(0.5, 1.0)),
                             .nearer = rounded(chance(0.6, 0.85)),
                             .speed = rounded(chance(0.15, 0.4)),
                             .first = static_cast<std::uint64_t>(chance(0.0, 1000.0))};
    result.cases.push_back(
        {fmt::format(
             "real:{}?action={}&place={}&stroke={}&frequency={}&nearer={}&speed={}&first={}", name,
             name_of(motion.action), at, motion.stroke, motion.frequency, motion.nearer,
             motion.speed, motion.first),
         [=](const std::string& method, const ExperimentOptions& options) {
           const Outcome outcome =
               touch(method, options, *recording, recording->places[at], motion);
           return Judgement{.held = !outcome.lost, .right = !outcome.lost && outcome.force.right()};
         }});
  }
  return result;
}

Experiment real_experiment() {
  return {.name = "real",
          .summary = "recordings of a camera, at rest and with exact composed motion",
          .header = "method,action,place,distance_m,lost,suspected,error_mm,felt_n,step_n,range_n",
          .default_methods = {"paper", "sight"},
          .cells = real_cells,
          .scores = real_scores,
          .takes_recording = true,
          .plays_programs = true};
}

}  // namespace palpate::lab
