// SPDX-License-Identifier: Apache-2.0
// The program as a user meets it: exit codes, messages, files.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <qrencode.h>
#include <sys/wait.h>
#include <unistd.h>

#include "app/opened_scenes.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/pose.hpp"
#include "palpate/kernel/core/vectorise.hpp"

#include "tests/app/program.hpp"
#include "tests/support/depth_pngs.hpp"
#include "tests/support/environment.hpp"
#include "tests/support/mcap.hpp"

namespace palpate {
namespace test_program {

namespace fs = std::filesystem;
using test::lines_in;
using test::Program;
using test::read;

// Tests of what `palpate` hands over to the programs beside it.
class ProgramWithLab : public Program {
  void SetUp() override {
    if (!PALPATE_WITH_LAB) GTEST_SKIP() << "this build has no palpate-lab and palpate-bench";
  }
};

constexpr const char* plane = "'synthetic:plane?noise=0.5mm&seed=3&size=320x240'";

TEST_F(Program, TracesTheSameBytesEveryTime) {
  const std::string arguments = std::string("trace --camera ") + plane + " --path " + press();
  const Outcome first = run(arguments + " --out " + path("a.csv"));
  const Outcome second = run(arguments + " --out " + path("b.csv"));
  ASSERT_EQ(first.code, 0) << first.err;
  ASSERT_EQ(second.code, 0) << second.err;
  const std::string trace = read(path("a.csv"));
  EXPECT_EQ(trace, read(path("b.csv")));
  EXPECT_EQ(trace.substr(0, trace.find('\n')),
            "t,hip_x,hip_y,hip_z,proxy_x,proxy_y,proxy_z,normal_x,normal_y,normal_z,"
            "force_x,force_y,force_z,state,steps,surface_velocity,frame,flags");
  EXPECT_EQ(lines_in(trace), 1002U) << "1001 ticks from 0 to 1 s, and the header";
  EXPECT_NE(trace.find(",contact,"), std::string::npos);
}

TEST_F(Program, TakesTheNoiseThatIsUsualForACamerasKindUnlessItIsSet) {
  const auto trace = [&](const std::string& camera, const std::string& settings) {
    const Outcome outcome = run("trace --camera 'synthetic:plane?size=160x120&sensor=" + camera +
                                "' --path " + press() + settings);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return outcome.out;
  };
  const std::string as_stereo = " --set usual_noise=0.005 --set noise_growth=2";
  EXPECT_EQ(trace("ideal&noise=2mm", ""), trace("ideal&noise=2mm", as_stereo)) << "nobody says";
  const std::string usual = trace("tof", "");
  EXPECT_EQ(usual, trace("tof", " --set usual_noise=0.005 --set noise_growth=1"));
  EXPECT_NE(usual, trace("tof", as_stereo));
}

TEST_F(Program, AdoptsAFrameAtTheFirstTickAtOrAfterItsStamp) {
  const Outcome outcome = run(std::string("trace --camera ") + plane + " --path " + press());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  std::istringstream lines(outcome.out);
  std::string line;
  std::getline(lines, line);
  for (int tick = 0; std::getline(lines, line); ++tick) {
    const std::size_t flags = line.rfind(',');
    const std::size_t frame = line.rfind(',', flags - 1);
    // Frame k is stamped k/30 s.
    EXPECT_EQ(std::stoi(line.substr(frame + 1, flags - frame - 1)), tick * 30 / 1000)
        << "tick " << tick;
  }
}

TEST_F(Program, SummarisesATraceForPrograms) {
  const Outcome outcome = run(std::string("trace --json --camera ") + plane + " --path " + press() +
                              " --out " + path("t.csv"));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto summary = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(summary["ticks"], 1001);
  EXPECT_EQ(summary["frames"], 31);
  EXPECT_EQ(summary["pop_throughs"], 0);
  EXPECT_GT(summary["max_force_asked"], 1.0);
}

TEST_F(Program, SetsParametersFromAFileAndFromTheCommandLine) {
  const std::string config = write("c.toml", "method = \"paper\"\n[parameters]\nstiffness = 100\n");
  const std::string base = std::string("trace --json --camera ") + plane + " --path " + press() +
                           " --out " + path("t.csv") + " --config " + config;
  const auto soft = nlohmann::json::parse(run(base).out);
  const auto hard = nlohmann::json::parse(run(base + " --set stiffness=400").out);
  EXPECT_NEAR(hard["max_force_asked"].get<double>() / soft["max_force_asked"].get<double>(), 4.0,
              1e-9);
}

// A device that lies in the scene turned by 90 degrees about z, at (0.1, 0.2, 0.3).
std::array<double, 3> on_device(double x, double y, double z) {
  return {y - 0.2, -(x - 0.1), z - 0.3};
}

TEST_F(Program, PrintsASessionThatReadsBackTheSame) {
  const std::string options =
      " --camera synthetic:plane --device hand:?device=touch --device-pose 0.1,0.2,0.3,0,0,0,1"
      " --scale 2 --clutch-button 1 --limit max_device_force=1.5 --set stiffness=400 --rate 2000"
      " --method paper --port 0 --no-browser --without-watchdog";
  const Outcome first = run("run --print-config" + options);
  ASSERT_EQ(first.code, 0) << first.err;
  EXPECT_NE(first.out.find("scale = 2.0"), std::string::npos) << first.out;
  EXPECT_NE(first.out.find("max_device_force = 1.5"), std::string::npos) << first.out;
  EXPECT_NE(first.out.find("without_watchdog = true"), std::string::npos) << first.out;
  const Outcome again = run("run --print-config --config " + write("s.toml", first.out));
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_EQ(again.out, first.out);
  const Outcome other = run("run --print-config --scale 3 --config " + path("s.toml"));
  EXPECT_NE(other.out.find("scale = 3.0"), std::string::npos) << "options come after the file";
  const Outcome placed = run("run --print-config --device-pose " + path("s.toml"));
  EXPECT_NE(placed.out.find("world_from_device = [0.1, 0.2, 0.3, 0, 0, 0, 1]"), std::string::npos);
  expect_refusal("run --limit max_fore=1", {"max_fore"});
  expect_refusal("run --limit max_device_force", {"--limit", "NAME=VALUE"});
  expect_refusal("run --limit max_device_force=99", {"max_device_force", "out of range"});
  expect_refusal("run --device-pose 1,2,3", {"--device-pose", "x,y,z,qx,qy,qz,qw"});
  expect_refusal("run --device-pose nowhere.toml", {"nowhere.toml", "no such file"});
  expect_refusal("run --scale 0", {"scale"});
  expect_refusal("run --clutch-button 40", {"--clutch-button", "0 to 31"});
  expect_refusal("run --config " + write("k.toml", "\n[safety]\nswig = 1\n"),
                 {"k.toml:3", "did you mean 'swing'"});
}

TEST_F(Program, KeepsTheLimitsItIsGiven) {
  const std::string base =
      "run --headless --json --duration 4 --camera 'synthetic:plane?size=160x120'";
  const auto usual = nlohmann::json::parse(run(base).out);
  const auto low = nlohmann::json::parse(run(base + " --limit max_device_force=0.5").out);
  EXPECT_GT(usual["max_force_sent"].get<double>(), 0.6);
  EXPECT_LE(low["max_force_sent"].get<double>(), 0.5 + 1e-12);
}

TEST_F(Program, CalibratesADeviceFromPairs) {
  std::string pairs = "dx,dy,dz,wx,wy,wz\n";
  const double points[][3] = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, {0, 0, 0.1}};
  for (const auto& w : points) {
    const auto d = on_device(w[0], w[1], w[2]);
    for (const double number : {d[0], d[1], d[2], w[0], w[1]})
      pairs += std::to_string(number) + ",";
    pairs += std::to_string(w[2]) + "\n";
  }
  const std::string out = write("session.toml", "# mine\nmethod = \"paper\"  # the old one\n");
  const Outcome outcome =
      run("calibrate --json --pairs " + write("pairs.csv", pairs) + " --out " + out);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_LT(json["rms_m"].get<double>(), 1e-9);
  EXPECT_EQ(json["residuals_m"].size(), 4U);
  const std::string written = read(out);
  EXPECT_EQ(written.find("# mine\nmethod = \"paper\"  # the old one\n"), 0U) << written;
  EXPECT_NE(written.find("world_from_device = [0.1"), std::string::npos) << written;
  EXPECT_EQ(run("run --print-config --config " + out).code, 0);

