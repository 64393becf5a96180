// SPDX-License-Identifier: Apache-2.0
#include "palpate/record/replay.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/methods/methods.hpp"
#include "palpate/servo/free_side.hpp"

namespace palpate {
namespace {

bool same(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

bool same(const Vec3& a, const Vec3& b) {
  return same(a.x(), b.x()) && same(a.y(), b.y()) && same(a.z(), b.z());
}

// The field in which two ticks differ; empty if there is none. A recording that begins in the midst
// of a session has other numbers for its frames.
std::string difference(const Tick& a, const Tick& b) {
  if (!same(a.force, b.force)) return "force";
  if (!same(a.proxy, b.proxy)) return "proxy";
  if (!same(a.normal, b.normal)) return "normal";
  if (!same(a.surface_velocity, b.surface_velocity)) return "surface_velocity";
  if (a.state != b.state) return "state";
  if (a.steps != b.steps) return "steps";
  if (a.flags != b.flags) return "flags";
  return {};
}

// The method of a session, given again what it was given then.
class Rerun {
 public:
  Rerun(SessionReader& session, const ServoTick& first, const MethodRegistry& methods)
      : session_(session),
        methods_(methods),
        settings_number_(first.settings_number),
        settings_(session.settings(settings_number_)),
        method_(make_method(settings_.method, settings_.parameters, methods_)) {
    if (!session.info().seat) return;
    last_proxy_ = *session.info().seat;
    method_->seat(last_proxy_);
  }

  Tick tick(const ServoTick& recorded) {
    bool switched = (recorded.hand & method_switched) != 0 && ticks_ > 0;
    if (recorded.settings_number != settings_number_) {
      const std::string before = settings_.method;
      settings_number_ = recorded.settings_number;
      settings_ = session_.settings(settings_number_);
      switched = switched || settings_.method != before;
      if (!switched) method_->set_parameters(settings_.parameters);
    }
    if (switched) {
      method_ = make_method(settings_.method, settings_.parameters, methods_);
      method_->seat(last_proxy_);
      last_normal_ = Vec3::Zero();
      if (recorded.frame_number == frame_number_ && cloud_) method_->frame(*cloud_, stamp_);
    }
    ++ticks_;
    adopt(recorded.frame_number);
    if ((recorded.hand & proxy_reseated) != 0 && cloud_) {
      method_->seat(
          free_side(*cloud_, last_proxy_, last_normal_, settings_.parameters.proxy.r_c(), patch_));
    }
    Tick tick = method_->tick(recorded.tick.hip, recorded.tick.t);
    last_proxy_ = tick.proxy;
    last_normal_ = tick.normal;
    return tick;
  }

  [[nodiscard]] std::uint64_t frames() const { return frames_; }

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
      std::shared_ptr<const Cloud> cloud = session_.cloud(frame->second);
      stamp_ = frame->second.stamp;
      method_->frame(*cloud, stamp_);
      cloud_ = std::move(cloud);  // only now may the one before go
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
  std::shared_ptr<const Cloud> cloud_;
  double stamp_ = 0.0;  // [s] of cloud_
  Patch patch_;
  Vec3 last_proxy_ = Vec3::Zero();
  Vec3 last_normal_ = Vec3::Zero();
  std::uint64_t frames_ = 0;
};

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
  std::optional<Rerun> rerun;
  for (std::size_t i = 0; i < session.ticks(); ++i) {
    try {
      const ServoTick recorded = session.tick(i);
      if (last && recorded.number != last->number + 1) {
        report.broken_off = "ticks " + std::to_string(last->number + 1) + " to " +
                            std::to_string(recorded.number - 1) + " are missing";
        break;
      }
      if (!rerun) rerun.emplace(session, recorded, methods);
      const Tick again = rerun->tick(recorded);
      const std::string field = difference(again, recorded.tick);
      if (!field.empty()) {
        ++report.different_ticks;
        if (!report.first_difference) {
          report.first_difference = recorded.number;
          report.field = field;
        }
        const double distance = (again.force - recorded.tick.force).norm();
        report.largest_difference = std::max(report.largest_difference, distance);
      }
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
