// SPDX-License-Identifier: Apache-2.0
#include "lab/field/field_setting.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "lab/field/field_scene.hpp"
#include "lab/method.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate::lab::field {

Script& Script::wait(double seconds) {
  return follow(seconds, [place = end_](double) { return place; });
}

Script& Script::reach(const Vec3& to, double speed) { return stroke({end_, to}, speed); }

Script& Script::stroke(const std::vector<Vec3>& places, double speed) {
  std::vector<double> gone = {0.0};
  for (std::size_t i = 1; i < places.size(); ++i)
    gone.push_back(gone.back() + (places[i] - places[i - 1]).norm());
  const double seconds = std::max(ease_peak * gone.back() / speed, 1e-3);
  return follow(seconds, [=, begin = now_](double t) {
    const double way = gone.back() * ease((t - begin) / seconds);
    std::size_t i = 1;
    while (i + 1 < places.size() && gone[i] < way) ++i;
    const double length = gone[i] - gone[i - 1];
    const double share = length > 0.0 ? std::clamp((way - gone[i - 1]) / length, 0.0, 1.0) : 1.0;
    return Vec3(places[i - 1] + share * (places[i] - places[i - 1]));
  });
}

Script& Script::follow(double seconds, std::function<Vec3(double)> place) {
  actions_.push_back({now_, now_ + seconds, std::move(place)});
  now_ += seconds;
  end_ = actions_.back().place(now_);
  return *this;
}

Vec3 Script::at(double t) const {
  for (const Action& action : actions_) {
    if (t < action.end) return action.place(t);
  }
  return actions_.empty() ? start_ : end_;
}

std::uint64_t hash_of(std::string_view text, std::uint64_t hash) {
  for (const char letter : text) hash = Chance(hash ^ static_cast<unsigned char>(letter)).bits();
  return hash;
}

double Draw::even(std::string_view key, double low, double high) {
  return given(key, low + (high - low) * chance_of(key), std::min(11.0 * low, 0.0),
               high + 10.0 * std::abs(high));
}

double Draw::by_factor(std::string_view key, double low, double high) {
  return given(key, low * math::pow(high / low, chance_of(key)), 0.01 * low, 10.0 * high);
}

int Draw::whole(std::string_view key, int count) {
  return static_cast<int>(
      given(key, std::floor(chance_of(key) * count), 0.0, static_cast<double>(count - 1)));
}

void Draw::check() const {
  std::vector<std::string_view> keys = {"seed"};
  for (const auto& [key, value] : values_) keys.push_back(key);
  uri_.allow_only(keys);
}

std::string Draw::text() const {
  std::string text;
  for (const auto& [key, value] : values_)
    text += fmt::format("{}{}={:.4g}", text.empty() ? "" : "&", key, value.value);
  return text;
}

double Draw::given(std::string_view key, double drawn, double low, double high) {
  const Value value{uri_.number_option(key, drawn, low, high), low, high};
  const auto [found, is_new] = values_.emplace(key, value);
  if (!is_new && (found->second.low != low || found->second.high != high))
    throw Error("field: " + std::string(key), "two values have this name",
                "use different names for the values of a class and its sensors");
  return value.value;
}

Place below(const FieldScene& scene, double x, double y, double t, double from) {
  const Snapshot snapshot(scene, t);
  const Vec3 high(x, y, from);
  const double gone = snapshot.cast(high, -Vec3::UnitZ(), 2.0).value_or(from);
  const Vec3 point = high - gone * Vec3::UnitZ();
  return {point, snapshot.nearest(point + 1e-4 * Vec3::UnitZ()).normal};
}

void play_script(Setting& setting, const Script& script) {
  setting.duration = script.duration();
  setting.hip = [script](double t) { return script.at(t); };
}

std::function<Eigen::Isometry3d(double)> turning(const Vec3& axis_at, double angle, double begin,
                                                 double seconds, const Eigen::Isometry3d& on_it) {
  return [=](double t) {
    return Eigen::Isometry3d(at(axis_at) * turned(angle * ease((t - begin) / seconds)) * on_it);
  };
}

