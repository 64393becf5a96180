// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "palpate/drivers/drivers.hpp"
#include "palpate/drivers/reopener.hpp"
#include "palpate/drivers/shared_library.hpp"
#include "palpate/io/devices/device_body.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace open_haptics {
namespace {

constexpr std::string_view scheme = "touch:";
constexpr unsigned long scheduler_rate = 1000;  // [Hz]
constexpr unsigned short priority = 65535 / 2;  // the scheduler's default
constexpr double call_time = 0.5;               // [s] for a call of the driver to end
constexpr int failures_of_loss = 20;            // ticks in a row that fail before it is opened anew
constexpr int ticks_a_look = 256;               // between two looks at calibration and motors
constexpr double rest_after_error = 0.5;        // [s] without a force after the driver took it off
constexpr double too_warm = 0.95;               // of 0 (cold) to 1
constexpr double cool_enough = 0.85;

// As the headers of OpenHaptics 3 number them.
enum Name : unsigned {
  current_buttons = 0x2000,
  current_position = 0x2050,   // [mm]
  current_transform = 0x2052,  // 4 x 4, column by column, [mm]
  device_model_type = 0x2501,
  device_serial_number = 0x2504,
  usable_workspace_dimensions = 0x2551,  // [mm] lowest, highest
  calibration_style = 0x2555,
  nominal_max_force = 0x2603,             // [N]
  nominal_max_continuous_force = 0x2604,  // [N]
  motor_temperature = 0x2605,             // 6
  current_force = 0x2700,                 // [N]
  force_output = 0x4000
};
enum Calibration : unsigned { ok = 0x5000, needs_update = 0x5001, needs_manual_input = 0x5002 };
enum ErrorCode : unsigned {
  success = 0,
  warm_motors = 0x200,
  exceeded_max_force = 0x201,
  force_error = 0x204,
  device_fault = 0x300,
  comm_error = 0x302,
  comm_config_error = 0x303
};
constexpr unsigned invalid_handle = 0xFFFFFFFF;

struct ErrorInfo {  // returned by value
  unsigned code;
  int internal_code;
  unsigned handle;
};
static_assert(sizeof(ErrorInfo) == 12);

const std::vector<std::string>& usb() {
  static const std::vector<std::string> ids = {"2988", "0301:2988"};
  return ids;
}

LibraryNames names() {
  return {.name = std::string(scheme) + " (OpenHaptics)",
          .files = {"libHD.so", "libHD.so.3.4.0", "libHD.so.3.0.0", "libHD.so.3.0",
                    "/usr/lib/libHD.so", "/usr/local/lib/libHD.so"},
          .variable = "PALPATE_OPENHAPTICS",
          .remedy = "install OpenHaptics and the Touch driver of support.3dsystems.com"};
}

struct Hd {
  // The newest error, and none is left.
  unsigned take_errors() const noexcept {
    unsigned newest = success;
    for (int i = 0; i < 16; ++i) {
      const ErrorInfo error = get_error();
      if (error.code == success) break;
      if (newest == success) newest = error.code;
    }
    return newest;
  }
  [[nodiscard]] std::string text_of(unsigned code) const {
    const char* text = get_error_string(code);
    return text == nullptr ? "error " + std::to_string(code) : text;
  }
  [[nodiscard]] std::string text(Name name) const {
    const char* value = get_string(name);
    return take_errors() != success || value == nullptr ? "" : value;
  }
  template <std::size_t Count>
  [[nodiscard]] std::array<double, Count> numbers(Name name) const noexcept {
    std::array<double, Count> values{};
    get_double(name, values.data());
    return values;
  }
  // Within a frame: whether it is calibrated, after it has calibrated what it can by itself.
  [[nodiscard]] unsigned calibration() const noexcept {
    unsigned state = check_calibration();
    if (state == needs_update) {
      int styles = 0;
      get_integer(calibration_style, &styles);
      for (const unsigned style : {4U, 2U, 1U}) {  // inkwell, automatic, encoders
        if ((static_cast<unsigned>(styles) & style) == 0) continue;
        update_calibration(style);
        state = check_calibration();
        break;
      }
    }
    return state;
  }
  // The same in a frame of its own.
  [[nodiscard]] unsigned calibration_of(unsigned device) const noexcept {
    begin_frame(device);
    const unsigned state = calibration();
    end_frame(device);
    return state;
  }
  [[nodiscard]] double warmest_motor() const noexcept {
    const auto values = numbers<6>(motor_temperature);
    return *std::max_element(values.begin(), values.end());
  }

