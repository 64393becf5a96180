// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace palpate::lab {

/// 0 of nothing.
double mean(std::span<const double> values);

/// Root of the mean of the squares; 0 of nothing.
double rms(const std::vector<double>& values);

/// The part of a signal sampled at 1 kHz that lies in 20 to 400 Hz, rms: what a finger is most
/// sensitive to. Over whole seconds; a remainder is left out.
double felt_rms(const std::vector<double>& signal);

/// The same over all samples, however many.
double felt_rms_of_all(const std::vector<double>& signal);

/// An estimate and the interval that holds what it estimates with 95 % confidence.
struct Interval {
  double value = 0.0;
  double low = 0.0;
  double high = 0.0;
};

/// A share of successes, as Wilson has it: right for few cases and for shares of 0 and 1, too.
/// @param of  how many were tried, at least one
Interval wilson(std::size_t successes, std::size_t of);

/// The mean of independent estimates. The distances from value to bounds are added by squares, each
/// side for itself (Zou and Donner's MOVER), so shares of 1 still have a lower bound below 1.
/// @param parts  at least one
Interval mean_of(std::span<const Interval> parts);

/// The mean of repeats that differ at random alone: Student's t. One repeat says nothing: its
/// bounds are infinite.
/// @param repeats  at least one
Interval student(std::span<const double> repeats);

}  // namespace palpate::lab
