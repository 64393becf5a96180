// SPDX-License-Identifier: Apache-2.0
#include "palpate/core/sight.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace palpate {
namespace {

using Vec5 = Eigen::Matrix<double, 5, 1>;

// Along a line of sight a surface is looked for this far from where it is expected [m].
constexpr double reach = 0.3;
// What comes before it is looked for this far [m]: an arm may be held high.
constexpr double occluder_reach = 1.2;
// A surface is where it is expected if this share of its disc is within the gate.
constexpr double least_support = 0.3;
constexpr double narrowest_gate = 12e-3;  // [m]
constexpr double widest_gate = 60e-3;     // [m]
constexpr double gate_after_hold = 5e-3;  // [m]
constexpr double longest_gap = 0.25;      // [s] between frames that can tell a motion
// Layers along a line of sight are told apart by a gap of at least this [m].
constexpr double layer_gap = 20e-3;
constexpr std::size_t least_points = 8;
constexpr std::size_t beam_points = 256;
// What comes before a contact is looked for in all that `judge` looks at [m].
constexpr double shadow_radius = 15e-3;
constexpr std::size_t wide_beam_points = 512;
constexpr std::size_t inner_points = 768;
constexpr std::size_t outer_points = 1280;
constexpr std::size_t inner_rungs = 2;
constexpr std::size_t median_points = 192;
// A fit serves contacts within this of its centre [m].
constexpr double serves = 1.5e-3;
// While the surface is out of sight there is nothing to fit: what is remembered serves this far
// [m].
constexpr double serves_while_held = 15e-3;
// Frames whose centres are this near [m] have seen the same cells.
constexpr double same_place = 0.2e-3;
// Residuals this small are no structure, whatever the noise [m].
constexpr double structure_floor = 50e-6;
// Noise of a disc's height that is usual for a depth camera: this [m] at 1 m, growing with the
// square of the distance, as stereo does. Serves until the noise has been measured.
constexpr double usual_noise = 2e-3;
// Spread of a surface's curvature coefficients x^2, xy, y^2 that is expected [1/m]: radii down to
// some 30 mm are common, and noise must not invent them.
constexpr double curvature_sd = 15.0;
// A map of what is beside the contact [m].
constexpr double beside_inner = 12e-3;
constexpr std::array<double, 5> beside_bands = {40e-3, 80e-3, 140e-3, 220e-3, 320e-3};
constexpr std::size_t beside_points = 640;
// A surface that has been followed for so many frames is known not to jump on its own.
constexpr std::size_t well_known = 4;
constexpr float nothing = -1e3F;

constexpr double squared(double x) {
  return x * x;
}

// What the newest 2, 4, 8, ... frames say of a shape: matrix * shape = right_side, in centimetres.
constexpr std::size_t slope_windows = 4;
struct SlopeWindow {
  Eigen::Matrix<double, 5, 5> matrix;
  Vec5 right_side;
};

// Keeps the slopes of a shape that was summed over all frames within 4 standard deviations of what
// each window of the newest ones says, the longest first: a surface that turns is never farther
// off than their noise, and a false alarm costs no more than a little of the averaging.
// @param point_variance  [cm^2] what one point weighs
void confine_slopes(Vec5& shape, std::span<const SlopeWindow> windows, double point_variance) {
  constexpr double confidence = 4.0;
  for (std::size_t i = windows.size(); i-- > 0;) {
    const Eigen::Matrix2d matrix = windows[i].matrix.topLeftCorner<2, 2>();
    const double determinant = matrix.determinant();
    if (!(determinant > 1e-6 * squared(matrix.trace()))) continue;
    const Vec5 off = windows[i].right_side - windows[i].matrix * shape;
    const Eigen::Matrix2d inverse = matrix.inverse();
    const Vec2 change = inverse * off.head<2>();
    for (int axis = 0; axis < 2; ++axis) {
      const double slack = confidence * std::sqrt(point_variance * inverse(axis, axis));
      shape[axis] += change[axis] - std::clamp(change[axis], -slack, slack);
    }
  }
}

// Where the sightlines of the view that sees most of the patch come from; none if it does not know.
std::optional<Vec3> main_viewpoint(const Patch& patch) {
  std::size_t most = 0;
  std::optional<Vec3> viewpoint;
  for (std::size_t i = 0; i < patch.view_count(); ++i) {
    const std::size_t end = i + 1 < patch.view_count() ? patch.view(i + 1).begin : patch.size();
    if (end - patch.view(i).begin <= most) continue;
    most = end - patch.view(i).begin;
    viewpoint = patch.view(i).viewpoint;
  }
  return viewpoint;
}

// Heights of a patch's points above its centre along `up`. Returns how many were written.
std::size_t heights_along(const Patch& patch, const Vec3& up, std::span<float> heights) {
  const Eigen::Vector3f u = up.cast<float>();
  const std::size_t most = std::min(patch.size(), heights.size());
  std::size_t size = 0;
  for (std::size_t i = 0; i < most; ++i) {
    const float height = patch.x()[i] * u.x() + patch.y()[i] * u.y() + patch.z()[i] * u.z();
    if (std::isfinite(height)) heights[size++] = height;
  }
  return size;
}

}  // namespace

