// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "palpate/kernel/core/patch.hpp"

namespace palpate::lab::field {

/// A scripted hand: one action after another, each with the least jerk; positions in metres, world.
class Script {
 public:
  explicit Script(const Vec3& start) : end_(start), start_(start) {}

  Script& wait(double seconds);
  /// Straight to a place. @param speed  [m/s] the fastest on the way
  Script& reach(const Vec3& to, double speed);
  /// Along straight pieces from place to place, the whole way as one movement.
  Script& stroke(const std::vector<Vec3>& places, double speed);
  /// Whatever else. @param place  where the hand is at a time [s] of the script
  Script& follow(double seconds, std::function<Vec3(double t)> place);

  [[nodiscard]] double duration() const { return now_; }  ///< [s] so far
  [[nodiscard]] const Vec3& end() const { return end_; }  ///< [m] where the hand is then
  [[nodiscard]] Vec3 at(double t) const;

 private:
  struct Action {
    double begin, end;
    std::function<Vec3(double t)> place;
  };
  std::vector<Action> actions_;
  double now_ = 0.0;
  Vec3 end_;
  Vec3 start_;
};

}  // namespace palpate::lab::field
