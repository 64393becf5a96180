// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/core/pose.hpp"

#include "robot/models.hpp"

namespace palpate::robot {

// The four blocks around the hole, which are all of the body, are written again.
std::string desk_model(double hole) {
  constexpr double half_x = 0.0575;  // [m] of the board
  constexpr double half_y = 0.04;    // [m]
  constexpr double half_z = 0.015;   // [m]
  const double half = 0.5 * hole;
  std::string geoms;
  const auto add = [&geoms](const char* name, double size_x, double size_y, double x, double y) {
    geoms += std::string("<geom name=\"board_") + name + R"(" type="box" size=")" +
             shortest(size_x) + " " + shortest(size_y) + " " + shortest(half_z) + R"(" pos=")" +
             shortest(x) + " " + shortest(y) + " " + shortest(half_z) + "\"/>\n";
  };
  add("left", 0.5 * (half_x - half), half_y, -0.5 * (half_x + half), 0.0);
  add("right", 0.5 * (half_x - half), half_y, 0.5 * (half_x + half), 0.0);
  add("near", half, 0.5 * (half_y - half), 0.0, -0.5 * (half_y + half));
  add("far", half, 0.5 * (half_y - half), 0.0, 0.5 * (half_y + half));
  std::string model(desk_model());
  const std::size_t begin = model.find("<geom name=\"board_left\"");
  const std::size_t end = model.find("</body>", begin);
  return model.replace(begin, end - begin, geoms);
}

}  // namespace palpate::robot
