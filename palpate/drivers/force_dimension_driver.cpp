// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include <sys/utsname.h>

#include "palpate/drivers/drivers.hpp"
#include "palpate/drivers/reopener.hpp"
#include "palpate/drivers/shared_library.hpp"
#include "palpate/io/devices/device_body.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {
namespace force_dimension {
namespace {

constexpr std::string_view scheme = "force-dimension:";
constexpr double watchdog_unit = 125e-6;  // [s] of dhdSetWatchdog
constexpr double call_time = 0.5;         // [s] for a call of the driver to end
constexpr int ticks_a_status = 8;         // between two looks at the status
constexpr int failures_of_loss = 10;      // reads in a row that fail before the arm is opened anew
constexpr double rest_before_on = 0.5;    // [s] without a force before forces are switched on again

// As the SDK numbers them.
enum Status : std::size_t { power = 0, calibrated = 3, force_on = 5, error = 9, off_cause = 14 };
constexpr std::size_t status_count = 17;
enum class OffCause : int { none, button, velocity, watchdog, software, usb, dead_man };

const std::vector<std::string>& usb() {
  static const std::vector<std::string> ids = {"1451", "0403:cb48"};
  return ids;
}

LibraryNames names() {
  LibraryNames names{.name = std::string(scheme) + " (Force Dimension's SDK)",
                     .files = {},
                     .variable = "PALPATE_FORCE_DIMENSION",
                     .remedy = "install the SDK of www.forcedimension.com"};
  const auto add = [&](const std::string& folder) {
    for (const char* file : {"libdrd.so.3", "libdrd.so", "libdhd.so.3", "libdhd.so"})
      names.files.push_back(folder + file);
  };
  const auto of_environment = [](const char* name) {
    const char* value = std::getenv(name);
    return std::string(value == nullptr ? "" : value);
  };
  if (const std::string file = of_environment("FORCEDIMENSION_LIB"); !file.empty())
    names.files.push_back(file);
  utsname machine{};
  uname(&machine);
  for (const char* variable : {"FDSDK", "FORCEDIM_SDK"}) {
    if (const std::string sdk = of_environment(variable); !sdk.empty())
      add(sdk + "/lib/release/lin-" + static_cast<const char*>(machine.machine) + "-gcc/");
  }
  if (const std::string home = of_environment("HOME"); !home.empty()) add(home + "/.local/lib/");
  add("/usr/local/lib/");
  add("");
  return names;
}

// The functions of the SDK that are used. ID is what opening returned.
struct Sdk {
  [[nodiscard]] std::string version() const {
    int major = 0;
    int minor = 0;
    int release = 0;
    int revision = 0;
    get_sdk_version(&major, &minor, &release, &revision);
    return version_text({major, minor, release});
  }
  [[nodiscard]] std::string last_error() const {
    const char* text = error_get_last_str();
    return text == nullptr || *text == '\0' ? "the library does not say why" : text;
  }
  [[nodiscard]] std::string name(int id) const {
    const char* text = get_system_name(static_cast<char>(id));
    return text == nullptr ? "arm" : text;
  }
  // Empty where the arm has none, as a Falcon.
  [[nodiscard]] std::string serial(int id) const {
    unsigned short number = 0;
    return get_serial_number(&number, static_cast<char>(id)) < 0 || number == 0
               ? ""
               : std::to_string(number);
  }

