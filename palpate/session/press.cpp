// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/press.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/cloud/proposed_touch.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/parameters.hpp"

namespace palpate {
namespace {

constexpr double farthest_jump = 0.08;       // [m] of what a pixel sees, that is flown to
constexpr double slack = 0.01;               // [m] by which the hand may be behind where it is led
constexpr double look_radius = 8e-3;         // [m] about the place that is pressed
constexpr std::size_t most_looked_at = 512;  // points there
constexpr double most_too_deep = 5e-3;       // [m] deeper than asked, before the hand gives way
constexpr double most_missed = 0.25;         // [s] without a force, after which it tries again

std::string name_of(Pixel pixel) {
  return "pixel " + std::to_string(pixel.u) + "," + std::to_string(pixel.v);
}

bool contains(const Intrinsics& k, Pixel pixel) {
  return pixel.u >= 0 && pixel.u < k.width && pixel.v >= 0 && pixel.v < k.height;
}

void check_inside(const Intrinsics& k, Pixel pixel) {
  if (contains(k, pixel)) return;
  throw Error(name_of(pixel), "it lies outside the image",
              "give a column from 0 to " + std::to_string(k.width - 1) + " and a row from 0 to " +
                  std::to_string(k.height - 1));
}

// The pixel nearest to one at which there is something; none if there is nothing.
template <class IsThere>
std::optional<Pixel> nearest_pixel(const Intrinsics& k, Pixel pixel, const IsThere& is_there) {
  if (contains(k, pixel) && is_there(pixel.u, pixel.v)) return pixel;
  std::optional<Pixel> nearest;
  std::int64_t least = std::numeric_limits<std::int64_t>::max();
  for (int v = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u) {
      const std::int64_t du = u - pixel.u;
      const std::int64_t dv = v - pixel.v;
      if (du * du + dv * dv >= least || !is_there(u, v)) continue;
      least = du * du + dv * dv;
      nearest = Pixel{u, v};
    }
  }
  return nearest;
}

// Is there a surface about a pixel that carries a proxy, and not an edge? Readings on two circles
// about it, of half of `radius` [m] and all of it, are of about its depth.
bool is_firm(const DepthImage& image, Pixel pixel, double radius) {
  constexpr int directions = 8;
  constexpr int most_missing = 2;
  constexpr double steepest = 1.7;  // [-] of the depth to the distance: 60 degrees
  constexpr double noise = 0.01;    // [1/m] of depth, times its square
  const auto depth = median_depth(image, pixel);
  if (!depth || !image.deproject(pixel.u, pixel.v)) return false;
  const Intrinsics& k = image.intrinsics();
  int missing = 0;
  for (const double share : {0.5, 1.0}) {
    const double away = std::clamp(share * radius * k.fx / *depth, 1.0, 40.0);  // [px]
    for (int i = 0; i < directions; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / directions;
      const Pixel beside{pixel.u + static_cast<int>(std::lround(away * std::cos(angle))),
                         pixel.v + static_cast<int>(std::lround(away * std::sin(angle)))};
      const auto there = contains(k, beside) && image.deproject(beside.u, beside.v)
                             ? median_depth(image, beside)
                             : std::nullopt;
      const double most = steepest * away / k.fx * *depth + noise * *depth * *depth;
      missing += there && std::abs(*there - *depth) <= most ? 0 : 1;
    }
  }
  return missing <= most_missing;
}

// The pixel itself if it measured something and `itself` will do, or else the nearest that is firm,
// or at least measured something.
std::optional<Pixel> nearest_surface(const DepthImage& image, Pixel pixel, double radius,
                                     bool itself) {
  const auto is_measured_there = [&](int u, int v) { return image.deproject(u, v).has_value(); };
  if (itself && contains(image.intrinsics(), pixel) && is_measured_there(pixel.u, pixel.v))
    return pixel;
  const auto firm = nearest_pixel(image.intrinsics(), pixel, [&](int u, int v) {
    return is_firm(image, {u, v}, radius);
  });
  return firm ? firm : nearest_pixel(image.intrinsics(), pixel, is_measured_there);
}

}  // namespace

