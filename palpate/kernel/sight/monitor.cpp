// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/sight/monitor.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "palpate/kernel/sight/surface_fit.hpp"

namespace palpate {
namespace {

// A camera that measures fewer points than this in a footprint says nothing about it: with fewer a
// median is no better than a single pixel.
constexpr std::size_t least_points = 8;
// [detail] Behind a place what lies along a line of sight is looked for this far: as far as the
// tracker looks for a surface. Before it, as far as that looks for what hides one: a place that
// something far in front hides is not free.
constexpr double look_reach = 60.0;
constexpr double hides_reach = 240.0;
// [-] Share of the points that may lie before a hand in free space: flying pixels and other strays.
// More would let go of a hand at an edge that only grazes its lines of sight.
constexpr double strays = 0.05;
// [-] r_c: radius of the hand's footprint. A sphere of r_c that touches the outline of a body has a
// fifth of such a footprint within the outline: four times the strays.
constexpr double hand_radius = 2.0;
// [-] pixels: radius of the narrowest footprint. It holds some ten.
constexpr double narrowest = 1.8;
constexpr double least_margin = 0.2;  // [detail] rounding of depth, in common cameras
// [-] footprint's radius: a look without an edge has 80 % of its points within this along the line
// of sight, and the margin for noise. A plane at 70 degrees from facing the camera spans 4.4.
constexpr double one_layer = 4.0;
// [-] r_c: a nearer layer that begins beyond such a step, after the proxy has moved sideways by
// `sideways`, is another body, behind which the proxy went round an edge. What a surface that leans
// by 70 degrees rises on the way, `steepest_rise` times that, is no step.
constexpr double edge_step = 2.0;
constexpr double steepest_rise = 2.75;  // [-] tan 70 degrees
constexpr double sideways = 0.4;        // [detail]
// [-] Noise that moves a footprint also spreads its points: the margin for it is at most this, in
// multiples of what 80 % of them span: four standard deviations.
constexpr double most_spans = 1.5;
// [-] Cosine: a force that points away from the camera, within 73 degrees of its line of sight.
constexpr double away = -0.3;
// [detail] A look serves as long as its place moves less than this.
constexpr double look_serves = 0.2;
// [-] standard deviations: a slope that rises by less says nothing.
constexpr double least_rise = 3.0;

// [m] By how much more a slope rises towards the camera at a view's points, where these lie beside
// the place, than at the place.
// @param begin, end  of the view's points in the patch
double rise_beside(const Patch& patch, std::size_t begin, std::size_t end,
                   const Eigen::Vector3f& towards, float farthest) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  std::size_t size = 0;
  const auto each = [&](const auto& use) {
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Vector3f p(patch.x()[i], patch.y()[i], patch.z()[i]);
      if (p.dot(towards) >= -farthest && p.allFinite()) use(p.cast<double>());
    }
  };
  each([&](const Vec3& p) {
    mean += p;
    ++size;
  });
  if (size == 0) return 0.0;
  mean /= static_cast<double>(size);
  const Vec3 line = towards.cast<double>();
  const double height = mean.dot(line);
  const Vec3 beside = mean - height * line;
  const double aside = beside.norm();
  if (!(aside > 0.0)) return 0.0;
  double squares = 0.0;
  double products = 0.0;
  double heights = 0.0;
  each([&](const Vec3& p) {
    const double along = p.dot(beside) / aside - aside;
    const double above = p.dot(line) - height;
    squares += along * along;
    products += along * above;
    heights += above * above;
  });
  if (!(squares > 0.0)) return 0.0;
  const double rise = aside * products / squares;
  const double residual = std::max(heights - products * products / squares, 0.0);
  const double variance = residual / static_cast<double>(size) *
                          (1.0 / static_cast<double>(size) + aside * aside / squares);
  return rise * rise > least_rise * least_rise * variance ? rise : 0.0;
}

}  // namespace

void Monitor::set(const Parameters& parameters) noexcept {
  parameters_ = parameters.sight;
  r_c_ = parameters.proxy.r_c();
}

