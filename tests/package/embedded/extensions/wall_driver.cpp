// SPDX-License-Identifier: Apache-2.0
// A stranger's camera: this file, and nothing elsewhere.
#include "palpate/drivers/drivers.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"

namespace palpate {
namespace {

// Sees a wall at 0.5 m.
class Wall final : public Source {
 public:
  explicit Wall(const Uri& uri) {
    info_.uri = uri.text();
    info_.kind = "wall";
    info_.frame_rate = 30.0;
  }
  [[nodiscard]] const SourceInfo& info() const override { return info_; }
  std::optional<Frame> next(double /*timeout*/) override {
    return Frame{number_++ / 30.0, std::make_shared<DepthImage>(
                                       rays_, std::vector<std::uint16_t>(160 * 120, 500), 1000.0)};
  }

 private:
  int number_ = 0;
  SourceInfo info_;
  std::shared_ptr<const ViewingRays> rays_ = std::make_shared<ViewingRays>(
      Intrinsics{.width = 160, .height = 120, .fx = 150, .fy = 150, .cx = 79.5, .cy = 59.5});
};

}  // namespace

Driver wall_driver() {
  return {.name = "wall",
          .summary = "a wall",
          .tried = "nothing",
          .open_camera = [](const Uri& uri) { return std::make_unique<Wall>(uri); },
          .look = [] { return DriverReport{.library = "none"}; }};
}

}  // namespace palpate
