// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "palpate/drivers/drivers.hpp"
#include "palpate/drivers/live_camera.hpp"
#include "palpate/io/sources/depth_png.hpp"
#include "palpate/io/sources/intrinsics_file.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate::v4l2 {
namespace {

constexpr std::uint32_t wanted_buffers = 4;
constexpr int most_nodes = 64;

std::string reason() { return std::generic_category().message(errno); }

std::string remedy() {
  if (errno == EACCES || errno == EPERM)
    return "add yourself to the group video: usermod -aG video USER";
  if (errno == EBUSY) return "end the other program that uses it";
  return "check that it is plugged in and which /dev/video it is; palpate doctor lists those of "
         "depth";
}

class Node {
 public:
  explicit Node(const std::string& path)
      : file_(::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NONBLOCK)) {}
  ~Node() {
    if (file_ >= 0) ::close(file_);
  }
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;

  [[nodiscard]] bool is_open() const { return file_ >= 0; }
  [[nodiscard]] int file() const { return file_; }
  template <class Argument>
  [[nodiscard]] bool control(unsigned long request, Argument& argument) const {
    int status = 0;
    do {
      status = ::ioctl(file_, request, &argument);
    } while (status < 0 && errno == EINTR);
    return status >= 0;
  }
  [[nodiscard]] bool captures() const {
    v4l2_capability about{};
    if (!control(VIDIOC_QUERYCAP, about)) return false;
    const std::uint32_t can =
        (about.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? about.device_caps : about.capabilities;
    return (can & V4L2_CAP_VIDEO_CAPTURE) != 0 && (can & V4L2_CAP_STREAMING) != 0;
  }
  [[nodiscard]] std::string name() const {
    v4l2_capability about{};
    if (!control(VIDIOC_QUERYCAP, about)) return {};
    const char* text = reinterpret_cast<const char*>(about.card);
    return {text, strnlen(text, sizeof about.card)};
  }
  [[nodiscard]] bool gives_depth() const {
    v4l2_fmtdesc format{};
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    for (; control(VIDIOC_ENUM_FMT, format); ++format.index) {
      if (format.pixelformat == V4L2_PIX_FMT_Z16) return true;
    }
    return false;
  }

 private:
  int file_;
};

DriverReport look() {
  DriverReport report{.library = "the kernel's own"};
  for (int i = 0; i < most_nodes; ++i) {
    const std::string path = "/dev/video" + std::to_string(i);
    const Node node(path);
    if (!node.is_open()) {
      if (errno == EACCES)
        report.found.push_back({.uri = "v4l2:" + path, .name = "", .note = remedy()});
      continue;
    }
    if (node.captures() && node.gives_depth())
      report.found.push_back({.uri = "v4l2:" + path, .name = node.name()});
  }
  return report;
}

// One of the kernel's buffers, seen from here.
struct Unmap {
  std::size_t size;
  void operator()(void* data) const noexcept { ::munmap(data, size); }
};
using Mapping = std::unique_ptr<void, Unmap>;

class Camera final : public LiveCamera {
 public:
  explicit Camera(const Uri& uri)
      : LiveCamera({.uri = uri.text(), .kind = "V4L2", .clock = StampClock::monotonic}),
        lens_(lens_of(uri)),
        node_(uri.path()),
        rays_(std::make_shared<const ViewingRays>(lens_.intrinsics)) {
    if (!node_.is_open()) fail("it cannot be opened");
    if (!node_.captures())
      throw Error(info_.uri, "it is not a video capture device", "palpate doctor lists those");
    info_.kind = node_.name();
    info_.sensor = lens_.sensor;
    choose_format();
    if (uri.has("fps")) choose_rate(uri.number_option("fps", 30.0, 1.0, 1000.0, "Hz"));
    map_buffers();
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (!node_.control(VIDIOC_STREAMON, type)) fail("it does not start");
  }
  ~Camera() override {
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    static_cast<void>(node_.control(VIDIOC_STREAMOFF, type));
  }

 private:
  static RecordedCamera lens_of(const Uri& uri) {
    uri.allow_only(std::to_array<std::string_view>({"intrinsics", "fps"}));
    if (uri.path().empty())
      throw Error(uri.text(), "no video node is named",
                  "name one as v4l2:/dev/video2; palpate doctor lists those of depth");
    if (!uri.has("intrinsics"))
      throw Error(uri.text(), "V4L2 tells neither lens nor unit of depth",
                  "give ?intrinsics=FILE.json; docs/sources.md describes it");
    return read_intrinsics(uri.text_option("intrinsics", ""));
  }
  [[noreturn]] void fail(const std::string& what) const {
    throw Error(info_.uri, what + ": " + reason(), remedy());
  }

