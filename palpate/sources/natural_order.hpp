// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace palpate {

/// Does `a` come before `b` in the order people number files: frame_2 before frame_10?
///
/// Runs of digits compare as numbers of any length, all else byte by byte. Names that are equal so
/// (frame_1 and frame_01) compare byte by byte: a strict total order.
[[nodiscard]] bool natural_less(std::string_view a, std::string_view b) noexcept;

}  // namespace palpate
