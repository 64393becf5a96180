// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

namespace palpate::test {

/// A path below the folder of recorded data that PALPATE_DATA names.
inline std::filesystem::path data_path(const std::filesystem::path& below) {
  const char* root = std::getenv("PALPATE_DATA");
  return root == nullptr || *root == '\0' ? std::filesystem::path{}
                                          : std::filesystem::path(root) / below;
}

}  // namespace palpate::test

/// Sets `variable` to the path of recorded data, or skips the test, saying what is missing.
#define PALPATE_DATA_OR_SKIP(variable, below)                                       \
  const std::filesystem::path variable = palpate::test::data_path(below);           \
  if ((variable).empty() || !std::filesystem::exists(variable)) {                   \
    GTEST_SKIP() << "recorded data not found: "                                     \
                 << ((variable).empty() ? std::string(below) : (variable).string()) \
                 << "; set PALPATE_DATA to the folder that holds it";               \
  }