  expect_refusal("calibrate", {"--at", "--points", "--pairs"});
  expect_refusal("calibrate --pairs " + write("two.csv", "dx,dy,dz,wx,wy,wz\n0,0,0,0,0,0\n"),
                 {"too few"});
  expect_refusal("calibrate --pairs " + write("bad.csv", "dx,dy,dz,wx,wy,wz\n0,0,0,0,0\n"),
                 {"bad.csv: line 2"});
  expect_refusal("calibrate --at 1,2", {"--device"});
}

TEST_F(Program, CalibratesADeviceThatTouchesPixels) {
  // The device touches what the camera sees at these pixels, resting a second at each.
  const std::string camera = "'synthetic:tilt?slope=20deg&tilt=0deg&distance=0.5m&size=64x48'";
  std::string script = "t,x,y,z\n0,0,0,0\n";
  std::string pixels;
  int t = 1;
  for (const char* pixel : {"10,10", "50,12", "30,40", "20,30"}) {
    const auto at =
        nlohmann::json::parse(run("info " + camera + " --json --at " + pixel).out)["at"];
    const auto& w = at["in_world_m"];
    const auto d = on_device(w[0].get<double>(), w[1].get<double>(), w[2].get<double>());
    for (int rest = 0; rest < 2; ++rest, ++t) {
      script += std::to_string(t);
      for (const double number : d) script += "," + std::to_string(number);
      script += "\n";
    }
    pixels += std::string(" --at ") + pixel;
  }
  const std::string base = "calibrate --camera " + camera +
                           " --device script:" + write("touch.csv", script) + pixels + " --out " +
                           path("new.toml");
  const Outcome outcome = run(base + " --json");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_LT(nlohmann::json::parse(outcome.out)["rms_m"].get<double>(), 2e-3);
  EXPECT_NE(outcome.err.find("1 of 4: touch pixel 10,10"), std::string::npos) << outcome.err;
  EXPECT_NE(read(path("new.toml")).find("[placement]\nworld_from_device = ["), std::string::npos);

  fs::remove(path("new.toml"));
  const Outcome strict = run(base + " --max-residual 1e-9");
  EXPECT_EQ(strict.code, 2) << strict.err;
  EXPECT_NE(strict.err.find("--max-residual"), std::string::npos) << strict.err;
  EXPECT_FALSE(fs::exists(path("new.toml")));
}

TEST_F(Program, CalibratesTwoCameras) {
  const std::string desk = "synthetic:desk?size=320x240&noise=1mm";
  const std::string turned = desk + "&seed=7&azimuth=30deg";
  const auto pose_of = [](const std::string& uri) {
    const Frame frame = *open_source(uri)->next();
    return dynamic_cast<const DepthImage&>(*frame.cloud).world_from_camera();
  };
  const Eigen::Isometry3d truth = pose_of(turned);
  Eigen::Isometry3d rough = pose_of(desk).inverse() * truth;
  rough.translation() += Vec3(0.05, -0.03, 0.04);
  const std::string base = "calibrate --cameras '" + desk + "' '" + turned + "'";
  const Outcome outcome = run(base + " --json --start='" + pose_text(rough) + "'");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  const auto pose = json["world_from_second"].get<std::string>();
  const Eigen::Isometry3d found = parse_pose(pose.substr(1, pose.size() - 2), "the pose");
  EXPECT_LT((found.translation() - truth.translation()).norm(), 3e-3);
  EXPECT_LT(json["shift_deviation_m"], 1e-3);
  const Outcome text = run(base + " --start='" + pose_text(rough) + "'");
  EXPECT_EQ(run("run --headless --duration 0.1 --config " + write("two.toml", text.out)).code, 0)
      << text.out << text.err;
  expect_refusal(base, {"--start", "10 cm"});
  // A pose in the second camera's URI is where to start from, and does not stay in it.
  const Eigen::Isometry3d start = pose_of(desk) * rough;
  const Outcome posed =
      run("calibrate --cameras '" + desk + "' '" + turned + "&pose=" + pose_text(start) + "'");
  EXPECT_EQ(posed.code, 0) << posed.err;
  EXPECT_NE(posed.out.find("uri = \"" + turned + "\"\n"), std::string::npos) << posed.out;
  expect_refusal("calibrate --cameras '" + desk + "'", {"--cameras", "two cameras, not 1"});
}

TEST_F(Program, TracesAPressOnAPixel) {
  const std::string base =
      std::string("trace --camera ") + plane + " --json --out " + path("p.csv");
  const Outcome press = run(base + " --press 160,120");
  ASSERT_EQ(press.code, 0) << press.err;
  const auto summary = nlohmann::json::parse(press.out);
  EXPECT_GT(summary["max_force_asked"].get<double>(), 2.0);
  EXPECT_LT(summary["max_force_asked"].get<double>(), 8.0);
  EXPECT_EQ(summary["pop_throughs"], 0);
  const auto light = nlohmann::json::parse(run(base + " --press 160,120 --press-depth 0.002").out);
  EXPECT_LT(light["max_force_asked"].get<double>(), 2.0);
  const Outcome slide = run(base + " --press 160,120 --slide-to 200,120");
  ASSERT_EQ(slide.code, 0) << slide.err;
  EXPECT_GT(nlohmann::json::parse(slide.out)["ticks"], summary["ticks"]);
  expect_refusal(base, {"--path", "--press"});
  expect_refusal(base + " --press 320", {"--press", "320,240"});
  expect_refusal(base + " --press 9999,0", {"pixel 9999,0", "outside"});
  expect_refusal(base + " --press 1,1 --press-depth 5", {"press depth", "0.1"});
  expect_refusal(base + " --slide-to 1,1 --path " + this->press(), {"--slide-to", "--press"});
}

TEST_F(Program, RunsHeadlessOnTheSyntheticDesk) {
  const Outcome outcome = run("run --headless --json --duration 4");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto summary = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(summary["ticks"], 4000);
  EXPECT_NEAR(summary["frames"].get<double>(), 120.0, 1.0);
  EXPECT_GT(summary["contact_ticks"], 1000);
  EXPECT_EQ(summary["pop_throughs"], 0);
  for (const char* key : {"late_ticks", "max_force_asked", "max_force_sent", "duration_s"})
    EXPECT_TRUE(summary.contains(key)) << key;
}

// A grid of points 4 mm apart, 0.5 m away.
TEST_F(Program, TouchesAFileThatIsNamedAlone) {
  std::string points;
  for (int v = -25; v <= 25; ++v) {
    for (int u = -25; u <= 25; ++u)
      points += std::to_string(0.004 * u) + " " + std::to_string(0.004 * v) + " 0.5\n";
  }
  const std::string file = write("grid.pcd",
                                 "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
                                 "WIDTH 2601\nHEIGHT 1\nPOINTS 2601\nDATA ascii\n" +
                                     points);
  const Outcome outcome = run(file + " --headless --duration 4 --json");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_GT(nlohmann::json::parse(outcome.out)["contact_ticks"], 500);
}

// Live, so by the wall clock: what is told at the end is of the kind that a headless run tells.
TEST_F(Program, RunsALiveSessionAndSaysWhereItsPageIs) {
  const Outcome outcome =
      run("run --json --duration 1.5 --port 0 --no-browser --device hand: "
          "--camera synthetic:plane?size=160x120 --set stiffness=300");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("open http://127.0.0.1:"), std::string::npos) << outcome.err;
  const auto summary = nlohmann::json::parse(outcome.out);
  EXPECT_GT(summary["ticks"], 100);
  EXPECT_GT(summary["frames"], 3);
  for (const char* key :
       {"late_ticks", "pop_throughs", "max_force_asked", "max_force_sent", "duration_s"})
    EXPECT_TRUE(summary.contains(key)) << key;
}

