// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "palpate/kernel/core/cloud.hpp"

namespace palpate::app {

/// Distances for people: millimetres up to a metre.
std::string length_text(double metres);

/// One sentence about points that are touched by a larger proxy than the usual one; empty: they
/// are not. @param r_c  [m] of the proxy
std::string radius_remark(const Cloud& cloud, double r_c);

/// Why points without an image are not felt, and what to do; empty: nothing is odd about them.
/// @param uri  of their source  @param r_c  [m] of the proxy
std::string sparse_remark(const Cloud& cloud, const std::string& uri, double r_c);

}  // namespace palpate::app
