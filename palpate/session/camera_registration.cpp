// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/linear.hpp"
#include "palpate/session/registration.hpp"

namespace palpate {
namespace {

using Vec6 = Eigen::Matrix<double, 6, 1>;
using Mat6 = Eigen::Matrix<double, 6, 6>;

constexpr int samples = 8000;         // of the second image, about
constexpr int cells_across = 160;     // of the first image: where planes are fitted
constexpr double jump = 0.03;         // of the depth: beyond it lies another surface
constexpr double first_gate = 0.1;    // [m] between a point and its plane
constexpr double least_gate = 0.005;  // [m]
// By which the gate narrows with each step: fast, and the largest plane fits alone, while what
// stands on it is left out and so never moves to its place.
constexpr double narrowing = 0.93;
constexpr double tukey = 4.685;          // 95 % efficient on normal noise
constexpr int most_steps = 200;          // a rough start takes some 40
constexpr double settled = 1e-6;         // [m] of the last step
constexpr double least_overlap = 0.1;    // of the second image
constexpr double least_agreement = 0.5;  // of what lies within the first's view
constexpr double most_misfit = 0.01;     // of the distance: twice what stereo cameras have
// [-] of the weakest motion's information, 1/3 if planes face all ways: a thousandth of the points
// that face along a motion settle it. Noise makes one plane's normals look like its own variance.
constexpr double least_information = 1e-3;
constexpr double noise_margin = 4.0;  // times that variance: noise of pixels goes together

// [m, optical frame]
std::optional<Vec3> point_at(const DepthImage& image, int u, int v) {
  const Intrinsics& lens = image.intrinsics();
  if (u < 0 || v < 0 || u >= lens.width || v >= lens.height) return {};
  const double z = image.depth_at(u, v);
  const Eigen::Vector2d ray = image.rays().ray(u, v);
  if (z == 0.0 || !ray.allFinite()) return {};
  return Vec3(z * ray.x(), z * ray.y(), z);
}

struct Plane {
  Vec3 centre;  // [m, first camera]
  Vec3 normal;
  double variance;  // [rad^2] of the normal, about an axis
};

// Planes fitted to the first image, one for each cell of `size` pixels.
class Planes {
 public:
  explicit Planes(const DepthImage& image)
      : image_(image), size_(std::max(2, image.intrinsics().width / cells_across)) {
    columns_ = (image.intrinsics().width + size_ - 1) / size_;
    const int rows = (image.intrinsics().height + size_ - 1) / size_;
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns_; ++column)
        planes_.push_back(fit(column * size_ + size_ / 2, row * size_ + size_ / 2));
    }
  }
  // That of the pixel which sees a place. @param is_in_view  the image shows the place
  [[nodiscard]] const Plane* at(const Vec3& place, bool& is_in_view) const {
    is_in_view = false;
    if (place.z() < 0.05) return nullptr;
    const double pixels = 2.0 * place.z() / image_.intrinsics().fx;
    const ViewingRays::Window window = image_.rays().window(place, pixels);
    if (window.empty()) return nullptr;
    is_in_view = true;
    const int column = (window.u_begin + window.u_end) / 2 / size_;
    const int row = (window.v_begin + window.v_end) / 2 / size_;
    const auto& plane = planes_[static_cast<std::size_t>(row * columns_ + column)];
    return plane ? &*plane : nullptr;
  }

 private:
  [[nodiscard]] std::optional<Plane> fit(int u, int v) const {
    const auto middle = point_at(image_, u, v);
    if (!middle) return {};
    const int half = 2 * size_;
    const int stride = std::max(1, size_ / 2);
    int looked_at = 0;
    std::vector<Vec3> points;
    for (int y = v - half; y <= v + half; y += stride) {
      for (int x = u - half; x <= u + half; x += stride) {
        ++looked_at;
        const auto point = point_at(image_, x, y);
        if (point && std::abs(point->z() - middle->z()) < jump * middle->z())
          points.push_back(*point);
      }
    }
    if (4 * points.size() < 3 * static_cast<std::size_t>(looked_at)) return {};  // at an edge
    Vec3 mean = Vec3::Zero();
    for (const Vec3& point : points) mean += point / static_cast<double>(points.size());
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const Vec3& point : points) spread += (point - mean) * (point - mean).transpose();
    const Axes axes = axes_of(spread);
    if (axes.values[0] > 0.1 * axes.values[1]) return {};  // no plane
    const auto n = static_cast<double>(points.size());
    return Plane{mean, axes.vectors.col(0), axes.values[0] / (n - 3.0) / axes.values[1]};
  }

  const DepthImage& image_;
  int size_, columns_ = 0;
  std::vector<std::optional<Plane>> planes_;
};