TEST_F(ProgramWithLab, RunsALiveSessionWithAMethodOfTheLab) {
  const std::string live =
      "run --json --duration 1.5 --port 0 --no-browser --device hand: "
      "--camera synthetic:plane?size=160x120 --method ";
  const Outcome outcome = run(live + "direct");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("direct is a method of the lab"), std::string::npos) << outcome.err;
  const auto summary = nlohmann::json::parse(outcome.out);
  EXPECT_GT(summary["ticks"], 100);
  EXPECT_GT(summary["max_force_asked"], 0.1) << "the hand presses within the first second";
  expect_refusal(live + "ideal", {"ideal", "no such method"});
}

TEST_F(Program, MakesATokenForOtherMachines) {
  const Outcome outcome =
      run("run --duration 0.2 --port 0 --no-browser --listen 0.0.0.0 "
          "--camera synthetic:plane?size=160x120");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("/?token="), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("unencrypted"), std::string::npos) << outcome.err;
}

TEST_F(Program, PrintsTheAddressesThatOthersReach) {
  const std::vector<std::string> addresses = app::reachable_addresses("0.0.0.0");
  const Outcome outcome =
      run("run --duration 0.2 --port 0 --no-browser --listen 0.0.0.0 --token for-the-phones "
          "--camera synthetic:plane?size=160x120");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  for (const std::string& address : addresses) {
    in_addr number{};
    ASSERT_EQ(inet_pton(AF_INET, address.c_str(), &number), 1) << address;
    EXPECT_NE(ntohl(number.s_addr) >> 24U, 127U) << address;
    const std::string said = "or a phone, open http://" + address + ":";
    EXPECT_NE(outcome.err.find(said), std::string::npos) << outcome.err;
  }
  EXPECT_EQ(addresses.empty(), outcome.err.find("no network address") != std::string::npos);
  EXPECT_EQ(outcome.err.find("\x1b["), std::string::npos) << "a code where no terminal is";
  EXPECT_EQ(app::reachable_addresses("::1"), std::vector<std::string>{"[::1]"});
}

// The modules of a code that was drawn, true where it is dark.
std::vector<std::vector<bool>> modules_of(const std::string& drawn) {
  std::vector<std::vector<bool>> modules;
  std::istringstream lines(drawn);
  for (std::string line; std::getline(lines, line);) {
    line = line.substr(8, line.size() - 12);  // without the colours
    std::vector<bool> upper;
    std::vector<bool> lower;
    while (!line.empty()) {
      const std::string character = line.substr(0, line[0] == ' ' ? 1 : 3);
      upper.push_back(character == " " || character == "▄");
      lower.push_back(character == " " || character == "▀");
      line.erase(0, character.size());
    }
    modules.push_back(upper);
    modules.push_back(lower);
  }
  return modules;
}

