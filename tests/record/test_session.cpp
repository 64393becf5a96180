// SPDX-License-Identifier: Apache-2.0
#include <bit>
#include <csignal>
#include <cstdlib>
#include <limits>
#include <string>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "palpate/io/sources/bag_camera.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/record/replay.hpp"

#include "tests/record/sessions.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_session {

namespace fs = std::filesystem;
using test::fails_saying;
using test::press_info;
using test::record_press;
using test::TemporaryFolder;
using test::wavy_floor;

std::uint64_t bits(double value) { return std::bit_cast<std::uint64_t>(value); }

TEST(RecordedHand, IsThatOfEvenlySpacedTicks) {
  const TemporaryFolder folder;
  SessionWriter writer(folder.path() / "bag", press_info(), 0.0);
  const std::vector<ServoTick> ticks = record_press(writer, {}, 101);
  const std::vector<Tick> path = recorded_hand(folder.path() / "bag", 11);
  ASSERT_EQ(path.size(), 11u);
  for (std::size_t i = 0; i < path.size(); ++i) {
    EXPECT_EQ(path[i].t, ticks[10 * i].tick.t);
    EXPECT_EQ(path[i].hip, ticks[10 * i].tick.hip);
  }
  EXPECT_EQ(recorded_hand(folder.path() / "bag", 1000).size(), 101u);
  EXPECT_TRUE(fails_saying([&] { return recorded_hand(folder.path() / "none", 2); }, "none"));
}

TEST(Session, KeepsEachBitOfATick) {
  const TemporaryFolder folder;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  ServoTick tick{};
  tick.tick = {.t = 1.0 / 3.0,
               .hip = {nan, -0.0, 5e-324},
               .proxy = {1.0 / 7.0, -1e300, std::numeric_limits<double>::infinity()},
               .normal = {0, 0, 1},
               .force = {0.1, 0.2, 0.3},
               .state = ContactState::entrenchment,
               .steps = 63,
               .surface_velocity = 1e-17,
               .frame = -1,
               .flags = 0xffffffffU};
  tick.tick.orientation = {0.5, -0.5, nan, 5e-324};
  tick.tick.proxy_orientation = {-0.0, 1.0 / 3.0, 2, 3};
  tick.tick.torque = {1e-17, -0.0, 1.0 / 23.0};
  tick.handle = {1.0 / 29.0, 1, 2, 3};
  tick.torque = {1, 2, 1.0 / 31.0};
  tick.force = {-0.1, 1.0 / 9.0, 2};
  tick.position = {4, 5, 6};
  tick.gain = 1.0 / 11.0;
  tick.frame_age = std::numeric_limits<double>::infinity();
  tick.number = 1ULL << 52U;
  tick.frame_number = 12345678901ULL;
  tick.settings_number = 3;
  tick.safety = 0x80000001U;
  tick.wake_up_ns = 4294967295U;
  tick.hand = 7;
  tick.tick.surface_motion = {1e-9, -0.0, 1.0 / 13.0};
  tick.energy = {.relative = {-1.0 / 3.0, 5e-324, 1.0 / 17.0, 1ULL << 51U},
                 .absolute = {2.0, 3.0, 1.0 / 19.0, 4},
                 .contacts = 1ULL << 50U};
  {
    SessionWriter writer(folder.path() / "bag", press_info(), 0.0);
    writer.tick(tick);
    writer.close();
  }
  SessionReader reader(folder.path() / "bag");
  ASSERT_EQ(reader.ticks(), 1U);
  const std::vector<double> wrote = row_of(tick);
  const std::vector<double> read = row_of(reader.tick(0));
  ASSERT_EQ(read.size(), tick_columns().size());
  for (std::size_t i = 0; i < read.size(); ++i)
    EXPECT_EQ(bits(read[i]), bits(wrote[i])) << tick_columns()[i];
  EXPECT_EQ(reader.tick(0).number, tick.number);
  EXPECT_EQ(reader.tick(0).tick.state, ContactState::entrenchment);
}

