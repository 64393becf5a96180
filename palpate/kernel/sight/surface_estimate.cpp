// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/sight/surface_estimate.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "palpate/kernel/core/lanes.hpp"
#include "palpate/kernel/core/linear.hpp"
#include "palpate/kernel/core/mathematics.hpp"

namespace palpate {
namespace {

using Vec5 = Eigen::Matrix<double, 5, 1>;  // as SurfaceEstimate's

constexpr double widest_gate = 12.0;  // [detail]
constexpr std::size_t inner_points = 768;
constexpr std::size_t outer_points = 1280;
constexpr std::size_t inner_rungs = 2;
constexpr std::size_t median_points = 192;
constexpr double narrowest_cell = 0.9;  // [detail]
// A disc's radius in multiples of what lies between points: pi 3^2 = 28 points are enough for a
// quadric and for an outlier test, and half of them still are at an edge.
constexpr double least_radius = 3.0;
// Discs of coarse images grow at least by this from rung to rung; fine ones' by 1.57 to 1.7.
constexpr double least_growth = 1.25;
// Noise may grow by this much at once, however little there was [detail].
constexpr double unnoticed_noise = 0.01;
// Less noise is not told from rounding: a standard deviation [detail].
constexpr double least_sd = 2e-4;
// Upper 99 % confidence bounds of a variance estimated from 1 to 5 samples, in multiples of it.
constexpr std::array upper_bounds = {6000.0, 400.0, 120.0, 50.0, 28.0};
// [detail] Places of a fit that differ by less are the same.
constexpr double same_centre = 2e-4;
// [-] standard deviations. A disc in use needs so much stronger evidence against it: a change is
// felt.
constexpr double hysteresis = 0.5;

// How many standard deviations, themselves estimated with so many degrees of freedom, are exceeded
// as rarely as `z` known ones: Student's quantile, by Fisher's expansion.
double t_quantile(double z, double freedom) { return z + z * (z * z + 1.0) / (4.0 * freedom); }

// Variance of heights that do not move [m^2], all but the newest; 0 if there are too few.
double variance_at_rest(std::span<const HeightSample> newest_first, std::size_t frames) {
  constexpr std::size_t enough = 8;
  if (frames <= enough) return 0.0;
  const double base = newest_first[1].height;
  double count = 0.0;
  double sum = 0.0;
  double squares = 0.0;
  for (std::size_t i = 1; i < frames; ++i) {
    const double height = newest_first[i].height - base;
    const double weight = 1.0 / newest_first[i].doubt;
    count += weight;
    sum += weight * height;
    squares += weight * height * height;
  }
  return std::max(squares - sum * sum / count, 0.0) / static_cast<double>(frames - 2);
}

// How many of the newest readings, 2, 4 or 8, differ from those before; 0: none. Noise of depth
// cameras correlates from frame to frame by up to 0.85: so much of a single one's deviation is left
// in a mean.
// @param worth    [-] of so many of the newest frames, from 0 to all: one over a reading's variance
//                 in usual ones is what a frame is worth
// @param most     [m] that a single usual one may deviate
// @param reading  [m] of a frame, by its age, times what that is worth
template <class Reading>
std::size_t changed_since(std::span<const double> worth, double most, const Reading& reading) {
  constexpr std::array<double, 3> left = {0.96, 0.91, 0.80};  // [-]
  const std::size_t frames = worth.size() - 1;
  double all = 0.0;
  for (std::size_t i = 0; i < frames; ++i) all += reading(i);
  double newest = 0.0;
  std::size_t added = 0;
  for (std::size_t i = 0; i < left.size(); ++i) {
    const std::size_t window = std::size_t{2} << i;
    if (frames < 2 * window) return 0;
    for (; added < window; ++added) newest += reading(added);
    const double before = worth[frames] - worth[window];
    const double change = newest / worth[window] - (all - newest) / before;
    // Of frames that are worth less a mean is so much less certain.
    const double unsure = std::sqrt(static_cast<double>(window) / std::min(worth[window], before));
    if (std::abs(change) > left[i] * unsure * most) return window;
  }
  return 0;
}

// Normal equations of the shape over the newest 2, 4, 8, ... frames: matrix * shape = right_side,
// in units.
constexpr std::size_t slope_windows = 4;
struct SlopeWindow {
  Eigen::Matrix<double, 5, 5> matrix;
  Vec5 right_side;
};

// Keeps the slopes of a shape that was summed over all frames within `confidence` standard
// deviations of what each window of the newest ones gives, the longest first: a surface that turns
// is never farther off than their noise, and a false alarm costs no more than a little of the
// averaging.
// @param point_variance  [unit^2] what one point weighs
void confine_slopes(Vec5& shape, std::span<const SlopeWindow> windows, double point_variance,
                    double confidence) {
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

}  // namespace

void SurfaceEstimate::set(const SightParameters& parameters) noexcept {
  const double before = parameters_.detail;
  parameters_ = parameters;
  if (detail() == before) return;
  set_spacing(0.0);
  forget_frames();
  fit_test_.forget();
}

double SurfaceEstimate::height_sd() const noexcept { return std::sqrt(variance(mover_)); }

double SurfaceEstimate::beam_sd() const noexcept {
  double most = 0.0;
  for (std::size_t i = 0; i < is_known_.size(); ++i)
    if (is_known_[i]) most = std::max(most, variance(0, i));
  return std::sqrt(most > 0.0 ? most : variance(0, camera_));
}

double SurfaceEstimate::variance(std::size_t rung) const noexcept {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < is_known_.size(); ++i)
    if (is_known_[i]) least = std::min(least, variance(rung, i));
  return std::isfinite(least) ? least : variance(rung, camera_);
}

// Variance of one frame's height in a disc [m^2]: the usual one of a depth camera, until enough
// frames have been measured; then the measured one, with a margin for how few they were.
double SurfaceEstimate::variance(std::size_t rung, std::size_t camera) const noexcept {
  const std::array<Scatter, rungs>& scatters = scatter_[camera];
  const Scatter& scatter = scatters[rung];
  const double floor = squared(least_sd * detail());
  // Correlated noise that moves a whole disc also spreads its points: little spread, little noise.
  // What moves them all by more than twice that is motion, if only of a camera that shakes.
  const double rounding = 0.1 * detail();
  const double most = squared(2.0 * spread_ + rounding) + floor;
  const double reading = noisier_[camera] * usual_noise(camera);
  const double usual =
      squared(std::min(reading, 4.0 * spread_ + rounding)) + 0.03 * squared(spread_) + floor;
  // Noise falls with the area it is averaged over: a wider disc's is the least of this one's.
  double wider = 0.0;
  for (std::size_t j = rung + 1; j < rungs; ++j) wider = std::max(wider, scatters[j].variance);
  wider = std::min(wider, most);
  if (scatter.samples < 1.0) return std::max(usual, wider);
  const double scattered =
      std::max({scatter.variance * (1.0 + 4.0 / scatter.samples), scatter.least,
                std::min(scatter.at_rest, 4.0 * scatter.variance)});
  const double measured = std::min(scattered + floor, most);
  if (scatter.samples > static_cast<double>(upper_bounds.size())) return measured;
  const double largest =
      upper_bounds[static_cast<std::size_t>(scatter.samples) - 1] * (scatter.variance + floor);
  return std::max({std::min(usual, largest), measured, wider});
}

void SurfaceEstimate::set_spacing(double spacing) noexcept {
  double least = least_radius * spacing;
  for (std::size_t j = 0; j < rungs; ++j, least *= least_growth) {
    radii_[j] = std::max(narrowest_discs[j] * detail(), least);
  }
  fit_test_.set_cell_size(narrowest_cell * detail() * coarseness());
}

std::size_t SurfaceEstimate::most_rungs() const noexcept {
  std::size_t most = inner_rungs;
  while (most < rungs && narrowest_discs[most] <= parameters_.widest_fit) ++most;
  return most;
}

bool SurfaceEstimate::misfits(double spacing) const noexcept {
  constexpr double tolerated = 1.4;
  const double ratio = std::max(narrowest_discs[0] * detail(), least_radius * spacing) / radii_[0];
  return spacing > 0.0 && (ratio > tolerated || ratio < 1.0 / tolerated);
}

double SurfaceEstimate::gate(double narrowest) const noexcept {
  // The beam is as wide as the narrowest disc, whose height is the noisiest.
  return std::clamp(std::max(4.0 * spread_, 6.0 * beam_sd()), narrowest, widest_gate * detail());
}

double SurfaceEstimate::displacement(double t) const noexcept {
  return moved_since(velocity_, t - stamp_, interval_);
}

SurfaceContact SurfaceEstimate::contact(const Vec3& point, double t, double reach) const noexcept {
  Vec3 local = frame_.local_from_world(point);
  const double moved = displacement(t);
  local.z() -= moved;
  Vec3 from = local;
  if (const double bulge = surface_.strongest_fall(); bulge > 0.0) {
    // From near the centre of curvature all places around are equally near. The one above counts.
    constexpr double deepest = 0.6;  // [-] of the bulge's radius
    from.z() = std::max(from.z(), surface_.height(from.head<2>()) - deepest / bulge);
  }
  const Vec2 at = surface_.nearest(from, from.head<2>(), centre_, reach);
  const Vec3 foot(at.x(), at.y(), surface_.height(at));
  const Vec3 normal = surface_.normal(at);
  return {frame_.world_from_local(foot + Vec3(0, 0, moved)), frame_.direction_in_world(normal),
          (local - foot).dot(normal), (at - centre_).norm() > 0.999 * reach,
          surface_.strongest_rise()};
}

void SurfaceEstimate::start_frame(std::size_t camera, double stamp, double interval) noexcept {
  const bool follows = stamp > stamp_ || (stamp == stamp_ && camera != camera_);
  camera_ = camera;
  if (!(follows && stamp - stamp_ <= longest_gap())) {
    stop();
    settled_ = 0;
  }
  stamp_ = stamp;
  interval_ = interval;
}

bool SurfaceEstimate::start(const Cloud& cloud, const Vec3& foot, const Vec3& up) noexcept {
  frame_ = LocalFrame::about(foot, up);
  surface_ = {};
  count_ = 0;
  fit_test_.forget();
  stop();
  jumped_ = false;
  smooth_ = false;
  // Wide enough for the narrowest disc on a surface that leans by 60 degrees
  const double gate = narrowest_gate * detail() * coarseness() + 4.0 * spread_;
  return measure(cloud, Vec2::Zero(), Look{gate}, true);
}

SurfaceEstimate::Shape SurfaceEstimate::Shape::of(const Moments& disc) noexcept {
  const Eigen::Matrix<double, 6, 6> a = disc.normal_matrix();
  const Vec6 b = disc.right_side();
  const double weight = std::max(a(0, 0), 1e-9);
  const Vec5 column = a.block<5, 1>(1, 0);
  const Eigen::Matrix<double, 5, 5> matrix =
      a.bottomRightCorner<5, 5>() - column * column.transpose() / weight;
  Shape shape{.sums = {}, .means = column / weight, .height = b[0] / weight, .points = a(0, 0)};
  for (Eigen::Index i = 0, k = 0; i < 5; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) shape.sums[k++] = matrix(i, j);
  }
  shape.sums.tail<5>() = b.tail<5>() - column * (b[0] / weight);
  return shape;
}