  void choose_format() {
    v4l2_format format{};
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    auto& wanted = format.fmt.pix;
    const Intrinsics& k = lens_.intrinsics;
    wanted.width = static_cast<std::uint32_t>(k.width);
    wanted.height = static_cast<std::uint32_t>(k.height);
    wanted.pixelformat = V4L2_PIX_FMT_Z16;
    wanted.field = V4L2_FIELD_NONE;
    if (!node_.control(VIDIOC_S_FMT, format)) fail("it takes no format");
    if (wanted.pixelformat != V4L2_PIX_FMT_Z16) {
      std::string code(4, ' ');
      for (unsigned i = 0; i < 4; ++i)
        code[i] = static_cast<char>(wanted.pixelformat >> (8 * i) & 0x7fU);
      throw Error(info_.uri, "it gives '" + code + "', not depth as Z16",
                  "name another node; palpate doctor lists those of depth");
    }
    check_size(k, wanted.width, wanted.height, info_.uri,
               "give the intrinsics of a size that it has; v4l2-ctl --list-formats-ext");
    stride_ = std::max<std::size_t>(wanted.bytesperline, 2 * std::size_t{wanted.width});
    needed_ = stride_ * (wanted.height - 1) + 2 * std::size_t{wanted.width};
  }

  void choose_rate(double rate) {
    v4l2_streamparm parameters{};
    parameters.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    parameters.parm.capture.timeperframe = {
        .numerator = 1000, .denominator = static_cast<std::uint32_t>(std::lround(1e3 * rate))};
    if (!node_.control(VIDIOC_S_PARM, parameters)) fail("it takes no rate");
    const auto& given = parameters.parm.capture.timeperframe;
    if (given.numerator > 0)
      info_.frame_rate = static_cast<double>(given.denominator) / given.numerator;
  }

  [[nodiscard]] static v4l2_buffer buffer(std::uint32_t index) {
    v4l2_buffer buffer{};
    buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = index;
    return buffer;
  }

  void map_buffers() {
    v4l2_requestbuffers request{};
    request.count = wanted_buffers;
    request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    request.memory = V4L2_MEMORY_MMAP;
    if (!node_.control(VIDIOC_REQBUFS, request) || request.count == 0) fail("it has no buffers");
    for (std::uint32_t i = 0; i < request.count; ++i) {
      v4l2_buffer each = buffer(i);
      if (!node_.control(VIDIOC_QUERYBUF, each)) fail("it does not show its buffers");
      void* const data = ::mmap(nullptr, each.length, PROT_READ, MAP_SHARED, node_.file(),
                                static_cast<off_t>(each.m.offset));
      if (data == MAP_FAILED) fail("its buffers cannot be mapped");
      mappings_.emplace_back(data, Unmap{each.length});
      if (each.length < needed_)
        throw Error(info_.uri, "its buffers are smaller than its images", "update its driver");
      if (!node_.control(VIDIOC_QBUF, each)) fail("it does not take its buffers");
    }
  }

  std::optional<Frame> wait(double seconds) override {
    pollfd ready{.fd = node_.file(), .events = POLLIN, .revents = 0};
    const int status = ::poll(&ready, 1, static_cast<int>(std::lround(1e3 * seconds)));
    if (status == 0 || (status < 0 && errno == EINTR)) return std::nullopt;
    v4l2_buffer filled = buffer(0);
    if (!node_.control(VIDIOC_DQBUF, filled)) {
      if (errno == EAGAIN && (ready.revents & (POLLERR | POLLHUP)) == 0) return std::nullopt;
      throw Error(info_.uri, "it gives no frame: " + reason(),
                  errno == ENODEV ? "plug it in again" : remedy());
    }
    std::optional<Frame> frame;
    // Damaged ones are left out: the kernel marks what was lost on the cable.
    if (filled.index < mappings_.size() && (filled.flags & V4L2_BUF_FLAG_ERROR) == 0 &&
        filled.bytesused >= needed_)
      frame = frame_of(filled);
    if (!node_.control(VIDIOC_QBUF, filled)) fail("it does not take its buffers");
    return frame;
  }

  Frame frame_of(const v4l2_buffer& filled) {
    const Intrinsics& k = lens_.intrinsics;
    std::vector<std::uint16_t> depth =
        depth_rows(mappings_[filled.index].get(), k.width, k.height, stride_, info_.uri);
    for (std::uint16_t& raw : depth) {
      if (raw == lens_.invalid_value || raw == lens_.saturated_value) raw = 0;
    }
    Frame frame;
    frame.cloud = std::make_shared<DepthImage>(rays_, std::move(depth), lens_.units_per_metre);
    frame.stamp = static_cast<double>(filled.timestamp.tv_sec) +
                  1e-6 * static_cast<double>(filled.timestamp.tv_usec);
    // Another clock's would lie far from it; CameraFeed then uses the arrival and says so.
    return frame;
  }

  const RecordedCamera lens_;
  const Node node_;
  std::shared_ptr<const ViewingRays> rays_;
  std::vector<Mapping> mappings_;
  std::size_t stride_ = 0, needed_ = 0;  // [bytes] of a row, of an image
};

}  // namespace
}  // namespace palpate::v4l2

namespace palpate {

/// docs/cameras.md describes it. Stamps are the kernel's, as all drivers of cameras in it have
/// them: when a frame's first or last bytes arrived.
Driver v4l2_driver() {
  return {.name = "v4l2",
          .summary = "v4l2:/dev/videoN?intrinsics=FILE.json, depth as Z16 by the kernel",
          .tried = "only mocked kernel calls",
          .usb = {},
          .open_camera = opened<v4l2::Camera>,
          .look = reporting(v4l2::look)};
}

}  // namespace palpate
