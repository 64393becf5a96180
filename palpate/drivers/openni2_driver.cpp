// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "palpate/drivers/drivers.hpp"
#include "palpate/drivers/live_camera.hpp"
#include "palpate/drivers/shared_library.hpp"
#include "palpate/io/sources/depth_png.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate::openni2 {
namespace {

// The C interface of OpenNI2 2.2, from its headers; only what is used.
struct Device;
struct Stream;
struct VideoMode {
  int format = 0, width = 0, height = 0, rate = 0;
  bool operator==(const VideoMode&) const = default;
};
struct SensorModes {
  int sensor;
  int count;
  const VideoMode* modes;
};
struct DeviceInfo {
  std::array<char, 256> uri, vendor, name;
  std::uint16_t usb_vendor, usb_product;
};
struct ImageFrame {
  int size;  // [bytes]
  void* data;
  int sensor;
  std::uint64_t stamp;  // [us]
  int number, width, height;
  VideoMode mode;
  int is_cropped, crop_x, crop_y;
  int stride;  // [bytes]
};
struct Version {
  int major, minor, maintenance, build;
};

constexpr int api_version = 2002;  // 2.2
constexpr int ok = 0, timed_out = 102;
constexpr int colour_sensor = 2, depth_sensor = 3;
constexpr int format_1_mm = 100, format_100_um = 101, format_rgb888 = 200;
constexpr int firmware_property = 0, serial_property = 3, registration_property = 5;  // of a device
constexpr int horizontal_fov = 1, vertical_fov = 2, mode_property = 3, mirroring = 7;  // of streams
constexpr int most_pixels = 640 * 480;  // that are chosen; what is larger is interpolated
constexpr double silence = 0.5;         // [s] without a frame after which the camera is looked for
constexpr DepthRange measurable{0.3, 10.0};  // [m]
constexpr const char* plug_in =
    "plug it in; if it is, install the package libopenni2-0 with its udev rules, and for a Kinect "
    "modprobe -r gspca_kinect";

std::string text_of(const std::array<char, 256>& text) {
  return {text.begin(), std::find(text.begin(), text.end(), '\0')};
}

struct Api {
  Api() {
    if (initialize(api_version) != ok)
      throw Error("OpenNI2", "it does not start: " + said(),
                  "install the package libopenni2-0 with its drivers");
  }
  // The library counts: others may go on using it.
  ~Api() { shut_down(); }
  Api(const Api&) = delete;
  Api& operator=(const Api&) = delete;

  // What the library says of the last call, on one line.
  [[nodiscard]] std::string said() const {
    const char* text = get_extended_error();
    std::string line = text == nullptr ? "" : text;
    while (!line.empty() && (line.back() == '\n' || line.back() == '\t')) line.pop_back();
    return line.empty() ? "it does not say why" : line;
  }
  [[nodiscard]] std::vector<DeviceInfo> devices() const {
    DeviceInfo* list = nullptr;
    int count = 0;
    if (get_device_list(&list, &count) != ok || list == nullptr) return {};
    std::vector<DeviceInfo> found(list, list + std::max(count, 0));
    release_device_list(list);
    return found;
  }
  // A text of a device; empty if it has none.
  [[nodiscard]] std::string property(Device* device, int which) const {
    std::array<char, 256> text{};
    int size = static_cast<int>(text.size());
    return device_get_property(device, which, text.data(), &size) == ok ? text_of(text) : "";
  }