  SharedLibrary library{names()};
  unsigned (*init_device)(const char* name) = library.find("hdInitDevice");
  void (*disable_device)(unsigned device) = library.find("hdDisableDevice");
  void (*make_current_device)(unsigned device) = library.find("hdMakeCurrentDevice");
  void (*begin_frame)(unsigned device) = library.find("hdBeginFrame");
  void (*end_frame)(unsigned device) = library.find("hdEndFrame");
  void (*enable)(unsigned what) = library.find("hdEnable");
  void (*disable)(unsigned what) = library.find("hdDisable");
  void (*get_double)(unsigned name, double* values) = library.find("hdGetDoublev");
  void (*get_integer)(unsigned name, int* values) = library.find("hdGetIntegerv");
  const char* (*get_string)(unsigned name) = library.find("hdGetString");
  void (*set_double)(unsigned name, const double* values) = library.find("hdSetDoublev");
  ErrorInfo (*get_error)() = library.find("hdGetError");
  const char* (*get_error_string)(unsigned code) = library.find("hdGetErrorString");
  unsigned long (*schedule_asynchronous)(unsigned (*callback)(void*), void* data,
                                         unsigned short priority) =
      library.find("hdScheduleAsynchronous");
  void (*unschedule)(unsigned long handle) = library.find("hdUnschedule");
  void (*set_scheduler_rate)(unsigned long hertz) = library.find("hdSetSchedulerRate");
  void (*start_scheduler)() = library.find("hdStartScheduler");
  void (*stop_scheduler)() = library.find("hdStopScheduler");
  unsigned (*check_calibration)() = library.find("hdCheckCalibration");
  void (*update_calibration)(unsigned style) = library.find("hdUpdateCalibration");
};

// What the models are good for, by a part of the vendor's name; CHAI3D's table.
struct Model {
  std::string_view name;
  double force;      // [N]
  double stiffness;  // [N/m]
  double damping;    // [N s/m]
};
constexpr std::array models = {Model{"Desktop", 7.9, 1000.0, 5.0},
                               Model{"Touch X", 7.9, 1000.0, 5.0},
                               Model{"Premium 3", 22.0, 1000.0, 5.0},
                               Model{"Premium", 8.5, 800.0, 5.0}, Model{"Omni", 3.3, 700.0, 5.0}};
constexpr Model touch{"Touch", 3.3, 400.0, 4.0};

const Model& model_of(std::string_view type) {
  const auto* const model = std::find_if(models.begin(), models.end(), [&](const Model& one) {
    return type.find(one.name) != std::string_view::npos;
  });
  return model == models.end() ? touch : *model;
}

// OpenHaptics' axes are x to the right, y up, z towards the user.
Vec3 from_device(const double* v) { return {v[0], -v[2], v[1]}; }
std::array<double, 3> to_device(const Vec3& v) { return {v.x(), v.z(), -v.y()}; }

struct Wanted {
  std::string uri, name;
  double slew = 500.0;  // [N/s]
  std::optional<double> max_force = {};
};

class Pen final : public Device {
 public:
  Pen(std::shared_ptr<const Hd> hd, Wanted wanted)
      : hd_(std::move(hd)), wanted_(std::move(wanted)) {
    open();
    try {
      identify();
    } catch (...) {
      hd_->disable_device(handle_);
      throw;
    }
    reopener_ = std::make_unique<Reopener>([this] { return open_again(); });
  }
  ~Pen() override {
    stop();
    reopener_.reset();
    hd_->make_current_device(handle_);
    hd_->disable(force_output);
    hd_->disable_device(handle_);
  }

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  [[nodiscard]] bool drives() const override { return true; }