Eigen::Matrix<double, 5, 5> SurfaceEstimate::Shape::matrix(const Sums& sums) noexcept {
  Eigen::Matrix<double, 5, 5> result;
  for (Eigen::Index i = 0, k = 0; i < 5; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) result(i, j) = result(j, i) = sums[k++];
  }
  return result;
}

// The residuals of a patch's points within `radius` of `foot`: their median, and how they spread
// about it. Looks at an even part of them: a median of so many is good enough to judge what belongs
// to a surface.
std::optional<SurfaceEstimate::Residuals> SurfaceEstimate::residuals(const Vec2& foot,
                                                                     double radius,
                                                                     double wide) const noexcept {
  std::array<float, median_points + 1> values;
  std::size_t size = 0;
  const FloatQuadric surface(surface_);
  const auto foot_x = static_cast<float>(foot.x());
  const auto foot_y = static_cast<float>(foot.y());
  const auto radius_squared = static_cast<float>(squared(radius));
  const auto most = static_cast<float>(wide);
  const std::size_t stride = 1 + points_.size / (median_points + 1);
  for (std::size_t i = 0; i < points_.size && size < median_points; i += stride) {
    const float dx = points_.x[i] - foot_x;
    const float dy = points_.y[i] - foot_y;
    const float r = points_.z[i] - surface.height(points_.x[i], points_.y[i]);
    values[size] = r;
    const bool counts = (dx * dx + dy * dy <= radius_squared) & (std::abs(r) <= most);
    size += counts ? 1 : 0;
  }
  if (size < least_points) return std::nullopt;
  const std::span found(values.data(), size);
  const float centre = kth_smallest(found, size / 2);
  return Residuals{centre, deviation_about<double>(centre, found)};
}

