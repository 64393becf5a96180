// SPDX-License-Identifier: Apache-2.0
// The kernel's calls for one video node, put before the C library's by LD_PRELOAD: /dev/video77
// gives depth as Z16, /dev/video78 pictures as YUYV, /dev/video79 may not be opened. All other
// files are the system's. Its traps: rows are padded, a driver changes what it cannot do and says
// so only in its answer, now and then a frame is marked as damaged.
#include <cerrno>
#include <cstdarg>
#include <cstring>
#include <string>
#include <vector>

#include <dlfcn.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <unistd.h>

#include "tests/fakes/fake_camera.hpp"

namespace {

constexpr std::size_t buffers = 4;

struct Node {
  int file = -1;
  bool is_depth = true, is_running = false;
  int generation = 0;
  std::vector<std::vector<unsigned char>> memory{buffers};
  std::vector<unsigned> queued;
  bool is_filled = false;
};
Node node;

FakeCamera& world() { return FakeCamera::instance(); }

template <class Function>
Function* real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

int refuse(int error) {
  errno = error;
  return -1;
}

int stride() { return 2 * world().width() + 16; }

bool is_gone() { return world().is_gone() || node.generation != world().generation(); }

void fill(unsigned index) {
  auto& bytes = node.memory.at(index);
  const int width = world().width();
  const int height = world().height();
  const int row = stride();
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const auto raw = static_cast<std::uint16_t>(std::lround(1e3 * world().depth(u, v)));
      std::memcpy(&bytes.at(static_cast<std::size_t>(v * row + 2 * u)), &raw, 2);
    }
  }
}

int control(unsigned long request, void* argument) {
  if (is_gone()) return refuse(ENODEV);
  switch (request) {
    case VIDIOC_QUERYCAP: {
      auto* about = static_cast<v4l2_capability*>(argument);
      std::strcpy(reinterpret_cast<char*>(about->card), "Fake Depth Camera");
      about->capabilities = V4L2_CAP_DEVICE_CAPS | V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
      about->device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
      return 0;
    }
    case VIDIOC_ENUM_FMT: {
      auto* format = static_cast<v4l2_fmtdesc*>(argument);
      if (format->index > 0) return refuse(EINVAL);
      format->pixelformat = node.is_depth ? V4L2_PIX_FMT_Z16 : V4L2_PIX_FMT_YUYV;
      return 0;
    }
    case VIDIOC_S_FMT: {
      auto& format = static_cast<v4l2_format*>(argument)->fmt.pix;
      format.width = static_cast<unsigned>(world().width());
      format.height = static_cast<unsigned>(world().height());
      format.pixelformat = node.is_depth ? V4L2_PIX_FMT_Z16 : V4L2_PIX_FMT_YUYV;
      format.bytesperline = static_cast<unsigned>(stride());
      return 0;
    }
    case VIDIOC_S_PARM:
      static_cast<v4l2_streamparm*>(argument)->parm.capture.timeperframe = {1, 30};
      return 0;
    case VIDIOC_REQBUFS:
      static_cast<v4l2_requestbuffers*>(argument)->count = buffers;
      return 0;
    case VIDIOC_QUERYBUF: {
      auto* buffer = static_cast<v4l2_buffer*>(argument);
      buffer->length = static_cast<unsigned>(stride() * world().height());
      buffer->m.offset = buffer->index * 4096;
      node.memory.at(buffer->index).assign(buffer->length, 0xee);
      return 0;
    }
    case VIDIOC_QBUF:
      node.queued.push_back(static_cast<v4l2_buffer*>(argument)->index);
      return 0;
    case VIDIOC_DQBUF: {
      auto* buffer = static_cast<v4l2_buffer*>(argument);
      if (!node.is_filled || node.queued.empty()) return refuse(EAGAIN);
      node.is_filled = false;
      buffer->index = node.queued.front();
      node.queued.erase(node.queued.begin());
      fill(buffer->index);
      buffer->bytesused = static_cast<unsigned>(stride() * world().height());
      buffer->flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
      if (world().frames() % 10 == 5) {  // half of it was lost on the cable
        buffer->flags |= V4L2_BUF_FLAG_ERROR;
        buffer->bytesused /= 2;
      }
      const double stamp =
          std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
              .count() -
          0.01;
      buffer->timestamp.tv_sec = static_cast<time_t>(stamp);
      buffer->timestamp.tv_usec = static_cast<suseconds_t>(1e6 * (stamp - std::floor(stamp)));
      return 0;
    }
    case VIDIOC_STREAMON:
      node.is_running = true;
      return 0;
    case VIDIOC_STREAMOFF:
      node.is_running = false;
      return 0;
    default:
      return refuse(ENOTTY);
  }
}

int open_file(const char* path, int flags, mode_t mode) {
  const std::string name = path;
  if (name == "/dev/video79") return refuse(EACCES);
  if (name != "/dev/video77" && name != "/dev/video78")
    return real<int(const char*, int, ...)>("open")(path, flags, mode);
  world().look();
  if (world().is_gone()) return refuse(ENOENT);
  if (world().has("busy")) return refuse(EBUSY);
  node = Node();
  node.is_depth = name == "/dev/video77";
  node.generation = world().generation();
  node.file = eventfd(0, EFD_CLOEXEC);
  return node.file;
}

mode_t mode_of(int flags, va_list arguments) {
  return (flags & O_CREAT) != 0 ? va_arg(arguments, mode_t) : 0;
}

}  // namespace

FAKE_EXPORT int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  return open_file(path, flags, mode);
}
FAKE_EXPORT int open64(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  return open_file(path, flags, mode);
}
FAKE_EXPORT int close(int file) {
  if (file >= 0 && file == node.file) node.file = -1;
  return real<int(int)>("close")(file);
}
FAKE_EXPORT int ioctl(int file, unsigned long request, ...) {
  va_list arguments;
  va_start(arguments, request);
  void* argument = va_arg(arguments, void*);
  va_end(arguments);
  if (file >= 0 && file == node.file) return control(request, argument);
  return real<int(int, unsigned long, ...)>("ioctl")(file, request, argument);
}
FAKE_EXPORT void* mmap(void* address, std::size_t size, int protection, int flags, int file,
                       off_t offset) {
  if (file >= 0 && file == node.file)
    return node.memory.at(static_cast<std::size_t>(offset) / 4096).data();
  return real<void*(void*, std::size_t, int, int, int, off_t)>("mmap")(address, size, protection,
                                                                       flags, file, offset);
}
FAKE_EXPORT int munmap(void* address, std::size_t size) {
  for (const auto& memory : node.memory) {
    if (!memory.empty() && address == memory.data()) return 0;
  }
  return real<int(void*, std::size_t)>("munmap")(address, size);
}
// The C library's header says that poll only writes what it is given.
#pragma GCC diagnostic push
#ifndef __clang__
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif
FAKE_EXPORT int poll(pollfd* files, nfds_t count, int milliseconds) {
  if (count != 1 || files->fd != node.file || node.file < 0)
    return real<int(pollfd*, nfds_t, int)>("poll")(files, count, milliseconds);
  if (!node.is_filled) node.is_filled = world().wait(1e-3 * milliseconds);
  files->revents = 0;
  if (is_gone()) {
    files->revents = POLLERR | POLLHUP;
    return 1;
  }
  if (!node.is_filled) return 0;
  files->revents = POLLIN;
  return 1;
}
#pragma GCC diagnostic pop
