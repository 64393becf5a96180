// SPDX-License-Identifier: Apache-2.0
#include "palpate/record/replay.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <memory>
#include <span>
#include <string_view>
#include <utility>

#include "palpate/kernel/core/error.hpp"
#include "palpate/servo/free_side.hpp"

namespace palpate {
namespace {

// The columns of a tick that follow from what went into the cycle. A recording that begins in
// mid-session counts its frames and settings differently.
constexpr std::array<std::string_view, 6> sent_columns{"force",     "gain",   "frame_stamp",
                                                       "frame_age", "safety", "hand"};
constexpr std::array<std::string_view, 8> asked_columns{
    "hip", "proxy", "normal", "rendered_force", "state", "steps", "surface_velocity", "flags"};

// Those of the energy: of the method, and of the cycle.
constexpr std::array<std::string_view, 1> asked_energy{"surface_motion"};

// Does `columns` name the column, or the vector that it is an axis of?
bool names(std::span<const std::string_view> columns, std::string_view column) {
  if (column.ends_with("_x") || column.ends_with("_y") || column.ends_with("_z"))
    column.remove_suffix(2);
  return std::find(columns.begin(), columns.end(), column) != columns.end();
}

// Which of two groups of numbers a column belongs to.
enum class Group { asked, sent };

bool is_of(Group group, const std::string& column, bool energy) {
  if (energy) return names(asked_energy, column) == (group == Group::asked);
  return group == Group::asked ? names(asked_columns, column) : names(sent_columns, column);
}

// Which columns a recording has beside those of every version.
struct LaterColumns {
  bool energy = false;
  bool fixtures = false;
};

// Compares the columns of a group, the later ones if they were recorded.
void compare(const ServoTick& recorded, const ServoTick& again, Group group, LaterColumns later,
             const Vec3& force_difference, ReplayDifferences& differences) {
  bool different = false;
  const auto compare_rows = [&](const std::vector<double>& a, const std::vector<double>& b,
                                const std::vector<std::string>& columns, bool energy) {
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (std::bit_cast<std::uint64_t>(a[i]) == std::bit_cast<std::uint64_t>(b[i]) ||
          !is_of(group, columns[i], energy))
        continue;
      different = true;
      if (!differences.first)
        differences.first = ReplayDifference{recorded.number, columns[i], a[i], b[i]};
    }
  };
  compare_rows(row_of(recorded), row_of(again), tick_columns(), false);
  if (later.energy)
    compare_rows(energy_row_of(recorded), energy_row_of(again), energy_columns(), true);
  if (later.fixtures)
    compare_rows(fixture_row_of(recorded), fixture_row_of(again), fixture_columns(), true);
  if (!different) return;
  ++differences.ticks;
  differences.largest_force = std::max(differences.largest_force, force_difference.norm());
}

// A session's ticks made again.
class Rerun {
 public:
  virtual ~Rerun() = default;
  // The next tick. @throws Error if the recording lacks what it needs
  virtual ServoTick tick(const ServoTick& recorded) = 0;
  [[nodiscard]] virtual std::uint64_t frames() const = 0;
};

// The device of a replay: its hand is where it was then.
class ReplayDevice final : public Device {
 public:
  explicit ReplayDevice(const DeviceLimits& limits)
      : info_{.uri = "replay:", .kind = "replay", .limits = limits} {}

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double /*t*/) noexcept override { return hand_; }
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}

  void set_hand(const ServoTick& recorded) {
    hand_ = {.position = recorded.position,
             .present = (recorded.hand & hand_present) != 0,
             .clutched = (recorded.hand & hand_clutched) != 0,
             .fault = fault_of(recorded.hand)};
  }

 private:
  DeviceInfo info_;
  HandState hand_;
};

