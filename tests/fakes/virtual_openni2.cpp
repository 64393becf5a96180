// SPDX-License-Identifier: Apache-2.0
// A camera for the stock OpenNI2 runtime, by its interface for drivers: FakeCamera's wall in
// millimetres. When it is unplugged it says so, and is back when the runtime begins anew.
#include <array>
#include <atomic>
#include <cstring>
#include <thread>

#include "tests/fakes/fake_camera.hpp"

#define XN_NEW(type, ...) new type(__VA_ARGS__)  // which the header wants to be there
#define XN_DELETE(pointer) delete (pointer)
#include <OniDriverAPI.h>

namespace {

FakeCamera& world() { return FakeCamera::instance(); }

template <class Value>
OniStatus give(const Value& value, void* data, int* size) {
  if (*size < static_cast<int>(sizeof value)) return ONI_STATUS_BAD_PARAMETER;
  std::memcpy(data, &value, sizeof value);
  *size = sizeof value;
  return ONI_STATUS_OK;
}

class Driver;

class DepthStream final : public oni::driver::StreamBase {
 public:
  explicit DepthStream(Driver& driver) : driver_(driver) {}
  ~DepthStream() override { end(); }
  OniStatus start() override {
    is_running_ = true;
    thread_ = std::thread(&DepthStream::run, this);
    return ONI_STATUS_OK;
  }
  void stop() override { end(); }

  OniBool isPropertySupported(int property) override {
    std::array<unsigned char, 64> data{};
    int size = static_cast<int>(data.size());
    return static_cast<OniBool>(getProperty(property, data.data(), &size) == ONI_STATUS_OK);
  }
  OniStatus getProperty(int property, void* data, int* size) override {
    switch (property) {
      case ONI_STREAM_PROPERTY_VIDEO_MODE:
        return give(mode(), data, size);
      case ONI_STREAM_PROPERTY_HORIZONTAL_FOV:
        return give(angle(world().width()), data, size);
      case ONI_STREAM_PROPERTY_VERTICAL_FOV:
        return give(angle(world().height()), data, size);
      case ONI_STREAM_PROPERTY_MIRRORING:
        return give(is_mirrored_, data, size);
      case ONI_STREAM_PROPERTY_CROPPING:
        return give(OniCropping{}, data, size);
      case ONI_STREAM_PROPERTY_STRIDE:
        return give(2 * world().width(), data, size);
      case ONI_STREAM_PROPERTY_MAX_VALUE:
        return give(10'000, data, size);
      default:
        return ONI_STATUS_NOT_SUPPORTED;
    }
  }
  OniStatus setProperty(int property, const void* data, int size) override {
    if (property == ONI_STREAM_PROPERTY_MIRRORING && size == sizeof is_mirrored_) {
      std::memcpy(&is_mirrored_, data, sizeof is_mirrored_);
      return ONI_STATUS_OK;
    }
    OniVideoMode wanted = mode();
    const bool is_mine = property == ONI_STREAM_PROPERTY_VIDEO_MODE && size == sizeof wanted &&
                         std::memcmp(data, &wanted, sizeof wanted) == 0;
    return is_mine ? ONI_STATUS_OK : ONI_STATUS_NOT_SUPPORTED;
  }
  // A recorder keeps what it hears here.
  void notifyAllProperties() override {
    for (int property = 0; property < 16; ++property) {
      std::array<unsigned char, 64> data{};
      int size = static_cast<int>(data.size());
      if (getProperty(property, data.data(), &size) == ONI_STATUS_OK)
        raisePropertyChanged(property, data.data(), size);
    }
  }

  static OniVideoMode mode() {
    return {ONI_PIXEL_FORMAT_DEPTH_1_MM, world().width(), world().height(),
            static_cast<int>(world().number("fps", 30))};
  }

 private:
  static float angle(int pixels) {
    return static_cast<float>(2.0 * std::atan(0.5 * pixels / world().focal()));
  }
  void end() {
    is_running_ = false;
    if (thread_.joinable()) thread_.join();
  }
  void run();

  Driver& driver_;
  std::atomic<bool> is_running_{false};
  OniBool is_mirrored_ = 1;
  std::thread thread_;
};

class Device final : public oni::driver::DeviceBase {
 public:
  explicit Device(Driver& driver) : driver_(driver) {}
  OniStatus getSensorInfoList(OniSensorInfo** sensors, int* count) override {
    mode_ = DepthStream::mode();
    sensor_ = {ONI_SENSOR_DEPTH, 1, &mode_};
    *sensors = &sensor_;
    *count = 1;
    return ONI_STATUS_OK;
  }
  oni::driver::StreamBase* createStream(OniSensorType /*sensor*/) override {
    return new DepthStream(driver_);
  }
  void destroyStream(oni::driver::StreamBase* stream) override { delete stream; }
  OniStatus getProperty(int property, void* data, int* size) override {
    if (property == ONI_DEVICE_PROPERTY_SERIAL_NUMBER) return give("VIRTUAL-1", data, size);
    return ONI_STATUS_NOT_SUPPORTED;
  }

 private:
  Driver& driver_;
  OniVideoMode mode_{};
  OniSensorInfo sensor_{};
};

class Driver final : public oni::driver::DriverBase {
 public:
  explicit Driver(OniDriverServices* services) : DriverBase(services) {
    std::strcpy(info_.uri, "virtual/1");
    std::strcpy(info_.vendor, "Tests");
    std::strcpy(info_.name, "Wall");
  }
  OniStatus initialize(oni::driver::DeviceConnectedCallback connected,
                       oni::driver::DeviceDisconnectedCallback disconnected,
                       oni::driver::DeviceStateChangedCallback changed, void* cookie) override {
    static_cast<void>(DriverBase::initialize(connected, disconnected, changed, cookie));
    world().look();
    if (world().cameras() > 0) deviceConnected(&info_);
    return ONI_STATUS_OK;
  }
  oni::driver::DeviceBase* deviceOpen(const char* /*uri*/, const char* /*mode*/) override {
    return new Device(*this);
  }
  void deviceClose(oni::driver::DeviceBase* device) override { delete device; }
  void shutdown() override {}
  void unplug() { deviceDisconnected(&info_); }

 private:
  OniDeviceInfo info_{};
};

void DepthStream::run() {
  for (int number = 1; is_running_;) {
    if (!world().wait(0.05)) {
      if (world().is_gone()) {
        driver_.unplug();
        return;
      }
      continue;
    }
    OniFrame* frame = getServices().acquireFrame();
    if (frame == nullptr) continue;
    frame->sensorType = ONI_SENSOR_DEPTH;
    frame->frameIndex = number;
    frame->timestamp = static_cast<std::uint64_t>(33'333 * number++);
    frame->videoMode = mode();
    frame->width = frame->videoMode.resolutionX;
    frame->height = frame->videoMode.resolutionY;
    frame->croppingEnabled = 0;
    frame->cropOriginX = frame->cropOriginY = 0;
    frame->stride = 2 * frame->width;
    auto* depth = static_cast<std::uint16_t*>(frame->data);
    for (int v = 0; v < frame->height; ++v) {
      for (int u = 0; u < frame->width; ++u) {
        const int from = is_mirrored_ != 0 ? frame->width - 1 - u : u;
        *depth++ = static_cast<std::uint16_t>(std::lround(1000.0 * world().depth(from, v)));
      }
    }
    raiseNewFrame(frame);
    getServices().releaseFrame(frame);
  }
}

}  // namespace

ONI_EXPORT_DRIVER(Driver)
