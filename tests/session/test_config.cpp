// SPDX-License-Identifier: Apache-2.0
#include <fstream>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/session/config.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_config {

using test::fails_saying;

Eigen::Isometry3d pose_of(double seed) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::AngleAxisd(seed, Eigen::Vector3d(1, 2, -0.5).normalized()).matrix();
  pose.translation() = Eigen::Vector3d(0.1 * seed, -1.0 / 3.0, 1e-9);
  return pose;
}

SessionConfig everything() {
  SessionConfig config;
  config.cameras = {{.uri = "tum:/data/a b?x=\"1\"\\2", .world_from_camera = pose_of(1.0)},
                    {.uri = "synthetic:desk", .name = "left"}};
  config.hands = {{.device = "hand:?device=touch",
                   .placement = {pose_of(-2.0), 2.5, 1, 0.0625, 0.3, 0.045, Vec3(0.6, 0.0, -0.8)}},
                  {.device = "script:a.csv", .name = "left", .placement = {pose_of(0.5), 0.5}},
                  {.device = "hand:"}};
  config.without_watchdog = true;
  config.rate = 2000.0;
  config.method = "paper";
  set_parameter(config.parameters, "r_c", 7e-3);
  set_parameter(config.parameters, "stiffness", 1234.5678901234567);
  set_parameter(config.safety, "max_device_force", 1.0 / 3.0);
  config.record = "out/\ttab";
  config.fixtures = "fixtures.toml";
  config.record_folder = "where it \"goes\"";
  config.record_limit = 0.25;
  config.operator_limits = {{"max_device_force", 4.0}, {"ramp_time", 0.5}};
  config.server = {"0.0.0.0", 0, "secret", "of the operator", false};
  return config;
}

void expect_same(const Placement& a, const Placement& b) {
  EXPECT_TRUE(a.world_from_device.isApprox(b.world_from_device, 1e-14));
  EXPECT_EQ(a.workspace_scale, b.workspace_scale);
  EXPECT_EQ(a.clutch_button, b.clutch_button);
  EXPECT_EQ(a.bubble_radius, b.bubble_radius);
  EXPECT_EQ(a.bubble_speed, b.bubble_speed);
  EXPECT_EQ(a.handle_weight, b.handle_weight);
  EXPECT_EQ(a.down, b.down);
}

void expect_same(const SessionConfig& a, const SessionConfig& b) {
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (std::size_t i = 0; i < a.cameras.size(); ++i) {
    EXPECT_EQ(a.cameras[i].uri, b.cameras[i].uri);
    EXPECT_EQ(a.cameras[i].name, b.cameras[i].name);
    ASSERT_EQ(a.cameras[i].world_from_camera.has_value(),
              b.cameras[i].world_from_camera.has_value());
    if (a.cameras[i].world_from_camera) {
      EXPECT_TRUE(a.cameras[i].world_from_camera->isApprox(*b.cameras[i].world_from_camera, 1e-14));
    }
  }
  ASSERT_EQ(a.hands.size(), b.hands.size());
  for (std::size_t i = 0; i < a.hands.size(); ++i) {
    EXPECT_EQ(a.hands[i].device, b.hands[i].device);
    EXPECT_EQ(a.hands[i].name, b.hands[i].name);
    expect_same(a.hands[i].placement, b.hands[i].placement);
  }
  EXPECT_EQ(a.without_watchdog, b.without_watchdog);
  EXPECT_EQ(a.rate, b.rate);
  EXPECT_EQ(a.method, b.method);
  for (const ParameterInfo& row : parameter_table())
    EXPECT_EQ(row.get(a.parameters), row.get(b.parameters)) << row.name;
  for (const SafetyParameterInfo& row : safety_parameter_table())
    EXPECT_EQ(row.get(a.safety), row.get(b.safety)) << row.name;
  EXPECT_EQ(a.record, b.record);
  EXPECT_EQ(a.server.listen, b.server.listen);
  EXPECT_EQ(a.server.port, b.server.port);
  EXPECT_EQ(a.server.token, b.server.token);
  EXPECT_EQ(a.server.operator_token, b.server.operator_token);
  EXPECT_EQ(a.fixtures, b.fixtures);
  EXPECT_EQ(a.record_folder, b.record_folder);
  EXPECT_EQ(a.record_limit, b.record_limit);
  EXPECT_EQ(a.operator_limits, b.operator_limits);
  EXPECT_EQ(a.server.browser, b.server.browser);
}

TEST(SessionConfig, ComesBackFromItsTomlBitForBit) {
  for (const SessionConfig& config : {SessionConfig{}, everything()}) {
    const std::string text = to_toml(config);
    expect_same(parse_session_config(text, "session.toml"), config);
  }
  const std::string usual = to_toml({});
  EXPECT_EQ(to_toml(parse_session_config(usual, "session.toml")), usual);
}

