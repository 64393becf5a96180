// SPDX-License-Identifier: Apache-2.0
#include "app/recording_check.hpp"

#include <fmt/format.h>

namespace palpate::app {

std::string text_of(const BagCheck& check) {
  if (!check.damage.empty()) return "the recording is damaged: " + check.damage;
  std::string text =
      "the recording has no checksums (it is older, or written by another program): damage may not "
      "be detected";
  if (check.has_checksums) {
    text = fmt::format("checksums of all {} messages are right", check.messages - check.unchecked);
    if (check.unchecked > 0) text += fmt::format("; {} others have none", check.unchecked);
  }
  if (!check.closed)
    text +=
        "; it was not closed (its program was probably killed), and contains only the completely "
        "written messages";
  return text;
}

}  // namespace palpate::app
