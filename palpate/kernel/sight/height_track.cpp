// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/sight/height_track.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "palpate/kernel/core/mathematics.hpp"

namespace palpate {
namespace {

// Units of the bank: `detail` d, and the mean interval T between heights.
// Jerk assumed by each filter of the bank [d/T^3], from a surface that a hand moves slowly to one
// that is struck.
constexpr std::array<double, 5> jerks = {0.0075, 0.045, 0.3, 1.85, 22.0};
// Change of velocity from frame to frame assumed by each of the others [d/T], from a surface that
// is drawn along to one that is dropped. Without an acceleration to believe in, they do not
// overshoot where a motion begins at once.
constexpr std::array<double, 4> velocity_steps = {0.067, 0.33, 1.67, 8.0};
constexpr std::size_t filters = jerks.size() + velocity_steps.size();
// Older frames say little about the present motion.
constexpr std::size_t motion_frames = 24;
// Logarithm of the prior odds of a step of the velocity against an acceleration: a motion that
// begins between two frames looks like a strong acceleration, which would carry the surface three
// times too far.
constexpr double plain_bonus = 8.0;
// Logarithm of the odds that the newest frame alone has to bring beside what is asked of several:
// by itself it may be a bad frame, of which a person who presses on a thing at rest meets one in a
// few minutes. A motion that begins is proved by the frame after it, or at once by one that is five
// standard deviations away instead of four.
constexpr double single_proof = 4.5;
// Standard deviations of a surface's velocity [d/T] and acceleration [d/T^2] before it is
// known.
constexpr double first_velocity = 20.0;
constexpr double first_acceleration = 2.2;
constexpr double least_height_sd = 2e-5;  // [d] less noise is not told from rounding

// Kalman filters of height, velocity and acceleration, side by side: filter i in lane i. Those of
// velocity steps have no acceleration.
struct Bank {
  using Lanes = std::array<double, filters>;
  Lanes x{}, v{}, a{};
  Lanes xx{}, xv{}, xa{}, vv{}, va{}, aa{};  // covariances
  Lanes likelihood{};                        // its logarithm
  Lanes jerk{}, velocity_step{};

  double memory;  // of the likelihood's logarithm, from frame to frame

  // @param speed  [m/s] d in each mean interval, `period` [s]
  Bank(double height, double variance, double remembered, double speed, double period) noexcept
      : memory(remembered) {
    const double acceleration = speed / period;
    x.fill(height);
    xx.fill(variance);
    vv.fill((first_velocity * speed) * (first_velocity * speed));
    for (std::size_t i = 0; i < filters; ++i) {
      const bool accelerates = i < jerks.size();
      const double first = accelerates ? first_acceleration * acceleration : 0.0;
      jerk[i] = accelerates ? jerks[i] * (acceleration / period) : 0.0;
      velocity_step[i] = accelerates ? 0.0 : velocity_steps[i - jerks.size()] * speed;
      aa[i] = first * first;
    }
  }