// The very cycle of a live session, with all that went into it then.
class CycleRerun final : public Rerun {
 public:
  CycleRerun(SessionReader& session, const ServoTick& first, const MethodRegistry& methods)
      : session_(session),
        methods_(methods),
        device_(session.info().limits.value()),
        commands_(session.commands(first.settings_number)),
        cycle_(made_method(), device_, commands_),
        ticks_(cycle_.reader()) {
    if (!session.state()) return;
    // What was in use before, of each camera.
    std::vector<FrameInUse> in_use;
    const auto use = [&](std::uint64_t number) {
      for (FrameInUse& frame : session.seen(number)) in_use.push_back(std::move(frame));
      frame_number_ = std::max(frame_number_, number);
      ++frames_;
    };
    bool any_known = false;
    for (const auto& [number, frame] : session.adopted()) {
      any_known = any_known || frame.tick;
      if (frame.tick && *frame.tick < first.number) use(number);
    }
    if (!any_known && first.frame_number > 0 && !session.adopted().contains(first.frame_number))
      use(first.frame_number);
    cycle_.restore(*session.state(), in_use);
  }

  ServoTick tick(const ServoTick& recorded) override {
    const bool switched = (recorded.hand & method_switched) != 0;
    if (switched || recorded.settings_number != commands_.number) {
      commands_ = session_.commands(recorded.settings_number);
      cycle_.command([&](ServoCommands& told) { told = commands_; },
                     switched ? made_method() : nullptr);
    }
    if ((recorded.hand & faults_reset) != 0) cycle_.reset_faults();
    for (const std::uint64_t number : session_.taken_in(recorded, frame_number_)) put(number);
    device_.set_hand(recorded);
    cycle_.run({.t = recorded.tick.t,
                .wake_up_ns = recorded.wake_up_ns,
                .previous_compute_ns = recorded.previous_compute_ns});
    ServoTick again{};
    ticks_.try_pop(again);
    return again;
  }

  [[nodiscard]] std::uint64_t frames() const override { return frames_; }

 private:
  [[nodiscard]] std::shared_ptr<Method> made_method() const {
    return make_method(commands_.settings.method, commands_.settings.parameters, methods_);
  }

  void put(std::uint64_t number) {
    const auto adopted = session_.adopted().find(number);
    if (adopted == session_.adopted().end())
      throw Error("recording", "lacks how frame " + std::to_string(number) + " was handed over",
                  "it may be damaged");
    AdoptedFrame frame = adopted->second;
    const std::span<CameraFrame> cameras(frame.cameras.data(), frame.camera_count);
    for (const FrameInUse& seen : session_.seen(number)) {
      // In an old recording its camera need not be the first.
      const auto own = std::find_if(cameras.begin(), cameras.end(), [&](const CameraFrame& each) {
        return each.camera == seen.camera;
      });
      if (own == cameras.end())
        throw Error("recording", "has a frame " + std::to_string(number) + " of another camera",
                    "it may be damaged");
      std::iter_swap(cameras.begin(), own);
      cycle_.put_frame(seen.cloud, frame.stamp, cameras, frame.put_at);
    }
    frame_number_ = std::max(frame_number_, number);
    ++frames_;
  }

  SessionReader& session_;
  const MethodRegistry& methods_;
  ReplayDevice device_;
  ServoCommands commands_;
  Cycle cycle_;
  TickRing<ServoTick>::Reader ticks_;
  std::uint64_t frame_number_ = 0;
  std::uint64_t frames_ = 0;
};

// The method of a session alone, given again what it was given then: for recordings that lack what
// the rest of the cycle needs.
class MethodRerun final : public Rerun {
 public:
  MethodRerun(SessionReader& session, const ServoTick& first, const MethodRegistry& methods)
      : session_(session),
        methods_(methods),
        settings_number_(first.settings_number),
        settings_(session.commands(settings_number_).settings),
        method_(make_method(settings_.method, settings_.parameters, methods_)) {
    if (!session.info().seat) return;
    last_proxy_ = *session.info().seat;
    method_->seat(last_proxy_);
  }

