// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "palpate/io/devices/mouse_device.hpp"
#include "palpate/net/viewer/session_host.hpp"
#include "palpate/record/replay.hpp"

#include "tests/session/fakes.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/viewer/client.hpp"

namespace palpate {
namespace test_session_host {

using nlohmann::json;
using test::fails_saying;

SessionOptions wall_options(const std::string& device) {
  SessionOptions options;
  options.cameras.push_back({.uri = "wall:"});
  options.sources.add({"wall", "", [](const Uri&) { return test::wall_source(); }});
  options.hands[0].device = device;
  options.pace = Pace::free_running;
  return options;
}

// Pages' view of a session on a wall.
struct Hosted {
  explicit Hosted(PageRules rules = {}, const std::string& device = "mouse:")
      : host("1.2.3", std::move(rules)), session(wall_options(device)) {
    host.attach(session);
  }
  ~Hosted() { host.detach(); }
  Hosted(const Hosted&) = delete;
  Hosted& operator=(const Hosted&) = delete;

  json state() { return host.state(); }
  auto asking(const Command& command, Role role) {
    return [this, command, role] { host.command(command, role); };
  }

  SessionHost host;
  Session session;
};

TEST(SessionHost, ShowsTheRobotThatTheHandLeads) {
  EXPECT_TRUE(Hosted().host.robot().is_null());
  RobotPicture picture{.name = "arm", .latency = 0.12};
  PageRules rules;
  rules.robot = [&] { return std::optional(picture); };
  Hosted hosted(std::move(rules));
  json shown = hosted.host.robot();
  EXPECT_TRUE(shown["tool"].is_null());
  EXPECT_EQ(shown["latency"], 0.12);
  picture.tool = Vec3(0.1, 0.2, 0.3);
  picture.links = {Vec3::Zero(), *picture.tool};
  picture.trouble = "its brakes are on";
  shown = hosted.host.robot();
  EXPECT_EQ(shown["tool"], (json{0.1, 0.2, 0.3}));
  EXPECT_EQ(shown["links"].size(), 2U);
  EXPECT_EQ(shown["trouble"], "its brakes are on");
}

// Hazard: strangers-limits
TEST(SessionHost, HoldsLimitsToWhatTheSessionWasStartedWith) {
  Hosted hosted;
  const auto force = [](double newtons) { return SetSafetyParameter{"max_device_force", newtons}; };
  const json before = hosted.state();
  ASSERT_EQ(before["safety"]["max_device_force"], 3.3);
  EXPECT_TRUE(fails_saying(hosted.asking(force(50.0), Role::holding), "3.3 N"));
  EXPECT_TRUE(
      fails_saying(hosted.asking(SetSafetyParameter{"rise_rate", 1e5}, Role::holding), "500 N/s"));
  EXPECT_TRUE(
      fails_saying(hosted.asking(SetSafetyParameter{"fall_rate", 1.0}, Role::holding), "operator"));
  EXPECT_EQ(hosted.state()["safety"], before["safety"]) << "what is refused changes nothing";

  hosted.host.command(force(1.0), Role::holding);
  EXPECT_EQ(hosted.state()["safety"]["max_device_force"], 1.0);
  hosted.host.command(force(3.3), Role::holding);  // back to what the operator allows
  hosted.host.command(force(2.0), Role::operating);
  EXPECT_TRUE(fails_saying(hosted.asking(force(3.3), Role::holding), "2 N"));
  hosted.host.command(force(5.0), Role::operating);
  hosted.host.command(force(4.5), Role::holding);
  EXPECT_EQ(hosted.state()["safety"]["max_device_force"], 4.5);
  // A value that the session refuses is no new bound either.
  EXPECT_TRUE(fails_saying(hosted.asking(force(1e9), Role::operating), "max_device_force"));
  EXPECT_TRUE(fails_saying(hosted.asking(force(5.1), Role::holding), "5 N"));
}

TEST(SessionHost, ShowsAStillPictureThatCameBeforeTheServerOnce) {
  Hosted hosted;
  FedFrame still{.frame = Frame{0.0, test::wall()}};
  hosted.host.show(0, still);
  ViewerServer server({.listen = "127.0.0.1", .port = 0}, hosted.host);
  hosted.host.show_on(&server);
  still.is_new = false;
  hosted.host.show(0, still);
  hosted.host.show(0, still);
  Page page(server.port());
  const std::string frame = page.until_kind(1);
  ASSERT_EQ(frame.size(), 96u + 2 * 120 * 90);
  EXPECT_EQ(frame.substr(4, 4), std::string(4, '\0')) << "the first, and no other";
  hosted.host.show_on(nullptr);
}

TEST(SessionHost, OpensNoSceneButThoseThatItLists) {
  std::vector<std::string> opened;
  Hosted hosted({.scenes = {{"synthetic:desk", "a desk"}},
                 .open_scene = [&](const std::string& uri) { opened.push_back(uri); }});
  EXPECT_EQ(hosted.host.hello()["scenes"][0]["uri"], "synthetic:desk");
  EXPECT_TRUE(fails_saying(hosted.asking(OpenScene{"pcd:/etc/secret.pcd"}, Role::operating),
                           "/etc/secret.pcd", "not among"));
  EXPECT_TRUE(opened.empty());
  hosted.host.command(OpenScene{"synthetic:desk"}, Role::operating);
  EXPECT_EQ(opened, std::vector<std::string>{"synthetic:desk"});
  Hosted without;
  EXPECT_TRUE(
      fails_saying(without.asking(OpenScene{"synthetic:desk"}, Role::operating), "not among"));
}

TEST(SessionHost, ProposesTheLengthOfWhatIsTooLargeAndOpensItOnceItIsWanted) {
  const test::TemporaryFolder folder;
  std::string points = "FIELDS x y z\nPOINTS 400\nDATA ascii\n";
  for (int i = 0; i < 400; ++i)
    points += std::to_string(15 * (i % 20)) + " " + std::to_string(15 * (i / 20)) + " 900\n";
  const std::string camera = "pcd:" + folder.write("millimetres.pcd", points).string();
  const std::string scaled = camera + "?scale=0.001";
  std::vector<std::string> opened;
  const PageRules rules{.scenes = {{camera, "what the program was started with"}},
                        .open_scene = [&](const std::string& uri) { opened.push_back(uri); }};
  const auto seen = [&](const std::string& uri) {
    SessionOptions options = wall_options("mouse:");
    options.cameras.front().uri = uri;
    SessionHost host("1.2.3", rules);
    Session session(std::move(options));
    host.attach(session);
    EXPECT_TRUE(host.state()["points"].is_null()) << "nothing was seen yet";
    session.run(0.01);
    json state = host.state()["points"];
    if (state["rescaled"] != "") host.command(OpenScene{state["rescaled"]}, Role::operating);
    host.detach();
    return state;
  };
  const json large = seen(camera);
  EXPECT_EQ(large["extent"], 285.0);
  EXPECT_EQ(large["scale"], 1e-3);
  EXPECT_EQ(large["rescaled"], scaled);
  EXPECT_EQ(opened, std::vector<std::string>{scaled});
  EXPECT_EQ(seen(scaled)["rescaled"], "");
  EXPECT_EQ(seen(camera + "?scale=1.0")["rescaled"], "") << "that was chosen";
}

TEST(SessionHost, GivesTheSplatThatIsFeltAndOpensItAtTheScaleThatWasMeasured) {
  const test::TemporaryFolder folder;
  std::string sheet = "ply\nformat ascii 1.0\nelement vertex 100\n";
  for (const char* name : {"x", "y", "z", "opacity", "scale_0", "scale_1", "scale_2", "rot_0",
                           "rot_1", "rot_2", "rot_3", "f_dc_0", "f_dc_1", "f_dc_2"})
    sheet += std::string("property float ") + name + "\n";
  sheet += "end_header\n";
  for (int i = 0; i < 100; ++i)
    sheet += std::to_string(i % 10) + " " + std::to_string(i / 10) + " 7 5 0 0 -3 1 0 0 0 9 0 -9\n";
  const std::filesystem::path file = folder.write("sheet.ply", sheet);
  const std::string camera = "splat:" + file.string();
  std::vector<std::string> opened;
  SessionOptions options = wall_options("mouse:");
  options.cameras.front().uri = camera + "?scale=10mm&up=x&pose=1,2,3,0,0,0,1";
  SessionHost host("1.2.3", {.open_scene = [&](const std::string& uri) { opened.push_back(uri); }});
  Session session(std::move(options));
  host.attach(session);
  EXPECT_EQ(host.hello()["splat"], true);
  const auto drawn = host.gaussians();
  ASSERT_EQ(drawn.size(), 100U);
  // World from file: (x, y, z) to (1 - z / 100, 2 + y / 100, 3 + x / 100).
  const auto corner =
      std::min_element(drawn.begin(), drawn.end(),
                       [](const auto& a, const auto& b) { return a[1] + a[2] < b[1] + b[2]; });
  const double thin = 1e-4 * std::exp(-6.0);
  const std::array<double, 12> expected{1 - 0.07, 2, 3,    255 * 65536 + 128 * 256,  thin, 0, 0,
                                        1e-4,     0, 1e-4, 1 / (1 + std::exp(-5.0)), 0};
  for (std::size_t i = 0; i < expected.size(); ++i)
    EXPECT_NEAR((*corner)[i], expected[i], i >= 4 && i < 10 ? 1e-9 : 1e-6) << i;

  host.command(Rescale{0.5}, Role::operating);
  EXPECT_EQ(opened, std::vector<std::string>{camera + "?up=x&pose=1,2,3,0,0,0,1&scale=0.005"});
  const auto by = [&](double times) {
    return [&host, times] { host.command(Rescale{times}, Role::operating); };
  };
  EXPECT_TRUE(fails_saying(by(0.0), "scale"));
  EXPECT_TRUE(fails_saying(by(-1.0), "scale"));
  host.detach();

  Hosted wall({.open_scene = [&](const std::string& uri) { opened.push_back(uri); }});
  EXPECT_EQ(wall.host.hello()["splat"], false);
  EXPECT_TRUE(wall.host.gaussians().empty());
  EXPECT_TRUE(fails_saying(wall.asking(Rescale{0.5}, Role::operating), "scale", "--camera"));
  EXPECT_EQ(opened.size(), 1U);
}

TEST(SessionHost, OpensAFileThatArrivedInFull) {
  std::vector<std::string> opened;
  const auto files = std::make_shared<DroppedFiles>(1000);
  Hosted hosted(
      {.open_scene = [&](const std::string& uri) { opened.push_back(uri); }, .files = files});
  EXPECT_EQ(hosted.host.hello()["file_limit"], 1000);
  const std::filesystem::path half = hosted.host.begin_file("half.ply", 900);
  std::ofstream(half) << "ply";
  EXPECT_TRUE(fails_saying([&] { return hosted.host.begin_file("more.ply", 200); }, "more.ply",
                           "1 MB", "--camera"));
  hosted.host.end_file(half, false);
  EXPECT_FALSE(std::filesystem::exists(half));
  const std::filesystem::path whole = hosted.host.begin_file("Half.PCD", 900);
  EXPECT_EQ(std::filesystem::status(whole.parent_path().parent_path()).permissions(),
            std::filesystem::perms::owner_all);
  hosted.host.end_file(whole, true);
  EXPECT_EQ(opened, std::vector<std::string>{"pcd:" + whole.string()});
  // No structured binding: clang 14 lets no lambda capture one.
  const auto refuses = [&](const std::string& name, const char* said) {
    return fails_saying([&] { return hosted.host.begin_file(name, 1); }, said);
  };
  EXPECT_TRUE(refuses("../x.ply", "rename"));
  EXPECT_TRUE(refuses(".ply", "rename"));
  EXPECT_TRUE(refuses("a b.ply", "rename"));
  EXPECT_TRUE(refuses("scan.mkv", "PNG"));
  EXPECT_TRUE(refuses("depth.png", "--camera depth:"));
}

TEST(SessionHost, HoldsTheOperatorToTheSessionsOptions) {
  Hosted hosted({.operator_limits = {{"max_device_force", 4.0}}});
  const auto force = [](double newtons) { return SetSafetyParameter{"max_device_force", newtons}; };
  EXPECT_TRUE(fails_saying(hosted.asking(force(4.5), Role::operating), "--operator-limit"));
  hosted.host.command(force(4.0), Role::operating);
  EXPECT_EQ(hosted.state()["safety"]["max_device_force"], 4.0);
}

TEST(SessionHost, SaysInWhichDirectionLimitsAreStricter) {
  Hosted hosted;
  const json hello = hosted.host.hello();
  for (const json& row : hello["safety"]) {
    if (row["name"] == "max_device_force") {
      EXPECT_EQ(row["stricter"], "lower");
    } else if (row["name"] == "ramp_time") {
      EXPECT_EQ(row["stricter"], "higher");
    } else if (row["name"] == "fall_rate") {
      EXPECT_EQ(row["stricter"], "");
    }
  }
}

// A device whose position is no number for a tick at 50, 100 and 150 ms.
class StumblingDevice final : public Device {
 public:
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double /*t*/) noexcept override {
    ++reads_;
    const bool stumbles = reads_ % 50 == 0 && reads_ <= 150;
    return {.position = Vec3::Constant(stumbles ? std::nan("") : 0.1)};
  }
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}