  SharedLibrary library{names()};
  int (*get_device_count)() = library.find("dhdGetDeviceCount");
  int (*open)() = library.find("dhdOpen");
  int (*open_id)(char index) = library.find("dhdOpenID");
  int (*open_serial)(int serial) = library.find("dhdOpenSerial");
  int (*close)(char id) = library.find("dhdClose");
  int (*stop)(char id) = library.find("dhdStop");
  int (*get_system_type)(char id) = library.find("dhdGetSystemType");
  const char* (*get_system_name)(char id) = library.find("dhdGetSystemName");
  int (*get_serial_number)(unsigned short* number, char id) = library.find("dhdGetSerialNumber");
  void (*get_sdk_version)(int* major, int* minor, int* release,
                          int* revision) = library.find("dhdGetSDKVersion");
  const char* (*error_get_last_str)() = library.find("dhdErrorGetLastStr");
  int (*get_position)(double* x, double* y, double* z,
                      char id) = library.find("dhdGetPosition");  // [m]
  int (*get_orientation_frame)(double rows[3][3], char id) = library.find("dhdGetOrientationFrame");
  int (*set_force)(double x, double y, double z, char id) = library.find("dhdSetForce");  // [N]
  int (*enable_force)(unsigned char on, char id) = library.find("dhdEnableForce");
  int (*set_brakes)(int on, char id) = library.find("dhdSetBrakes");
  int (*set_gravity_compensation)(int on, char id) = library.find("dhdSetGravityCompensation");
  int (*set_max_force)(double newtons, char id) = library.find("dhdSetMaxForce");
  unsigned (*get_button_mask)(char id) = library.find("dhdGetButtonMask");
  int (*emulate_button)(unsigned char on, char id) = library.find("dhdEmulateButton");
  int (*get_status)(int* status, char id) = library.find("dhdGetStatus");
  bool (*has_wrist)(char id) = library.find("dhdHasWrist");
  bool (*has_gripper)(char id) = library.find("dhdHasGripper");
  int (*enable_expert_mode)() = library.find("dhdEnableExpertMode");
  int (*set_watchdog)(unsigned char units, char id) = library.find("dhdSetWatchdog");
  // Of arms with motors in their wrist; torques in N m about the arm's axes.
  bool (*has_active_wrist)(char id) = library.try_find("dhdHasActiveWrist");
  int (*set_force_and_torque)(double x, double y, double z, double about_x, double about_y,
                              double about_z, char id) = library.try_find("dhdSetForceAndTorque");
  int (*set_max_torque)(double newton_metres, char id) = library.try_find("dhdSetMaxTorque");
  // Of libdrd alone:
  int (*drd_open_id)(char id) = library.try_find("drdOpenID");
  bool (*drd_is_initialized)(char id) = library.try_find("drdIsInitialized");
  int (*drd_auto_init)(char id) = library.try_find("drdAutoInit");
  int (*drd_stop)(bool force_on, char id) = library.try_find("drdStop");
};

// What the arms are good for, by the SDK's type; CHAI3D's table.
struct Model {
  int first, last;        // types
  double force;           // [N]
  double stiffness;       // [N/m]
  double damping;         // [N s/m]
  double radius;          // [m]
  std::string_view body;  // the simulated model whose mechanics are nearest; empty: unknown
  double torque = 0.0;    // [N m] of its wrist; 0: it has no motors there
};
constexpr std::array models = {Model{63, 63, 20.0, 5000.0, 30.0, 0.15, ""},           // delta.3
                               Model{33, 37, 12.0, 5000.0, 30.0, 0.075, "omega"},     // omega
                               Model{104, 105, 12.0, 4000.0, 30.0, 0.075, "", 0.2},   // sigma.7
                               Model{206, 206, 12.0, 4000.0, 30.0, 0.075, ""},        // sigma.3
                               Model{108, 109, 12.0, 8000.0, 30.0, 0.1125, "", 0.2},  // lambda.7
                               Model{131, 132, 12.0, 8000.0, 30.0, 0.1125, "", 0.2},  // lambda.6
                               Model{203, 203, 12.0, 8000.0, 30.0, 0.1125, ""},       // lambda.3
                               Model{60, 60, 8.0, 3000.0, 20.0, 0.04, "falcon"}};
// For a type that is not in the table: the weakest.
constexpr Model unknown_model{0, 0, 8.0, 3000.0, 20.0, 0.04, ""};

const Model& model_of(int type) {
  const auto* const model = std::find_if(models.begin(), models.end(), [&](const Model& one) {
    return type >= one.first && type <= one.last;
  });
  return model == models.end() ? unknown_model : *model;
}

// The SDK's axes are x towards the user, y to the right, z up.
Vec3 from_arm(double x, double y, double z) { return {y, -x, z}; }
Vec3 to_arm(const Vec3& v) { return {-v.y(), v.x(), v.z()}; }

struct Wanted {
  std::string uri;
  std::optional<int> serial;
  bool calibrate = false;
  bool gravity = true;
  unsigned char watchdog = 0;         // [watchdog_unit]
  std::optional<double> max_force{};  // [N]
};

class Arm final : public Device {
 public:
  Arm(std::shared_ptr<const Sdk> sdk, const Wanted& wanted)
      : sdk_(std::move(sdk)), wanted_(wanted) {
    open();
    try {
      identify();
      prepare();
    } catch (...) {
      sdk_->close(id());
      throw;
    }
    reopener_ = std::make_unique<Reopener>([this] { return open_again(); });
  }
  ~Arm() override {
    reopener_.reset();
    disable();
    sdk_->stop(id());
    sdk_->close(id());
  }

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }

