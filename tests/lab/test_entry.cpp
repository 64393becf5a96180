// SPDX-License-Identifier: Apache-2.0
// Entries of the bench: intervals against tables, the same bytes however they are made, what a
// check finds; and methods behind a pipe, good and bad ones.
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "lab/entry.hpp"
#include "lab/experiments/pop.hpp"
#include "lab/experiments/pop_cases.hpp"
#include "lab/pipe_method.hpp"
#include "lab/sha256.hpp"
#include "lab/statistics.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate::lab {
namespace test_entry {

namespace fs = std::filesystem;
using test::fails_saying;

std::string text_of(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

void write(const fs::path& file, const std::string& text) { std::ofstream(file) << text; }

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at))
    text.replace(at, from.size(), to), at += to.size();
  return text;
}

TEST(Intervals, AreWilsons) {  // Newcombe, Statistics in Medicine 17 (1998), table I
  const Interval some = wilson(81, 263);
  EXPECT_NEAR(some.low, 0.2553, 5e-5);
  EXPECT_NEAR(some.high, 0.3662, 5e-5);
  const Interval none = wilson(0, 20);
  EXPECT_EQ(none.low, 0.0);
  EXPECT_NEAR(none.high, 0.1611, 5e-5);
  EXPECT_NEAR(wilson(29, 29).low, 0.8830, 5e-5);
}

TEST(Intervals, OfAMeanNarrowWithTheRootOfTheirNumber) {
  const std::array four = {wilson(5, 5), wilson(5, 5), wilson(5, 5), wilson(5, 5)};
  const Interval mean = mean_of(four);
  EXPECT_EQ(mean.value, 1.0);
  EXPECT_EQ(mean.high, 1.0);
  EXPECT_NEAR(1.0 - mean.low, (1.0 - four[0].low) / 2.0, 1e-12);
}

TEST(Intervals, OfRepeatsAreStudents) {
  const Interval three = student(std::array{1.0, 2.0, 3.0});
  EXPECT_NEAR(three.value, 2.0, 1e-12);
  EXPECT_NEAR(three.high - three.value, 4.303 / std::sqrt(3.0), 1e-9);
  EXPECT_TRUE(std::isinf(student(std::array{1.0}).high));
}

