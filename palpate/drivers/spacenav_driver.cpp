// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <string>

#include <poll.h>

#include "palpate/drivers/drivers.hpp"
#include "palpate/drivers/rate_hand.hpp"
#include "palpate/drivers/shared_library.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace spacenav {
namespace {

constexpr double full = 350.0;      // of an axis
constexpr int wait_ms = 20;         // [ms]
constexpr int waits_of_retry = 12;  // before the daemon is asked for anew
constexpr int motion = 1;           // types of events
constexpr int button = 2;

// As spnav.h has it.
union Event {
  int type;
  struct {
    int type, x, y, z, rx, ry, rz;
    unsigned period;
    int* data;
  } motion;
  struct {
    int type, press, number;
  } button;
  char room[256];  // for events of later versions
};

struct Library {
  SharedLibrary library{{.name = "spacenav: (libspnav)",
                         .files = {"libspnav.so.0", "libspnav.so.1", "libspnav.so"},
                         .variable = "PALPATE_SPNAV",
                         .remedy = "install it: apt install libspnav0 spacenavd"}};
  int (*open)() = library.find("spnav_open");
  int (*close)() = library.find("spnav_close");
  int (*fd)() = library.find("spnav_fd");
  int (*poll_event)(Event* event) = library.find("spnav_poll_event");
};

class Puck final : public Sticks {
 public:
  explicit Puck(const std::string& uri) {
    if (library_.open() < 0)
      throw Error(uri, "its daemon spacenavd does not answer",
                  "start it: systemctl start spacenavd");
  }
  ~Puck() override {
    if (state_.plugged_in) library_.close();
  }

  StickState wait() noexcept override {
    pollfd descriptor{.fd = state_.plugged_in ? library_.fd() : -1, .events = POLLIN, .revents = 0};
    const int ready = poll(&descriptor, 1, wait_ms);
    if (!state_.plugged_in) {
      if (++waits_ % waits_of_retry == 0) state_.plugged_in = library_.open() >= 0;
      return state_;
    }
    if (ready <= 0) return state_;
    int events = 0;
    for (Event event{}; library_.poll_event(&event) != 0; ++events) take(event);
    if (events == 0) {  // what can be read is the end
      library_.close();
      state_ = {.plugged_in = false};
    }
    return state_;
  }

 private:
  void take(const Event& event) {
    if (event.type == motion) {
      // x to the right, y up, z away from the user
      const Vec3 axes(event.motion.x, event.motion.z, event.motion.y);
      state_.deflection = (axes / full).cwiseMax(-1.0).cwiseMin(1.0);
    } else if (event.type == button && event.button.number >= 0 && event.button.number < 32) {
      const std::uint32_t bit = 1U << static_cast<unsigned>(event.button.number);
      state_.buttons = event.button.press != 0 ? state_.buttons | bit : state_.buttons & ~bit;
    }
  }

  Library library_;
  StickState state_;
  int waits_ = 0;
};

std::unique_ptr<Device> open_puck(const Uri& uri) {
  const RateOptions options = rate_options(uri);
  if (!uri.path().empty())
    throw Error(uri.text(), "spacenav: has no '" + uri.path() + "'", "write spacenav: alone");
  DeviceInfo info{.uri = uri.text(), .kind = "SpaceMouse by libspnav", .limits = no_motors};
  return std::make_unique<RateHand>(std::make_unique<Puck>(uri.text()), info, options);
}

DriverReport look() {
  const Library library;
  DriverReport report{.library = library.library.path()};
  if (library.open() < 0) {
    report.problem =
        "spacenav: its daemon spacenavd does not answer; start it: systemctl start spacenavd";
    return report;
  }
  report.found.push_back({.uri = "spacenav:", .name = "what spacenavd serves"});
  library.close();
  return report;
}

}  // namespace
}  // namespace spacenav

Driver spacenav_driver() {
  return {.name = "spacenav",
          .summary = "a SpaceMouse by spacenavd: moves the hand, gives no force",
          .tried = "a mock library only",
          .usb = {"256f", "046d:c62"},
          .open_device = spacenav::open_puck,
          .look = reporting(spacenav::look)};
}

}  // namespace palpate
