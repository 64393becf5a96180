// SPDX-License-Identifier: Apache-2.0
// librealsense2 as its headers describe it, with cameras that are not there. Its traps: the depth
// sensor is not the first, rows are padded, the first frames have the camera's own time although
// the global one is on, a set of frames has two streams, in either order, and a camera that is gone
// gives no error but no frames either.
#include <array>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "tests/fakes/fake_camera.hpp"

namespace {

int live_objects = 0;  // made and not given back
std::array<float, 64> options{};

}  // namespace

struct Counted {
  Counted() { ++live_objects; }
  ~Counted() { --live_objects; }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;
};
struct rs2_error : Counted {
  std::string message;
};
struct rs2_context : Counted {};
struct rs2_device_list : Counted {
  int count = 0;
};
struct rs2_device : Counted {
  int index = 0;
  int generation = 0;
};
struct rs2_sensor_list : Counted {};
struct rs2_sensor : Counted {
  bool is_depth = false;
};
struct rs2_config : Counted {
  std::string serial;
  int width = 0, height = 0, rate = 0;
  bool with_colour = false;
};
struct rs2_pipeline : Counted {
  int generation = 0;
  int width = 0, height = 0, rate = 0;
  bool with_colour = false, is_running = false;
};
struct rs2_pipeline_profile : Counted {
  int generation = 0;
};
struct rs2_stream_profile {
  int stream, format, rate, width, height;
};
struct rs2_frame : Counted {
  int references = 1;
  std::vector<rs2_frame*> parts;
  rs2_stream_profile* profile = nullptr;
  std::vector<unsigned char> data;
  int stride = 0;
  int domain = 0;
  double stamp = 0.0;     // [ms]
  long long arrival = 0;  // [ms]
};
struct rs2_intrinsics {
  int width, height;
  float ppx, ppy, fx, fy;
  int model;
  std::array<float, 5> coeffs;
};
struct rs2_extrinsics {
  std::array<float, 9> rotation;
  std::array<float, 3> translation;
};

namespace {

FakeCamera& world() { return FakeCamera::instance(); }

void fail(rs2_error** error, const std::string& message) {
  *error = new rs2_error;
  (*error)->message = message;
}

std::string serial_of(int index) { return "10000000000" + std::to_string(index + 1); }

rs2_stream_profile depth_profile{1, 1, 30, 0, 0};
rs2_stream_profile colour_profile{2, 5, 30, 0, 0};

double system_milliseconds() {
  using std::chrono::duration;
  return 1e3 * duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

rs2_frame* depth_frame() {
  auto* frame = new rs2_frame;
  const int width = depth_profile.width;
  const int height = depth_profile.height;
  const double unit = world().number("unit", 0.001);
  frame->profile = &depth_profile;
  frame->stride = 2 * width + 32;
  frame->data.assign(static_cast<std::size_t>(frame->stride * height), 0xee);
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const auto raw = static_cast<std::uint16_t>(std::lround(world().depth(u, v) / unit));
      std::memcpy(&frame->data[static_cast<std::size_t>(v * frame->stride + 2 * u)], &raw, 2);
    }
  }
  return frame;
}

rs2_frame* colour_frame() {
  auto* frame = new rs2_frame;
  frame->profile = &colour_profile;
  frame->stride = 3 * colour_profile.width;
  for (int i = 0; i < colour_profile.width * colour_profile.height; ++i)
    frame->data.insert(frame->data.end(), {200, 100, 50});
  return frame;
}

}  // namespace

FAKE_EXPORT int fake_live_objects() { return live_objects; }
FAKE_EXPORT float fake_option(int option) { return options.at(static_cast<std::size_t>(option)); }

FAKE_EXPORT int rs2_get_api_version(rs2_error** /*error*/) {
  world().begin();
  return static_cast<int>(world().number("version", 25802));
}
FAKE_EXPORT const char* rs2_get_error_message(const rs2_error* error) {
  return error->message.c_str();
}
FAKE_EXPORT void rs2_free_error(rs2_error* error) { delete error; }

