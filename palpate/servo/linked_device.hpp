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
/// Its device reports a fault, its safety chain has latched or rejects its input, or its ticks have
/// stopped. Not: nobody holds the device, or it is clutched; nor a late frame, which every hand of
/// a session detects itself. [servo]
/// @param t        [s] now
/// @param silence  [s] without a tick, the first included; infinite where no clock drives the ticks
bool is_in_trouble(const CycleStatistics& hand, double t, double silence) noexcept;

/// Wrapper for the device of one hand in a session with several hands. It forwards all calls, and
/// reports DeviceFault::another_hand while another hand has a fault.
///
/// If only one of two opposing forces stopped, the other would give the user a sudden push. The
/// fault sets this hand's force to zero as any fault of its device does; afterwards the hand must
/// engage again. Since it comes from the device's read, it is recorded and replayed.
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
  void write(const Wrench& wrench, double t) noexcept override { device_->write(wrench, t); }
  void announce(const palpate_gate_wish& wish) noexcept override { device_->announce(wish); }
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
