// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "palpate/kernel/core/parameters.hpp"

#include "bench/subject.hpp"

namespace palpate::bench {

/// How long something took, over many times [us].
struct Distribution {
  double median = 0.0, p99 = 0.0, p999 = 0.0, max = 0.0;
  std::size_t samples = 0;  ///< each the mean of `batch` calls
  std::size_t batch = 1;
};

/// The processor time of the calling thread [us]. Others' work does not count, but their wear on
/// caches does.
double thread_time();

/// How a hand moves while ticks are measured.
struct Hand {
  double depth = 0.005;       ///< [m] beyond the surface; negative: above it, in free motion
  double speed = 0.1;         ///< [m/s] back and forth along the surface
  double amplitude = 0.02;    ///< [m]
  double frame_rate = 30.0;   ///< [Hz] of frames
  double tick_rate = 1000.0;  ///< [Hz] of ticks
};

/// The library's method that is measured.
struct MethodChoice {
  std::string name = "sight";
  Parameters parameters{};
};

/// What the kernel costs on a subject.
struct KernelCosts {
  double points = 0.0;            ///< in the patch, mean over ticks
  double steps = 0.0;             ///< per tick
  double gathers = 0.0;           ///< per tick
  Distribution tick;              ///< all that a cycle of haptic rendering does
  Distribution tick_after_frame;  ///< those ticks that had a new frame to gather from
  Distribution frame;             ///< handing a frame over
  Distribution step;              ///< one step from contact at rest, and the look around after it
  Distribution gather;            ///< of the points about the proxy at rest
};

/// Runs the hand over the subject for about `budget` seconds a figure.
KernelCosts kernel_costs(const Subject& subject, const MethodChoice& method, const Hand& hand,
                         double budget);

/// One way to find the points near a place.
struct SearchCosts {
  std::string name;
  std::optional<Distribution> build;  ///< once a frame; none if there is nothing to build
  Distribution query;
  std::size_t found = 0;
};

/// The same ball searched in the subject's first frame by every method there is, ours first.
std::vector<SearchCosts> search_costs(const Subject& subject, const Parameters& parameters,
                                      double budget);

}  // namespace palpate::bench
