// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "palpate/drivers/drivers.hpp"
#include "palpate/drivers/live_camera.hpp"
#include "palpate/drivers/shared_library.hpp"
#include "palpate/io/sources/depth_png.hpp"
#include "palpate/io/sources/realsense_lens.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate::realsense {
namespace {

// The C interface of librealsense2, 2.50 to 2.58, from its headers; only what is used. Every call
// that can fail ends in an error to be filled.
struct LibraryError;
struct Context;
struct DeviceList;
struct CameraDevice;  // rs2_device
struct SensorList;
struct DepthSensor;  // rs2_sensor, which is an rs2_options too
struct Pipeline;
struct PipelineConfig;
struct PipelineProfile;
struct LibraryFrame;
struct StreamProfile;
struct LibraryIntrinsics {
  int width, height;
  float ppx, ppy, fx, fy;
  int model;
  std::array<float, 5> coeffs;
};
struct LibraryExtrinsics {
  std::array<float, 9> rotation;  // column by column
  std::array<float, 3> translation;
};

constexpr int stream_depth = 1, stream_colour = 2;
constexpr int format_z16 = 1, format_rgb8 = 5;
constexpr int info_name = 0, info_serial = 1, info_firmware = 2, info_usb = 9;
constexpr int option_exposure = 3, option_auto_exposure = 10, option_preset = 12, option_laser = 13,
              option_emitter = 18, option_global_time = 53;
constexpr int extension_depth_sensor = 7;
constexpr int domain_hardware = 0;
constexpr int metadata_arrival = 7;  // [ms since 1970]
constexpr std::array<const char*, 6> distortions{
    "None",   "Modified Brown Conrady", "Inverse Brown Conrady",
    "Ftheta", "Brown Conrady",          "Kannala Brandt4"};
constexpr std::array<std::string_view, 5> presets{"default", "hand", "high-accuracy",
                                                  "high-density", "medium-density"};
constexpr int first_preset = 1;  // of the D400 series, in the order of `presets`

constexpr double silence = 0.5;  // [s] without a frame after which the camera is looked for

constexpr DepthRange stereo_range{0.05, 20.0};  // [m] the D405 sees the nearest
constexpr DepthRange other_range{0.15, 10.0};   // [m] L515 and SR300 series

class Refusal : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

LibraryNames library_names() {
  LibraryNames names{.name = "librealsense2",
                     .files = {"librealsense2.so"},
                     .variable = "PALPATE_LIBREALSENSE",
                     .remedy =
                         "install librealsense2 2.50 or later, RealSense's SDK, which is no "
                         "package of Debian's or Ubuntu's"};
  for (int minor = 58; minor >= 50; --minor)
    names.files.push_back("librealsense2.so.2." + std::to_string(minor));
  return names;
}

std::string version_of(int code) {
  return version_text({code / 10000, code / 100 % 100, code % 100});
}

class Api {
  // A function of the library: its last argument, an error to be filled, is not given.
  template <class Signature>
  class Call;
  template <class Result, class... Given>
  class Call<Result(Given...)> {
   public:
    Call(const Api& api, const char* symbol) : api_(api), function_(api.library.find(symbol)) {}

    // @throws Refusal with the library's words
    Result operator()(Given... given) const {
      LibraryError* error = nullptr;
      if constexpr (std::is_void_v<Result>) {
        function_(given..., &error);
        api_.check(error);
      } else {
        Result result = function_(given..., &error);
        api_.check(error);
        return result;
      }
    }

   private:
    const Api& api_;
    Result (*function_)(Given..., LibraryError**);
  };

 public:
  Api() = default;
  Api(const Api&) = delete;
  Api& operator=(const Api&) = delete;