  HandState read(double t) noexcept override {
    HandState state = last_;
    state.present = false;
    state.fault = DeviceFault::disconnected;
    if (reopener_->is_lost()) return state;
    const std::unique_lock turn(calls_, std::try_to_lock);
    if (!turn) return state;
    double x = 0.0;
    double y = 0.0;
    double z = 0.0;
    // TimeGuard (1) repeats the place of a read that was less than a period ago: no error.
    bool good = sdk_->get_position(&x, &y, &z, id()) >= 0;
    if (good) state.position = from_arm(x, y, z);
    if (good && has_wrist_) good = read_orientation(state);
    if (good) state.buttons = sdk_->get_button_mask(id());
    if (good && ++ticks_ % ticks_a_status == 1) good = look_at_status(t);
    if (!good) {
      if (++failures_ >= failures_of_loss) reopener_->ask();
      return state;
    }
    failures_ = 0;
    state.fault = fault_.load(std::memory_order_relaxed);
    state.present = state.fault == DeviceFault::none;
    last_ = state;
    return state;
  }

  void write(const Vec3& force, double t) noexcept override { write(Wrench{force}, t); }

  void write(const Wrench& wrench, double t) noexcept override {
    if (reopener_->is_lost()) return;
    const std::unique_lock turn(calls_, std::try_to_lock);
    if (!turn) return;
    const bool enabled = enabled_.load(std::memory_order_acquire);
    if (!enabled || !wrench.force.isZero(0.0) || !wrench.torque.isZero(0.0)) last_force_ = t;
    if (!send(enabled ? wrench : Wrench{})) {
      if (++failures_ >= failures_of_loss) reopener_->ask();
      return;
    }
    if (!enabled_.load(std::memory_order_acquire)) {  // disabled meanwhile
      if (enabled) sdk_->enable_force(0, id());
    } else if (off_.load(std::memory_order_relaxed) && may_switch_on() &&
               t - last_force_ > rest_before_on) {
      sdk_->enable_force(1, id());
      last_force_ = t;
      ticks_ = 0;
    }
  }

  void enable() override {
    bool done = false;
    const bool called = call_when_free(calls_, call_time, [&] {
      done = send({}) && sdk_->enable_force(1, id()) >= 0;
      if (done) enabled_.store(true, std::memory_order_release);
    });
    if (!called) throw Error(info_.uri, "its driver does not answer", "plug it in again");
    if (!done)
      throw Error(info_.uri, "its forces cannot be switched on (" + sdk_->last_error() + ")",
                  "switch the device off and on again");
  }

  // Where another thread is within a call, that one switches the force off when it returns, or the
  // firmware's watchdog does when it does not.
  void disable() noexcept override {
    enabled_.store(false, std::memory_order_release);
    const std::unique_lock turn(calls_, std::try_to_lock);
    if (!turn || reopener_ == nullptr || reopener_->is_lost()) return;
    send({});
    sdk_->enable_force(0, id());
  }