// [m] No estimate of the noise counts beyond what is usual, so that a wrong one cannot blind the
// monitor.
double Monitor::most_margin(double distance) const noexcept {
  return parameters_.confidence * parameters_.usual_noise_at(distance);
}

void Monitor::forget() noexcept {
  hand_ = proxy_ = last_front_ = {};
  side_ = Side::unknown;
  frame_judged_ = false;
  frames_behind_ = frames_past_edge_ = 0;
  proved_ = behind_in_frame_ = false;
}

// What each camera measures on its lines of sight within `radius` of `place`. A camera that sees
// the place free, or in front of a surface, is right whatever others see.
void Monitor::look(const Cloud& cloud, const Vec3& place, double radius, bool widened,
                   Look& result) noexcept {
  result = {};
  result.fresh = true;
  result.place = place;
  result.radius = radius;
  result.widened = widened;
  gather(cloud, Beam{place, radius, hides_reach * parameters_.detail, Vec3::UnitZ()}, look_points,
         patch_);
  std::array<float, look_points> heights;
  const auto farthest = static_cast<float>(look_reach * parameters_.detail);
  for (std::size_t v = 0; v < patch_.view_count(); ++v) {
    const Patch::View& view = patch_.view(v);
    const std::size_t end = patch_.view_end(v);
    if (!view.viewpoint) continue;
    const Vec3 line = (*view.viewpoint - place).normalized();
    const Eigen::Vector3f towards = line.cast<float>();
    std::size_t size = 0;
    for (std::size_t i = view.begin; i < end && size < look_points; ++i) {
      const float height =
          patch_.x()[i] * towards.x() + patch_.y()[i] * towards.y() + patch_.z()[i] * towards.z();
      if (height >= -farthest && std::isfinite(height)) heights[size++] = height;
    }
    if (size < least_points) continue;
    const std::span<const float> all(heights.data(), size);
    const auto strayed = static_cast<std::size_t>(strays * static_cast<double>(size));
    const double clear = -kth_smallest(all, size - 1 - strayed);
    // A widened footprint may hold points on one side alone: of a slope these are nearer or
    // farther.
    const double rise = widened ? rise_beside(patch_, view.begin, end, towards, farthest) : 0.0;
    const double behind = kth_smallest(all, size / 2) - rise;
    if (!result.seen || behind < result.behind) {
      result.behind = behind;
      result.line = line;
      result.distance = (*view.viewpoint - place).norm();
      result.low = kth_smallest(all, size / 10) - rise;
      result.high = kth_smallest(all, size - 1 - size / 10) - rise;
    }
    result.clear = result.seen ? std::max(result.clear, clear) : clear;
    result.seen = true;
  }
}

// The look at `place`, taken anew only if the last one does not serve any more.
const Monitor::Look& Monitor::look_at(const Cloud& cloud, const Vec3& place, double radius,
                                      Look& last) noexcept {
  if (last.fresh && (place - last.place).norm() < look_serves * parameters_.detail) return last;
  radius = std::max(radius, narrowest * cloud.spacing(place));
  for (int i = 0; i < 3; ++i, radius *= hole_widening) {
    look(cloud, place, radius, i > 0, last);
    if (last.seen) break;
  }
  return last;
}

// Does the newest frame show the surface where the proxy was last in front of it?
bool Monitor::still_shown(const Cloud& cloud, double margin) noexcept {
  Look there;
  look(cloud, last_front_.place, last_front_.radius, last_front_.widened, there);
  return there.seen && std::abs(there.behind - last_front_.behind) <= margin;
}

