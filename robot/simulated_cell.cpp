// SPDX-License-Identifier: Apache-2.0
#include "robot/simulated_cell.hpp"

#include <array>

#include "palpate/kernel/core/error.hpp"

#include "robot/simulated_camera.hpp"

namespace palpate::robot {
namespace {

constexpr std::array<std::string_view, 26> options = {
    "plate",   "plate_stroke",    "plate_rate",  "max_force",    "max_speed",      "arm",
    "hole",    "plate_stiffness", "margin",      "latency",      "size",           "fps",
    "fov",     "distance",        "tilt",        "azimuth",      "seed",           "sensor",
    "noise",   "noise_grows",     "correlation", "quantisation", "disparity_step", "dropouts",
    "grazing", "flying"};

void check(const Uri& uri) {
  uri.allow_only(options);
  if (uri.path() == "desk") return;
  throw Error(uri.text(), "there is no model '" + uri.path() + "'", "write mujoco:desk");
}

SimulationSetup simulation_setup(const Uri& uri) {
  SimulationSetup setup;
  setup.plate.height = uri.number_option("plate", setup.plate.height, 0.0, 0.2, "m");
  setup.plate.stroke = uri.number_option("plate_stroke", setup.plate.stroke, 0.0, 0.2, "m");
  setup.plate.frequency = uri.number_option("plate_rate", setup.plate.frequency, 0.0, 5.0, "Hz");
  setup.max_force = uri.number_option("max_force", setup.max_force, 0.5, 30.0);
  setup.max_speed = uri.number_option("max_speed", setup.max_speed, 0.01, 1.0);
  if (uri.has("plate_stiffness"))
    setup.plate_stiffness = uri.number_option("plate_stiffness", 0.0, 50.0, 5e3);
  setup.hole = uri.number_option("hole", setup.hole, 0.011, 0.06, "m");
  return setup;
}

std::unique_ptr<Source> make_camera(const Uri& uri, const std::shared_ptr<Simulation>& simulation) {
  check(uri);
  SimulatedCameraSetup setup;
  setup.camera = camera_setup(uri);
  setup.sensor = camera_sensor(uri);
  const std::string arm = uri.text_option("arm", "hidden");
  if (arm != "hidden" && arm != "remembered" && arm != "seen")
    throw Error(uri.text() + ": option 'arm'", "there is no '" + arm + "'",
                "write arm=hidden, arm=remembered or arm=seen");
  setup.arm = arm == "seen"         ? ArmView::seen
              : arm == "remembered" ? ArmView::remembered
                                    : ArmView::hidden;
  setup.margin = uri.number_option("margin", setup.margin, 0.0, 0.1, "m");
  setup.latency = uri.number_option("latency", setup.latency, 0.0, 0.4, "s");
  SourceInfo info;
  info.uri = uri.text();
  info.sensor = camera_kind(uri);
  return std::make_unique<SimulatedCamera>(simulation, setup, std::move(info));
}

class SimulatedRobot final : public Robot {
 public:
  SimulatedRobot(std::shared_ptr<Simulation> simulation, const std::string& uri)
      : simulation_(std::move(simulation)), info_(simulation_->info()) {
    info_.uri = uri;
  }
  [[nodiscard]] const RobotInfo& info() const override { return info_; }
  void command(const HandPose& pose, const Vec3& velocity, double /*t*/) noexcept override {
    simulation_->command(pose, velocity);
  }
  [[nodiscard]] std::optional<RobotState> state() override { return simulation_->state(); }

 private:
  std::shared_ptr<Simulation> simulation_;
  RobotInfo info_;
};

}  // namespace

SimulatedCell::SimulatedCell(const Uri& uri, Pace pace) : uri_(uri) {
  check(uri);
  simulation_ = std::make_shared<Simulation>(simulation_setup(uri));
  if (pace == Pace::real_time) simulation_->start();
}

std::unique_ptr<Robot> SimulatedCell::robot() const {
  return std::make_unique<SimulatedRobot>(simulation_, uri_.text());
}

std::unique_ptr<Source> SimulatedCell::camera() const { return make_camera(uri_, simulation_); }

SourceScheme SimulatedCell::source_scheme() const {
  return {"mujoco", "mujoco:desk?KEY=VALUE&...: the camera of the robot's simulated cell",
          [simulation = simulation_](const Uri& uri) { return make_camera(uri, simulation); }};
}

}  // namespace palpate::robot