  [[nodiscard]] std::string fault_text() const override {
    if (!off_.load(std::memory_order_relaxed)) return {};
    switch (cause_.load(std::memory_order_relaxed)) {
      case OffCause::button:
        return "the arm's force button switched its forces off; press it again";
      case OffCause::velocity:
        return "the arm was moved too fast and has braked; its forces come back by themselves";
      case OffCause::watchdog:
        return "the arm's watchdog took the force off, as no force came in time; it comes back by "
               "itself";
      case OffCause::usb:
        return "the arm lost its USB connection; check the cable";
      case OffCause::dead_man:
        return "nobody holds the arm's dead man's switch; hold it";
      default:
        return "the arm has switched its forces off; they come back by themselves";
    }
  }

 private:
  [[nodiscard]] char id() const { return id_.load(std::memory_order_relaxed); }

  // MOTOR_SATURATED (2) is no error. A wrist with motors keeps its torque over a force alone.
  bool send(const Wrench& wrench) const noexcept {
    const Vec3 force = to_arm(wrench.force);
    if (info_.limits.max_torque <= 0.0)
      return sdk_->set_force(force.x(), force.y(), force.z(), id()) >= 0;
    const Vec3 torque = to_arm(wrench.torque);
    return sdk_->set_force_and_torque(force.x(), force.y(), force.z(), torque.x(), torque.y(),
                                      torque.z(), id()) >= 0;
  }

  void open() {
    const int opened = wanted_.serial ? sdk_->open_serial(*wanted_.serial) : sdk_->open();
    if (opened >= 0) {
      id_ = static_cast<char>(opened);
      return;
    }
    const std::string why = sdk_->last_error();
    const int count = sdk_->get_device_count();
    if (count > 0) {
      std::string serials;
      for (int i = 0; i < count; ++i) {
        const int other = sdk_->open_id(static_cast<char>(i));
        if (other < 0) continue;
        add_to_list(serials, sdk_->serial(other));
        sdk_->close(static_cast<char>(other));
      }
      if (wanted_.serial && !serials.empty())
        throw Error(wanted_.uri, "no arm of that serial number is plugged in (" + why + ")",
                    "there are: " + serials);
      throw Error(wanted_.uri, "the arm cannot be opened (" + why + ")",
                  "close other programs that use it");
    }
    for (const std::string& found : usb_ids()) {
      if (is_usb_of(found, usb()))
        throw Error(wanted_.uri, "an arm is plugged in (USB " + found + ") but cannot be opened",
                    usb_permission_remedy(found));
    }
    throw Error(wanted_.uri, "no arm is plugged in (" + why + ")",
                "check its power and its USB cable");
  }

  // Once: what it is, and whether it can be used.
  void identify() {
    const std::string name = sdk_->name(id());
    if (!is_calibrated()) calibrate(name);
    const Model& model = model_of(sdk_->get_system_type(id()));
    const double force = std::min(wanted_.max_force.value_or(model.force), model.force);
    info_.uri = wanted_.uri;
    info_.kind = name + " by Force Dimension's SDK";
    info_.limits = {.max_force = force,
                    .continuous_force = force,
                    .max_stiffness = model.stiffness,
                    .max_damping = model.damping};
    // A torque that the SDK does not bound is not sent.
    if (model.torque > 0.0 && sdk_->set_max_torque != nullptr &&
        sdk_->set_force_and_torque != nullptr && sdk_->has_active_wrist != nullptr &&
        sdk_->has_active_wrist(id()))
      info_.limits.max_torque = model.torque * force / model.force;
    info_.reach = DeviceReach::ball(model.radius);
    if (!model.body.empty()) {
      const DeviceBody& body = device_preset(model.body).body;
      info_.damping = body.damping;
      info_.delay = body.delay;
    }
    info_.serial = sdk_->serial(id());
    if (!info_.serial.empty()) wanted_.serial = std::stoi(info_.serial);  // when opened again
    info_.watchdog = watchdog_unit * wanted_.watchdog;
    has_wrist_ = sdk_->has_wrist(id());
  }

