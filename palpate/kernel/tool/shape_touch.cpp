// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/tool/shape_touch.hpp"

#include <algorithm>
#include <bitset>
#include <cmath>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/lanes.hpp"
#include "palpate/kernel/core/mathematics.hpp"
#include "palpate/kernel/sight/render.hpp"

namespace palpate {
namespace {

// [m] that a tool's points move in a step at most, so that a surface is straight over it; and at
// least, where they would cross an edge.
constexpr double longest_step = 3e-3;
constexpr double shortest_step = 1e-4;
// [m] Contacts are looked for so far before a surface: more than a step.
constexpr double margin = 4e-3;
// [m] A point deeper than that behind a surface, and never seen in front of it, is behind another
// body, not in this one.
constexpr double deepest = SeenSurface::deepest;
constexpr double aside = 1e-3;  // [m] that a body which slides pushes a tool in a tick at most
constexpr std::size_t slid_over_of_patch = 4;  // points, the coarsest, that are looked at
// [points/tick] over which a tick's steps are taken: 100 us at 10 ns.
constexpr std::size_t scanned = 10'000;
// Points of each patch that tell whether a hand is in free space.
constexpr std::size_t coarse = patch_block;
constexpr std::size_t all = std::numeric_limits<std::size_t>::max();
constexpr std::size_t most_moves = 4;  // of a tick
constexpr double at_rest = 2e-6;       // [m] a shorter step is none
constexpr double same_plane = 0.5e-3;  // [m] of a point in a tick before a plane is fitted anew
constexpr double lost = 0.3;           // [m] between hand and proxy: no contact is so far away
constexpr int friction_rounds = 4;     // of a step, until all contacts that push have friction
constexpr int friction_contacts = 4;   // get it beside these: four hold a tool
constexpr double least_slide = 1e-9;   // [m] less is none
constexpr double still_touching = 0.05e-3;  // [m] before a surface
constexpr double sliding_time = 10e-3;      // [s] over which the proxy's own velocity is smoothed
constexpr double spin_time = 2e-3;          // [s] over which a spin is smoothed, as HandVelocity is
constexpr double longest_gap = 20e-3;       // [s] over more, differences are no velocity
constexpr double free_gap = 0.5e-3;         // [m] beside the noise, that a free tool is in front

constexpr float infinite = std::numeric_limits<float>::infinity();
constexpr float nowhere = std::numeric_limits<float>::quiet_NaN();

struct Known {
  float least;        // [m] of all gaps that are known
  std::size_t count;  // of them
};
PALPATE_VECTORISED
Known summarise(const float* gap, std::size_t size) {
  FloatLanes least;
  std::array<std::uint32_t, sum_lanes> count{};
  least.fill(infinite);
  for (std::size_t block = 0; block < whole_blocks(size); block += sum_lanes) {
    for (std::size_t lane = 0; lane < sum_lanes; ++lane) {
      const float here = gap[block + lane];
      const bool is_known = here > -infinite;
      const float known = is_known ? here : infinite;
      least[lane] = known < least[lane] ? known : least[lane];
      count[lane] += is_known ? 1U : 0U;
    }
  }
  return {least_of_lanes(least), sum_of_lanes(count)};
}

void push_nothing(Tick& tick) {
  tick.force = tick.torque = tick.normal = tick.vibration = Vec3::Zero();
  tick.contacts = {};
  tick.contact_count = 0;
}

}  // namespace

ShapeTouch::ShapeTouch(std::shared_ptr<const ToolShape> shape, const Parameters& parameters)
    : shape_(std::move(shape)), stride_(longest_step) {
  validate(parameters);
  set_parameters(parameters);
  moves_ = std::clamp<std::size_t>(scanned / shape_->points().size(), 1, most_moves);
  std::size_t longest = 0;
  for (std::size_t patch = 0; patch < most_contacts; ++patch) {
    shell_.begin[patch] = shell_.x.size();
    for (std::uint32_t i = 0; i < shape_->points().size(); ++i)
      if (const ToolShape::Point& point = shape_->points()[i]; point.patch == patch)
        add_point(point.at.cast<float>(), i);
    shell_.size[patch] = shell_.x.size() - shell_.begin[patch];
    while (shell_.x.size() % patch_block != 0) add_point(Eigen::Vector3f::Constant(nowhere), 0);
    longest = std::max(longest, shell_.x.size() - shell_.begin[patch]);
  }
  shell_.begin.back() = shell_.x.size();
  gap_.resize(longest);
  behind_.is.resize(shell_.x.size());
  behind_now_ = behind_;
}

void ShapeTouch::add_point(const Eigen::Vector3f& at, std::uint32_t point) {
  shell_.x.push_back(at.x());
  shell_.y.push_back(at.y());
  shell_.z.push_back(at.z());
  shell_.point.push_back(point);
}

void ShapeTouch::check(const Cloud& cloud) const {
  for (const Cloud* part : cloud.parts()) check(*part);
  if (cloud.parts().empty() && cloud.image() == nullptr)
    throw Error("tool '" + shape_->text() + "'",
                "points without an image cannot be touched with it",
                "use a depth camera or a depth recording, or the tool ball");
}

Eigen::Isometry3d ShapeTouch::isometry(const Pose& pose) const noexcept {
  Eigen::Isometry3d isometry = Eigen::Isometry3d::Identity();
  isometry.linear() = pose.turn.toRotationMatrix();
  isometry.translation() = pose.at;
  return isometry;
}

void ShapeTouch::seat(const Vec3& proxy) noexcept {
  if (!is_place(proxy)) return;
  release({proxy, pose_.turn});
  hand_velocity_.reset();
}

// Nothing is felt until the tool is free.
void ShapeTouch::release(const Pose& hand) noexcept {
  placed_ = true;
  pose_ = kept_ = hand;
  loose_ = true;
  touching_ = false;
  stride_ = longest_step;
  held_ = {};
  contact_count_ = 0;
  sliding_side_.forget();
}

void ShapeTouch::observe(const Observation& seen) noexcept {
  if (seen.camera >= Patch::max_views) return;
  feel_.take(seen);
  frame_.take(seen, 1.0 / parameters_.motion.frame_rate);
  timing_.frame(frame_.stamp(),
                frame_.in_order() && frame_.count() > 1 ? frame_.camera_interval() : 0.0);
  fresh_ = true;
  if (seen.camera >= most_cameras) return;
  SeenSurface& surface = seen_[seen.camera];
  const DepthImage* image = seen.cloud.image();
  if (image == nullptr) {
    surface.forget();
    return;
  }
  const double interval =
      frame_.in_order() ? frame_.camera_interval() : 1.0 / parameters_.motion.frame_rate;
  surface.observe(*image, {pose_.at, shape_->reach() + deepest}, frame_.camera_stamp(), interval,
                  parameters_.sight);
}

// Looks where the tool's points are at a pose, at most so many of each patch: (4), one transform,
// projection and look-up a point.
void ShapeTouch::scan(const Pose& pose, std::size_t most, Scan& scan, Behind* behind) noexcept {
  scan.inside = scan.crossed = scan.known = scan.looked = 0;
  scan.least = infinite;
  scan.gap.fill(infinite);
  const Eigen::Isometry3d world_from_tool = isometry(pose);
  std::array<SeenSurface::View, most_cameras> views{};
  std::array<std::uint8_t, most_cameras> camera{};
  std::size_t cameras = 0;
  float noise = 0.0F, hiding = 0.0F;
  for (std::size_t i = 0; i < most_cameras; ++i) {
    if (!seen_[i].active()) continue;
    views[cameras] = seen_[i].view(world_from_tool);
    camera[cameras++] = static_cast<std::uint8_t>(i);
    noise = std::max(noise, static_cast<float>(seen_[i].noise()));
    hiding = std::max(hiding, seen_[i].hiding(parameters_.sight));
  }
  const auto side_depth = static_cast<float>(parameters_.sight.side_depth);
  const float inside = -static_cast<float>(free_gap) - 2.0F * noise;
  constexpr auto too_deep = static_cast<float>(-deepest);
  const bool has_side = sliding_side_.size(last_t_) > 0;
  constexpr auto near = static_cast<float>(2.0 * margin);
  for (std::size_t patch = 0; patch < most_contacts; ++patch) {
    const std::size_t begin = shell_.begin[patch];
    const std::size_t size = std::min(shell_.begin[patch + 1] - begin, most);
    if (size == 0) continue;
    const PointArrays points{&shell_.x[begin], &shell_.y[begin], &shell_.z[begin], size};
    std::fill_n(gap_.begin(), size, -infinite);
    // The camera that shows most free space is right: others are hidden from it.
    for (std::size_t k = 0; k < cameras; ++k)
      SeenSurface::raise_gaps(views[k], points, gap_.data());
    const Known known = vectorised<summarise>(gap_.data(), size);
    scan.known += known.count;
    scan.least = std::min(scan.least, known.least);
    scan.looked += std::min(size, shell_.size[patch]);
    std::size_t nearest = size;
    if (behind != nullptr && behind->in_patch[patch] != 0) {
      std::fill_n(behind->is.begin() + begin, size, 0);
      behind->in_patch[patch] = 0;
    }
    if (behind_.in_patch[patch] == 0 && known.least >= inside) {  // nearly always
      if (known.least < near)
        nearest = std::find(gap_.begin(), gap_.begin() + size, known.least) - gap_.begin();
    } else {
      float least = near;
      for (std::size_t i = 0; i < size; ++i) {
        const float gap = gap_[i];
        if (gap == -infinite) continue;
        const std::uint8_t was = behind_.is[begin + i];
        const bool was_behind = was != in_front;
        if (gap < inside && gap > -side_depth) ++scan.inside;
        if (gap < too_deep && gap > -side_depth && !was_behind) ++scan.crossed;
        const bool is_slid_over =
            gap > -hiding && (was == slid_over || (slid_ && !was_behind && gap < too_deep));
        // Behind until it has been in front again.
        if (gap < too_deep || (was == Place::behind && gap < 0.0F) ||
            (is_slid_over && has_side && gap < inside)) {
          if (behind == nullptr) continue;
          behind->is[begin + i] = is_slid_over ? slid_over : Place::behind;
          ++behind->in_patch[patch];
        } else if (gap < least) {
          least = gap;
          nearest = i;
        }
      }
    }
    if (nearest == size) continue;
    scan.gap[patch] = gap_[nearest];
    scan.point[patch] = shell_.point[begin + nearest];
    std::size_t of = 0;
    for (; of + 1 < cameras; ++of) {
      const std::size_t block = begin + nearest / patch_block * patch_block;
      FloatLanes gap;
      gap.fill(-infinite);
      SeenSurface::raise_gaps(views[of],
                              {&shell_.x[block], &shell_.y[block], &shell_.z[block], patch_block},
                              gap.data());
      if (gap[nearest % patch_block] == gap_[nearest]) break;
    }
    scan.camera[patch] = camera[of];
  }
}

void ShapeTouch::find_contacts(const Scan& scan) noexcept {
  contact_count_ = 0;
  if (taken_in_) find_sliding_side();
  taken_in_ = slid_ = false;
  const std::size_t sides = sliding_side_.size(last_t_);
  for (std::size_t i = 0; i < most_contacts; ++i) {
    if (!(scan.gap[i] < static_cast<float>(2.0 * margin))) continue;
    const ToolShape::Point& point = shape_->points()[scan.point[i]];
    const Vec3 lever = pose_.turn * point.at;
    const Vec3 place = pose_.at + lever;
    Plane& plane = planes_[i];
    if (plane.tick != ticks_ || plane.point != scan.point[i] ||
        (place - plane.place).squaredNorm() > same_plane * same_plane) {
      plane = {ticks_, scan.point[i], place,
               seen_[scan.camera[i]].fit(place, -(pose_.turn * point.inward),
                                         parameters_.sight.side_depth)};
    }
    std::optional<SeenSurface::Fit> fit = plane.fit;
    if (fit) fit->gap += fit->normal.dot(place - plane.place);
    if (!fit || fit->gap > margin || !(fit->gap > -2.0 * deepest)) continue;
    // A wall that faces the sliding side is another side of the same body.
    if (sides > 0 && fit->wall && fit->normal.dot(sliding_side_.normal()) < 0.0) continue;
    contacts_[contact_count_++] = {lever, *fit, scan.camera[i], i};
  }
  for (std::size_t i = 0; i < sides; ++i) {
    const SlidingSide::Point& point = sliding_side_.point(i);
    const Vec3 lever = pose_.turn * point.at;
    const double gap = sliding_side_.gap(i, pose_.at + lever, last_t_);
    if (gap > margin) continue;
    contacts_[contact_count_++] = {
        lever, {gap, sliding_side_.normal(), 0.0, true}, sliding_side_.camera(), point.patch};
  }
  // A frame shows all at once what slid in; it pushes by little in a step.
  for (std::size_t i = 0; i < contact_count_ && sides > 0; ++i)
    contacts_[i].fit.gap = std::max(contacts_[i].fit.gap, -aside / static_cast<double>(moves_));
}

// Where a frame that is now taken in shows the side of a body that slid over the tool.
void ShapeTouch::find_sliding_side() noexcept {
  std::array<SlidingSide::Point, SlidingSide::most_points> points;
  std::size_t size = 0;
  for (std::size_t patch = 0; patch < most_contacts; ++patch) {
    if (behind_.in_patch[patch] == 0) continue;
    const std::size_t most = std::min(size + slid_over_of_patch, points.size());
    const std::size_t end = shell_.begin[patch] + shell_.size[patch];
    for (std::size_t i = shell_.begin[patch]; i < end && size < most; ++i) {
      if (behind_.is[i] != slid_over) continue;
      const Vec3& at = shape_->points()[shell_.point[i]].at;
      points[size++] = {patch, at, pose_.at + pose_.turn * at};
    }
  }
  std::size_t camera = sliding_side_.camera();
  for (std::size_t i = 0; i < most_cameras; ++i)
    if (seen_[i].active() && seen_[i].slid()) camera = i;
  const SeenSurface& seen = seen_[camera];
  if (!seen.active() || !seen.whole()) return;
  if (size > 0)
    sliding_side_.find(seen, camera, std::span(points.data(), size), support_);
  else if (sliding_side_.size(last_t_) > 0)
    sliding_side_.follow(seen, isometry(pose_));
}

void ShapeTouch::Limits::add(const Contact& of, std::size_t number, const Vec3& direction,
                             double length) noexcept {
  if (size == limit.size()) return;
  contact[size] = number;
  limit[size].direction << direction, of.lever.cross(direction) / length;
  limit[size++].least = -of.fit.gap;
}

void ShapeTouch::set_parameters(const Parameters& parameters) noexcept {
  parameters_ = parameters;
  feel_.set(parameters);
  const Coupling& coupling = parameters.coupling;
  turn_length_ = shape_->turn_length();
  if (coupling.turn_stiffness > 0.0)
    turn_length_ = std::min(
        turn_length_, std::sqrt(coupling.turn_stiffness / std::max(coupling.stiffness, 1e-9)));
}

// [m/s] world: of the hand's tool at a lever.
Vec3 ShapeTouch::hand_velocity_at(const Vec3& lever) const noexcept {
  return movement_.velocity + spin_.cross(lever);
}

// [m] How a tool's motion moves the point of a contact.
Vec3 ShapeTouch::motion_at(const Motion6& motion, const Contact& contact) const noexcept {
  return motion.head<3>() + motion.tail<3>().cross(contact.lever) / turn_length_;
}

// (11): the sides of a contact's cone of friction, two of them along the way that it would slide.
void ShapeTouch::add_friction(std::size_t number, const Motion6& wanted, Limits& limits) noexcept {
  const Contact& contact = contacts_[number];
  const Vec3& normal = contact.fit.normal;
  const auto tangential = [&](const Vec3& v) -> Vec3 { return v - v.dot(normal) * normal; };
  const double length = turn_length_;
  const double speed = std::min(tangential(sliding_ + sliding_spin_.cross(contact.lever)).norm(),
                                tangential(hand_velocity_at(contact.lever)).norm());
  const double coefficient = feel_.friction(contact.patch, pose_.at + contact.lever, normal, speed);
  if (!(coefficient > 0.0)) return;
  Vec3 along = tangential(motion_at(wanted, contact));
  if (!(along.norm() > least_slide))  // any direction will do
    along = tangential(std::abs(normal.x()) < 0.5 ? Vec3::UnitX() : Vec3::UnitY());
  along.normalize();
  const Vec3 across = normal.cross(along);
  for (const Vec3& side : {along, across, Vec3(-along), Vec3(-across)})
    limits.add(contact, number, normal + coefficient * side, length);
}

// One step of the proxy: the motion nearest to the one to the hand that keeps all contacts open.
void ShapeTouch::step(const Pose& hand) noexcept {
  const double length = turn_length_;  // (2)
  Limits limits;
  for (std::size_t i = 0; i < contact_count_; ++i)
    limits.add(contacts_[i], i, contacts_[i].fit.normal, length);
  const Vec3 turn = rotation_vector(between(hand.turn, pose_.turn));
  Motion6 wanted;
  wanted << hand.at - pose_.at, length * turn;
  const double farthest = (hand.at - pose_.at).norm() + shape_->reach() * turn.norm();
  whole_ = std::max(farthest / stride_, 1.0);
  if (farthest > stride_) wanted *= stride_ / farthest;
  Motion6 motion = wanted;
  const auto solve = [&] {
    motion = wanted;
    held_ = least_motion(std::span(limits.limit.data(), limits.size), motion);  // (3)
  };
  solve();
  // Contacts that push get friction, and those that slide most: until all that push have it.
  std::bitset<most_contacts + SlidingSide::most_held> is_rough;
  const auto roughen = [&](std::size_t number) {
    if (is_rough[number]) return;
    is_rough.set(number);
    add_friction(number, wanted, limits);
  };
  for (int round = 0; feel_.feels() && round < friction_rounds; ++round) {
    const std::size_t before = limits.size;
    for (std::size_t i = 0; i < held_.count; ++i) roughen(limits.contact[held_.limit[i]]);
    for (int more = 0; round == 0 && more < friction_contacts; ++more) {
      double most = least_slide;
      std::size_t worst = contact_count_;
      for (std::size_t i = 0; i < contact_count_; ++i) {
        const Contact& contact = contacts_[i];
        const Vec3 way = motion_at(motion, contact);
        const double along = way.dot(contact.fit.normal);
        const double slide = (way - along * contact.fit.normal).norm();
        if (is_rough[i] || contact.fit.gap + along > still_touching || slide <= most) continue;
        most = slide;
        worst = i;
      }
      if (worst == contact_count_) break;
      roughen(worst);
    }
    if (limits.size == before) break;
    solve();
  }
  support_.setZero();
  for (std::size_t i = 0; i < held_.count; ++i) {
    const SeenSurface::Fit& fit = contacts_[limits.contact[held_.limit[i]]].fit;
    if (!fit.wall) support_ += held_.push[i] * fit.normal;
    pushes_[i] = held_.push[i] * limits.limit[held_.limit[i]].direction.head<3>();
    held_.limit[i] = limits.contact[held_.limit[i]];
  }
  // Limits that contradict one another may ask for any motion.
  const double way = motion.head<3>().norm() + shape_->reach() / length * motion.tail<3>().norm();
  if (way > deepest) motion *= deepest / way;
  pose_.at += motion.head<3>();
  pose_.turn = unit(product(rotation_by(motion.tail<3>() / length), pose_.turn));
}

// [m] How far a point of the tool moves at most from the proxy to the hand.
double ShapeTouch::way_to(const Pose& hand) const noexcept {
  return (hand.at - pose_.at).norm() +
         2.0 * shape_->reach() * between(hand.turn, pose_.turn).vec().norm();
}

// May a proxy without contacts go to the hand at once? Not into a surface that it has not reached,
// nor behind one.
bool ShapeTouch::can_follow(const Pose& hand) noexcept {
  if (stride_ < longest_step) return false;
  if (way_to(hand) <= stride_) return true;
  Scan found;
  scan(hand, all, found, nullptr);
  return found.inside == 0 && !(found.least < static_cast<float>(-deepest));
}

// Moves the proxy towards the hand until it rests. True if it touches.
bool ShapeTouch::move(const Pose& hand) noexcept {
  Scan found;
  if (touching_) {
    // A hand in free space pulls its proxy out of whatever it is caught behind.
    scan(hand, coarse, found, nullptr);
    double noise = 0.0;
    for (const SeenSurface& each : seen_)
      if (each.active()) noise = std::max(noise, each.noise());
    if (2 * found.known > found.looked && found.least > free_gap + 4.0 * noise) {
      pose_ = kept_ = hand;
      held_ = {};
      contact_count_ = 0;
      return false;
    }
  }
  for (std::size_t i = 0; i < moves_; ++i) {
    scan(pose_, all, found, &behind_now_);
    ++steps_;
    if (found.crossed > 0 && !fresh_ && !slid_ && stride_ > shortest_step) {
      // The step went through the side of a body: shorter steps meet it.
      pose_ = kept_;
      stride_ = std::max(0.25 * stride_, shortest_step);
      scan(pose_, all, found, &behind_now_);
    } else if (found.crossed == 0) {
      stride_ = std::min(2.0 * stride_, longest_step);
    }
    fresh_ = false;
    kept_ = pose_;
    std::swap(behind_, behind_now_);
    find_contacts(found);
    if (contact_count_ == 0 && can_follow(hand)) {
      pose_ = hand;
      held_ = {};
      return false;
    }
    step(hand);
    if (way_to(kept_) < at_rest) break;
  }
  // On its way to a hand that nothing holds it from any more, it still pulls: no force ends at
  // once.
  return held_.count > 0 || (touching_ && way_to(hand) > at_rest);
}

// Hazard: tool-pushes
// [-] of a force that is left where its contacts are hidden, or frames do not come.
double ShapeTouch::known_share(double t) const noexcept {
  const SightParameters& sight = parameters_.sight;
  double pushes = 0.0, known = 0.0;
  for (std::size_t i = 0; i < held_.count; ++i) {
    const Contact& contact = contacts_[held_.limit[i]];
    pushes += held_.push[i];
    known += held_.push[i] * ease((contact.fit.unseen - sight.hidden_hold) / sight.hidden_fade);
  }
  double share = pushes > 0.0 ? known / pushes : 1.0;
  // As sight has it: a single frame is a scan, not a stream that stopped.
  const double fade = std::max(parameters_.motion.max_extrapolation, 1e-3);
  const double late = std::max(fade, 2.5 * timing_.interval());
  if (frame_.count() > 1) share *= ease((timing_.age(t) - late) / fade);
  return share;
}

// Where the contacts push, and what their materials make of the coupling's force and torque.
// @param surface  [m/s] world: of the first contact's surface, along its camera's line of sight
void ShapeTouch::feel(const Pose& hand, double t, const Vec3& surface, Tick& tick) noexcept {
  std::array<ToolFeel::Pushed, 6> pushed;
  Vec3 normals = Vec3::Zero();
  for (std::size_t i = 0; i < held_.count; ++i) {
    const Contact& contact = contacts_[held_.limit[i]];
    const Vec3 force = parameters_.coupling.stiffness * whole_ * pushes_[i];
    normals += along(force, contact.fit.normal);
    const Vec3 velocity = hand_velocity_at(contact.lever) -
                          along(seen_[contact.camera].velocity(t), contact.fit.normal);
    pushed[i] = {contact.patch, pose_.at + contact.lever, contact.lever, contact.fit.normal, force,
                 velocity};
  }
  const std::span contacts(pushed.data(), held_.count);
  if (feel_.feels() && normals.norm() > 0.0) tick.normal = normals.normalized();
  tick.surface_motion = along(surface, tick.normal);
  movement_.by = hand.at - last_hand_ - movement_.dt * tick.surface_motion;
  feel_.press(contacts, movement_, tick);
  for (const ToolFeel::Pushed& contact : contacts) {
    const Eigen::Vector3f lever = contact.lever.cast<float>();
    std::uint32_t at = 0;  // one for all sides of a contact's cone of friction
    while (at < tick.contact_count && tick.contacts[at].lever != lever) ++at;
    tick.contact_count = std::max(tick.contact_count, at + 1);
    tick.contacts[at] = {lever, tick.contacts[at].force + contact.force.cast<float>()};
  }
}

// The virtual coupling, (1): what pulls the hand to the proxy, in translation and in rotation.
void ShapeTouch::render(const Pose& hand, double t, Tick& tick) noexcept {
  const Coupling& coupling = parameters_.coupling;
  const double length = turn_length_;  // (2)
  const Vec3 u = pose_.at - hand.at;
  const Vec3 turn = rotation_vector(between(pose_.turn, hand.turn));
  const Vec3 surface =
      held_.count > 0 ? seen_[contacts_[held_.limit[0]].camera].velocity(t) : Vec3(Vec3::Zero());
  // Each pushes harder while the hand goes deeper, and never pulls.
  const auto push = [&](const Vec3& way, const Vec3& velocity, double stiffness, double damping) {
    const double size = way.norm();
    if (!(size > 0.0)) return Vec3(Vec3::Zero());
    const double rate = -velocity.dot(way) / size;
    return Vec3(std::max(stiffness * size + damping * rate, 0.0) / size * way);
  };
  tick.force = push(u, hand_velocity_.value() - surface, coupling.stiffness, coupling.damping);
  tick.torque =
      push(turn, spin_, coupling.stiffness * length * length, coupling.damping * length * length);
  if (const double size = tick.force.norm(); size > undirected_force)
    tick.normal = tick.force / size;
  feel(hand, t, surface, tick);
  const double share = known_share(t);
  if (share <= 0.0) {
    push_nothing(tick);
    release(hand);
    return;
  }
  double scale = share;
  if (const double size = share * tick.force.norm(); size > coupling.max_force) {
    scale *= (1.0 - 1e-15) * coupling.max_force / size;
    tick.flags |= force_saturated;
  }
  tick.force *= scale;
  tick.torque *= scale;
  tick.vibration *= scale;
  for (ContactPush& contact : tick.contacts) contact.force *= static_cast<float>(scale);
  tick.state = ContactState::contact;
  for (std::size_t i = 0; i < held_.count; ++i)
    if (contacts_[held_.limit[i]].fit.unseen > 0.0) tick.flags |= surface_hidden;
  tick.surface_velocity = surface.dot(tick.normal);
}

Tick ShapeTouch::tick(const HandPose& given, double t) noexcept {
  Tick tick = free_tick(given.position, t, frame_.number());
  tick.orientation = tick.proxy_orientation = given.orientation;
  const double length = given.orientation.norm();
  if (!is_place(given.position) || !std::isfinite(t) || !(length > 0.5 && length < 2.0)) {
    tick.proxy = placed_ ? pose_.at : Vec3::Zero();
    tick.flags = non_finite_input;
    return tick;
  }
  const Pose hand{given.position, unit(given.orientation)};
  hand_velocity_.update(hand.at, t);
  const double dt = t - last_t_;
  movement_ = {Vec3::Zero(), hand_velocity_.value(), dt};
  if (dt > 0.0 && dt < longest_gap) {
    const Vec3 spin = rotation_vector(between(hand.turn, last_turn_)) / dt;
    spin_ += -math::expm1(-dt / spin_time) * (spin - spin_);
  } else if (dt != 0.0) {
    spin_ = Vec3::Zero();
  }
  last_turn_ = hand.turn;
  last_t_ = t;
  if (!placed_) release(hand);
  if (frame_.cloud() == nullptr) {
    pose_ = kept_ = hand;
    tick.flags = no_frame;
    return tick;
  }
  timing_.tick(t);
  const SeenSurface::Aim aim{loose_ ? hand.at : pose_.at, shape_->reach() + deepest};
  taken_in_ = slid_ = false;
  for (SeenSurface& each : seen_) {
    each.start_tick(aim, t, parameters_.sight);
    taken_in_ = taken_in_ || (each.active() && each.whole());
    slid_ = slid_ || (each.active() && each.slid());
  }
  steps_ = 0;
  ++ticks_;
  if (loose_) {
    Scan found;
    std::fill(behind_.is.begin(), behind_.is.end(), std::uint8_t{0});
    behind_.in_patch = {};
    scan(hand, all, found, &behind_now_);
    pose_ = kept_ = hand;
    fresh_ = false;
    std::swap(behind_, behind_now_);
    loose_ = found.inside > 0;
  }
  if (!loose_) {
    touching_ = move(hand);
    if (touching_) render(hand, t, tick);
    if ((pose_.at - hand.at).norm() > lost) {
      release(hand);
      push_nothing(tick);
      tick.state = ContactState::free_motion;
      tick.flags |= proxy_let_go;
    }
  }
  if (dt > 0.0) {
    const double newest = dt / (dt + sliding_time);
    sliding_ += newest * ((pose_.at - last_pose_.at) / dt - sliding_);
    sliding_spin_ +=
        newest * (rotation_vector(between(pose_.turn, last_pose_.turn)) / dt - sliding_spin_);
  }
  last_pose_ = pose_;
  last_hand_ = hand.at;
  movement_.velocity -= tick.surface_motion;
  feel_.ring(movement_, tick);
  tick.steps = steps_;
  tick.proxy = pose_.at;
  tick.proxy_orientation = pose_.turn;
  if (frame_.count() > 1 && t - frame_.stamp() > parameters_.motion.max_extrapolation)
    tick.flags |= frame_stale;
  return tick;
}

}  // namespace palpate
