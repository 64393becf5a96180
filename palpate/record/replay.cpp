// SPDX-License-Identifier: Apache-2.0
#include "palpate/record/replay.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cinttypes>
#include <cstdio>
#include <memory>
#include <span>
#include <string_view>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/pose.hpp"

namespace palpate {
namespace {

// What went into a cycle, or only counts: not compared, as a replay is given it, and a recording
// that begins in mid-session counts differently.
constexpr std::array<std::string_view, 9> given_columns{"t",
                                                        "frame",
                                                        "position",
                                                        "handle",
                                                        "number",
                                                        "frame_number",
                                                        "settings_number",
                                                        "wake_up_ns",
                                                        "previous_compute_ns"};
// What the method made of it; all others are the cycle's.
constexpr std::array<std::string_view, 12> asked_columns{"hip",
                                                         "proxy",
                                                         "normal",
                                                         "rendered_force",
                                                         "state",
                                                         "steps",
                                                         "flags",
                                                         "surface_velocity",
                                                         "surface_motion",
                                                         "orientation",
                                                         "proxy_orientation",
                                                         "rendered_torque"};

// Does `columns` name the column, or the vector that it is an axis of?
bool names(std::span<const std::string_view> columns, std::string_view column) {
  if (column.size() > 2 && column[column.size() - 2] == '_') column.remove_suffix(2);
  return std::find(columns.begin(), columns.end(), column) != columns.end();
}

// Compares the columns that were recorded, and counts the tick in each of the two groups in which
// it differs.
void compare(const ServoTick& recorded, const ServoTick& again, const TickRows& rows,
             ReplayReport& report) {
  const std::vector<double> a = row_of(recorded);
  const std::vector<double> b = row_of(again);
  bool asked = false;
  bool sent = false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const std::string& column = tick_columns()[i];
    if (std::bit_cast<std::uint64_t>(a[i]) == std::bit_cast<std::uint64_t>(b[i]) || !rows.has(i) ||
        names(given_columns, column))
      continue;
    const bool is_asked = names(asked_columns, column);
    (is_asked ? asked : sent) = true;
    auto& first = (is_asked ? report.asked : report.sent).first;
    if (!first) first = ReplayDifference{recorded.number, column, a[i], b[i]};
  }
  const auto count = [](ReplayDifferences& differences, const Vec3& force) {
    ++differences.ticks;
    differences.largest_force = std::max(differences.largest_force, force.norm());
  };
  if (asked) count(report.asked, again.tick.force - recorded.tick.force);
  if (sent) count(report.sent, again.force - recorded.force);
}

class ReplayDevice final : public Device {
 public:
  explicit ReplayDevice(const DeviceLimits& limits)
      : info_{.uri = "replay:", .kind = "replay", .limits = limits} {}

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double /*t*/) noexcept override { return hand_; }
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}

  void set_hand(const ServoTick& recorded) {
    hand_ = {.position = recorded.position,
             .orientation = Eigen::Quaterniond(recorded.handle),
             .present = (recorded.hand & hand_present) != 0,
             .clutched = (recorded.hand & hand_clutched) != 0,
             .fault = fault_of(recorded.hand)};
  }

 private:
  DeviceInfo info_;
  HandState hand_;
};

// The very cycle of a live session, with all that went into it then.
class Rerun {
 public:
  Rerun(SessionReader& session, const ServoTick& first, const MethodRegistry& methods)
      : session_(session),
        methods_(methods),
        device_(session.info().limits),
        commands_(session.commands(first.settings_number)),
        cycle_(made_method(), device_, commands_),
        ticks_(cycle_.reader()) {
    if (!session.state()) {
      if (first.number == 0) return;
      throw Error("the recording", "begins in mid-session, with the state of another version",
                  "replay it with the version that made it");
    }
    // What was in use before, of each camera.
    std::vector<FrameInUse> in_use;
    for (const auto& [number, frame] : session.adopted())
      if (frame.tick < first.number) in_use.push_back(session.seen(number));
    frames_ = in_use.size();
    cycle_.restore(*session.state(), in_use);
  }

  // The next tick. @throws Error if the recording lacks what it needs
  ServoTick tick(const ServoTick& recorded) {
    const bool switched = (recorded.hand & method_switched) != 0;
    if (switched || recorded.settings_number != commands_.number) {
      commands_ = session_.commands(recorded.settings_number);
      cycle_.command([&](ServoCommands& told) { told = commands_; },
                     switched ? made_method() : nullptr);
    }
    if ((recorded.hand & faults_reset) != 0) cycle_.reset_faults();
    for (const std::uint64_t number : session_.taken_in(recorded)) put(number);
    device_.set_hand(recorded);
    cycle_.run({.t = recorded.tick.t,
                .wake_up_ns = recorded.wake_up_ns,
                .previous_compute_ns = recorded.previous_compute_ns});
    ServoTick again{};
    ticks_.try_pop(again);
    return again;
  }

