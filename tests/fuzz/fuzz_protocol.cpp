// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <span>
#include <variant>

#include "palpate/net/viewer/protocol.hpp"

#include "tests/fuzz/expect.hpp"

// A page's message, binary or text, gives none or one that makes sense.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace palpate;
  if (const auto message = parse_binary(std::as_bytes(std::span(data, size)))) {
    if (const auto* hand = std::get_if<HandMessage>(&*message)) {
      test::expect(hand->target || !hand->held);
      test::expect(!hand->target ||
                   (hand->target->allFinite() && hand->target->norm() <= 2.0 * max_hand_distance));
      test::expect(!hand->orientation || std::abs(hand->orientation->norm() - 1.0) < 1e-9);
    }
  }
  if (const auto command = parse_command(test::text_of(data, size))) {
    if (const auto* set = std::get_if<SetParameter>(&*command))
      test::expect(std::isfinite(set->value));
    if (const auto* set = std::get_if<SetSafetyParameter>(&*command))
      test::expect(std::isfinite(set->value));
  }
  return 0;
}
