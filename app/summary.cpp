// SPDX-License-Identifier: Apache-2.0
#include "app/summary.hpp"

#include <algorithm>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "palpate/cloud/audit.hpp"

namespace palpate::app {

std::optional<double> least_behind(std::span<const Cloud* const> cameras, const Vec3& proxy,
                                   double r_c) {
  std::optional<double> least;
  for (const Cloud* cloud : cameras) {
    const auto* image = dynamic_cast<const DepthImage*>(cloud);
    if (image == nullptr) continue;
    const std::optional<double> behind = distance_behind(*image, proxy, r_c);
    if (behind && (!least || *behind < *least)) least = behind;
  }
  return least;
}

void Summary::count(const Tick& tick, std::size_t frames, const std::optional<double>& behind,
                    double r_c) {
  if (ticks_ == 0) first_t_ = tick.t;
  last_t_ = tick.t;
  ++ticks_;
  steps_ += static_cast<std::size_t>(tick.steps);
  frames_ = frames;
  contact_ticks_ += tick.state != ContactState::free_motion ? 1 : 0;
  budget_hits_ += (tick.flags & step_budget_hit) != 0 ? 1 : 0;
  thinned_ += (tick.flags & patch_thinned) != 0 ? 1 : 0;
  max_force_ = std::max(max_force_, tick.force.norm());

  if (!behind) return;
  if (*behind < 0.0) {
    was_in_front_ = true;
    behind_since_frame_ = -1;
  } else if (was_in_front_ && *behind > r_c) {
    if (behind_since_frame_ < 0) behind_since_frame_ = tick.frame;
    if (tick.frame > behind_since_frame_ + 1) {
      ++pop_throughs_;
      was_in_front_ = false;
    }
  }
}

std::string Summary::text() const {
  const double share =
      ticks_ == 0 ? 0.0 : 100.0 * static_cast<double>(contact_ticks_) / static_cast<double>(ticks_);
  const double steps =
      ticks_ == 0 ? 0.0 : static_cast<double>(steps_) / static_cast<double>(ticks_);
  std::string text = fmt::format(
      "{} ticks over {:.3f} s, {} frames, in contact {:.1f} % of the time, largest force {:.3f} N, "
      "{:.2f} steps a tick, suspected pop-throughs {}",
      ticks_, last_t_ - first_t_, frames_, share, max_force_, steps, pop_throughs_);
  if (late_ticks_ > 0) text += fmt::format(", late ticks {}", late_ticks_);
  if (budget_hits_ > 0) text += fmt::format(", step budget spent in {} ticks", budget_hits_);
  if (thinned_ > 0) text += fmt::format(", points thinned in {} ticks", thinned_);
  return text + "\n";
}

std::string Summary::json() const {
  const nlohmann::ordered_json object = {{"ticks", ticks_},
                                         {"frames", frames_},
                                         {"duration_s", last_t_ - first_t_},
                                         {"late_ticks", late_ticks_},
                                         {"contact_ticks", contact_ticks_},
                                         {"steps", steps_},
                                         {"step_budget_hits", budget_hits_},
                                         {"patch_thinned_ticks", thinned_},
                                         {"max_force", max_force_},
                                         {"pop_throughs", pop_throughs_}};
  return object.dump(2) + "\n";
}

}  // namespace palpate::app