TEST(Sha256, GivesTheStandardsExamples) {  // FIPS 180-4's examples, and nothing
  const auto of = [](std::string_view text) {
    Sha256 hash;
    hash.add(text);
    return hash.digest();
  };
  EXPECT_EQ(of("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(of("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(of(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  Sha256 parts;
  for (int i = 0; i < 1000; ++i) parts.add(std::string(1000, 'a'));
  EXPECT_EQ(parts.digest(), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(RealCases, FollowFromTheSeedAndTheRulerIsRightInAll) {
  const std::string uri = "synthetic:desk?sensor=d4xx&frames=4";
  const RealCases cases = draw_real_cases(uri, "desk", 3, 8);
  const RealCases other = draw_real_cases(uri, "desk", 4, 8);
  ASSERT_EQ(cases.cases.size(), 8U);
  EXPECT_EQ(cases.hash, other.hash);
  EXPECT_EQ(cases.cases[5].text, draw_real_cases(uri, "desk", 3, 6).cases[5].text);
  EXPECT_NE(cases.cases[5].text, other.cases[5].text);
  for (const RealCase& c : cases.cases) {
    const Judgement judgement = c.play("ideal", {});
    EXPECT_TRUE(judgement.held && judgement.right) << c.text;
  }
  EXPECT_FALSE(
      draw_real_cases("synthetic:plane?frames=2", "plane", 1, 4).cases[3].play("paper", {}).held)
      << "it loses what another patch sweeps over";
  EXPECT_TRUE(fails_saying(
      [] { return draw_real_cases("synthetic:plane?speed=0.3&frames=8", "plane", 1, 1); },
      "its camera moved", "at rest"));
}

class Entries : public ::testing::Test {
 protected:
  static EntryOptions small() {
    EntryOptions options;
    options.method = "fixed-step";
    options.seed = 7;
    options.cases = options.repeats = 1;
    options.recordings = {"synthetic:plane?sensor=d4xx&frames=2&size=320x240"};
    return options;
  }
  [[nodiscard]] fs::path file(const std::string& name) const { return folder_.path() / name; }
  [[nodiscard]] EntryCheck check(const fs::path& path, std::size_t sample) const {
    return check_entry(path, sample, 1, small().recordings, {}, {});
  }

 private:
  test::TemporaryFolder folder_;
};

TEST_F(Entries, AreTheSameFromThreadsAndHoldUntilTheyAreChanged) {
  const fs::path one = file("one.json");
  const std::string text = make_entry(small(), {{"date", "today"}}, {}, one);
  EXPECT_EQ(text, text_of(one));
  EXPECT_FALSE(fs::exists(file("one.json.part")));

  const fs::path two = file("two.json");
  const std::string command =
      std::string(PALPATE_PROGRAM) +
      " bench-entry fixed-step --seed 7 --cases 1 --repeats 1 --jobs 2 --recording '" +
      small().recordings.front() + "' --out " + two.string() + " >" + file("log").string() +
      " 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0) << text_of(file("log"));
  const auto without_run = [](const std::string& entry) {
    return entry.substr(0, entry.find(" \"run\""));
  };
  EXPECT_EQ(without_run(text_of(two)), without_run(text));
  EXPECT_NE(text_of(two), text) << "threads and cost are said";

  EXPECT_TRUE(check(one, 6).holds);
  const EntryCheck without = check_entry(one, 1, 1, {}, {}, {});
  EXPECT_TRUE(without.holds);
  EXPECT_EQ(without.left_out.size(), 1U);

  const fs::path changed = file("changed.json");
  write(changed, replaced(text, "\"held\": \"0\"", "\"held\": \"1\""));
  EntryCheck found = check(changed, 1);
  EXPECT_FALSE(found.holds);
  ASSERT_EQ(found.faults.size(), 1U);
  EXPECT_NE(found.faults[0].find("scores"), std::string::npos);

  write(changed, replaced(text, "\"seed\": 7", "\"seed\": 8"));
  EXPECT_FALSE(check(changed, 1).faults.empty()) << "other cases";

  write(changed, replaced(replaced(text, "\"right\": \"1\"", "\"right\": \"2\""),
                          "\"right\": \"0\"", "\"right\": \"1\""));
  found = check(changed, 15);
  EXPECT_GT(found.differences.size(), 1U);
  EXPECT_FALSE(found.holds);
}

TEST_F(Entries, SayWhatIsWrongWithThem) {
  const fs::path path = file("entry.json");
  EXPECT_TRUE(fails_saying([&] { return check(path, 1); }, "cannot be read", "bench-entry"));
  write(path, "{\"a\": ");
  EXPECT_TRUE(fails_saying([&] { return check(path, 1); }, "not a benchmark entry"));
  write(path, R"({"palpate_entry": 1, "method": "paper"})");
  EXPECT_TRUE(fails_saying([&] { return check(path, 1); }, "incomplete"));
  write(path, R"({"palpate_entry": 2})");
  EXPECT_TRUE(fails_saying([&] { return check(path, 1); }, "another version"));
  EntryOptions options = small();
  options.cases = 0;
  EXPECT_TRUE(fails_saying([&] { return make_entry(options, {}, {}, path); }, "--cases 0", "1 to"));
  options.method = "papr";
  EXPECT_TRUE(fails_saying([&] { return make_entry(options, {}, {}, path); }, "papr", "'paper'"));
}

// ---- Methods behind a pipe. ----

constexpr std::chrono::milliseconds soon(300);

std::unique_ptr<Method> pipe(const std::string& command,
                             std::chrono::milliseconds patience = std::chrono::minutes(1)) {
  return make_pipe_method("pipe:" + command, {}, patience);
}

// A program in Python that answers each TICK with a statement's `out`, nine numbers.
class Pipes : public ::testing::Test {
 protected:
  [[nodiscard]] std::string program(const std::string& statement) const {
    const fs::path path = folder_.path() / "method.py";
    write(path, R"(
import json, struct, sys, math
seat = frame = None
while True:
    head = sys.stdin.buffer.read(8)
    if len(head) < 8:
        break
    letters, size = struct.unpack("<4sI", head)
    data = sys.stdin.buffer.read(size)
    if letters == b"INIT":
        parameters = json.loads(data)
        sys.stdout.buffer.write(b"INIT" + struct.pack("<I", 0))
    elif letters == b"SEAT":
        seat = struct.unpack("<3d", data)
    elif letters == b"FRAM":
        frame = struct.unpack_from("<4d3I", data) + struct.unpack_from(f"<{len(data) // 4 - 11}f", data, 44)
    elif letters == b"TICK":
        t, *hip = struct.unpack("<4d", data)
        )" + statement +
                    R"(
        sys.stdout.buffer.write(b"TICK" + struct.pack("<I9d", 72, *out))
    sys.stdout.buffer.flush()
)");
    return "exec python3 " + path.string();
  }

 private:
  test::TemporaryFolder folder_;
};

Vec3 asked(Method& method, const Vec3& hip = Vec3(1, 2, 3), double t = 0.5) {
  const Tick tick = method.tick(hip, t);
  dynamic_cast<const LabMethod&>(method).rethrow();
  return tick.force;
}

TEST_F(Pipes, SendParametersSeatsFramesAndHips) {
  const auto method = pipe(program("out = [*hip, parameters['stiffness'], seat[1], t, 0, 0, 1]"));
  method->seat(Vec3(4, 5, 6));
  EXPECT_EQ(asked(*method), Vec3(600, 5, 0.5));

  const auto framed =
      pipe(program("out = [*hip, frame[0], frame[3], frame[4] * 100 + frame[5] * 10 + frame[6], "
                   "frame[-3], 0 if math.isnan(frame[7]) else 1, len(frame)]"));
  const DepthImage image(std::make_shared<const ViewingRays>(Intrinsics{2, 1, 1, 1, 0, 0, {}}),
                         std::vector<std::uint16_t>{0, 500}, 1000.0,
                         Eigen::Isometry3d(Eigen::Translation3d(0, 0, 7)));
  framed->observe({image, 0.25});
  const Tick tick = framed->tick(Vec3::Zero(), 1.0);
  EXPECT_EQ(tick.force, Vec3(0.25, 7, 212)) << "stamp, viewpoint, 2 x 1 pixels, 2 points";
  EXPECT_EQ(tick.normal, Vec3(0.5, 0, 13)) << "the second pixel's x, a hole before, all numbers";
  EXPECT_EQ(tick.state, ContactState::contact);
  EXPECT_EQ(tick.frame, 0);

  const std::vector<Vec3> points = {Vec3(0.125, 0, 0)};
  framed->observe({PointCloud(points, Vec3::Zero()), 0.5});
  EXPECT_EQ(asked(*framed).z(), 1) << "in no order, one point";
}

TEST_F(Pipes, ThatFailSayHow) {
  const auto fails = [&](const std::string& command, const std::string& how,
                         std::chrono::milliseconds patience = std::chrono::minutes(1)) {
    return fails_saying(
        [&] {
          const auto method = pipe(command, patience);
          asked(*method);
          return 0;
        },
        "pipe:", how);
  };
  EXPECT_TRUE(fails("", "no command"));
  EXPECT_TRUE(fails("exit 3", "status 3"));
  EXPECT_TRUE(fails("kill -SEGV $$", "signal 11"));
  EXPECT_TRUE(fails("echo Hello, world", "48 65 6c 6c"));
  EXPECT_TRUE(fails("exec sleep 60", "neither ends nor writes for 0.3 s", soon));
  EXPECT_TRUE(fails("exec <&- >&-; exec sleep 60", "closed its end"));
  EXPECT_TRUE(fails(program("sys.exit(4)"), "status 4"));
  EXPECT_TRUE(
      fails(program("print('debugging', t, flush=True); out = [0] * 9"), "print nothing else"));
  EXPECT_TRUE(fails(program("out = [math.nan] * 9"), "not finite"));
}

TEST_F(Pipes, ThatStopReadingAreGivenUp) {
  const auto method = pipe(R"(printf 'INIT\0\0\0\0'; exec sleep 60)", soon);
  const DepthImage image(
      std::make_shared<const ViewingRays>(Intrinsics{640, 480, 500, 500, 320, 240, {}}),
      std::vector<std::uint16_t>(std::size_t{640} * 480, 500), 1000.0);
  method->observe({image, 0.0});
  EXPECT_TRUE(fails_saying([&] { return asked(*method); }, "neither ends nor reads"));
  EXPECT_EQ(method->tick(Vec3::Zero(), 1.0).force, Vec3::Zero()) << "it is left alone from then on";
}

TEST(PipeExample, HoldsAPlane) {
  ExperimentOptions options;
  const std::string method = "pipe:exec python3 " PALPATE_SOURCES "/examples/pipe/cushion.py";
  const Judgement judgement =
      judge(method, parse_pop_case("pop:hold?noise=0&correlated=0&seconds=2&seed=1"), options);
  EXPECT_TRUE(judgement.held);
  EXPECT_TRUE(judgement.right);
  options.methods = {method};
  EXPECT_TRUE(fails_saying([&] { return methods_of(find_experiment("lift"), options); },
                           "only the methods of the lab", "bench-entry"));
}

}  // namespace test_entry
}  // namespace palpate::lab