  SharedLibrary library{library_names()};
  const char* (*get_error_message)(const LibraryError*) = library.find("rs2_get_error_message");
  void (*free_error)(LibraryError*) = library.find("rs2_free_error");
  Call<int()> get_api_version{*this, "rs2_get_api_version"};
  int version = supported_version();
  Call<Context*(int)> create_context{*this, "rs2_create_context"};
  void (*delete_context)(Context*) = library.find("rs2_delete_context");
  Call<DeviceList*(const Context*)> query_devices{*this, "rs2_query_devices"};
  Call<int(const DeviceList*)> get_device_count{*this, "rs2_get_device_count"};
  void (*delete_device_list)(DeviceList*) = library.find("rs2_delete_device_list");
  Call<int(const DeviceList*, const CameraDevice*)> device_list_contains{
      *this, "rs2_device_list_contains"};
  Call<CameraDevice*(const DeviceList*, int)> create_device{*this, "rs2_create_device"};
  void (*delete_device)(CameraDevice*) = library.find("rs2_delete_device");
  Call<int(const CameraDevice*, int)> supports_device_info{*this, "rs2_supports_device_info"};
  Call<const char*(const CameraDevice*, int)> get_device_info{*this, "rs2_get_device_info"};
  Call<SensorList*(const CameraDevice*)> query_sensors{*this, "rs2_query_sensors"};
  Call<int(const SensorList*)> get_sensors_count{*this, "rs2_get_sensors_count"};
  void (*delete_sensor_list)(SensorList*) = library.find("rs2_delete_sensor_list");
  Call<DepthSensor*(const SensorList*, int)> create_sensor{*this, "rs2_create_sensor"};
  void (*delete_sensor)(DepthSensor*) = library.find("rs2_delete_sensor");
  Call<int(const DepthSensor*, int)> is_sensor_extendable_to{*this, "rs2_is_sensor_extendable_to"};
  Call<int(const DepthSensor*, int)> supports_option{*this, "rs2_supports_option"};
  Call<float(const DepthSensor*, int)> get_option{*this, "rs2_get_option"};
  Call<void(const DepthSensor*, int, float)> set_option{*this, "rs2_set_option"};
  Call<Pipeline*(Context*)> create_pipeline{*this, "rs2_create_pipeline"};
  void (*delete_pipeline)(Pipeline*) = library.find("rs2_delete_pipeline");
  Call<PipelineConfig*()> create_config{*this, "rs2_create_config"};
  void (*delete_config)(PipelineConfig*) = library.find("rs2_delete_config");
  Call<void(PipelineConfig*, const char*)> config_enable_device{*this, "rs2_config_enable_device"};
  Call<void(PipelineConfig*, int, int, int, int, int, int)> config_enable_stream{
      *this, "rs2_config_enable_stream"};
  Call<PipelineProfile*(Pipeline*, PipelineConfig*)> pipeline_start{
      *this, "rs2_pipeline_start_with_config"};
  Call<void(Pipeline*)> pipeline_stop{*this, "rs2_pipeline_stop"};
  Call<int(Pipeline*, LibraryFrame**, unsigned)> pipeline_wait{*this,
                                                               "rs2_pipeline_try_wait_for_frames"};
  Call<CameraDevice*(PipelineProfile*)> profile_get_device{*this,
                                                           "rs2_pipeline_profile_get_device"};
  void (*delete_pipeline_profile)(PipelineProfile*) = library.find("rs2_delete_pipeline_profile");
  Call<int(LibraryFrame*)> embedded_frames_count{*this, "rs2_embedded_frames_count"};
  Call<LibraryFrame*(LibraryFrame*, int)> extract_frame{*this, "rs2_extract_frame"};
  void (*release_frame)(LibraryFrame*) = library.find("rs2_release_frame");
  Call<const void*(const LibraryFrame*)> get_frame_data{*this, "rs2_get_frame_data"};
  Call<int(const LibraryFrame*)> get_frame_width{*this, "rs2_get_frame_width"};
  Call<int(const LibraryFrame*)> get_frame_height{*this, "rs2_get_frame_height"};
  Call<int(const LibraryFrame*)> get_frame_stride{*this, "rs2_get_frame_stride_in_bytes"};
  Call<double(const LibraryFrame*)> get_frame_timestamp{*this, "rs2_get_frame_timestamp"};  // [ms]
  Call<int(const LibraryFrame*)> get_frame_domain{*this, "rs2_get_frame_timestamp_domain"};
  Call<int(const LibraryFrame*, int)> supports_metadata{*this, "rs2_supports_frame_metadata"};
  Call<long long(const LibraryFrame*, int)> get_metadata{*this, "rs2_get_frame_metadata"};
  Call<float(const LibraryFrame*)> get_units{*this, "rs2_depth_frame_get_units"};  // [m]
  Call<const StreamProfile*(const LibraryFrame*)> get_stream_profile{
      *this, "rs2_get_frame_stream_profile"};
  Call<void(const StreamProfile*, int*, int*, int*, int*, int*)> get_profile_data{
      *this, "rs2_get_stream_profile_data"};
  Call<void(const StreamProfile*, LibraryIntrinsics*)> get_intrinsics{
      *this, "rs2_get_video_stream_intrinsics"};
  Call<void(const StreamProfile*, const StreamProfile*, LibraryExtrinsics*)> get_extrinsics{
      *this, "rs2_get_extrinsics"};