std::optional<Layer> first_layer(std::span<float> heights, double gap,
                                 double least_share) noexcept {
  if (heights.size() < least_points) return std::nullopt;
  std::sort(heights.begin(), heights.end(), std::greater<>());
  const auto total = static_cast<double>(heights.size());
  std::size_t begin = 0;
  for (std::size_t i = 1; i <= heights.size(); ++i) {
    if (i < heights.size() && heights[i - 1] - heights[i] < gap) continue;
    const double share = static_cast<double>(i - begin) / total;
    if (share >= least_share) return Layer{heights[begin + (i - begin) / 2], share};
    begin = i;
  }
  return std::nullopt;
}

double SightTracker::height_sd() const noexcept {
  return std::sqrt(variance(mover_));
}

// Of one frame's height in a disc [m^2]. Until a few frames have told, what is usual for a depth
// camera; then what they told, with a margin for how few they were.
double SightTracker::variance(std::size_t rung) const noexcept {
  const Scatter& scatter = scatter_[rung];
  const double usual = squared(usual_noise * squared(distance_)) + 0.03 * squared(spread_) + 1e-12;
  if (scatter.samples < 1.0) return usual;
  const double told = scatter.variance * (1.0 + 4.0 / scatter.samples) + 1e-12;
  return scatter.samples < 6.0 ? std::max(usual, told) : told;
}

double SightTracker::gate() const noexcept {
  // The beam is as wide as the narrowest disc, whose height is the noisiest.
  return std::clamp(std::max(4.0 * spread_, 6.0 * std::sqrt(variance(0))), narrowest_gate,
                    widest_gate);
}

double SightTracker::travel(double t) const noexcept {
  if (holding_ || velocity_ == 0.0) return 0.0;
  // Beyond one and a half intervals the velocity fades over another, and the surface stays there.
  const double elapsed = std::max(t - stamp_, 0.0) / interval_;
  const double late = std::clamp(elapsed - 1.5, 0.0, 1.0);
  return velocity_ * interval_ * (std::min(elapsed, 1.5) + late - 0.5 * late * late);
}

SurfaceContact SightTracker::contact(const Vec3& point, double t) const noexcept {
  Vec3 local = frame_.local_from_world(point);
  const double moved = travel(t);
  local.z() -= moved;
  const double limit = holding_ ? serves_while_held : serves;
  const Vec2 at = surface_.nearest(local, local.head<2>(), centre_, limit);
  const Vec3 foot(at.x(), at.y(), surface_.height(at));
  const Vec3 normal = surface_.normal(at);
  return {frame_.world_from_local(foot + Vec3(0, 0, moved)), frame_.direction_in_world(normal),
          (local - foot).dot(normal), (at - centre_).norm() > 0.999 * limit,
          surface_.strongest_rise()};
}