TEST(Session, OfAnotherVersionIsReadByTheNamesOfItsColumns) {
  const std::vector<std::string> columns{"hip_z", "of_later_versions", "number", "t"};
  const TickRows rows(columns);
  const ServoTick tick = rows.read(std::vector<double>{0.3, 7.0, 12.0, 0.25}, "rows");
  EXPECT_EQ(tick.tick.hip, Vec3(0.0, 0.0, 0.3));
  EXPECT_EQ(tick.number, 12U);
  EXPECT_EQ(tick.tick.t, 0.25);
  EXPECT_EQ(tick.tick.frame, -1) << "as nothing has written it";
  EXPECT_EQ(tick.handle.w(), 1.0);
  const auto has = [&](std::string_view name) {
    return rows.has(static_cast<std::size_t>(
        std::find(tick_columns().begin(), tick_columns().end(), name) - tick_columns().begin()));
  };
  EXPECT_TRUE(has("hip_z") && has("t"));
  EXPECT_FALSE(has("hip_x") || has("torque_z"));
  EXPECT_TRUE(fails_saying(
      [&] {
        return rows.read(std::vector<double>{1.0, 2.0}, "rows");
      },
      "rows", "2 numbers instead of 4"));
}

TEST(Session, KeepsEachBitOfADepthImage) {
  const TemporaryFolder folder;
  std::vector<std::shared_ptr<const Cloud>> cameras{wavy_floor(0), wavy_floor(1, true)};
  {
    SessionWriter writer(folder.path() / "bag", press_info(), 0.0);
    writer.frame(3, 0.0, 0, cameras[0]);
    writer.frame(4, 1.0 / 3.0, 1, wavy_floor(2, true));
    writer.frame(5, 2.0 / 3.0, 1, cameras[1]);
    writer.frame(6, 1.0, 0, cameras[0]);  // the same again
    writer.close();
  }
  SessionReader reader(folder.path() / "bag");
  ASSERT_EQ(reader.frames().size(), 4U);
  EXPECT_EQ(reader.frames().at(5).stamp, 2.0 / 3.0);
  // The first camera's image was not written again.
  using Image = std::pair<std::size_t, std::size_t>;
  EXPECT_EQ(reader.frames().at(5).image, (Image{1, 1}));
  EXPECT_EQ(reader.frames().at(6).image, (Image{0, 0}));
  for (std::size_t i = 0; i < 2; ++i) {
    const FrameInUse seen = reader.seen(6 - i);
    EXPECT_EQ(seen.camera, i);
    const DepthImage* read = seen.cloud->image();
    const auto& wrote = dynamic_cast<const DepthImage&>(*cameras[i]);
    ASSERT_NE(read, nullptr);
    EXPECT_EQ(read->depth(), wrote.depth());
    EXPECT_EQ(read->intrinsics(), wrote.intrinsics());
    EXPECT_EQ(read->units_per_metre(), wrote.units_per_metre());
    EXPECT_EQ(read->world_from_camera().matrix(), wrote.world_from_camera().matrix());
  }
}

TEST(Session, KeepsEachBitOfTheNoiseAndWritesAnImageOfItWhereItChanges) {
  const TemporaryFolder folder;
  std::vector<std::shared_ptr<const DepthImage>> images;
  for (int i = 0; i < 5; ++i) {
    auto image = std::make_shared<DepthImage>(*wavy_floor(i));
    if (i < 4) image->set_noise(test::wavy_noise(i / 2));
    image->set_scale_unsure(i == 1);
    images.push_back(std::move(image));
  }
  {
    SessionWriter writer(folder.path() / "bag", press_info(), 0.0);
    for (std::size_t i = 0; i < images.size(); ++i)
      writer.frame(i, static_cast<double>(i), 0, images[i]);
    writer.close();
  }
  SessionReader reader(folder.path() / "bag");
  for (const std::size_t i : {3U, 0U, 1U, 2U, 4U}) {
    const DepthImage* read = reader.seen(i).cloud->image();
    ASSERT_NE(read, nullptr);
    ASSERT_EQ(read->has_noise(), i < 4) << i;
    if (i < 4) {
      EXPECT_EQ(*read->noise(), *images[i]->noise()) << i;
    }
    EXPECT_EQ(read->scale_unsure(), i == 1);
    EXPECT_FALSE(read->has_materials());
  }
  BagReader bag(folder.path() / "bag");
  EXPECT_EQ(bag.places(CameraTopics(0).noise).size(), 2U);
  // Whoever touches the bag's frames gets their noise too, and sees one camera.
  EXPECT_EQ(BagCamera::topics_of(bag).size(), 1U);
  const auto source = open_source("recording:" + (folder.path() / "bag").string());
  EXPECT_TRUE(source->next()->cloud->image()->has_noise());
}

