// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/pose.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_source {

using test::fails_saying;

// A stranger's camera: the least that compiles.
class TwoPoints final : public Source {
 public:
  explicit TwoPoints(const Uri& uri) {
    info_.uri = uri.text();
    info_.kind = "two points";
    info_.live = true;
    info_.clock = StampClock::sensor;
  }
  std::optional<Frame> next(double /*timeout*/) override {
    return Frame{1.5, std::make_shared<BruteForceCloud>(std::vector<Vec3>{Vec3::Zero()})};
  }
  [[nodiscard]] const SourceInfo& info() const override { return info_; }

 private:
  SourceInfo info_;
};

TEST(OpenSource, OpensASchemeThatAProgramAddedToACopyOfTheRegistry) {
  Registry<SourceScheme> schemes = standard_sources();
  const std::size_t standard = schemes.entries().size();
  schemes.add({"two-points", "two-points:, for a test",
               [](const Uri& uri) { return std::make_unique<TwoPoints>(uri); }});
  const auto camera = open_source("two-points:left?gain=2", schemes);
  EXPECT_EQ(camera->info().uri, "two-points:left?gain=2");
  EXPECT_TRUE(camera->info().live);
  EXPECT_EQ(camera->next()->stamp, 1.5);
  EXPECT_EQ(camera->skip(3), 0U) << "a source that cannot skip says so";
  camera->cancel();
  EXPECT_TRUE(open_source("synthetic:plane?size=4x3", schemes)->next());
  EXPECT_EQ(standard_sources().entries().size(), standard) << "the library's own is not changed";
  EXPECT_TRUE(fails_saying([] { return open_source("two-points:"); }, "unknown type of source",
                           "synthetic:", "recording:"));
  EXPECT_TRUE(fails_saying([&] { schemes.add({"tum", "", {}}); }, "'tum:'", "already"));
}

TEST(OpenSource, PutsTheCameraOfAnySchemeWhereTheUriSays) {
  const std::string pose = "1,-2,0.5,0,0,0.6,0.8";
  const Eigen::Isometry3d world_from_camera = parse_pose(pose, "it");
  const std::string plane = "synthetic:plane?noise=0mm&pose=" + pose + "&size=40x30";
  const auto source = open_source(plane);
  EXPECT_EQ(source->info().uri, plane);
  for (int i = 0; i < 2; ++i) {
    const auto frame = source->next();
    const auto& image = dynamic_cast<const DepthImage&>(*frame->cloud);
    EXPECT_TRUE(image.world_from_camera().isApprox(world_from_camera, 1e-15));
    const auto first = open_source("synthetic:plane?noise=0mm&size=40x30")->next();
    EXPECT_EQ(image.depth(), dynamic_cast<const DepthImage&>(*first->cloud).depth());
  }
  EXPECT_EQ(source->info().notes.size(), 1U);
  EXPECT_EQ(source->info().details, open_source("synthetic:plane?size=40x30")->info().details);

  const test::TemporaryFolder folder;
  const auto file = folder.write("some.pcd", "FIELDS x y z\nPOINTS 1\nDATA ascii\n1 2 3\n");
  const auto points = open_source("pcd:" + file.string() + "?scale=1m&pose=" + pose)->next();
  const auto& cloud = dynamic_cast<const PointCloud&>(*points->cloud);
  EXPECT_TRUE(cloud.point(0).isApprox(world_from_camera * Vec3(1, 2, 3), 1e-6));

  Registry<SourceScheme> schemes = standard_sources();
  std::string opened;
  schemes.add({"two-points", "two-points:, for a test", [&](const Uri& uri) {
                 opened = uri.text();
                 return std::make_unique<TwoPoints>(uri);
               }});
  const auto live = open_source("two-points:left?pose=" + pose, schemes);
  EXPECT_EQ(opened, "two-points:left");
  EXPECT_TRUE(live->info().live);
  EXPECT_EQ(live->info().uri, "two-points:left?pose=" + pose);
}

TEST(OpenSource, RefusesAPoseThatIsNone) {
  const std::string plane = "synthetic:plane?size=4x3&";
  const auto open = [&](const std::string& option) {
    return [uri = plane + option] { return open_source(uri); };
  };
  EXPECT_TRUE(fails_saying(open("pose=1,2,3"), "option 'pose'"));
  EXPECT_TRUE(fails_saying(open("pose"), "option 'pose'"));
  EXPECT_TRUE(fails_saying(open("pose=0,0,0,0,0,0,2"), "option 'pose'"));
  EXPECT_TRUE(fails_saying(open("pos=0,0,0,0,0,0,1"), "'pos'", "did you mean 'pose'"));
  EXPECT_TRUE(fails_saying(open("pose=0,0,0,0,0,0,1&pose="), "'pose'", "twice"));
}