// Shifts the expected surface by the median residual near `foot`, and sets `cut` [m], the residual
// beyond which a point is an outlier.
bool SurfaceEstimate::recentre(const Vec2& foot, double wide, double& cut) noexcept {
  const std::optional<Residuals> near = residuals(foot, radii_[0], wide);
  if (!near) return false;
  surface_.c[0] += near->median;
  // Smoothed, since quantised depth makes single deviations jump between its steps.
  spread_ = count_ == 0 ? near->deviation : spread_ + 0.2 * (near->deviation - spread_);
  cut = std::clamp(6.0 * std::max(near->deviation, spread_), 0.1 * detail(), wide);
  return true;
}

double SurfaceEstimate::usual_noise(std::size_t camera) const noexcept {
  return parameters_.usual_noise_at(distances_[camera]);
}

double SurfaceEstimate::weigh(const Cloud& cloud, double usual) noexcept {
  constexpr double most = 1e12;  // [-] a ratio of weights that is still a float
  is_weighted_ = cloud.has_noise() && points_.size > 0 && points_.size == patch_.size();
  if (!is_weighted_) return 1.0;
  weights_.fill(0.0F);
  double sum = 0.0;
  for (std::size_t i = 0; i < points_.size; ++i) {
    const Vec3 point(patch_.x()[i], patch_.y()[i], patch_.z()[i]);
    const double noise = cloud.noise_at(patch_.ball().centre + point, usual);
    const double weight = std::clamp(squared(usual / noise), 1.0 / most, most);
    weights_[i] = static_cast<float>(weight);
    sum += weight;
  }
  return sum / static_cast<double>(points_.size);
}