TEST(QrCode, HasItsQuietZoneAndItsFinderPatterns) {
  const auto modules = modules_of(app::qr_code("http://192.168.1.20:8642/?token=0123456789abcdef"));
  const std::size_t size = modules[0].size();
  ASSERT_EQ(size % 4, (4 * 4 + 1 + 2 * 4) % 4) << "a code has 4 V + 17 modules a side";
  ASSERT_EQ(modules.size(), size + 1) << "two modules a line, of an odd number";
  for (std::size_t i = 0; i < size; ++i) {
    EXPECT_FALSE(modules[3][i] || modules[size - 4][i] || modules[i][3] || modules[i][size - 4]);
  }
  const std::size_t far = size - 4 - 7;
  for (const auto& [top, left] : {std::pair{4UL, 4UL}, {4UL, far}, {far, 4UL}}) {
    for (std::size_t i = 0; i < 7; ++i) {
      for (std::size_t j = 0; j < 7; ++j) {
        const std::size_t ring = std::min({i, j, 6 - i, 6 - j});
        EXPECT_EQ(modules[top + i][left + j], ring != 1) << top << ' ' << left;
      }
    }
  }
  EXPECT_EQ(app::qr_code(std::string(5000, 'x')), "");
}

TEST(QrCode, HoldsItsTextAsTheLibraryEncodesIt) {
  const std::string link = "http://192.168.1.20:8642/?token=0123456789abcdef";
  const std::unique_ptr<QRcode, decltype(&QRcode_free)> code(
      QRcode_encodeString8bit(link.c_str(), 0, QR_ECLEVEL_L), QRcode_free);
  ASSERT_NE(code, nullptr);
  const auto modules = modules_of(app::qr_code(link));
  const auto width = static_cast<std::size_t>(code->width);
  ASSERT_EQ(modules[0].size(), width + 8) << "four modules of quiet zone at each side";
  for (std::size_t row = 0; row < width; ++row) {
    for (std::size_t column = 0; column < width; ++column)
      EXPECT_EQ(modules[row + 4][column + 4], (code->data[row * width + column] & 1U) != 0)
          << row << ' ' << column;
  }
}

// In a terminal, of which util-linux's `script` makes one.
TEST_F(Program, DrawsTheLinkThatAPhoneOpens) {
  if (app::reachable_addresses("0.0.0.0").empty()) GTEST_SKIP() << "there is no network address";
  if (run("-qec true /dev/null", "", "script").code != 0)
    GTEST_SKIP() << "there is no `script`, or no terminal that it could make";
  const Outcome outcome = run("-qec '" PALPATE_PROGRAM
                              " run --duration 0.2 --port 0 --no-browser --listen 0.0.0.0 "
                              "--camera synthetic:plane?size=160x120' " +
                                  path("typescript"),
                              "", "script");
  ASSERT_EQ(outcome.code, 0) << outcome.out;
  const std::string words = "or a phone, open ";
  std::string link;
  std::string drawn;
  std::istringstream lines(outcome.out);
  for (std::string line; std::getline(lines, line);) {
    std::erase(line, '\r');
    const std::size_t at = line.find(words);
    if (at != std::string::npos && link.empty()) link = line.substr(at + words.size());
    if (line.starts_with("\x1b[97;40m")) drawn += line + "\n";
  }
  ASSERT_NE(link.find("/?token="), std::string::npos) << outcome.out;
  EXPECT_EQ(drawn, app::qr_code(link)) << outcome.out;
}

TEST_F(Program, RemembersTheFilesThatWereOpenedLast) {
  const test::Environment state("XDG_STATE_HOME", path("state"));
  const std::string cup = write("cup.ply", "ply");
  {
    app::OpenedScenes opened(path("temporary"));
    EXPECT_TRUE(opened.uris().empty());
    opened.add("synthetic:desk");
    opened.add("ply:" + cup + "?scale=1mm");
    opened.add("pcd:" + path("gone.pcd"));
    opened.add("ply:" + path("temporary") + "-x/1/dropped.ply");
    opened.add("ply:" + cup);
    EXPECT_EQ(opened.uris(), (std::vector<std::string>{"ply:" + cup, "ply:" + cup + "?scale=1mm"}));
    opened.remove("ply:" + cup);
  }
  EXPECT_EQ(read(path("state/palpate/opened")),
            "pcd:" + path("gone.pcd") + "\nply:" + cup + "?scale=1mm\n");
  EXPECT_EQ(app::OpenedScenes().uris(), std::vector<std::string>{"ply:" + cup + "?scale=1mm"});
}

TEST_F(Program, PrintsTheOperatorsLinkAndTheViewers) {
  const std::string session =
      "run --duration 0.2 --port 0 --no-browser --camera synthetic:plane?size=160x120 ";
  const Outcome made = run(session);
  ASSERT_EQ(made.code, 0) << made.err;
  EXPECT_NE(made.err.find("/?token="), std::string::npos) << made.err;
  EXPECT_NE(made.err.find("controlling the HIP, open http://127.0.0.1:"), std::string::npos)
      << made.err;
  const Outcome given = run(session, "PALPATE_OPERATOR_TOKEN=from-outside ");
  EXPECT_NE(given.err.find("/?token=from-outside in a browser"), std::string::npos) << given.err;
}

TEST_F(Program, TellsWhatIsInASource) {
  const Outcome outcome = run("info synthetic:plane --json");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto about = nlohmann::json::parse(outcome.out);
  EXPECT_GT(about["first_frame"]["measured_percent"], 90.0);
  EXPECT_FALSE(about.contains("sensor"));
  EXPECT_EQ(about["usual_noise"], "5 mm at 1 m, growing with the square of distance");
  const auto light =
      nlohmann::json::parse(run("info 'synthetic:plane?sensor=tof&size=64x48' --json").out);
  EXPECT_EQ(light["sensor"], "time of flight");
  EXPECT_EQ(light["usual_noise"], "5 mm at 1 m, growing with distance");
}

