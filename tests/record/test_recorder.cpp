// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "palpate/record/recorder.hpp"
#include "palpate/record/replay.hpp"

#include "tests/record/sessions.hpp"
#include "tests/servo/fake_device.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace {

using test::FakeDevice;
using test::TemporaryFolder;
using test::wavy_floor;

// A loop on a clock of its own: a hand that presses into a floor which rises, method and limits
// that change on the way.
class LoopSession {
 public:
  explicit LoopSession(Method method) {
    settings_.rendering.method = method;
    cycle_ = std::make_unique<Cycle>(rendering_by<Renderer>(), device_, settings_);
  }

  void record(const std::filesystem::path& folder) {
    const bool is_on = tick_ > 0;
    recorder_ = std::make_unique<Recorder>(
        folder, SessionInfo{.kind = SessionInfo::Kind::live, .version = "test"}, cycle_->reader(),
        is_on ? [this] { cycle_->renew(rendering_by<Renderer>()); } : std::function<void()>{});
    recorder_->settings({settings_number_, settings_}, now());
    if (frame_ > 0) recorder_->frame(frame_, stamp_, {cloud_});
  }

  void run(int ticks) {
    for (int i = 0; i < ticks; ++i, ++tick_) {
      if (recorder_ && tick_ % 50 == 0) recorder_->flush();
      if (tick_ % 33 == 0) {
        cloud_ = wavy_floor(tick_ / 33 % 10);
        stamp_ = now() - 1e-4 / 3.0;
        frame_ = cycle_->put_frame(cloud_, stamp_, now());
        if (recorder_ && handing_) recorder_->frame(frame_, stamp_, {cloud_});
      }
      if (tick_ % 70 == 69) {
        settings_.rendering.coupling.stiffness += 100.0 / 3.0;  // a few times
        settings_number_ = cycle_->set_settings(settings_);
        if (recorder_) recorder_->settings({settings_number_, settings_}, now());
      }
      device_.hand.position = Vec3(0.03 + 1e-5 * tick_, -0.05, -0.02 - 1e-4 * std::min(tick_, 300));
      cycle_->run({.t = now()});
    }
  }

  void hand_no_more_frames() { handing_ = false; }
  [[nodiscard]] Recorder& recorder() { return *recorder_; }

 private:
  [[nodiscard]] double now() const {
    return 1000.0 / 3.0 + 1e-3 * tick_ + (tick_ > 150 ? 0.02 : 0);
  }

  FakeDevice device_;
  ServoSettings settings_;
  std::uint64_t settings_number_ = 0;
  std::unique_ptr<Cycle> cycle_;
  std::shared_ptr<const Cloud> cloud_;
  double stamp_ = 0.0;
  std::uint64_t frame_ = 0;
  int tick_ = 0;
  bool handing_ = true;
  std::unique_ptr<Recorder> recorder_;  // before the cycle, which it reads
};

class RecorderOf : public ::testing::TestWithParam<Method> {};

TEST_P(RecorderOf, ASessionFromItsStartIsReplayedBitForBit) {
  const TemporaryFolder folder;
  LoopSession session(GetParam());
  session.record(folder.path() / "bag");
  session.run(400);  // with a stall of 20 ms in it
  session.recorder().stop();
  EXPECT_EQ(session.recorder().status().trouble, "");
  EXPECT_EQ(session.recorder().status().ticks, 400U);
  SessionReader reader(folder.path() / "bag");
  const ReplayReport report = replay(reader);
  EXPECT_TRUE(report.identical()) << report.field << " " << report.broken_off;
  EXPECT_EQ(report.ticks, 400U);
  double largest = 0.0;
  bool reseated = false;
  for (std::size_t i = 0; i < reader.ticks(); ++i) {
    largest = std::max(largest, reader.tick(i).tick.force.norm());
    reseated = reseated || (reader.tick(i).hand & proxy_reseated) != 0;
  }
  EXPECT_GT(largest, 1.0);
  EXPECT_TRUE(reseated);
}

TEST_P(RecorderOf, ASessionInItsMidstIsReplayedBitForBit) {
  const TemporaryFolder folder;
  LoopSession session(GetParam());
  session.run(210);
  session.record(folder.path() / "bag");
  session.run(300);
  session.recorder().stop();
  EXPECT_EQ(session.recorder().status().trouble, "");
  SessionReader reader(folder.path() / "bag");
  ASSERT_GE(reader.ticks(), 200U);
  const ServoTick first = reader.tick(0);
  EXPECT_NE(first.hand & rendering_renewed, 0U);
  EXPECT_NE(reader.tick(10).tick.state, ContactState::free_motion);  // in the midst of a touch
  EXPECT_GT(reader.tick(100).tick.force.norm(), 1.0);
  const ReplayReport report = replay(reader);
  EXPECT_TRUE(report.identical()) << report.field << " " << report.broken_off;
}

INSTANTIATE_TEST_SUITE_P(Methods, RecorderOf, ::testing::Values(Method::paper, Method::sight),
                         [](const auto& each) { return std::string(method_name(each.param)); });

TEST(Recorder, EndsWithTheLastTickWhoseFrameItKnows) {
  const TemporaryFolder folder;
  LoopSession session(Method::paper);
  session.record(folder.path() / "bag");
  session.run(120);
  session.hand_no_more_frames();
  session.run(100);  // the next frame comes with tick 132
  session.recorder().stop();
  SessionReader reader(folder.path() / "bag");
  const ReplayReport report = replay(reader);
  EXPECT_TRUE(report.identical()) << report.broken_off;
  EXPECT_EQ(report.ticks, 132U);
}

TEST(Recorder, EndsWithAMessageWhereItsFolderIsTakenAwayAndTheLoopGoesOn) {
  const TemporaryFolder folder;
  LoopSession session(Method::paper);
  session.record(folder.path() / "bag");
  std::filesystem::rename(folder.path() / "bag", folder.path() / "elsewhere");
  session.run(1000);
  const Recorder::Status status = session.recorder().status();
  EXPECT_NE(status.trouble.find("metadata.yaml"), std::string::npos) << status.trouble;
  session.run(100);
}

}  // namespace
}  // namespace palpate
