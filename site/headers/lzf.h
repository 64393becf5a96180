/* SPDX-License-Identifier: Apache-2.0 */
/* liblzf's decoder, which is all that is used of it where there is no liblzf. */
#pragma once

#include <cstddef>
#include <cstdint>

/* Returns the bytes written; 0 if they are damaged or do not fit. */
inline unsigned lzf_decompress(const void* from, unsigned size, void* to, unsigned room) {
  const auto* in = static_cast<const std::uint8_t*>(from);
  auto* out = static_cast<std::uint8_t*>(to);
  unsigned at = 0;
  unsigned written = 0;
  while (at < size) {
    const unsigned control = in[at++];
    const bool is_literal = control < 32;
    unsigned length = is_literal ? control + 1 : control >> 5U;
    unsigned behind = 0; /* of what is copied */
    if (!is_literal) {
      if (length == 7 && at < size) length += in[at++];
      if (at >= size) return 0;
      behind = ((control & 31U) << 8U | in[at++]) + 1;
      length += 2;
    }
    if (length > room - written || behind > written || (is_literal && length > size - at)) return 0;
    for (; length > 0; --length, ++written)
      out[written] = is_literal ? in[at++] : out[written - behind];
  }
  return written;
}