  ServoTick tick(const ServoTick& recorded) override {
    bool switched = (recorded.hand & method_switched) != 0 && ticks_ > 0;
    if (recorded.settings_number != settings_number_) {
      const std::string before = settings_.method;
      settings_number_ = recorded.settings_number;
      settings_ = session_.commands(settings_number_).settings;
      switched = switched || settings_.method != before;
      if (!switched) method_->set_parameters(settings_.parameters);
    }
    if (switched) {
      method_ = make_method(settings_.method, settings_.parameters, methods_);
      method_->seat(last_proxy_);
      last_normal_ = Vec3::Zero();
      if (recorded.frame_number == frame_number_) {
        for (const FrameInUse& frame : in_use_)
          if (frame.cloud) method_->observe({*frame.cloud, frame.stamp, frame.camera});
      }
    }
    ++ticks_;
    adopt(recorded.frame_number);
    if ((recorded.hand & proxy_reseated) != 0 && !seen_.parts().empty()) {
      method_->seat(
          free_side(seen_, last_proxy_, last_normal_, settings_.parameters.proxy.r_c(), patch_));
    }
    ServoTick again = recorded;
    again.tick = method_->tick(recorded.tick.hip, recorded.tick.t);
    last_proxy_ = again.tick.proxy;
    last_normal_ = again.tick.normal;
    return again;
  }

  [[nodiscard]] std::uint64_t frames() const override { return frames_; }

 private:
  void adopt(std::uint64_t number) {
    if (number == frame_number_) return;
    const auto& put = session_.frames();
    const auto last = put.find(number);
    if (last == put.end() || number < frame_number_)
      throw Error("recording", "lacks frame " + std::to_string(number),
                  "the disk was too slow, or the recording is damaged");
    auto frame = last;
    if (session_.info().kind == SessionInfo::Kind::headless) frame = put.upper_bound(frame_number_);
    for (; frame != std::next(last); ++frame) {
      for (FrameInUse& seen : session_.seen(frame->first)) {
        method_->observe({*seen.cloud, seen.stamp, seen.camera});
        seen_.take(seen.camera, *seen.cloud);
        in_use_[seen.camera] = std::move(seen);  // only now may the one before go
      }
      ++frames_;
    }
    frame_number_ = number;
  }

  SessionReader& session_;
  const MethodRegistry& methods_;
  std::uint64_t settings_number_;
  ServoSettings settings_;
  std::unique_ptr<Method> method_;
  std::uint64_t ticks_ = 0;
  std::uint64_t frame_number_ = 0;
  std::array<FrameInUse, Freshness::max_cameras> in_use_;  // by camera
  ObservedClouds seen_;                                    // these
  Patch patch_;
  Vec3 last_proxy_ = Vec3::Zero();
  Vec3 last_normal_ = Vec3::Zero();
  std::uint64_t frames_ = 0;
};

// Why the cycle cannot be run again; empty if it can.
std::string lacks_for_cycle(const SessionReader& session, const ServoTick& first) {
  if (!session.info().limits)
    return "the recording has no device limits: it is older than these, or of a session "
           "without a safety chain";
  if (first.number > 0 && !session.state())
    return "the recording begins in mid-session, without a state of this version's safety chain";
  return {};
}

std::unique_ptr<Rerun> open_rerun(SessionReader& session, const ServoTick& first,
                                  const MethodRegistry& methods, ReplayReport& report) {
  report.sent_unchecked = lacks_for_cycle(session, first);
  if (report.sent_unchecked.empty()) return std::make_unique<CycleRerun>(session, first, methods);
  return std::make_unique<MethodRerun>(session, first, methods);
}

}  // namespace

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
  LaterColumns later;
  for (std::size_t i = 0; i < session.ticks(); ++i) {
    try {
      if (i == 0) later = {session.has_energy(), session.has_fixtures()};
      const ServoTick recorded = session.tick(i);
      if (last && recorded.number != last->number + 1) {
        report.broken_off = "ticks " + std::to_string(last->number + 1) + " to " +
                            std::to_string(recorded.number - 1) + " are missing";
        break;
      }
      if (!rerun) rerun = open_rerun(session, recorded, methods, report);
      const ServoTick again = rerun->tick(recorded);
      compare(recorded, again, Group::asked, later, again.tick.force - recorded.tick.force,
              report.asked);
      if (report.sent_unchecked.empty())
        compare(recorded, again, Group::sent, later, again.force - recorded.force, report.sent);
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
