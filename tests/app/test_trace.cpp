// SPDX-License-Identifier: Apache-2.0
// What `palpate trace` says of paths and frames that do not fit, and what it leaves when it is
// interrupted.
#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/app/program.hpp"

namespace palpate {
namespace test_trace {

using Place = Eigen::Vector3d;

class Trace : public test::Program {
 protected:
  // What is said besides the summary.
  [[nodiscard]] std::string remarks(const std::string& camera, const std::string& hand) const {
    const Outcome outcome = run("trace --out " + path("trace.csv") + " --camera '" + camera +
                                "' --path " + write("hand.csv", "t,x,y,z\n" + hand));
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return outcome.err;
  }

  std::string cloud(const std::string& name, const std::vector<Place>& points) const {
    std::ostringstream text;
    text.precision(17);
    text << "FIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nPOINTS " << points.size() << "\nDATA ascii\n";
    for (const Place& p : points) text << p.x() << ' ' << p.y() << ' ' << p.z() << '\n';
    return write(name, text.str());
  }
};

bool says(const std::string& text, const std::string& words) {
  return text.find(words) != std::string::npos;
}

// The number behind some words, without its unit.
double number_behind(const std::string& text, const std::string& words) {
  const std::size_t at = text.find(words);
  return at == std::string::npos ? std::numeric_limits<double>::quiet_NaN()
                                 : std::strtod(text.c_str() + at + words.size(), nullptr);
}

constexpr const char* floor_seen = "synthetic:tilt?slope=0deg&tilt=0deg&distance=0.5m&size=160x120";

TEST_F(Trace, SaysNothingOfAPathThatTouches) {
  EXPECT_EQ(remarks(floor_seen, "0,0,0,0.03\n0.3,0,0,-0.008\n0.6,0.02,0.01,-0.008\n"), "");
}

TEST_F(Trace, SaysHowNearAPathCameThatTouchedNothing) {
  // 3-4-5: from (0.3, 0, 0.6) to (0, 0, 1).
  const std::string points = "pcd:" + cloud("three.pcd", {{0, 0, 1}, {0, 0, 2}, {0.1, 0, 1.5}});
  const std::string aside = remarks(points, "0,3,0,0.6\n1,0.3,0,0.6\n");
  EXPECT_NEAR(number_behind(aside, "came no nearer than "), 500.0, 5.0) << aside;
  EXPECT_TRUE(says(aside, "the points then extended from (0, 0, 1) to (0.1, 0, 2) m")) << aside;
  EXPECT_TRUE(says(aside, "the path extends from (0.3, 0, 0.6) to (3, 0, 0.6) m")) << aside;
  EXPECT_TRUE(says(aside, "in metres and in the world frame?")) << aside;
  EXPECT_EQ(test::lines_in(aside), 1U) << aside;

  const std::string hovers = remarks(floor_seen, "0,0,0,0.06\n0.5,0.02,0,0.04\n");
  EXPECT_NEAR(number_behind(hovers, "came no nearer than "), 40.0, 1.0) << hovers;
  EXPECT_FALSE(says(hovers, "?")) << "there is no doubt about units: " << hovers;
}

TEST_F(Trace, GuessesWhichOfPathAndCloudIsInMillimetres) {
  const std::string large = remarks(floor_seen, "0,0,0,40\n0.2,0,0,20\n");
  EXPECT_TRUE(says(large, "is the path in millimetres?")) << large;
  EXPECT_NEAR(number_behind(large, "came no nearer than "), 20.0, 0.2) << large;
  const std::string points = cloud("millimetres.pcd", {{0, 0, 400}, {100, 0, 400}, {0, 100, 500}});
  const std::string hand = "0,0.01,0.01,0.4\n0.2,0.02,0.02,0.41\n";
  EXPECT_TRUE(says(remarks("pcd:" + points, hand), "is the cloud in millimetres?"));
  EXPECT_FALSE(says(remarks("pcd:" + points + "?scale=1mm", hand), "?"));
}

// Against every tick and every point.
TEST_F(Trace, FindsTheLeastDistanceToOnePercent) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> side(-0.5, 0.5);
  std::uniform_real_distribution<double> height(0.1, 0.4);
  std::vector<Place> points(300);
  for (Place& p : points) p = Place(side(random), side(random), -height(random));
  std::string hand;
  for (int i = 0; i < 12; ++i)
    hand += std::to_string(0.05 * i) + "," + std::to_string(side(random)) + "," +
            std::to_string(side(random)) + "," + std::to_string(height(random)) + "\n";
  const std::string said = remarks("pcd:" + cloud("random.pcd", points), hand);