SightTracker::Event SightTracker::frame(const Cloud& cloud, double stamp, double interval,
                                        const Vec3& proxy, double hardest_strike) noexcept {
  if (!tracking_) {
    stamp_ = stamp;
    interval_ = interval;
    watch(cloud, proxy);
    return tracking_ ? Event::followed : Event::none;
  }
  // Where the surface is expected: below the proxy, moved on.
  const double expected = holding_ ? 0.0 : velocity_ * std::min(interval, longest_gap);
  Vec2 foot =
      surface_.nearest(frame_.local_from_world(proxy), frame_.local_from_world(proxy).head<2>(),
                       centre_, holding_ ? serves_while_held : 2.0 * serves);
  // Frames of one place can be compared cell by cell.
  if ((foot - centre_).norm() < serves) foot = centre_;
  const Vec3 place =
      frame_.world_from_local(Vec3(foot.x(), foot.y(), surface_.height(foot) + expected));

  gather(cloud, Beam{place, shadow_radius, occluder_reach, frame_.up}, wide_beam_points, patch_);
  const std::optional<Vec3> viewpoint = main_viewpoint(patch_);
  if (viewpoint) distance_ = (*viewpoint - place).norm();
  Vec3 line = viewpoint ? Vec3((*viewpoint - place).normalized()) : frame_.up;
  const bool from_behind = line.dot(frame_.up) < 0.0;
  std::array<float, wide_beam_points> heights;
  std::size_t seen = 0;
  std::size_t near = 0;
  std::size_t before = 0;  // points between the viewpoint and the surface
  // What comes back into sight is where it was; what is left of an occluder may be near.
  const double wide = holding_ ? std::max(gate_after_hold, 6.0 * height_sd()) : gate();
  Quadric moved = surface_;
  moved.c[0] += expected;
  const SightCone inner({place, radii[0], occluder_reach, frame_.up}, viewpoint);
  for (std::size_t i = 0; i < std::min(patch_.size(), wide_beam_points); ++i) {
    const Vec3 p = Vec3(patch_.x()[i], patch_.y()[i], patch_.z()[i]);
    const Vec3 local = frame_.local_from_world(patch_.ball().centre + p);
    const double above = local.z() - moved.height(local.head<2>());
    if (above > wide) ++before;
    if (!inner.holds(p) || !(std::abs(above) <= occluder_reach) || above < -reach) continue;
    if (std::abs(above) <= wide) ++near;
    heights[seen++] = static_cast<float>(p.dot(line));
  }

  const double previous_stamp = stamp_;
  if (!(stamp > previous_stamp && stamp - previous_stamp <= longest_gap)) {
    velocity_ = 0.0;
    settled_ = 0;
  }
  stamp_ = stamp;
  interval_ = interval;
  Event event = Event::followed;
  double jump = 0.0;  // [m] along up, from where it was expected
  const bool there = near >= least_points &&
                     static_cast<double>(near) >= least_support * static_cast<double>(seen);
  if (!there) {
    const std::optional<Layer> layer =
        first_layer(std::span(heights.data(), seen), std::max(layer_gap, spread_), least_support);
    const double lean = std::max(line.dot(frame_.up), 0.2);
    if (layer && !from_behind) jump = layer->height / lean;
    const bool nearer = jump > 0.0;
    if (!layer || from_behind ||
        (nearer && (holding_ || is_occluder(look_beside(cloud, place), jump + expected, jump,
                                            hardest_strike)))) {
      if (from_behind && layer) {
        // Touched from behind, the surface went out of reach: the points decide.
        forget();
        return Event::none;
      }
      if (!holding_) held_since_ = previous_stamp;
      holding_ = true;
      velocity_ = 0.0;
      return Event::hidden;
    }
    event = Event::jumped;
  }
  const bool resumed = holding_;
  holding_ = false;
  surface_.c[0] += expected + jump;
  if (resumed && event == Event::jumped) count_ = 0;
  // Something that moves in before a contact that stays hides a part of it first. What is left of
  // the disc looks like an edge, and is none.
  // Points that vanish without anything before them are a sensor's shadow beside an occluder.
  if (foot != centre_ || near > near_usual_) near_usual_ = near;
  const bool covered = before >= 3 || near < near_usual_ - near_usual_ / 4;
  shadowed_ = covered && foot == centre_ && (shadowed_ || resumed || !covered_);
  covered_ = covered;
  if (!measure(cloud, foot, stamp, true, wide, event == Event::jumped)) {
    surface_.c[0] -= expected + jump;
    if (!holding_) held_since_ = previous_stamp;
    holding_ = true;
    velocity_ = 0.0;
    return Event::hidden;
  }
  beside_ = look_beside(
      cloud, frame_.world_from_local(Vec3(centre_.x(), centre_.y(), surface_.height(centre_))));
  return event;
}

void SightTracker::watch(const Cloud& cloud, const Vec3& proxy) noexcept {
  if (tracking_) {
    if (holding_) return;
    const Vec2 below = frame_.local_from_world(proxy).head<2>();
    if ((below - centre_).norm() < 5e-3) return;
  }
  tracking_ = false;
  gather(cloud, Beam{proxy, radii[0], reach, frame_.up}, beam_points, patch_);
  const std::optional<Vec3> viewpoint = main_viewpoint(patch_);
  if (!viewpoint) return;  // no line of sight to follow
  const Vec3 line = (*viewpoint - proxy).normalized();
  distance_ = (*viewpoint - proxy).norm();
  std::array<float, beam_points> heights;
  const std::size_t seen = heights_along(patch_, line, heights);
  const std::optional<Layer> layer =
      first_layer(std::span(heights.data(), seen), layer_gap, least_support);
  if (!layer || layer->height > 0.0) return;  // nothing, or the proxy is hidden behind it
  if (!start(cloud, proxy + layer->height * line, line)) return;
  beside_ = look_beside(
      cloud, frame_.world_from_local(Vec3(centre_.x(), centre_.y(), surface_.height(centre_))));
}

bool SightTracker::shows_behind(const Cloud& cloud, const Vec3& proxy, double radius) noexcept {
  if (!tracking_ || holding_ || covered_) return false;
  gather(cloud, Beam{proxy, radius, reach, frame_.up}, beam_points, patch_);
  const std::optional<Vec3> viewpoint = main_viewpoint(patch_);
  std::array<float, beam_points> heights;
  if (!viewpoint || patch_.size() < least_points) return false;
  const Vec3 line = (*viewpoint - proxy).normalized();
  if (line.dot(frame_.up) < 0.0) return false;  // touched from behind: that is where it belongs
  const std::size_t seen = heights_along(patch_, line, heights);
  auto* middle = heights.data() + seen / 2;
  std::nth_element(heights.data(), middle, heights.data() + seen);
  return *middle > 1e-3 + 3.0 * height_sd();
}