// Points of the second image, away from its edges of depth.
std::vector<Vec3> sampled(const DepthImage& image) {
  const Intrinsics& lens = image.intrinsics();
  const int stride =
      std::max(1, static_cast<int>(std::sqrt(1.0 * lens.width * lens.height / samples)));
  std::vector<Vec3> points;
  for (int v = stride / 2; v < lens.height; v += stride) {
    for (int u = stride / 2; u < lens.width; u += stride) {
      const auto point = point_at(image, u, v);
      if (!point) continue;
      bool at_edge = false;
      for (const auto& [x, y] : {std::pair{u - 2, v}, {u + 2, v}, {u, v - 2}, {u, v + 2}}) {
        const auto beside = point_at(image, x, y);
        at_edge |= !beside || std::abs(beside->z() - point->z()) > jump * point->z();
      }
      if (!at_edge) points.push_back(*point);
    }
  }
  return points;
}

struct Pair {
  Vec3 place, normal;  // first camera
  double distance;     // [m] of the place in front of the plane
  double variance;     // [rad^2] of the normal
};

// The weighted normal equations of a step, about the pairs' centre.
struct Equations {
  Mat6 information = Mat6::Zero();  // turn in units of 1 / radius
  Vec6 gradient = Vec6::Zero();
  Vec3 centre = Vec3::Zero();
  double radius = 1.0;  // [m] root mean square of the pairs' distance from the centre
  double weights = 0.0, squares = 0.0, variances = 0.0;
  double deviation = 0.0;  // [m] robust, of the distances
};

// @param gate  [m] from which distance on pairs have no weight
Equations equations_of(const std::vector<Pair>& pairs, double gate) {
  Equations sum;
  std::vector<double> sizes;
  for (const Pair& pair : pairs) {
    sum.centre += pair.place / static_cast<double>(pairs.size());
    sizes.push_back(std::abs(pair.distance));
  }
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  sum.deviation = std::max(1.4826 * *middle, 1e-5);
  double squares = 0.0;
  for (const Pair& pair : pairs) squares += (pair.place - sum.centre).squaredNorm();
  sum.radius = std::max(std::sqrt(squares / static_cast<double>(pairs.size())), 1e-3);
  for (const Pair& pair : pairs) {
    const double share = pair.distance / gate;
    const double weight = (1.0 - share * share) * (1.0 - share * share);
    Vec6 row;
    row << (pair.place - sum.centre).cross(pair.normal) / sum.radius, pair.normal;
    sum.information += weight * row * row.transpose();
    sum.gradient += weight * pair.distance * row;
    sum.weights += weight;
    sum.variances += weight * pair.variance;
    sum.squares += weight * pair.distance * pair.distance;
  }
  return sum;
}

std::string in_words(const Vec3& axis) {
  const auto number = [](double value) {
    const int tenths = static_cast<int>(std::lround(10.0 * value));
    return std::string(tenths < 0 ? "-" : "") + std::to_string(std::abs(tenths) / 10) + "." +
           std::to_string(std::abs(tenths) % 10);
  };
  return "(" + number(axis.x()) + ", " + number(axis.y()) + ", " + number(axis.z()) + ")";
}

// [-] Of a motion that what both see determines.
double needed_information(const Equations& sum) {
  return least_information + noise_margin * sum.variances / sum.weights;
}

// The step that brings the surfaces together, without the motions that are left open: along these
// the start stays.
Vec6 step_of(const Equations& sum) {
  const Axes6 axes = axes_of_six(sum.information / sum.weights);
  Vec6 step = Vec6::Zero();
  for (int i = 0; i < 6; ++i) {
    const Vec6 motion = axes.vectors.col(i);
    const double information = axes.values[i];
    if (information > needed_information(sum))
      step -= motion.dot(sum.gradient) / (sum.weights * information) * motion;
  }
  return step;
}

