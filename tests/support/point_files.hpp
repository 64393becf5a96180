// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <random>
#include <span>
#include <string>
#include <string_view>

#include <gtest/gtest.h>

#include "palpate/io/sources/point_file.hpp"
#include "palpate/kernel/core/error.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/point_file_rules.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate::test {

using Parse = PointFile (*)(std::span<const std::byte>, std::string_view);

inline PointFile parse(Parse parser, std::string_view text) {
  return parser(std::as_bytes(std::span(text)), "test file");
}

/// The bytes of `value` in the given order.
template <class T>
std::string bytes_of(T value, std::endian order = std::endian::little) {
  std::string bytes(sizeof(T), '\0');
  std::memcpy(bytes.data(), &value, sizeof(T));
  if (order != std::endian::native) {
    std::reverse(bytes.begin(), bytes.end());
  }
  return bytes;
}

/// What must hold of any bytes whatever: an Error of one line, or a consistent cloud.
inline testing::AssertionResult is_error_or_consistent(Parse parser, std::string_view text) {
  try {
    if (!is_consistent(parse(parser, text), text.size())) {
      return testing::AssertionFailure() << "an inconsistent cloud";
    }
  } catch (const Error& error) {
    if (std::string_view(error.what()).find_first_of("\r\n") != std::string_view::npos) {
      return testing::AssertionFailure() << "more than one line: " << error.what();
    }
  }
  return testing::AssertionSuccess();
}

/// Checks that on `count` variants of a valid file, each with a few bytes changed.
inline void expect_defined_on_damage(Parse parser, const std::string& valid, int count) {
  std::mt19937 random(17);
  for (int i = 0; i < count; ++i) {
    std::string damaged = valid;
    for (auto changes = random() % 3 + 1; changes > 0; --changes) {
      damaged[random() % damaged.size()] = static_cast<char>(random());
    }
    ASSERT_TRUE(is_error_or_consistent(parser, damaged)) << i;
  }
}

/// A change of a file, and what the error about it says.
struct Refusal {
  std::string from, to, says;
};
inline void expect_refusals(Parse parser, const std::string& good,
                            std::span<const Refusal> refusals) {
  EXPECT_EQ(parse(parser, good).points.size(), 1U);
  for (const Refusal& each : refusals) {
    std::string bad = good;
    const std::size_t at = bad.find(each.from);
    ASSERT_NE(at, std::string::npos) << each.from;
    bad.replace(at, each.from.size(), each.to);
    EXPECT_TRUE(fails_saying([&] { return parse(parser, bad); }, "test file: ", each.says, "; "));
  }
}

/// A format of point files, as the tests that all of them must pass need it.
struct PointFormat {
  const char* name;
  Parse parser;
  PointFile (*read)(const std::filesystem::path&);
  std::array<const char*, 3> encodings;  ///< ascii first
  std::string (*valid_file)(const std::string& encoding);
  const char* before_last;  ///< before the last number of the valid ascii file
};
class PointFiles : public testing::TestWithParam<PointFormat> {};

/// The mean of a cloud's finite points.
inline Vec3 mean_of(const PointFile& cloud) {
  Vec3 sum = Vec3::Zero();
  double count = 0.0;
  for (const Vec3& point : cloud.points) {
    if (point.allFinite()) {
      sum += point;
      count += 1.0;
    }
  }
  return count == 0.0 ? sum : Vec3(sum / count);
}

}  // namespace palpate::test