  double least = std::numeric_limits<double>::infinity();
  std::istringstream rows(test::read(path("trace.csv")));
  std::string row;
  std::getline(rows, row);
  std::size_t ticks = 0;
  for (; std::getline(rows, row); ++ticks) {
    std::array<double, 4> numbers{};  // t and the HIP
    std::istringstream fields(row);
    std::string field;
    for (double& number : numbers) {
      std::getline(fields, field, ',');
      number = std::stod(field);
    }
    for (const Place& p : points)
      least = std::min(least, (p - Place(numbers[1], numbers[2], numbers[3])).norm());
  }
  EXPECT_EQ(ticks, 551U);
  EXPECT_NEAR(number_behind(said, "came no nearer than "), 1e3 * least, 0.015 * 1e3 * least)
      << said;
}

TEST_F(Trace, SaysThatFramesEndedBeforeThePath) {
  std::filesystem::create_directory(path("frames"));
  std::vector<Place> sheet;
  for (int i = 0; i < 49; ++i) sheet.emplace_back(0.002 * (i % 7 - 3), 0.002 * (i / 7 - 3), 0.0);
  for (const char* name : {"frames/0.pcd", "frames/1.pcd", "frames/2.pcd"}) cloud(name, sheet);
  const std::string frames = "pcd:" + path("frames") + "?fps=10";  // at 0, 0.1 and 0.2 s
  const std::string touching = ",0,0,0.02\n";
  const std::string end = ",0,0,-0.002\n";
  const std::string longer = remarks(frames, "0" + touching + "1" + end);
  EXPECT_TRUE(says(longer, frames + ": its frames ended at t = 0.200 s, 0.800 s before the path"))
      << longer;
  EXPECT_EQ(remarks(frames, "0" + touching + "0.38" + end), "")
      << "less than two frames' intervals";
  // A single frame is a still picture, however long it is touched.
  EXPECT_EQ(remarks("pcd:" + path("frames/0.pcd"), "0" + touching + "1" + end), "");
}

TEST_F(Trace, SaysWhyAPressIsHardlyFelt) {
  std::vector<Place> sheet;
  for (int i = 0; i < 100; ++i) sheet.emplace_back(0.03 * (i % 10 - 5), 0.03 * (i / 10 - 5), 0.5);
  const Outcome outcome =
      run("trace --out " + path("trace.csv") +
          " --set stiffness=100 --camera pcd:" + cloud("sparse.pcd", sheet) + " --press 320,240");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(says(outcome.err, "too sparse for any proxy")) << outcome.err;
  EXPECT_TRUE(says(outcome.err, "sparse.pcd?scale=0.1'")) << outcome.err;
  EXPECT_FALSE(says(outcome.err, "frames had stopped")) << outcome.err;
}

// A square of 31 x 31 points that a camera sees from 16 gaps away.
std::vector<Place> square(double gap) {
  std::vector<Place> points;
  for (int i = 0; i < 31 * 31; ++i)
    points.emplace_back(gap * (i % 31 - 15), gap * (i / 31 - 15), 16.0 * gap);
  return points;
}

TEST_F(Trace, TouchesSparsePointsByALargerProxyUnlessOneIsChosen) {
  const std::string press = "trace --out " + path("trace.csv") +
                            " --camera pcd:" + cloud("sheet.pcd", square(0.01)) +
                            " --press 325,245";  // between points
  const Outcome felt = run(press + " --json");
  ASSERT_EQ(felt.code, 0) << felt.err;
  EXPECT_GT(nlohmann::json::parse(felt.out)["max_force_asked"].get<double>(), 2.0);
  EXPECT_TRUE(says(felt.err, "the proxy has r_c = 10")) << felt.err;
  EXPECT_TRUE(says(felt.err, "--set r_c=0.005 sets the default")) << felt.err;
  const Outcome usual = run(press + " --set r_c=0.005");
  EXPECT_FALSE(says(usual.err, "the proxy has r_c")) << usual.err;
}

TEST_F(Trace, NamesTheScaleAtWhichPointsInMillimetresAreFelt) {
  const std::string camera = "pcd:" + cloud("millimetres.pcd", square(10.0));
  const std::string press = "trace --out " + path("trace.csv") + " --press 320,240 --camera ";
  const std::string scaled = camera + "?scale=0.001";
  const Outcome lost = run(press + camera + " --set stiffness=100");  // a point alone is felt
  EXPECT_TRUE(says(lost.err, "too sparse")) << lost.err;
  EXPECT_TRUE(says(lost.err, "give --camera '" + scaled + "' to touch it 300 mm long")) << lost.err;
  const Outcome felt = run(press + scaled + " --json");
  EXPECT_GT(nlohmann::json::parse(felt.out)["max_force_asked"].get<double>(), 2.0) << felt.err;
  const Outcome info = run("info --json " + camera);
  const nlohmann::json about = nlohmann::json::parse(info.out);
  EXPECT_EQ(about["first_frame"]["proposed_scale"], 1e-3);
  EXPECT_EQ(about["first_frame"]["extent_m"], 300.0);
  EXPECT_NEAR(about["first_frame"]["spacing_m"].get<double>(), 10.0, 2.0);
  EXPECT_TRUE(says(about["advice"].get<std::string>(), scaled)) << info.out;
}

TEST_F(Trace, SaysThatThePathBeganBeforeTheFrames) {
  const std::string early = remarks(floor_seen, "-0.5,0,0,0.03\n0.3,0,0,-0.004\n");
  EXPECT_TRUE(says(early, "no frame before t = 0.000 s: the path began 0.500 s earlier")) << early;
  EXPECT_EQ(test::lines_in(early), 1U) << early;
  const std::string over = remarks(floor_seen, "-2,0,0,0.03\n-1.5,0,0,-0.004\n");
  EXPECT_TRUE(says(over, "the first frame is at t = 0.000 s, the path ended at -1.500 s")) << over;
  EXPECT_EQ(test::lines_in(over), 1U) << over;
}

TEST_F(Trace, SaysThatThePathBeganInsideTheSurfaceOrOnIt) {
  const std::string inside = remarks(floor_seen, "0,0,0,-0.012\n0.1,0,0,-0.012\n");
  EXPECT_NEAR(number_behind(inside, "the path began inside, "), 12.0, 0.5) << inside;
  const std::string on_it = remarks(floor_seen, "0,0,0,0.003\n0.1,0,0,-0.002\n");
  EXPECT_NEAR(number_behind(on_it, "the path began in contact, "), 3.0, 0.5) << on_it;
  const std::string point = "pcd:" + cloud("point.pcd", {{0, 0, 1}, {0.3, 0, 1}});
  const std::string near = remarks(point, "0,0,0,1.002\n0.1,0,0,1.002\n");
  EXPECT_NEAR(number_behind(near, "the path began in contact, "), 2.0, 1e-3) << near;
  // Where the first frame comes later, that is when it counts.
  const std::string late = remarks(floor_seen, "-0.1,0,0,-0.012\n0.1,0,0,-0.012\n");
  EXPECT_NEAR(number_behind(late, "at the first frame, t = 0.000 s, the path was inside, "), 12.0,
              0.5)
      << late;
}

// The program writes into a pipe, so it cannot be through before the signal: a pipe holds far less
// than the trace.
TEST_F(Trace, LeavesWholeLinesAndASummaryWhenItIsInterrupted) {
  const std::string arguments =
      std::string("trace --camera '") + floor_seen + "' --path " +
      write("long.csv", "t,x,y,z\n0,0,0,0.03\n1,0,0,-0.004\n6,0.02,0,-0.004\n") + " --out ";
  const Outcome whole = run(arguments + path("whole.csv"));
  ASSERT_EQ(whole.code, 0) << whole.err;
  ASSERT_EQ(whole.err, "");

  auto* const before = std::signal(SIGINT, SIG_DFL);  // it may be ignored, as in the background
  const std::string command =
      "echo $$; exec " PALPATE_PROGRAM " " + arguments + "- 2>" + path("said");
  std::FILE* pipe = popen(command.c_str(), "r");  // NOLINT(cert-env33-c): a shell is wanted
  ASSERT_NE(pipe, nullptr);
  std::string text;
  std::array<char, 4096> bytes{};
  pid_t program = 0;
  while (const std::size_t count = std::fread(bytes.data(), 1, bytes.size(), pipe)) {
    text.append(bytes.data(), count);
    if (program != 0 || test::lines_in(text) < 3) continue;
    program = std::stoi(text);
    kill(program, SIGINT);
  }
  const int status = pclose(pipe);
  static_cast<void>(std::signal(SIGINT, before));

  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 128 + SIGINT);
  const std::string trace = text.substr(text.find('\n') + 1);
  const std::string all = test::read(path("whole.csv"));
  ASSERT_GT(trace.size(), 0U);
  EXPECT_EQ(trace.back(), '\n');
  EXPECT_LT(trace.size(), all.size());
  EXPECT_EQ(all.compare(0, trace.size(), trace), 0) << "it is not how the whole trace begins";
  const std::string said = test::read(path("said"));
  const std::string ticks = std::to_string(test::lines_in(trace) - 1);
  EXPECT_TRUE(says(said, "interrupted: standard output has " + ticks + " of 6001 ticks")) << said;
  EXPECT_TRUE(says(said, "the same command again")) << said;
  EXPECT_TRUE(says(said, "\n" + ticks + " ticks over ")) << said;
}

}  // namespace test_trace
}  // namespace palpate
