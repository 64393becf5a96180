// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/viewer/roles.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

constexpr const char* operator_remedy = "open the operator's link, which the program printed";

struct Direction {
  std::string_view limit;
  Stricter stricter;
};

// Limits that are not here have no strict end: a short `continuous_time`, say, heats the motors
// sooner and lets them cool sooner, and a low `fall_rate` keeps a force for longer.
constexpr std::array directions = {
    Direction{"max_device_force", Stricter::lower}, Direction{"rise_rate", Stricter::lower},
    Direction{"engage_force", Stricter::lower},     Direction{"engage_ticks", Stricter::higher},
    Direction{"ramp_time", Stricter::higher},       Direction{"late_intervals", Stricter::lower},
    Direction{"fade_age", Stricter::lower},         Direction{"lost_age", Stricter::lower},
    Direction{"future_tolerance", Stricter::lower}, Direction{"max_speed", Stricter::lower},
    Direction{"stall_time", Stricter::lower},
};

bool is_looser(Stricter stricter, double value, double bound) {
  return stricter == Stricter::lower ? value > bound : value < bound;
}

std::string amount(const SafetyParameterInfo& row, double value) {
  return number_text(value) + (row.unit == "-" ? "" : " " + std::string(row.unit));
}

constexpr std::size_t remembered_tokens = 16;  // of an address: pages left open from before

using Padded = std::array<unsigned char, longest_token>;

Padded padded(std::string_view token) {
  Padded bytes{};
  std::copy_n(token.begin(), std::min(token.size(), bytes.size()), bytes.begin());
  return bytes;
}

}  // namespace

std::string_view to_string(Role role) {
  constexpr std::array<std::string_view, 3> names = {"looking", "holding", "operating"};
  return names[static_cast<std::size_t>(role)];
}

// Hazard: strangers-limits
void check_allowed(const Command& command, Role role) {
  if (role == Role::operating) return;
  if (std::holds_alternative<SetMethod>(command))
    throw Error("method", "only the operator changes it", operator_remedy);
  if (std::holds_alternative<SetTool>(command))
    throw Error("tool", "only the operator chooses it", operator_remedy);
  if (std::holds_alternative<SetRecording>(command))
    throw Error("recording", "only the operator starts and ends it", operator_remedy);
  if (std::holds_alternative<SetPlayback>(command) || std::holds_alternative<Seek>(command))
    throw Error("playback", "only the operator changes it", operator_remedy);
  if (std::holds_alternative<OpenScene>(command) || std::holds_alternative<Rescale>(command))
    throw Error("scene", "only the operator chooses it", operator_remedy);
  if (std::holds_alternative<SetPlacement>(command))
    throw Error("placement", "only the operator changes it", operator_remedy);
  if (std::holds_alternative<Forbid>(command) || std::holds_alternative<Guide>(command) ||
      std::holds_alternative<RemoveFixture>(command))
    throw Error("fixture", "only the operator adds and removes it", operator_remedy);
  if (std::holds_alternative<ResetFaults>(command))
    throw Error("latched fault", "only the operator resets it", operator_remedy);
  if (role == Role::holding) return;
  const std::string remedy = "take control of the HIP, or " + std::string(operator_remedy);
  if (std::holds_alternative<ResetHand>(command))
    throw Error("hand", "only the page that controls the HIP can reset it", "take the hand");
  if (std::holds_alternative<SetSafetyParameter>(command))
    throw Error("safety limit", "this page is for viewing only", remedy);
  if (std::holds_alternative<SetBrush>(command) || std::holds_alternative<DropBrush>(command) ||
      std::holds_alternative<ClearPaint>(command))
    throw Error("brush", "this page is for viewing only", remedy);
  throw Error("parameter", "this page is for viewing only", remedy);
}

Stricter stricter_direction(std::string_view limit) {
  const auto* row = std::find_if(directions.begin(), directions.end(),
                                 [&](const Direction& d) { return d.limit == limit; });
  return row == directions.end() ? Stricter::neither : row->stricter;
}

LimitBounds::LimitBounds(const SafetyParameters& start,
                         const std::map<std::string, double>& loosest)
    : operators_(start), loosest_(loosest) {
  for (const auto& [name, value] : loosest) {
    SafetyParameters checked;
    set_parameter(checked, name, value);
    if (stricter_direction(name) == Stricter::neither)
      throw Error("--operator-limit " + name,
                  "neither a smaller nor a larger value of this limit is always safer",
                  "use another limit, such as max_device_force or max_speed");
  }
}

// Hazard: strangers-limits
void LimitBounds::check(std::string_view name, double value, Role role) const {
  const SafetyParameterInfo& row = safety_parameter(name);
  const Stricter stricter = stricter_direction(name);
  const std::string subject = "limit '" + std::string(name) + "'";
  const std::string end = stricter == Stricter::lower ? "above" : "below";
  if (role == Role::operating) {
    const auto bound = loosest_.find(std::string(name));
    if (bound != loosest_.end() && is_looser(stricter, value, bound->second))
      throw Error(subject,
                  amount(row, value) + " is " + end + " the " + amount(row, bound->second) +
                      " of --operator-limit",
                  "start the session with another");
    return;
  }
  if (role == Role::looking) throw Error(subject, "this page is for viewing only", "take the hand");
  if (stricter == Stricter::neither)
    throw Error(subject, "only the operator changes it", operator_remedy);
  if (!is_looser(stricter, value, row.get(operators_))) return;
  throw Error(
      subject,
      amount(row, value) + " is " + end + " the operator's " + amount(row, row.get(operators_)),
      operator_remedy);
}

void LimitBounds::set_by_operator(std::string_view name, double value) {
  safety_parameter(name).set(operators_, value);
}

bool is_token(std::string_view given, std::string_view token) {
  const Padded a = padded(given);
  const Padded b = padded(token);
  unsigned difference = given.size() == token.size() ? 0U : 1U;
  for (std::size_t i = 0; i < a.size(); ++i) difference |= static_cast<unsigned>(a[i] ^ b[i]);
  // The token's own length is no secret to who set it, and is not shown to anybody else.
  return difference == 0 && !token.empty() && token.size() <= longest_token;
}

double GuessLimit::pause(const std::string& address, double t) const {
  const auto found = addresses_.find(address);
  return found == addresses_.end() ? 0.0 : std::max(found->second.until - t, 0.0);
}

void GuessLimit::wrong(const std::string& address, std::string_view token, double t) {
  if (addresses_.size() >= max_addresses && addresses_.find(address) == addresses_.end())
    addresses_.erase(std::min_element(
        addresses_.begin(), addresses_.end(),
        [](const auto& a, const auto& b) { return a.second.last < b.second.last; }));
  Address& known = addresses_[address];
  if (t - known.last > memory) known = {};
  known.last = t;
  const std::size_t hash = std::hash<std::string_view>{}(token.substr(0, longest_token + 1));
  if (std::find(known.hashes.begin(), known.hashes.end(), hash) != known.hashes.end()) return;
  known.hashes.push_back(hash);
  if (known.hashes.size() > remembered_tokens) known.hashes.pop_front();
  if (++known.guesses <= free_guesses) return;
  const auto beyond = static_cast<double>(known.guesses - free_guesses - 1);
  known.until = t + std::min(std::exp2(std::min(beyond, 30.0)), longest_pause);
}

}  // namespace palpate
