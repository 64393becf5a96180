// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "palpate/servo/cycle.hpp"
#include "palpate/servo/device.hpp"

namespace palpate {

/// Is something wrong with a hand, so that the others of its session must not push either?
///
/// Its device reports a fault of its own, its safety chain has latched or refuses what it gets, or
/// its ticks do not come. Not: nobody holds it, or it is clutched; nor a frame that is late, which
/// every hand of a session sees for itself. [servo]
/// @param t        [s] now
/// @param silence  [s] without a tick, the first included; infinite where no clock drives the ticks
bool is_in_trouble(const CycleStatistics& hand, double t, double silence) noexcept;

/// The device of one of several hands of a session: as it is, but that it reports
/// DeviceFault::another_hand while one of the others is in trouble.
///
/// A person who holds something between two fingers or two hands is pushed by both; if one force
/// went and the other stayed, that would be a kick. The fault takes this hand's force away as any
/// fault of its device does, and after it the hand has to engage anew. As it comes from the
/// device's read, it is recorded and replayed with the rest of it.
class LinkedDevice final : public Device {
 public:
  /// @param device  must not be null
  explicit LinkedDevice(std::unique_ptr<Device> device) : device_(std::move(device)) {}

  /// Says whom to look at; before the first `read`.
  /// @param others   of the other hands' cycles
  /// @param silence  [s] as is_in_trouble's
  void link(std::vector<std::shared_ptr<const CycleStatistics>> others, double silence) {
    others_ = std::move(others);
    silence_ = silence;
  }

  [[nodiscard]] const DeviceInfo& info() const override { return device_->info(); }
  HandState read(double t) noexcept override;
  void write(const Vec3& force, double t) noexcept override { device_->write(force, t); }
  void enable() override { device_->enable(); }
  void disable() noexcept override { device_->disable(); }
  [[nodiscard]] std::string fault_text() const override { return device_->fault_text(); }
  [[nodiscard]] bool drives() const override { return device_->drives(); }
  void start(CycleCallback cycle) override { device_->start(std::move(cycle)); }
  void stop() noexcept override { device_->stop(); }

 private:
  std::unique_ptr<Device> device_;
  std::vector<std::shared_ptr<const CycleStatistics>> others_;
  double silence_ = std::numeric_limits<double>::infinity();
};

}  // namespace palpate
