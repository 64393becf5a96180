// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace palpate::ros {

/// The fields of a message's header in their order; `way` writes them, reads them, or lays them
/// out.
template <class Way, class H>
void walk_header(Way& way, H& header) {
  way.begin_header();
  way.number(header.stamp.sec);
  way.number(header.stamp.nanosec);
  way.text(header.frame_id);
}

}  // namespace palpate::ros