bool SightTracker::slide(const Cloud& cloud, const Vec3& foot) noexcept {
  if (!tracking_ || holding_) return false;
  return measure(cloud, frame_.local_from_world(foot).head<2>(), stamp_, false, gate());
}

void SightTracker::touch(const Cloud& cloud, const Vec3& foot, const Vec3& normal) noexcept {
  if (holding_) return;
  if (tracking_) {
    const Vec3 local = frame_.local_from_world(foot);
    const double off = local.z() - surface_.height(local.head<2>());
    const bool same_side = frame_.up.dot(normal) > 0.35;
    if (same_side && std::abs(off) < 3e-3 + 4.0 * (spread_ + height_sd()) &&
        (local.head<2>() - centre_).norm() < 12e-3) {
      if ((local.head<2>() - centre_).norm() < serves) return;
      if (measure(cloud, local.head<2>(), stamp_, false, gate())) return;
    }
  }
  gather(cloud, Beam{foot, radii[0], narrowest_gate, normal}, beam_points, patch_);
  const std::optional<Vec3> viewpoint = main_viewpoint(patch_);
  Vec3 up = normal;
  if (viewpoint) {
    const Vec3 line = (*viewpoint - foot).normalized();
    distance_ = (*viewpoint - foot).norm();
    if (std::abs(line.dot(normal)) > 0.5) up = line.dot(normal) > 0.0 ? line : Vec3(-line);
  }
  if (!start(cloud, foot, up)) return;
  beside_ = look_beside(cloud, foot);
}

// Begins to follow the surface at `foot`. The past belongs to another one.
bool SightTracker::start(const Cloud& cloud, const Vec3& foot, const Vec3& up) noexcept {
  frame_ = LocalFrame::about(foot, up);
  surface_ = {};
  count_ = 0;
  for (Cells& past : cells_) past.full = false;
  velocity_ = 0.0;
  jumped_before_ = false;
  holding_ = false;
  smooth_ = false;
  shadowed_ = false;
  covered_ = false;
  tracking_ = measure(cloud, Vec2::Zero(), stamp_, true, narrowest_gate + 4.0 * spread_);
  return tracking_;
}

// The residuals of a patch's points within `radius` of `foot`: their median, and how they spread
// about it. Looks at an even part of them: a median of so many is
// good enough to tell what belongs to a surface.
std::optional<SightTracker::Residuals> SightTracker::residuals(const Vec2& foot, double radius,
                                                               double wide) const noexcept {
  std::array<float, median_points> values;
  std::size_t size = 0;
  const std::size_t stride = 1 + patch_.size() / (values.size() + 1);
  for (std::size_t i = 0; i < patch_.size() && size < values.size(); i += stride) {
    const Vec3 local = frame_.local_from_world(patch_.ball().centre +
                                               Vec3(patch_.x()[i], patch_.y()[i], patch_.z()[i]));
    if ((local.head<2>() - foot).squaredNorm() > squared(radius)) continue;
    const double r = local.z() - surface_.height(local.head<2>());
    if (std::abs(r) <= wide) values[size++] = static_cast<float>(r);
  }
  if (size < least_points) return std::nullopt;
  const auto median = [&] {
    auto* middle = values.data() + size / 2;
    std::nth_element(values.data(), middle, values.data() + size);
    return *middle;
  };
  const float centre = median();
  for (std::size_t i = 0; i < size; ++i) values[i] = std::abs(values[i] - centre);
  return Residuals{centre, 1.4826 * median()};
}

// Shifts the expected surface by the median residual near `foot` and says beyond which residual a
// point does not belong to it.
bool SightTracker::recentre(const Vec2& foot, double wide, double& cut) noexcept {
  const std::optional<Residuals> near = residuals(foot, radii[0], wide);
  if (!near) return false;
  surface_.c[0] += near->median;
  // Quantised depth makes single deviations jump between the steps.
  spread_ = count_ == 0 ? near->deviation : spread_ + 0.2 * (near->deviation - spread_);
  cut = std::clamp(6.0 * std::max(near->deviation, spread_), 0.5e-3, wide);
  return true;
}