// Shifts the expected surface to the points near `foot` and sets `cut`, as `recentre`. Without an
// estimate to start from, the shape is found by iterating the fit. False if there are too few.
bool SurfaceEstimate::find_surface(const Vec2& foot, double wide, double& cut) noexcept {
  if (count_ > 0) return recentre(foot, wide, cut);
  for (int i = 0; i < 3; ++i) {
    if (!recentre(foot, wide, cut)) return false;
    const Moments moments =
        moments_of({foot, 0.0, radii_[1], std::max(cut, 0.4 * detail())}, is_weighted_);
    if (moments.xy[0] < 6.0) return false;
    const Quadric correction = fit_quadric(moments, 0.1 * moments.xy[0], unit());
    surface_.c += correction.c;
  }
  return true;
}

// Begins the evidence of a new frame.
void SurfaceEstimate::start_evidence(bool jumped) noexcept {
  // Heights from before a jump belong to another surface, unless the next frame's jump says that
  // it was a motion.
  const bool goes_on = jumped && jumped_;
  jumped_ = jumped;
  if (count_ == 0 || (jumped && !goes_on)) settled_ = 0;
  if (settled_ == 0) rested_ = 0;
  settled_ += goes_on && settled_ == 1 ? 2 : 1;
  newest_ = (newest_ + 1) % history;
  count_ = std::min(count_ + 1, most_frames());
  evidence(0).camera = camera_;
  is_known_.fill(false);
  for (std::size_t i = 0; i < count_; ++i) is_known_[evidence(i).camera] = true;
  cameras_ = static_cast<std::size_t>(std::count(is_known_.begin(), is_known_.end(), true));
}

Moments SurfaceEstimate::moments_of(const Disc& disc, bool is_weighted) const noexcept {
  return disc_moments(patch_, frame_, surface_, disc, unit(),
                      is_weighted ? weights_.data() : nullptr);
}

// Adds the ring that makes disc j of the next narrower one.
void SurfaceEstimate::add_ring(std::size_t j, const Vec2& foot, double cut) noexcept {
  Evidence& now = evidence(0);
  const Disc disc{foot, j == 0 ? 0.0 : radii_[j - 1], radii_[j], cut};
  Moments moments = moments_of(disc, is_weighted_);
  // Where points are, and how many, does not depend on their noise.
  const Moments all = is_weighted_ ? moments_of(disc, false) : moments;
  now.extent[j] = all.xy[0] / patch_.share() + (j > 0 ? now.extent[j - 1] : 0.0);
  if (j == 0) middle_ = Eigen::Map<const Vec5>(&all.xy[1]) / std::max(all.xy[0], 1e-9);
  moments.raise(surface_, unit());
  if (j > 0) moments.add(now.disc[j - 1]);
  now.disc[j] = moments;
}

// Where there is noise to average away, looks farther.
// @param reading  [m] noise of a point that weighs 1
void SurfaceEstimate::add_wide_rings(const Cloud& cloud, const Vec3& place, const Vec2& foot,
                                     double wide, double reading, double cut) noexcept {
  Evidence& now = evidence(0);
  const Scatter& inner = scatter_[now.camera][1];
  const bool noisy =
      inner.samples >= 1.0 ? inner.variance > squared(4e-3 * detail()) : spread_ > 0.02 * detail();
  const std::size_t most = most_rungs();
  if (!noisy || most <= inner_rungs) return;
  const double widest = radii_[most - 1];
  gather(cloud, Beam{place, widest * 1.1, wide + widest, frame_.up}, outer_points, patch_);
  points_.take(patch_, frame_);
  weigh(cloud, reading);
  // Noise that is common to the inner disc is not common to the wide ones: their outliers are
  // judged by their own median and deviation.
  if (const std::optional<Residuals> far = residuals(foot, widest, wide)) {
    surface_.c[0] += far->median;
    cut = std::clamp(6.0 * far->deviation, cut, wide);
  }
  for (std::size_t j = inner_rungs; j < most; ++j) add_ring(j, foot, cut);
  now.rungs = most;
}