 private:
  int reads_ = 0;
  DeviceInfo info_{.uri = "stumbling:", .kind = "stumbling", .limits = no_motors};
};

// Hazard: repeated-fault
TEST(SessionHost, TellsALatchedFaultUntilTheOperatorResetsIt) {
  SessionOptions options = wall_options("hand:");
  options.open_devices[0] = std::make_unique<StumblingDevice>();
  Session session(std::move(options));
  SessionHost host("1.2.3");
  host.attach(session);
  std::vector<json> latched_by;
  session.run(0.4, [&](const ServoTick& tick) {
    if (tick.number % 120 == 119) latched_by.push_back(host.state()["latched_by"]);
    if (tick.number == 300) host.command(ResetFaults{}, Role::operating);
  });
  host.detach();
  const json reason = {"input_refused"};
  EXPECT_EQ(latched_by, (std::vector<json>{json::array(), reason, json::array()}));
}

TEST(SessionHost, SaysThatTheForceIsOnHold) {
  Session session(wall_options("hand:"));
  SessionHost host("1.2.3");
  host.attach(session);
  std::vector<json> on_hold;
  session.run(0.3, [&](const ServoTick& tick) {
    if (tick.number % 100 == 99) on_hold.push_back(host.state()["on_hold"]);
    if (tick.number == 100 || tick.number == 200) session.hold(tick.number == 100);
  });
  host.detach();
  EXPECT_EQ(on_hold, (std::vector<json>{false, true, false}));
}

