// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"

namespace palpate::test {

constexpr double wall_depth = 0.5;  // [m] before the camera

/// A wall across a camera's view: the camera is at the origin and looks along z.
/// @param depth  [mm]
inline std::shared_ptr<const DepthImage> wall(std::uint16_t depth = 500) {
  static const auto rays = std::make_shared<const ViewingRays>(
      Intrinsics{.width = 120, .height = 90, .fx = 200, .fy = 200, .cx = 59.5, .cy = 44.5});
  return std::make_shared<DepthImage>(rays, std::vector<std::uint16_t>(120 * 90, depth), 1000.0);
}

/// A recording whose frames a function makes: frame k, from 0; none is the end.
class MadeSource final : public Source {
 public:
  using Make = std::function<std::optional<Frame>(int k)>;
  explicit MadeSource(Make make, SourceInfo info = {.uri = "made:", .kind = "made"})
      : make_(std::move(make)), info_(std::move(info)) {}

  std::optional<Frame> next(double /*timeout*/) override {
    std::optional<Frame> frame = make_(next_);
    if (frame) ++next_;
    return frame;
  }
  [[nodiscard]] const SourceInfo& info() const override { return info_; }

 private:
  Make make_;
  SourceInfo info_;
  int next_ = 0;
};

/// The wall at 30 Hz for ever.
inline std::unique_ptr<Source> wall_source() {
  return std::make_unique<MadeSource>([cloud = wall()](int k) { return Frame{k / 30.0, cloud}; });
}

}  // namespace palpate::test