TEST(Session, KeepsPointsInTheOrderInWhichTheyAreGathered) {
  const TemporaryFolder folder;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-0.05, 0.05);
  std::vector<Vec3> points;
  for (int i = 0; i < 5000; ++i) points.emplace_back(uniform(random), uniform(random), 0.1);
  points.emplace_back(Vec3::Constant(std::numeric_limits<double>::quiet_NaN()));
  const auto cloud = std::make_shared<const PointCloud>(points, Vec3(0, 0, 1.0 / 3.0));
  const std::shared_ptr<const Cloud> seen = cloud;
  {
    SessionWriter writer(folder.path() / "bag", press_info(), 0.0);
    writer.frame(1, 0.0, 0, seen);
    writer.close();
  }
  SessionReader reader(folder.path() / "bag");
  const auto read = reader.seen(1).cloud;
  const auto patch_of = [](const Cloud& from) {
    auto patch = std::make_unique<Patch>();
    gather(from, Ball{Vec3(0.01, 0.0, 0.1), 0.02}, *patch);
    return patch;
  };
  const auto a = patch_of(*cloud);
  const auto b = patch_of(*read);
  ASSERT_GT(a->size(), 100U);
  ASSERT_EQ(a->size(), b->size());
  for (std::size_t i = 0; i < a->size(); ++i) {
    EXPECT_EQ(a->x()[i], b->x()[i]);
    EXPECT_EQ(a->y()[i], b->y()[i]);
    EXPECT_EQ(a->z()[i], b->z()[i]);
  }
  EXPECT_EQ(dynamic_cast<const PointCloud&>(*read).viewpoint(), cloud->viewpoint());
}

TEST(Session, KeepsEachBitOfTheSettings) {
  ServoCommands settings{.number = 9, .settings = {}, .scene = 4, .hold = true};
  ServoSettings& all = settings.settings;
  all.method = "sight";
  for (const ParameterInfo& row : parameter_table()) {
    // Between the smallest and the default, with a long fraction where fractions are kept.
    if (row.name != "r_c" && row.name != "step_budget")
      row.set(all.parameters, row.min + (row.default_value - row.min) * (1.0 - 1e-3 / 7.0));
  }
  all.safety.max_force = 1.0 / 3.0;
  all.safety.fade_age = 0.1 / 3.0;
  all.placement.workspace_scale = 2.0 / 3.0;
  all.placement.clutch_button = 3;
  all.placement.world_from_device.rotate(Eigen::AngleAxisd(0.1 / 3.0, Vec3::UnitY()));
  const ServoCommands back = commands_from_json(to_json(settings), "settings");
  EXPECT_EQ(back.number, 9U);
  EXPECT_EQ(back.scene, 4U);
  EXPECT_TRUE(back.hold);
  EXPECT_EQ(back.settings.method, "sight");
  for (const ParameterInfo& row : parameter_table())
    EXPECT_EQ(bits(row.get(back.settings.parameters)), bits(row.get(all.parameters))) << row.name;
  for (const SafetyParameterInfo& row : safety_parameter_table())
    EXPECT_EQ(bits(row.get(back.settings.safety)), bits(row.get(all.safety))) << row.name;
  EXPECT_EQ(back.settings.placement.world_from_device.matrix(),
            all.placement.world_from_device.matrix());
  EXPECT_EQ(back.settings.placement.workspace_scale, all.placement.workspace_scale);
  EXPECT_EQ(back.settings.placement.clutch_button, 3);
}

