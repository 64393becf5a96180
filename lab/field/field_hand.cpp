// SPDX-License-Identifier: Apache-2.0
#include "lab/field/field_hand.hpp"

#include <algorithm>
#include <utility>

#include "lab/field/field_scene.hpp"

namespace palpate::lab::field {
namespace {

constexpr double peak = 1.875;  // [-] of ease(): the fastest over the mean

}  // namespace

Script& Script::wait(double seconds) {
  return follow(seconds, [place = end_](double) { return place; });
}

Script& Script::reach(const Vec3& to, double speed) {
  return stroke({end_, to}, speed);
}

Script& Script::stroke(const std::vector<Vec3>& places, double speed) {
  std::vector<double> gone = {0.0};
  for (std::size_t i = 1; i < places.size(); ++i)
    gone.push_back(gone.back() + (places[i] - places[i - 1]).norm());
  const double seconds = std::max(peak * gone.back() / speed, 1e-3);
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

}  // namespace palpate::lab::field
