// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/trajectory.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <nlohmann/json.hpp>

#include "palpate/io/sources/point_file_detail.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/pose.hpp"
#include "palpate/kernel/core/rotation.hpp"

namespace palpate {
namespace {

using nlohmann::json;

std::optional<double> to_finite(std::string_view token) {
  const std::optional<double> number = detail::to_number(token);
  return number && std::isfinite(*number) ? number : std::nullopt;
}

// A line's fields, separated by blanks; none of a comment or an empty line.
std::vector<std::string_view> fields_of(std::string_view line) {
  std::vector<std::string_view> fields;
  for (auto field = detail::next_token(line); !field.empty(); field = detail::next_token(line)) {
    if (fields.empty() && field.front() == '#') break;
    fields.push_back(field);
  }
  return fields;
}

// Calls visit(where, stamp, fields) for each line of `count` fields whose first is a stamp.
template <class Visit>
void for_each_stamped_line(std::string_view text, const std::string& name, std::size_t count,
                           const char* form, const Visit& visit) {
  std::optional<double> before;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(line.size() + 1, text.size()));
    const std::vector<std::string_view> fields = fields_of(line);
    if (fields.empty()) continue;
    const std::string where = name + ":" + std::to_string(number);
    const std::string remedy = std::string("a line is '") + form + "'";
    if (fields.size() != count)
      throw Error(
          where,
          "fields: " + std::to_string(fields.size()) + " instead of " + std::to_string(count),
          remedy);
    const std::optional<double> stamp = to_finite(fields[0]);
    if (!stamp) throw Error(where, "the timestamp is not a finite number", remedy);
    if (before && *stamp <= *before)
      throw Error(where,
                  *stamp < *before ? "the timestamp goes backwards" : "the timestamp repeats",
                  "timestamps must increase from line to line");
    before = stamp;
    visit(where, *stamp, fields);
  }
}

Eigen::Isometry3d parse_matrix(const json& rows, const std::string& where) {
  constexpr const char* remedy = "give four rows of four numbers, a rotation and a translation [m]";
  Eigen::Matrix4d matrix;
  const auto of_four = [](const json& array) { return array.is_array() && array.size() == 4; };
  bool numbers = of_four(rows);
  for (std::size_t i = 0; numbers && i < 4; ++i) {
    numbers = of_four(rows[i]);
    for (std::size_t j = 0; numbers && j < 4; ++j) {
      numbers = rows[i][j].is_number();
      if (numbers)
        matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
            rows[i][j].get<double>();
    }
  }
  if (!numbers) throw Error(where, "is not a matrix of 4x4 numbers", remedy);
  constexpr double rounding = 1e-3;  // of matrices written with few digits
  const Eigen::Isometry3d as_written(matrix);
  if (!is_rigid(as_written, rounding)) throw Error(where, "is not a rigid transform", remedy);
  const Eigen::Quaterniond rotation(as_written.linear());
  return Trajectory::Sample{0.0, as_written.translation(), rotation.normalized()}.pose();
}

}  // namespace

std::optional<Eigen::Isometry3d> Trajectory::at(double stamp) const {
  const auto after = std::upper_bound(samples_.begin(), samples_.end(), stamp,
                                      [](double t, const Sample& s) { return t < s.stamp; });
  const Sample* const a = after == samples_.begin() ? nullptr : &*(after - 1);
  const Sample* const b = after == samples_.end() ? nullptr : &*after;
  if (a != nullptr && b != nullptr && b->stamp - a->stamp <= gap_) {
    const double share = (stamp - a->stamp) / (b->stamp - a->stamp);
    return Sample{stamp, a->translation + share * (b->translation - a->translation),
                  a->rotation.slerp(share, b->rotation)}
        .pose();
  }
  if (a != nullptr && stamp - a->stamp <= tolerance) return a->pose();
  if (b != nullptr && b->stamp - stamp <= tolerance) return b->pose();
  return std::nullopt;
}

Trajectory parse_trajectory(std::string_view text, const std::string& name) {
  constexpr const char* form = "stamp tx ty tz qx qy qz qw";
  std::vector<Trajectory::Sample> samples;
  for_each_stamped_line(
      text, name, 8, form,
      [&](const std::string& where, double stamp, const std::vector<std::string_view>& fields) {
        std::array<double, 7> numbers{};
        for (std::size_t i = 0; i < numbers.size(); ++i) {
          const std::optional<double> number = to_finite(fields[i + 1]);
          if (!number)
            throw Error(where, "field " + std::to_string(i + 2) + " is not a finite number",
                        std::string("a line is '") + form + "'");
          numbers[i] = *number;
        }
        const auto [tx, ty, tz, qx, qy, qz, qw] = numbers;
        const Eigen::Quaterniond rotation(qw, qx, qy, qz);
        if (!is_rotation(rotation))
          throw Error(where, "the quaternion is not of length 1", "give qx qy qz qw of a rotation");
        samples.push_back({stamp, {tx, ty, tz}, rotation.normalized()});
      });
  if (samples.empty()) throw Error(name, "has no poses", std::string("a line is '") + form + "'");
  return Trajectory(std::move(samples));
}

std::vector<Eigen::Isometry3d> parse_pose_matrices(std::string_view text, const std::string& name) {
  constexpr const char* remedy = "give {\"world_from_camera\": [4x4 matrices]}";
  const json root = json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!root.is_object())
    throw Error(name, root.is_discarded() ? "is not valid JSON" : "is not a JSON object", remedy);
  std::vector<Eigen::Isometry3d> poses;
  bool found = false;
  for (const auto& [key, matrices] : root.items()) {
    const bool inverse = key.starts_with("camera_from_");
    if (!inverse && key != "world_from_camera") continue;
    if (found) throw Error(name, "has more than one array of poses", remedy);
    if (!matrices.is_array()) throw Error(name, json(key).dump() + " is not an array", remedy);
    found = true;
    for (const json& matrix : matrices) {
      const Eigen::Isometry3d given = parse_matrix(
          matrix, name + ": " + json(key).dump() + "[" + std::to_string(poses.size()) + "]");
      poses.push_back(inverse ? given.inverse() : given);
    }
  }
  if (!found) throw Error(name, "has neither world_from_camera nor camera_from_...", remedy);
  return poses;
}

std::vector<StampedFile> parse_image_list(std::string_view text, const std::string& name) {
  std::vector<StampedFile> images;
  for_each_stamped_line(
      text, name, 2, "stamp file",
      [&](const std::string& /*where*/, double stamp, const std::vector<std::string_view>& fields) {
        images.push_back({stamp, std::string(fields[1])});
      });
  if (images.empty()) throw Error(name, "lists no images", "a line is 'stamp file'");
  return images;
}

}  // namespace palpate
