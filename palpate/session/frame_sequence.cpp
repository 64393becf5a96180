// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/frame_sequence.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "palpate/drivers/drivers.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/session/camera_feed.hpp"

namespace palpate {

namespace {

std::vector<std::unique_ptr<Source>> opened(const std::vector<std::string>& uris) {
  std::vector<std::unique_ptr<Source>> sources;
  if (uris.size() > Patch::max_views)
    throw Error("--camera", std::to_string(uris.size()) + " cameras are too many",
                "give at most " + std::to_string(Patch::max_views));
  for (const std::string& uri : uris) sources.push_back(open_source(uri, all_sources()));
  return sources;
}

}  // namespace

FrameSequence::FrameSequence(const std::vector<std::string>& uris) : FrameSequence(opened(uris)) {}

FrameSequence::FrameSequence(std::vector<std::unique_ptr<Source>> sources) {
  if (sources.empty())
    throw Error("--camera", "no camera is given", "give one, such as --camera synthetic:desk");
  for (std::unique_ptr<Source>& source : sources) {
    Camera camera;
    camera.source = std::move(source);
    camera.next = camera.source->next();
    if (!camera.next)
      throw Error(camera.source->info().uri, "it has no frames", "give a source with at least one");
    camera.first_stamp = camera.next->stamp;
    cameras_.push_back(std::move(camera));
  }
  newest_.resize(cameras_.size());
}

void FrameSequence::adopt_until(double t, const std::function<void(const Observation&)>& adopt) {
  for (;;) {
    Camera* due = nullptr;
    for (Camera& camera : cameras_) {
      if (!camera.next || camera.next->stamp > t) continue;
      if (due == nullptr || camera.next->stamp < due->next->stamp) due = &camera;
    }
    if (due == nullptr) break;
    due->newest = std::move(*due->next);
    due->next = due->source->next();
    const auto number = static_cast<std::size_t>(due - cameras_.data());
    adopt({*due->newest.cloud, due->newest.stamp, number});
    newest_[number] = due->newest.cloud;  // only now may the frame before go
    ++due->adopted;
    ++adopted_;
    shown_ = due->newest.stamp;
  }
  // A live camera that ends has failed: what it saw last stays as old as it is.
  const bool is_valid = std::all_of(cameras_.begin(), cameras_.end(), [](const Camera& camera) {
    return !camera.next && !camera.source->info().live;
  });
  if (!is_valid || adopted_ < 2 || shown_ + still_interval > t) return;
  shown_ += still_interval * std::floor((t - shown_) / still_interval);
  for (std::size_t i = 0; i < cameras_.size(); ++i) adopt({*newest_[i], shown_, i});
}

std::vector<ShownFrames> FrameSequence::shown() const {
  std::vector<ShownFrames> all;
  for (const Camera& camera : cameras_)
    all.push_back({.count = camera.adopted,
                   .first = camera.first_stamp,
                   .last = camera.newest.stamp,
                   .ended = !camera.next});
  return all;
}

std::vector<SensorKind> FrameSequence::sensors() const {
  std::vector<SensorKind> all;
  for (const Camera& camera : cameras_) all.push_back(camera.source->info().sensor);
  return all;
}

void FrameSequence::check(const Method& method) const {
  for (const Camera& camera : cameras_) method.check(*camera.next->cloud);
}

namespace {

void check_rate(double rate) {
  if (!(rate >= 1.0 && rate <= 100000.0))
    throw Error("rate", std::to_string(rate) + " Hz is not a tick rate", "give 1 to 100000");
}

}  // namespace

std::int64_t ticks_along(const HipPath& path, double rate) {
  check_rate(rate);
  // A path of whole milliseconds has its last tick at its last time, whatever the rounding.
  const double duration = path.last_time() - path.first_time();
  return static_cast<std::int64_t>(std::floor(duration * rate + 1e-6)) + 1;
}

void touch(FrameSequence& frames, Method& method, const HipPath::Sample& first, double rate,
           const std::function<std::optional<Vec3>(double)>& hand,
           const std::function<bool(const Tick&)>& on_tick) {
  check_rate(rate);
  frames.check(method);
  method.seat(first.hip);
  for (std::int64_t i = 0;; ++i) {
    const double t = first.t + static_cast<double>(i) / rate;
    frames.adopt_until(t, [&](const Observation& seen) { method.observe(seen); });
    const std::optional<Vec3> hip = hand(t);
    if (!hip || !on_tick(method.tick(*hip, t))) return;
  }
}

void touch_along(FrameSequence& frames, Method& method, const HipPath& path, double rate,
                 const std::function<bool(const Tick&)>& on_tick) {
  std::int64_t left = ticks_along(path, rate);
  touch(
      frames, method, path.samples().front(), rate,
      [&](double t) { return left-- > 0 ? std::optional(path.at(t)) : std::nullopt; }, on_tick);
}

}  // namespace palpate
