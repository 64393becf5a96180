// SPDX-License-Identifier: Apache-2.0
// Runs a number of ticks of a fixed slide, for others to count what they execute:
// `cost_of_ticks TICKS [METHOD [VECTOR_SET [TICKS_A_FRAME]]]`; an empty VECTOR_SET is the widest.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "palpate/kernel/core/vectorise.hpp"
#include "palpate/kernel/methods/methods.hpp"

#include "bench/subject.hpp"

int main(int argc, char** argv) {
  const int ticks = argc > 1 ? std::atoi(argv[1]) : 0;
  if (argc > 3 && *argv[3] != 0) palpate::use_vector_set(argv[3]);
  const int frame = argc > 4 ? std::max(std::atoi(argv[4]), 1) : 33;
  const palpate::bench::Subject subject = palpate::bench::noisy_plane(160, 120, 525.0, 1.0);
  const auto method = palpate::make_method(argc > 2 ? argv[2] : "paper");
  method->observe({*subject.frames.front(), 0.0});
  method->seat(subject.surface - 0.03 * subject.into);
  long steps = 0;
  for (int i = 0; i < ticks; ++i) {
    const double t = 1e-3 * i;
    if (i % frame == frame - 1)
      method->observe({*subject.frames[static_cast<std::size_t>(i / frame % 2)], t});
    const double along = 0.01 * std::abs(std::fmod(10.0 * t, 2.0) - 1.0);
    steps += method->tick(subject.surface + 0.005 * subject.into + along * subject.along, t).steps;
  }
  std::printf("%ld\n", steps);
}