// Measures the surface around `foot` in the newest frame, and estimates anew from all frames.
bool SurfaceEstimate::measure(const Cloud& cloud, const Vec2& foot, const Look& look,
                              bool new_frame) noexcept {
  const Vec3 place = frame_.world_from_local(Vec3(foot.x(), foot.y(), surface_.height(foot)));
  const double deep = look.gate + 2.0 * radii_[1];
  gather(cloud, Beam{place, radii_[1] * 1.2, deep, frame_.up}, inner_points, patch_);
  points_.take(patch_, frame_);
  const bool first = count_ == 0;
  const std::size_t camera = new_frame || first ? camera_ : this->camera();
  const double usual = usual_noise(camera);
  const double information = weigh(cloud, usual);
  // The inner disc's points weigh 1 in the mean
  if (is_weighted_)
    for (float& weight : weights_) weight /= static_cast<float>(information);
  const Quadric before = surface_;
  double cut = 0.0;
  if (!find_surface(foot, look.gate, cut)) {
    surface_ = before;
    return false;
  }
  if (new_frame || first) start_evidence(look.jumped);
  Evidence& now = evidence(0);
  now.stamp = stamp_;
  now.centre = foot;
  now.whole = !look.partial;
  now.lost = 0;
  now.information = information;
  noisier_[camera] = 1.0 / std::sqrt(information);
  for (std::size_t j = 0; j < inner_rungs; ++j) add_ring(j, foot, cut);
  now.rungs = inner_rungs;
  fit_test_.look(points_, surface_, foot, look.gate, look.partial, new_frame);
  add_wide_rings(cloud, place, foot, look.gate, usual / std::sqrt(information), cut);
  for (std::size_t j = 0; j < now.rungs; ++j) now.shape[j] = Shape::of(now.disc[j]);
  if (first && !spans_area()) {
    surface_ = before;
    count_ = 0;
    return false;
  }
  estimate(foot, new_frame, new_frame);
  if (!look.partial) judge(foot);
  now.smooth = smooth_;
  if (cameras_ > 1 && !look.partial) smooth_ = is_smooth_for_any(foot);
  centre_ = foot;
  if (foot.norm() > 0.8 * detail() * coarseness()) move_origin(foot);
  return true;
}

// Did the fit describe the newest frame of any camera there? What one camera sees whole another may
// see cut off by a shadow, in turn.
bool SurfaceEstimate::is_smooth_for_any(const Vec2& foot) noexcept {
  std::array<bool, Patch::max_views> is_judged{};
  for (std::size_t i = 0; i < count_; ++i) {
    const Evidence& e = evidence(i);
    if (std::exchange(is_judged[e.camera], true) || stamp_ - e.stamp > longest_gap()) continue;
    if (e.smooth && (e.centre - foot).squaredNorm() < squared(same_centre * detail())) return true;
  }
  return false;
}

// Estimates the surface at `foot` [m, local] from all frames: each disc's shape and heights, then
// which disc says where the surface is, then where that is.
// @param learns  new_frame, and nothing was learned from it yet
void SurfaceEstimate::estimate(const Vec2& foot, bool new_frame, bool learns) noexcept {
  Discs discs;
  const Vec2 at = foot / unit();
  discs.basis << at.x(), at.y(), at.x() * at.x(), at.x() * at.y(), at.y() * at.y();
  weigh_frames(discs);
  for (std::size_t j = 0; j < evidence(0).rungs; ++j) {
    ByCamera doubts{};
    for (std::size_t c = 0; c < doubts.size(); ++c)
      if (is_known_[c]) doubts[c] = doubt(j, c);
    average_shape(j, foot, doubts, discs);
    measure_heights(j, doubts, learns, discs);
  }
  const Choice choice = choose_discs(discs, learns);
  if (choice.changed > 0) {
    count_ = choice.changed;
    settled_ = std::min(settled_, choice.changed);
    rested_ = 0;
    estimate(foot, new_frame, false);
    return;
  }
  rung_ = choice.shape;
  mover_ = choice.motion;
  place_surface(discs, new_frame);
}

// What the frames say of their own noise: [-] what one is worth beside its camera's others.
void SurfaceEstimate::weigh_frames(Discs& discs) noexcept {
  ByCamera information{}, told{};
  for (std::size_t i = 0; i < count_; ++i) {
    information[evidence(i).camera] += evidence(i).information;
    ++told[evidence(i).camera];
  }
  discs.worth_of[0] = 0.0;
  for (std::size_t i = 0; i < count_; ++i) {
    const Evidence& e = evidence(i);
    discs.worth[i] = e.information / (information[e.camera] / told[e.camera]);
    discs.worth_of[i + 1] = discs.worth_of[i] + discs.worth[i];
  }
}

// The shape in disc j, over the frames whose disc overlaps this one's well.
void SurfaceEstimate::average_shape(std::size_t j, const Vec2& foot, const ByCamera& doubts,
                                    Discs& discs) noexcept {
  const std::size_t averaged =
      std::min(count_, cameras_ * static_cast<std::size_t>(parameters_.averaged_frames));
  const double farthest = squared(overlap(j));
  Shape::Sums sums = Shape::Sums::Zero();
  std::array<SlopeWindow, slope_windows> windows;
  std::size_t filled = 0;
  std::size_t whole = 0;
  std::size_t n = 0;
  for (; n < averaged; ++n) {
    const Evidence& e = evidence(n);
    if (j < e.lost || e.rungs <= j || (e.centre - foot).squaredNorm() > farthest) break;
    // A partly hidden disc determines the height, but hardly the slope.
    if (!e.whole && n > 0) continue;
    sums += discs.worth[n] / doubts[e.camera] * e.shape[j].sums;
    if (++whole == std::size_t{2} << filled && filled < slope_windows) {
      windows[filled++] = {Shape::matrix(sums), Shape::right_side(sums)};
    }
  }
  discs.frames[j] = n;
  // What one point weighs, with correlated noise counted by its effect.
  const double point_variance =
      variance(j) * std::max(evidence(0).shape[j].points, 1.0) / squared(unit());
  const double prior = point_variance / squared(parameters_.curvature_sd * unit());
  Eigen::Matrix<double, 5, 5> a = Shape::matrix(sums);
  a.diagonal().array() += 1e-9;
  a.diagonal().tail<3>().array() += prior;
  discs.shapes[j] = solve_symmetric<5>(a, Shape::right_side(sums));
  // One deviation more than elsewhere: each of four windows could be wrong in each frame.
  confine_slopes(discs.shapes[j], std::span(windows.data(), filled), point_variance,
                 parameters_.confidence + 1.0);
}