TEST_F(Program, InfoSaysWhatIsAtAPixel) {
  const Outcome outcome =
      run("info 'synthetic:tilt?slope=20deg&tilt=0deg&distance=0.5m&size=64x48' --json --at 31,23");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto at = nlohmann::json::parse(outcome.out)["at"];
  // Straight down onto a plane that rises along x by 20 degrees; 0.5 px off the image's middle.
  EXPECT_NEAR(at["depth_m"].get<double>(), 0.5, 0.01);
  EXPECT_NEAR(at["in_camera_m"][2].get<double>(), at["depth_m"].get<double>(), 1e-12);
  EXPECT_NEAR(at["in_world_m"][2].get<double>(), 0.5 - at["depth_m"].get<double>(), 1e-9);
  EXPECT_NEAR(at["normal"][0].get<double>(), -std::sin(0.349), 0.02);
  EXPECT_NEAR(at["normal"][2].get<double>(), std::cos(0.349), 0.02);
  EXPECT_EQ(at["neighbours"], 48);
  EXPECT_EQ(at["neighbours_measured"], 48);
  const std::string small = "info 'synthetic:plane?size=64x48'";
  const Outcome text = run(small + " --at 0,0");
  EXPECT_NE(text.out.find("at:\n  pixel: [0,0]\n"), std::string::npos) << text.out;
  expect_refusal(small + " --at 64,0", {"pixel 64,0", "64x48", "0 to 63"});
  expect_refusal(small + " --at=-1,0", {"pixel -1,0"});
  expect_refusal(small + " --at 3", {"--at", "'3'", "column and row, such as 320,240"});
  expect_refusal(small + " --at 3,4x", {"--at", "3,4x"});
  const std::string points = write("two.pcd", "FIELDS x y z\nPOINTS 2\nDATA ascii\n0 0 1\n0 0 2\n");
  expect_refusal("info pcd:" + points + " --at 0,0", {"not an image", "--at"});
}

TEST_F(ProgramWithLab, TouchesTheFacesOfAPlyFile) {
  // Two triangles of 200 mm about the origin, seen from above: no point within 100 mm of the hand.
  const std::string points =
      "element vertex 4\nproperty float x\nproperty float y\n"
      "property float z\n";
  const std::string corners = "-0.1 -0.1 0\n0.1 -0.1 0\n0.1 0.1 0\n-0.1 0.1 0\n";
  const std::string mesh = write("mesh.ply", "ply\nformat ascii 1.0\n" + points +
                                                 "element face 1\n"
                                                 "property list uchar int vertex_indices\n"
                                                 "end_header\n" +
                                                 corners + "4 0 1 2 3\n");
  const Outcome info = run("info --json ply:" + mesh);
  ASSERT_EQ(info.code, 0) << info.err;
  EXPECT_EQ(nlohmann::json::parse(info.out)["first_frame"]["triangles"], 2);
  const std::string touch = "trace --json --path " + press() + " --out " + path("trace.csv");
  const auto held = [&](const std::string& method) {
    const Outcome trace = run(touch + " --camera ply:" + mesh + " --method " + method);
    EXPECT_EQ(trace.code, 0) << trace.err;
    return nlohmann::json::parse(trace.out)["max_force_asked"].get<double>();
  };
  for (const char* method :
       {"god-object", "god-object-kept", "sphere-proxy", "sphere-proxy-kept", "force-shading"})
    EXPECT_NEAR(held(method), 600.0 * 0.008, 1e-3) << method;
  for (const char* method : {"sight", "paper", "surfels"})
    EXPECT_NEAR(held(method), 600.0 * 0.008, 0.1) << method << ": by the points on the faces";
  const std::string bare =
      write("points.ply", "ply\nformat ascii 1.0\n" + points + "end_header\n" + corners);
  expect_refusal(touch + " --camera ply:" + bare + " --method god-object", {"faces"});
  expect_refusal(
      "run --no-browser --duration 1 --device 'mouse:?x=0&y=0&z=0.05' --method "
      "god-object --camera ply:" +
          bare,
      {"faces"});
}

TEST_F(Program, SaysWhichFramesOfARecordingItLeavesOut) {
  fs::create_directory(path("tum"));
  write("tum/0.png", test::png_of(1, 1, 16, test::grey, std::string("\0\x10\x00", 3)));
  write("tum/intrinsics.json",
        R"({"width": 1, "height": 1, "fx": 1, "fy": 1, "cx": 0, "cy": 0,
            "depth_units_per_metre": 1000})");
  write("tum/depth.txt", "100 0.png\n101 0.png\n");
  write("tum/groundtruth.txt", "101 0 0 0 0 0 0 1\n");
  const std::string note = "1 of 2 frames are dropped";
  const Outcome info = run("info --json tum:" + path("tum"));
  ASSERT_EQ(info.code, 0) << info.err;
  const auto about = nlohmann::json::parse(info.out);
  EXPECT_EQ(about["start_time_s"], 101.0);
  EXPECT_EQ(about["notes"][0].get<std::string>().substr(0, note.size()), note);
  const Outcome trace = run("trace --camera tum:" + path("tum") + " --path " + press());
  EXPECT_EQ(trace.code, 0);
  EXPECT_NE(trace.err.find(": " + note), std::string::npos) << trace.err;
}

TEST_F(ProgramWithLab, MeasuresItselfBesideWhatOneCouldUseInstead) {
  const Outcome outcome = run("bench --quick --json");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  for (const char* key : {"step_us_median", "tick_us_median", "tick_us_p999", "frame_us_median",
                          "kdtree_query_us_median", "kdtree_build_us_median"})
    EXPECT_GT(json.at(key).get<double>(), 0.0) << key;
  for (const auto& scene : json.at("scenes")) {
    const auto& search = scene.at("search");
    ASSERT_GE(search.size(), 4U);  // and PCL's, where it is installed
    // All search the same ball; on its rim they may round differently.
    for (const auto& method : search)
      EXPECT_NEAR(method.at("found").get<int>(), search.back().at("found").get<int>(), 2)
          << method.at("method");
    EXPECT_GT(search[0].at("found"), 0);
    EXPECT_GT(scene.at("kernel").at("steps_per_tick"), 0.1) << "the hand does not touch";
  }
}

TEST_F(ProgramWithLab, WritesHowATicksCostGrows) {
  const Outcome outcome = run("bench --quick --growth --out " + path("growth"));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::string csv = read(path("growth/growth.csv"));
  for (const char* series :
       {"image_width,", "focal_length,", "cameras,", "frame_rate,", "depth_mm,", "unorganised,"})
    EXPECT_NE(csv.find(series), std::string::npos) << series;
}

