// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <sys/time.h>

#include "palpate/drivers/drivers.hpp"
#include "palpate/drivers/live_camera.hpp"
#include "palpate/drivers/shared_library.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate::freenect {
namespace {

// The C interface of libfreenect 0.5, from its headers; only what is used.
struct UsbContext;
struct Kinect;
struct Attributes {
  Attributes* next;
  const char* serial;
};
struct FrameMode {
  std::uint32_t reserved;
  int resolution, format;
  std::int32_t bytes;
  std::int16_t width, height;
  std::int8_t bits, padding_bits, rate, is_valid;
};
struct Registration {
  std::array<std::int32_t, 29> polynomials;
  std::array<std::uint16_t, 3> padding;
  float emitter_distance, colour_distance;         // [cm]
  float reference_distance, reference_pixel_size;  // [mm] at 1280 pixels a row
  double const_shift;
  void* raw_to_mm;
  void* depth_to_rgb;
  void* table;
};

constexpr int camera_part = 2, medium = 1, fatal_alone = 0;
constexpr int format_11bit = 0, format_registered = 4, format_mm = 5;
constexpr std::uint16_t no_value_11bit = 2047;
constexpr double units_of_mm = 1000.0, units_of_11bit = 10'000.0;  // [1/m]
constexpr double usual_focal_length = 580.0;                       // [px] of the infrared camera
constexpr DepthRange measurable{0.4, 10.0};                        // [m]
constexpr const char* plug_in =
    "plug it in, with its power supply; if it is, install the package libfreenect0.5 with its udev "
    "rules, modprobe -r gspca_kinect, and end other programs that use it";

struct Api {
  SharedLibrary library{{.name = "libfreenect",
                         .files = {"libfreenect.so.0.5", "libfreenect.so.0", "libfreenect.so"},
                         .variable = "PALPATE_LIBFREENECT",
                         .remedy = "install the package libfreenect0.5"}};
  int (*init)(UsbContext**, void*) = library.find("freenect_init");
  int (*shut_down)(UsbContext*) = library.find("freenect_shutdown");
  void (*set_log_level)(UsbContext*, int) = library.find("freenect_set_log_level");
  void (*select_parts)(UsbContext*, int) = library.find("freenect_select_subdevices");
  int (*count)(UsbContext*) = library.find("freenect_num_devices");
  int (*list)(UsbContext*, Attributes**) = library.try_find("freenect_list_device_attributes");
  void (*free_list)(Attributes*) = library.try_find("freenect_free_device_attributes");
  int (*open)(UsbContext*, Kinect**, int) = library.find("freenect_open_device");
  int (*open_serial)(UsbContext*, Kinect**,
                     const char*) = library.find("freenect_open_device_by_camera_serial");
  int (*close)(Kinect*) = library.find("freenect_close_device");
  FrameMode (*find_mode)(int, int) = library.find("freenect_find_depth_mode");
  int (*set_mode)(Kinect*, FrameMode) = library.find("freenect_set_depth_mode");
  void (*set_callback)(Kinect*,
                       void (*)(Kinect*, void*,
                                std::uint32_t)) = library.find("freenect_set_depth_callback");
  int (*start)(Kinect*) = library.find("freenect_start_depth");
  int (*stop)(Kinect*) = library.find("freenect_stop_depth");
  int (*process)(UsbContext*, timeval*) = library.find("freenect_process_events_timeout");
  Registration (*copy_registration)(Kinect*) = library.try_find("freenect_copy_registration");
  int (*destroy_registration)(Registration*) = library.try_find("freenect_destroy_registration");
};

using OwnedContext = std::unique_ptr<UsbContext, int (*)(UsbContext*)>;

OwnedContext context_of(const Api& api) {
  UsbContext* made = nullptr;
  if (api.init(&made, nullptr) < 0 || made == nullptr)
    throw Error("libfreenect", "it does not start", "see that this user may use USB");
  OwnedContext context(made, api.shut_down);
  api.set_log_level(made, fatal_alone);  // it would write to the terminal
  api.select_parts(made, camera_part);
  return context;
}

// Empty ones where the library does not tell them, as the fakenect of its package does not.
std::vector<std::string> serials(const Api& api, UsbContext* context) {
  if (api.list == nullptr || api.free_list == nullptr)
    return std::vector<std::string>(static_cast<std::size_t>(std::max(api.count(context), 0)));
  Attributes* list = nullptr;
  if (api.list(context, &list) < 0) return {};
  std::vector<std::string> found;
  for (const Attributes* each = list; each != nullptr; each = each->next)
    found.emplace_back(each->serial == nullptr ? "" : each->serial);
  api.free_list(list);
  return found;
}

DriverReport look() {
  const Api api;
  DriverReport report{.library = api.library.path()};
  const OwnedContext context = context_of(api);
  for (const std::string& serial : serials(api, context.get()))
    report.found.push_back({.uri = "freenect:" + serial,
                            .name = "Kinect v1",
                            .serial = serial,
                            .rate = 30.0,
                            .sensor = SensorKind::structured_light});
  return report;
}

// Steps of the sensor to tenths of a millimetre, after Magnenat's fit.
std::uint16_t distance_of(std::uint16_t step) {
  if (step >= no_value_11bit) return 0;
  const double metres = 0.1236 * std::tan(step / 2842.5 + 1.1863);
  const double raw = std::round(units_of_11bit * metres);
  return raw > 0.0 && raw < 65535.0 ? static_cast<std::uint16_t>(raw) : std::uint16_t{0};
}

class Camera;
thread_local Camera* processing = nullptr;  // whose frames the library hands over just now

class Camera final : public LiveCamera {
 public:
  explicit Camera(const Uri& uri)
      : LiveCamera({.uri = uri.text(),
                    .kind = "Kinect v1",
                    .frame_rate = 30.0,
                    .clock = StampClock::monotonic,
                    .sensor = SensorKind::structured_light,
                    .range = measurable}),
        context_(context_of(api_)),
        kinect_(nullptr, api_.close) {
    uri.allow_only(std::to_array<std::string_view>({"depth"}));
    const std::string kind = uri.text_option("depth", "mm");
    if (kind != "mm" && kind != "registered" && kind != "11bit")
      throw Error(info_.uri, "there is no depth '" + kind + "'",
                  "known here: mm, registered, 11bit");
    is_11bit_ = kind == "11bit";
    open(uri.path());
    mode_ = api_.find_mode(
        medium, is_11bit_ ? format_11bit : (kind == "mm" ? format_mm : format_registered));
    if (mode_.is_valid == 0 || api_.set_mode(kinect_.get(), mode_) < 0 || mode_.width < 1 ||
        mode_.height < 1 || mode_.bytes < 2 * mode_.width * mode_.height)
      throw Error(info_.uri, "its library has no depth of that kind", "try ?depth=11bit");
    const double focal = focal_length();
    rays_ = std::make_shared<const ViewingRays>(Intrinsics{.width = mode_.width,
                                                           .height = mode_.height,
                                                           .fx = focal,
                                                           .fy = focal,
                                                           .cx = 0.5 * mode_.width,
                                                           .cy = 0.5 * mode_.height});
    api_.set_callback(kinect_.get(), take);
    if (api_.start(kinect_.get()) < 0) throw Error(info_.uri, "it does not start", plug_in);
  }
  ~Camera() override { api_.stop(kinect_.get()); }