  // Each time that it was opened; leaves forces off.
  void prepare() {
    if (sdk_->has_gripper(id())) sdk_->emulate_button(1, id());
    // What the session relies on; without it this must not be used.
    if (sdk_->enable_expert_mode() < 0 || sdk_->set_watchdog(wanted_.watchdog, id()) < 0)
      throw Error(wanted_.uri, "its watchdog cannot be set (" + sdk_->last_error() + ")",
                  "use an arm and an SDK with dhdSetWatchdog, from 3.3.2 on");
    sdk_->set_max_force(info_.limits.max_force, id());
    if (const double torque = info_.limits.max_torque;
        torque > 0.0 && sdk_->set_max_torque(torque, id()) < 0)
      throw Error(wanted_.uri, "its torque cannot be bounded (" + sdk_->last_error() + ")",
                  "switch the device off and on again");
    sdk_->set_brakes(0, id());
    sdk_->set_gravity_compensation(wanted_.gravity ? 1 : 0, id());
    sdk_->enable_force(0, id());
  }

  [[nodiscard]] bool is_calibrated() const {
    std::array<int, status_count> status{};
    if (sdk_->get_status(status.data(), id()) < 0)
      throw Error(wanted_.uri, "it does not tell its status (" + sdk_->last_error() + ")",
                  "switch it off and on again");
    return status[calibrated] != 0;
  }

  void calibrate(const std::string& name) {
    const std::string what = name + " is not calibrated";
    if (!wanted_.calibrate)
      throw Error(wanted_.uri, what,
                  "add ?calibrate, and the arm moves by itself; or move it to its stops by hand as "
                  "its manual says");
    if (sdk_->drd_auto_init == nullptr || sdk_->drd_open_id == nullptr || sdk_->drd_stop == nullptr)
      throw Error(wanted_.uri, what + ", and " + sdk_->library.path() + " cannot calibrate it",
                  "install libdrd, or move it to its stops by hand as its manual says");
    if (sdk_->drd_open_id(id()) < 0 || sdk_->drd_auto_init(id()) < 0)
      throw Error(wanted_.uri, "it could not be calibrated (" + sdk_->last_error() + ")",
                  "clear its way and try again");
    sdk_->drd_stop(true, id());
  }

  bool read_orientation(HandState& state) const noexcept {
    double rows[3][3];
    if (sdk_->get_orientation_frame(rows, id()) < 0) return false;
    Eigen::Matrix3d handle;
    for (int column = 0; column < 3; ++column)
      handle.col(column) = from_arm(rows[0][column], rows[1][column], rows[2][column]);
    state.orientation = Eigen::Quaterniond(handle).normalized();
    return true;
  }

  bool look_at_status(double t) noexcept {
    std::array<int, status_count> status{};
    if (sdk_->get_status(status.data(), id()) < 0) return false;
    const bool off = enabled_.load(std::memory_order_acquire) && status[force_on] == 0;
    const auto cause = static_cast<OffCause>(status[off_cause]);
    if (off && !off_.load(std::memory_order_relaxed)) last_force_ = t;
    cause_.store(cause, std::memory_order_relaxed);
    off_.store(off, std::memory_order_relaxed);
    DeviceFault fault = DeviceFault::none;
    if (status[calibrated] == 0) {
      fault = DeviceFault::not_calibrated;
    } else if (status[power] == 0 || status[error] != 0) {
      fault = DeviceFault::other;
    } else if (off) {
      fault = cause == OffCause::button || cause == OffCause::dead_man
                  ? DeviceFault::emergency_stop
                  : DeviceFault::refused_command;
    }
    fault_.store(fault, std::memory_order_relaxed);
    return true;
  }

  // What a person has switched off stays off until that person switches it on.
  [[nodiscard]] bool may_switch_on() const noexcept {
    const OffCause cause = cause_.load(std::memory_order_relaxed);
    return cause != OffCause::button && cause != OffCause::dead_man;
  }

  // On the reopener's thread.
  bool open_again() noexcept {
    bool done = false;
    const bool called = call_when_free(calls_, call_time, [&] {
      try {
        sdk_->close(id());
        open();
        prepare();
        done = !enabled_.load(std::memory_order_acquire) || sdk_->enable_force(1, id()) >= 0;
      } catch (const std::exception&) {
        done = false;  // not yet; it is tried again
      }
    });
    return called && done;
  }

