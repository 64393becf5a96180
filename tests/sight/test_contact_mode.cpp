// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/sight/contact_mode.hpp"
#include "palpate/kernel/sight/sight.hpp"

namespace palpate {
namespace test_contact_mode {

using enum Evidence;

template <class Check>
void for_each_transition(const Check& check) {
  for (std::size_t m = 0; m < contact_modes; ++m) {
    for (std::size_t e = 0; e < evidences; ++e) {
      const auto mode = static_cast<ContactMode>(m);
      const auto evidence = static_cast<Evidence>(e);
      check(mode, evidence, next_mode(mode, evidence));
    }
  }
}

TEST(ContactMode, FollowsFromEachModeAndEvidenceByOneRule) {
  for_each_transition([](ContactMode from, Evidence evidence, ContactMode to) {
    SCOPED_TRACE("mode " + std::to_string(static_cast<int>(from)) + ", evidence " +
                 std::to_string(static_cast<int>(evidence)));
    const bool of_frame = evidence == seen || evidence == hidden || evidence == lost;
    const bool is_fitted = rests_on_fit(from) && evidence != lost;
    // Frames change what is known of the surface, ticks what the proxy does.
    EXPECT_EQ(is_followed(to), evidence == seen || (is_followed(from) && evidence != lost));
    EXPECT_EQ(is_hidden(to), evidence == hidden ? is_followed(from) : !of_frame && is_hidden(from));
    const bool is_groundless = evidence == on_fit && !is_followed(from);
    EXPECT_EQ(touches(to), of_frame || is_groundless ? touches(from) : evidence != left);
    EXPECT_EQ(rests_on_fit(to), of_frame ? is_fitted : evidence == on_fit && is_followed(from));
  });
}

TEST(ContactMode, ReachesEachModeFromEachOther) {
  std::array<std::array<bool, contact_modes>, contact_modes> reaches{};
  for_each_transition([&](ContactMode from, Evidence, ContactMode to) {
    reaches[static_cast<std::size_t>(from)][static_cast<std::size_t>(to)] = true;
  });
  for (std::size_t via = 0; via < contact_modes; ++via)
    for (std::size_t a = 0; a < contact_modes; ++a)
      for (std::size_t b = 0; b < contact_modes; ++b)
        reaches[a][b] = reaches[a][b] || (reaches[a][via] && reaches[via][b]);
  for (const auto& row : reaches)
    for (const bool reached : row) EXPECT_TRUE(reached);
}

// A camera 0.6 m above z = 0 that sees plates, waves and holes at random heights.
class RandomView {
 public:
  explicit RandomView(std::uint32_t seed) : random_(seed) {
    Intrinsics k;
    k.width = 96;
    k.height = 72;
    k.fx = k.fy = 240.0;
    k.cx = 47.5;
    k.cy = 35.5;
    rays_ = std::make_shared<ViewingRays>(k);
    pose_.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
    pose_.translation() = Vec3(0, 0, 0.6);
  }

  DepthImage shoot() {
    if (chance(0.1)) height_ += uniform(-0.06, 0.06);
    if (chance(0.05)) height_ = uniform(-0.05, 0.05);
    if (chance(0.05)) waves_ = chance(0.5) ? 0.0 : uniform(0.0, 6e-3);
    const bool empty = chance(0.05);
    if (chance(0.1)) visitor_ = chance(0.6) ? 0.0 : uniform(0.08, 0.3);
    const double edge = uniform(-0.2, 0.2);
    std::normal_distribution<double> noise(0.0, 5e-4);
    std::vector<std::uint16_t> depth;
    for (int v = 0; v < 72; ++v) {
      for (int u = 0; u < 96; ++u) {
        const double x = (u - 47.5) / 400.0;
        double z = 0.6 - height_ - waves_ * std::sin(600.0 * x) + noise(random_);
        if (visitor_ > 0.0 && x > edge) z = 0.6 - visitor_;
        depth.push_back(empty ? std::uint16_t{0} : static_cast<std::uint16_t>(z * 5e4));
      }
    }
    return DepthImage(rays_, std::move(depth), 5e4, pose_);
  }
  double uniform(double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random_);
  }
  bool chance(double p) { return uniform(0.0, 1.0) < p; }
  [[nodiscard]] double height() const { return height_; }

 private:
  std::mt19937 random_;
  std::shared_ptr<const ViewingRays> rays_;
  Eigen::Isometry3d pose_ = Eigen::Isometry3d::Identity();
  double height_ = 0.0, waves_ = 0.0, visitor_ = 0.0;
};

TEST(ContactMode, IsChangedByFramesAndTicksAsItsTableSaysWhateverIsSeen) {
  std::set<ContactMode> seen_modes;
  for (std::uint32_t seed = 1; seed <= 8; ++seed) {
    RandomView view(seed);
    Sight sight;
    Vec3 hip(0, 0, 0.05);
    sight.seat(hip);
    for (int k = 0; k < 150; ++k) {
      const DepthImage image = view.shoot();
      const double stamp = k / 30.0;
      ContactMode before = sight.mode();
      sight.observe({image, stamp});
      ContactMode after = sight.mode();
      ASSERT_EQ(touches(after), touches(before)) << "a frame alone makes and ends no contact";
      ASSERT_TRUE(!rests_on_fit(after) || rests_on_fit(before));
      seen_modes.insert(after);
      const double goal = view.height() + view.uniform(-0.02, 0.03);
      const Vec3 step = (Vec3(view.uniform(-0.02, 0.02), 0.0, goal) - hip) / 33.0;
      for (int i = 0; i < 33; ++i) {
        before = after;
        const Tick tick = sight.tick(hip += step, stamp + i * 1e-3);
        after = sight.mode();
        const bool released =
            (tick.flags & (free_space_released | proxy_let_go | returned_to_front)) != 0;
        ASSERT_TRUE(!is_hidden(after) || is_hidden(before)) << "a tick alone hides nothing";
        ASSERT_TRUE(is_hidden(after) || !is_hidden(before) || released)
            << "nor does it show what was hidden";
        ASSERT_TRUE(tick.state == ContactState::free_motion || touches(after));
        ASSERT_EQ((tick.flags & surface_hidden) != 0, is_hidden(after));
        seen_modes.insert(after);
      }
    }
  }
  EXPECT_EQ(seen_modes.size(), contact_modes) << "the views do not reach every mode";
}

}  // namespace test_contact_mode
}  // namespace palpate
