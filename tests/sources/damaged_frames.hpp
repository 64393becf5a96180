// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include <gtest/gtest.h>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate::test {

/// Reads all frames of a recording. Each that is damaged must be an error of one line.
/// @return how many were
inline int damaged_frames(Source& recording) {
  int errors = 0;
  for (std::size_t i = 0; i < recording.info().frames.value_or(0); ++i) {
    try {
      EXPECT_TRUE(recording.next()) << "frame " << i;
    } catch (const Error& error) {
      ++errors;
      EXPECT_EQ(std::string_view(error.what()).find('\n'), std::string_view::npos) << error.what();
    }
  }
  return errors;
}

}  // namespace palpate::test