  SharedLibrary library{{.name = "OpenNI2",
                         .files = {"libOpenNI2.so.0", "libOpenNI2.so"},
                         .variable = "PALPATE_OPENNI2",
                         .remedy = "install the package libopenni2-0"}};
  int (*initialize)(int) = library.find("oniInitialize");
  void (*shut_down)() = library.find("oniShutdown");
  Version (*get_version)() = library.find("oniGetVersion");
  const char* (*get_extended_error)() = library.find("oniGetExtendedError");
  int (*get_device_list)(DeviceInfo**, int*) = library.find("oniGetDeviceList");
  int (*release_device_list)(DeviceInfo*) = library.find("oniReleaseDeviceList");
  int (*device_open)(const char*, Device**) = library.find("oniDeviceOpen");
  int (*device_close)(Device*) = library.find("oniDeviceClose");
  int (*device_get_info)(Device*, DeviceInfo*) = library.find("oniDeviceGetInfo");
  const SensorModes* (*device_get_modes)(Device*, int) = library.find("oniDeviceGetSensorInfo");
  int (*device_get_property)(Device*, int, void*, int*) = library.find("oniDeviceGetProperty");
  int (*device_set_property)(Device*, int, const void*, int) = library.find("oniDeviceSetProperty");
  int (*registration_supported)(Device*,
                                int) = library.find("oniDeviceIsImageRegistrationModeSupported");
  int (*create_stream)(Device*, int, Stream**) = library.find("oniDeviceCreateStream");
  void (*stream_destroy)(Stream*) = library.find("oniStreamDestroy");
  int (*stream_start)(Stream*) = library.find("oniStreamStart");
  void (*stream_stop)(Stream*) = library.find("oniStreamStop");
  int (*stream_read)(Stream*, ImageFrame**) = library.find("oniStreamReadFrame");
  int (*stream_get_property)(Stream*, int, void*, int*) = library.find("oniStreamGetProperty");
  int (*stream_set_property)(Stream*, int, const void*, int) = library.find("oniStreamSetProperty");
  int (*wait_for_any)(Stream**, int, int*, int) = library.find("oniWaitForAnyStream");
  void (*frame_release)(ImageFrame*) = library.find("oniFrameRelease");
};

using OwnedDevice = std::unique_ptr<Device, int (*)(Device*)>;
using OwnedStream = std::unique_ptr<Stream, void (*)(Stream*)>;

DriverReport look() {
  const Api api;
  const Version version = api.get_version();
  DriverReport report{
      .library = api.library.path(),
      .version = version_text({version.major, version.minor, version.maintenance, version.build})};
  for (const DeviceInfo& info : api.devices()) {
    const std::string uri = text_of(info.uri);
    PluggedIn& entry = report.found.emplace_back();
    entry.uri = "openni2:" + uri;
    entry.name = text_of(info.vendor) + " " + text_of(info.name);
    entry.sensor = SensorKind::structured_light;
    Device* opened = nullptr;
    if (api.device_open(uri.c_str(), &opened) != ok) {
      entry.note = "it cannot be opened (" + api.said() + "); " + plug_in;
      continue;
    }
    const OwnedDevice device(opened, api.device_close);
    entry.serial = api.property(opened, serial_property);
    entry.firmware = api.property(opened, firmware_property);
    const SensorModes* modes = api.device_get_modes(opened, depth_sensor);
    for (int i = 0; modes != nullptr && i < modes->count; ++i)
      entry.rate = std::max(entry.rate.value_or(0.0), static_cast<double>(modes->modes[i].rate));
  }
  return report;
}

class Camera final : public LiveCamera {
 public:
  explicit Camera(const Uri& uri)
      : LiveCamera({.uri = uri.text(),
                    .kind = "OpenNI2",
                    .clock = StampClock::sensor,
                    .sensor = SensorKind::structured_light,
                    .range = measurable}),
        device_(nullptr, api_.device_close),
        depth_(nullptr, api_.stream_destroy),
        colour_(nullptr, api_.stream_destroy) {
    uri.allow_only(std::to_array<std::string_view>({"width", "height", "fps", "colour", "sensor"}));
    info_.sensor = sensor_option(uri, info_.sensor);
    open_device(uri.path());
    DeviceInfo info{};
    if (api_.device_get_info(device_.get(), &info) == ok) {
      address_ = text_of(info.uri);
      info_.kind = text_of(info.vendor) + " " + text_of(info.name);
    }
    for (const DeviceInfo& each : api_.devices()) is_listed_ |= text_of(each.uri) == address_;
    open_depth(uri);
    if (uri.has("colour")) open_colour();
    start(depth_.get());
    if (colour_) start(colour_.get());
  }
  ~Camera() override {
    for (Stream* stream : {colour_.get(), depth_.get()}) {
      if (stream != nullptr) api_.stream_stop(stream);
    }
  }

 private:
  [[nodiscard]] bool try_open(const char* address) {
    Device* opened = nullptr;
    if (api_.device_open(address, &opened) != ok) return false;
    device_.reset(opened);
    return true;
  }

  // Without a path the first, or by serial number, file or address.
  void open_device(const std::string& wanted) {
    const std::vector<DeviceInfo> devices = api_.devices();
    if (wanted.empty()) {
      if (devices.empty()) throw Error(info_.uri, "OpenNI2 sees no camera", plug_in);
      if (!try_open(nullptr))
        throw Error(info_.uri, "it cannot be opened: " + api_.said(), plug_in);
      return;
    }
    std::string others;
    std::error_code error;
    if (!std::filesystem::exists(wanted, error)) {
      for (const DeviceInfo& each : devices) {
        const std::string address = text_of(each.uri);
        if (address == wanted) break;  // opened below
        if (!try_open(address.c_str())) continue;
        const std::string serial = api_.property(device_.get(), serial_property);
        if (!serial.empty() && serial == wanted) return;
        add_to_list(others, (serial.empty() ? address : serial) + " (" + text_of(each.name) + ")");
        device_.reset();
      }
    }
    if (try_open(wanted.c_str())) return;
    throw Error(info_.uri, "OpenNI2 cannot open it: " + api_.said(),
                others.empty() ? plug_in : "plugged in: " + others);
  }

