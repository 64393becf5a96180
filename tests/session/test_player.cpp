// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/session/player.hpp"

#include "tests/session/fakes.hpp"
#include "tests/support/errors.hpp"

namespace palpate {
namespace test_player {

using test::fails_saying;
using test::MadeSource;
using test::wall;

std::unique_ptr<Source> stamped(std::vector<double> stamps) {
  return std::make_unique<MadeSource>([stamps = std::move(stamps)](int k) -> std::optional<Frame> {
    if (k >= static_cast<int>(stamps.size())) return std::nullopt;
    return Frame{stamps[static_cast<std::size_t>(k)], wall()};
  });
}

// What comes until `end` [s] of a clock of 1 kHz.
std::vector<FedFrame> played(Player& source, double end) {
  std::vector<FedFrame> frames;
  for (int i = 0; 1e-3 * i <= end; ++i) {
    while (auto frame = source.next_until(1e-3 * i)) frames.push_back(*frame);
  }
  return frames;
}

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(Player, GivesEachFrameWhenItIsDueWithOneOffset) {
  Player source(stamped({7.0, 7.1, 7.15, 7.4}), [] { return stamped({7.0, 7.1}); });
  EXPECT_EQ(source.first_frame().stamp, 7.0);
  const std::vector<FedFrame> frames = played(source, 0.41);
  ASSERT_EQ(frames.size(), 4U);
  for (const FedFrame& fed : frames) {
    EXPECT_NEAR(fed.frame.stamp, fed.source_stamp - 7.0, 1e-12);
    EXPECT_TRUE(fed.is_new);
  }
  EXPECT_EQ(source.status().frames, 4U);
}

// The k-th frame of a recording of 2.5 s.
std::vector<double> slow(double first) {
  return {first, first + 0.5, first + 1.0, first + 1.5, first + 2.0, first + 2.5};
}

TEST(Player, BeginsAgainAnIntervalAfterTheLastFrameAndSaysThatTimeJumps) {
  Player source(stamped(slow(0.0)), [] { return stamped(slow(50.0)); });
  const std::vector<FedFrame> frames = played(source, 6.2);
  ASSERT_EQ(frames.size(), 13U);
  for (std::size_t k = 0; k < frames.size(); ++k) {
    EXPECT_NEAR(frames[k].frame.stamp, 0.5 * static_cast<double>(k), 1e-12);
    EXPECT_TRUE(frames[k].is_new);
    EXPECT_EQ(frames[k].after_jump, k == 6 || k == 12) << k;
  }
  EXPECT_FALSE(source.status().stays_valid);
}

TEST(Player, StaysOnItsLastFrameWhereItIsShortOrCannotBeginAgain) {
  const auto open = [] { return stamped({}); };
  Player brief(stamped({4.0, 4.1, 4.2}), open);
  Player given(stamped(slow(4.0)), {});
  for (auto& [source, last] : {std::pair<Player&, double>(brief, 0.2), {given, 2.5}}) {
    EXPECT_FALSE(source.first_frame().cloud == nullptr);
    const std::vector<FedFrame> frames = played(source, last + 0.11);
    const auto count = static_cast<std::ptrdiff_t>(frames.size());
    ASSERT_GT(count, 5);
    for (auto fed = frames.begin(); fed != frames.end(); ++fed) {
      const double after = static_cast<double>(fed - frames.end() + 4) / 30.0;
      EXPECT_FALSE(fed->after_jump);
      EXPECT_EQ(fed->is_new, after < 0.01);
      if (fed->is_new) continue;
      EXPECT_NEAR(fed->frame.stamp, last + after, 1e-9);
      EXPECT_EQ(fed->frame.cloud, frames[static_cast<std::size_t>(count - 4)].frame.cloud);
    }
    EXPECT_TRUE(source.status().stays_valid);
  }
}

TEST(Player, ShowsASingleFrameAgainAtThirtyHertz) {
  Player source(stamped({3.0}), [] { return stamped({}); });
  const std::vector<FedFrame> frames = played(source, 1.001);
  ASSERT_EQ(frames.size(), 31U);
  EXPECT_TRUE(frames[0].is_new);
  for (std::size_t k = 1; k < frames.size(); ++k) {
    EXPECT_NEAR(frames[k].frame.stamp, static_cast<double>(k) / 30.0, 1e-9);
    EXPECT_FALSE(frames[k].is_new);
    EXPECT_EQ(frames[k].frame.cloud, frames[0].frame.cloud);
  }
  EXPECT_TRUE(source.status().stays_valid);
}

TEST(Player, LeavesOutFramesWhoseStampsCannotBeTrue) {
  Player source(stamped({nan, 0.0, 0.1, 0.1, 0.05, nan, 0.2}), [] { return stamped({0.0}); });
  const std::vector<FedFrame> frames = played(source, 0.22);
  ASSERT_EQ(frames.size(), 3U);
  for (std::size_t k = 0; k < frames.size(); ++k)
    EXPECT_NEAR(frames[k].frame.stamp, 0.1 * static_cast<double>(k), 1e-12);
  EXPECT_EQ(source.status().dropped, 4U);
}

TEST(Player, GoesOnWhenItsClockIsSet) {
  Player source(stamped({100.0, 100.1, 20.0, 20.1, 1e12, 1e12 + 0.1}),
                [] { return stamped({0.0}); });
  const std::vector<FedFrame> frames = played(source, 0.51);
  ASSERT_EQ(frames.size(), 6U);
  for (std::size_t k = 0; k < frames.size(); ++k)
    EXPECT_NEAR(frames[k].frame.stamp, 0.1 * static_cast<double>(k), 1e-3);
  for (std::size_t k = 0; k < frames.size(); ++k)
    EXPECT_EQ(frames[k].after_jump, k == 2 || k == 4) << k;
}

TEST(Player, EndsEachLookAtASourceThatRepeatsOneStampForEver) {
  Player source(std::make_unique<MadeSource>([](int) {
                  return Frame{1.0, wall()};
                }),
                [] { return stamped({0.0}); });
  EXPECT_EQ(played(source, 0.02).size(), 1U);
  EXPECT_GT(source.status().dropped, 0U);
}

TEST(Player, TakesALiveCameraOnTheSessionsClockAsItsFramesCome) {
  double now = 0.0;
  Player source(
      std::make_unique<MadeSource>(
          [&now](int k) {
            const double stamp = 0.1 * k;
            return stamp <= now ? std::optional(Frame{stamp, wall()}) : std::nullopt;
          },
          SourceInfo{.uri = "page:", .kind = "page", .live = true, .clock = StampClock::session}),
      {});
  EXPECT_EQ(source.first_frame().stamp, 0.0);
  std::vector<double> stamps;
  for (int i = 0; i <= 250; ++i) {
    now = 1e-3 * i;
    while (auto fed = source.next_until(now)) stamps.push_back(fed->frame.stamp);
  }
  EXPECT_EQ(stamps, (std::vector{0.0, 0.1, 0.2}));
  EXPECT_FALSE(source.has_ended());
}

TEST(Player, RefusesLiveCamerasAndEmptyRecordings) {
  const auto open = [] { return stamped({}); };
  const auto live = [] {
    return std::make_unique<MadeSource>(
        [](int k) {
          return Frame{0.1 * k, wall()};
        },
        SourceInfo{.uri = "camera:", .kind = "camera", .live = true});
  };
  EXPECT_TRUE(fails_saying([&] { Player(live(), open); }, "camera:", "real time"));
  EXPECT_TRUE(fails_saying([&] { return Player(stamped({}), open).first_frame().stamp; }, "made:"));
  EXPECT_TRUE(fails_saying(
      [&] {
        return Player(stamped({nan, nan}), open).first_frame().stamp;
      },
      "made:"));
  Player gone(stamped(slow(0.0)), open);
  EXPECT_TRUE(fails_saying([&] { return played(gone, 4.0).size(); }, "no frames any more"));
}

TEST(Player, GoesToAPlaceBeyondFramesThatCannotBeRead) {
  const auto made = [] {
    return std::make_unique<MadeSource>(
        [read = 0](int) mutable -> std::optional<Frame> {
          const int k = read++;
          if (k == 3) throw Error("made:", "frame 3 is damaged", "leave it out");
          return k < 10 ? std::optional(Frame{0.1 * k, wall()}) : std::nullopt;
        },
        SourceInfo{.uri = "made:", .kind = "made", .frames = 10});
  };
  Player player(made(), made);
  ASSERT_TRUE(player.next_until(0.0));
  double t = 0.0;
  for (const auto& [share, stamp] : {std::pair(1.0, 0.9), {5.0 / 9.0, 0.5}}) {
    player.seek(share);
    EXPECT_TRUE(fails_saying([&] { return player.next_until(t += 1.0).has_value(); }, "damaged"));
    const std::optional<FedFrame> fed = player.next_until(t);
    ASSERT_TRUE(fed);
    EXPECT_NEAR(fed->source_stamp, stamp, 1e-12);
    EXPECT_TRUE(fed->after_jump);
  }
  EXPECT_EQ(player.status().place, 5U);
  EXPECT_NEAR(player.status().recorded_time, 0.5, 1e-12);
  EXPECT_EQ(player.status().dropped, 2U);
}

TEST(Player, SaysThatTimeJumpsWhereItIsClosedAndBeginsAgain) {
  Player player(stamped(slow(0.0)), [] { return stamped(slow(0.0)); });
  EXPECT_FALSE(player.next_until(0.0)->after_jump);
  player.close();
  EXPECT_FALSE(player.next_until(0.01)) << "an interval after the frame before";
  EXPECT_TRUE(player.next_until(0.04)->after_jump);
}

TEST(Player, KeepsTheStampsOfTheSourceWhereItsFramesAreTakenByThem) {
  Player player(stamped({5.0, 5.1, 5.1, nan, 5.05, 2.0, 2.1, 30.0}), {}, Playing::by_its_stamps);
  EXPECT_EQ(player.first_frame().stamp, 5.0);
  EXPECT_FALSE(player.next_until(4.9));
  for (const double stamp : {5.0, 5.1, 2.0, 2.1, 30.0}) {
    const std::optional<FedFrame> fed = player.next_until(stamp);
    ASSERT_TRUE(fed) << stamp;
    EXPECT_EQ(fed->frame.stamp, stamp);
  }
  EXPECT_FALSE(player.next_until(100.0)) << "nothing is repeated";
  EXPECT_TRUE(player.has_ended());
  EXPECT_EQ(player.status().dropped, 3U);
}

TEST(PosedSource, PutsDepthImagesAndPointsWhereTheCameraStands) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = Vec3(1.0, 2.0, 3.0);
  pose.rotate(Eigen::AngleAxisd(0.5, Vec3::UnitY()));

