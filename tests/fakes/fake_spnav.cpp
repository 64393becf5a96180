// SPDX-License-Identifier: Apache-2.0
// libspnav with a SpaceMouse that is pushed down and away by turns, 60 events a second. x to the
// right, y up, z away from the user.
#include <cmath>
#include <cstdint>
#include <cstring>

#include <poll.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include "tests/fakes/workbench.hpp"

namespace {

using palpate::test::clock_now;
using palpate::test::find_workbench;
using palpate::test::workbench;

int timer = -1;

struct Motion {
  int type, x, y, z, rx, ry, rz;
  unsigned period;
  int* data;
};

}  // namespace

#define EXPORT extern "C" __attribute__((visibility("default")))

EXPORT int spnav_open() {
  find_workbench();
  if (!workbench().plugged_in) return -1;
  timer = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
  const itimerspec every{{0, 16'000'000}, {0, 16'000'000}};
  timerfd_settime(timer, 0, &every, nullptr);
  ++workbench().opens;
  return 0;
}
EXPORT int spnav_close() {
  close(timer);
  timer = -1;
  ++workbench().closes;
  return 0;
}
EXPORT int spnav_fd() { return timer; }
EXPORT int spnav_poll_event(void* event) {
  std::uint64_t times = 0;
  if (!workbench().plugged_in || read(timer, &times, sizeof times) < 0) return 0;
  if (workbench().began == 0.0) workbench().began = clock_now();
  const double t = clock_now() - workbench().began;
  // A second down and half a second up.
  const int up = std::fmod(t, 1.5) < 1.0 ? -350 : 350;
  const Motion motion{1, 0, up, 0, 0, 0, 0, 16, nullptr};
  std::memcpy(event, &motion, sizeof motion);
  return 1;
}
