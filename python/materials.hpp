// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/material_map.hpp"

#include "python/arrays.hpp"

namespace palpate::python {

/// What surfaces are made of: palpate.Materials.
struct MaterialsOf {
  std::shared_ptr<const MaterialTable> table;
};

/// Labels without a brightness, or the other way round, or both.
/// @param labels      uint8 (height, width), or None
/// @param brightness  likewise
/// @return null if nothing is given
/// @throws Error or TypeError for arrays of another form
std::shared_ptr<const MaterialMap> make_map(const Intrinsics& k,
                                            const std::optional<MaterialsOf>& materials,
                                            const py::object& labels, const py::object& brightness);

}  // namespace palpate::python