  const auto image = with_pose(stamped({4.0}), pose)->next();
  ASSERT_TRUE(image);
  EXPECT_EQ(image->stamp, 4.0);
  const DepthImage* posed = image->cloud->image();
  ASSERT_NE(posed, nullptr);
  EXPECT_TRUE(posed->world_from_camera().isApprox(pose, 0.0));
  EXPECT_EQ(posed->depth(), wall()->depth());

  const auto beside = std::make_shared<ColourImage>();
  beside->camera = ColourImage::Camera();
  beside->camera->world_from_camera.translation() = Vec3(0.015, 0.0, 0.0);
  const auto coloured = with_pose(std::make_unique<MadeSource>([&](int) {
                                    return Frame{.stamp = 0.0, .cloud = wall(), .colour = beside};
                                  }),
                                  pose)
                            ->next();
  EXPECT_TRUE(coloured->colour->camera->world_from_camera.translation().isApprox(
      pose * Vec3(0.015, 0.0, 0.0), 1e-12));

  const std::vector<Vec3> points = {{0.0, 0.0, 1.0}, {0.1, 0.0, 1.0}, {0.0, 0.1, 1.2}};
  const auto cloud =
      with_pose(std::make_unique<MadeSource>([&](int) {
                  return Frame{0.0, std::make_shared<PointCloud>(points, Vec3(0.0, 0.0, 0.5))};
                }),
                pose)
          ->next();
  ASSERT_TRUE(cloud);
  const auto* moved = dynamic_cast<const PointCloud*>(cloud->cloud.get());
  ASSERT_NE(moved, nullptr);
  ASSERT_EQ(moved->size(), points.size());
  ASSERT_TRUE(moved->viewpoint());
  EXPECT_TRUE(moved->viewpoint()->isApprox(pose * Vec3(0.0, 0.0, 0.5), 1e-12));
  // The cloud may keep its points in another order: each is where one of ours was taken to.
  for (const Vec3& point : points) {
    double nearest = 1.0;
    for (std::size_t i = 0; i < moved->size(); ++i)
      nearest = std::min(nearest, (moved->point(i) - pose * point).norm());
    EXPECT_LT(nearest, 1e-6);
  }
}

TEST(PosedSource, RefusesACloudOfAnotherKind) {
  class Nothing final : public Cloud {
   public:
    void gather(const Ball&, std::size_t, Patch&) const noexcept override {}
    void gather(const Beam&, std::size_t, Patch&) const noexcept override {}
  };
  const auto source = with_pose(std::make_unique<MadeSource>([](int) {
                                  return Frame{0.0, std::make_shared<Nothing>()};
                                }),
                                Eigen::Isometry3d::Identity());
  EXPECT_TRUE(fails_saying([&] { return source->next()->stamp; }, "made:", "pose"));
}

}  // namespace test_player
}  // namespace palpate