// One frame's evidence about the surface around `foot`, and what follows from all of it.
bool SightTracker::measure(const Cloud& cloud, const Vec2& foot, double stamp, bool new_frame,
                           double wide, bool jumped) noexcept {
  const Vec3 place = frame_.world_from_local(Vec3(foot.x(), foot.y(), surface_.height(foot)));
  const double deep = wide + 2.0 * radii[1];
  gather(cloud, Beam{place, radii[1] * 1.2, deep, frame_.up}, inner_points, patch_);
  const Quadric before = surface_;
  double cut = 0.0;
  const bool first = count_ == 0;
  // From nothing, the shape is found by fitting the disc a few times over.
  for (int i = 0; i < (first ? 3 : 1); ++i) {
    if (!recentre(foot, wide, cut)) {
      surface_ = before;
      return false;
    }
    if (!first) break;
    Moments moments =
        disc_moments(patch_, frame_, surface_, Disc{foot, 0.0, radii[1], std::max(cut, 2e-3)});
    if (moments.xy[0] < 6.0) {
      surface_ = before;
      return false;
    }
    const Quadric correction = fit_quadric(moments, 0.1 * moments.xy[0]);
    surface_.c += correction.c;
  }

  if (new_frame || count_ == 0) {
    // Heights from before a jump belong to another surface, unless the next frame's jump says that
    // it was a motion.
    const bool goes_on = jumped && jumped_before_;
    jumped_before_ = jumped;
    if (count_ == 0 || (jumped && !goes_on)) settled_ = 0;
    settled_ += goes_on && settled_ == 1 ? 2 : 1;
    newest_ = (newest_ + 1) % history;
    count_ = std::min(count_ + 1, history);
  }
  Evidence& now = evidence(0);
  now.stamp = stamp;
  now.centre = foot;
  now.whole = !shadowed_;
  const auto add_ring = [&](std::size_t j) {
    Moments moments = disc_moments(patch_, frame_, surface_,
                                   Disc{foot, j == 0 ? 0.0 : radii[j - 1], radii[j], cut});
    moments.raise(surface_);
    if (j > 0) moments.add(now.disc[j - 1]);
    now.disc[j] = moments;
  };
  for (std::size_t j = 0; j < inner_rungs; ++j) add_ring(j);
  now.rungs = inner_rungs;

  look_at_cells(foot, wide, new_frame);

  // Where there is noise to average away, look farther.
  const bool noisy =
      scatter_[1].samples >= 1.0 ? scatter_[1].variance > squared(20e-6) : spread_ > 0.1e-3;
  if (noisy) {
    gather(cloud, Beam{place, radii[rungs - 1] * 1.1, wide + radii[rungs - 1], frame_.up},
           outer_points, patch_);
    // Noise that is alike over the inner disc is not over the wide ones: what belongs to them is
    // told by their own spread about their own middle.
    if (const std::optional<Residuals> far = residuals(foot, radii[rungs - 1], wide)) {
      surface_.c[0] += far->median;
      cut = std::clamp(6.0 * far->deviation, cut, wide);
    }
    for (std::size_t j = inner_rungs; j < rungs; ++j) add_ring(j);
    now.rungs = rungs;
  }
  for (std::size_t j = 0; j < now.rungs; ++j) {
    const Moments& m = now.disc[j];
    const Eigen::Matrix<double, 6, 6> a = m.normal_matrix();
    const Vec6 b = m.right_side();
    const double weight = std::max(a(0, 0), 1e-9);
    const Vec5 column = a.block<5, 1>(1, 0);
    now.shape[j] = {a.bottomRightCorner<5, 5>() - column * column.transpose() / weight,
                    b.tail<5>() - column * (b[0] / weight), column / weight, b[0] / weight,
                    a(0, 0)};
  }
  estimate(foot, new_frame);
  if (!shadowed_) judge(foot);
  centre_ = foot;
  if (foot.norm() > 4e-3) move_origin(foot);
  return true;
}

