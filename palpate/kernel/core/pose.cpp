// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/core/pose.hpp"

#include <array>
#include <charconv>
#include <cmath>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/rotation.hpp"

namespace palpate {

bool is_rigid(const Eigen::Isometry3d& pose, double tolerance) noexcept {
  const Eigen::Matrix3d rotation = pose.linear();
  return pose.matrix().allFinite() && pose.matrix().row(3) == Eigen::RowVector4d(0, 0, 0, 1) &&
         (rotation * rotation.transpose()).isIdentity(tolerance) && rotation.determinant() > 0.0;
}

void check_rigid(const Eigen::Isometry3d& pose, const std::string& subject) {
  if (is_rigid(pose)) return;
  throw Error(subject, "it is not a rotation and a translation",
              "give a right-handed rigid transform, with a quaternion of length 1");
}

Eigen::Isometry3d parse_pose(std::string_view text, const std::string& subject) {
  constexpr std::string_view separators = ", \t";
  constexpr double farthest = 1e6;  // [m]
  const char* const remedy = "give x,y,z,qx,qy,qz,qw: metres and a quaternion of length 1";
  std::array<double, 7> numbers{};
  std::size_t count = 0;
  std::string_view rest = text;
  for (;;) {
    const std::size_t begin = rest.find_first_not_of(separators);
    if (begin == std::string_view::npos) break;
    rest.remove_prefix(begin);
    const std::string_view word = rest.substr(0, rest.find_first_of(separators));
    rest.remove_prefix(word.size());
    double number = 0.0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
    if (error != std::errc{} || end != word.data() + word.size() || !std::isfinite(number))
      throw Error(subject, "'" + std::string(word) + "' is not a finite number", remedy);
    if (count < numbers.size()) numbers[count] = number;
    ++count;
  }
  if (count != numbers.size())
    throw Error(subject, std::to_string(count) + " numbers are no pose", remedy);
  const Eigen::Vector3d translation(numbers[0], numbers[1], numbers[2]);
  const Eigen::Quaterniond rotation(numbers[6], numbers[3], numbers[4], numbers[5]);
  if (translation.cwiseAbs().maxCoeff() > farthest)
    throw Error(subject, "the position is beyond 1000 km", remedy);
  if (!is_rotation(rotation))
    throw Error(subject, "the quaternion's length is " + shortest(rotation.norm()), remedy);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = rotation.normalized().toRotationMatrix();
  pose.translation() = translation;
  return pose;
}

std::string pose_text(const Eigen::Isometry3d& pose) {
  Eigen::Quaterniond q(pose.linear());
  q.normalize();
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  std::string text;
  for (const double number : {pose.translation().x(), pose.translation().y(),
                              pose.translation().z(), q.x(), q.y(), q.z(), q.w()}) {
    if (!text.empty()) text += ", ";
    text += shortest(number == 0.0 ? 0.0 : number);  // no -0
  }
  return text;
}

std::string shortest(double value) {
  std::array<char, 32> digits{};
  const auto [end, error] = std::to_chars(digits.data(), digits.data() + digits.size(), value);
  return {digits.data(), end};
}

}  // namespace palpate
