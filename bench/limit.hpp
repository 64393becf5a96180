// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "palpate/kernel/core/patch.hpp"

namespace palpate::bench {

/// The least that one pass over a patch can cost here: each coordinate loaded and added up.
float load_and_add(const Patch& patch);

/// The same for a pixel window: `rows` of `columns` readings, `row_length` apart.
std::uint16_t load_and_add(const std::uint16_t* depth, std::size_t columns, std::size_t rows,
                           std::size_t row_length);

}  // namespace palpate::bench