  [[nodiscard]] OwnedStream stream_of(int sensor, const std::string& what) {
    Stream* stream = nullptr;
    if (api_.create_stream(device_.get(), sensor, &stream) != ok)
      throw Error(info_.uri, info_.kind + " gives no " + what + ": " + api_.said(),
                  sensor == colour_sensor ? "leave colour out" : "plug in a depth camera");
    return {stream, api_.stream_destroy};
  }
  void start(Stream* stream) {
    const int off = 0;
    // Refused by those that do not mirror
    static_cast<void>(api_.stream_set_property(stream, mirroring, &off, sizeof off));
    if (api_.stream_start(stream) != ok)
      throw Error(info_.uri, "it does not start: " + api_.said(),
                  "end other programs that use it; plug it in again");
  }

  void open_depth(const Uri& uri) {
    depth_ = stream_of(depth_sensor, "depth");
    const auto whole = [&](std::string_view key, double most, std::string_view unit) {
      return static_cast<int>(std::lround(uri.number_option(key, 0.0, 0.0, most, unit)));
    };
    const VideoMode wanted{.width = whole("width", 16384.0, "px"),
                           .height = whole("height", 16384.0, "px"),
                           .rate = whole("fps", 1000.0, "Hz")};
    const bool is_asked = wanted != VideoMode{};
    const SensorModes* list = api_.device_get_modes(device_.get(), depth_sensor);
    std::optional<VideoMode> best;
    std::string offered;
    const auto worth = [](const VideoMode& mode) {
      const int pixels = mode.width * mode.height;
      return std::make_tuple(pixels <= most_pixels ? pixels : -pixels, mode.format == format_1_mm,
                             mode.rate <= 30, mode.rate);
    };
    for (int i = 0; list != nullptr && i < list->count; ++i) {
      const VideoMode& mode = list->modes[i];
      if (mode.format != format_1_mm && mode.format != format_100_um) continue;
      add_to_list(offered,
                  size_text(mode.width, mode.height) + " at " + std::to_string(mode.rate) + " Hz");
      if ((wanted.width != 0 && mode.width != wanted.width) ||
          (wanted.height != 0 && mode.height != wanted.height) ||
          (wanted.rate != 0 && mode.rate != wanted.rate))
        continue;
      if (!best || worth(mode) > worth(*best)) best = mode;
    }
    if (is_asked && !best)
      throw Error(info_.uri, "it has no depth of that size and rate", "it offers " + offered);
    if (best && api_.stream_set_property(depth_.get(), mode_property, &*best, sizeof *best) == ok)
      info_.frame_rate = best->rate;
    else if (is_asked)
      throw Error(info_.uri, "it refuses that size and rate: " + api_.said(), "leave them out");
    horizontal_view_ = field_of_view(horizontal_fov);
    vertical_view_ = field_of_view(vertical_fov);
  }

  // [rad] Asked before anything runs: OpenNI2's own Dummy has none, and crashes once it ran.
  [[nodiscard]] double field_of_view(int which) const {
    float angle = 0.0F;  // [rad]
    int size = sizeof angle;
    if (api_.stream_get_property(depth_.get(), which, &angle, &size) != ok ||
        !(angle > 0.01F && angle < 3.1F))
      throw Error(info_.uri, "it does not say its field of view",
                  "record it with its own tools and give the images with depth:");
    return angle;
  }

  void open_colour() {
    colour_ = stream_of(colour_sensor, "colour");
    constexpr int depth_to_colour = 1;
    if (api_.registration_supported(device_.get(), depth_to_colour) == 0 ||
        api_.device_set_property(device_.get(), registration_property, &depth_to_colour,
                                 sizeof depth_to_colour) != ok)
      throw Error(info_.uri, info_.kind + " cannot register its depth to colour",
                  "leave colour out");
    VideoMode mode;
    int size = sizeof mode;
    if (api_.stream_get_property(depth_.get(), mode_property, &mode, &size) != ok) return;
    mode.format = format_rgb888;
    if (api_.stream_set_property(colour_.get(), mode_property, &mode, sizeof mode) != ok)
      throw Error(info_.uri, "its colour has no such size and rate as its depth",
                  "leave colour out, or choose another width and height");
  }

