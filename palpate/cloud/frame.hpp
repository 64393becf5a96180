// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "palpate/core/cloud.hpp"

namespace palpate {

/// One capture of a camera.
struct Frame {
  double stamp = 0.0;                  ///< [s] when it was captured
  std::shared_ptr<const Cloud> cloud;  ///< what it saw; a DepthImage where there is a depth image
};

}  // namespace palpate