// A handle that rests away from the wall, with the figures of its mechanism.
class KnownDevice final : public Device {
 public:
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double /*t*/) noexcept override { return {}; }
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}

 private:
  DeviceInfo info_{.uri = "known:",
                   .kind = "known",
                   .limits = {.max_force = 3.3, .continuous_force = 0.88, .max_stiffness = 500.0},
                   .damping = 0.7,  // [N s/m]
                   .delay = 1e-3};  // [s]
};

TEST(SessionHost, WarnsOfAStiffnessThatTheDeviceIsNotGoodFor) {
  SessionOptions options = wall_options("hand:");
  options.open_devices[0] = std::make_unique<KnownDevice>();
  Session session(std::move(options));
  SessionHost host("1.2.3");
  host.attach(session);
  const auto warnings = [&] { return host.state()["device"]["warnings"]; };
  host.command(SetParameter{"stiffness", 460.0}, Role::operating);
  EXPECT_EQ(warnings(), json::array()) << "2 * 0.7 / (1 ms + 2 * 1 ms) = 466.7 N/m at 1 kHz";
  host.command(SetParameter{"stiffness", 480.0}, Role::operating);
  ASSERT_EQ(warnings().size(), 1U);
  EXPECT_NE(warnings()[0].get<std::string>().find("466 N/m"), std::string::npos);
  host.command(SetParameter{"stiffness", 600.0}, Role::operating);
  EXPECT_EQ(warnings().size(), 2U) << "nor are its motors good for that";
  host.command(SetParameter{"stiffness", 230.0}, Role::operating);
  host.command(SetPlacement{"scale", 2.2}, Role::operating);
  EXPECT_EQ(warnings().size(), 2U) << "506 N/m at the hand";
  host.detach();
}

