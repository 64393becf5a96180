// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/teleop/behind_arm.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

constexpr double least_motion = 0.5e-3;  // [m]
constexpr double sure = 4.0;             // [-] standard deviations of a block's mean
constexpr double alike = 25.0;           // [px] that a stereo camera's noise moves together
constexpr double largest_step = 5e-3;    // [m] that one pixel counts: an edge is not a motion
constexpr int least_pixels = 32;         // of a block that say something
constexpr double new_share = 0.25;       // [-] of a frame in a block's mean and noise

}  // namespace

BehindArm::BehindArm(int width, int height, const Options& options)
    : options_(options),
      width_(width),
      columns_((width + side - 1) / side),
      rows_((height + side - 1) / side) {
  if (width < 1 || height < 1) throw Error("arm's memory", "an image has no pixels", "give some");
  if (!(options.kept >= 0.0 && options.tolerance >= 0.0))
    throw Error("arm's memory", "a time or a distance is negative", "give 0 or more");
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  last_.resize(pixels);
  known_.resize(pixels);
  when_.resize(pixels);
  before_.resize(pixels);
  was_hidden_.resize(pixels);
  blocks_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
}

void BehindArm::forget() noexcept {
  std::fill(last_.begin(), last_.end(), std::uint16_t{0});
  std::fill(before_.begin(), before_.end(), std::uint16_t{0});
  std::fill(was_hidden_.begin(), was_hidden_.end(), false);
  std::fill(blocks_.begin(), blocks_.end(), Block());
}

std::size_t BehindArm::block_of(std::size_t pixel) const {
  const auto width = static_cast<std::size_t>(width_);
  return pixel / width / side * static_cast<std::size_t>(columns_) + pixel % width / side;
}

// Of a block and the eight about it.
template <class Test>
bool BehindArm::any_around(std::size_t block, const Test& test) const {
  const int row = static_cast<int>(block) / columns_;
  const int column = static_cast<int>(block) % columns_;
  for (int y = std::max(row - 1, 0); y <= std::min(row + 1, rows_ - 1); ++y) {
    for (int x = std::max(column - 1, 0); x <= std::min(column + 1, columns_ - 1); ++x) {
      if (test(blocks_[static_cast<std::size_t>(y * columns_ + x)])) return true;
    }
  }
  return false;
}

void BehindArm::look_for_motion(std::span<const std::uint16_t> readings, std::span<const float> arm,
                                double units) {
  struct Sum {
    double way = 0.0;      // [m] since the arm came
    double scatter = 0.0;  // [m^2] of the way since the last frame
    int count = 0;
  };
  std::vector<Sum> sums(blocks_.size());
  const auto way_from = [&](std::uint16_t before, std::uint16_t now) {
    return std::clamp((static_cast<double>(now) - before) / units, -largest_step, largest_step);
  };
  for (std::size_t i = 0; i < readings.size(); ++i) {
    if (std::isfinite(arm[i]) || readings[i] == 0 || before_[i] == 0 || last_[i] == 0) continue;
    Sum& sum = sums[block_of(i)];
    const double step = way_from(last_[i], readings[i]);
    sum.way += way_from(before_[i], readings[i]);
    sum.scatter += step * step;
    ++sum.count;
  }
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    const Sum& sum = sums[b];
    Block& block = blocks_[b];
    block.moved = false;
    if (sum.count < least_pixels) continue;
    block.way += new_share * (sum.way / sum.count - block.way);
    block.noise += new_share * (sum.scatter / sum.count - block.noise);
    const double of_mean = std::sqrt(block.noise * std::min(alike / sum.count, 1.0));
    block.moved = std::abs(block.way) > std::max(least_motion, sure * of_mean);
    if (block.moved) block.way = 0.0;
  }
}

void BehindArm::know(std::size_t pixel, std::uint16_t reading, double units) noexcept {
  Known& known = known_[pixel];
  const float off = static_cast<float>(reading) - known.mean;
  if (last_[pixel] == 0 || std::abs(off) > largest_step * units) known = {};
  known.frames = static_cast<std::uint8_t>(std::min(known.frames + 1, most_frames));
  known.mean += (static_cast<float>(reading) - known.mean) / static_cast<float>(known.frames);
}

void BehindArm::fill(std::span<std::uint16_t> readings, std::span<const float> arm, double units,
                     double t) {
  if (readings.size() != last_.size() || arm.size() != last_.size())
    throw Error("arm's memory", "an image has another size", "give those of one camera");
  if (t < t_) forget();
  t_ = t;
  for (Block& block : blocks_) block.hidden = false;
  for (std::size_t i = 0; i < arm.size(); ++i)
    if (std::isfinite(arm[i])) blocks_[block_of(i)].hidden = true;
  look_for_motion(readings, arm, units);
  std::vector<bool> near(blocks_.size());   // the arm hides some of it, or of a neighbour
  std::vector<bool> moved(blocks_.size());  // the same of what moved
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    near[b] = any_around(b, [](const Block& one) { return one.hidden; });
    moved[b] = any_around(b, [](const Block& one) { return one.moved; });
  }
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const std::size_t b = block_of(i);
    if (!std::isfinite(arm[i])) {
      if (!near[b] || moved[b] || was_hidden_[i] || before_[i] == 0) before_[i] = readings[i];
      if (readings[i] != 0) {
        know(i, readings[i], units);
        last_[i] = readings[i];
        when_[i] = t;
      }
    } else {
      const bool gone = arm[i] > known_[i].mean / units + options_.tolerance;
      if (moved[b] || gone || t - when_[i] > options_.kept) last_[i] = 0;
      readings[i] = last_[i] == 0 ? std::uint16_t{0}
                                  : static_cast<std::uint16_t>(std::lround(known_[i].mean));
    }
    was_hidden_[i] = std::isfinite(arm[i]);
  }
}

}  // namespace palpate
