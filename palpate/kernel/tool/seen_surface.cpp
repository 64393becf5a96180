// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/tool/seen_surface.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "palpate/kernel/core/lanes.hpp"
#include "palpate/kernel/sight/monitor.hpp"
#include "palpate/kernel/sight/relief.hpp"
#include "palpate/kernel/sight/render.hpp"

namespace palpate {
namespace {

constexpr float unknown = std::numeric_limits<float>::quiet_NaN();
// As sight's averaged points have them: docs/sight.md, 5.
constexpr std::size_t most_frames = 64;  // of a level
constexpr float most_relief = 128.0F;    // frames in a cell's mean
// [intervals] over which small corrections of a cell are shown, [s] over which large ones are, and
// [-] spreads that are large.
constexpr double slow_intervals = 4.0;
constexpr double quick = 10e-3;
constexpr float large_spreads = 1.0F;
// What comes nearer by more than what may strike a surface hides what was there. [-] So much nearer
// than it is high is a body that is seen 30 degrees from aside, and [-] spreads of a reading.
constexpr double aslant = 1.15;
constexpr float hiding_spreads = 2.0F;
constexpr float flying_spreads = 2.0F;  // [-] that a reading beside an occluder may be nearer
constexpr int edge = 2;                 // [cells] from an occluder to where readings may be so
// [-] beside `deepest`, by which a body is nearer that begins to slide; by which it is while it
// goes on; and [frames] without it, after which it begins again.
constexpr float sliding_spreads = 3.0F;
constexpr float going_spreads = 2.0F;
constexpr double going_frames = 3.5;
constexpr float edge_spreads = 4.0F;  // [-] by which it is at its foot, in so many cells
constexpr int foot = 6;
constexpr int least_slid = 24;  // cells: two along a frame's way, twelve along an edge
// Cells that are nearer by more than so many times what hides a surface: more are an occluder.
constexpr int most_struck = 16;
constexpr float far_strikes = 1.3F;
constexpr int rows_of_tick = 8;          // of cells that take the newest frame in
constexpr int lag = 1;                   // [cells] by which they follow a tool late
constexpr double longest_tick = 20e-3;   // [s] over more, nothing is smooth
constexpr int most_across = 15;          // cells that measure the level, along either axis
constexpr std::size_t least_cells = 8;   // that measure a level
constexpr double nearest_camera = 1e-3;  // [m] from it to a place, along its axis
constexpr double farthest_pixel = 1e6;   // [px] beyond any image
constexpr double least_noise = 1e-6;     // [m] to divide by
constexpr int coarsest = 16;             // [px] of a cell
constexpr double steepest = 2.75;        // [-] slope of 70 degrees: steeper is an edge
constexpr float layer = 10e-3F;          // [m] pixels of one cell farther apart are of two surfaces
constexpr int near_cells = 2;            // of a fit, on either side of the middle one
// The wider fits: cells on either side of the middle, cells from one of those to the next, and [-]
// how much better the fit before it knows the height at the place than one cell does.
struct WideFit {
  int cells, step;
  double known;
};
constexpr std::array<WideFit, 2> wide_fits = {{{4, 4, 1.0}, {4, 14, 3.0}}};
constexpr double farthest_cell = 1.0;  // [m] from the place
// [-] scatter about a wide plane over a cell's noise: up to here noise explains it, and from there
// on it is shape.
constexpr double trusted_scatter = 1.5;
constexpr double refused_scatter = 3.0;
constexpr double near_enough = 3.0;  // [-] noise that a cell of a wider fit may be off the narrower
// [-] share of the cells which must not be: a wall of a corner has more than half at its foot.
constexpr double trusted_part = 0.6;
constexpr double refused_part = 0.4;
// [-] cosine between the tool's outward normal and the surface's: more is not a side that meets it.
constexpr double facing = -0.4;
// [m] and spreads below an edge: a place so deep is beside a body, not on its rim.
constexpr double rim = 1.5e-3;
constexpr double rim_spreads = 4.0;
// A place in a body is pushed out through its side if that is at most so many cells away, and if
// [-] so much of the tool's normal is across the line of sight.
constexpr int farthest_side = 8;
constexpr double least_across = 0.5;
constexpr int farthest_out = 48;  // [cells] to where a body is pushed away, that slid over a tool

// (4), block by block: compilers make vector code of all but the look-up.
PALPATE_VECTORISED
void raise(const SeenSurface::View& view, const PointArrays& points, float* gap) {
  constexpr int side = SeenSurface::side;
  constexpr float last = side - 1;  // the window's last row and column have no next one
  const auto [x, y, z, size] = points;
  const std::array<float, 9>& r = view.turn;
  const std::array<float, 3>& s = view.shift;
  for (std::size_t block = 0; block < whole_blocks(size); block += sum_lanes) {
    FloatLanes depth, p, q, upper_left, upper_right, lower_left, lower_right;
    std::array<std::int32_t, sum_lanes> cell;
    for (std::size_t lane = 0; lane < sum_lanes; ++lane) {
      const std::size_t i = block + lane;
      const float away = r[6] * x[i] + r[7] * y[i] + r[8] * z[i] + s[2];
      const float inverse = 1.0F / away;
      float u = view.cu + view.fu * ((r[0] * x[i] + r[1] * y[i] + r[2] * z[i] + s[0]) * inverse);
      float v = view.cv + view.fv * ((r[3] * x[i] + r[4] * y[i] + r[5] * z[i] + s[1]) * inverse);
      // One condition at a time, as vectors have them. A NaN meets none.
      float known = away > 0.0F ? away : unknown;
      known = u >= 0.0F ? known : unknown;
      known = v >= 0.0F ? known : unknown;
      known = u < last ? known : unknown;
      known = v < last ? known : unknown;
      u = known > 0.0F ? u : 0.0F;
      v = known > 0.0F ? v : 0.0F;
      const auto a = static_cast<std::int32_t>(u);
      const auto b = static_cast<std::int32_t>(v);
      p[lane] = u - static_cast<float>(a);
      q[lane] = v - static_cast<float>(b);
      cell[lane] = b * side + a;
      depth[lane] = known;
    }
    for (std::size_t lane = 0; lane < sum_lanes; ++lane) {
      const float* here = view.depth + cell[lane];
      upper_left[lane] = here[0];
      upper_right[lane] = here[1];
      lower_left[lane] = here[side];
      lower_right[lane] = here[side + 1];
    }
    for (std::size_t lane = 0; lane < sum_lanes; ++lane) {
      const float above = upper_left[lane] + p[lane] * (upper_right[lane] - upper_left[lane]);
      const float below = lower_left[lane] + p[lane] * (lower_right[lane] - lower_left[lane]);
      const float surface = above + q[lane] * (below - above);
      // Beside a hole that of the nearest cell.
      const float upper = p[lane] < 0.5F ? upper_left[lane] : upper_right[lane];
      const float lower = p[lane] < 0.5F ? lower_left[lane] : lower_right[lane];
      const float nearest = q[lane] < 0.5F ? upper : lower;
      const float here = (surface == surface ? surface : nearest) - depth[lane];
      float& highest = gap[block + lane];
      highest = here > highest ? here : highest;
    }
  }
}

// (9), cell by cell: small corrections of the relief are followed slowly, large ones at once.
PALPATE_VECTORISED
void follow(const float* relief, std::size_t size, float slow, float more, float large,
            float* smooth) {
  for (std::size_t i = 0; i < whole_blocks(size); ++i) {
    const float off = relief[i] - smooth[i];
    const float share = std::abs(off) * large;
    smooth[i] += (slow + more * (share < 1.0F ? share : 1.0F)) * off;
  }
}

}  // namespace

void SeenSurface::raise_gaps(const View& view, const PointArrays& points, float* gap) noexcept {
  vectorised<raise>(view, points, gap);
}

Vec3 SeenSurface::in_camera(const Vec3& place) const noexcept {
  return pose_.linear().transpose() * (place - pose_.translation());
}

Eigen::Vector2d SeenSurface::cell_of(const Vec3& p) const noexcept {
  const Intrinsics& k = image_->intrinsics();
  const double middle = 0.5 * (stride_ - 1);  // of a cell, behind its first pixel
  return {(k.cx + shift_u_ + k.fx * p.x() / p.z() - middle) / stride_,
          (k.cy + shift_v_ + k.fy * p.y() / p.z() - middle) / stride_};
}

float SeenSurface::hiding(const SightParameters& parameters) const noexcept {
  return static_cast<float>(aslant * farthest_strike * parameters.detail) +
         hiding_spreads * spread_;
}

double SeenSurface::level(double t) const noexcept {
  return level_ + moved_since(velocity_, t - stamp_, interval_);  // (6)
}

// The mean of a cell's pixels that are of its nearest layer; 0: nothing.
float SeenSurface::read(int u, int v) const noexcept {
  const Intrinsics& k = image_->intrinsics();
  if (stride_ == 1) {
    const bool is_inside = u >= 0 && v >= 0 && u < k.width && v < k.height;
    return is_inside ? static_cast<float>(image_->depth_at(u, v)) : 0.0F;
  }
  const int first = stride_ / 4;
  const int step = std::max(stride_ / 2, 1);
  std::array<float, 4> depths{};
  std::size_t size = 0;
  float nearest = std::numeric_limits<float>::max();
  for (int y = v * stride_ + first; y < (v + 1) * stride_; y += step) {
    for (int x = u * stride_ + first; x < (u + 1) * stride_; x += step) {
      if (x < 0 || y < 0 || x >= k.width || y >= k.height) continue;
      const auto z = static_cast<float>(image_->depth_at(x, y));
      if (z <= 0.0F) continue;
      depths[size++] = z;
      nearest = std::min(nearest, z);
    }
  }
  float sum = 0.0F;
  float of = 0.0F;
  for (std::size_t i = 0; i < size; ++i) {
    if (depths[i] > nearest + layer) continue;
    sum += depths[i];
    of += 1.0F;
  }
  return size == 0 ? 0.0F : sum / of;
}

double SeenSurface::noise_of(int u, int v) const noexcept {
  const Intrinsics& k = image_->intrinsics();
  return image_->noise_at(std::clamp(u * stride_ + stride_ / 2, 0, k.width - 1),
                          std::clamp(v * stride_ + stride_ / 2, 0, k.height - 1), mean_noise_);
}

float SeenSurface::weigh(int u, int v) noexcept {
  const auto noisier = static_cast<float>(noise_of(u, v) / mean_noise_);
  cells_[0].weight[index(u, v)] = 1.0F / (noisier * noisier);
  return noisier * spread_;
}

double SeenSurface::noise_at_1m(const Vec3& place,
                                const SightParameters& parameters) const noexcept {
  const double said = image_->noise_at(place, 0.0);
  const double z = std::max(in_camera(place).z(), nearest_camera);
  return said > 0.0 ? said / (z * z) : parameters.usual_noise_at(1.0);
}

void SeenSurface::start_cell(int u, int v) noexcept {
  Cells& all = cells_[0];
  const std::size_t i = index(u, v);
  const float z = read(u, v);
  // The middle of a cell with an even number of pixels is half a pixel before the next one's.
  const Intrinsics& k = image_->intrinsics();
  const Eigen::Vector2d ray =
      image_->rays().ray(std::clamp(u * stride_ + stride_ / 2, 0, k.width - 1),
                         std::clamp(v * stride_ + stride_ / 2, 0, k.height - 1));
  const double half = stride_ % 2 == 0 ? 0.5 : 0.0;
  all.ray_x[i] = static_cast<float>(ray.x() - half / k.fx);
  all.ray_y[i] = static_cast<float>(ray.y() - half / k.fy);
  all.relief[i] = z > 0.0F ? z - newest_ : unknown;
  all.smooth[i] = all.relief[i];
  all.slides[i] = unknown;
  all.slid[i] = std::numeric_limits<double>::quiet_NaN();
  all.drift[i] = 0.0F;
  all.frames[i] = z > 0.0F ? 1.0F : 0.0F;
  all.seen[i] = stamp_;
  if (image_->has_noise()) weigh(u, v);
}

// Keeps the cells about a tool; what they leave is forgotten.
void SeenSurface::aim_at(const Aim& aim) noexcept {
  const Intrinsics& k = image_->intrinsics();
  const Vec3 p = in_camera(aim.place);
  // The part of the tool that is nearest to the camera spans most pixels.
  const double z = std::max(p.z(), nearest_camera);
  const double near = std::max(p.z() - aim.radius, 0.5 * z);
  const double across = 2.0 * aim.radius * std::max(k.fx, k.fy) / near;  // [px]
  const bool fits = across <= side * stride_ && (stride_ == 1 || 3.0 * across > side * stride_);
  const int from_stride = stride_;
  if (!fits || frames_ == 0) {
    stride_ = 1;
    while (stride_ < coarsest && 1.2 * across > side * stride_) stride_ *= 2;
  }
  const auto pixel = [](double x) { return std::clamp(x, -farthest_pixel, farthest_pixel); };
  double u = pixel(k.cx + k.fx * p.x() / z);
  double v = pixel(k.cy + k.fy * p.y() / z);
  if (k.distorted() && p.z() > nearest_camera) {
    const ViewingRays::Window window = image_->rays().window(p, 0.5 * p.z() / k.fx);
    if (!window.empty()) {
      shift_u_ = 0.5 * (window.u_begin + window.u_end - 1) - u;
      shift_v_ = 0.5 * (window.v_begin + window.v_end - 1) - v;
    }
    u += shift_u_;
    v += shift_v_;
  }
  const int first_u = static_cast<int>(std::floor(u / stride_)) - side / 2;
  const int first_v = static_cast<int>(std::floor(v / stride_)) - side / 2;
  const bool all_new = frames_ == 0 || stride_ != from_stride;
  if (!all_new && std::abs(first_u - u_) <= lag && std::abs(first_v - v_) <= lag) return;
  const int from_u = u_;
  const int from_v = v_;
  u_ = first_u;
  v_ = first_v;
  for (int y = v_; y < v_ + side; ++y)
    for (int x = u_; x < u_ + side; ++x)
      if (all_new || x < from_u || y < from_v || x >= from_u + side || y >= from_v + side)
        start_cell(x, y);
}

// The newest frame's level (5). False: too few cells are known.
bool SeenSurface::find_level(const Aim& aim, const SightParameters& parameters) noexcept {
  const Cells& all = cells_[0];
  const Vec3 p = in_camera(aim.place);
  const double pitch = cell_at(std::max(p.z(), nearest_camera));
  const int reach = std::clamp(static_cast<int>(aim.radius / pitch), 2, side / 2 - 1);
  const int step = 1 + 2 * reach / most_across;
  std::array<float, std::size_t{most_across + 1} * (most_across + 1)> values;
  // What comes so much nearer at once is an occluder: it measures nothing. If it hides half of the
  // cells, the rest is too little.
  const float hidden = frames_ > 1 ? static_cast<float>(level(stamp_)) - hiding(parameters)
                                   : std::numeric_limits<float>::lowest();
  std::size_t size = 0, known = 0;
  double noise = 0.0;
  for (int y = v_ + side / 2 - reach; y <= v_ + side / 2 + reach; y += step) {
    for (int x = u_ + side / 2 - reach; x <= u_ + side / 2 + reach; x += step) {
      const float relief = all.relief[index(x, y)];
      const float z = read(x, y);
      if (!(z > 0.0F && relief == relief && known < values.size())) continue;
      ++known;
      if (!(z - relief >= hidden)) continue;
      values[size++] = z - relief;
      noise += noise_of(x, y);
    }
  }
  if (size < least_cells || 2 * size < known) return false;
  const std::span<float> near(values.data(), size);
  newest_ = level_of(near, spread_).height;
  spread_ = next_spread(spread_, newest_, near, image_->units_per_metre());
  mean_noise_ = noise / static_cast<double>(size);
  // How much one frame's level varies: by second differences, which no steady motion changes.
  constexpr double memory = 0.05;  // [-] of the newest of them
  if (frames_ >= 2) {
    const double bend = newest_ - 2.0 * levels_[0].height + levels_[1].height;
    // An image that is too sure of itself must not make the level so.
    const double usual =
        std::max(noise_at_1m(aim.place, parameters), parameters.usual_noise_at(1.0));
    const double size_of = std::min(bend * bend / 6.0, p.squaredNorm() * usual * usual);
    wobble_ = std::sqrt((1.0 - memory) * wobble_ * wobble_ + memory * size_of);
  }
  return true;
}

// Takes the newest reading [m], 0 for none, into a cell's relief (7).
// @param spread  [m] standard deviation of the reading
void SeenSurface::update(std::size_t i, float z, float spread,
                         const SightParameters& parameters) noexcept {
  Cells& all = cells_[0];
  if (!(all.frames[i] > 0.0F)) {
    if (z > 0.0F) {
      all.relief[i] = all.smooth[i] = z - newest_;
      all.frames[i] = 1.0F;
      all.drift[i] = 0.0F;
      all.seen[i] = stamp_;
    }
    return;
  }
  if (z == 0.0F || z - newest_ - all.relief[i] < -hiding(parameters)) {  // hidden
    if (stamp_ - all.seen[i] > parameters.hidden_hold + parameters.hidden_fade) {
      all.relief[i] = all.smooth[i] = unknown;
      all.frames[i] = 0.0F;
    }
    return;
  }
  all.seen[i] = stamp_;
  follow_relief(z - newest_, spread, most_relief, all.relief[i], all.drift[i], all.frames[i]);
}

// Is a reading [m] between a surface and what hides it beside this cell? It measures neither.
bool SeenSurface::flies(int u, int v, float z, const SightParameters& parameters) const noexcept {
  const auto above = [&](int at_u, int at_v, float reading) {
    return reading > 0.0F ? newest_ + cells_[0].relief[index(at_u, at_v)] - reading : 0.0F;
  };
  if (!(above(u, v, z) > flying_spreads * spread_)) return false;  // nearly always
  for (int y = v - edge; y <= v + edge; ++y)
    for (int x = u - edge; x <= u + edge; ++x)
      if (has(x, y) && above(x, y, read(x, y)) > hiding(parameters)) return true;
  return false;
}

// Is a reading [m], nearer than what was there, of a body, and not of its edge, where readings are
// between both?
bool SeenSurface::is_of_body(int u, int v, float z) const noexcept {
  int same = 0;
  for (const auto& [x, y] :
       {std::pair(u - 1, v), std::pair(u + 1, v), std::pair(u, v - 1), std::pair(u, v + 1)})
    same += std::abs(read(x, y) - z) < layer + sliding_spreads * spread_ ? 1 : 0;
  return same >= 3;
}

// Lets bodies slide over all cells at once: a half-taken one would have sides that are none. Where
// one is so much nearer that no tool can be pushed along the line of sight, it slid; and so it did
// beside, down to its foot. Few cells are noise; and while something passes before the surface,
// nothing is said to slide.
void SeenSurface::slide() noexcept {
  if (!slides_) return;
  slides_ = false;
  Cells& all = cells_[0];
  const bool goes_on = stamp_ - slid_at_ < going_frames * interval_;
  const float high =
      static_cast<float>(deepest) + (goes_on ? going_spreads : sliding_spreads) * spread_;
  const auto is_high = [&](int u, int v) {
    return has(u, v) && all.smooth[index(u, v)] - all.slides[index(u, v)] > high;
  };
  int size = 0;
  for (std::size_t i = 0; i < count; ++i) size += all.smooth[i] - all.slides[i] > high ? 1 : 0;
  slid_ = size >= least_slid && struck_ <= most_struck;
  if (slid_) slid_at_ = stamp_;
  for (int v = v_; v < v_ + side; ++v) {
    for (int u = u_; u < u_ + side; ++u) {
      float& slides = all.slides[index(u, v)];
      if (!(slides == slides)) continue;
      bool slid = is_high(u, v);
      for (int k = 1; k <= foot && !slid; ++k)
        slid = is_high(u - k, v) || is_high(u + k, v) || is_high(u, v - k) || is_high(u, v + k);
      if (!slid || !slid_) slides = unknown;
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (!(all.slides[i] == all.slides[i])) continue;
    all.relief[i] = all.smooth[i] = all.slides[i];
    all.slides[i] = unknown;
    all.drift[i] = 0.0F;
    all.frames[i] = 1.0F;
    all.seen[i] = all.slid[i] = stamp_;
  }
}

// Takes further rows of the newest frame in: all at once would be felt as a late tick.
void SeenSurface::read_rows(int rows, const SightParameters& parameters) noexcept {
  if (rows_read_ == side) return;
  const float nearer = hiding(parameters);
  const bool has_noise = image_->has_noise();
  for (; rows > 0 && rows_read_ < side; --rows, ++rows_read_) {
    const int v = v_ + ((rows_read_ - v_) & (side - 1));  // each row of the memory once
    for (int u = u_; u < u_ + side; ++u) {
      const float z = read(u, v);
      const std::size_t i = index(u, v);
      const bool flying = flies(u, v, z, parameters);
      const float above = z > 0.0F ? newest_ + cells_[0].smooth[i] - z : 0.0F;
      if (above > far_strikes * nearer) ++struck_;
      if (above > edge_spreads * spread_ && above < nearer && !flying && is_of_body(u, v, z)) {
        cells_[0].slides[i] = z - newest_;
        slides_ = true;
      }
      update(i, flying ? 0.0F : z, has_noise ? weigh(u, v) : spread_, parameters);
    }
  }
  if (rows_read_ < side) return;
  whole_ = true;
  slide();
}

void SeenSurface::observe(const DepthImage& image, const Aim& aim, double stamp, double interval,
                          const SightParameters& parameters) noexcept {
  const bool goes_on = image_ != nullptr && frames_ > 0 && stamp > stamp_ &&
                       pose_.matrix() == image.world_from_camera().matrix();
  whole_ = slid_ = false;
  if (goes_on) read_rows(side, parameters);  // what is left of the frame before
  if (!blend_due_) carried_ = level(t_) + offset(t_);
  const double held = level(stamp);  // where it is if this frame does not measure it
  image_ = &image;
  pose_ = image.world_from_camera();
  stamp_ = stamp;
  interval_ = interval;
  if (!goes_on) {
    frames_ = 0;
    slides_ = false;
    slid_at_ = -std::numeric_limits<double>::infinity();
    newest_ = static_cast<float>(in_camera(aim.place).z());
    spread_ = 0.0F;
    const double usual = noise_at_1m(aim.place, parameters);
    mean_noise_ = std::max(least_noise, usual * newest_ * newest_);
    // [-] of a reading's noise that is left in the median of many, which correlate.
    constexpr double left = 0.2;
    wobble_ = left * usual * newest_ * newest_;
    aim_at(aim);
    level_ = newest_;
    velocity_ = 0.0;
    blend_due_ = false;
    blend_start_ = -std::numeric_limits<double>::infinity();
    levels_[0] = {stamp, level_};
    frames_ = 1;
    rows_read_ = side;
    spread_ = static_cast<float>(usual * newest_ * newest_);
    return;
  }
  blend_due_ = true;
  if (find_level(aim, parameters)) {
    std::copy_backward(levels_.begin(), levels_.begin() + most_frames - 1,
                       levels_.begin() + most_frames);
    levels_[0] = {stamp, double{newest_}};
    frames_ = std::min(frames_ + 1, most_frames);
    const double least = 0.1 / image.units_per_metre();  // [m] no level is known better
    const HeightTrack track = track_height(std::span(levels_.data(), frames_),
                                           std::max(wobble_, least), interval, parameters);
    level_ = track.height;
    velocity_ = track.velocity;
  } else {
    level_ = held;
    velocity_ = 0.0;
  }
  aim_at(aim);  // by the new level: cells that begin have their relief over it
  rows_read_ = 0;
  struck_ = 0;
}

void SeenSurface::start_tick(const Aim& aim, double t, const SightParameters& parameters) noexcept {
  if (image_ == nullptr) return;
  Cells& all = cells_[0];
  aim_at(aim);
  if (!blend_due_) whole_ = slid_ = false;  // else that of the frame before may just have been
  read_rows(rows_of_tick, parameters);
  if (blend_due_) {  // (8): the level goes on from where it was
    blend_due_ = false;
    blend_start_ = t;
    blend_time_ = parameters.blend * interval_;
    offset_ = carried_ - level(t);
  }
  const double dt = std::clamp(t - t_, 0.0, longest_tick);
  const auto slow = static_cast<float>(dt / (dt + slow_intervals * interval_));
  const auto more = static_cast<float>(dt / (dt + quick)) - slow;
  const float large = 1.0F / std::max(large_spreads * spread_, 1e-4F);
  vectorised<follow>(all.relief.data(), count, slow, more, large, all.smooth.data());
  const auto now = static_cast<float>(level(t) + offset(t));
  float* shown = all.shown.data();
  for (int v = v_; v < v_ + side; ++v) {
    const float* row = &all.smooth[index(0, v)];
    const int first = u_ & (side - 1);
    for (int u = first; u < side; ++u) *shown++ = now + row[u];
    for (int u = 0; u < first; ++u) *shown++ = now + row[u];
  }
  t_ = t;
}

// [m] by which the level is shown otherwise, so that no frame makes it jump.
double SeenSurface::offset(double t) const noexcept {
  return ease((t - blend_start_) / std::max(blend_time_, 1e-9)) * offset_;
}

SeenSurface::View SeenSurface::view(const Eigen::Isometry3d& world_from_tool) const noexcept {
  const Intrinsics& k = image_->intrinsics();
  View view{};
  const Eigen::Matrix3d turn = pose_.linear().transpose() * world_from_tool.linear();
  const Vec3 shift = in_camera(world_from_tool.translation());
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      view.turn[static_cast<std::size_t>(3 * row + column)] = static_cast<float>(turn(row, column));
    view.shift[static_cast<std::size_t>(row)] = static_cast<float>(shift[row]);
  }
  // The middle of a cell of s pixels is (s - 1) / 2 pixels behind its first.
  const double middle = 0.5 * (stride_ - 1);
  view.fu = static_cast<float>(k.fx / stride_);
  view.fv = static_cast<float>(k.fy / stride_);
  view.cu = static_cast<float>((k.cx + shift_u_ - middle) / stride_ - u_);
  view.cv = static_cast<float>((k.cy + shift_v_ - middle) / stride_ - v_);
  view.depth = cells_[0].shown.data();
  return view;
}

double SeenSurface::noise() const noexcept {
  return spread_ / std::sqrt(static_cast<double>(std::max<std::size_t>(frames_, 1)));
}

Vec3 SeenSurface::velocity(double t) const noexcept {
  constexpr double dt = 1e-3;  // [s]
  return (level(t) - level(t - dt)) / dt * pose_.linear().col(2);
}

std::optional<SeenSurface::Fit> SeenSurface::fit(const Vec3& place, const Vec3& outward,
                                                 double side_depth) const noexcept {
  const Cells& all = cells_[0];
  const Vec3 p = in_camera(place);
  if (!(p.z() > nearest_camera)) return std::nullopt;
  const Eigen::Vector2d cell = cell_of(p);
  const double x = cell.x() - u_;
  const double y = cell.y() - v_;
  if (!(x >= 0.0 && y >= 0.0 && x < side - 1 && y < side - 1)) return std::nullopt;
  const int u = u_ + static_cast<int>(x);
  const int v = v_ + static_cast<int>(y);
  const double a = x - std::floor(x), b = y - std::floor(y);
  // The four cells about it: are they of one surface?
  const float* four = &all.shown[shown_index(u, v)];
  const std::array<double, 4> corner{four[0], four[1], four[side], four[side + 1]};
  double low = std::numeric_limits<double>::max(), high = 0.0;
  std::size_t known = 0;
  for (const double z : corner) {
    if (!(z > 0.0)) continue;
    low = std::min(low, z);
    high = std::max(high, z);
    ++known;
  }
  if (known == 0) return std::nullopt;
  const double pitch = cell_at(p.z());
  const double jump = steepest * pitch + rim_spreads * noise();
  const int nearest_u = a < 0.5 ? u : u + 1;
  const int nearest_v = b < 0.5 ? v : v + 1;
  const double here = all.shown[shown_index(nearest_u, nearest_v)];
  double from = known == 4 ? (1 - b) * ((1 - a) * corner[0] + a * corner[1]) +
                                 b * ((1 - a) * corner[2] + a * corner[3])
                           : here;
  if (!(from > 0.0)) from = low;
  if (high - low > jump) {
    if (known == 4 && p.z() > low + rim + rim_spreads * noise()) {
      if (p.z() > low + side_depth) return std::nullopt;
      // The side of a body: the ramp between its edge and what is behind.
      const double along_u =
          ((1 - b) * (corner[1] - corner[0]) + b * (corner[3] - corner[2])) / pitch;
      const double along_v =
          ((1 - a) * (corner[2] - corner[0]) + a * (corner[3] - corner[1])) / pitch;
      const double steep = std::sqrt(1.0 + along_u * along_u + along_v * along_v);
      return Fit{.gap = (from - p.z()) / steep,
                 .normal = pose_.linear() * (Vec3(along_u, along_v, -1.0) / steep),
                 .unseen = unseen_since(all.seen[index(nearest_u, nearest_v)]),
                 .wall = true};
    }
    // On the layer of the nearest cell: a rim ends half a cell beyond its last one.
    from = here > 0.0 ? here : low;
  }
  const Middle around{p, x, y, from, jump};
  if (p.z() > from + rim + rim_spreads * noise())
    if (std::optional<Fit> way_out = side_near(around, outward)) return way_out;
  // The plane through the cells of that surface (10): through far ones, too, as far as noise alone
  // explains their distances from it.
  Plane near = plane_about(around, near_cells, 1);
  if (near.cells == 0) return std::nullopt;
  const auto normal_of = [&](const Eigen::Vector2d& slope) -> Vec3 {
    return pose_.linear() * Vec3(slope.x(), slope.y(), -1.0).normalized();
  };
  if (normal_of(near.slope).dot(outward) > facing) return std::nullopt;
  const double usual = std::max(noise(), 0.3 / image_->units_per_metre());
  double reach = near_cells;
  for (const WideFit& each : wide_fits) {
    const Narrower narrower{near, near_enough * usual, reach};
    const Plane wide = plane_about(around, each.cells, each.step, &narrower);
    reach = each.cells * each.step;
    if (wide.cells <= near.cells / 2) break;
    const double off =
        std::max(wide.scatter, each.known * std::abs(wide.height - near.height)) / usual;
    const double share = ease((off - trusted_scatter) / (refused_scatter - trusted_scatter)) *
                         ease((trusted_part - wide.part) / (trusted_part - refused_part));
    near.height += share * (wide.height - near.height);
    near.slope += share * (wide.slope - near.slope);
    if (share < 1.0) break;
  }
  const Vec3 normal = normal_of(near.slope);
  return Fit{.gap = (p.z() - near.height) * pose_.linear().col(2).dot(normal),
             .normal = normal,
             .unseen = unseen_since(near.newest),
             .wall = false};
}

// Of a place deep in a body: the side that it came through, a frame or a step before, if there is
// one in the direction from which the tool's surface is.
std::optional<SeenSurface::Fit> SeenSurface::side_near(const Middle& middle,
                                                       const Vec3& outward) const noexcept {
  const Cells& all = cells_[0];
  Vec3 way = pose_.linear().transpose() * -outward;
  way.z() = 0.0;
  const double across = way.norm();
  if (across < least_across) return std::nullopt;
  way /= across;
  const double pitch = cell_at(middle.p.z());
  const double farthest = (middle.p.z() - middle.from) / pitch;  // deeper than it is away
  double before = middle.from, at = 0.0;  // [m] depth of the cell before, [cells] along the way
  for (int i = 1; i <= std::min(static_cast<int>(farthest), farthest_side); ++i) {
    const int u = static_cast<int>(std::lround(middle.x + i * way.x()));
    const int v = static_cast<int>(std::lround(middle.y + i * way.y()));
    if (u < 0 || v < 0 || u >= side || v >= side) break;
    const double z = all.shown[static_cast<std::size_t>(v * side + u)];
    if (!(z > 0.0)) continue;
    const double along = (u - middle.x) * way.x() + (v - middle.y) * way.y();
    if (z > middle.p.z() + rim)
      return Fit{.gap = -pitch * (at + (middle.p.z() - before) / (z - before) * (along - at)),
                 .normal = pose_.linear() * way,
                 .unseen = unseen_since(all.seen[index(u_ + u, v_ + v)]),
                 .wall = true};
    before = z;
    at = along;
  }
  return std::nullopt;
}

// [m] from a place along a way of unit length along the image to the first cell for which
// `ends(its index, its depth less that of the way there)`; infinite: there is none.
template <typename Ends>
double SeenSurface::walk(const Vec3& place, const Vec3& way, Ends ends) const noexcept {
  constexpr double none = std::numeric_limits<double>::infinity();
  const Vec3 p = in_camera(place);
  if (!(p.z() > nearest_camera)) return none;
  const Eigen::Vector2d cell = cell_of(p);
  const double pitch = cell_at(p.z());
  for (int i = 0; i < farthest_out; ++i) {
    const int u = static_cast<int>(std::floor(cell.x() + 0.5 + i * way.x()));
    const int v = static_cast<int>(std::floor(cell.y() + 0.5 + i * way.y()));
    if (!has(u, v)) return none;
    if (ends(index(u, v), cells_[0].shown[shown_index(u, v)] - p.z() - i * pitch * way.z()))
      return (i + 0.5) * pitch * way.norm();
  }
  return none;
}

double SeenSurface::way_out(const Vec3& place, const Vec3& way) const noexcept {
  const double least = -rim - rim_spreads * noise();
  return walk(place, way, [least](std::size_t /*cell*/, double gap) { return gap > least; });
}

double SeenSurface::way_back(const Vec3& place, const Vec3& way) const noexcept {
  return walk(place, -way, [](std::size_t /*cell*/, double gap) { return gap < -0.5 * deepest; });
}

double SeenSurface::speed_along(const Vec3& from, const Vec3& way) const noexcept {
  const std::array<double, count>& slid = cells_[0].slid;
  // [s] before which a body slid over a cell; and where the walk ended
  double latest = stamp_ + interval_, ended = 0.0;
  const auto far = [&] {
    return walk(from, -way, [&](std::size_t i, double) { return (ended = slid[i]) < latest; });
  };
  const double front = far();
  for (const double frames : {1.5, 0.5}) {
    latest = stamp_ - frames * interval_;
    if (const double older = far(); std::isfinite(older)) return (older - front) / (stamp_ - ended);
  }
  return std::numeric_limits<double>::quiet_NaN();
}

// The plane through the cells on a lattice, `step` apart, of so many on either side of the middle.
template <bool is_weighted>
SeenSurface::Plane SeenSurface::plane_through(const Middle& middle, int cells, int step,
                                              const Narrower* narrower) const noexcept {
  const Cells& all = cells_[0];
  const int middle_u = static_cast<int>(std::lround(middle.x));
  const int middle_v = static_cast<int>(std::lround(middle.y));
  const int reach = cells * step;
  const auto first = [&](int at) { return at < reach ? at % step : at - reach; };
  double sx = 0.0, sy = 0.0, sz = 0.0, xx = 0.0, xy = 0.0, yy = 0.0, xz = 0.0, yz = 0.0, zz = 0.0;
  Plane plane;
  double looked = 0.0, of = 0.0;
  for (int v = first(middle_v); v <= std::min(middle_v + reach, side - 1); v += step) {
    for (int u = first(middle_u); u <= std::min(middle_u + reach, side - 1); u += step) {
      const double z = all.shown[static_cast<std::size_t>(v * side + u)];
      const double away = std::max(std::abs(u - middle.x), std::abs(v - middle.y));
      if (!(std::abs(z - middle.from) <= middle.jump * std::max(away, 1.0))) continue;
      const std::size_t i = index(u_ + u, v_ + v);
      // Relative to the place: small numbers, whose squares lose nothing.
      const double px = double{all.ray_x[i]} * z - middle.p.x();
      const double py = double{all.ray_y[i]} * z - middle.p.y();
      const double pz = z - middle.from;
      if (!(std::abs(px) + std::abs(py) < farthest_cell)) continue;  // nor a pixel without a ray
      ++looked;
      if (narrower != nullptr && !narrower->explains(px, py, z, away)) continue;
      const double w = is_weighted ? double{all.weight[i]} : 1.0;
      of += w;
      sx += w * px;
      sy += w * py;
      sz += w * pz;
      xx += w * px * px;
      xy += w * px * py;
      yy += w * py * py;
      xz += w * px * pz;
      yz += w * py * pz;
      zz += w * pz * pz;
      plane.newest = std::max(plane.newest, all.seen[i]);
      ++plane.cells;
    }
  }
  if (plane.cells == 0) return plane;
  plane.part = static_cast<double>(plane.cells) / looked;
  const double mx = sx / of, my = sy / of, mz = sz / of;
  plane.height = middle.from + mz;
  const double pitch = cell_at(middle.p.z());
  // Cells on a line have no slope across it.
  const double least = 1e-6 * of * pitch * pitch;
  const double cxx = xx - sx * mx + least, cxy = xy - sx * my, cyy = yy - sy * my + least;
  const double cxz = xz - sx * mz, cyz = yz - sy * mz;
  const double determinant = cxx * cyy - cxy * cxy;
  if (plane.cells < least_cells || !(determinant > 0.0)) return plane;
  plane.slope = Eigen::Vector2d(cyy * cxz - cxy * cyz, cxx * cyz - cxy * cxz) / determinant;
  plane.height -= plane.slope.x() * mx + plane.slope.y() * my;
  const double left = zz - sz * mz - plane.slope.x() * cxz - plane.slope.y() * cyz;
  // Of cells of the mean noise: weights take a noisier one's as so much less.
  plane.scatter = std::sqrt(std::max(left, 0.0) / static_cast<double>(plane.cells));
  return plane;
}

SeenSurface::Plane SeenSurface::plane_about(const Middle& middle, int cells, int step,
                                            const Narrower* narrower) const noexcept {
  return image_->has_noise() ? plane_through<true>(middle, cells, step, narrower)
                             : plane_through<false>(middle, cells, step, narrower);
}

}  // namespace palpate