TEST(SessionHost, TakesAHandOnlyForTheMouse) {
  EXPECT_TRUE(Hosted().host.takes_hand());
  EXPECT_FALSE(Hosted({}, "hand:").host.takes_hand());
}

TEST(SessionHost, PutsTheHandWhereThePageSaysWhateverThePlacement) {
  for (const double scale : {1.0, 2.5}) {
    Hosted hosted({}, "mouse:?x=0&y=0&z=0.1");
    hosted.host.command(SetPlacement{"scale", scale}, Role::operating);
    hosted.host.command(SetPlacement{"origin_y", 0.02 * (scale - 1.0)}, Role::operating);
    hosted.host.command(SetPlacement{"yaw", 0.3 * (scale - 1.0)}, Role::operating);
    const Vec3 place(0.03, -0.04, 0.2);  // [m, world] before the wall
    bool present = false;
    Vec3 hip = Vec3::Zero();
    const auto note = [&](const ServoTick& record) {
      hip = record.tick.hip;
      present = (record.hand & hand_present) != 0;
    };
    hosted.host.hand({.held = true, .target = place});
    hosted.session.run(0.4, note);  // less than the mouse's silence
    EXPECT_TRUE(present);
    EXPECT_LT((hip - place).norm(), 1e-6) << "scale " << scale << ": " << hip.transpose();
  }
}