void SightTracker::estimate(const Vec2& foot, bool new_frame) noexcept {
  Evidence& now = evidence(0);
  const Vec2 at = foot / Moments::unit;
  Vec5 basis;
  basis << at.x(), at.y(), at.x() * at.x(), at.x() * at.y(), at.y() * at.y();
  const double cm2 = squared(Moments::unit);

  std::array<Vec5, rungs> shapes;
  std::array<std::array<HeightSample, history>, rungs> heights;
  std::array<std::size_t, rungs> frames{};
  std::size_t chosen = 0;
  for (std::size_t j = 0; j < now.rungs; ++j) {
    // Evidence from frames whose disc overlaps this one's well.
    Eigen::Matrix<double, 5, 5> matrix = Eigen::Matrix<double, 5, 5>::Zero();
    Vec5 right_side = Vec5::Zero();
    std::array<SlopeWindow, slope_windows> windows;
    std::size_t filled = 0;
    std::size_t whole = 0;
    std::size_t n = 0;
    for (; n < count_; ++n) {
      const Evidence& e = evidence(n);
      if (e.rungs <= j || (e.centre - foot).norm() > std::max(3e-3, 0.5 * radii[j])) break;
      // A disc that something covers in part tells the height, but hardly the slope.
      if (!e.whole && n > 0) continue;
      matrix += e.shape[j].matrix;
      right_side += e.shape[j].right_side;
      if (++whole == std::size_t{2} << filled && filled < slope_windows) {
        windows[filled++] = {matrix, right_side};
      }
    }
    frames[j] = n;
    const double points = std::max(now.shape[j].points, 1.0);
    Scatter& scatter = scatter_[j];
    // What one point weighs against the prior, whatever correlation does to it.
    const double prior = variance(j) * points / cm2 / squared(curvature_sd * Moments::unit);
    const auto fit_shape = [&](Eigen::Matrix<double, 5, 5> a, const Vec5& b) {
      a.diagonal().array() += 1e-9;
      a.diagonal().tail<3>().array() += prior;
      shapes[j] = a.ldlt().solve(b);
    };
    fit_shape(matrix, right_side);
    confine_slopes(shapes[j], std::span(windows.data(), filled), variance(j) * points / cm2);
    const double above = shapes[j].dot(basis);
    for (std::size_t i = 0; i < n; ++i) {
      const Evidence& e = evidence(i);
      heights[j][i] = {
          e.stamp, (e.shape[j].height - e.shape[j].means.dot(shapes[j]) + above) * Moments::unit};
    }
    if (new_frame && n >= 5 && now.whole) {
      // Fourth differences do not see a smooth motion; their variance is 70 times a height's.
      const auto& h = heights[j];
      const double fourth =
          h[0].height - 4.0 * h[1].height + 6.0 * h[2].height - 4.0 * h[3].height + h[4].height;
      double change = fourth * fourth / 70.0;
      // A single jump is no noise.
      if (scatter.samples >= 4.0) change = std::min(change, 9.0 * scatter.variance + 1e-12);
      scatter.samples = std::min(scatter.samples + 1.0, 40.0);
      scatter.variance += (change - scatter.variance) / scatter.samples;
    }
  }
  // Lepski: the widest disc that agrees with all narrower ones. Their differences, frame by frame,
  // do not see the surface move, and tell their own noise.
  // A disc may differ from the narrower ones, because the surface is not its quadric, and yet move
  // with them: then it tells the motion, and they tell where the surface is.
  std::size_t mover = 0;
  bool agree = true;
  for (std::size_t j = 1; j < now.rungs; ++j) {
    bool moves_along = frames[j] >= std::min<std::size_t>(frames[0], 2);
    for (std::size_t i = 0; i < j && moves_along; ++i) {
      const std::size_t n = std::min(frames[i], frames[j]);
      double sum = 0.0;
      double squares = 0.0;
      for (std::size_t k = 0; k < n; ++k) {
        const double d = heights[j][k].height - heights[i][k].height;
        sum += d;
        squares += d * d;
      }
      const auto count = static_cast<double>(n);
      const double mean = sum / count;
      // Until there are frames to tell, what the heights' own noise suggests counts as two of them.
      const double expected = 2.0 * (variance(i) + variance(j));
      const double scattered =
          (std::max(squares - count * mean * mean, 0.0) + (n < 4 ? expected : 0.0)) / count;
      // What was in use needs better evidence against it: a change is felt.
      const double confidence = (j <= rung_ ? 4.5 : 3.5) + 4.0 / count;
      agree = agree && std::abs(mean) <= confidence * std::sqrt(scattered / count) + 2e-6;
      const double newest = heights[j][0].height - heights[i][0].height;
      moves_along =
          agree || (n >= 4 && std::abs(newest - mean) <= 3.0 * std::sqrt(scattered) + 2e-6);
    }
    if (!moves_along) break;
    if (agree && variance(j) <= variance(chosen)) chosen = j;
    if (variance(j) <= variance(mover)) mover = j;
  }
  rung_ = chosen;
  mover_ = mover;
  std::array<HeightSample, history>& past = heights[mover];
  const std::size_t known = std::min(frames[chosen], frames[mover]);
  if (mover != chosen) {
    double difference = 0.0;
    for (std::size_t k = 0; k < known; ++k) {
      difference += (heights[chosen][k].height - past[k].height) / static_cast<double>(known);
    }
    for (std::size_t k = 0; k < frames[mover]; ++k) past[k].height += difference;
  }
  const std::span<const HeightSample> since(past.data(),
                                            std::clamp<std::size_t>(settled_, 1, frames[mover]));
  const double sd = height_sd();
  const HeightTrack track = track_height(since, sd, interval_);
  if (new_frame) velocity_ = track.velocity;
  const double height = track.height;
  surface_.c.tail<5>() = shapes[chosen];
  surface_.c.tail<3>() /= Moments::unit;
  above_mean_ = since.front().height - height;
  surface_.c[0] = height - shapes[chosen].dot(basis) * Moments::unit;
}