  std::optional<Frame> wait(double seconds) override {
    const double end = monotonic_now() + seconds;
    for (;;) {
      std::array<Stream*, 2> streams{depth_.get(), colour_.get()};
      const int count = colour_ ? 2 : 1;
      int ready = 0;
      const double left = std::max(end - monotonic_now(), 0.0);
      const int status = api_.wait_for_any(streams.data(), count, &ready,
                                           static_cast<int>(std::lround(1e3 * left)));
      if (status == timed_out) {
        expect_it_is_there();
        return std::nullopt;
      }
      ImageFrame* given = nullptr;
      if (status != ok || ready < 0 || ready >= count ||
          api_.stream_read(streams.at(static_cast<std::size_t>(ready)), &given) != ok ||
          given == nullptr)
        throw Error(info_.uri, "it gives no frame: " + api_.said(), "plug it in again");
      last_frame_ = monotonic_now();
      const std::unique_ptr<ImageFrame, void (*)(ImageFrame*)> image(given, api_.frame_release);
      if (ready == 0) return depth_of(*image);
      keep_colour(*image);
    }
  }

  // OpenNI2 goes on waiting when a camera goes.
  void expect_it_is_there() const {
    if (!is_listed_ || monotonic_now() - last_frame_ < silence) return;
    for (const DeviceInfo& each : api_.devices()) {
      if (text_of(each.uri) == address_) return;
    }
    throw Error(info_.uri, "it is not plugged in any more", "plug it in again");
  }

  Frame depth_of(const ImageFrame& image) {
    double units = 0.0;  // [1/m]
    if (image.mode.format == format_1_mm) units = 1000.0;
    if (image.mode.format == format_100_um) units = 10'000.0;
    if (units == 0.0)
      throw Error(info_.uri,
                  "its depth is of format " + std::to_string(image.mode.format) +
                      ", neither millimetres nor tenths of them",
                  "choose another width, height and fps");
    const std::array<int, 4> shape{image.width, image.height, image.crop_x, image.crop_y};
    if (!rays_ || shape != shape_) {
      // As OpenNI2 itself makes points of depth: the axis is at w / 2.
      const VideoMode& mode = image.mode;
      const double fx = 0.5 * mode.width / std::tan(0.5 * horizontal_view_);
      const double fy = 0.5 * mode.height / std::tan(0.5 * vertical_view_);
      const bool is_cropped = image.is_cropped != 0;
      rays_ = std::make_shared<const ViewingRays>(
          Intrinsics{.width = image.width,
                     .height = image.height,
                     .fx = fx,
                     .fy = fy,
                     .cx = 0.5 * mode.width - (is_cropped ? image.crop_x : 0),
                     .cy = 0.5 * mode.height - (is_cropped ? image.crop_y : 0)});
      shape_ = shape;
    }
    const auto stride = static_cast<std::size_t>(std::max(image.stride, 1));
    if (image.size < 0 || static_cast<std::size_t>(image.size) / stride <
                              static_cast<std::size_t>(std::max(image.height, 0)))
      throw Error(info_.uri, "its frames are shorter than they say", "update its driver");
    Frame frame;
    frame.stamp = 1e-6 * static_cast<double>(image.stamp);
    frame.cloud = std::make_shared<DepthImage>(
        rays_, depth_rows(image.data, image.width, image.height, stride, info_.uri), units);
    if (seen_ && seen_->width == image.width && seen_->height == image.height) frame.colour = seen_;
    return frame;
  }

  void keep_colour(const ImageFrame& image) {
    const auto bytes = std::int64_t{image.height} * image.stride;
    if (image.mode.format != format_rgb888 || image.size < bytes) return;
    if (auto rows = colour_rows(image.data, image.width, image.height, image.stride))
      seen_ = std::move(rows);
  }

  const Api api_;
  OwnedDevice device_;
  OwnedStream depth_, colour_;
  std::string address_;
  bool is_listed_ = false;
  double horizontal_view_ = 0.0, vertical_view_ = 0.0;  // [rad]
  double last_frame_ = monotonic_now();                 // [s] when it came
  std::array<int, 4> shape_{};                          // of the image that rays_ are for
  std::shared_ptr<const ViewingRays> rays_;
  std::shared_ptr<const ColourImage> seen_;
};

}  // namespace
}  // namespace palpate::openni2

namespace palpate {

/// docs/cameras.md describes it. A path may also be an address as OpenNI2 lists it.
Driver openni2_driver() {
  return {.name = "openni2",
          .summary = "openni2:SERIAL|FILE.oni, a Kinect v1, Xtion, Carmine or Astra by OpenNI2",
          .tried = "the library itself with a camera of the tests' own",
          .usb = {"1d27", "2bc5", "045e:02ae"},
          .open_camera = opened<openni2::Camera>,
          .look = reporting(openni2::look)};
}

}  // namespace palpate