TEST(SessionHost, GivesTheHandAnotherToolThatItsPageTurns) {
  const test::TemporaryFolder folder;
  const std::string bag = (folder.path() / "bag").string();
  Hosted hosted({}, "mouse:?x=0&y=0&z=0.4");
  hosted.session.start_recording(bag);
  auto ticks = hosted.session.ticks();
  ServoTick newest{};
  TickBatch shown;
  double t = 0.0;
  const auto play = [&](double seconds, const HandMessage& hand) {
    for (const double end = t + seconds; t < end; hosted.session.advance(t += 0.05))
      hosted.host.hand(hand);
    while (ticks.try_pop(newest)) {
    }
    shown = hosted.host.ticks().value();
  };
  const auto choose = [&](const std::string& tool) {
    hosted.host.command(SetTool{tool}, Role::operating);
    return hosted.state()["tool"];
  };
  EXPECT_EQ(hosted.state()["tool"], "ball");
  const json offered = hosted.host.hello()["tools"];
  EXPECT_EQ(choose(offered[1]), "box:40x20x5mm");
  // Tilted about x by 0.2 rad: the edge at +y touches first.
  const Rotation tilted(std::cos(0.1), std::sin(0.1), 0.0, 0.0);
  play(0.5, {true, Vec3(0.0, 0.0, 0.45), tilted});
  EXPECT_TRUE(newest.force.isZero());
  EXPECT_NEAR(newest.tick.orientation.x(), std::sin(0.1), 1e-6);
  play(1.0, {true, Vec3(0.0, 0.0, 0.497), tilted});
  EXPECT_LT(newest.force.z(), -0.5);
  EXPECT_TRUE(newest.torque.isZero()) << "a mouse has no motors for it";
  EXPECT_LT(shown.newest.torque.x(), -5e-3) << "the wall pushes the edge at +y back";
  // What it does not offer it makes, but a page opens no files.
  EXPECT_TRUE(fails_saying(hosted.asking(SetTool{"mesh:/etc/passwd.stl?unit=mm"}, Role::operating),
                           "cannot be read"));
  EXPECT_TRUE(fails_saying(hosted.asking(SetTool{"spoon:4mm"}, Role::operating), "no tool"));
  EXPECT_TRUE(fails_saying(hosted.asking(SetMethod{"paper"}, Role::operating), "ball"));
  EXPECT_EQ(hosted.state()["tool"], "box:40x20x5mm");
  // A hand that is let go does not turn back.
  play(0.2, {});
  EXPECT_NEAR(newest.tick.orientation.x(), std::sin(0.1), 1e-6);
  EXPECT_EQ(choose("ball"), "ball");
  play(1.0, {true, Vec3(0.0, 0.0, 0.45), tilted});
  play(1.0, {true, Vec3(0.0, 0.0, 0.505), tilted});
  EXPECT_LT(newest.force.z(), -0.5);
  EXPECT_TRUE(shown.newest.torque.isZero());
  hosted.session.stop();
  SessionReader reader(bag);
  EXPECT_TRUE(replay(reader).identical());
}

