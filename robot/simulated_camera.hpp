// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "palpate/io/sources/sensor_model.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/net/teleop/behind_arm.hpp"
#include "palpate/servo/end_signal.hpp"

#include "robot/simulation.hpp"

namespace palpate::robot {

/// How the robot's own arm appears in the image.
enum class ArmView : std::uint8_t {
  seen,        ///< as any other body
  hidden,      ///< its pixels are holes: what is touched is the scene, not the robot
  remembered,  ///< its pixels show what was seen there before it came; see BehindArm
};

struct SimulatedCameraSetup {
  CameraSetup camera;
  SensorModel sensor;
  ArmView arm = ArmView::hidden;
  /// [m] by which the arm is thought thicker than it is when it is hidden, for what noise moves
  double margin = 0.003;
  double latency = 0.0;  ///< [s] from capture until a live camera gives the frame, 0 to 0.4
};

/// A depth camera in a simulated cell.
///
/// While the simulation runs in real time it is live: stamps are on the servo loop's clock, and a
/// frame that is not taken in time is lost. Otherwise it is a recording of the simulation, which
/// `next` advances to the frame's time k / frame_rate where it is not there yet.
class SimulatedCamera final : public Source {
 public:
  /// @throws Error if the set-up does not validate.
  SimulatedCamera(std::shared_ptr<Simulation> simulation, const SimulatedCameraSetup& setup,
                  SourceInfo info = {});

  std::optional<Frame> next(double timeout = no_timeout) override;
  std::size_t skip(std::size_t count) override;
  void cancel() noexcept override { cancelled_.give(); }
  [[nodiscard]] const SourceInfo& info() const override { return info_; }

  /// The frame of these poses; its noise depends on the seed and the number alone.
  [[nodiscard]] Frame capture(const BodyPoses& poses, std::uint64_t frame);
  [[nodiscard]] const SimulatedCameraSetup& setup() const { return setup_; }

 private:
  [[nodiscard]] std::optional<Frame> live(double timeout);

  std::shared_ptr<Simulation> simulation_;
  SimulatedCameraSetup setup_;
  Sensor sensor_;
  SourceInfo info_;
  std::shared_ptr<const ViewingRays> rays_;
  std::vector<Shape> thick_;            // of the arm's geoms, by the margin; one per geom
  std::vector<float> resting_, depth_;  // bodies at rest, drawn once; and the newest image
  std::vector<float> arm_;              // the thickened arm
  std::optional<BehindArm> behind_arm_;
  std::uint64_t next_frame_ = 0;
  std::optional<double> first_;  // [s] of a live camera's frame 0

  EndSignal cancelled_;
};

}  // namespace palpate::robot