 private:
  void check(LibraryError* error) const {
    if (error == nullptr) return;
    const char* said = get_error_message(error);
    const std::string message = said == nullptr ? "" : said;
    free_error(error);
    throw Refusal(message);
  }
  [[nodiscard]] int supported_version() const {
    const int found = get_api_version();
    if (found / 10000 != 2)
      throw Error("librealsense2", library.path() + " is of version " + version_of(found),
                  "install 2.50 or later");
    return found;
  }
};

// What the library made, given back to it at the end.
template <class Thing>
using Owned = std::unique_ptr<Thing, void (*)(Thing*)>;

std::string remedy_for(const std::string& refusal) {
  const std::string said = lower_case(refusal);
  const auto says = [&](std::string_view word) { return said.find(word) != std::string::npos; };
  if (says("permission") || says("access") || says("denied") || says("power state"))
    return "install the SDK's udev rules (99-realsense-libusb.rules) and plug it in again";
  if (says("busy")) return "end the other program that uses it";
  if (says("resolve"))
    return "leave width, height and fps out, or take those that rs-enumerate-devices lists";
  return "check its cable and port; plug it in again";
}

struct Found {
  std::string name, serial, firmware, usb;
};

std::string info_of(const Api& api, const CameraDevice* device, int which) {
  if (api.supports_device_info(device, which) == 0) return {};
  const char* text = api.get_device_info(device, which);
  return text == nullptr ? "" : text;
}

Found found_of(const Api& api, const CameraDevice* device) {
  return {info_of(api, device, info_name), info_of(api, device, info_serial),
          info_of(api, device, info_firmware), info_of(api, device, info_usb)};
}

std::string usb_note(const std::string& usb) {
  return usb.starts_with("2") ? "it is on USB " + usb +
                                    ", which is too slow for most sizes; use a cable and a port "
                                    "of USB 3"
                              : "";
}

// The sensor that measures depth; null if the device has none.
Owned<DepthSensor> depth_sensor(const Api& api, const CameraDevice* device) {
  const Owned<SensorList> sensors(api.query_sensors(device), api.delete_sensor_list);
  const int count = api.get_sensors_count(sensors.get());
  for (int i = 0; i < count; ++i) {
    Owned<DepthSensor> sensor(api.create_sensor(sensors.get(), i), api.delete_sensor);
    if (api.is_sensor_extendable_to(sensor.get(), extension_depth_sensor) != 0) return sensor;
  }
  return {nullptr, api.delete_sensor};
}

DriverReport look() {
  const Api api;
  DriverReport report{.library = api.library.path(), .version = version_of(api.version)};
  try {
    const Owned<Context> context(api.create_context(api.version), api.delete_context);
    const Owned<DeviceList> devices(api.query_devices(context.get()), api.delete_device_list);
    const int count = api.get_device_count(devices.get());
    for (int i = 0; i < count; ++i) {
      PluggedIn& entry = report.found.emplace_back();
      entry.uri = "realsense:";
      try {
        const Owned<CameraDevice> device(api.create_device(devices.get(), i), api.delete_device);
        const Found found = found_of(api, device.get());
        entry = {.uri = "realsense:" + found.serial,
                 .name = found.name,
                 .serial = found.serial,
                 .firmware = found.firmware,
                 .sensor = realsense_sensor(found.name),
                 .note = usb_note(found.usb)};
      } catch (const Refusal& refusal) {
        entry.note = std::string(refusal.what()) + "; " + remedy_for(refusal.what());
      }
    }
  } catch (const Refusal& refusal) {
    report.problem =
        std::string("librealsense2: ") + refusal.what() + "; " + remedy_for(refusal.what());
  }
  return report;
}

RealSenseLens lens_of(const LibraryIntrinsics& given) {
  RealSenseLens lens{.pinhole = {.width = given.width,
                                 .height = given.height,
                                 .fx = given.fx,
                                 .fy = given.fy,
                                 .cx = given.ppx,
                                 .cy = given.ppy},
                     .model = "of number " + std::to_string(given.model)};
  if (given.model >= 0 && given.model < static_cast<int>(distortions.size()))
    lens.model = distortions.at(static_cast<std::size_t>(given.model));
  std::copy(given.coeffs.begin(), given.coeffs.end(), lens.coeffs.begin());
  return lens;
}

class Camera final : public LiveCamera {
 public:
  explicit Camera(const Uri& uri)
      : LiveCamera({.uri = uri.text(), .kind = "RealSense"}),
        context_(nullptr, api_.delete_context),
        config_(nullptr, api_.delete_config),
        pipeline_(nullptr, api_.delete_pipeline),
        profile_(nullptr, api_.delete_pipeline_profile),
        device_(nullptr, api_.delete_device) {
    try {
      open(uri);
    } catch (const Refusal& refusal) {
      throw error(refusal);
    }
  }
  ~Camera() override {
    try {
      if (profile_) api_.pipeline_stop(pipeline_.get());
    } catch (const Refusal&) {  // it has ended
    }
  }

