// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "palpate/io/sources/source.hpp"

namespace palpate {

/// What cameras that are driven by a library have in common: waiting in short slices, so that
/// `cancel` is heard whatever the library does with its time-outs.
class LiveCamera : public Source {
 public:
  std::optional<Frame> next(double timeout) final;
  void cancel() noexcept final { is_cancelled_ = true; }
  [[nodiscard]] const SourceInfo& info() const final { return info_; }

 protected:
  explicit LiveCamera(SourceInfo info) : info_(std::move(info)) { info_.live = true; }
  /// The next frame, waited for up to `seconds` [s], at most 0.1. @throws Error
  virtual std::optional<Frame> wait(double seconds) = 0;

  SourceInfo info_;

 private:
  std::atomic<bool> is_cancelled_{false};
};

/// The rows of an image without what pads them.
/// @param stride  [bytes] from row to row
/// @throws Error naming the camera if a row is longer than its stride.
std::vector<std::uint16_t> depth_rows(const void* data, int width, int height, std::size_t stride,
                                      const std::string& camera);

/// The same of a colour image: red, green, blue. Null if it is none.
std::shared_ptr<ColourImage> colour_rows(const void* data, int width, int height, int stride);

}  // namespace palpate
