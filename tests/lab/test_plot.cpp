// SPDX-License-Identifier: Apache-2.0
// Figures as SVG: what is in them, and where.
#include <cstdio>
#include <fstream>

#include "lab/experiment.hpp"
#include "lab/plot.hpp"
#include "lab/report.hpp"

#include "tests/lab/drawn.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate::lab {
namespace test_plot {

// Where a path begins anew [px]: of marks, each of them.
Points begins(const std::string& data) {
  Points found;
  for (std::size_t at = data.find('M'); at != std::string::npos; at = data.find('M', at + 1)) {
    double x = 0.0;
    double y = 0.0;
    EXPECT_EQ(std::sscanf(data.c_str() + at, "M%lf %lf", &x, &y), 2) << data;
    found.push_back({x, y});
  }
  return found;
}

// The paths of that name after those of the key.
std::vector<std::string> data_of(const Figure& figure, const std::string& name,
                                 std::size_t in_key) {
  std::vector<std::string> data;
  for (const DrawnPath& path : paths_of(svg(figure, "test")))
    if (path.name == name && in_key-- == 0) ++in_key, data.push_back(path.data);
  return data;
}

Panel ten_by_ten(std::vector<Series> series) {
  return {.x = {.low = 0.0, .high = 10.0},
          .y = {.low = 0.0, .high = 10.0},
          .series = std::move(series)};
}

TEST(Plot, HasEverySeriesWhateverItsNameAndItsKind) {
  Figure figure{{ten_by_ten({}), ten_by_ten({})}, 2};
  for (const Line line : {Line::solid, Line::dashed, Line::dotted, Line::steps, Line::none}) {
    for (int mark = line == Line::none ? 1 : 0; mark < 9; ++mark)
      figure.panels[mark % 2].series.push_back({"<a & 'b'> \"" + std::to_string(mark) + "\" µ",
                                                {{1.0, 2.0}, {3.0, 4.0}},
                                                line,
                                                static_cast<Mark>(mark)});
  }
  expect_drawn(figure);
}

TEST(Plot, PutsValuesWhereTheAxesSay) {
  Panel panel = ten_by_ten({{"", {{0, 1}, {5, 10}, {10, 100}}, Line::none, Mark::disc}});
  panel.y = {.log = true, .low = 1.0, .high = 100.0};
  const Points marks = begins(data_of({{panel}}, "", 0).at(0));
  ASSERT_EQ(marks.size(), 3U);
  EXPECT_EQ(marks[0][0], 0.0);
  EXPECT_EQ(marks[2][1], 0.0) << "the uppermost";
  EXPECT_NEAR(marks[1][0], 0.5 * marks[2][0], 0.1);
  EXPECT_NEAR(marks[1][1], 0.5 * marks[0][1], 0.1);
}

TEST(Plot, FitsAxesToTheirValuesAndRulesAcrossThem) {
  Panel panel{.series = {{"", {{-3.0, 7.0}, {1.0, 8.0}}, Line::none, Mark::dot},
                         {"rule", {{-anything, 7.5}, {anything, 7.5}}}}};
  const Figure figure{{panel}};
  const Points rule = begins(data_of(figure, "rule", 1).at(0));
  const Points marks = begins(data_of(figure, "", 0).at(0));
  ASSERT_EQ(marks.size(), 2U);
  EXPECT_EQ(rule, (Points{{0.0, rule[0][1]}}));
  EXPECT_NEAR(rule[0][1], 0.5 * (marks[0][1] + marks[1][1]), 0.1);
  EXPECT_GT(marks[0][0], 5.0) << "beside the frame";
}

TEST(Plot, InterruptsALineAndLeavesOutMarksBeyondTheAxes) {
  const Figure figure{{ten_by_ten(
      {{"", {{1, 1}, {2, 2}, {fitting, 3}, {4, 4}, {40, 40}}, Line::solid, Mark::cross}})}};
  const std::vector<std::string> paths = data_of(figure, "", 0);
  ASSERT_EQ(paths.size(), 2U) << "line and marks";
  EXPECT_EQ(begins(paths[0]).size(), 2U) << paths[0];
  EXPECT_EQ(begins(paths[1]).size(), 3U) << paths[1];
}

TEST(Plot, StepsGoAlongBeforeTheyGoUp) {
  const Figure figure{{ten_by_ten({{"", {{0, 0}, {10, 10}}, Line::steps}})}};
  const std::string data = data_of(figure, "", 0).at(0);
  const Points start = begins(data);
  EXPECT_NE(data.find(" " + std::to_string(static_cast<int>(start[0][1])) + "L", data.find('L')),
            std::string::npos)
      << data;
}

TEST(Plot, KeepsTheSpikesOfALongCurveAndLittleElse) {
  Series series{"", {}};
  for (int i = 0; i <= 10000; ++i) series.points.push_back({1e-3 * i, i == 4321 ? 10.0 : 5.0});
  const std::string data = data_of({{ten_by_ten({series})}}, "", 0).at(0);
  EXPECT_LT(data.size(), 100U) << data;
  EXPECT_NE(data.find(" 0L"), std::string::npos) << data;
}

TEST(Plot, NamesGroupsFromTheTopWithAMarkAMethod) {
  const Table table("t",
                    "method,family,v\na,one,1\na,two,2\nb,one,3\nb,two,nan\nb,three,4\nb,,5\n");
  const Panel panel = by_group(
      table, [&](std::size_t row) { return table.text(row, "family"); },
      [&](const std::vector<std::size_t>& rows) { return table.number(rows.front(), "v"); }, {});
  EXPECT_EQ(panel.y.names, (std::vector<std::string>{"one", "two", "three"}));
  ASSERT_EQ(panel.series.size(), 2U);
  EXPECT_EQ(panel.series[0].points, (Points{{1.0, 1.0}, {2.0, 2.0}}));
  EXPECT_EQ(panel.series[1].points.size(), 3U);
  const Figure figure{{panel}};
  const Points b = begins(data_of(figure, "b", 1).at(0));
  ASSERT_EQ(b.size(), 2U) << "one is not a number";
  EXPECT_LT(b[0][1], b[1][1]) << "three is below one";
}

TEST(Plot, OfEveryExperimentIsDrawnEvenOfNothing) {
  for (const Experiment& experiment : known_experiments()) {
    const Table empty(experiment.name, std::string(experiment.header) + "\n");
    EXPECT_NO_THROW(paths_of(svg(experiment.figure(empty), experiment.summary))) << experiment.name;
  }
}

TEST(Plot, DrawsTheFilesOfOtherVerbs) {
  const test::TemporaryFolder folder;
  const auto drawn = [&](const std::string& name, const std::string& text) {
    std::ofstream(folder.path() / name) << text;
    std::ifstream in(draw(folder.path() / name));
    return paths_of({std::istreambuf_iterator<char>(in), {}});
  };
  const auto growth = drawn("growth.csv",
                            "series,x,points,tick_us\ncameras,1,70,0.5\ncameras,2,140,0.9\n"
                            "focal_length,300,28,0.4\nunorganised,10000,70,0.5\n");
  EXPECT_EQ(growth.size(), 6U) << "three lines with their marks";
  const auto trace = drawn("press.csv",
                           "hip_x,hip_y,hip_z,proxy_y,proxy_z,force_x,force_y,force_z\n"
                           "0,1,2,1,3,0,3,4\n0,2,2,2,3,0,6,8\n");
  EXPECT_EQ(trace.size(), 6U) << "three curves, and in the key";
  EXPECT_TRUE(test::fails_saying([&] { return draw(folder.path() / "none.csv"); }, "none.csv",
                                 "no such file"));
  std::ofstream(folder.path() / "corner.csv") << "method\npaper\n";
  EXPECT_TRUE(test::fails_saying([&] { return draw(folder.path() / "corner.csv"); }, "corner",
                                 "did you mean 'corners'"));
}

}  // namespace test_plot
}  // namespace palpate::lab