 private:
  [[nodiscard]] Error error(const Refusal& refusal) const {
    return {info_.uri, refusal.what(), remedy_for(refusal.what())};
  }

  // The serial number of the camera that is meant.
  std::string choose(const std::string& wanted) {
    const Owned<DeviceList> devices(api_.query_devices(context_.get()), api_.delete_device_list);
    const int count = api_.get_device_count(devices.get());
    std::string others;
    for (int i = 0; i < count; ++i) {
      const Owned<CameraDevice> device(api_.create_device(devices.get(), i), api_.delete_device);
      const Found found = found_of(api_, device.get());
      if (wanted.empty() || found.serial == wanted) {
        info_.kind = found.name;
        info_.sensor = realsense_sensor(found.name);
        info_.range = info_.sensor == SensorKind::stereo ? stereo_range : other_range;
        if (const std::string note = usb_note(found.usb); !note.empty())
          info_.notes.push_back(note);
        return found.serial;
      }
      add_to_list(others, found.serial + " (" + found.name + ")");
    }
    if (count > 0)
      throw Error(info_.uri, "there is no RealSense of that serial number",
                  "plugged in: " + others);
    throw Error(info_.uri, "no RealSense is plugged in",
                "plug it in; if it is, install the SDK's udev rules (99-realsense-libusb.rules)");
  }

  void open(const Uri& uri) {
    uri.allow_only(std::to_array<std::string_view>(
        {"width", "height", "fps", "colour", "preset", "laser", "exposure"}));
    const auto whole = [&](std::string_view key, double most, std::string_view unit) {
      return static_cast<int>(std::lround(uri.number_option(key, 0.0, 0.0, most, unit)));
    };
    const int width = whole("width", 16384.0, "px");
    const int height = whole("height", 16384.0, "px");
    const int rate = whole("fps", 1000.0, "Hz");
    context_.reset(api_.create_context(api_.version));
    const std::string serial = choose(uri.path());
    config_.reset(api_.create_config());
    api_.config_enable_device(config_.get(), serial.c_str());
    api_.config_enable_stream(config_.get(), stream_depth, -1, width, height, format_z16, rate);
    if (uri.has("colour"))
      api_.config_enable_stream(config_.get(), stream_colour, -1, 0, 0, format_rgb8, rate);
    pipeline_.reset(api_.create_pipeline(context_.get()));
    profile_.reset(api_.pipeline_start(pipeline_.get(), config_.get()));
    device_.reset(api_.profile_get_device(profile_.get()));
    const Owned<DepthSensor> sensor = depth_sensor(api_, device_.get());
    if (!sensor) throw Error(info_.uri, info_.kind + " has no depth", "plug in a depth camera");
    set_options(uri, sensor.get());
    const bool is_global = api_.supports_option(sensor.get(), option_global_time) != 0 &&
                           api_.get_option(sensor.get(), option_global_time) != 0.0F;
    info_.clock = is_global ? StampClock::system : StampClock::sensor;
  }

