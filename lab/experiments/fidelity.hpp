// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string_view>

#include "lab/experiment.hpp"

namespace palpate::lab {

/// How near the rendered contact and force are to the true ones, white noise and a real camera's,
/// beside its aims. Takes some seconds a method.
Experiment fidelity_experiment();

/// A measure of a scene, and the most that it is to be.
struct FidelityMeasure {
  std::string_view scene;
  std::string_view name;
  std::string_view unit;
  std::optional<double> aim;  ///< none: it is only shown
};
std::span<const FidelityMeasure> fidelity_measures();

/// Has a scene no noise, so that every seed gives the same?
bool is_without_chance(std::string_view scene);

}  // namespace palpate::lab