FAKE_EXPORT rs2_context* rs2_create_context(int version, rs2_error** error) {
  if (version > 25802) {
    fail(error, "API version mismatch: librealsense.so was compiled with API version 2.58.2");
    return nullptr;
  }
  return new rs2_context;
}
FAKE_EXPORT void rs2_delete_context(rs2_context* context) { delete context; }
FAKE_EXPORT rs2_device_list* rs2_query_devices(const rs2_context* /*context*/,
                                               rs2_error** /*error*/) {
  world().look();
  auto* list = new rs2_device_list;
  list->count = world().cameras();
  return list;
}
FAKE_EXPORT int rs2_get_device_count(const rs2_device_list* list, rs2_error** /*error*/) {
  return list->count;
}
FAKE_EXPORT int rs2_device_list_contains(const rs2_device_list* list, const rs2_device* device,
                                         rs2_error** /*error*/) {
  return static_cast<int>(list->count > 0 && device->generation == world().generation());
}
FAKE_EXPORT void rs2_delete_device_list(rs2_device_list* list) { delete list; }
FAKE_EXPORT rs2_device* rs2_create_device(const rs2_device_list* list, int index,
                                          rs2_error** error) {
  if (index < 0 || index >= list->count) {
    fail(error, "out of range value for argument \"index\"");
    return nullptr;
  }
  if (world().has("denied")) {
    fail(error, "failed to open usb interface: 0, error: RS2_USB_STATUS_ACCESS");
    return nullptr;
  }
  auto* device = new rs2_device;
  device->index = index;
  device->generation = world().generation();
  return device;
}
FAKE_EXPORT void rs2_delete_device(rs2_device* device) { delete device; }
FAKE_EXPORT int rs2_supports_device_info(const rs2_device* /*device*/, int info,
                                         rs2_error** /*error*/) {
  return info >= 0 && info <= 2 ? 1 : static_cast<int>(info == 9);
}
FAKE_EXPORT const char* rs2_get_device_info(const rs2_device* device, int info, rs2_error** error) {
  static std::string text;
  switch (info) {
    case 0:
      text = "Intel RealSense D435";
      break;
    case 1:
      text = serial_of(device->index);
      break;
    case 2:
      text = "5.16.0.1";
      break;
    case 9:
      text = world().text("usb", "3.2");
      break;
    default:
      fail(error, "info not supported by the device!");
      return nullptr;
  }
  return text.c_str();
}
FAKE_EXPORT rs2_sensor_list* rs2_query_sensors(const rs2_device* /*device*/,
                                               rs2_error** /*error*/) {
  return new rs2_sensor_list;
}
FAKE_EXPORT int rs2_get_sensors_count(const rs2_sensor_list* /*list*/, rs2_error** /*error*/) {
  return 2;
}
FAKE_EXPORT void rs2_delete_sensor_list(rs2_sensor_list* list) { delete list; }
FAKE_EXPORT rs2_sensor* rs2_create_sensor(const rs2_sensor_list* /*list*/, int index,
                                          rs2_error** /*error*/) {
  auto* sensor = new rs2_sensor;
  sensor->is_depth = index == 1;
  return sensor;
}
FAKE_EXPORT void rs2_delete_sensor(rs2_sensor* sensor) { delete sensor; }
FAKE_EXPORT int rs2_is_sensor_extendable_to(const rs2_sensor* sensor, int extension,
                                            rs2_error** /*error*/) {
  return static_cast<int>(sensor->is_depth && extension == 7);
}
FAKE_EXPORT int rs2_supports_option(const rs2_sensor* sensor, int option, rs2_error** /*error*/) {
  if (!sensor->is_depth || (option == 53 && world().has("no_global_time"))) return 0;
  for (const int known : {3, 10, 12, 13, 18, 53}) {
    if (option == known) return 1;
  }
  return 0;
}
FAKE_EXPORT float rs2_get_option(const rs2_sensor* /*sensor*/, int option, rs2_error** /*error*/) {
  return option == 53 ? 1.0F : fake_option(option);
}
FAKE_EXPORT void rs2_set_option(const rs2_sensor* /*sensor*/, int option, float value,
                                rs2_error** error) {
  if (option == 13 && value > 360.0F) {
    fail(error, "out of range value for argument \"value\"");
    return;
  }
  options.at(static_cast<std::size_t>(option)) = value;
}

