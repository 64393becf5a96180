// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

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

/// What reading that clock costs [us]: the median of many.
double clock_cost();

/// Calls `operation` over and over for about `budget` seconds of thread time, at least five times
/// `batch`. Its times are means over `batch` calls, less the clock's own cost: take a batch for
/// what is shorter than that.
Distribution measure(double budget, std::size_t batch, const std::function<void()>& operation);

/// What the samples [us] say; `batch` is passed on.
Distribution distribution(std::vector<double> samples, std::size_t batch);

}  // namespace palpate::bench
