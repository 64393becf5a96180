// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "palpate/io/sources/point_file_detail.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/mathematics.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace {

constexpr std::size_t fewest_points = 3;  // [-] as each has the error of one place

struct Reference {
  Eigen::Vector4d plane = Eigen::Vector4d::Zero();  // (n, d): n . place = d; zero: points
  std::vector<Vec3> points{};                       // [m, world]
};

Reference parse_reference(const std::string& text, const std::string& subject) {
  constexpr const char* remedy =
      "give plane:NX,NY,NZ,D or points:X,Y,Z;X,Y,Z;X,Y,Z in metres, in the world";
  const auto numbers = [&](const std::string& list, std::size_t count) {
    std::vector<double> all = detail::to_numbers(list, count);
    if (all.empty())
      throw Error(subject, "'" + list + "' is not " + std::to_string(count) + " numbers", remedy);
    return all;
  };
  const std::string kind = text.substr(0, text.find(':'));
  std::string rest = text.substr(std::min(kind.size() + 1, text.size()));
  Reference reference;
  if (kind == "plane") {
    reference.plane = Eigen::Vector4d(numbers(rest, 4).data());
    const double length = reference.plane.head<3>().norm();
    if (!(length > 0.0)) throw Error(subject, "its normal is zero", "give the plane's normal");
    reference.plane /= length;
  } else if (kind == "points") {
    for (std::size_t end = 0; end != std::string::npos; rest.erase(0, end + 1)) {
      end = rest.find(';');
      reference.points.emplace_back(numbers(rest.substr(0, end), 3).data());
      if (end == std::string::npos) break;
    }
    if (reference.points.size() < fewest_points)
      throw Error(subject, "points of it are too few", "give three or more, or a plane");
  } else {
    throw Error(subject, "'" + kind + "' is no reference", remedy);
  }
  return reference;
}

class ScaledSource final : public Source {
 public:
  ScaledSource(std::unique_ptr<Source> source, const std::string& reference, std::string uri)
      : source_(std::move(source)),
        reference_(parse_reference(reference, uri + ": option 'scale_reference'")),
        uri_(std::move(uri)) {
    look_at_info();
  }

  std::optional<Frame> next(double timeout) override {
    std::optional<Frame> frame = source_->next(timeout);
    if (!frame) return frame;
    const DepthImage* image = frame->cloud->image();
    if (image == nullptr)
      throw Error(uri_, "scale_reference= is for depth images, and its frames are points",
                  "leave it out");
    look(*image, frame->stamp);
    const bool is_sure = seen_ && frame->stamp - last_ <= patience && last_ - first_ >= settling;
    auto scaled = std::make_shared<DepthImage>(*image);
    scaled->rescale(scale_);
    scaled->set_scale_unsure(!is_sure);
    frame->cloud = std::move(scaled);
    look_at_info();
    info_.details += (info_.details.empty() ? "" : ", ") + std::string("depth times ") +
                     number_text(scale_) + (is_sure ? "" : ", in doubt");
    return frame;
  }
  std::size_t skip(std::size_t count) override { return source_->skip(count); }
  void cancel() noexcept override { source_->cancel(); }
  void follow(const Vec3& hand) override { source_->follow(hand); }
  // The reference is in the world that the poses are in.
  bool place(const Eigen::Isometry3d& pose, const std::string& uri) override {
    source_ = with_pose(std::move(source_), pose, uri);
    look_at_info();
    return true;
  }
  [[nodiscard]] const SourceInfo& info() const override { return info_; }

 private:
  static constexpr double noise = 0.01;        // [-] of depth (sd), as networks make it
  static constexpr double band = 5.0 * noise;  // [-] what is farther from the reference is not it
  static constexpr double first_band = 0.25;   // [-] by which the scale may be off at first
  static constexpr double widest_spread = 2.0 * noise;  // [-] (sd) of what belongs to one reference
  static constexpr double time_constant = 0.1;          // [s] a drift of 1 %/s lags by 0.1 %
  static constexpr double settling = 0.5;               // [s] seen for so long, the scale is sure
  static constexpr double patience = 0.2;               // [s] not seen for longer, it is in doubt
  static constexpr std::size_t most_pixels = 20000;     // [px] looked at
  static constexpr double least_share = 0.05;           // [-] of them that have to see the plane
  static constexpr double least_facing = 0.17;          // [-] of 80 degrees, under which it is seen
  static constexpr double spot = 0.01;  // [-] of its distance: the radius about a point

