// SPDX-License-Identifier: Apache-2.0
// A camera in one class, opened by a URI of its own.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include <palpate/kernel/cloud/depth_image.hpp>
#include <palpate/session/session.hpp>

// Sees a wall that moves 10 mm to and fro, like a chest that breathes.
class BreathingWall final : public palpate::Source {
 public:
  explicit BreathingWall(const palpate::Uri& uri)
      : period_(uri.number_option("period", 4.0, 1.0, 60.0, "s")) {
    info_.uri = uri.text();
    info_.kind = "breathing wall";
    info_.frame_rate = 30.0;
  }
  [[nodiscard]] const palpate::SourceInfo& info() const override { return info_; }

  std::optional<palpate::Frame> next(double /*timeout*/) override {
    const double stamp = number_++ / 30.0;
    const double depth = 0.5 + 0.005 * std::sin(2.0 * std::numbers::pi * stamp / period_);  // [m]
    const auto raw = static_cast<std::uint16_t>(std::lround(10'000.0 * depth));
    return palpate::Frame{stamp, std::make_shared<palpate::DepthImage>(
                                     rays_, std::vector<std::uint16_t>(160 * 120, raw), 10'000.0)};
  }

 private:
  double period_;  // [s]
  int number_ = 0;
  palpate::SourceInfo info_;
  std::shared_ptr<const palpate::ViewingRays> rays_ =
      std::make_shared<palpate::ViewingRays>(palpate::Intrinsics{
          .width = 160, .height = 120, .fx = 150, .fy = 150, .cx = 79.5, .cy = 59.5});
};

int main() {
  palpate::SessionOptions options;
  options.sources.add({"breathing", "a wall that moves: breathing:?period=SECONDS",
                       [](const palpate::Uri& uri) -> std::unique_ptr<palpate::Source> {
                         return std::make_unique<BreathingWall>(uri);
                       }});
  options.cameras.push_back({.uri = "breathing:?period=3"});
  options.pace = palpate::Pace::free_running;
  options.stroke_time = 6.0;
  palpate::Session session(std::move(options));
  session.run(6.0);
  const palpate::SessionState state = session.state();
  const palpate::Summary& felt = state.hands[0].summary;
  std::printf("%s: %zu frames, felt %.1f N, pop-throughs: %zu\n", state.cameras[0].kind.c_str(),
              felt.frames, felt.largest_sent, felt.pop_throughs);
}
