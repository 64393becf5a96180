// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <string_view>
#include <vector>

#include "lab/method.hpp"
#include "palpate/io/devices/hip_path.hpp"
#include "palpate/kernel/core/cloud.hpp"
#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/fixtures/fixture_set.hpp"
#include "palpate/net/teleop/robot.hpp"

namespace palpate::lab {

/// What a link does to what it carries, one way.
struct LinkQuality {
  double delay = 0.0;   ///< [s]
  double jitter = 0.0;  ///< [s] at most, to either side; never before it was sent
  double loss = 0.0;    ///< [-] share that never arrives
  /// [s] between which nothing arrives
  double down_from = std::numeric_limits<double>::infinity();
  double down_until = std::numeric_limits<double>::infinity();
};

/// One way of a link. What is overtaken by something newer is dropped, as by a mailbox.
template <class T>
class Channel {
 public:
  Channel(const LinkQuality& quality, std::uint64_t seed) : quality_(quality), random_(seed) {}

  void send(T value, double t) {
    const double chance = uniform();
    const double shift = quality_.jitter * (2.0 * uniform() - 1.0);
    if (chance < quality_.loss || (t >= quality_.down_from && t < quality_.down_until)) return;
    on_the_way_.push_back({std::move(value), t + std::max(quality_.delay + shift, 0.0), ++sent_});
  }

  /// The newest that has arrived by t, once.
  std::optional<T> arrived(double t) {
    std::optional<T> newest;
    for (auto it = on_the_way_.begin(); it != on_the_way_.end();) {
      if (it->due > t + 1e-9) {
        ++it;
        continue;
      }
      if (it->number > taken_) {
        taken_ = it->number;
        newest = std::move(it->value);
      }
      it = on_the_way_.erase(it);
    }
    return newest;
  }

 private:
  struct Parcel {
    T value;
    double due;  // [s]
    std::uint64_t number;
  };

  double uniform() { return static_cast<double>(random_() >> 11U) * 0x1p-53; }

  LinkQuality quality_;
  std::mt19937_64 random_;
  std::deque<Parcel> on_the_way_;
  std::uint64_t sent_ = 0, taken_ = 0;
};

/// A scene before a robot's camera, with who leads the robot.
struct TeleopScene {
  /// [s] -> what the camera sees; frame k is captured at k / frame_rate
  std::function<std::shared_ptr<const Cloud>(std::uint64_t frame, double t)> cloud;
  Truth truth;
  HipPath hand;     ///< where the operator wants to be [m, world]
  double duration;  ///< [s]
  double frame_rate = 30.0;
  double camera_latency = 0.03;  ///< [s] capture to the robot's computer
  /// [s] between which the camera gives nothing
  double dark_from = std::numeric_limits<double>::infinity();
  double dark_until = std::numeric_limits<double>::infinity();
  std::vector<double> marks = {};  ///< [s] ends of contacts, for their energy
};

/// Who is coupled to what, and how.
struct TeleopCase {
  std::string_view way;  ///< one of teleop_ways
  LinkQuality up = {}, down = {};
  Parameters parameters = {};
  std::uint64_t seed = 1;
  std::shared_ptr<const FixtureSet> fixtures = {};  ///< at both ends
  /// [s] from when on nothing of an end runs any more
  double operator_dies = std::numeric_limits<double>::infinity();
  double robot_dies = std::numeric_limits<double>::infinity();
};

/// `palpate`, and what others do: `wave` (wave variables), `tdpa` (time-domain passivity).
inline constexpr std::array<std::string_view, 4> teleop_ways{"palpate", "position-force", "wave",
                                                             "tdpa"};

/// A millisecond at both ends.
struct TeleopTick {
  double t = 0.0;                     ///< [s]
  double hand_speed = 0.0;            ///< [m/s]
  Vec3 force = Vec3::Zero();          ///< [N] on the operator's hand
  double shake = 0.0;                 ///< [m] rms above 20 Hz, of the last 0.25 s
  double work = 0.0;                  ///< [J] that the force has done on the hand so far
  Vec3 tool = Vec3::Zero();           ///< [m] world
  Vec3 tool_velocity = Vec3::Zero();  ///< [m/s]
  double depth = 0.0;                 ///< [m] of the tool in the true surface
  double contact = 0.0;               ///< [N] of the surface on the tool
};

/// Plays a case at 1 kHz. Deterministic.
void play_teleop(const TeleopScene& scene, const TeleopCase& one,
                 const std::function<void(const TeleopTick&)>& on_tick);

}  // namespace palpate::lab
