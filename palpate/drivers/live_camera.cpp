// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/live_camera.hpp"

#include <algorithm>
#include <cstring>

#include "palpate/io/sources/depth_png.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {
namespace {

constexpr double longest_slice = 0.1;  // [s] after which `cancel` is heard

}  // namespace

std::optional<Frame> LiveCamera::next(double timeout) {
  const double end = monotonic_now() + timeout;
  for (double left = timeout; !is_cancelled_; left = end - monotonic_now()) {
    std::optional<Frame> frame = wait(std::clamp(left, 0.0, longest_slice));
    if (frame) return frame;
    if (monotonic_now() >= end) break;
  }
  return std::nullopt;
}

std::vector<std::uint16_t> depth_rows(const void* data, int width, int height, std::size_t stride,
                                      const std::string& camera) {
  const std::size_t row = sizeof(std::uint16_t) * static_cast<std::size_t>(std::max(width, 0));
  if (data == nullptr || width < 1 || height < 1 || stride < row)
    throw Error(camera,
                "it gives images of " + size_text(width, height) + " pixels in rows of " +
                    std::to_string(stride) + " bytes",
                "its library or firmware may be of another version");
  std::vector<std::uint16_t> depth(static_cast<std::size_t>(width) *
                                   static_cast<std::size_t>(height));
  const auto* from = static_cast<const std::byte*>(data);
  auto* to = reinterpret_cast<std::byte*>(depth.data());
  for (int v = 0; v < height; ++v, from += stride, to += row) std::memcpy(to, from, row);
  return depth;
}

std::shared_ptr<ColourImage> colour_rows(const void* data, int width, int height, int stride) {
  if (data == nullptr || width < 1 || height < 1 || stride < 3 * width) return nullptr;
  auto image = std::make_shared<ColourImage>();
  image->width = width;
  image->height = height;
  image->rgb.reserve(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  const auto* from = static_cast<const std::uint8_t*>(data);
  for (int v = 0; v < height; ++v, from += stride)
    image->rgb.insert(image->rgb.end(), from, from + 3 * width);
  return image;
}

}  // namespace palpate
