// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/frame_sequence.hpp"

#include <cmath>
#include <utility>

#include "palpate/drivers/drivers.hpp"
#include "palpate/kernel/core/error.hpp"

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

void check_rate(double rate) { check_range("rate", "", "Hz", 1.0, 1e5, rate); }

}  // namespace

FrameSequence::FrameSequence(const std::vector<std::string>& uris) : FrameSequence(opened(uris)) {}

FrameSequence::FrameSequence(std::vector<std::unique_ptr<Source>> sources) {
  if (sources.empty())
    throw Error("--camera", "no camera is given", "give one, such as --camera synthetic:desk");
  for (std::unique_ptr<Source>& source : sources) {
    players_.emplace_back(std::move(source), Player::Open(), Playing::by_its_stamps);
    shown_.push_back({.first = players_.back().first_frame().stamp});
  }
  newest_.resize(players_.size());
}

void FrameSequence::adopt_until(double t, const std::function<void(const Observation&)>& adopt) {
  for (;;) {
    Player* due = nullptr;
    for (Player& player : players_) {
      const Frame* next = player.look_ahead();
      if (next == nullptr || next->stamp > t) continue;
      if (due == nullptr || next->stamp < due->upcoming()->stamp) due = &player;
    }
    const std::optional<FedFrame> fed = due == nullptr ? std::nullopt : due->next_until(t);
    if (!fed) break;
    const auto number = static_cast<std::size_t>(due - players_.data());
    adopt({*fed->frame.cloud, fed->frame.stamp, number});
    newest_[number] = fed->frame.cloud;  // only now may the frame before go
    shown_[number].last = last_ = fed->frame.stamp;
    ++shown_[number].count;
    ++adopted_;
  }
  bool is_valid = true;
  for (std::size_t i = 0; i < players_.size(); ++i) {
    shown_[i].ended = players_[i].has_ended();
    // A live camera that ends has failed: what it saw last stays as old as it is.
    is_valid = is_valid && shown_[i].ended && !players_[i].source().info().live;
  }
  if (!is_valid || adopted_ < 2 || last_ + still_interval > t) return;
  last_ += still_interval * std::floor((t - last_) / still_interval);
  for (std::size_t i = 0; i < players_.size(); ++i) adopt({*newest_[i], last_, i});
}

std::vector<SensorKind> FrameSequence::sensors() const {
  std::vector<SensorKind> all;
  for (const Player& player : players_) all.push_back(player.status().sensor);
  return all;
}

void FrameSequence::check(const Method& method) const {
  for (const Player& player : players_) method.check(*player.upcoming()->cloud);
}

std::int64_t ticks_along(const HipPath& path, double rate) {
  check_rate(rate);
  // A path of whole milliseconds has its last tick at its last time, whatever the rounding.
  const double duration = path.last_time() - path.first_time();
  return static_cast<std::int64_t>(std::floor(duration * rate + 1e-6)) + 1;
}

void touch(FrameSequence& frames, Method& method, const HipPath::Sample& first, double rate,
           const std::function<std::optional<HandPose>(double)>& hand,
           const std::function<bool(const Tick&)>& on_tick) {
  check_rate(rate);
  frames.check(method);
  method.seat(first.hip);
  frames.follow(first.hip);
  for (std::int64_t i = 0;; ++i) {
    const double t = first.t + static_cast<double>(i) / rate;
    frames.adopt_until(t, [&](const Observation& seen) { method.observe(seen); });
    const std::optional<HandPose> pose = hand(t);
    if (!pose) return;
    frames.follow(pose->position);
    if (!on_tick(method.tick(*pose, t))) return;
  }
}

void touch_along(FrameSequence& frames, Method& method, const HipPath& path, double rate,
                 const std::function<bool(const Tick&)>& on_tick) {
  std::int64_t left = ticks_along(path, rate);
  touch(
      frames, method, path.samples().front(), rate,
      [&](double t) { return left-- > 0 ? std::optional(path.pose_at(t)) : std::nullopt; },
      on_tick);
}

}  // namespace palpate