// Means of the inner patch's points in cells of a square about `foot`, kept to tell structure,
// which stays, from noise, which does not.
void SightTracker::look_at_cells(const Vec2& foot, double wide, bool new_frame) noexcept {
  constexpr double cell = 2.0 * 9e-3 / cells_per_side;
  constexpr double half = 0.5 * cells_per_side;
  if (new_frame) newest_cells_ = (newest_cells_ + 1) % cell_frames;
  Cells& now = cells_[newest_cells_];
  now.centre = foot;
  now.heights.fill(0.0F);
  now.means.fill(Eigen::Matrix<float, 6, 1>::Zero());
  for (std::size_t i = 0; i < patch_.size(); ++i) {
    const Vec3 local = frame_.local_from_world(patch_.ball().centre +
                                               Vec3(patch_.x()[i], patch_.y()[i], patch_.z()[i]));
    const double u = (local.x() - foot.x()) / cell + half;
    const double v = (local.y() - foot.y()) / cell + half;
    if (!(u >= 0.0 && v >= 0.0 && u < cells_per_side && v < cells_per_side)) continue;
    const Vec6 basis = quadric_basis(local.head<2>());
    if (!(std::abs(local.z() - surface_.c.dot(basis)) <= wide)) continue;
    const std::size_t k =
        static_cast<std::size_t>(v) * cells_per_side + static_cast<std::size_t>(u);
    now.heights[k] += static_cast<float>(local.z());
    now.means[k] += basis.cast<float>();
  }
  now.full = !shadowed_;
  for (std::size_t k = 0; k < cells; ++k) {
    const float count = now.means[k][0];
    if (!(count > 0.0F)) {
      now.full = false;
      return;
    }
    now.heights[k] /= count;
    now.means[k] /= count;
  }
}

// Mean square of what no quadric explains in residuals of cells [m^2]: the fit's own errors, which
// grow towards the corners, are no structure.
double SightTracker::squared_structure(const Cells& frame,
                                       const std::array<double, cells>& residuals) noexcept {
  Eigen::Matrix<double, 6, 6> a = 1e-9 * Eigen::Matrix<double, 6, 6>::Identity();
  Vec6 b = Vec6::Zero();
  const auto basis = [&](std::size_t k) {
    Vec6 means = frame.means[k].cast<double>();
    means.segment<2>(1) /= Moments::unit;
    means.tail<3>() /= squared(Moments::unit);
    return means;
  };
  for (std::size_t k = 0; k < cells; ++k) {
    const Vec6 means = basis(k);
    a += means * means.transpose();
    b += residuals[k] * means;
  }
  const Vec6 c = a.ldlt().solve(b);
  double sum = 0.0;
  for (std::size_t k = 0; k < cells; ++k) sum += squared(residuals[k] - c.dot(basis(k)));
  constexpr double free = cells - 6;
  return sum / free;
}

// Is the surface what its fit says, up to noise?
void SightTracker::judge(const Vec2& foot) noexcept {
  const Evidence& now = evidence(0);
  // An edge shows as a disc whose points lie to one side, a gap as one without a middle.
  const Shape& inner = now.shape[0];
  const Vec2 middle(inner.means[0], inner.means[1]);
  const Vec2 spread = Vec2(inner.means[2], inner.means[4]) - Vec2(middle.cwiseAbs2());
  const double full = 0.25 * squared(radii[0] / Moments::unit);
  const bool whole = (middle * Moments::unit - foot).norm() < 0.3 * radii[0] &&
                     spread.minCoeff() > 0.65 * full && spread.maxCoeff() < 1.35 * full;
  if (!whole) {
    smooth_ = false;
    return;
  }
  // Residuals over the surface as it is known now, less what all cells share.
  const auto residuals_of = [this](const Cells& frame) {
    std::array<double, cells> residuals;
    double mean = 0.0;
    for (std::size_t k = 0; k < cells; ++k) {
      const Vec6 means = frame.means[k].cast<double>();
      residuals[k] = frame.heights[k] - surface_.c.dot(means);
      mean += residuals[k] / cells;
    }
    for (double& r : residuals) r -= mean;
    return residuals;
  };
  const Cells& newest = cells_[newest_cells_];
  if (!newest.full) {
    smooth_ = false;
    return;
  }
  std::array<double, cells> sums = residuals_of(newest);
  const std::array<double, cells> residuals = sums;
  std::size_t frames = 1;
  for (; frames < cell_frames; ++frames) {
    const Cells& past = cells_[(newest_cells_ + cell_frames - frames) % cell_frames];
    if (!past.full || (past.centre - newest.centre).norm() > same_place) break;
    const std::array<double, cells> older = residuals_of(past);
    double change = 0.0;
    for (std::size_t k = 0; k < cells; ++k) {
      sums[k] += older[k];
      change += squared(residuals[k] - older[k]) / (2.0 * cells);
    }
    if (frames == 1) {
      cell_scatter_.samples = std::min(cell_scatter_.samples + 1.0, 30.0);
      cell_scatter_.variance += (change - cell_scatter_.variance) / cell_scatter_.samples;
    }
  }
  const auto n = static_cast<double>(frames);
  const double structure = squared_structure(newest, sums) / squared(n);
  const double noise = cell_scatter_.samples > 0.0 ? cell_scatter_.variance / n : 0.0;
  // Hysteresis, so that the way to rest does not change from frame to frame.
  const double confidence = smooth_ ? 6.0 : 3.0;
  smooth_ = structure <= squared(structure_floor) + confidence * noise;
}