  void start(CycleCallback cycle) override {
    const std::lock_guard lock(scheduler_);
    cycle_ = std::move(cycle);
    ending_.store(false, std::memory_order_release);
    run_scheduler();
    if (const unsigned error = hd_->take_errors(); error != success) {
      stop_scheduler();
      throw Error(info_.uri, "its scheduler does not start (" + hd_->text_of(error) + ")",
                  "close other programs that use it");
    }
  }
  void stop() noexcept override {
    ending_.store(true, std::memory_order_release);
    const std::lock_guard lock(scheduler_);
    stop_scheduler();
  }

  HandState read(double t) noexcept override {
    HandState state = last_;
    state.present = false;
    state.fault = DeviceFault::disconnected;
    if (reopener_->is_lost()) return state;
    const std::unique_lock turn(calls_, std::try_to_lock);
    if (!turn) return state;
    in_frame_ = true;
    hd_->begin_frame(handle_);
    state.position = 1e-3 * from_device(hd_->numbers<3>(current_position).data());
    const auto transform = hd_->numbers<16>(current_transform);
    Eigen::Matrix3d pen;
    for (int column = 0; column < 3; ++column)
      pen.col(column) = from_device(&transform[4 * static_cast<std::size_t>(column)]);
    int buttons = 0;
    hd_->get_integer(current_buttons, &buttons);
    state.buttons = static_cast<std::uint32_t>(buttons);
    state.orientation = Eigen::Quaterniond(pen).normalized();
    if (!state.orientation->coeffs().allFinite()) state.orientation.reset();
    double warmest = -1.0;
    if (++ticks_ % ticks_a_look == 0) {
      calibration_ = hd_->calibration();
      warmest = hd_->warmest_motor();
    }
    if (!judge(hd_->take_errors(), t)) {
      in_frame_ = false;
      hd_->end_frame(handle_);
      hd_->take_errors();
      return state;
    }
    if (warmest > too_warm) hot_.store(true, std::memory_order_relaxed);
    if (warmest >= 0.0 && warmest < cool_enough) hot_.store(false, std::memory_order_relaxed);
    state.fault = fault(t);
    state.present = state.fault == DeviceFault::none;
    last_ = state;
    return state;
  }

  void write(const Vec3& force, double t) noexcept override {
    const bool in_frame = std::exchange(in_frame_, false);
    if (reopener_->is_lost()) return;
    const std::unique_lock turn(calls_, std::try_to_lock);
    if (!turn) return;
    if (!in_frame) hd_->begin_frame(handle_);  // the last write, which no read came before
    const bool enabled = enabled_.load(std::memory_order_acquire);
    const bool passes = enabled && fault_.load(std::memory_order_relaxed) == DeviceFault::none;
    sent_ = passes ? slewed(force, t) : Vec3::Zero();
    last_write_ = t;
    hd_->set_double(current_force, to_device(sent_).data());
    hd_->end_frame(handle_);
    judge(hd_->take_errors(), t);
    if (enabled && !enabled_.load(std::memory_order_acquire)) hd_->disable(force_output);
  }

  void enable() override {
    unsigned error = success;
    const bool called = call_when_free(calls_, call_time, [&] {
      hd_->make_current_device(handle_);
      hd_->take_errors();
      hd_->enable(force_output);
      error = hd_->take_errors();
      if (error == success) enabled_.store(true, std::memory_order_release);
    });
    if (!called) throw Error(info_.uri, "its driver does not answer", "plug it in again");
    if (error != success)
      throw Error(info_.uri, "its forces cannot be switched on (" + hd_->text_of(error) + ")",
                  "switch the device off and on again");
  }

  // While the scheduler's thread is within a call, that one switches the force off when it returns.
  void disable() noexcept override {
    enabled_.store(false, std::memory_order_release);
    const std::unique_lock turn(calls_, std::try_to_lock);
    if (!turn) return;
    hd_->make_current_device(handle_);
    hd_->disable(force_output);
  }

  [[nodiscard]] std::string fault_text() const override {
    switch (fault_.load(std::memory_order_relaxed)) {
      case DeviceFault::not_calibrated:
        return "it is not calibrated: put the pen into its holder (the inkwell)";
      case DeviceFault::refused_command:
        return "its driver took the force off (too strong or too sudden); it comes back by itself";
      default:
        return {};
    }
  }

