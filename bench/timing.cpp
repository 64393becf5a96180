// SPDX-License-Identifier: Apache-2.0
#include "bench/timing.hpp"

#include <algorithm>
#include <ctime>

namespace palpate::bench {

double thread_time() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e6 + static_cast<double>(now.tv_nsec) * 1e-3;
}

double clock_cost() {
  static const double cost = [] {
    std::vector<double> costs(2001);
    for (double& each : costs) {
      const double begin = thread_time();
      each = thread_time() - begin;
    }
    return distribution(costs, 1).median;
  }();
  return cost;
}

Distribution distribution(std::vector<double> samples, std::size_t batch) {
  if (samples.empty()) return {};
  std::sort(samples.begin(), samples.end());
  const auto at = [&samples](double part) {
    return samples[static_cast<std::size_t>(part * static_cast<double>(samples.size() - 1))];
  };
  return {at(0.5), at(0.99), at(0.999), samples.back(), samples.size(), batch};
}

Distribution measure(double budget, std::size_t batch, const std::function<void()>& operation) {
  constexpr std::size_t fewest = 5;
  constexpr std::size_t most = 200000;
  const double cost = clock_cost();
  std::vector<double> samples;
  samples.reserve(most);
  const double end = thread_time() + budget * 1e6;
  while (samples.size() < most) {
    const double begin = thread_time();
    if (begin > end && samples.size() >= fewest) break;
    for (std::size_t i = 0; i < batch; ++i) operation();
    const double taken = std::max(thread_time() - begin - cost, 0.0);
    samples.push_back(taken / static_cast<double>(batch));
  }
  return distribution(std::move(samples), batch);
}

}  // namespace palpate::bench