Pixel parse_pixel(std::string_view text, const std::string& subject) {
  Pixel pixel;
  const char* const end = text.data() + text.size();
  const auto column = std::from_chars(text.data(), end, pixel.u);
  const bool comma = column.ec == std::errc{} && column.ptr != end && *column.ptr == ',';
  const auto row = comma ? std::from_chars(column.ptr + 1, end, pixel.v) : column;
  if (!comma || row.ec != std::errc{} || row.ptr != end) {
    throw Error(subject, "'" + std::string(text) + "' is not a pixel",
                "give column and row, such as 320,240");
  }
  return pixel;
}

std::optional<double> median_depth(const DepthImage& image, Pixel pixel) noexcept {
  constexpr int half = 3;
  const Intrinsics& k = image.intrinsics();
  std::array<std::uint16_t, (2 * half + 1) * (2 * half + 1)> near{};
  std::size_t count = 0;
  for (int v = std::max(pixel.v - half, 0); v <= std::min(pixel.v + half, k.height - 1); ++v) {
    for (int u = std::max(pixel.u - half, 0); u <= std::min(pixel.u + half, k.width - 1); ++u) {
      const auto place = static_cast<std::size_t>(v) * static_cast<std::size_t>(k.width) +
                         static_cast<std::size_t>(u);
      const std::uint16_t raw = image.depth()[place];
      if (is_measured(raw)) near[count++] = raw;
    }
  }
  if (count == 0) return std::nullopt;
  auto* const middle = near.data() + count / 2;
  std::nth_element(near.data(), middle, near.data() + count);
  return *middle / image.units_per_metre();
}

Vec3 surface_at(const DepthImage& image, Pixel pixel) {
  const Intrinsics& k = image.intrinsics();
  check_inside(k, pixel);
  const auto depth = median_depth(image, pixel);
  const Eigen::Vector2d ray = image.rays().ray(pixel.u, pixel.v);
  if (!depth || !ray.allFinite()) {
    const auto near =
        nearest_pixel(k, pixel, [&](int u, int v) { return image.deproject(u, v).has_value(); });
    throw Error(name_of(pixel), "nothing was measured there",
                near ? "the nearest measured pixel is " + std::to_string(near->u) + "," +
                           std::to_string(near->v)
                     : "the frame is empty: check the camera");
  }
  return image.world_from_camera() * (*depth * Vec3(ray.x(), ray.y(), 1.0));
}

// The line of sight through a pixel's coordinates, which may lie between pixels.
std::optional<Press::Line> Press::look(double u, double v) {
  const Pixel pixel{static_cast<int>(std::lround(u)), static_cast<int>(std::lround(v))};
  const PointCloud* points = cloud_->point_cloud();
  if (points != nullptr && view_ && !seen_) {
    seen_.emplace(*view_, *points);
    drawn_ = std::make_shared<DepthImage>(seen_->image());
  }
  const DepthImage* image = points != nullptr ? drawn_.get() : cloud_->image();
  if (image == nullptr) return std::nullopt;
  // Points are drawn coarsely: what carries a proxy is to be seen on all sides of it.
  const double firm = points != nullptr ? 3.0 * proposed_touch(*points).radius : look_radius;
  const auto near = nearest_surface(*image, pixel, firm, !missed_once_);
  if (!near) return std::nullopt;
  const Eigen::Isometry3d& pose = image->world_from_camera();
  if (points != nullptr) {
    const Vec3 way = points->point(*seen_->at(near->u, near->v)) - pose.translation();
    return Line{pose.translation(), way.normalized(), way.norm(), *near};
  }
  Eigen::Vector2d ray = image->rays().ray(near->u, near->v);
  const Intrinsics& k = image->intrinsics();
  if (*near == pixel) ray += Eigen::Vector2d((u - pixel.u) / k.fx, (v - pixel.v) / k.fy);
  const Vec3 direction(ray.x(), ray.y(), 1.0);
  return Line{pose.translation(), pose.linear() * direction.normalized(),
              *median_depth(*image, *near) * direction.norm(), *near};
}

