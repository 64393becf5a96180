// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

namespace palpate {

/// The candidate with the smallest edit distance to `word`, or empty if none is near enough to be
/// what was meant.
std::string_view nearest_name(std::string_view word, std::span<const std::string_view> candidates);

}  // namespace palpate