// The heights that frames measured in disc j, with its shape over all of them.
void SurfaceEstimate::measure_heights(std::size_t j, const ByCamera& doubts, bool learns,
                                      Discs& discs) noexcept {
  const Evidence& now = evidence(0);
  const Vec5& shape = discs.shapes[j];
  const double above = shape.dot(discs.basis);
  const std::span<HeightSample> heights(discs.heights[j].data(), discs.frames[j]);
  ByCamera own_frames{}, usual_extent{};
  for (std::size_t i = 0; i < heights.size(); ++i) ++own_frames[evidence(i).camera];
  for (std::size_t i = 0; i < heights.size(); ++i) {
    const Evidence& e = evidence(i);
    heights[i] = {e.stamp, (e.shape[j].height - e.shape[j].means.dot(shape) + above) * unit(),
                  1.0 / discs.worth[i]};
    usual_extent[e.camera] += e.extent[j] / own_frames[e.camera];
  }
  std::array<HeightSample, newest_heights> own;  // without what its camera is worth beside others
  std::size_t owned = 0;
  for (std::size_t i = 0; i < heights.size(); ++i) {
    const Evidence& e = evidence(i);
    HeightSample& height = heights[i];
    // A disc that an occluder begins to hide has fewer points and more noise.
    const double share = e.extent[j] / usual_extent[e.camera];
    if (share < 0.8) height.doubt /= squared(std::max(share, 0.1));
    if (e.camera == now.camera && owned < own.size()) own[owned++] = height;
    height.doubt *= doubts[e.camera];
  }
  if (cameras_ > 1) align_cameras(heights);
  if (!learns) return;
  Scatter& scatter = scatter_[now.camera][j];
  if (owned == own.size() && now.whole) learn_noise(own, scatter);
  scatter.at_rest =
      doubts[now.camera] * variance_at_rest(heights, std::min(heights.size(), rested_));
}

// Fourth differences do not see a smooth motion; their variance is 70 times a height's.
void SurfaceEstimate::learn_noise(const std::array<HeightSample, newest_heights>& h,
                                  Scatter& scatter) const noexcept {
  const double fourth =
      h[0].height - 4.0 * h[1].height + 6.0 * h[2].height - 4.0 * h[3].height + h[4].height;
  double change = fourth * fourth /
                  (h[0].doubt + 16.0 * (h[1].doubt + h[3].doubt) + 36.0 * h[2].doubt + h[4].doubt);
  // A single jump is not noise.
  if (scatter.samples >= 4.0)
    change = std::min(change, 9.0 * scatter.variance + squared(unnoticed_noise * detail()));
  scatter.samples = std::min(scatter.samples + 1.0, 40.0);
  scatter.variance += (change - scatter.variance) / scatter.samples;
}

// Lepski's rule: the widest disc that agrees with all narrower ones determines the height. A disc
// may differ from the narrower ones, because the surface is not a quadric over its width, and yet
// move with them: then it determines the motion only.
SurfaceEstimate::Choice SurfaceEstimate::choose_discs(const Discs& discs, bool learns) noexcept {
  const Evidence& now = evidence(0);
  // [-] A disc that is emptier than this, beside the narrowest, reaches beyond the body: at a
  // straight edge half of it is empty.
  constexpr double least_filled = 0.45;
  Choice choice;
  bool agree = true;
  for (std::size_t j = 1; j < now.rungs; ++j) {
    if (now.extent[j] < least_filled * now.extent[0] * squared(radii_[j] / radii_[0])) break;
    bool moves_along = discs.frames[j] >= std::min<std::size_t>(discs.frames[0], 2);
    for (std::size_t i = 0; i < j && moves_along; ++i) {
      const Comparison comparison = compare(i, j, discs, learns && choice.changed == 0);
      agree = agree && comparison.agree;
      moves_along = agree || comparison.moves_along;
      choice.changed = std::max(choice.changed, comparison.changed);
    }
    if (!moves_along) break;
    if (agree && variance(j) <= variance(choice.shape)) choice.shape = j;
    if (variance(j) <= variance(choice.motion)) choice.motion = j;
  }
  return choice;
}