 private:
  void open() {
    const unsigned handle = hd_->init_device(wanted_.name.empty() ? nullptr : wanted_.name.c_str());
    const unsigned error = hd_->take_errors();
    if (error == success && handle != invalid_handle) {
      handle_ = handle;
      return;
    }
    const std::string why = "cannot be opened (" + hd_->text_of(error) + ")";
    for (const std::string& found : usb_ids()) {
      if (is_usb_of(found, usb()))
        throw Error(wanted_.uri, "it is plugged in (USB " + found + ") but " + why,
                    usb_permission_remedy(found) +
                        "; one with /dev/ttyACM0 needs your account in the group dialout");
    }
    throw Error(wanted_.uri, "it " + why,
                "check power and cable, and that Touch_Setup shows a device of that name");
  }

  void identify() {
    hd_->make_current_device(handle_);
    if (hd_->calibration_of(handle_) != ok) {
      hd_->take_errors();
      throw Error(wanted_.uri, "it is not calibrated",
                  "put the pen into its holder (the inkwell) and start again");
    }
    const std::string type = hd_->text(device_model_type);
    const Model& model = model_of(type);
    const double told = hd_->numbers<1>(nominal_max_force)[0];
    const double told_continuous = hd_->numbers<1>(nominal_max_continuous_force)[0];
    const double peak = told > 0.0 ? std::min(told, model.force) : model.force;
    const DevicePreset& preset = device_preset("touch");
    const double continuous =
        told_continuous > 0.0 ? told_continuous : preset.limits.continuous_force;
    const double most = std::min(wanted_.max_force.value_or(peak), peak);
    info_.uri = wanted_.uri;
    info_.kind = (type.empty() ? std::string(model.name) : type) + " by OpenHaptics";
    info_.limits = {.max_force = most,
                    .continuous_force = std::min(continuous, most),
                    .max_stiffness = model.stiffness,
                    .max_damping = model.damping};
    if (model.force <= touch.force) {
      info_.damping = preset.body.damping;
      info_.delay = preset.body.delay;
    }
    const auto reach = hd_->numbers<6>(usable_workspace_dimensions);
    const Vec3 a = 1e-3 * from_device(reach.data());
    const Vec3 b = 1e-3 * from_device(&reach[3]);
    if ((a - b).cwiseAbs().minCoeff() > 0.0)
      info_.reach = DeviceReach{a.cwiseMin(b), a.cwiseMax(b)};
    info_.rate = scheduler_rate;
    info_.serial = hd_->text(device_serial_number);
    hd_->take_errors();  // of what this model does not tell
  }

  void run_scheduler() {
    callback_ = hd_->schedule_asynchronous(&Pen::called, this, priority);
    hd_->set_scheduler_rate(scheduler_rate);
    hd_->start_scheduler();
    running_ = true;
  }
  void stop_scheduler() noexcept {
    if (!std::exchange(running_, false)) return;
    hd_->stop_scheduler();
    hd_->unschedule(callback_);
  }

  static unsigned called(void* data) {
    auto& self = *static_cast<Pen*>(data);
    if (self.ending_.load(std::memory_order_acquire)) return 0;  // done
    self.cycle_();
    return 1;  // continue
  }

  // What an error means; true if the device was read.
  bool judge(unsigned error, double t) noexcept {
    if (error >= device_fault && error <= comm_config_error) {
      if (++failures_ >= failures_of_loss) reopener_->ask();
      fault_.store(DeviceFault::disconnected, std::memory_order_relaxed);
      return false;
    }
    if (error == success) failures_ = 0;
    if (error == warm_motors) hot_.store(true, std::memory_order_relaxed);
    if (error >= exceeded_max_force && error <= force_error) rest_until_ = t + rest_after_error;
    return true;
  }

  DeviceFault fault(double t) noexcept {
    DeviceFault now = DeviceFault::none;
    if (calibration_ != ok) {
      now = DeviceFault::not_calibrated;
    } else if (hot_.load(std::memory_order_relaxed)) {
      now = DeviceFault::overheated;
    } else if (t < rest_until_) {
      now = DeviceFault::refused_command;
    } else if (std::exchange(rest_until_, -1.0) >= 0.0 &&
               enabled_.load(std::memory_order_acquire)) {
      hd_->enable(force_output);  // the driver may have switched it off
    }
    fault_.store(now, std::memory_order_relaxed);
    return now;
  }

