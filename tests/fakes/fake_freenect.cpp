// SPDX-License-Identifier: Apache-2.0
// libfreenect 0.5 as its headers describe it: frames come in a callback while events are processed,
// modes and calibration are passed by value, and a Kinect that is gone makes processing fail.
#include <array>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include <sys/time.h>

#include "tests/fakes/fake_camera.hpp"

namespace {

int live_objects = 0;  // made and not given back

FakeCamera& world() { return FakeCamera::instance(); }

}  // namespace

struct Context {
  struct Kinect* running;
};
struct Attributes {
  Attributes* next;
  const char* serial;
};
struct Mode {
  std::uint32_t reserved;
  int resolution, format;
  std::int32_t bytes;
  std::int16_t width, height;
  std::int8_t bits, padding, rate, is_valid;
};
struct Registration {
  std::array<std::int32_t, 29> polynomials;
  std::array<std::uint16_t, 3> padding;
  float emitter_distance, colour_distance, reference_distance, reference_pixel_size;
  double const_shift;
  void *raw_to_mm, *depth_to_rgb, *table;
};
struct Kinect {
  Context* context;
  Mode mode;
  void (*callback)(Kinect*, void*, std::uint32_t);
  int generation;
};

FAKE_EXPORT int fake_live_objects() { return live_objects; }

FAKE_EXPORT int freenect_init(Context** context, void* /*usb*/) {
  world().begin();
  *context = new Context{};
  ++live_objects;
  return 0;
}
FAKE_EXPORT int freenect_shutdown(Context* context) {
  delete context;
  --live_objects;
  return 0;
}
FAKE_EXPORT void freenect_set_log_level(Context* /*context*/, int /*level*/) {}
FAKE_EXPORT void freenect_select_subdevices(Context* /*context*/, int /*parts*/) {}
FAKE_EXPORT int freenect_list_device_attributes(Context* /*context*/, Attributes** list) {
  static const std::array<const char*, 2> serials{"A00361", "A00362"};
  world().look();
  *list = nullptr;
  const int count = std::min(world().cameras(), 2);
  for (int i = count - 1; i >= 0; --i) {
    *list = new Attributes{*list, serials.at(static_cast<std::size_t>(i))};
    ++live_objects;
  }
  return count;
}
FAKE_EXPORT void freenect_free_device_attributes(Attributes* list) {
  while (list != nullptr) {
    delete std::exchange(list, list->next);
    --live_objects;
  }
}
FAKE_EXPORT int freenect_num_devices(Context* /*context*/) { return world().cameras(); }
FAKE_EXPORT int freenect_open_device(Context* context, Kinect** kinect, int /*index*/) {
  if (world().has("denied") || world().is_gone()) return -1;
  *kinect = new Kinect{context, {}, nullptr, world().generation()};
  ++live_objects;
  return 0;
}
FAKE_EXPORT int freenect_open_device_by_camera_serial(Context* context, Kinect** kinect,
                                                      const char* /*serial*/) {
  return freenect_open_device(context, kinect, 0);
}
FAKE_EXPORT int freenect_close_device(Kinect* kinect) {
  delete kinect;
  --live_objects;
  return 0;
}
FAKE_EXPORT Mode freenect_find_depth_mode(int resolution, int format) {
  const int width = world().width();
  const int height = world().height();
  const bool is_known = !(format == 5 && world().has("no_mm"));
  return {0,
          resolution,
          format,
          2 * width * height,
          static_cast<std::int16_t>(width),
          static_cast<std::int16_t>(height),
          11,
          5,
          30,
          static_cast<std::int8_t>(is_known)};
}
FAKE_EXPORT int freenect_set_depth_mode(Kinect* kinect, Mode mode) {
  kinect->mode = mode;
  return mode.is_valid != 0 ? 0 : -1;
}
FAKE_EXPORT void freenect_set_depth_callback(Kinect* kinect,
                                             void (*callback)(Kinect*, void*, std::uint32_t)) {
  kinect->callback = callback;
}
FAKE_EXPORT int freenect_start_depth(Kinect* kinect) {
  kinect->context->running = kinect;
  return 0;
}
FAKE_EXPORT int freenect_stop_depth(Kinect* kinect) {
  kinect->context->running = nullptr;
  return 0;
}
FAKE_EXPORT int freenect_process_events_timeout(Context* context, timeval* timeout) {
  const double seconds =
      static_cast<double>(timeout->tv_sec) + 1e-6 * static_cast<double>(timeout->tv_usec);
  Kinect* kinect = context->running;
  const bool has_frame = world().wait(seconds);
  if (kinect == nullptr || world().is_gone() || kinect->generation != world().generation())
    return -4;  // LIBUSB_ERROR_NO_DEVICE
  if (!has_frame) return 0;
  std::vector<std::uint16_t> depth;
  for (int v = 0; v < kinect->mode.height; ++v) {
    for (int u = 0; u < kinect->mode.width; ++u) {
      const double metres = world().depth(u, v);
      if (kinect->mode.format != 0)
        depth.push_back(static_cast<std::uint16_t>(std::lround(1e3 * metres)));
      else  // the step nearest to it; 2047 is none
        depth.push_back(metres == 0.0 ? std::uint16_t{2047}
                                      : static_cast<std::uint16_t>(std::lround(
                                            2842.5 * (std::atan(metres / 0.1236) - 1.1863))));
    }
  }
  kinect->callback(kinect, depth.data(), static_cast<std::uint32_t>(2'000'000 * world().frames()));
  return 0;
}
FAKE_EXPORT Registration freenect_copy_registration(Kinect* /*kinect*/) {
  Registration registration{};
  registration.reference_distance = world().has("uncalibrated") ? 0.0F : 120.0F;
  registration.reference_pixel_size = 0.1042F;
  registration.table = new int;
  ++live_objects;
  return registration;
}
FAKE_EXPORT int freenect_destroy_registration(Registration* registration) {
  delete static_cast<int*>(registration->table);
  --live_objects;
  return 0;
}
