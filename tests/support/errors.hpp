// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include <gtest/gtest.h>

#include "palpate/kernel/core/error.hpp"

namespace palpate::test {

/// Does `action` throw an Error of one line that contains each of `parts`?
template <class Action, class... Parts>
testing::AssertionResult fails_saying(const Action& action, const Parts&... parts) {
  std::string message;
  try {
    static_cast<void>(action());
    return testing::AssertionFailure() << "nothing was thrown";
  } catch (const Error& error) {
    message = error.what();
  }
  if (message.find_first_of("\r\n") != std::string::npos) {
    return testing::AssertionFailure() << "more than one line: " << message;
  }
  for (const std::string_view part : {std::string_view(parts)...}) {
    if (message.find(part) == std::string::npos) {
      return testing::AssertionFailure() << "'" << part << "' is not in: " << message;
    }
  }
  return testing::AssertionSuccess() << message;
}

}  // namespace palpate::test
