// SPDX-License-Identifier: Apache-2.0
// OpenNI2 as its headers describe it. Its traps: images are mirrored until that is switched off,
// the mode at the start is the smallest, a device that is gone only ends in time-outs.
#include <array>
#include <cstring>
#include <string>
#include <vector>

#include "tests/fakes/fake_camera.hpp"

namespace {

int live_objects = 0;  // made and not given back

FakeCamera& world() { return FakeCamera::instance(); }

std::string last_error;

}  // namespace

struct VideoMode {
  int format, width, height, rate;
};
struct SensorInfo {
  int sensor, count;
  VideoMode* modes;
};
struct DeviceInfo {
  char uri[256], vendor[256], name[256];
  std::uint16_t usb_vendor, usb_product;
};
struct Frame {
  int size;
  void* data;
  int sensor;
  std::uint64_t stamp;
  int number, width, height;
  VideoMode mode;
  int is_cropped, crop_x, crop_y, stride;
};
struct Version {
  int major, minor, maintenance, build;
};
struct Device {
  int index, generation;
  bool is_registered;
};
struct Stream {
  Device* device;
  int sensor;
  VideoMode mode;
  bool is_mirrored, is_running, is_ready;
};

namespace {

std::array<VideoMode, 4> depth_modes() {
  const int format = world().has("tenths") ? 101 : 100;
  const int width = world().width();
  const int height = world().height();
  return {{{format, width / 2, height / 2, 30},
           {format, width, height, 30},
           {102, width, height, 30},
           {format, width, height, 60}}};
}

DeviceInfo info_of(int index) {
  DeviceInfo info{};
  // A number of the bus, which is another one when it is plugged in again
  const int number = index + 1 + 10 * world().generation();
  std::strcpy(info.uri, ("1d27/0601@1/" + std::to_string(number)).c_str());
  std::strcpy(info.vendor, "PrimeSense");
  std::strcpy(info.name, "PS1080");
  return info;
}

bool is_gone(const Stream* stream) {
  return world().is_gone() || stream->device->generation != world().generation();
}

}  // namespace

FAKE_EXPORT int fake_live_objects() { return live_objects; }

