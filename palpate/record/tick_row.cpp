// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <span>
#include <type_traits>
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

// The axes of a field's numbers; a single number has no axis.
template <class T>
constexpr std::string_view axes_of{};
template <>
constexpr std::string_view axes_of<Vec3> = "xyz";
template <>
constexpr std::string_view axes_of<Rotation> = "xyzw";  // as a rotation's coeffs()

class Names {
 public:
  template <class T>
  void operator()(std::string_view name, const T& /*value*/) {
    if constexpr (axes_of<T>.empty()) names.emplace_back(name);
    for (const char axis : axes_of<T>) names.push_back(std::string(name) + "_" + axis);
  }
  std::vector<std::string> names;
};

class Put {
 public:
  void operator()(std::string_view /*name*/, const Vec3& v) {
    row.insert(row.end(), v.begin(), v.end());
  }
  void operator()(std::string_view /*name*/, const Rotation& q) {
    row.insert(row.end(), q.coeffs().begin(), q.coeffs().end());
  }
  template <class T>
  void operator()(std::string_view /*name*/, const T& value) {
    row.push_back(static_cast<double>(value));  // whole numbers are far below 2^53
  }
  std::vector<double> row;
};

class Get {
 public:
  Get(std::span<const double> row, std::span<const std::optional<std::size_t>> places,
      const std::string& name)
      : row_(row), places_(places), name_(name) {}

  void operator()(std::string_view /*field*/, double& value) { value = next().value_or(value); }
  void operator()(std::string_view /*field*/, Vec3& v) {
    for (double& value : v) value = next().value_or(value);
  }
  void operator()(std::string_view /*field*/, Rotation& q) {
    for (double& value : q.coeffs()) value = next().value_or(value);
  }
  template <class T>
  void operator()(std::string_view field, T& value) {
    const std::optional<double> number = next();
    if (!number) return;
    if constexpr (std::is_enum_v<T>) {
      value = static_cast<T>(static_cast<int>(whole(field, *number, 0.0, 2.0)));
    } else {
      constexpr double most = 9007199254740992.0;  // 2^53
      using Limits = std::numeric_limits<T>;
      value =
          static_cast<T>(whole(field, *number, std::max(static_cast<double>(Limits::min()), -most),
                               std::min(static_cast<double>(Limits::max()), most)));
    }
  }

 private:
  std::optional<double> next() {
    const std::optional<std::size_t> place = places_[at_++];
    return place ? std::optional(row_[*place]) : std::nullopt;
  }
  [[nodiscard]] double whole(std::string_view field, double value, double least,
                             double most) const {
    if (!(value >= least && value <= most && value == std::floor(value)))
      throw Error(name_, "has a " + std::string(field) + " of " + std::to_string(value),
                  "it may be damaged");
    return value;
  }

  std::span<const double> row_;
  std::span<const std::optional<std::size_t>> places_;
  const std::string& name_;
  std::size_t at_ = 0;
};

}  // namespace

const std::vector<std::string>& tick_columns() {
  static const std::vector<std::string> columns = [] {
    Names names;
    const ServoTick tick;
    walk(names, tick);
    return std::move(names.names);
  }();
  return columns;
}

std::vector<double> row_of(const ServoTick& tick) {
  Put put;
  put.row.reserve(tick_columns().size());
  walk(put, tick);
  return std::move(put.row);
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
  Get get(row, places_, name);
  walk(get, tick);
  return tick;
}

}  // namespace palpate