std::optional<Press::Line> Press::look_on_the_way() {
  const Pixel& to = *options_.slide_to;
  return look(slides_from_.u + slid_ * (to.u - slides_from_.u),
              slides_from_.v + slid_ * (to.v - slides_from_.v));
}

Press::Press(const Cloud& first, Pixel at, const PressOptions& options)
    : options_(options), asked_(at), cloud_(&first), behind_(-options.approach) {
  check_range("press depth", "", "m", 0.0, 0.1, options.depth);
  check_range("press speed", "", "m/s", 1e-3, 2.0, options.speed);
  check_range("press approach", "", "m", 1e-3, 1.0, options.approach);
  check_range("press hold", "", "s", 0.0, 60.0, options.hold);
  check_range("press patience", "", "s", 0.0, 600.0, options.patience);
  Intrinsics size;
  if (const PointCloud* points = first.point_cloud()) {
    view_ = proposed_view(*points);
    size = view_->rays->intrinsics();
  } else if (const DepthImage* image = first.image()) {
    size = image->intrinsics();
  } else {
    throw Error("press", "the frame is neither an image nor points", "give a path");
  }
  check_inside(size, at);
  const auto line = look(at.u, at.v);
  if (!line)
    throw Error(name_of(at), "nothing was measured there, nor anywhere else in the frame",
                "check the camera");
  line_ = *line;
  goal_range_ = line_.range;
  slides_from_ = line_.pixel;
  hip_ = line_.at(behind_);
  if (const auto& to = options.slide_to) {
    check_inside(size, *to);
    way_ = (look(to->u, to->v)->at(0.0) - line_.at(0.0)).norm();
  }
}

void Press::frame(const Cloud& cloud) {
  cloud_ = &cloud;
  seen_.reset();
  if (phase_ == Phase::slide) {
    if (const auto line = look_on_the_way()) lead(*line);
  } else if (committed_) {
    follow();
  } else if (const auto line = look(asked_.u, asked_.v)) {
    lead(*line);
  }
}

// The hand goes where the line leads; in the air it waits before a surface that is elsewhere, or
// that has come nearer than it looked.
void Press::lead(const Line& line) {
  const double ahead = line.range - (hip_ - line.from).dot(line.along);  // [m] of the hand
  const bool jumped = (line.at(0.0) - line_.at(0.0)).norm() > farthest_jump;
  if (phase_ == Phase::down && (jumped || ahead < commits)) behind_ = -options_.approach;
  line_ = line;
  goal_range_ = line.range;
}

// The surface at the place that is pressed, by the points about the line of sight to it.
void Press::follow() {
  const Vec3 surface = line_.at(0.0);
  const double radius = std::max(0.5 * look_radius, 1.5 * cloud_->spacing(surface));
  gather(*cloud_, Beam{surface, radius, look_radius * 4.0, line_.along}, most_looked_at, *patch_);
  std::vector<double> along;
  for (std::size_t i = 0; i < patch_->size(); ++i)
    along.push_back(Vec3(patch_->x()[i], patch_->y()[i], patch_->z()[i]).dot(line_.along));
  if (along.empty()) return;
  const auto middle = along.begin() + static_cast<std::ptrdiff_t>(along.size() / 2);
  std::nth_element(along.begin(), middle, along.end());
  goal_range_ = line_.range + *middle;
}

// Back before the surface, after what the pixel sees.
void Press::begin_again() {
  phase_ = Phase::down;
  committed_ = false;
  missed_once_ = true;
  behind_ = -options_.approach;
  felt_ = missed_ = 0.0;
  if (const auto line = look(asked_.u, asked_.v)) lead(*line);
}