TEST(OpenSource, SaysTheNearestSchemeAndASummaryOfEach) {
  EXPECT_TRUE(fails_saying([] { return open_source("synthetik:desk"); }, "synthetik:desk",
                           "did you mean 'synthetic:'?"));
  for (const SourceScheme& scheme : standard_sources().entries()) {
    EXPECT_EQ(scheme.summary.rfind(scheme.name + ":", 0), 0U) << scheme.name;
    EXPECT_TRUE(scheme.open) << scheme.name;
  }
}

TEST(OpenSource, TakesAFileOrFolderWithoutAScheme) {
  const test::TemporaryFolder folder;
  const std::string cup = folder.write("cup.ply", "ply").string();
  EXPECT_EQ(source_uri(cup), "ply:" + cup);
  EXPECT_EQ(source_uri(folder.path()), "ply:" + folder.path().string());
  folder.write("intrinsics.json", "{}");
  EXPECT_EQ(source_uri(folder.path()), "depth:" + folder.path().string());
  folder.write("depth.txt", "");
  EXPECT_EQ(source_uri(folder.path()), "tum:" + folder.path().string());
  EXPECT_EQ(source_uri("synthetic"), "synthetic:");
  EXPECT_EQ(source_uri("pcd:" + cup), "pcd:" + cup) << "a URI stays as it is";
  const test::TemporaryFolder empty;
  EXPECT_TRUE(fails_saying([&] { return source_uri(empty.path()); }, "nothing to touch", "TUM"));
  EXPECT_TRUE(
      fails_saying([] { return source_uri("nowhere.ply"); }, "'nowhere.ply'", "no such file"));
}

TEST(Source, ThatIsARecordingSaysSoAndLeavesOutFramesOnRequest) {
  const test::TemporaryFolder folder;
  for (int k = 0; k < 5; ++k)
    folder.write(std::to_string(k) + ".pcd",
                 "FIELDS x y z\nPOINTS 1\nDATA ascii\n" + std::to_string(k) + " 0 0\n");
  for (const std::string& uri : {std::string("synthetic:plane?size=4x3&fps=1Hz&frames=5"),
                                 "pcd:" + folder.path().string() + "?fps=1"}) {
    const auto source = open_source(uri);
    EXPECT_FALSE(source->info().live);
    EXPECT_EQ(source->info().clock, StampClock::recording);
    EXPECT_EQ(source->next(0.0)->stamp, 0.0);
    EXPECT_EQ(source->skip(2), 2U);
    EXPECT_EQ(source->next(0.0)->stamp, 3.0);
    EXPECT_EQ(source->skip(9), 1U) << "no more than there are";
    EXPECT_EQ(source->skip(9), 0U);
    EXPECT_FALSE(source->next(0.0));
  }
  EXPECT_EQ(open_source("synthetic:plane?size=4x3")->skip(1000000), 1000000U);
}

TEST(Source, OfASimulatedSensorSaysHowThatMeasures) {
  const auto sensor = [](const std::string& name) {
    return open_source("synthetic:plane?size=8x6&sensor=" + name)->info().sensor;
  };
  EXPECT_EQ(sensor("ideal"), SensorKind::unknown);
  EXPECT_EQ(sensor("d4xx"), SensorKind::stereo);
  EXPECT_EQ(sensor("kinect"), SensorKind::structured_light);
  EXPECT_EQ(sensor("tof"), SensorKind::time_of_flight);
  EXPECT_EQ(name_of(StampClock::monotonic), "monotonic");
}

TEST(Source, OfFilesTakesTheKindOfSensorThatItIsTold) {
  const test::TemporaryFolder folder;
  folder.write("0.pcd", "FIELDS x y z\nPOINTS 1\nDATA ascii\n0 0 0\n");
  const std::string uri = "pcd:" + folder.path().string();
  EXPECT_EQ(open_source(uri)->info().sensor, SensorKind::unknown);
  for (const SensorKind kind : {SensorKind::unknown, SensorKind::stereo,
                                SensorKind::structured_light, SensorKind::time_of_flight}) {
    std::string name(name_of(kind));
    std::replace(name.begin(), name.end(), ' ', '-');
    EXPECT_EQ(open_source(uri + "?sensor=" + name)->info().sensor, kind) << name;
  }
  EXPECT_TRUE(test::fails_saying([&] { open_source(uri + "?sensor=lidar"); }, "lidar",
                                 "structured-light", "time-of-flight"));
}

}  // namespace test_source
}  // namespace palpate