FAKE_EXPORT int oniInitialize(int version) {
  world().begin();
  if (version / 1000 != 2 || world().has("no_drivers")) {
    last_error = "\tFound no valid drivers in '/usr/lib/OpenNI2/Drivers'\n";
    return 1;
  }
  ++live_objects;
  return 0;
}
FAKE_EXPORT void oniShutdown() { --live_objects; }
FAKE_EXPORT Version oniGetVersion() { return {2, 2, 0, 33}; }
FAKE_EXPORT const char* oniGetExtendedError() { return last_error.c_str(); }
FAKE_EXPORT int oniGetDeviceList(DeviceInfo** list, int* count) {
  world().look();
  *count = world().cameras();
  *list = new DeviceInfo[static_cast<std::size_t>(*count)];
  for (int i = 0; i < *count; ++i) (*list)[i] = info_of(i);
  ++live_objects;
  return 0;
}
FAKE_EXPORT int oniReleaseDeviceList(DeviceInfo* list) {
  delete[] list;
  --live_objects;
  return 0;
}
FAKE_EXPORT int oniDeviceOpen(const char* uri, Device** device) {
  if (world().has("denied")) {
    last_error =
        "\tDeviceOpen using default: no devices found\n\tCould not open USB: access denied\n";
    return 1;
  }
  const int count = world().cameras();
  for (int i = 0; i < count; ++i) {
    if (uri != nullptr && std::string(uri) != info_of(i).uri) continue;
    *device = new Device{i, world().generation(), false};
    ++live_objects;
    return 0;
  }
  last_error =
      "\tDeviceOpen: Couldn't open device '" + std::string(uri == nullptr ? "" : uri) + "'\n";
  return 6;
}
FAKE_EXPORT int oniDeviceClose(Device* device) {
  delete device;
  --live_objects;
  return 0;
}
FAKE_EXPORT int oniDeviceGetInfo(Device* device, DeviceInfo* info) {
  *info = info_of(device->index);
  return 0;
}
FAKE_EXPORT const SensorInfo* oniDeviceGetSensorInfo(Device* /*device*/, int sensor) {
  static std::array<VideoMode, 4> modes;
  static SensorInfo info;
  modes = depth_modes();
  info = {sensor, static_cast<int>(modes.size()), modes.data()};
  return &info;
}
FAKE_EXPORT int oniDeviceGetProperty(Device* device, int property, void* data, int* size) {
  const std::string text = property == 3   ? "KINECT-" + std::to_string(device->index + 1)
                           : property == 0 ? "5.9.2"
                                           : "";
  if (text.empty() || *size <= static_cast<int>(text.size())) return 3;
  std::memcpy(data, text.c_str(), text.size() + 1);
  *size = static_cast<int>(text.size()) + 1;
  return 0;
}
FAKE_EXPORT int oniDeviceIsImageRegistrationModeSupported(Device* /*device*/, int mode) {
  return static_cast<int>(mode == 1 && !world().has("no_registration"));
}
FAKE_EXPORT int oniDeviceSetProperty(Device* device, int property, const void* data, int size) {
  if (property != 5 || size != 4) return 3;
  int mode = 0;
  std::memcpy(&mode, data, 4);
  device->is_registered = mode == 1;
  return 0;
}
FAKE_EXPORT int oniDeviceCreateStream(Device* device, int sensor, Stream** stream) {
  if (sensor == 3)
    *stream = new Stream{device, sensor, depth_modes()[0], true, false, false};
  else
    *stream = new Stream{device, sensor, {200, 8, 6, 30}, true, false, false};
  ++live_objects;
  return 0;
}
FAKE_EXPORT void oniStreamDestroy(Stream* stream) {
  delete stream;
  --live_objects;
}
FAKE_EXPORT int oniStreamStart(Stream* stream) {
  stream->is_running = true;
  return 0;
}
FAKE_EXPORT void oniStreamStop(Stream* stream) { stream->is_running = false; }
FAKE_EXPORT int oniStreamGetProperty(Stream* stream, int property, void* data, int* size) {
  if (property == 3 && *size == static_cast<int>(sizeof(VideoMode))) {
    std::memcpy(data, &stream->mode, sizeof(VideoMode));
    return 0;
  }
  if ((property == 1 || property == 2) && *size == 4 && !world().has("no_view")) {
    const double half = property == 1 ? 0.5 * world().width() : 0.5 * world().height();
    const auto angle = static_cast<float>(2.0 * std::atan(half / world().focal()));
    std::memcpy(data, &angle, 4);
    return 0;
  }
  return 3;
}
FAKE_EXPORT int oniStreamSetProperty(Stream* stream, int property, const void* data, int size) {
  if (stream->is_running) return 5;
  if (property == 7 && size == 4) {
    int on = 0;
    std::memcpy(&on, data, 4);
    stream->is_mirrored = on != 0;
    return 0;
  }
  if (property != 3 || size != static_cast<int>(sizeof(VideoMode))) return 3;
  std::memcpy(&stream->mode, data, sizeof(VideoMode));
  return 0;
}
FAKE_EXPORT int oniWaitForAnyStream(Stream** streams, int count, int* index, int milliseconds) {
  for (int i = 0; i < count; ++i) {
    if (streams[i]->is_ready) {
      *index = i;
      return 0;
    }
  }
  if (!world().wait(1e-3 * milliseconds) || is_gone(streams[0])) return 102;
  for (int i = 0; i < count; ++i) streams[i]->is_ready = streams[i]->is_running;
  *index = count - 1;  // colour comes first
  return 0;
}
FAKE_EXPORT int oniStreamReadFrame(Stream* stream, Frame** given) {
  stream->is_ready = false;
  auto* frame = new Frame{};
  ++live_objects;
  const bool is_depth = stream->sensor == 3;
  const VideoMode& mode = stream->mode;
  frame->sensor = stream->sensor;
  frame->stamp = static_cast<std::uint64_t>(33'333 * world().frames());
  frame->width = mode.width;
  frame->height = mode.height;
  frame->mode = mode;
  frame->stride = (is_depth ? 2 : 3) * mode.width + (is_depth ? 16 : 0);
  frame->size = frame->stride * mode.height;
  auto* bytes = new unsigned char[static_cast<std::size_t>(frame->size)]();
  frame->data = bytes;
  const double units = mode.format == 101 ? 1e4 : 1e3;
  for (int v = 0; is_depth && v < mode.height; ++v) {
    for (int u = 0; u < mode.width; ++u) {
      const int from = stream->is_mirrored ? mode.width - 1 - u : u;
      const auto raw = static_cast<std::uint16_t>(std::lround(units * world().depth(from, v)));
      std::memcpy(bytes + v * frame->stride + 2 * u, &raw, 2);
    }
  }
  for (int i = 0; !is_depth && i < frame->size; i += 3) bytes[i] = 200;
  if (world().has("short_frames")) frame->size /= 2;
  *given = frame;
  return 0;
}
FAKE_EXPORT void oniFrameRelease(Frame* frame) {
  delete[] static_cast<unsigned char*>(frame->data);
  delete frame;
  --live_objects;
}