// A surface that comes towards the hand pushes it away, and does not get pressed deeper.
void Press::give_way(double dt, const Tick* last) {
  const double depth = rest_ && last->state != ContactState::free_motion
                           ? (last->hip - last->proxy).norm() - *rest_
                           : 0.0;
  if (depth > options_.depth + most_too_deep)
    behind_ = std::max(behind_ - follows * dt, -options_.approach);
  else
    behind_ = std::min(behind_ + options_.speed * dt, options_.depth);
}

void Press::advance(double dt, const Tick* last) {
  const bool felt = last != nullptr && !last->force.isZero(0.0);
  if (felt && !rest_) rest_ = (last->hip - last->proxy).norm();
  const double away = (hip_ - line_.at(behind_)).norm();  // [m] of where it is to be
  const bool in_time = spent_ < options_.patience + options_.hold;
  const auto next = [&](Phase phase) {
    phase_ = phase;
    felt_ = missed_ = 0.0;
  };
  felt_ += felt ? dt : 0.0;
  missed_ = felt ? 0.0 : missed_ + dt;
  switch (phase_) {
    case Phase::down:
      if (away < slack) behind_ = std::min(behind_ + options_.speed * dt, options_.depth);
      committed_ = committed_ || (behind_ > -commits && away < slack);
      if (behind_ >= options_.depth) next(Phase::hold);
      if (!in_time) next(Phase::lift);
      break;
    case Phase::hold:
      give_way(dt, last);
      if (felt_ >= options_.hold || !in_time)
        next(options_.slide_to && in_time ? Phase::slide : Phase::lift);
      else if (missed_ > most_missed)
        begin_again();
      break;
    case Phase::slide:
      if (away < slack) slid_ = std::min(slid_ + options_.speed * dt / std::max(way_, 1e-6), 1.0);
      if (const auto line = look_on_the_way()) lead(*line);
      if (slid_ >= 1.0 && away < slack) next(Phase::stay);
      break;
    case Phase::stay:
      give_way(dt, last);
      if (felt_ + missed_ >= options_.hold) next(Phase::lift);
      break;
    case Phase::lift:
      behind_ = std::max(behind_ - options_.speed * dt, -options_.approach);
      if (behind_ <= -options_.approach) next(Phase::done);
      break;
    case Phase::done:
      break;
  }
}

const Vec3& Press::step(double t, const Tick* last) {
  const double dt = t_ ? std::max(t - *t_, 0.0) : 0.0;
  t_ = t;
  spent_ += dt;
  advance(dt, last);
  line_.range += std::clamp(goal_range_ - line_.range, -follows * dt, follows * dt);
  const bool in_the_air = phase_ == Phase::down && !committed_;
  const double fastest = in_the_air ? std::max(travel, options_.speed) : options_.speed + follows;
  const Vec3 way = line_.at(behind_) - hip_;
  const double length = way.norm();
  hip_ += length > fastest * dt ? Vec3(fastest * dt / length * way) : way;
  return hip_;
}