TEST_F(Program, SaysHowToGetWhatTheProgramsBesideItHave) {
  const std::string alone = path("palpate");
  std::filesystem::copy_file(PALPATE_PROGRAM, alone);
  for (const auto& [arguments, words] :
       {std::pair<std::string, std::vector<std::string>>{"eval flat", {"eval", "palpate-lab"}},
        {"bench --help", {"bench", "palpate-bench"}},
        {"run --headless --method god-object", {"god-object", "palpate-lab", "scripts/run"}}}) {
    const Outcome outcome = run(arguments, "", alone);
    EXPECT_EQ(outcome.code, 2) << arguments;
    EXPECT_EQ(lines_in(outcome.err), 1U) << outcome.err;
    for (const std::string& word : words)
      EXPECT_NE(outcome.err.find(word), std::string::npos) << word << " is not in " << outcome.err;
  }
  EXPECT_EQ(run("methods --names", "", alone).out, "paper paper-as-printed fixed-step sight\n");
}

TEST_F(ProgramWithLab, HandsOverToTheProgramsBesideIt) {
  EXPECT_NE(run("eval --list-methods").out.find("god-object"), std::string::npos);
  EXPECT_NE(run("bench --help").out.find("--growth"), std::string::npos);
  expect_refusal("eval info", {"experiment 'info'"});  // though a verb has that name
  expect_refusal("eval flat bund", {"did you mean 'bound'"});
}

TEST_F(Program, SuggestsTheWordThatWasMeant) {
  expect_refusal("trcae", {"trcae", "did you mean 'trace'"});
  expect_refusal(std::string("trace --camra x --path ") + press(), {"--camera"});
  expect_refusal(
      std::string("trace --camera ") + plane + " --path " + press() + " --set stifness=3",
      {"stifness", "did you mean 'stiffness'"});
  expect_refusal(std::string("trace --camera ") + plane + " --path " + press() + " --method papr",
                 {"papr", "paper"});
  expect_refusal("info sinthetic:plane", {"sinthetic", "synthetic"});
  expect_refusal("info 'synthetic:plan'", {"plan"});
  expect_refusal("info 'synthetic:plane?nois=1mm'", {"nois", "noise"});
}

TEST_F(ProgramWithLab, RefusesRecordingsThatAnExperimentCannotTake) {
  expect_refusal("eval lift --recording tum:there", {"--recording", "lift"});
  expect_refusal("eval real lift --recording tum:there", {"--recording", "lift"});
  expect_refusal("eval real --recording tum:nowhere", {"nowhere"});
}

// The commands of a page of the documentation: its blocks of `sh`, one after the other.
std::string commands_of(const fs::path& page) {
  std::istringstream lines(read(page));
  std::string commands;
  bool in_block = false;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("```")) {
      in_block = line == "```sh";
    } else if (in_block) {
      commands += line + "\n";
    }
  }
  return commands;
}

// How many of them call the program, which each does at the beginning of a line.
std::size_t calls_in(const std::string& commands) {
  std::istringstream lines(commands);
  std::size_t calls = 0;
  for (std::string line; std::getline(lines, line);)
    calls += line.starts_with("scripts/run") || line.starts_with("palpate ") ? 1 : 0;
  return calls;
}