TEST(SessionConfig, ComesBackWhateverTheValues) {
  std::mt19937 random(5);
  for (int i = 0; i < 100; ++i) {
    SessionConfig config;
    const auto between = [&](double min, double max) {
      return std::uniform_real_distribution<double>(min, max)(random);
    };
    for (const ParameterInfo& row : parameter_table()) {
      if (row.name.substr(0, 2) != "r_") row.set(config.parameters, between(row.min, row.max));
    }
    for (const SafetyParameterInfo& row : safety_parameter_table())
      row.set(config.safety, between(row.min, row.max));
    config.safety.fade_age = 0.5 * config.safety.lost_age;
    set_parameter(config.parameters, "r_c", between(1e-3, 1e-2));
    expect_same(parse_session_config(to_toml(config), "session.toml"), config);
  }
}

TEST(SessionConfig, KnowsWhetherSomebodyChoseARadius) {
  const auto parsed = [](const std::string& text) {
    return parse_session_config(text, "session.toml");
  };
  EXPECT_FALSE(parsed("[parameters]\nstiffness = 500\n").radii_chosen);
  EXPECT_TRUE(parsed("[parameters]\nr_c = 0.005\n").radii_chosen) << "the usual one, but chosen";
  EXPECT_FALSE(parsed(to_toml({})).radii_chosen);
  SessionConfig chosen;
  chosen.radii_chosen = true;
  EXPECT_TRUE(parsed(to_toml(chosen)).radii_chosen);
}

TEST(SessionConfig, TakesWhatTheFileLeavesOutFromItsBase) {
  expect_same(parse_session_config("", "empty.toml", everything()), everything());
  const SessionConfig config =
      parse_session_config("[placement]\nscale = 3\n", "session.toml", everything());
  EXPECT_EQ(config.hands[0].placement.workspace_scale, 3.0);
  EXPECT_EQ(config.hands[0].placement.clutch_button, 1);
  EXPECT_EQ(config.method, "paper");
}

TEST(SessionConfig, TakesACameraInShort) {
  EXPECT_EQ(parse_session_config("camera = \"tum:a\"", "s").cameras.front().uri, "tum:a");
  EXPECT_EQ(parse_session_config("camera = [\"tum:a\", \"tum:b\"]", "s").cameras.back().uri,
            "tum:b");
  EXPECT_EQ(parse_session_config("hand = \"hand:\"", "s").hands[1].device, "hand:");
  const SessionConfig config = parse_session_config(
      "[[camera]]\nuri = \"tum:a\"\nworld_from_camera = \"1,2,3,0,0,0,1\"", "s");
  EXPECT_EQ(config.cameras.front().world_from_camera->translation(), Eigen::Vector3d(1, 2, 3));
}

TEST(SessionConfig, NamesFileAndLineOfWhatIsWrong) {
  const auto parsing = [](const char* text) {
    return [text] { return parse_session_config(text, "session.toml"), 0; };
  };
  EXPECT_TRUE(fails_saying(parsing("rate = 1000\nmethd = \"x\""), "session.toml:2:", "'methd'",
                           "did you mean 'method'?"));
  EXPECT_TRUE(fails_saying(parsing("[parameters]\n\nstifness = 1"), "session.toml:3:", "'stifness'",
                           "[parameters]", "did you mean 'stiffness'?"));
  EXPECT_TRUE(fails_saying(parsing("[safety]\nmax_force = 1"),
                           "session.toml:2:", "known here: max_device_force"));
  EXPECT_TRUE(
      fails_saying(parsing("[parameters]\nstiffness = -1"), "session.toml:2:", "out of range"));
  EXPECT_TRUE(
      fails_saying(parsing("[parameters]\nstiffness = \"a\""), "session.toml:2:", "not a number"));
  EXPECT_TRUE(fails_saying(parsing("[parameters]\nr_1 = 0.02"), "session.toml:1:", "radii"));
  EXPECT_TRUE(fails_saying(parsing("[safety]\nfade_age = 1.0"), "session.toml:1:", "fade_age"));
  EXPECT_TRUE(fails_saying(parsing("parameters = 3"), "session.toml:1:", "not a table"));
  EXPECT_TRUE(fails_saying(parsing("\nrate = 5"), "session.toml:2:", "'rate'", "from 100 to"));
  EXPECT_TRUE(fails_saying(parsing("rate = nan"), "session.toml:1:", "out of range"));
  EXPECT_TRUE(fails_saying(parsing("device = 3"), "session.toml:1:", "not a text"));
  EXPECT_TRUE(fails_saying(parsing("[placement]\nworld_from_device = [1, 2]"),
                           "session.toml:2:", "2 numbers"));
  EXPECT_TRUE(fails_saying(parsing("[placement]\nworld_from_device = [0,0,0,0,0,0,3]"),
                           "session.toml:2:", "length is 3"));
  EXPECT_TRUE(
      fails_saying(parsing("[placement]\nworld_from_device = true"), "session.toml:2:", "no pose"));
  EXPECT_TRUE(
      fails_saying(parsing("[placement]\nclutch_button = 1.5"), "session.toml:2:", "whole number"));
  EXPECT_TRUE(fails_saying(parsing("[placement]\nclutch_buton = 1"),
                           "session.toml:2:", "did you mean 'clutch_button'?"));
  EXPECT_TRUE(fails_saying(parsing("[[hand]]\nname = \"x\""), "session.toml:1:", "no 'device'"));
  EXPECT_TRUE(fails_saying(parsing("hand = [3]"), "session.toml:1:", "write [[hand]]"));
  EXPECT_TRUE(fails_saying(parsing("[[hand]]\ndevice = \"hand:\"\nscal = 2"),
                           "session.toml:3:", "did you mean 'scale'?"));
  EXPECT_TRUE(fails_saying(parsing("[server]\nport = 99999"), "session.toml:2:", "65535"));
  EXPECT_TRUE(fails_saying(parsing("[server]\nbrowser = 1"), "session.toml:2:", "true or false"));
  EXPECT_TRUE(fails_saying(parsing("[[camera]]\nname = \"x\""), "session.toml:1:", "no 'uri'"));
  EXPECT_TRUE(fails_saying(parsing("camera = []"), "session.toml:1:", "no camera"));
  EXPECT_TRUE(fails_saying(parsing("a = = 1"), "session.toml:1:"));
  for (const char* text :
       {"\nrate = \u00e9", "\nrate = \u3042", "\nrate = 1.0\u0416", "\n\u00fc = 1", "\nrate = \xff",
        "\nrate = 1.0\xc3", "\xef\xbb\xbf\nrate = \xe2\x80"})
    EXPECT_TRUE(fails_saying(parsing(text), "session.toml:2:", "in UTF-8")) << text;
  EXPECT_EQ(parse_session_config("device = \"\u3042\" # \u00e9", "s").hands[0].device, "\u3042");
  EXPECT_TRUE(fails_saying(
      [] {
        return parse_session_config("\nmethod = \"papr\"", "session.toml", {},
                                    [](const std::string& name) {
                                      throw Error("method '" + name + "'", "there is none");
                                    }),
               0;
      },
      "session.toml:2:", "method 'papr'", "there is none"));
}