  void look_at_info() {
    info_ = source_->info();
    info_.uri = uri_;
    info_.notes.emplace_back("depth is brought to metres by ?scale_reference=");
  }

  // True depth over depth as read, of each pixel that may see the plane, or of each point.
  // @return how many have to be the reference
  std::size_t compare(const DepthImage& image) {
    ratios_.clear();
    const Eigen::Isometry3d& pose = image.world_from_camera();
    const Intrinsics& k = image.intrinsics();
    if (!reference_.points.empty()) {
      for (const Vec3& point : reference_.points) compare(image, pose.inverse() * point);
      return std::max(fewest_points, (reference_.points.size() + 1) / 2);
    }
    const Vec3 normal = pose.linear().transpose() * reference_.plane.head<3>();
    const double away = reference_.plane.w() - reference_.plane.head<3>().dot(pose.translation());
    const int stride = ViewingRays::Window{0, k.width, 0, k.height}.stride(most_pixels);
    std::size_t count = 0;
    for (int v = 0; v < k.height; v += stride) {
      for (int u = 0; u < k.width; u += stride, ++count) {
        const Vec3 ray = image.rays().ray(u, v).homogeneous();
        const double facing = normal.dot(ray);
        const double depth = image.depth_at(u, v);
        if (depth > 0.0 && facing * away > 0.0 && std::abs(facing) > least_facing * ray.norm())
          ratios_.push_back(away / facing / depth);
      }
    }
    return static_cast<std::size_t>(least_share * static_cast<double>(count)) + 1;
  }

  void compare(const DepthImage& image, const Vec3& point) {  // [m, optical frame]
    if (!(point.z() > 0.0)) return;
    const auto window = image.rays().window(point, spot * point.z());
    std::vector<double> depths;
    for (int v = window.v_begin; v < window.v_end; ++v)
      for (int u = window.u_begin; u < window.u_end; ++u)
        if (const double depth = image.depth_at(u, v); depth > 0.0) depths.push_back(depth);
    if (depths.empty()) return;
    std::sort(depths.begin(), depths.end());
    ratios_.push_back(point.z() / depths[depths.size() / 2]);
  }

  // Brings the scale up to date, if the reference is seen.
  void look(const DepthImage& image, double stamp) {
    if (seen_ && !(stamp >= last_)) seen_ = false;
    const std::size_t enough = compare(image);
    std::sort(ratios_.begin(), ratios_.end());
    using At = std::vector<double>::const_iterator;
    const auto within = [&](double centre, double width) {
      return std::pair<At, At>(
          std::lower_bound(ratios_.begin(), ratios_.end(), centre * (1.0 - width)),
          std::upper_bound(ratios_.begin(), ratios_.end(), centre * (1.0 + width)));
    };
    auto [begin, end] = seen_ ? within(scale_, band) : within(1.0, first_band);
    if (!seen_) {  // where most of them are alike
      const auto all = std::pair(begin, end);
      end = begin;
      auto last = begin;
      for (auto first = all.first; first != all.second; ++first) {
        while (last != all.second && *last <= *first * (1.0 + 2.0 * band)) ++last;
        if (last - first > end - begin) std::tie(begin, end) = std::pair(first, last);
      }
    }
    const auto count = static_cast<std::size_t>(end - begin);
    if (count < enough) return;
    const auto at = [&, first = begin](std::size_t percent) {
      return *(first + static_cast<std::ptrdiff_t>(percent * (count - 1) / 100));
    };
    if (at(84) - at(16) > 2.0 * widest_spread * at(50)) return;
    if (!seen_ || stamp - last_ > patience) first_ = stamp;
    const double share = seen_ ? -math::expm1((last_ - stamp) / time_constant) : 1.0;
    scale_ += share * (at(50) - scale_);
    last_ = stamp;
    seen_ = true;
  }

  std::unique_ptr<Source> source_;
  Reference reference_;
  std::string uri_;
  SourceInfo info_;
  std::vector<double> ratios_;
  double scale_ = 1.0;
  bool seen_ = false;
  double first_ = 0.0, last_ = 0.0;  // [s] since when the reference is seen, and when last
};

}  // namespace

std::unique_ptr<Source> with_scale_reference(std::unique_ptr<Source> source,
                                             const std::string& reference, std::string uri) {
  return std::make_unique<ScaledSource>(std::move(source), reference, std::move(uri));
}

}  // namespace palpate
