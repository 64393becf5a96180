// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <iterator>
#include <limits>
#include <new>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/core/registry.hpp"
#include "palpate/kernel/core/tick.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_tick {

TEST(Tick, IsAllZeroUnlessItIsSaidOtherwise) {
  // Left over memory must not shine through.
  alignas(Tick) unsigned char memory[sizeof(Tick)];
  std::fill(std::begin(memory), std::end(memory), 0xA5);
  const Tick& tick = *new (memory) Tick;
  EXPECT_TRUE(tick.hip.isZero(0.0) && tick.proxy.isZero(0.0));
  EXPECT_TRUE(tick.normal.isZero(0.0) && tick.force.isZero(0.0));
  EXPECT_EQ(tick.frame, -1);
}

TEST(Tick, NamesEveryFlagOnce) {
  std::vector<std::string> names;
  for (const FlagInfo& row : tick_flag_table()) {
    names.emplace_back(row.name);
    EXPECT_FALSE(row.meaning.empty()) << row.name;
  }
  EXPECT_EQ(names.size(), tick_flag_count);
  EXPECT_EQ(1U << (tick_flag_count - 1), std::uint32_t{returned_to_front});
  EXPECT_EQ(names.at(8), "surface_hidden");
  std::sort(names.begin(), names.end());
  EXPECT_EQ(std::unique(names.begin(), names.end()), names.end());
}

TEST(Tick, KnowsWhatCanBeAPlace) {
  constexpr double inf = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(is_place(Vec3(1e6, -1e6, 0)));
  EXPECT_FALSE(is_place(Vec3(1.1e6, 0, 0)));
  EXPECT_FALSE(is_place(Vec3(0, -inf, 0)));
  EXPECT_FALSE(is_place(Vec3(0, 0, std::numeric_limits<double>::quiet_NaN())));
}

struct Named {
  std::string name;
  int value = 0;
  std::string summary = {};
};

TEST(Registry, FindsByNameAndNamesTheNearestAndAllOthers) {
  Registry<Named> registry("fruit", ":", {{"apple", 1, "Bramley and others"}, {"pear", 2}});
  EXPECT_EQ(registry.find("pear").value, 2);
  EXPECT_EQ(registry.with_scheme("pear"), "pear:");
  EXPECT_EQ(registry.with_scheme("plum:x"), "plum:x");
  EXPECT_TRUE(
      test::fails_saying([&] { return registry.with_scheme("bramley"); }, "did you mean 'apple:'"));
  EXPECT_EQ(registry.try_find("plum"), nullptr);
  EXPECT_TRUE(test::fails_saying([&] { return registry.find("aple"); }, "'apple:'", "pear:"));
  EXPECT_TRUE(test::fails_saying([&] { return registry.find("aple", "aple:x"); }, "aple:x",
                                 "unknown fruit 'aple:'"));
}

TEST(Registry, IsAValueThatCanBeAddedToButNotTwice) {
  const Registry<Named> library("fruit", "", {{"apple", 1}});
  Registry<Named> mine = library;
  mine.add({"quince", 3});
  EXPECT_EQ(mine.entries().size(), 2U);
  EXPECT_EQ(library.entries().size(), 1U);
  EXPECT_TRUE(test::fails_saying(
      [&] {
        mine.add({"apple", 4});
        return 0;
      },
      "apple", "another name"));
  EXPECT_THROW(mine.add({"", 5}), Error);
}

}  // namespace test_tick
}  // namespace palpate