FAKE_EXPORT rs2_config* rs2_create_config(rs2_error** /*error*/) { return new rs2_config; }
FAKE_EXPORT void rs2_delete_config(rs2_config* config) { delete config; }
FAKE_EXPORT void rs2_config_enable_device(rs2_config* config, const char* serial,
                                          rs2_error** /*error*/) {
  config->serial = serial;
}
FAKE_EXPORT void rs2_config_enable_stream(rs2_config* config, int stream, int /*index*/, int width,
                                          int height, int /*format*/, int rate,
                                          rs2_error** /*error*/) {
  if (stream == 2) {
    config->with_colour = true;
    return;
  }
  config->width = width;
  config->height = height;
  config->rate = rate;
}
FAKE_EXPORT rs2_pipeline* rs2_create_pipeline(rs2_context* /*context*/, rs2_error** /*error*/) {
  return new rs2_pipeline;
}
FAKE_EXPORT void rs2_delete_pipeline(rs2_pipeline* pipeline) { delete pipeline; }
FAKE_EXPORT rs2_pipeline_profile* rs2_pipeline_start_with_config(rs2_pipeline* pipeline,
                                                                 rs2_config* config,
                                                                 rs2_error** error) {
  if (world().is_gone()) {
    fail(error, "No device connected");
    return nullptr;
  }
  if (world().has("busy")) {
    fail(error, "xioctl(VIDIOC_S_FMT) failed, errno=16 Last Error: Device or resource busy");
    return nullptr;
  }
  const int width = config->width == 0 ? world().width() : config->width;
  const int height = config->height == 0 ? world().height() : config->height;
  const bool is_known = (width == world().width() && height == world().height()) ||
                        (width == 2 * world().width() && height == 2 * world().height());
  if (!is_known || config->rate > 90) {
    fail(error, "Couldn't resolve requests");
    return nullptr;
  }
  depth_profile = {1, 1, config->rate == 0 ? 30 : config->rate, width, height};
  colour_profile = {2, 5, depth_profile.rate, 8, 6};
  pipeline->with_colour = config->with_colour;
  pipeline->is_running = true;
  pipeline->generation = world().generation();
  auto* profile = new rs2_pipeline_profile;
  profile->generation = pipeline->generation;
  return profile;
}
FAKE_EXPORT void rs2_pipeline_stop(rs2_pipeline* pipeline, rs2_error** error) {
  pipeline->is_running = false;
  if (world().is_gone()) fail(error, "get_device_time_ms failed: no such device");
}
FAKE_EXPORT rs2_device* rs2_pipeline_profile_get_device(rs2_pipeline_profile* profile,
                                                        rs2_error** /*error*/) {
  auto* device = new rs2_device;
  device->generation = profile->generation;
  return device;
}
FAKE_EXPORT void rs2_delete_pipeline_profile(rs2_pipeline_profile* profile) { delete profile; }
FAKE_EXPORT int rs2_pipeline_try_wait_for_frames(rs2_pipeline* pipeline, rs2_frame** frame,
                                                 unsigned milliseconds, rs2_error** error) {
  if (!pipeline->is_running) {
    fail(error, "try_wait_for_frames cannot be called before start()");
    return 0;
  }
  if (!world().wait(1e-3 * milliseconds) || pipeline->generation != world().generation()) return 0;
  auto* set = new rs2_frame;
  set->parts.push_back(depth_frame());
  if (pipeline->with_colour)
    set->parts.insert(world().frames() % 2 == 0 ? set->parts.begin() : set->parts.end(),
                      colour_frame());
  const double now = system_milliseconds();
  const bool is_own = world().has("no_global_time") || world().frames() <= 2;
  for (rs2_frame* part : set->parts) {
    part->domain = is_own ? 0 : 2;
    part->arrival = static_cast<long long>(now);
    // Captured 20 ms ago; its own clock began with it.
    part->stamp = is_own ? 33.333 * world().frames() : now - 20.0;
  }
  *frame = set;
  return 1;
}
FAKE_EXPORT int rs2_embedded_frames_count(rs2_frame* set, rs2_error** /*error*/) {
  return static_cast<int>(set->parts.size());
}
FAKE_EXPORT rs2_frame* rs2_extract_frame(rs2_frame* set, int index, rs2_error** /*error*/) {
  rs2_frame* part = set->parts.at(static_cast<std::size_t>(index));
  ++part->references;
  return part;
}
FAKE_EXPORT void rs2_release_frame(rs2_frame* frame) {
  if (--frame->references > 0) return;
  for (rs2_frame* part : frame->parts) rs2_release_frame(part);
  delete frame;
}
FAKE_EXPORT const void* rs2_get_frame_data(const rs2_frame* frame, rs2_error** /*error*/) {
  return frame->data.data();
}
FAKE_EXPORT int rs2_get_frame_width(const rs2_frame* frame, rs2_error** /*error*/) {
  return frame->profile->width;
}
FAKE_EXPORT int rs2_get_frame_height(const rs2_frame* frame, rs2_error** /*error*/) {
  return frame->profile->height;
}
FAKE_EXPORT int rs2_get_frame_stride_in_bytes(const rs2_frame* frame, rs2_error** /*error*/) {
  return frame->stride;
}
FAKE_EXPORT double rs2_get_frame_timestamp(const rs2_frame* frame, rs2_error** /*error*/) {
  return frame->stamp;
}
FAKE_EXPORT int rs2_get_frame_timestamp_domain(const rs2_frame* frame, rs2_error** /*error*/) {
  return frame->domain;
}
FAKE_EXPORT int rs2_supports_frame_metadata(const rs2_frame* /*frame*/, int which,
                                            rs2_error** /*error*/) {
  return static_cast<int>(which == 7);
}
FAKE_EXPORT long long rs2_get_frame_metadata(const rs2_frame* frame, int /*which*/,
                                             rs2_error** /*error*/) {
  return frame->arrival;
}
#ifndef FAKE_WITHOUT_UNITS
FAKE_EXPORT float rs2_depth_frame_get_units(const rs2_frame* /*frame*/, rs2_error** /*error*/) {
  return static_cast<float>(world().number("unit", 0.001));
}
#endif
FAKE_EXPORT const rs2_stream_profile* rs2_get_frame_stream_profile(const rs2_frame* frame,
                                                                   rs2_error** /*error*/) {
  return frame->profile;
}
FAKE_EXPORT void rs2_get_stream_profile_data(const rs2_stream_profile* profile, int* stream,
                                             int* format, int* index, int* id, int* rate,
                                             rs2_error** /*error*/) {
  *stream = profile->stream;
  *format = profile->format;
  *index = 0;
  *id = profile->stream;
  *rate = profile->rate;
}
FAKE_EXPORT void rs2_get_video_stream_intrinsics(const rs2_stream_profile* profile,
                                                 rs2_intrinsics* intrinsics,
                                                 rs2_error** /*error*/) {
  const int width = profile->width + static_cast<int>(world().number("lens_wider", 0));
  const bool is_depth = profile->stream == 1;
  *intrinsics = {width,
                 profile->height,
                 0.5F * static_cast<float>(width - 1),
                 0.5F * static_cast<float>(profile->height - 1),
                 1.2F * static_cast<float>(profile->width),
                 1.2F * static_cast<float>(profile->width),
                 is_depth ? static_cast<int>(world().number("model", 4)) : 2,
                 {}};
  if (!is_depth || world().has("distorted")) intrinsics->coeffs = {0.1F, -0.05F, 0, 0, 0.01F};
}
FAKE_EXPORT void rs2_get_extrinsics(const rs2_stream_profile* from, const rs2_stream_profile* to,
                                    rs2_extrinsics* extrinsics, rs2_error** error) {
  if (from->stream != 2 || to->stream != 1) {
    fail(error, "Requested extrinsics are not available!");
    return;
  }
  // The colour camera is 15 mm to the right and turned by 90 degrees about z; column by column.
  *extrinsics = {{0, 1, 0, -1, 0, 0, 0, 0, 1}, {0.015F, 0, 0}};
}
