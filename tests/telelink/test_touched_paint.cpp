// SPDX-License-Identifier: Apache-2.0
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/net/telelink/touched_paint.hpp"

namespace palpate {
namespace test_touched_paint {

const Vec3 here(0.1, 0.0, 0.03);

std::vector<std::string> painted(const Paint& paint) {
  std::vector<std::string> names;
  for (const Dab& dab : paint.dabs()) names.push_back(dab.material);
  return names;
}

TEST(PaintTouched, PaintsWhatIsSofterThanWhatIsRendered) {
  Paint paint;
  EXPECT_EQ(paint_touched(paint, {}, {.place = here, .stiffness = 300.0}), "");
  EXPECT_EQ(painted(paint), std::vector<std::string>{"touched 308 N/m"});
  // Twice is once, and what has become hard is no longer soft.
  EXPECT_EQ(paint_touched(paint, {}, {.place = here, .stiffness = 300.0}), "");
  EXPECT_EQ(painted(paint).size(), 1u);
  EXPECT_EQ(paint_touched(paint, {}, {.place = here, .stiffness = 601.0}),
            "ignored: it is not softer than the rendered stiffness");
  EXPECT_TRUE(painted(paint).empty());
  EXPECT_EQ(paint_touched(paint, {}, {.place = here, .friction = 0.42}), "");
  EXPECT_EQ(painted(paint), std::vector<std::string>{"touched friction 0.4"});
}

TEST(PaintTouched, LeavesWhatAPersonPainted) {
  Paint paint;
  paint.add({.place = here, .radius = 0.01, .material = "foam"});
  EXPECT_EQ(paint_touched(paint, {}, {.place = here, .stiffness = 300.0}),
            "ignored: a user has painted there");
  EXPECT_EQ(painted(paint), std::vector<std::string>{"foam"});
}

// Hazard: robot-lies
TEST(PaintTouched, IgnoresWhatCannotBeSaying) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  Paint paint;
  const auto after = [&](std::vector<double> data) {
    ros::Float64MultiArray message;
    message.data = std::move(data);
    return paint_touched(paint, {}, touched_of(message));
  };
  EXPECT_EQ(after({0.1, 0.0, 0.03, 0.0, 0.0, 1.0, 1e12, nan}), "stiffness is out of range");
  EXPECT_EQ(after({0.1, 0.0, 0.03, 0.0, 0.0, 1.0, -300.0, nan}), "stiffness is out of range");
  EXPECT_EQ(after({nan, 0.0, 0.03, 0.0, 0.0, 1.0, 300.0, nan}), "position is not finite");
  EXPECT_EQ(after({0.1, 0.0, 0.03, 0.0, 0.0, 1.0, nan, nan}),
            "contains neither stiffness nor friction");
  EXPECT_EQ(after({0.1}), "contains neither stiffness nor friction");
  EXPECT_TRUE(painted(paint).empty());
  EXPECT_EQ(after({0.1, 0.0, 0.03, 0.0, 0.0, 1.0, 300.0, 0.5}), "");
}

}  // namespace test_touched_paint
}  // namespace palpate