TEST(Session, WithDamagedSettingsIsRefused) {
  std::string text = to_json(ServoCommands{});
  EXPECT_TRUE(fails_saying([&] { return commands_from_json(text.substr(9), "it"); }, "it"));
  text.replace(text.find("\"sight\""), 7, "17");
  EXPECT_TRUE(fails_saying([&] { return commands_from_json(text, "it"); }, "it"));
  EXPECT_TRUE(fails_saying([&] { return commands_from_json("{}", "it"); }, "it"));
  EXPECT_TRUE(fails_saying([&] { return session_from_json("[]", "it"); }, "it"));
  const std::string info = to_json(press_info());
  const std::size_t epoch = info.find("\"epoch_ns\":") + 11;
  for (const char* number : {"1e120", "9223372036854775808", "0.5", "true"}) {
    const std::string damaged =
        info.substr(0, epoch) + number + info.substr(info.find_first_of(",}", epoch));
    EXPECT_TRUE(fails_saying([&] { return session_from_json(damaged, "it"); }, "it")) << number;
  }
  const TickRows rows;
  std::vector<double> row = row_of(ServoTick{});
  row[0] = 0.25;
  EXPECT_EQ(rows.read(row, "it").tick.t, 0.25);
  row[13] = 3.0;
  EXPECT_TRUE(fails_saying([&] { return rows.read(row, "it"); }, "it", "state"));
  row[13] = 1e300;
  EXPECT_TRUE(fails_saying([&] { return rows.read(row, "it"); }, "it", "state"));
  row.pop_back();
  EXPECT_TRUE(fails_saying([&] { return rows.read(row, "it"); }, "it", "numbers"));
}

TEST(Session, IsThereUpToTheLastCommitWhenItsProgramIsKilled) {
  const TemporaryFolder folder;
  const fs::path bag = folder.path() / "bag";
  const pid_t child = fork();
  if (child == 0) {
    SessionWriter writer(bag, press_info(), 0.0);
    static_cast<void>(record_press(writer, {}, 100, false));
    writer.commit();
    ServoTick lost{};
    lost.number = 100;
    writer.tick(lost);
    raise(SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
  ASSERT_TRUE(fs::exists(bag / "metadata.yaml"));
  SessionReader reader(bag);
  EXPECT_EQ(reader.ticks(), 100U);
  const ReplayReport report = replay(reader);
  EXPECT_TRUE(report.identical()) << text_of(report);
  EXPECT_EQ(report.ticks, 100U);
}

TEST(Session, EndsWithAMessageWhereTheDiskIsFullAndKeepsWhatWasCommitted) {
  const TemporaryFolder folder;
  SessionWriter writer(folder.path() / "bag", press_info(), 0.0);
  writer.commands({}, 0.0);
  std::uint64_t committed = 0;
  const auto fill = [&] {
    for (std::uint64_t i = 0;; ++i) {
      ServoTick tick{};
      tick.number = i;
      writer.tick(tick);
      if (i % 100 != 99) continue;
      writer.commit();
      committed = i + 1;
    }
    return 0;
  };
  const auto usual = std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const rlimit small{.rlim_cur = 60'000, .rlim_max = before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  EXPECT_TRUE(fails_saying(fill, "bag_0.mcap", "full", "make room on the disk"));
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, usual);
  EXPECT_GE(committed, 100U);
  SessionReader reader(folder.path() / "bag");
  EXPECT_EQ(reader.ticks(), committed);
  EXPECT_EQ(reader.check().damage, "");
}

TEST(Session, IsASourceOfItsFrames) {
  const TemporaryFolder folder;
  {
    SessionWriter writer(folder.path() / "bag", press_info(), 0.0);
    static_cast<void>(record_press(writer, {}, 100));
  }
  const auto source = open_source("recording:" + (folder.path() / "bag").string());
  EXPECT_EQ(source->info().frames, 4U);
  for (int i = 0; i < 4; ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    const auto& image = dynamic_cast<const DepthImage&>(*frame->cloud);
    EXPECT_EQ(image.depth(), wavy_floor(i)->depth());
    EXPECT_EQ(frame->stamp, (i * 33 * 1e-3 - 1e-4 / 3.0) - (0.0 - 1e-4 / 3.0));
  }
  EXPECT_FALSE(source->next());
}

}  // namespace test_session
}  // namespace palpate