 private:
  void open(const std::string& serial) {
    const std::vector<std::string> plugged_in = serials(api_, context_.get());
    if (plugged_in.empty()) throw Error(info_.uri, "no Kinect v1 is plugged in", plug_in);
    Kinect* opened = nullptr;
    if (!serial.empty() &&
        std::find(plugged_in.begin(), plugged_in.end(), serial) == plugged_in.end()) {
      std::string others;
      for (const std::string& each : plugged_in) add_to_list(others, each);
      throw Error(info_.uri, "there is no Kinect of that serial number", "plugged in: " + others);
    }
    const int status = serial.empty() ? api_.open(context_.get(), &opened, 0)
                                      : api_.open_serial(context_.get(), &opened, serial.c_str());
    if (status < 0 || opened == nullptr) throw Error(info_.uri, "it cannot be opened", plug_in);
    kinect_.reset(opened);
  }

  // [px] as the camera itself was calibrated
  double focal_length() {
    if (api_.copy_registration == nullptr || api_.destroy_registration == nullptr)
      return usual_focal_length;
    Registration calibration = api_.copy_registration(kinect_.get());
    const double length = 0.5 * calibration.reference_distance / calibration.reference_pixel_size;
    api_.destroy_registration(&calibration);
    if (std::isfinite(length) && length > 100.0 && length < 2000.0) return length;
    info_.notes.emplace_back("it does not say its focal length; 580 px is assumed");
    return usual_focal_length;
  }

  // Called by the library from within `process`, on the thread of `wait`.
  static void take(Kinect* kinect, void* depth, std::uint32_t /*stamp*/) {
    Camera* self = processing;
    if (self == nullptr || self->kinect_.get() != kinect || depth == nullptr) return;
    self->arrival_ = monotonic_now();
    self->depth_ = depth_rows(depth, self->mode_.width, self->mode_.height,
                              2 * static_cast<std::size_t>(self->mode_.width), self->info_.uri);
  }

  std::optional<Frame> wait(double seconds) override {
    const double end = monotonic_now() + seconds;
    depth_.clear();
    do {
      const auto left = static_cast<long>(1e6 * std::max(end - monotonic_now(), 0.0));
      timeval bound{.tv_sec = left / 1'000'000, .tv_usec = left % 1'000'000};
      processing = this;
      const int status = api_.process(context_.get(), &bound);
      processing = nullptr;
      if (status < 0) throw Error(info_.uri, "it is not plugged in any more", "plug it in again");
    } while (depth_.empty() && monotonic_now() < end);
    if (depth_.empty()) return std::nullopt;
    if (is_11bit_) std::transform(depth_.begin(), depth_.end(), depth_.begin(), distance_of);
    Frame frame;
    frame.stamp = arrival_;
    frame.arrival = arrival_;
    frame.cloud = std::make_shared<DepthImage>(rays_, std::exchange(depth_, {}),
                                               is_11bit_ ? units_of_11bit : units_of_mm);
    return frame;
  }

  const Api api_;
  OwnedContext context_;
  std::unique_ptr<Kinect, int (*)(Kinect*)> kinect_;
  FrameMode mode_{};
  bool is_11bit_ = false;
  std::shared_ptr<const ViewingRays> rays_;
  std::vector<std::uint16_t> depth_;  // that came last, until it is given
  double arrival_ = 0.0;              // [s] of it
};

}  // namespace
}  // namespace palpate::freenect

namespace palpate {

/// docs/cameras.md describes it. The camera's own stamps are of no documented unit.
Driver freenect_driver() {
  return {.name = "freenect",
          .summary = "freenect:SERIAL, a Kinect v1 by libfreenect",
          .tried = "a mock library, and the package's fakenect with depth=11bit",
          .usb = {"045e:02ae"},
          .open_camera = opened<freenect::Camera>,
          .look = reporting(freenect::look)};
}

}  // namespace palpate