// In a folder for each page, with a scripts/run that calls the program as that one does, and by its
// own name. Sessions are shortened, and those with a page end by themselves; `bench` has a test of
// its own. What needs hardware, minutes or files of the reader's is no block of `sh`.
TEST_F(ProgramWithLab, RunsTheCommandsOfTheReadmeAndTheDocs) {
  const test::Environment state("XDG_STATE_HOME", path("state"));
  const fs::path sources = PALPATE_SOURCES;
  std::vector<fs::path> pages = {sources / "README.md"};
  for (const char* folder : {"docs", "docs/tutorial"})
    for (const auto& file : fs::directory_iterator(sources / folder))
      if (file.path().extension() == ".md") pages.push_back(file.path());
  std::sort(pages.begin(), pages.end());
  std::vector<std::string> run_of;
  for (const fs::path& page : pages) {
    const std::string commands = commands_of(page);
    if (commands.empty()) continue;
    const std::string name = page.stem().string();
    run_of.push_back(name);
    const fs::path folder = path(name);
    fs::create_directories(folder / "scripts");
    std::ofstream(folder / "scripts/run")
        << "#!/bin/bash\n"
           "if [[ ${1-} == -* || $# == 0 ]]; then set -- run \"$@\"; fi\n"
           "words=()\n"
           "for word in \"$@\"; do\n"
           "  if [[ ${last-} == --duration ]]; then word=0.5; fi\n"
           "  last=$word words+=(\"$word\")\n"
           "done\n"
           "if [[ $1 == run && $* != *--headless* && $* != *--print-config* ]]; then\n"
           "  if [[ $* == *--record* ]]; then seconds=1; else seconds=0.3; fi\n"
           "  words+=(--duration $seconds --port 0 --no-browser)\n"
           "fi\n"
           "if [[ $1 == bench ]]; then words+=(--help); fi\n"
           "echo \"${words[*]}\" >>calls\n"
           "exec " PALPATE_PROGRAM " \"${words[@]}\"\n";
    fs::permissions(folder / "scripts/run", fs::perms::owner_all);
    fs::create_symlink("run", folder / "scripts/palpate");
    std::ofstream(folder / "commands") << commands;
    const Outcome outcome =
        run("commands", "cd " + folder.string() + " && PATH=$PWD/scripts:$PATH ", "bash -e");
    const std::string calls = read(folder / "calls");
    EXPECT_EQ(outcome.code, 0) << page << ": " << calls << outcome.err;
    EXPECT_EQ(lines_in(calls), calls_in(commands)) << page << ": " << calls;
    EXPECT_GT(calls_in(commands), 0U) << page;
  }
  for (const char* page : {"README", "2-recordings", "3-session", "5-bench", "recording", "session",
                           "sources", "lab", "bench-entries"})
    EXPECT_NE(std::find(run_of.begin(), run_of.end(), page), run_of.end()) << page;
  for (const char* page : {"README", "2-recordings"})
    EXPECT_GT(fs::file_size(path(std::string(page) + "/press.csv")), 100'000U) << page;
}

TEST_F(Program, SaysWhatToDoWithASourceThatIsNone) {
  expect_refusal("info", {"info: no source is given", "synthetic:desk"});
  expect_refusal("info tum:", {"'tum:'", "names no folder", "tum:FOLDER"});
  expect_refusal("info recording:" + write("walk.bag", "#ROSBAG V1.2\n"),
                 {"walk.bag", "ROS 1", "rosbag reindex"});
  expect_refusal("info recording:" + write("scan.mkv", "x"), {"scan.mkv", "video", "depth:FOLDER"});
  expect_refusal("info " + write("cup.jpg", "x"), {"cup.jpg", ".pcd, .ply"});
  // Six digits, whatever the sums behind them.
  const Outcome at = run("info synthetic:desk --at 300,200");
  EXPECT_NE(at.out.find("depth_m: 0.7331\n"), std::string::npos) << at.out;
}

TEST_F(Program, RefusesBadInputInOneLineThatNamesIt) {
  const std::string camera = std::string("trace --camera ") + plane + " --path ";
  expect_refusal(camera + path("missing.csv"), {"missing.csv"});
  expect_refusal(camera + write("empty.csv", ""), {"empty.csv"});
  expect_refusal(camera + write("header.csv", "t,x,y,z\n"), {"header.csv"});
  expect_refusal(camera + write("columns.csv", "t,x,y\n0,0,0\n"), {"columns.csv", "z"});
  expect_refusal(camera + write("nan.csv", "t,x,y,z\n0,0,nan,0\n"), {"nan.csv: line 2"});
  expect_refusal(camera + write("unsorted.csv", "t,x,y,z\n1,0,0,0\n0,0,0,0\n"),
                 {"unsorted.csv: line 3"});
  expect_refusal(camera + press() + " --rate 0", {"--rate"});
  expect_refusal(camera + press() + " --set r_1=0.006", {"r_1"});
  expect_refusal(camera + press() + " --set r_1", {"r_1", "="});
  expect_refusal(camera + press() + " --set theta=abc", {"theta", "abc"});
  expect_refusal(camera + press() + " --json", {"--out"});
  expect_refusal(camera + press() + " --out " + path("no/such/folder/t.csv"), {"no/such/folder"});
  expect_refusal(camera + press() + " --config " + path("missing.toml"), {"missing.toml"});
  expect_refusal(camera + press() + " --config " + write("bad.toml", "a = = 3\n"), {"bad.toml:1"});
  expect_refusal(camera + press() + " --config " + write("key.toml", "methd = \"paper\"\n"),
                 {"key.toml", "method"});
  expect_refusal("info tum:" + path("nowhere"), {"nowhere"});
  expect_refusal("info pcd:" + write("not.pcd", "hello\n"), {"not.pcd"});
  expect_refusal("trace", {"--camera"});
  expect_refusal("run --headless --duration -1", {"--duration"});
  expect_refusal("run --duration -1", {"--duration"});
  expect_refusal("run --listen nowhere", {"--listen nowhere"});
  expect_refusal("run --listen 0.0.0.0 --token short", {"--token"});
  expect_refusal("run --operator-token short", {"--operator-token", "8"});
  expect_refusal("run --operator-limit fall_rate=1", {"--operator-limit", "fall_rate"});
  expect_refusal("run --operator-limit max_device_farce=1",
                 {"max_device_farce", "max_device_force"});
  expect_refusal("run --record-limit 0", {"--record-limit", "0.001"});
  expect_refusal("run --device mouze:", {"mouze", "mouse"});
  expect_refusal("run --device omega", {"'omega'", "did you mean 'force-dimension:'"});
  expect_refusal("run --port 99999", {"--port", "99999", "65535"});
  expect_refusal("run --rate 10", {"10"});
}

TEST_F(Program, FailsWithOneWhenTheDiskIsFull) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "there is no /dev/full here";
  const Outcome outcome =
      run(std::string("trace --camera ") + plane + " --path " + press() + " --out /dev/full");
  EXPECT_EQ(outcome.code, 1);
  EXPECT_NE(outcome.err.find("/dev/full"), std::string::npos);
}

TEST_F(Program, ReplaysWhatItRecordedBitForBit) {
  const std::vector<std::string> sessions = {
      "--method paper", "--method paper-as-printed", "--method fixed-step",
      "--method sight --camera synthetic:moving?noise=1mm&size=160x120",
      "--method sight --set damping=1.5 --camera synthetic:desk?size=160x120 "
      "--camera synthetic:plane?size=80x60"};
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    const std::string bag = path("bag" + std::to_string(i));
    std::string options = sessions[i];
    if (options.find("--camera") == std::string::npos)
      options += " --camera synthetic:desk?noise=1mm&size=160x120";
    for (std::size_t at = 0; (at = options.find('&', at)) != std::string::npos; at += 2)
      options.insert(at, "\\");
    const Outcome session = run("run --headless --duration 2.5 --record " + bag + " " + options);
    ASSERT_EQ(session.code, 0) << session.err;
    const Outcome replay = run("replay --json " + bag);
    EXPECT_EQ(replay.code, 0) << options << "\n" << replay.out << replay.err;
    const auto report = nlohmann::json::parse(replay.out);
    EXPECT_EQ(report["identical"], true);
    EXPECT_EQ(report["ticks"], 2500);
    EXPECT_GT(report["frames"], 70);
  }
}

TEST_F(Program, ReplaysALiveSessionBitForBit) {
  const Outcome session =
      run("run --json --duration 2.5 --port 0 --no-browser --device hand: --method sight "
          "--camera synthetic:desk?size=160x120 --camera synthetic:plane?size=80x60 --record " +
          path("bag"));
  ASSERT_EQ(session.code, 0) << session.err;
  const Outcome replay = run("replay --json " + path("bag"));
  EXPECT_EQ(replay.code, 0) << replay.out << replay.err;
  const auto report = nlohmann::json::parse(replay.out);
  EXPECT_EQ(report["identical"], true);
  EXPECT_EQ(report["ticks"], nlohmann::json::parse(session.out)["ticks"]);
}