// Keeps the local origin near the contact: sums of fourth powers lose digits far from it.
void SightTracker::move_origin(const Vec2& foot) noexcept {
  const Vec3 shift(foot.x(), foot.y(), surface_.height(foot));
  const Vec2 gradient = surface_.gradient(foot);
  frame_.origin = frame_.world_from_local(shift);
  surface_.c[0] = 0.0;
  surface_.c[1] = gradient.x();
  surface_.c[2] = gradient.y();
  centre_ -= foot;
  for (Cells& past : cells_) past.full = false;
  for (std::size_t age = 0; age < count_; ++age) {
    Evidence& e = evidence(age);
    e.centre -= foot;
    for (std::size_t j = 0; j < e.rungs; ++j) {
      e.disc[j] = e.disc[j].moved(shift);
      const Eigen::Matrix<double, 6, 6> a = e.disc[j].normal_matrix();
      const Vec6 b = e.disc[j].right_side();
      const double weight = std::max(a(0, 0), 1e-9);
      const Vec5 column = a.block<5, 1>(1, 0);
      e.shape[j] = {a.bottomRightCorner<5, 5>() - column * column.transpose() / weight,
                    b.tail<5>() - column * (b[0] / weight), column / weight, b[0] / weight,
                    a(0, 0)};
    }
  }
}

// Residuals of the nearest points beside the contact, by sector and band.
SightTracker::Ring SightTracker::look_beside(const Cloud& cloud, const Vec3& place) noexcept {
  Ring ring;
  ring.fill(nothing);
  gather(cloud, Beam{place, beside_bands.back(), reach, frame_.up}, beside_points, patch_);
  const Vec3 centre = frame_.local_from_world(place);
  const Vec2 at = centre.head<2>();
  const Vec2 slope = surface_.gradient(centre_);
  const double base = surface_.height(centre_);
  for (std::size_t i = 0; i < patch_.size(); ++i) {
    const Vec3 local = frame_.local_from_world(patch_.ball().centre +
                                               Vec3(patch_.x()[i], patch_.y()[i], patch_.z()[i]));
    const Vec2 d = local.head<2>() - at;
    const double away = d.norm();
    if (away < beside_inner || away >= beside_bands.back()) continue;
    std::size_t band = 0;
    while (away >= beside_bands[band]) ++band;
    const std::size_t sector =
        (d.x() > 0.0 ? 4 : 0) + (d.y() > 0.0 ? 2 : 0) + (std::abs(d.x()) > std::abs(d.y()) ? 1 : 0);
    const double r = local.z() - base - slope.dot(local.head<2>() - centre_);
    float& cell = ring[band * sectors + sector];
    cell = std::max(cell, static_cast<float>(r));
  }
  return ring;
}

// Did something come between the viewpoint and the surface, or did the surface itself come?
// Something did if it was already to be seen beside the contact, if the surface still is, or if no
// surface could have been struck so hard.
// @param height  [m] of what is seen now, above where the surface was
// @param jump    [m] above where it was expected
bool SightTracker::is_occluder(const Ring& now, double height, double jump,
                               double hardest_strike) const noexcept {
  const double strike = 0.5 * hardest_strike * squared(interval_);
  const double times = jumped_before_ ? 4.0 : velocity_ != 0.0 ? 2.0 : 1.0;
  const double noise = std::max(spread_, height_sd());
  if (settled_ >= well_known && jump > times * strike + 15e-3 + 4.0 * noise) return true;
  const double tolerance = std::max(15e-3, 4.0 * noise);
  // A cell keeps its nearest point, and that is the noise's farthest.
  const double nearer = std::max(15e-3, 6.0 * noise);
  std::size_t same_before = 0;
  std::size_t unchanged = 0;
  for (std::size_t i = 0; i < now.size(); ++i) {
    const double before = beside_[i];
    if (before > nearer && std::abs(before - height) < std::min(30e-3, 0.6 * height)) return true;
    if (std::abs(before) < tolerance) {
      ++same_before;
      if (std::abs(now[i] - before) < std::min(tolerance, 0.3 * height)) ++unchanged;
    }
  }
  return unchanged >= 3 && 4 * unchanged >= same_before;
}

}  // namespace palpate