TEST(SessionConfig, IsReadFromAFile) {
  const test::TemporaryFolder folder;
  const auto file = folder.path() / "session.toml";
  std::ofstream(file) << to_toml(everything());
  expect_same(read_session_config(file), everything());
  EXPECT_TRUE(fails_saying([&] { return read_session_config(folder.path() / "none.toml"), 0; },
                           "none.toml", "cannot be read"));
  EXPECT_TRUE(
      fails_saying([&] { return read_session_config(folder.path()), 0; }, "cannot be read"));
  std::ofstream(file) << std::string((1 << 20) + 1, '\n');
  EXPECT_TRUE(fails_saying([&] { return read_session_config(file), 0; }, "1 MiB"));
}

TEST(SessionConfig, IsEditedWithoutLosingWhatElseIsInTheFile) {
  const Placement placement{pose_of(0.7), 2.0, {}};
  const auto edited = [&](const std::string& text) {
    const std::string result = with_placement(text, "session.toml", placement);
    const Placement got = parse_session_config(result, "session.toml").hands[0].placement;
    EXPECT_TRUE(got.world_from_device.isApprox(placement.world_from_device, 1e-14)) << result;
    EXPECT_EQ(got.workspace_scale, 2.0) << result;
    return result;
  };
  const std::string head = "# mine\nmethod = \"paper\"  # the old one\n";
  EXPECT_TRUE(edited("").starts_with("[placement]\nscale = 2.0\nworld_from_device = [0.0"));
  EXPECT_TRUE(edited(head).starts_with(head + "\n[placement]\n"));
  EXPECT_TRUE(edited(head + "[placement]\nclutch_button = 3 # grey\n[safety]\nswing = 1.0\n")
                  .ends_with("clutch_button = 3 # grey\n[safety]\nswing = 1.0\n"));
  const std::string replaced = edited(
      "[placement]  # of the arm\nscale = 1.0  # for now\nworld_from_device = [0, 0, 0,\n"
      "   # comment\n   0, 0, 0, 1]  # measured\n\n[safety]\nswing = 1.0");
  EXPECT_TRUE(
      replaced.starts_with("[placement]  # of the arm\nscale = 2.0  # for now\nworld_from"));
  EXPECT_TRUE(replaced.ends_with("]  # measured\n\n[safety]\nswing = 1.0\n")) << replaced;
  edited("placement.scale = 3\nrate = 500\n");
  edited(to_toml(everything()));
  EXPECT_TRUE(fails_saying([&] { return edited("placement = { scale = 1.0 }"); },
                           "session.toml:1:", "inline table"));
  EXPECT_TRUE(fails_saying([&] { return edited("rat = 3"); }, "session.toml:1:", "'rat'"));
}

}  // namespace test_config
}  // namespace palpate