  void set_options(const Uri& uri, const DepthSensor* sensor) {
    const auto set = [&](std::string_view key, int option, float value) {
      if (api_.supports_option(sensor, option) == 0)
        throw Error(info_.uri, info_.kind + " has no option " + std::string(key), "leave it out");
      try {
        api_.set_option(sensor, option, value);
      } catch (const Refusal& refusal) {
        throw Error(info_.uri, std::string(key) + " is refused: " + refusal.what(),
                    "give another value or leave it out");
      }
    };
    if (uri.has("preset")) {
      const std::string name = uri.text_option("preset", "");
      const auto* const preset = std::find(presets.begin(), presets.end(), name);
      if (preset == presets.end())
        throw Error(info_.uri, "there is no preset '" + name + "'",
                    "known here: default, hand, high-accuracy, high-density, medium-density");
      set("preset", option_preset, static_cast<float>(first_preset + (preset - presets.begin())));
    }
    if (uri.has("laser")) {
      const auto power = static_cast<float>(uri.number_option("laser", 0.0, 0.0, 1000.0, "mW"));
      set("laser", option_emitter, power > 0.0F ? 1.0F : 0.0F);
      if (power > 0.0F) set("laser", option_laser, power);
    }
    if (uri.has("exposure")) {
      const double exposure = uri.number_option("exposure", 0.0, 1e-6, 1.0, "s");
      if (api_.supports_option(sensor, option_auto_exposure) != 0)
        set("exposure", option_auto_exposure, 0.0F);
      set("exposure", option_exposure, static_cast<float>(1e6 * exposure));
    }
  }

  std::optional<Frame> wait(double seconds) override {
    try {
      LibraryFrame* given = nullptr;
      const auto milliseconds = static_cast<unsigned>(std::lround(1e3 * seconds));
      if (api_.pipeline_wait(pipeline_.get(), &given, milliseconds) == 0 || given == nullptr) {
        expect_it_is_there();
        return std::nullopt;
      }
      last_frame_ = monotonic_now();
      const Owned<LibraryFrame> set(given, api_.release_frame);
      return frame_of(set.get());
    } catch (const Refusal& refusal) {
      throw error(refusal);
    }
  }

  // The library itself says nothing when a camera goes.
  void expect_it_is_there() const {
    if (monotonic_now() - last_frame_ < silence) return;
    const Owned<DeviceList> devices(api_.query_devices(context_.get()), api_.delete_device_list);
    if (api_.device_list_contains(devices.get(), device_.get()) == 0)
      throw Error(info_.uri, "it is not plugged in any more", "plug it in again");
  }

  std::optional<Frame> frame_of(LibraryFrame* set) {
    std::optional<Frame> frame;
    std::shared_ptr<ColourImage> colour;
    const StreamProfile* depth_profile = nullptr;
    const StreamProfile* colour_profile = nullptr;
    const int count = api_.embedded_frames_count(set);
    for (int i = 0; i < count; ++i) {
      const Owned<LibraryFrame> part(api_.extract_frame(set, i), api_.release_frame);
      const StreamProfile* profile = api_.get_stream_profile(part.get());
      int stream = 0, format = 0, index = 0, id = 0, rate = 0;
      api_.get_profile_data(profile, &stream, &format, &index, &id, &rate);
      if (stream == stream_depth && format == format_z16) {
        info_.frame_rate = rate;
        depth_profile = profile;
        frame = depth_of(part.get(), profile);
      } else if (stream == stream_colour && format == format_rgb8) {
        colour_profile = profile;
        colour = colour_of(part.get(), profile);
      }
    }
    if (frame && colour) {
      LibraryExtrinsics moved{};
      api_.get_extrinsics(colour_profile, depth_profile, &moved);
      for (int column = 0; column < 3; ++column) {
        for (int row = 0; row < 3; ++row)
          colour->camera->world_from_camera.linear()(row, column) =
              moved.rotation.at(static_cast<std::size_t>(3 * column + row));
        colour->camera->world_from_camera.translation()[column] =
            moved.translation.at(static_cast<std::size_t>(column));
      }
      frame->colour = std::move(colour);
    }
    return frame;
  }

