// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string_view>

namespace palpate::lab {

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