  std::shared_ptr<const Sdk> sdk_;
  Wanted wanted_;
  DeviceInfo info_;
  bool has_wrist_ = false;
  std::atomic<char> id_{0};
  std::mutex calls_;  // of the driver; whoever does not get it at once goes on without
  std::atomic<bool> enabled_{false};
  std::atomic<bool> off_{false};  // the arm has switched its forces off by itself
  std::atomic<OffCause> cause_{OffCause::none};
  std::atomic<DeviceFault> fault_{DeviceFault::none};
  // Of the servo's thread:
  HandState last_;
  int failures_ = 0;         // calls in a row
  unsigned ticks_ = 0;       // reads
  double last_force_ = 0.0;  // [s] when a force was asked for, or the arm switched it off
  std::unique_ptr<Reopener> reopener_;  // the last to be made and the first to go
};

std::unique_ptr<Device> open_arm(const Uri& uri) {
  uri.allow_only(
      std::to_array<std::string_view>({"calibrate", "gravity", "watchdog", "max_force"}));
  Wanted wanted{.uri = uri.text(), .serial = {}};
  if (const std::string& serial = uri.path(); !serial.empty()) {
    if (serial.size() > 5 || serial.find_first_not_of("0123456789") != std::string::npos)
      throw Error(uri.text(), "'" + serial + "' is no serial number of an arm",
                  "write force-dimension:, or force-dimension:12345");
    wanted.serial = std::stoi(serial);
  }
  wanted.calibrate = uri.has("calibrate");
  const std::string gravity = uri.text_option("gravity", "on");
  if (gravity != "on" && gravity != "off")
    throw Error(uri.text(), "gravity=" + gravity + " is not understood",
                "gravity=on lets the arm carry its own weight, gravity=off does not");
  wanted.gravity = gravity == "on";
  const double watchdog = uri.number_option("watchdog", 0.02, 0.002, 0.0318, "s");
  wanted.watchdog = static_cast<unsigned char>(std::lround(watchdog / watchdog_unit));
  if (uri.has("max_force")) wanted.max_force = uri.number_option("max_force", 1.0, 0.1, 20.0, "N");
  return std::make_unique<Arm>(std::make_shared<const Sdk>(), wanted);
}

DriverReport look() {
  const Sdk sdk;
  DriverReport report{.library = sdk.library.path(), .version = sdk.version()};
  const int count = std::max(sdk.get_device_count(), 0);
  for (int i = 0; i < count; ++i) {
    const int id = sdk.open_id(static_cast<char>(i));
    if (id < 0) {
      report.found.push_back({.uri = std::string(scheme),
                              .name = "an arm that cannot be opened",
                              .note = sdk.last_error() + "; close other programs that use it"});
      continue;
    }
    PluggedIn arm{.uri = std::string(scheme) + sdk.serial(id),
                  .name = sdk.name(id),
                  .serial = sdk.serial(id)};
    std::array<int, status_count> status{};
    if (sdk.get_status(status.data(), static_cast<char>(id)) >= 0 && status[calibrated] == 0)
      arm.note = "not calibrated: add ?calibrate, and the arm moves by itself";
    report.found.push_back(arm);
    sdk.close(static_cast<char>(id));
  }
  if (count == 0) report.problem = unopened_by_usb(scheme, usb());
  return report;
}

}  // namespace
}  // namespace force_dimension

/// docs/devices.md describes it. The arm's firmware takes its force away when no force was sent for
/// `watchdog`, whatever has become of this process; sessions may rely on it (DeviceInfo::watchdog).
Driver force_dimension_driver() {
  return {.name = "force-dimension",
          .summary = "Force Dimension's omega, delta, sigma and lambda, and the Novint Falcon",
          .tried = "a mock library only",
          .usb = force_dimension::usb(),
          .open_device = force_dimension::open_arm,
          .look = reporting(force_dimension::look)};
}

}  // namespace palpate