// Keeps account of the side of what the camera sees on which the proxy is. Does the look show a
// proxy that belongs in front behind?
bool Monitor::is_behind(const Cloud& cloud, double margin, double deepest) noexcept {
  if (!proxy_.seen) return false;
  const bool in_front = proxy_.behind < -margin - r_c_;
  if (side_ == Side::unknown) side_ = proxy_.behind < 0.0 ? Side::front : Side::behind;
  if (side_ == Side::behind && in_front) side_ = Side::front;
  if (side_ != Side::front) return false;
  const auto count_past_edge = [this](bool past) {
    if (!frame_judged_) frames_past_edge_ = past ? frames_past_edge_ + 1 : 0;
  };
  if (proxy_.behind <= (proved_ ? 0.0 : margin)) {
    if (proxy_.behind <= 0.0) last_front_ = proxy_;
    count_past_edge(false);
    return false;
  }
  // At an edge the median is of one body or the other.
  if (proxy_.high - proxy_.low > one_layer * proxy_.radius + margin) return false;
  if (last_front_.seen) {
    const Vec3 way = proxy_.place - last_front_.place;
    const Vec3& line = proxy_.line;
    const double nearer = way.dot(line) + proxy_.behind - last_front_.behind;
    const double aside = (way - way.dot(line) * line).norm();
    // Noise of the two looks must not end the watch over the front, however small it is estimated.
    const double noise = most_margin(proxy_.distance);
    // What came before the surface, while the proxy moved, is no edge that it passed.
    const bool past_edge =
        nearer > edge_step * r_c_ + noise + steepest_rise * aside &&
        aside > sideways * parameters_.detail &&
        (frame_judged_ ? frames_past_edge_ > 0 : still_shown(cloud, margin + noise));
    count_past_edge(past_edge);
    if (past_edge) {
      if (frames_past_edge_ >= parameters_.evidence_frames) side_ = Side::behind;
      return false;
    }
    if (nearer > farthest_strike * parameters_.detail + margin) return false;
  }
  return proxy_.behind <= deepest + margin;
}

Monitor::Verdict Monitor::judge(const Cloud& cloud, const Contact& contact) noexcept {
  Verdict verdict;
  const double r_c = r_c_;
  const auto margin_of = [&](const Look& look) {
    const double most = std::min(most_margin(look.distance), most_spans * (look.high - look.low));
    return std::max(least_margin * parameters_.detail,
                    std::min(parameters_.confidence * contact.noise, most));
  };
  // The frame shows the surface where it was when the frame was captured.
  const Look& proxy = look_at(cloud, contact.proxy - contact.carried, r_c, proxy_);
  const double margin = margin_of(proxy);
  verdict.behind = is_behind(cloud, margin, contact.deepest);
  verdict.hidden = proxy.seen && proxy.low > edge_step * r_c + margin;
  if (!frame_judged_) {
    frame_judged_ = true;
    frames_behind_ = verdict.behind ? frames_behind_ + 1 : 0;
    proved_ = std::exchange(behind_in_frame_, false) && proved_;
  } else if (!verdict.behind) {
    frames_behind_ = 0;
  }
  behind_in_frame_ = behind_in_frame_ || verdict.behind;

  if (contact.touching) {
    const Look& hand = look_at(cloud, contact.hip - contact.carried, hand_radius * r_c, hand_);
    const bool free = hand.seen && hand.clear > r_c + margin_of(hand);
    proved_ = proved_ && hand.seen && hand.behind > 0.0;
    if (side_ == Side::behind) {
      if (free && (contact.hip - contact.proxy).norm() > contact.deepest + margin)
        verdict.action = Action::let_go;
    } else {
      const bool pulls = proxy.seen && std::abs(proxy.behind) < 2.0 * r_c + margin &&
                         contact.normal.dot(proxy.line) < away;
      // A hand that belongs in front and is held from behind was inside when the surface came back.
      const bool inside = side_ == Side::front && proxy.behind > 0.0 && hand.behind > 0.0;
      if (free || pulls)
        verdict.action = !free && inside ? Action::return_to_front : Action::release;
    }
    if (verdict.action == Action::release || verdict.action == Action::let_go) return verdict;
  }
  if (verdict.behind && (proved_ || frames_behind_ >= parameters_.evidence_frames)) {
    verdict.action = Action::return_to_front;
    // The median of a wider or steeper look may be far from the surface at the proxy.
    verdict.again = std::exchange(proved_, proxy.radius <= hole_widening * r_c &&
                                               proxy.high - proxy.low <= proxy.radius + margin);
  }
  if (verdict.action == Action::return_to_front) {
    verdict.normal = proxy.line;
    verdict.front = contact.proxy + (proxy.behind + r_c) * proxy.line;
    frames_behind_ = 0;
    proxy_.fresh = false;
  }
  return verdict;
}

}  // namespace palpate
