// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

namespace palpate::lab {

/// Root of the mean of the squares; 0 of nothing.
double rms(const std::vector<double>& values);

/// The part of a signal sampled at 1 kHz that lies in 20 to 400 Hz, rms: what a finger is most
/// sensitive to. Over whole seconds; a remainder is left out.
double felt_rms(const std::vector<double>& signal);

/// The same over all samples, however many.
double felt_rms_of_all(const std::vector<double>& signal);

}  // namespace palpate::lab