  void step(double dt, double height, double variance) noexcept {
    const double h = 0.5 * dt * dt;
    for (std::size_t i = 0; i < filters; ++i) {
      // Prediction: process noise is a step of the acceleration, or of the velocity, at the
      // beginning of the interval.
      const double ga = jerk[i] * dt;
      const double gv = ga * dt + velocity_step[i];
      const double gx = ga * h + velocity_step[i] * dt;
      x[i] += dt * v[i] + h * a[i];
      v[i] += dt * a[i];
      const double new_xa = xa[i] + dt * va[i] + h * aa[i];
      const double new_va = va[i] + dt * aa[i];
      const double new_xv = xv[i] + dt * (vv[i] + xa[i]) + (dt * dt + h) * va[i] + dt * h * aa[i];
      const double new_vv = vv[i] + 2.0 * dt * va[i] + dt * dt * aa[i];
      const double new_xx = xx[i] + 2.0 * dt * xv[i] + 2.0 * h * xa[i] + dt * dt * vv[i] +
                            2.0 * dt * h * va[i] + h * h * aa[i];
      xx[i] = new_xx + gx * gx;
      xv[i] = new_xv + gx * gv;
      xa[i] = new_xa + gx * ga;
      vv[i] = new_vv + gv * gv;
      va[i] = new_va + gv * ga;
      aa[i] += ga * ga;
      // Correction.
      const double expected = xx[i] + variance;
      const double inverse = 1.0 / expected;
      const double miss = height - x[i];
      const double kx = xx[i] * inverse;
      const double kv = xv[i] * inverse;
      const double ka = xa[i] * inverse;
      x[i] += kx * miss;
      v[i] += kv * miss;
      a[i] += ka * miss;
      aa[i] -= ka * xa[i];
      va[i] -= kv * xa[i];
      vv[i] -= kv * xv[i];
      xa[i] -= kx * xa[i];
      xv[i] -= kx * xv[i];
      xx[i] -= kx * xx[i];
      likelihood[i] =
          memory * likelihood[i] - 0.5 * (miss * miss * inverse + math::log(expected / variance));
    }
  }
};

// Logarithm of the likelihood of a surface that rests, with and without the newest height.
struct Rest {
  double with, without;
};

// Each height is foretold by the mean of those before.
Rest likelihood_of_rest(std::span<const HeightSample> samples, std::size_t frames, double variance,
                        double memory) noexcept {
  double sum = 0.0;
  double n = 0.0;
  double likelihood = 0.0;
  double before = 0.0;
  for (std::size_t i = samples.size(); i-- > 0;) {
    before = likelihood;
    const double height = samples[i].height - samples.front().height;
    const double weight = 1.0 / samples[i].doubt;
    if (n > 0.0 && i + 1 < frames) {
      const double miss = height - sum / n;
      const double spread = 1.0 + weight / n;
      likelihood = memory * likelihood -
                   0.5 * (weight * miss * miss / (variance * spread) + math::log(spread));
    }
    sum += weight * height;
    n += weight;
  }
  return {likelihood, before};
}

}  // namespace

double moved_since(double velocity, double elapsed, double interval) noexcept {
  if (velocity == 0.0) return 0.0;
  const double intervals = std::max(elapsed, 0.0) / interval;
  const double late = std::clamp(intervals - 1.5, 0.0, 1.0);
  return velocity * interval * (std::min(intervals, 1.5) + late - 0.5 * late * late);
}

double agreed_height(std::span<const HeightSample> samples, double sd, double confidence) noexcept {
  const std::size_t size = std::min(samples.size(), most_heights);
  const double base = samples.front().height;
  // Means over 1, 2, 4, ... and all heights.
  std::array<double, 8> means{};
  std::array<double, 8> counts{};
  std::size_t levels = 0;
  double sum = 0.0;
  double count = 0.0;
  std::size_t next = 1;
  for (std::size_t i = 0; i < size && levels < means.size(); ++i) {
    const double weight = 1.0 / samples[i].doubt;
    sum += weight * (samples[i].height - base);
    count += weight;
    if (i + 1 == next || i + 1 == size) {
      means[levels] = sum / count;
      counts[levels] = count;
      ++levels;
      next *= 2;
    }
  }
  double height = means[levels - 1];
  for (std::size_t level = levels - 1; level-- > 0;) {
    const double slack =
        confidence * sd * std::sqrt(1.0 / counts[level] - 1.0 / counts[levels - 1]);
    height = std::clamp(height, means[level] - slack, means[level] + slack);
  }
  return base + height;
}

HeightTrack track_height(std::span<const HeightSample> all, double sd, double interval,
                         const SightParameters& parameters) noexcept {
  const double confidence = parameters.confidence;
  const double detail = parameters.detail;
  const double memory = parameters.motion_memory;
  const std::span<const HeightSample> samples = all.first(std::min(all.size(), most_heights));
  const double resting = agreed_height(samples, sd, confidence);
  const std::size_t frames = std::min(samples.size(), motion_frames);
  const double whole = samples.front().stamp - samples[frames - 1].stamp;
  const double period = frames < 2 ? 0.0 : whole / static_cast<double>(frames - 1);
  if (!(period > 0.0 && interval > 0.0)) return {resting, 0.0};

  const double base = samples.front().height;
  const double variance =
      std::max(sd * sd, (least_height_sd * detail) * (least_height_sd * detail));
  Bank bank(samples[frames - 1].height - base, samples[frames - 1].doubt * variance, memory,
            detail / period, period);
  Bank::Lanes before{};  // the newest height
  for (std::size_t i = frames - 1; i-- > 0;) {
    before = bank.likelihood;
    // A stamp of another clock lies days ahead: what would be expected then is beyond the digits.
    const double dt = std::clamp(samples[i].stamp - samples[i + 1].stamp, 0.0, whole);
    bank.step(dt, samples[i].height - base, samples[i].doubt * variance);
  }
  const Rest resting_odds = likelihood_of_rest(samples, frames, variance, memory);
  for (std::size_t i = 0; i < jerks.size(); ++i) {
    bank.likelihood[i] -= plain_bonus;
    before[i] -= plain_bonus;
  }
  const double odds = parameters.rest_odds;
  double rest = odds + resting_odds.with;
  if (odds + resting_odds.without > *std::max_element(before.begin(), before.end()))
    rest += single_proof;
  double most = rest;
  for (const double l : bank.likelihood) most = std::max(most, l);
  const double rest_share = math::exp(rest - most);
  double shares = rest_share;
  double height = rest_share * (resting - base);
  double next = height;
  for (std::size_t i = 0; i < filters; ++i) {
    const double share = math::exp(bank.likelihood[i] - most);
    shares += share;
    height += share * bank.x[i];
    next += share * (bank.x[i] + interval * (bank.v[i] + 0.5 * interval * bank.a[i]));
  }
  if (!std::isfinite(next)) return {resting, 0.0};
  height /= shares;
  next /= shares;
  const double slack = confidence * sd * std::sqrt(samples.front().doubt);
  const double confined = std::clamp(height, -slack, slack);
  // A velocity is felt at once: it is used only if motion is more likely than rest.
  const bool rests = rest_share > 0.5 * shares;
  return {base + confined, rests ? 0.0 : (next - height) / interval};
}

}  // namespace palpate