  [[nodiscard]] std::uint64_t frames() const { return frames_; }

 private:
  [[nodiscard]] std::shared_ptr<Method> made_method() const {
    return make_method(commands_.settings.method, commands_.settings.parameters, methods_,
                       commands_.settings.tool);
  }

  void put(std::uint64_t number) {
    const AdoptedFrame& frame = session_.adopted().at(number);
    const FrameInUse seen = session_.seen(number);
    if (seen.camera != frame.cameras[0].camera)
      throw Error("recording", "has a frame " + std::to_string(number) + " of another camera",
                  "it may be damaged");
    cycle_.put_frame(seen.cloud, frame.stamp, std::span(frame.cameras).first(frame.camera_count),
                     frame.put_at);
    ++frames_;
  }

  SessionReader& session_;
  const MethodRegistry& methods_;
  ReplayDevice device_;
  ServoCommands commands_;
  Cycle cycle_;
  TickRing<ServoTick>::Reader ticks_;
  std::uint64_t frames_ = 0;
};

std::string text_of(const ReplayDifferences& differences, std::uint64_t ticks) {
  if (!differences.first) return "identical, bit for bit";
  const ReplayDifference& first = *differences.first;
  return std::to_string(differences.ticks) + " of " + std::to_string(ticks) +
         " ticks differ, forces by up to " + shortest(differences.largest_force) +
         " N; first tick " + std::to_string(first.tick) + ": " + first.field + " was " +
         shortest(first.recorded) + ", and is " + shortest(first.replayed) + " now";
}

}  // namespace

std::string text_of(const BagCheck& check) {
  if (!check.damage.empty()) return "the recording is damaged: " + check.damage;
  std::string text =
      "the recording has no checksums (it is older, or written by another program): damage may not "
      "be detected";
  if (check.has_checksums) {
    text = "checksums of all " + std::to_string(check.messages - check.unchecked) +
           " messages are right";
    if (check.unchecked > 0) text += "; " + std::to_string(check.unchecked) + " others have none";
  }
  if (!check.closed)
    text +=
        "; it was not closed (its program was probably killed), and contains only the completely "
        "written messages";
  return text;
}

std::string text_of(const ReplayReport& report) {
  std::array<char, 17> hash{};
  std::snprintf(hash.data(), hash.size(), "%016" PRIx64, report.hash);
  std::string text = std::to_string(report.ticks) + " ticks and " + std::to_string(report.frames) +
                     " frames replayed, hash " + hash.data() +
                     "\nasked: " + text_of(report.asked, report.ticks) +
                     "\nsent:  " + text_of(report.sent, report.ticks) + "\n";
  if (!report.broken_off.empty()) text += "the replay stopped: " + report.broken_off + "\n";
  return text + text_of(report.check) + "\n";
}

ReplayReport replay(SessionReader& session, const std::function<void(std::size_t)>& progress,
                    const MethodRegistry& methods) {
  constexpr std::size_t ticks_a_report = 1000;
  ReplayReport report;
  report.check = session.check();
  if (session.ticks() == 0) {
    report.broken_off = "the recording has no ticks";
    return report;
  }
  std::optional<ServoTick> last;
  std::unique_ptr<Rerun> rerun;
  for (std::size_t i = 0; i < session.ticks(); ++i) {
    try {
      const ServoTick recorded = session.tick(i);
      if (last && recorded.number != last->number + 1) {
        report.broken_off = "ticks " + std::to_string(last->number + 1) + " to " +
                            std::to_string(recorded.number - 1) + " are missing";
        break;
      }
      if (!rerun) rerun = std::make_unique<Rerun>(session, recorded, methods);
      const ServoTick again = rerun->tick(recorded);
      compare(recorded, again, session.rows(), report);
      add_to_hash(report.hash, again);
      last = recorded;
    } catch (const Error& error) {
      report.broken_off = last ? "after tick " + std::to_string(last->number) + ": " : "";
      report.broken_off += error.what();
      break;
    }
    ++report.ticks;
    if (progress && i % ticks_a_report == 0) progress(i);
  }
  if (rerun) report.frames = rerun->frames();
  return report;
}

}  // namespace palpate
