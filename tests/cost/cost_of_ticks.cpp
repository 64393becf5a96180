// SPDX-License-Identifier: Apache-2.0
// Runs a number of ticks of a fixed slide, for others to count what they execute.
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "palpate/kernel/paper/paper.hpp"

#include "bench/subject.hpp"

int main(int argc, char** argv) {
  const int ticks = argc > 1 ? std::atoi(argv[1]) : 0;
  const palpate::bench::Subject subject = palpate::bench::noisy_plane(160, 120, 525.0, 1.0);
  palpate::Paper paper;
  paper.observe({*subject.frames.front(), 0.0});
  paper.seat(subject.surface - 0.03 * subject.into);
  long steps = 0;
  for (int i = 0; i < ticks; ++i) {
    const double t = 1e-3 * i;
    if (i % 33 == 32) paper.observe({*subject.frames[static_cast<std::size_t>(i / 33 % 2)], t});
    const double along = 0.01 * std::abs(std::fmod(10.0 * t, 2.0) - 1.0);
    steps += paper.tick(subject.surface + 0.005 * subject.into + along * subject.along, t).steps;
  }
  std::printf("%ld\n", steps);
}
