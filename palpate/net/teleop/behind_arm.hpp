// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// Fills the area that a robot's arm occludes with the surface that a fixed camera saw there
/// before.
///
/// The pixels of the arm get the last measurement at that pixel, so that the user does not feel the
/// arm and does not lose the surface under it. A stored value is deleted, and the pixel becomes a
/// hole,
/// - after `kept`;
/// - if the arm is seen behind the stored value: that surface has gone;
/// - if the visible surface around it has moved since the arm came, by more than 0.5 mm and four
///   standard deviations of the noise.
/// Drawback: an object that moves while completely occluded stays in the image at its old position.
class BehindArm {
 public:
  struct Options {
    double kept = 30.0;       ///< [s]
    double tolerance = 0.01;  ///< [m] by which the arm is behind what it shows to have gone
  };

  BehindArm(int width, int height) : BehindArm(width, height, Options()) {}
  /// @throws Error if an option is out of range or there are no pixels.
  BehindArm(int width, int height, const Options& options);

  /// Fills one frame.
  /// @param readings  depth image in `units` a metre, 0: not measured
  /// @param arm       [m] depth of the arm where it hides the scene, infinity elsewhere
  /// @param t         [s] of capture; not before the last one's, or all is forgotten
  void fill(std::span<std::uint16_t> readings, std::span<const float> arm, double units, double t);
  void forget() noexcept;

 private:
  struct Block {
    bool hidden = false;  // partly
    bool moved = false;
    double way = 0.0;    // [m] mean of the visible surface, since the arm came, over some frames
    double noise = 0.0;  // [m^2] variance of a pixel's way from one frame to the next
  };
  static constexpr int side = 16;  // [px] of a block
  [[nodiscard]] std::size_t block_of(std::size_t pixel) const;
  template <class Test>
  [[nodiscard]] bool any_around(std::size_t block, const Test& test) const;
  void look_for_motion(std::span<const std::uint16_t> readings, std::span<const float> arm,
                       double units);

  Options options_;
  int width_, columns_, rows_;
  struct Known {
    float mean = 0.0F;  // of the last readings, so that a hidden surface is not one frame's noise
    std::uint8_t frames = 0;  // that are in it, up to most_frames
  };
  void know(std::size_t pixel, std::uint16_t reading, double units) noexcept;
  static constexpr int most_frames = 8;
  std::vector<Known> known_;
  std::vector<std::uint16_t> last_;    // measured; 0: nothing is known
  std::vector<double> when_;           // [s] of that
  std::vector<std::uint16_t> before_;  // as it was when the arm came near
  std::vector<bool> was_hidden_;
  std::vector<Block> blocks_;
  double t_ = 0.0;  // [s]
};

}  // namespace palpate