TEST_F(Program, TouchesARecordingAsItTouchedTheCamera) {
  ASSERT_EQ(run(std::string("run --headless --duration 2 --device script:") + press() +
                " --record " + path("bag") + " --camera " + plane)
                .code,
            0);
  const std::string trace = "trace --path " + press() + " --out ";
  ASSERT_EQ(run(trace + path("camera.csv") + " --camera " + plane).code, 0);
  const Outcome outcome = run(trace + path("recording.csv") + " --camera recording:" + path("bag"));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(read(path("recording.csv")), read(path("camera.csv")));

  // The same in ROS 2's usual storage, and what is left of it when its recorder is killed.
  const std::string mcap = write("bag.mcap", test::as_mcap(path("bag"), {.compression = "zstd"}));
  const Outcome again = run(trace + path("mcap.csv") + " --camera recording:" + mcap);
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_EQ(read(path("mcap.csv")), read(path("camera.csv")));
  const std::string whole = run("info recording:" + mcap).out;
  EXPECT_NE(whole.find("messages are right\n"), std::string::npos) << whole;
  std::filesystem::resize_file(mcap, std::filesystem::file_size(mcap) / 2);
  const std::string half = run("info recording:" + mcap).out;
  EXPECT_NE(half.find("it was not closed"), std::string::npos) << half;
}

TEST_F(Program, GoesOnWithoutItsRecordingWhenTheDiskIsFull) {
  const Outcome outcome =
      run("run --headless --json --duration 4 --camera 'synthetic:desk?noise=1mm&size=320x240' "
          "--record " +
              path("bag"),
          "trap '' XFSZ; ulimit -f 3000; ");
  EXPECT_EQ(outcome.code, 1);
  EXPECT_EQ(nlohmann::json::parse(outcome.out)["ticks"], 4000);
  EXPECT_EQ(lines_in(outcome.err), 1U) << outcome.err;
  EXPECT_NE(outcome.err.find("the recording has stopped"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("disk"), std::string::npos) << outcome.err;
  // What was committed is a session as any other.
  const auto report = nlohmann::json::parse(run("replay --json " + path("bag")).out);
  EXPECT_EQ(report["asked"]["different_ticks"], 0);
}

TEST_F(Program, FailsWithOneWhenAReplayDiffers) {
  ASSERT_EQ(run("run --headless --duration 2 --record " + path("bag") +
                " --camera synthetic:desk?size=160x120")
                .code,
            0);
  // The lowest bit of one HIP's z, the fourth number behind 36 bytes of layout.
  const std::string file = path("bag/bag_0.mcap");
  BagReader reader(file);
  const std::vector<std::byte> tick = reader.read(reader.places("/palpate/tick").at(1500));
  const auto changed = [&](bool checksums) {
    std::string text = test::as_mcap(file, {.in_chunks = false, .checksums = checksums});
    const std::size_t at =
        text.find(std::string(reinterpret_cast<const char*>(tick.data()), tick.size()));
    EXPECT_NE(at, std::string::npos);
    char& z = text.at(at + 36 + 8 * 3);
    z = static_cast<char>(z ^ 1);
    return text;
  };
  const std::string hurt = write("hurt.mcap", changed(true));
  const Outcome damaged = run("replay " + hurt);
  EXPECT_EQ(damaged.code, 1);
  EXPECT_NE(damaged.out.find("the recording is damaged: "), std::string::npos) << damaged.out;
  EXPECT_NE(run("info recording:" + hurt).out.find("is damaged: "), std::string::npos);
  // Without checksums it shows in the forces.
  const std::string other = write("other.mcap", changed(false));
  const Outcome outcome = run("replay --json " + other);
  EXPECT_EQ(outcome.code, 1);
  const auto report = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(report["identical"], false);
  EXPECT_EQ(report["asked"]["first_difference"]["tick"], 1500);
  EXPECT_NE(run("replay " + other).out.find("tick 1500"), std::string::npos);
}

TEST_F(Program, LooksAtTheMachineAndSaysWhatToDo) {
  const test::NoVendorsUnderASanitizer ours_alone;
  const Outcome outcome = run("doctor --json --seconds 0.2");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto report = nlohmann::json::parse(outcome.out);
  EXPECT_GT(report["realtime"]["ticks"], 0);
  EXPECT_GE(report["realtime"]["wake_up_max_s"], report["realtime"]["wake_up_p50_s"]);
  EXPECT_TRUE(report["fit"].is_boolean());
  const auto& session = report["realtime"]["session"];
  EXPECT_GT(session["ticks"], 0);
  EXPECT_GE(session["late_ticks"].get<int>(),
            session["late_by_compute"].get<int>() + session["late_by_interruption"].get<int>());
  const double delay = report["realtime"]["delay_s"].get<double>();
  EXPECT_NEAR(report["realtime"]["stiffness_per_damping_1_s"], 2.0 / (1e-3 + 2.0 * delay), 1e-6);
  EXPECT_TRUE(report["devices"].is_array());
  EXPECT_TRUE(report["drivers"].is_array());
  EXPECT_GE(report["machine"]["cores"], 1);
  EXPECT_NE(report["versions"]["sqlite"], "");
  // What is refused comes with what to do about it.
  for (const char* right : {"memory_locked", "kept_awake"}) {
    EXPECT_TRUE(report["realtime"][right].get<bool>() || !report["advice"].empty()) << right;
  }
  EXPECT_EQ(report["machine"]["vector_set"], vector_set_in_use());
  const std::string first(vector_sets().front());
  const Outcome chosen = run("doctor --json --seconds 0.2", "PALPATE_VECTOR=" + first + " ");
  EXPECT_EQ(nlohmann::json::parse(chosen.out)["machine"]["vector_set"], first);
  expect_refusal("methods", {"'mmx'", first}, "PALPATE_VECTOR=mmx ");
  const std::string text = run("doctor --seconds 0.2").out;
  for (const char* part : {"for haptics at 1000 Hz", "N/m for each N s/m", "Session, ",
                           "wake-up latency", "Cameras and haptic", "Versions"})
    EXPECT_NE(text.find(part), std::string::npos) << part << " is not in\n" << text;
  expect_refusal("doctor --seconds 0", {"--seconds"});
}

TEST_F(Program, RefusesWhatIsNoRecording) {
  expect_refusal("replay " + path("none"), {"none", "no such bag"});
  expect_refusal("run --headless --record " + path("."), {"is there already"});
  expect_refusal("info recording:" + write("x.db3", "text"), {"x.db3", "not a database"});
  expect_refusal("info recording:" + write("x.mcap", "text"), {"x.mcap", "not an MCAP file"});
}

}  // namespace test_program
}  // namespace palpate