void add_arm(FieldScene& scene, const std::function<Eigen::Isometry3d(double)>& pose) {
  std::vector<std::pair<ShapePtr, Eigen::Isometry3d>> parts = {
      {capsule(0.16, 0.038), at(-0.38, 0.0, 0.0)},
      {capsule(0.035, 0.027), at(-0.135, 0.015, 0.0)},
      {capsule(0.035, 0.027), at(-0.135, -0.015, 0.0)}};
  for (const double y : {-0.024, -0.008, 0.008, 0.024})  // closed fingers
    parts.emplace_back(capsule(0.045, 0.0085), at(-0.055, y, 0.0));
  for (const auto& [shape, place] : parts)
    scene.push_back(moving(
        shape, [pose, at_rest = place](double t) { return Eigen::Isometry3d(pose(t) * at_rest); }));
}

void crop(SensorSetup& setup, double distance, double wide, int most_pixels) {
  setup.focal = std::min(setup.focal, most_pixels * distance / wide);
  setup.width = setup.height = std::max(static_cast<int>(wide * setup.focal / distance), 64);
}

std::string FieldCase::text() const {
  return fmt::format("{}:{}?seed={}{}{}", set->name, name, seed, fixed.empty() ? "" : "&", fixed);
}

const FieldClass& find_field_class(std::string_view name, const CaseSet& set) {
  return find_named(set.classes, name, "class",
                    fmt::format("there is no such class of the {} set", set.name));
}

FieldCase draw_field_case(const FieldClass& of, std::uint64_t seed, std::uint64_t index,
                          const CaseSet& set) {
  Chance chance(hash_of(of.name, Chance(seed ^ set.stream).bits()) ^ Chance(index).bits());
  return {&set, of.name, chance.bits() >> 33U, {}};
}

FieldCase parse_field_case(const std::string& text, const CaseSet& set) {
  const Uri uri(text);
  if (uri.scheme() != set.name)
    throw Error("--case " + text, fmt::format("it does not begin with '{}:'", set.name),
                fmt::format("give one as `palpate eval {}` prints it", set.name));
  FieldCase c{&set, find_field_class(uri.path(), set).name};
  c.seed = static_cast<std::uint64_t>(uri.number_option("seed", 0.0, 0.0, 0x1p31));
  // All but the seed, as it was written.
  std::string rest =
      text.substr(text.find('?') == std::string::npos ? text.size() : text.find('?') + 1);
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('&'), rest.size());
    const std::string assignment = rest.substr(0, end);
    if (assignment.rfind("seed=", 0) != 0) c.fixed += (c.fixed.empty() ? "" : "&") + assignment;
    rest.erase(0, end + 1);
  }
  return c;
}

Stage make_stage(const FieldCase& c) {
  Draw draw(c);
  const CameraPlan plan = c.set->camera(draw);
  const double rate = plan.rate;
  // The hand waits until the camera has shown the scene at least three times.
  const double start = 0.1 + plan.latency + 4.0 / rate;

  const FieldClass& of = find_field_class(c.name, *c.set);
  Setting setting;
  const View& view = setting.view;
  setting.most_tilt = of.most_tilt;
  of.make(draw, setting, start);
  const double tilt = draw.even("tilt", view.least_tilt, setting.most_tilt);
  const double azimuth =
      draw.even("azimuth", view.azimuth - view.azimuth_range, view.azimuth + view.azimuth_range);
  Stage stage;
  stage.sensor = std::make_shared<Sensor>(
      plan.setup,
      camera_pose(Vec3::Zero(), plan.distance, tilt, azimuth, draw.even("roll", -pi, pi)));
  if (setting.before_camera) setting.before_camera(setting.scene, stage.sensor->eye());
  stage.scene = std::move(setting.scene);
  stage.hip = std::move(setting.hip);
  stage.duration = setting.duration;
  stage.feature = setting.feature;
  stage.interval = 1.0 / rate;

  Chance chance(draw.seed_of("shots"));
  for (int i = 0; i / rate <= stage.duration; ++i) {
    Shot shot;
    shot.captured = i / rate;
    const double off = plan.jitter * chance.normal();
    shot.arrives = shot.captured + plan.latency + std::abs(off);
    shot.stamp = shot.captured + off;
    const bool lost = chance.even() < plan.dropped;
    if (lost && i >= 3) continue;  // the hand waits for the first three
    if (!stage.shots.empty()) {
      shot.arrives = std::max(shot.arrives, stage.shots.back().arrives);
      shot.stamp = std::max(shot.stamp, stage.shots.back().stamp + 1e-3);
    }
    shot.stamp = std::min(shot.stamp, shot.arrives);
    stage.shots.push_back(shot);
  }
  draw.check();
  stage.values = draw.text();
  return stage;
}

}  // namespace palpate::lab::field