// Does disc j agree with the narrower i? Their differences are taken frame by frame, so that motion
// cancels and their scatter is the noise.
SurfaceEstimate::Comparison SurfaceEstimate::compare(std::size_t i, std::size_t j,
                                                     const Discs& discs, bool asks_since) noexcept {
  const std::array<HeightSample, history>& narrow = discs.heights[i];
  const std::array<HeightSample, history>& wide = discs.heights[j];
  const std::size_t n = std::min(discs.frames[i], discs.frames[j]);
  const std::span<const double> worth_of(discs.worth_of.data(), n + 1);
  const auto difference = [&](std::size_t k) { return wide[k].height - narrow[k].height; };
  const auto [sum, squares] = sums_over<2>(n, [&](std::size_t k) {
    const double d = difference(k);
    return std::array{discs.worth[k] * d, discs.worth[k] * d * d};
  });
  const auto count = static_cast<double>(n);
  const double mean = sum / worth_of[n];
  const double about_mean = std::max(squares - worth_of[n] * mean * mean, 0.0);
  // Noise falls at most with the area it is averaged over, so the difference from the next narrower
  // disc is a lower bound of a disc's noise.
  if (i + 1 == j && n >= 4) {
    scatter_[evidence(0).camera][j].least =
        (1.0 + 2.0 / count) * about_mean / count / (squared(radii_[j] / radii_[i]) - 1.0);
  }
  const double negligible =
      4e-4 * detail() + 0.02 * spread_;  // [m] bias of noise along oblique lines of sight
  // Few differences may happen to be alike: what the heights' noise lets expect counts as `prior`
  // more. Without it a contact that slides falls back on narrow discs in single frames.
  constexpr double prior = 4.0;
  const double freedom = count - 1.0 + prior;
  const double scattered =
      (about_mean + prior * (expected_variance(i) + expected_variance(j))) / freedom;
  // What is not measured yet is bounded, not estimated.
  const bool measured = is_measured(i) && is_measured(j);
  const double sds = parameters_.confidence + (j <= rung_ ? hysteresis : 0.0);
  const double confidence = measured ? t_quantile(sds, freedom) : sds;
  // What slides in under a contact at rest changes the newest frames alone: of the mean over all it
  // is a small part, and it scatters. Only noise that was measured before shows it.
  const auto most = [&](double variance) { return sds * std::sqrt(variance) + negligible; };
  const bool differs =
      measured && changed_since(worth_of, most(variance(i) + variance(j)),
                                [&](std::size_t k) { return discs.worth[k] * difference(k); }) > 0;
  Comparison comparison;
  // Where the narrower one has changed itself, it is another surface that is touched.
  if (differs && asks_since)
    comparison.changed = changed_since(worth_of, most(variance(i)), [&](std::size_t k) {
      return discs.worth[k] * narrow[k].height;
    });
  comparison.agree =
      !differs && std::abs(mean) <= confidence * std::sqrt(scattered / worth_of[n]) + negligible;
  comparison.moves_along =
      n >= 4 && !differs &&
      std::abs(difference(0) - mean) <=
          parameters_.confidence * std::sqrt(scattered / discs.worth[0]) + negligible;
  return comparison;
}

// Has a disc's noise been measured over time?
bool SurfaceEstimate::is_measured(std::size_t rung) const noexcept {
  return scatter_[camera()][rung].samples > static_cast<double>(upper_bounds.size());
}

// [m^2] Until then what its points scatter counts at most: the usual noise of a camera would let a
// wide disc agree that reaches beyond a body.
double SurfaceEstimate::expected_variance(std::size_t rung) const noexcept {
  constexpr double unmeasured = 0.5;  // [-] of the spread
  return is_measured(rung) ? variance(rung)
                           : std::min(variance(rung), squared(unmeasured * spread_));
}

// Where the surface is, and how it moves, by the discs that were chosen.
void SurfaceEstimate::place_surface(Discs& discs, bool new_frame) noexcept {
  std::array<HeightSample, history>& past = discs.heights[mover_];
  const std::size_t known = std::min(discs.frames[rung_], discs.frames[mover_]);
  if (mover_ != rung_) {
    double difference = 0.0;
    for (std::size_t k = 0; k < known; ++k) {
      difference += (discs.heights[rung_][k].height - past[k].height) / static_cast<double>(known);
    }
    for (std::size_t k = 0; k < discs.frames[mover_]; ++k) past[k].height += difference;
  }
  const std::span<const HeightSample> since(
      past.data(), std::clamp<std::size_t>(settled_, 1, discs.frames[mover_]));
  const HeightTrack track = track_height(since, height_sd(), interval_, parameters_);
  if (new_frame) {
    velocity_ = track.velocity;
    rested_ = velocity_ == 0.0 ? std::min(rested_ + 1, history) : 0;
  }
  surface_.c.tail<5>() = discs.shapes[rung_];
  surface_.c.tail<3>() /= unit();
  above_mean_ = since.front().height - track.height;
  surface_.c[0] = track.height - discs.shapes[rung_].dot(discs.basis) * unit();
}