// @throws Error if the geometry leaves a motion open.
void check_information(const Equations& sum) {
  const Axes6 axes = axes_of_six(sum.information / sum.weights);
  if (axes.values[0] > needed_information(sum)) return;
  const Vec6 weakest = axes.vectors.col(0);
  const bool turns = weakest.head<3>().norm() > weakest.tail<3>().norm();
  const Vec3 axis = (turns ? weakest.head<3>() : weakest.tail<3>()).normalized();
  throw Error(
      "the two cameras",
      std::string("the common view does not determine the ") +
          (turns ? "rotation about " : "translation along ") + in_words(axis) +
          " in the frame of the first camera",
      "place an object with faces in three directions, such as a box, in view of both cameras");
}

}  // namespace

double CameraFit::turn_deviation() const {
  return std::sqrt(axes_of(Eigen::Matrix3d(covariance.topLeftCorner<3, 3>())).values[2]);
}

double CameraFit::shift_deviation() const {
  return std::sqrt(axes_of(Eigen::Matrix3d(covariance.bottomRightCorner<3, 3>())).values[2]);
}

CameraFit register_cameras(const DepthImage& first, const DepthImage& second,
                           const Eigen::Isometry3d& start) {
  const Planes planes(first);
  const std::vector<Vec3> points = sampled(second);
  CameraFit fit;
  fit.first_from_second = start;
  Equations sum;
  double gate = first_gate;
  std::size_t in_view = 0;
  std::vector<Pair> pairs;
  for (int step = 0; step < most_steps; ++step) {
    pairs.clear();
    in_view = 0;
    for (const Vec3& point : points) {
      const Vec3 place = fit.first_from_second * point;
      bool is_in_view = false;
      const Plane* plane = planes.at(place, is_in_view);
      in_view += is_in_view ? 1 : 0;
      if (plane == nullptr) continue;
      const double distance = plane->normal.dot(place - plane->centre);
      if (std::abs(distance) < gate)
        pairs.push_back({place, plane->normal, distance, plane->variance});
    }
    if (static_cast<double>(pairs.size()) <
        std::max(least_overlap * static_cast<double>(points.size()), 50.0))
      throw Error("the two cameras", "the two views overlap too little",
                  "point both cameras at the same scene, or use a better initial estimate");
    sum = equations_of(pairs, gate);
    const Vec6 motion = step_of(sum);
    const Vec3 turn = motion.head<3>() / sum.radius;
    const double angle = turn.norm();
    Eigen::Isometry3d update = Eigen::Isometry3d::Identity();
    update.translate(sum.centre + motion.tail<3>());
    if (angle > 0.0) update.rotate(Eigen::AngleAxisd(angle, turn / angle));
    update.translate(-sum.centre);
    fit.first_from_second = update * fit.first_from_second;
    const double narrowest = std::min(std::max(tukey * sum.deviation, least_gate), gate);
    if (gate == narrowest && motion.norm() < settled) break;
    gate = std::max(narrowing * gate, narrowest);
  }
  fit.first_from_second.linear() =
      Eigen::Quaterniond(fit.first_from_second.linear()).normalized().toRotationMatrix();
  check_information(sum);
  const double agreement = static_cast<double>(pairs.size()) / static_cast<double>(in_view);
  if (agreement < least_agreement || sum.deviation > most_misfit * sum.centre.norm())
    throw Error("the two cameras",
                "their surfaces do not fit: " + std::to_string(std::lround(100.0 * agreement)) +
                    " % agree, to " + std::to_string(std::lround(1e3 * sum.deviation)) + " mm",
                "use an initial estimate accurate to 10 cm and 10 degrees, keep the scene at rest, "
                "and check the depth units");
  const double variance = sum.squares / std::max(sum.weights - 6.0, 1.0);
  const Axes6 axes = axes_of_six(sum.information);
  fit.covariance.setZero();
  for (int i = 0; i < 6; ++i) {
    Vec6 motion = axes.vectors.col(i);
    motion.head<3>() /= sum.radius;
    fit.covariance += variance / axes.values[i] * motion * motion.transpose();
  }
  fit.centre = sum.centre;
  fit.rms = std::sqrt(sum.squares / sum.weights);
  fit.overlap = static_cast<double>(pairs.size()) / static_cast<double>(points.size());
  return fit;
}

}  // namespace palpate
