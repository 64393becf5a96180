// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>
#include <span>
#include <utility>

#include "palpate/kernel/core/error.hpp"
#include "palpate/record/session.hpp"

namespace palpate {
namespace {

// One walk over a tick's fields names, writes and reads them, so that the three cannot differ.
template <class Way, class T>
void walk(Way& way, T& record) {
  auto& tick = record.tick;
  way("t", tick.t);
  way("hip", tick.hip);
  way("proxy", tick.proxy);
  way("normal", tick.normal);
  way("rendered_force", tick.force);
  way("state", tick.state);
  way("steps", tick.steps);
  way("surface_velocity", tick.surface_velocity);
  way("frame", tick.frame);
  way("flags", tick.flags);
  way("force", record.force);
  way("position", record.position);
  way("gain", record.gain);
  way("frame_stamp", record.frame_stamp);
  way("frame_age", record.frame_age);
  way("number", record.number);
  way("frame_number", record.frame_number);
  way("settings_number", record.settings_number);
  way("safety", record.safety);
  way("wake_up_ns", record.wake_up_ns);
  way("previous_compute_ns", record.previous_compute_ns);
  way("hand", record.hand);
  way("surface_motion", tick.surface_motion);
  const auto walk_port = [&way](const std::string& name, auto& port) {
    way(name + "_excess", port.excess);
    way(name + "_most", port.most);
    way(name + "_made", port.made);
    way(name + "_generating", port.generating);
  };
  walk_port("relative", record.energy.relative);
  walk_port("absolute", record.energy.absolute);
  way("contacts", record.energy.contacts);
  way("region", record.region);
  way("guidance", record.guidance);
  way("fixtures", record.fixtures);
  way("handle", record.handle);
  way("orientation", tick.orientation);
  way("proxy_orientation", tick.proxy_orientation);
  way("rendered_torque", tick.torque);
  way("torque", record.torque);
}

}  // namespace

const std::vector<std::string>& tick_columns() {
  static const std::vector<std::string> columns = [] {
    NameNumbers names;
    const ServoTick tick;
    walk(names, tick);
    return std::move(names.names);
  }();
  return columns;
}

std::vector<double> row_of(const ServoTick& tick) {
  std::vector<double> row(tick_columns().size());
  PutNumbers put(row);
  walk(put, tick);
  return row;
}

void add_to_hash(std::uint64_t& hash, const ServoTick& tick) {
  static const auto count = static_cast<std::size_t>(
      std::find(tick_columns().begin(), tick_columns().end(), "hand") - tick_columns().begin() + 1);
  const std::vector<double> row = row_of(tick);
  for (const double number : std::span(row).first(count)) {
    const auto bits = std::bit_cast<std::uint64_t>(number);
    for (int byte = 0; byte < 8; ++byte)
      hash = (hash ^ (bits >> 8 * byte & 0xffU)) * 0x100000001b3U;
  }
}

TickRows::TickRows(std::span<const std::string> columns) : width_(columns.size()) {
  for (const std::string& name : tick_columns()) {
    const auto found = std::find(columns.begin(), columns.end(), name);
    places_.push_back(found == columns.end() ? std::nullopt
                                             : std::optional<std::size_t>(found - columns.begin()));
  }
}

ServoTick TickRows::read(std::span<const double> row, const std::string& name) const {
  if (row.size() != width_)
    throw Error(
        name, "has " + std::to_string(row.size()) + " numbers instead of " + std::to_string(width_),
        "it may be damaged");
  ServoTick tick;
  std::vector<double> all = row_of(tick);
  for (std::size_t i = 0; i < all.size(); ++i)
    if (has(i)) all[i] = row[*places_[i]];
  GetNumbers get(all, name);
  walk(get, tick);
  return tick;
}

}  // namespace palpate