TEST(SessionHost, OffersTheToolThatTheSessionBeganWith) {
  SessionOptions options = wall_options("mouse:");
  options.tool = "box:41x20x5mm?points=200";
  Session session(std::move(options));
  SessionHost host("1.2.3");
  host.attach(session);
  const auto began = session.settings().tool;
  EXPECT_EQ(host.hello()["tools"].back(), "box:41x20x5mm?points=200");
  host.command(SetTool{"ball"}, Role::operating);
  EXPECT_EQ(session.settings().tool, nullptr);
  host.command(SetTool{"box:41x20x5mm?points=200"}, Role::operating);
  EXPECT_EQ(session.settings().tool, began) << "a mesh is not read again";
  host.detach();
}

TEST(SessionHost, LetsTheHandGoTowardsAPlaceWithoutHoldingIt) {
  Hosted hosted({}, "mouse:?x=0&y=0&z=0.1");
  bool present = true;
  Vec3 hip = Vec3::Zero();
  hosted.host.hand({.held = true, .target = Vec3(0.0, 0.0, 0.3)});
  hosted.host.hand({.held = false, .target = Vec3(0.0, 0.0, 0.2)});
  hosted.session.run(0.4, [&](const ServoTick& record) {
    hip = record.tick.hip;
    present = (record.hand & hand_present) != 0;
  });
  EXPECT_FALSE(present);
  EXPECT_LT((hip - Vec3(0.0, 0.0, 0.2)).norm(), 1e-6);
}

TEST(SessionHost, RecordsIntoItsFolderUnderNamesOfItsOwn) {
  const test::TemporaryFolder folder;
  const std::filesystem::path made = folder.path() / "made" / "here";
  Hosted hosted({.recordings = {.folder = made}});
  std::vector<std::string> paths;
  for (int i = 0; i < 3; ++i) {
    hosted.host.command(SetRecording{true}, Role::operating);
    hosted.host.command(SetRecording{true}, Role::operating);  // it is on
    paths.push_back(hosted.state()["recording"]["path"]);
    EXPECT_EQ(std::filesystem::path(paths.back()).parent_path(), made);
    hosted.host.command(SetRecording{false}, Role::operating);
    EXPECT_EQ(hosted.state()["recording"]["path"], nullptr);
  }
  EXPECT_NE(paths[0], paths[1]);
  EXPECT_NE(paths[1], paths[2]);
  EXPECT_EQ(hosted.host.recording_ended(), "");
}

TEST(SessionHost, EndsARecordingAtItsLimitAndStartsNoOther) {
  const test::TemporaryFolder folder;
  Hosted hosted({.recordings = {.folder = folder.path(), .limit = 1000.0, .interval = 0.01}});
  hosted.host.command(SetRecording{true}, Role::operating);
  // The file alone is larger. Its end comes from a thread; a minute is for hanging tests.
  for (int i = 0; i < 6000 && hosted.host.recording_ended().empty(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_NE(hosted.host.recording_ended().find("--record-limit"), std::string::npos);
  const json recording = hosted.state()["recording"];
  EXPECT_EQ(recording["path"], nullptr);
  EXPECT_EQ(recording["ended"], hosted.host.recording_ended());
  EXPECT_TRUE(fails_saying(hosted.asking(SetRecording{true}, Role::operating), "1 kB"));
}

TEST(SessionHost, LeavesTheDiskItsFreeSpace) {
  const test::TemporaryFolder folder;
  Hosted hosted({.recordings = {.folder = folder.path() / "made", .keep_free = 1e30}});
  EXPECT_TRUE(fails_saying(hosted.asking(SetRecording{true}, Role::operating), "free"));
  EXPECT_EQ(hosted.state()["recording"]["path"], nullptr);
}

TEST(SessionHost, SaysThatARecordingFolderCannotBeMade) {
  const test::TemporaryFolder folder;
  const auto file = folder.write("file", "");
  Hosted hosted({.recordings = {.folder = file / "below"}});
  EXPECT_TRUE(
      fails_saying(hosted.asking(SetRecording{true}, Role::operating), "--record-folder", "file"));
}

}  // namespace test_session_host
}  // namespace palpate