HipPath stroke_path(const DepthImage& image, double duration, double press) {
  const Intrinsics& k = image.intrinsics();
  constexpr double hover = 0.05;       // [m] in front of the surface, before and after
  constexpr double clearance = 0.02;   // [m] in front of what it is lifted over
  constexpr double approach = 1.0;     // [s] to come down, and to go up
  constexpr double lift = 0.3;         // [s] to be lifted, and as long before an edge
  constexpr double edge = 0.004;       // [m] between two samples
  constexpr double interval = 0.01;    // [s] between samples
  constexpr double circle_time = 4.0;  // [s]
  const double radius = k.height / 6.0;

  std::optional<double> depth = median_depth(image, {k.width / 2, k.height / 2});
  if (!depth)
    throw Error("built-in hand", "the middle of the first frame measures nothing to touch",
                "give a path with --device script:FILE.csv");
  struct Place {
    Eigen::Vector2d ray;
    double depth;
    bool flat;  // measured, and no edge since the place before
  };
  std::vector<Place> places;
  for (int i = 0; i * interval <= duration; ++i) {
    const double stroke =
        std::clamp(i * interval - approach, 0.0, std::max(duration - 2 * approach, 0.0));
    const double angle = 2.0 * std::numbers::pi * stroke / circle_time;
    const int u = k.width / 2 + static_cast<int>(radius * std::sin(angle));
    const int v = k.height / 2 + static_cast<int>(radius * (std::cos(angle) - 1.0));
    const std::optional<double> measured = median_depth(image, {u, v});
    const bool flat = measured && std::abs(*measured - *depth) < edge;
    if (measured) depth = measured;
    places.push_back({image.rays().ray(u, v), *depth, flat});
  }

  // Where a camera sees an edge there is often a shadow behind it, and nothing to touch.
  const int ahead = static_cast<int>(lift / interval);
  const int count = static_cast<int>(places.size());
  std::vector<HipPath::Sample> samples;
  double surface = places.front().depth;
  double down = 1.0;  // 0 lifted, 1 pressing
  for (int i = 0; i < count; ++i) {
    double nearest = places[static_cast<std::size_t>(i)].depth;
    bool flat = true;
    for (int j = std::max(i - ahead, 0); j < std::min(i + 2 * ahead, count); ++j) {
      nearest = std::min(nearest, places[static_cast<std::size_t>(j)].depth);
      flat = flat && places[static_cast<std::size_t>(j)].flat;
    }
    const double target = flat ? places[static_cast<std::size_t>(i)].depth : nearest;
    surface += 0.2 * (target - surface);  // a hand does not jump
    down = std::clamp(down + (flat ? 1.0 : -1.0) * interval / lift, 0.0, 1.0);
    const double t = i * interval;
    const double into = std::min({1.0, t / approach, (duration - t) / approach});
    const double reach = surface - hover + into * (hover - clearance + down * (clearance + press));
    const Place& place = places[static_cast<std::size_t>(i)];
    samples.push_back(
        {t, image.world_from_camera() * (reach * Vec3(place.ray.x(), place.ray.y(), 1.0))});
  }
  return HipPath(std::move(samples));
}

Vec3 hover_place(const Cloud& cloud) {
  constexpr double hover = 0.05;  // [m]
  if (const DepthImage* image = cloud.image()) {
    const Intrinsics& k = image->intrinsics();
    Vec3 camera = image->world_from_camera().translation();
    // Outwards from the middle until something was measured.
    for (int ring = 0; ring < k.width / 2; ++ring) {
      for (const int side : {-1, 1}) {
        const auto point = image->deproject(k.width / 2 + side * ring, k.height / 2);
        if (point) return *point + hover * (camera - *point).normalized();
      }
    }
    return camera;
  }
  const PointCloud* points = cloud.point_cloud();
  if (points == nullptr || points->size() == 0) return Vec3::Zero();
  Vec3 middle = Vec3::Zero();
  for (std::size_t i = 0; i < points->size(); ++i) middle += points->point(i);
  middle /= static_cast<double>(points->size());
  Vec3 nearest = points->point(0);
  for (std::size_t i = 1; i < points->size(); ++i) {
    const Vec3& point = points->point(i);
    if ((point - middle).squaredNorm() < (nearest - middle).squaredNorm()) nearest = point;
  }
  const Vec3 from = points->viewpoint().value_or(Vec3::Zero());
  const Vec3 away = from - nearest;
  return nearest + hover * (away.norm() > 1e-3 ? away.normalized() : Vec3::UnitZ());
}

void touch_along(FrameSequence& frames, Method& method, Press& press, double rate,
                 const std::function<bool(const Tick&)>& on_tick) {
  std::shared_ptr<const Cloud> seen;
  std::optional<Tick> last;
  touch(
      frames, method, {frames.upcoming(0)->stamp, press.hip()}, rate,
      [&](double t) -> std::optional<HandPose> {
        if (press.done()) return std::nullopt;
        if (frames.newest().front() != seen) {
          seen = frames.newest().front();
          press.frame(*seen);
        }
        return HandPose{.position = press.step(t, last ? &*last : nullptr)};
      },
      [&](const Tick& tick) {
        last = tick;
        return on_tick(tick);
      });
}

}  // namespace palpate