// Where cameras' poses are not quite right, their heights differ by what is no motion: takes from
// each camera's how far they lie above those of the others, interpolated in time, so that the mean
// stays. Of the newest frames.
void SurfaceEstimate::align_cameras(std::span<HeightSample> heights) noexcept {
  const std::size_t n = heights.size();
  constexpr std::size_t none = history;
  std::array<std::size_t, history> newer;  // frame of another camera; the next older one likewise
  std::array<std::size_t, history> older;
  const auto camera = [this](std::size_t i) { return evidence(i).camera; };
  for (std::size_t i = 0; i < n; ++i)
    newer[i] = i == 0 ? none : camera(i - 1) != camera(i) ? i - 1 : newer[i - 1];
  for (std::size_t i = n; i-- > 0;)
    older[i] = i + 1 == n ? none : camera(i + 1) != camera(i) ? i + 1 : older[i + 1];
  struct Sums {
    double difference = 0.0, count = 0.0, weight = 0.0;
  };
  std::array<Sums, Patch::max_views> sums{};
  double weight = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    Sums& own = sums[camera(i)];
    own.weight += 1.0 / heights[i].doubt;
    weight += 1.0 / heights[i].doubt;
    if (newer[i] == none || older[i] == none) continue;
    const HeightSample& after = heights[newer[i]];
    const HeightSample& before = heights[older[i]];
    const double time = after.stamp - before.stamp;
    const double share = time > 0.0 ? (heights[i].stamp - before.stamp) / time : 0.5;
    own.difference += heights[i].height - before.height - share * (after.height - before.height);
    ++own.count;
  }
  for (std::size_t i = 0; i < n; ++i) {
    const Sums& own = sums[camera(i)];
    if (own.count > 0.0)
      heights[i].height -= own.difference / own.count * (1.0 - own.weight / weight);
  }
}

// Do the points span an area, so that they determine a slope? Those of a border seen from its side
// lie in a line.
bool SurfaceEstimate::spans_area() const noexcept {
  const double xx = middle_[2] - squared(middle_[0]);
  const double xy = middle_[3] - middle_[0] * middle_[1];
  const double yy = middle_[4] - squared(middle_[1]);
  const double least = 0.5 * (xx + yy) - math::hypot(0.5 * (xx - yy), xy);
  return least > 0.05 * full_disc();
}

// Does the fit describe the surface, up to noise, in this camera's newest frame or in another's?
void SurfaceEstimate::judge(const Vec2& foot) noexcept {
  // At an edge the points lie to one side of the disc, at a gap around an empty middle.
  const Vec2 middle = middle_.head<2>();
  const Vec2 spread = Vec2(middle_[2], middle_[4]) - Vec2(middle.cwiseAbs2());
  // Hysteresis, so that the way to rest does not change from frame to frame.
  const double slack = smooth_ ? 0.5 : 0.35;
  const bool whole = (middle * unit() - foot).norm() < 0.85 * slack * radii_[0] &&
                     spread.minCoeff() > (1.0 - slack) * full_disc() &&
                     spread.maxCoeff() < (1.0 + slack) * full_disc();
  smooth_ = whole && fit_test_.describes(surface_, detail(), smooth_);
}

// Keeps the local origin near the contact: sums of fourth powers lose digits far from it.
void SurfaceEstimate::move_origin(const Vec2& foot) noexcept {
  const double cell = fit_test_.cell_size();
  const Eigen::Vector2i step = (foot / cell).array().round().cast<int>();
  const Vec2 to = cell * step.cast<double>();
  const Vec3 shift(to.x(), to.y(), surface_.height(to));
  const Vec2 gradient = surface_.gradient(to);
  frame_.origin = frame_.world_from_local(shift);
  surface_.c[0] = 0.0;
  surface_.c[1] = gradient.x();
  surface_.c[2] = gradient.y();
  centre_ -= to;
  fit_test_.move_origin(step, shift);
  // A disc that lies twice as far as discs may overlap from a newer frame's is never reached again,
  // nor is what is older. The newest frame's may still be moved.
  const Vec2 newer = count_ > 1 ? evidence(1).centre : foot;
  std::size_t lost = 0;
  for (std::size_t age = 0; age < count_; ++age) {
    Evidence& e = evidence(age);
    const double away = (e.centre - newer).norm();
    while (age > 1 && lost < rungs && away > 2.0 * overlap(lost)) ++lost;
    e.lost = std::max(e.lost, lost);
    e.centre -= to;
    for (std::size_t j = e.lost; j < e.rungs; ++j) {
      e.disc[j] = e.disc[j].moved(shift / unit());
      e.shape[j] = Shape::of(e.disc[j]);
    }
  }
}

}  // namespace palpate
