// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/sight/tracker.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/kernel/sight/monitor.hpp"

namespace palpate {
namespace {

// Lengths are in multiples of `detail`.
// Along a line of sight a surface is looked for this far from where it is expected [detail].
constexpr double reach_in_details = 60.0;
double reach(const SurfaceEstimate& surface) { return reach_in_details * surface.detail(); }
// Occluders are looked for this far in front of the surface [detail]: an arm may be held high.
constexpr double occluder_reach = 240.0;
constexpr double most_support = 0.7;     // beyond this share nothing else is checked
constexpr double gate_after_hold = 1.0;  // [detail]
// Layers along a line of sight are separated by a gap of at least this [detail], and by what a
// surface that leans by 70 degrees falls from point to point: tan 70 degrees by a third of the
// resolution.
constexpr double narrowest_layer_gap = 4.0;
constexpr double steepest = 0.92;  // [-]
double layer_gap(const SurfaceEstimate& surface) {
  return std::max(narrowest_layer_gap * surface.detail(), steepest * surface.resolution());
}
constexpr std::size_t beam_points = 256;
// Radius within which an occluder is looked for: that of the cells of FitTest [detail].
constexpr double shadow_radius = 3.0;
// A fit is used for contacts within this of its centre [detail].
constexpr double serves = 0.3;
// While the surface is hidden it cannot be fitted anew: the last fit is used this far from its
// centre [detail].
constexpr double serves_while_held = 3.0;
// Radii of the rings of the map of heights beside the contact [detail].
constexpr double beside_inner = 2.4;
constexpr std::array<double, 5> beside_bands = {8.0, 16.0, 28.0, 44.0, 64.0};
// [detail] Beside the contact, heights that differ by less are of one surface, whatever the noise.
constexpr double one_surface = 3.0;
constexpr std::size_t beside_points = 640;
// From so many frames on, a jump is compared with `hardest_strike`.
constexpr std::size_t well_known = 4;
constexpr float nothing = -1e3F;
// [-] cosine: a camera sees a surface that faces it within 70 degrees.
constexpr double faces_at = 0.35;

// The viewpoint of the view that contributed most of the patch's points; none if it has none.
std::optional<Vec3> main_viewpoint(const Patch& patch) {
  std::size_t most = 0;
  std::optional<Vec3> viewpoint;
  for (std::size_t i = 0; i < patch.view_count(); ++i) {
    const std::size_t points = patch.view_end(i) - patch.view(i).begin;
    if (points <= most) continue;
    most = points;
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

// What is above a surface and above the plane that touches it at `foot` [m, local] may hide it. A
// fit alone says little of what is far off: a small body's falls far below what it stands on.
class Cover {
 public:
  Cover(const Quadric& surface, const Vec2& foot) noexcept : surface_(surface), plane_(Quadric{}) {
    const Vec2 g = surface.gradient(foot);
    plane_.c.head<3>() = Vec3(surface.height(foot) - g.dot(foot), g.x(), g.y()).cast<float>();
  }
  [[nodiscard]] float above(float x, float y, float z) const noexcept {
    return z - std::max(surface_.height(x, y), plane_.height(x, y));
  }

 private:
  FloatQuadric surface_, plane_;
};

}  // namespace

std::optional<Layer> first_layer(std::span<float> heights, double gap,
                                 double least_share) noexcept {
  if (heights.size() < SurfaceEstimate::least_points) return std::nullopt;
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

void SightTracker::set(const SightParameters& parameters) noexcept {
  least_share_ = parameters.least_share;
  surface_.set(parameters);
}

SurfaceContact SightTracker::contact(const Vec3& point, double t) const noexcept {
  return surface_.contact(point, t, (holding() ? serves_while_held : serves) * surface_.detail());
}

// The surface was not measured: it is kept as it was at `since` [s].
SightTracker::Event SightTracker::hold(double since) noexcept {
  if (!holding()) held_since_ = since;
  note(Evidence::hidden);
  surface_.stop();
  return Event::hidden;
}

SightTracker::Event SightTracker::lose() noexcept {
  note(Evidence::lost);
  return Event::none;
}

SightTracker::Ring SightTracker::nothing_beside() noexcept {
  Ring ring;
  ring.fill(nothing);
  return ring;
}

// The camera that measures most on its lines of sight through a place.
std::size_t SightTracker::best_camera(const ObservedClouds& clouds, const Vec3& place) noexcept {
  std::size_t best = 0;
  std::size_t most = 0;
  for (std::size_t i = 0; i < views_.size(); ++i) {
    const Cloud* cloud = clouds.of(i);
    if (cloud == nullptr) continue;
    if (clouds.parts().size() == 1) return i;
    gather(*cloud, Beam{place, surface_.resolution(), reach(surface_), surface_.frame().up},
           beam_points, patch_);
    if (patch_.size() > most || clouds.of(best) == nullptr) best = i;
    most = std::max(most, patch_.size());
  }
  return best;
}

// Does the newest frame of another camera that faces the surface show it at `place`?
bool SightTracker::others_show(const ObservedClouds& clouds, std::size_t camera, const Vec3& place,
                               const Vec3& normal, double gate) noexcept {
  for (std::size_t i = 0; i < views_.size(); ++i) {
    const double since = views_[camera].stamp - views_[i].stamp;
    if (i == camera || clouds.of(i) == nullptr || !(since <= surface_.longest_gap())) continue;
    const std::optional<Seen> shown = look_at(*clouds.of(i), place, surface_.resolution());
    if (shown && shown->line.dot(normal) > faces_at &&
        std::abs(shown->above * shown->line.dot(normal)) <= gate)
      return true;
  }
  return false;
}

// Where the surface is expected after `elapsed` [s]: below the proxy, moved by its velocity.
SightTracker::Expectation SightTracker::expect(const Vec3& proxy, double elapsed) const noexcept {
  const LocalFrame& axes = surface_.frame();
  const Vec3 hand = axes.local_from_world(proxy);
  const double detail = surface_.detail();
  Expectation expected{
      .rise = surface_.velocity() * std::min(elapsed, surface_.longest_gap()),
      .foot = surface_.surface().nearest(hand, hand.head<2>(), surface_.centre(),
                                         (holding() ? serves_while_held : 2.0 * serves) * detail),
      .surface = surface_.surface(),
      // After a hold the gate is narrow: the surface is where it was, and what remains of an
      // occluder may be close to it.
      .gate = holding() ? surface_.gate(gate_after_hold * detail) : surface_.gate()};
  // An unchanged centre lets frames be compared cell by cell.
  if ((expected.foot - surface_.centre()).norm() < serves * detail)
    expected.foot = surface_.centre();
  expected.surface.c[0] += expected.rise;
  expected.place = axes.world_from_local(
      Vec3(expected.foot.x(), expected.foot.y(), expected.surface.height(expected.foot)));
  return expected;
}

// The points about a place as far as occluders are looked for, in the surface's axes, too.
void SightTracker::gather_wide_beam(const Cloud& cloud, const Vec3& place) noexcept {
  const LocalFrame& axes = surface_.frame();
  const double detail = surface_.detail();
  gather(
      cloud,
      Beam{place, shadow_radius * detail * surface_.coarseness(), occluder_reach * detail, axes.up},
      wide_beam_points, patch_);
  points_.take(patch_, axes);
}

// What a frame measures along its lines of sight through the place where the surface is expected.
void SightTracker::look_along(const Cloud& cloud, std::size_t camera, const Expectation& expected,
                              Sighting& sighting) noexcept {
  const LocalFrame& axes = surface_.frame();
  const Vec3& place = expected.place;
  const double far = occluder_reach * surface_.detail();
  gather_wide_beam(cloud, place);
  const std::optional<Vec3> viewpoint = main_viewpoint(patch_);
  if (viewpoint) surface_.set_distance(camera, (*viewpoint - place).norm());
  sighting.is_camera = viewpoint.has_value();
  sighting.line = viewpoint ? Vec3((*viewpoint - place).normalized()) : axes.up;
  const SightCone inner({place, surface_.resolution(), far, axes.up}, viewpoint);
  const Eigen::Vector3f axis = inner.axis().cast<float>();
  const auto radius = static_cast<float>(inner.radius_at(0.0));
  const auto widening = static_cast<float>((inner.radius_at(far) - inner.radius_at(0.0)) / far);
  const Eigen::Vector3f towards = sighting.line.cast<float>();
  const FloatQuadric surface(expected.surface);
  const Cover cover(expected.surface, expected.foot);
  const std::size_t size = std::min(patch_.size(), wide_beam_points);
  std::array<float, wide_beam_points> above_surface;
  std::array<float, wide_beam_points> covers;
  std::array<float, wide_beam_points> off_axis;  // [m^2] squared distance, less the cone's radius
  std::array<float, wide_beam_points> height;
  for (std::size_t i = 0; i < size; ++i) {
    const float x = patch_.x()[i];
    const float y = patch_.y()[i];
    const float z = patch_.z()[i];
    const float along = x * axis.x() + y * axis.y() + z * axis.z();
    const float r = std::max(radius + widening * along, 0.0F);
    off_axis[i] = x * x + y * y + z * z - along * along - r * r;
    height[i] = x * towards.x() + y * towards.y() + z * towards.z();
    above_surface[i] = points_.z[i] - surface.height(points_.x[i], points_.y[i]);
    covers[i] = cover.above(points_.x[i], points_.y[i], points_.z[i]);
  }
  std::size_t near = 0;
  std::array<float, wide_beam_points + 1> near_above;
  const auto gate = static_cast<float>(expected.gate);
  const auto nearest = static_cast<float>(far);
  const auto farthest = static_cast<float>(-reach(surface_));
  for (std::size_t i = 0; i < size; ++i) {
    const float above = above_surface[i];
    sighting.before += covers[i] > gate ? 1 : 0;
    const bool counts = (off_axis[i] <= 0.0F) & (above <= nearest) & (above >= farthest);
    const bool is_near = counts & (std::abs(above) <= gate);
    near_above[near] = above;
    near += is_near ? 1 : 0;
    sighting.heights[sighting.seen] = height[i];
    sighting.seen += counts ? 1 : 0;
  }
  const auto all = static_cast<double>(sighting.seen);
  const auto share = static_cast<double>(near);
  sighting.near = share / patch_.share();
  sighting.there = near >= SurfaceEstimate::least_points && share >= least_share_ * all;
  // Of a surface that moved beyond the gate, the tail of the noise is still inside.
  if (sighting.there && share < most_support * all) {
    const float middle = kth_smallest(std::span(near_above.data(), near), near / 2);
    sighting.there = std::abs(middle) <= 0.5F * gate;
  }
}

// How much of the disc a camera sees. An occluder that moves in front of a resting contact first
// hides a part of the disc: the border of the rest is not an edge of the surface. Points that
// vanish without an occluder in front of them lie in a stereo camera's shadow beside one. A hand
// that slid there itself has come beside what stood there before: the camera's previous image
// tells that from what came over the place since.
void SightTracker::outline(View& view, const Sighting& sighting, const Expectation& expected,
                           const Vec3& hip, const Cloud* previous) noexcept {
  constexpr double usual = 0.75;           // [-] of the points
  constexpr std::size_t least_before = 3;  // points
  const Vec3& up = surface_.frame().up;
  const Vec3 slid = hip - view.hip;
  const double still = 0.5 * surface_.resolution();
  const bool slides = (slid - slid.dot(up) * up).squaredNorm() > still * still;
  if (slides) view.hip = hip;
  const bool stays = expected.foot == surface_.centre() && !slides;
  if (!stays || sighting.near > view.near_usual) view.near_usual = sighting.near;
  const bool fewer = sighting.near < usual * view.near_usual;  // than where it stays
  const bool covered = sighting.before >= least_before || fewer;
  const auto came = [&] {
    return sighting.before >= least_before && previous != nullptr &&
           2 * covering(*previous, expected) < sighting.before;
  };
  const bool arrived = stays ? holding() || fewer || view.outline != Outline::cut
                             : covered && (view.outline == Outline::shadowed || came());
  view.outline = !covered ? Outline::whole : arrived ? Outline::shadowed : Outline::cut;
}

// How many points of an image lie before the expected surface, of those looked at.
std::size_t SightTracker::covering(const Cloud& cloud, const Expectation& expected) noexcept {
  gather_wide_beam(cloud, expected.place);
  const Cover cover(expected.surface, expected.foot);
  const auto gate = static_cast<float>(expected.gate);
  std::size_t count = 0;
  for (std::size_t i = 0; i < points_.size; ++i)
    count += cover.above(points_.x[i], points_.y[i], points_.z[i]) > gate ? 1 : 0;
  return count;
}

SightTracker::Event SightTracker::frame(const ObservedClouds& clouds, const Cloud* previous,
                                        std::size_t camera, double stamp, double interval,
                                        const Vec3& hip, const Vec3& proxy,
                                        double hardest_strike) noexcept {
  const Cloud& cloud = *clouds.of(camera);
  View& view = views_[camera];
  view.stamp = stamp;
  view.interval = interval;
  if (!tracking()) {
    surface_.start_frame(camera, stamp, interval);
    watch(clouds, proxy);
    return tracking() ? Event::followed : Event::none;
  }
  const bool alone = clouds.parts().size() == 1;
  const double elapsed = alone ? interval : stamp - surface_.stamp();
  // What was captured before the newest evidence says nothing about now.
  if (!alone && elapsed < 0.0 && elapsed >= -surface_.longest_gap()) return Event::none;
  const Expectation expected = expect(proxy, elapsed);
  Sighting sighting;
  look_along(cloud, camera, expected, sighting);
  const LocalFrame& axes = surface_.frame();
  if (!alone) {
    const Vec3 normal = axes.direction_in_world(expected.surface.normal(expected.foot));
    const bool is_faced = sighting.is_camera && sighting.line.dot(normal) > faces_at;
    if (!(sighting.there && is_faced) &&
        others_show(clouds, camera, expected.place, normal, expected.gate))
      return Event::none;
  }
  const double previous_stamp = surface_.stamp();
  surface_.start_frame(camera, stamp, interval);
  const double towards = sighting.line.dot(axes.up);
  double jump = 0.0;  // [m] along up, from where it was expected
  if (!sighting.there) {
    const std::optional<Layer> layer =
        first_layer(std::span(sighting.heights.data(), sighting.seen),
                    std::max(layer_gap(surface_), surface_.spread()), least_share_);
    // A surface touched from behind has left the gate: the proxy goes on over the points.
    if (towards < 0.0 && layer) return lose();
    if (!layer) return hold(previous_stamp);
    jump = layer->height / std::max(towards, 0.2);
    if (jump > 0.0 && (holding() || is_occluder(view.beside, look_beside(cloud, expected.place),
                                                jump + expected.rise, jump, hardest_strike)))
      return hold(previous_stamp);
  }
  surface_.shift(expected.rise + jump);
  if (holding() && !sighting.there) surface_.forget_frames();
  outline(view, sighting, expected, hip, previous);
  if (!surface_.add(cloud, expected.foot, {expected.gate, !sighting.there, is_shadowed(camera)})) {
    surface_.shift(-expected.rise - jump);
    // What is seen behind it is not hidden by anything: the surface ends here, as over a hole.
    return jump < 0.0 ? lose() : hold(previous_stamp);
  }
  note(Evidence::seen);
  view.beside = look_beside(cloud, surface_.place());
  return sighting.there ? Event::followed : Event::jumped;
}

void SightTracker::watch(const ObservedClouds& clouds, const Vec3& proxy) noexcept {
  if (tracking()) {
    if (holding()) return;
    const Vec2 below = surface_.frame().local_from_world(proxy).head<2>();
    if ((below - surface_.centre()).norm() < surface_.detail()) return;
  }
  note(Evidence::lost);
  const std::size_t camera = best_camera(clouds, proxy);
  const Cloud& cloud = *clouds.of(camera);
  surface_.set_spacing(cloud.spacing(proxy));
  gather(cloud, Beam{proxy, surface_.resolution(), reach(surface_), surface_.frame().up},
         beam_points, patch_);
  const std::optional<Vec3> viewpoint = main_viewpoint(patch_);
  if (!viewpoint) return;  // no line of sight to follow
  const Vec3 line = (*viewpoint - proxy).normalized();
  surface_.set_distance(camera, (*viewpoint - proxy).norm());
  std::array<float, beam_points> heights;
  const std::size_t seen = heights_along(patch_, line, heights);
  const std::optional<Layer> layer =
      first_layer(std::span(heights.data(), seen), layer_gap(surface_), least_share_);
  if (!layer || layer->height > 0.0) return;  // nothing, or the proxy is hidden behind it
  const Vec3 place = proxy + layer->height * line;
  surface_.set_spacing(cloud.spacing(place));
  start(clouds, camera, place, line);
}

// Does the camera that sees most there show a surface at `foot`, from the side of `normal`?
bool SightTracker::is_shown(const ObservedClouds& clouds, const Vec3& foot,
                            const Vec3& normal) noexcept {
  const Cloud& cloud = *clouds.of(best_camera(clouds, foot));
  const std::optional<Seen> seen = look_at(cloud, foot, surface_.resolution());
  return seen && seen->line.dot(normal) > 0.0 &&
         std::abs(seen->above) < SurfaceEstimate::narrowest_gate * surface_.detail();
}

void SightTracker::touch(const ObservedClouds& clouds, const Vec3& foot,
                         const Vec3& normal) noexcept {
  // What hid the surface and is touched from in front, where the newest frame shows it, is followed
  // instead.
  if (holding()) {
    if (!is_shown(clouds, foot, normal)) return;
    note(Evidence::lost);
  }
  if (tracking()) {
    const Vec3 local = surface_.frame().local_from_world(foot);
    const Vec2 at = local.head<2>();
    const double off = local.z() - surface_.surface().height(at);
    const double away = (at - surface_.centre()).norm();
    const double detail = surface_.detail();
    if (faces(normal) && away < SurfaceEstimate::narrowest_gate * detail &&
        std::abs(off) < 0.6 * detail + 4.0 * (surface_.spread() + surface_.height_sd())) {
      if (away < serves * detail) return;
      const std::size_t measured_by = surface_.camera();
      if (surface_.move_to(*clouds.of(measured_by), at,
                           {surface_.gate(), false, is_shadowed(measured_by)}))
        return;
    }
  }
  const std::size_t camera = best_camera(clouds, foot);
  const Cloud& cloud = *clouds.of(camera);
  // Where the camera sees the surface well behind this place, the contact from behind is with a
  // stray point.
  const double gate = SurfaceEstimate::narrowest_gate * surface_.detail();
  const std::optional<Seen> seen = look_at(cloud, foot, surface_.resolution());
  if (seen && seen->line.dot(normal) < 0.0 && seen->above < -gate) return;
  surface_.set_spacing(cloud.spacing(foot));
  gather(cloud, Beam{foot, surface_.resolution(), gate, normal}, beam_points, patch_);
  const std::optional<Vec3> viewpoint = main_viewpoint(patch_);
  Vec3 up = normal;
  if (viewpoint) {
    const Vec3 line = (*viewpoint - foot).normalized();
    surface_.set_distance(camera, (*viewpoint - foot).norm());
    if (std::abs(line.dot(normal)) > 0.5) up = line.dot(normal) > 0.0 ? line : Vec3(-line);
  }
  start(clouds, camera, foot, up);
}

bool SightTracker::slide(const ObservedClouds& clouds, const Vec3& foot) noexcept {
  if (!tracking() || holding()) return false;
  const std::size_t camera = surface_.camera();
  const Cloud& cloud = *clouds.of(camera);
  if (const double spacing = cloud.spacing(foot); surface_.misfits(spacing)) {
    surface_.set_spacing(spacing);
    start(clouds, camera, foot, surface_.frame().up);
    return tracking();
  }
  const LocalFrame& axes = surface_.frame();
  const Vec2 at = axes.local_from_world(foot).head<2>();
  // A camera that goes round a body with the hand sees it upright where its first view's heights
  // lean too much for a quadric. One that stays does not: lines of sight through a body are alike.
  constexpr double leaning = 0.7;  // [-] cosine of 45 degrees
  constexpr double upright = 0.8;  // [-] of 37
  if (const Vec3 normal = axes.direction_in_world(surface_.surface().normal(at));
      normal.dot(axes.up) < leaning) {
    const std::optional<Seen> seen = look_at(cloud, foot, surface_.resolution());
    if (seen && seen->line.dot(normal) > upright) {
      start(clouds, camera, foot, seen->line);
      return tracking();
    }
  }
  return surface_.move_to(cloud, at, {surface_.gate(), false, is_shadowed(camera)});
}

// Begins to follow the surface at `foot`, in a camera's newest frame.
void SightTracker::start(const ObservedClouds& clouds, std::size_t camera, const Vec3& foot,
                         const Vec3& up) noexcept {
  const Cloud& cloud = *clouds.of(camera);
  for (View& view : views_) {
    view.outline = Outline::whole;
    if (&view != &views_[camera]) view.beside = nothing_beside();
  }
  if (clouds.parts().size() > 1)
    surface_.start_frame(camera, views_[camera].stamp, views_[camera].interval);
  note(surface_.start(cloud, foot, up) ? Evidence::seen : Evidence::lost);
  if (tracking()) views_[camera].beside = look_beside(cloud, surface_.place());
}

std::optional<SightTracker::Seen> SightTracker::look_at(const Cloud& cloud, const Vec3& place,
                                                        double radius) noexcept {
  gather(cloud, Beam{place, radius, reach(surface_), surface_.frame().up}, beam_points, patch_);
  const std::optional<Vec3> viewpoint = main_viewpoint(patch_);
  if (!viewpoint) return std::nullopt;
  const Vec3 line = (*viewpoint - place).normalized();
  std::array<float, beam_points> heights;
  const std::size_t seen = heights_along(patch_, line, heights);
  if (seen < SurfaceEstimate::least_points) return std::nullopt;
  return Seen{kth_smallest(std::span(heights.data(), seen), seen / 2), line};
}

std::optional<Vec3> SightTracker::in_front(const ObservedClouds& clouds, const Vec3& before,
                                           const Vec3& after, double radius) noexcept {
  if (!tracking() || holding()) return std::nullopt;
  const auto from_fit = [this](const Vec3& place) {
    return surface_.contact(place, surface_.stamp(), surface_.resolution());
  };
  const SurfaceContact there = from_fit(after);
  const bool crossed = !there.at_limit && there.distance < 0.0 && from_fit(before).distance >= 0.0;
  // A proxy that goes round an edge has the surface beside or behind it all the way, or comes from
  // farther away.
  const double farthest = 4.0 * radius;
  const double way = (after - before).norm();
  const bool may_have_passed =
      way >= 0.5 * radius && way <= farthest && views_[surface_.camera()].outline == Outline::whole;
  if (!crossed && !may_have_passed) return std::nullopt;
  const Cloud& cloud = *clouds.of(best_camera(clouds, after));
  std::optional<Seen> now = look_at(cloud, after, radius);
  // Where nothing is measured, as in a hole of a screen's image, what is around it counts.
  const bool is_hole = !now && crossed && surface_.coarseness() == 1.0;
  if (is_hole) now = look_at(cloud, after, hole_widening * radius);
  if (!now || now->above < 0.0 || now->above > farthest) return std::nullopt;
  if (is_hole) return there.foot + radius * there.normal;
  if (!crossed) {
    const std::optional<Seen> then = look_at(cloud, before, radius);
    if (!then || then->above > 0.0 || then->above < -farthest) return std::nullopt;
  }
  return after + (now->above + radius) * now->line;
}

// For each sector and ring beside the contact, the height of the point nearest to the camera.
SightTracker::Ring SightTracker::look_beside(const Cloud& cloud, const Vec3& place) noexcept {
  Ring ring = nothing_beside();
  const LocalFrame& axes = surface_.frame();
  const double detail = surface_.detail();
  gather(cloud, Beam{place, beside_bands.back() * detail, reach(surface_), axes.up}, beside_points,
         patch_);
  points_.take(patch_, axes);
  const Eigen::Vector3f at = axes.local_from_world(place).cast<float>();
  // Beside the contact the surface is continued as its tangent plane.
  Quadric plane;
  plane.c.segment<2>(1) = surface_.surface().gradient(surface_.centre());
  plane.c[0] = surface_.surface().height(surface_.centre()) - plane.height(surface_.centre());
  const FloatQuadric tangent(plane);
  const auto squared_band = [detail](double r) {
    return static_cast<float>((r * detail) * (r * detail));
  };
  for (std::size_t i = 0; i < points_.size; ++i) {
    const float dx = points_.x[i] - at.x();
    const float dy = points_.y[i] - at.y();
    const float away = dx * dx + dy * dy;
    if (!(away >= squared_band(beside_inner) && away < squared_band(beside_bands.back()))) continue;
    std::size_t band = 0;
    for (const double end : beside_bands) band += away >= squared_band(end) ? 1 : 0;
    const std::size_t sector =
        (dx > 0.0F ? 4 : 0) + (dy > 0.0F ? 2 : 0) + (std::abs(dx) > std::abs(dy) ? 1 : 0);
    float& cell = ring[band * sectors + sector];
    cell = std::max(cell, points_.z[i] - tangent.height(points_.x[i], points_.y[i]));
  }
  return ring;
}

// Is the nearer layer an occluder, or the surface itself? It is an occluder if it was visible
// beside the contact in the frame before, if the surface is still visible there, or if the surface
// would need a larger acceleration than `hardest_strike`.
// @param height  [m] of what is seen now, above where the surface was
// @param jump    [m] above where it was expected
bool SightTracker::is_occluder(const Ring& ring_before, const Ring& now, double height, double jump,
                               double hardest_strike) const noexcept {
  const double interval = surface_.interval();
  const double times = surface_.jumped() ? 4.0 : surface_.velocity() != 0.0 ? 2.0 : 1.0;
  const double noise = std::max(surface_.spread(), surface_.height_sd());
  // A surface that is not touched may come from anywhere.
  constexpr double infinite = std::numeric_limits<double>::infinity();
  const double struck =
      surface_.settled() >= well_known ? 0.5 * hardest_strike * (interval * interval) : infinite;
  const double most = std::isfinite(hardest_strike)
                          ? times * std::min(struck, farthest_strike * surface_.detail())
                          : infinite;
  const double detail = surface_.detail();
  const double tolerance = std::max(one_surface * detail, 4.0 * noise);
  if (jump > most + one_surface * detail + 4.0 * noise) return true;
  // A cell keeps its nearest point, which is the extreme of the noise.
  const double nearer = std::max(one_surface * detail, 6.0 * noise);
  std::size_t same_before = 0;
  std::size_t unchanged = 0;
  for (std::size_t i = 0; i < now.size(); ++i) {
    const double before = ring_before[i];
    if (before > nearer &&
        std::abs(before - height) < std::min(2.0 * one_surface * detail, 0.6 * height))
      return true;
    if (std::abs(before) < tolerance) {
      ++same_before;
      if (std::abs(now[i] - before) < std::min(tolerance, 0.3 * height)) ++unchanged;
    }
  }
  return unchanged >= 3 && 4 * unchanged >= same_before;
}

}  // namespace palpate