  LibraryIntrinsics intrinsics_of_profile(const StreamProfile* profile) const {
    LibraryIntrinsics intrinsics{};
    api_.get_intrinsics(profile, &intrinsics);
    return intrinsics;
  }

  Frame depth_of(const LibraryFrame* part, const StreamProfile* profile) {
    const Intrinsics k = intrinsics_of(lens_of(intrinsics_of_profile(profile)), info_.uri);
    const int width = api_.get_frame_width(part);
    const int height = api_.get_frame_height(part);
    check_size(k, width, height, info_.uri, "update firmware and library");
    if (!rays_ || !(rays_->intrinsics() == k)) rays_ = std::make_shared<const ViewingRays>(k);
    const double unit = api_.get_units(part);  // [m]
    if (!(unit > 0.0))
      throw Error(info_.uri, "it says " + std::to_string(unit) + " m for a unit of depth",
                  "update its firmware");
    // A float has seven digits: 0.001f is meant to be 1/1000 m.
    const double units_per_metre = std::round(100.0 / unit) / 100.0;
    const int stride = api_.get_frame_stride(part);
    Frame frame;
    frame.cloud = std::make_shared<DepthImage>(
        rays_,
        depth_rows(api_.get_frame_data(part), width, height,
                   static_cast<std::size_t>(std::max(stride, 0)), info_.uri),
        units_per_metre);
    stamp(part, frame);
    return frame;
  }

  void stamp(const LibraryFrame* part, Frame& frame) const {
    const auto since_1970 = std::chrono::system_clock::now().time_since_epoch();
    const double now = std::chrono::duration<double>(since_1970).count();
    double arrival = now;  // [s since 1970]
    if (api_.supports_metadata(part, metadata_arrival) != 0)
      arrival = 1e-3 * static_cast<double>(api_.get_metadata(part, metadata_arrival));
    // It is of a whole millisecond, and of another program's clock where that was set.
    const double waited = std::clamp(now - arrival, 0.0, 1.0);
    frame.arrival = monotonic_now() - waited;
    const bool is_of_the_camera = api_.get_frame_domain(part) == domain_hardware;
    frame.stamp = info_.clock == StampClock::system && is_of_the_camera
                      ? now - waited
                      : 1e-3 * api_.get_frame_timestamp(part);
  }

  std::shared_ptr<ColourImage> colour_of(const LibraryFrame* part, const StreamProfile* profile) {
    auto image = colour_rows(api_.get_frame_data(part), api_.get_frame_width(part),
                             api_.get_frame_height(part), api_.get_frame_stride(part));
    if (!image) return nullptr;
    // Colour is to be looked at: a distortion that has no equal here is left out.
    RealSenseLens lens = lens_of(intrinsics_of_profile(profile));
    if (lens.model != "Brown Conrady") lens.coeffs = {};
    image->camera = ColourImage::Camera{.intrinsics = intrinsics_of(lens, info_.uri)};
    return image;
  }

  const Api api_;
  Owned<Context> context_;
  Owned<PipelineConfig> config_;
  Owned<Pipeline> pipeline_;
  Owned<PipelineProfile> profile_;
  Owned<CameraDevice> device_;
  double last_frame_ = monotonic_now();  // [s] when it came
  std::shared_ptr<const ViewingRays> rays_;
};

}  // namespace
}  // namespace palpate::realsense

namespace palpate {

/// docs/cameras.md describes it. A frame that says it has the camera's own time although the clock
/// is the system's, as the first ones after the start do, gets the time at which it arrived.
Driver realsense_driver() {
  return {.name = "realsense",
          .summary = "realsense:SERIAL, a RealSense camera by librealsense2",
          .tried = "a mock library only",
          .usb = {"8086:0a", "8086:0b"},
          .open_camera = opened<realsense::Camera>,
          .look = reporting(realsense::look)};
}

}  // namespace palpate
