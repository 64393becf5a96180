// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/devices/hip_path.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <span>
#include <sstream>
#include <string_view>
#include <utility>

#include "palpate/kernel/core/csv.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/rotation.hpp"

namespace palpate {
namespace {

constexpr double farthest = 1e6;  // [m] where the renderer stops calling it a place
constexpr double longest = 1e6;   // [s] 10^9 ticks at 1 kHz
constexpr std::array<std::string_view, 8> columns{"t", "x", "y", "z", "qx", "qy", "qz", "qw"};
constexpr std::size_t still = 4;  // of them, of a hand that does not turn

// What is wrong with a sample after another one, or nothing.
std::string fault(const HipPath::Sample& sample, std::span<const HipPath::Sample> before) {
  if (!std::isfinite(sample.t)) return "t is not finite";
  if (!sample.hip.allFinite()) return "x, y or z is not finite";
  if (sample.hip.cwiseAbs().maxCoeff() > farthest) return "the position is beyond 1000 km";
  if (!is_rotation(sample.turn)) return "qx,qy,qz,qw is no unit quaternion";
  if (before.empty()) return {};
  if (!(sample.t > before.back().t)) return "t does not increase";
  if (sample.t - before.front().t > longest) return "the path is longer than 1000000 s";
  return {};
}

constexpr const char* fault_remedy = "give seconds and metres, in the order of time";

void check_not_empty(const std::vector<HipPath::Sample>& samples, const std::string& subject) {
  if (!samples.empty()) return;
  throw Error(subject, "it has no samples", "give a line 't,x,y,z' and one such line for each");
}

}  // namespace

HipPath HipPath::read_csv(const std::filesystem::path& file) {
  const std::string subject = file.string();
  std::ifstream in(file);
  std::error_code unused;
  if (!in || std::filesystem::is_directory(file, unused)) {
    throw Error(subject, "it cannot be read", "name a CSV file with the columns t,x,y,z");
  }
  return parse_csv(in, subject);
}

HipPath HipPath::parse_csv(std::istream& in, const std::string& name) {
  // The header says whether the hand turns: it is read twice.
  const std::string text(std::istreambuf_iterator<char>(in), {});
  std::istringstream whole(text);
  const std::string header = text.substr(0, text.find_first_of("\r\n"));
  const bool turns = header.find("qw") != std::string::npos;
  const auto wanted = std::span(columns).first(turns ? columns.size() : still);
  CsvColumns lines(whole, name, wanted);
  std::vector<Sample> samples;
  std::array<double, columns.size()> values{0, 0, 0, 0, 0, 0, 0, 1};
  while (lines.next(std::span(values).first(wanted.size()))) {
    Sample sample{values[0], Vec3(values[1], values[2], values[3]),
                  Rotation(values[7], values[4], values[5], values[6])};
    const std::string wrong = fault(sample, samples);
    if (!wrong.empty()) throw Error(lines.where(), wrong, fault_remedy);
    sample.turn.normalize();
    samples.push_back(sample);
  }
  check_not_empty(samples, name);
  return HipPath(std::move(samples));
}

HipPath::HipPath(std::vector<Sample> samples) : samples_(std::move(samples)) {
  check_not_empty(samples_, "HIP path");
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const std::string wrong = fault(samples_[i], std::span(samples_).first(i));
    if (!wrong.empty()) {
      throw Error("HIP path: sample " + std::to_string(i + 1), wrong, fault_remedy);
    }
    turns_ = turns_ || samples_[i].turn.w() != 1.0;
  }
}

HandPose HipPath::pose_at(double t) const noexcept {
  if (!(t > samples_.front().t)) return {samples_.front().hip, samples_.front().turn};
  if (t >= samples_.back().t) return {samples_.back().hip, samples_.back().turn};
  const auto next = std::upper_bound(samples_.begin(), samples_.end(), t,
                                     [](double time, const Sample& s) { return time < s.t; });
  const auto last = next - 1;
  const double share = (t - last->t) / (next->t - last->t);
  HandPose pose{last->hip + share * (next->hip - last->hip), last->turn};
  if (!turns_) return pose;
  // Between neighbours a straight line in quaternions turns nearly evenly, and needs no sine.
  const double sign = last->turn.dot(next->turn) < 0.0 ? -1.0 : 1.0;
  pose.orientation.coeffs() =
      (1.0 - share) * last->turn.coeffs() + share * sign * next->turn.coeffs();
  if (pose.orientation.norm() > 1e-6) pose.orientation.normalize();
  return pose;
}

ScriptedDevice::ScriptedDevice(HipPath path, bool repeat, std::string uri)
    : info_{.uri = std::move(uri), .kind = "scripted path", .limits = no_motors, .simulated = true},
      path_(std::move(path)),
      repeat_(repeat) {}

HandState ScriptedDevice::read(double t) noexcept {
  if (!began_) began_ = t;
  double along = t - *began_;
  const double length = path_.last_time() - path_.first_time();
  if (repeat_ && length > 0.0) along = std::fmod(along, length);
  const HandPose pose = path_.pose_at(path_.first_time() + along);
  HandState hand{.position = pose.position};
  if (path_.turns()) hand.orientation = Eigen::Quaterniond(pose.orientation);
  return hand;
}

}  // namespace palpate