  // A force that changes no faster than the driver bears; one that is taken away goes at once.
  [[nodiscard]] Vec3 slewed(const Vec3& force, double t) const noexcept {
    if (force.isZero(0.0)) return force;
    const Vec3 change = force - sent_;
    const double most = wanted_.slew * std::clamp(t - last_write_, 0.0, 1.0 / scheduler_rate);
    const double length = change.norm();
    return length > most ? Vec3(sent_ + (most / length) * change) : force;
  }

  // On the reopener's thread.
  bool open_again() noexcept {
    const std::lock_guard lock(scheduler_);
    const bool ran = running_;
    stop_scheduler();
    bool done = false;
    call_when_free(calls_, call_time, [&] {
      try {
        hd_->disable_device(handle_);
        hd_->take_errors();
        open();
        hd_->make_current_device(handle_);
        if (enabled_.load(std::memory_order_acquire)) hd_->enable(force_output);
        done = hd_->take_errors() == success;
      } catch (const std::exception&) {
        done = false;  // not yet; it is tried again
      }
    });
    if (ran && !ending_.load(std::memory_order_acquire)) run_scheduler();
    return done;
  }

  std::shared_ptr<const Hd> hd_;
  Wanted wanted_;
  DeviceInfo info_;
  std::atomic<unsigned> handle_{invalid_handle};
  std::mutex scheduler_;  // of the three below; the scheduler's thread never takes it
  bool running_ = false;
  unsigned long callback_ = 0;
  CycleCallback cycle_;
  std::mutex calls_;  // of the driver; whoever does not get it at once goes on without
  std::atomic<bool> enabled_{false}, ending_{false}, hot_{false};
  std::atomic<DeviceFault> fault_{DeviceFault::none};
  // Of the scheduler's thread:
  HandState last_;
  bool in_frame_ = false;
  int failures_ = 0;  // in a row
  unsigned ticks_ = 0;
  unsigned calibration_ = ok;
  Vec3 sent_ = Vec3::Zero();  // [N]
  double last_write_ = 0.0;   // [s]
  double rest_until_ = -1.0;  // [s]
  std::unique_ptr<Reopener> reopener_;
};

std::unique_ptr<Device> open_pen(const Uri& uri) {
  uri.allow_only(std::to_array<std::string_view>({"slew", "max_force"}));
  Wanted wanted{.uri = uri.text(), .name = uri.path()};
  wanted.slew = uri.number_option("slew", wanted.slew, 10.0, 2000.0, "N/s");
  if (uri.has("max_force")) wanted.max_force = uri.number_option("max_force", 1.0, 0.1, 30.0, "N");
  return std::make_unique<Pen>(std::make_shared<const Hd>(), wanted);
}

DriverReport look() {
  const auto hd = std::make_shared<const Hd>();
  DriverReport report{.library = hd->library.path()};
  const unsigned handle = hd->init_device(nullptr);
  const unsigned error = hd->take_errors();
  if (error != success || handle == invalid_handle) {
    report.problem = unopened_by_usb(scheme, usb(), hd->text_of(error));
    return report;
  }
  hd->make_current_device(handle);
  PluggedIn pen{.uri = std::string(scheme),
                .name = hd->text(device_model_type),
                .serial = hd->text(device_serial_number),
                .rate = scheduler_rate};
  const unsigned calibration = hd->calibration_of(handle);
  if (calibration != ok) pen.note = "not calibrated: put the pen into its holder (the inkwell)";
  const double warmest = hd->warmest_motor();
  if (hd->take_errors() == success && warmest > too_warm) pen.note = "its motors must cool down";
  report.found.push_back(pen);
  hd->disable_device(handle);
  return report;
}

}  // namespace
}  // namespace open_haptics

/// docs/devices.md describes it. Its scheduler calls the cycle (Device::drives). What the hardware
/// does when its computer dies is not documented, so a program holds it by a guard (open_guarded).
Driver open_haptics_driver() {
  return {.name = "touch",
          .summary = "3D Systems' Touch and Touch X, SensAble's Phantoms, by OpenHaptics",
          .tried = "a mock library only",
          .usb = open_haptics::usb(),
          .open_device = open_haptics::open_pen,
          .look = reporting(open_haptics::look),
          .needs_guard = true};
}

}  // namespace palpate
