// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include <unistd.h>

namespace palpate::test {

/// Where a fuzzer's files go: in memory, where there is such a folder; of this process alone.
inline std::filesystem::path memory_folder() {
  namespace fs = std::filesystem;
  const fs::path memory = "/dev/shm";
  return (fs::is_directory(memory) ? memory : fs::temp_directory_path()) /
         ("palpate_fuzz_" + std::to_string(getpid()));
}

}  // namespace palpate::test
