// SPDX-License-Identifier: Apache-2.0
// The experiment `zwidth`: theory and loop agree, and what the safety chain cuts does not count.
#include <algorithm>
#include <string>
#include <string_view>

#include <gtest/gtest.h>

#include "lab/experiments/zwidth.hpp"
#include "lab/runner.hpp"
#include "palpate/io/devices/device_body.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate::lab {
namespace test_zwidth {

ZHolding holding(std::string_view device, std::string_view hand) {
  for (const ZHolding& one : z_holdings()) {
    if (one.name == device && one.hand.name == hand) return one;
  }
  ADD_FAILURE() << "no " << device << " in a hand " << hand;
  return {};
}

TEST(ZWidth, AHandleWithoutFrictionIsWhatTheLinearLoopSays) {
  const ZScene plane("plane", "ideal", 1);
  for (const std::string_view hand : {"none", "light"}) {
    const ZHolding held = holding("touch-0N", hand);
    for (const double damping : {0.0, 2.0}) {
      const SampledWall wall = {.handle = {.mass = 0.06 + held.hand.mass,
                                           .damping = 0.7 + held.hand.damping,
                                           .stiffness = held.hand.stiffness},
                                .damping = damping};
      const double theory = linear_stiffness(wall, stiffest);
      EXPECT_NEAR(largest_stiffness({&plane, &held, "ideal", damping, false}, {}), theory,
                  0.06 * theory)
          << hand << ", k_d = " << damping;
    }
  }
}

TEST(ZWidth, ADampedSurfaceOf1500NewtonsAMetreDecaysUnderAHandleThatNobodyHolds) {
  for (const std::string_view scene_name : {"plane", "corner"}) {
    const ZScene scene(scene_name, "d4xx", 1);
    for (const std::string_view device : {"touch-0.05N", "touch-0.26N"}) {
      const ZHolding held = holding(device, "none");
      EXPECT_TRUE(poke({&scene, &held, "sight", 4.0, false}, {}, 1500.0).decays())
          << scene_name << ", " << device;
      if (scene_name == "corner") continue;  // noise shakes it, and the chain may soften that
      EXPECT_TRUE(poke({&scene, &held, "sight", 4.0, true}, {}, 1500.0).decays()) << device;
    }
    const ZHolding held = holding("touch-0.05N", "none");
    EXPECT_FALSE(poke({&scene, &held, "sight", 0.0, false}, {}, 1500.0).decays()) << scene_name;
  }
}

TEST(ZWidth, WhatTheSafetyChainSoftensDoesNotDecayByItself) {
  const ZScene plane("plane", "ideal", 1);
  const ZHolding held = holding("touch-0N", "none");
  const ZTrial cut = poke({&plane, &held, "ideal", 0.0, true}, {}, 1200.0);
  EXPECT_TRUE(cut.cut);
  EXPECT_LT(cut.speed, 0.2 * poke({&plane, &held, "ideal", 0.0, false}, {}, 1200.0).speed);
  EXPECT_FALSE(cut.decays());
}

TEST(ZWidth, AHandThatFeelsNothingIsNoContact) {
  const ZScene plane("plane", "ideal", 1);
  const ZHolding held = holding("touch-0.26N", "none");
  Parameters weak;
  weak.coupling.max_force = 0.0;
  const ZTrial through = poke({&plane, &held, "ideal", 0.0, false}, weak, 300.0);
  EXPECT_EQ(through.force, 0.0);
  EXPECT_FALSE(through.decays());
}

TEST(ZWidth, IsAnExperiment) {
  const test::TemporaryFolder folder;
  ExperimentOptions options;
  options.families = {"plane"};
  options.methods = {"ideal"};
  options.parameters.coupling.damping = 4.0;
  const Experiment& zwidth = find_experiment("zwidth");
  const Table table("zwidth", run_experiment(zwidth, options, {}, folder.path() / "zwidth.csv"));
  EXPECT_EQ(table.rows(), 4U * 3U * 2U) << "devices, hands, ways";
  const Scores scores = zwidth.scores(table);
  EXPECT_EQ(scores.rows.size(), 12U);
  EXPECT_EQ(scores.rows.front().size(), scores.columns.size());
  options.families = {"plain"};
  EXPECT_TRUE(test::fails_saying([&] { return zwidth.cells(zwidth, options); }, "--families plain",
                                 "did you mean 'plane'?"));
}

}  // namespace test_zwidth
}  // namespace palpate::lab
