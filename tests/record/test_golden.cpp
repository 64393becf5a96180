// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/core/vectorise.hpp"
#include "palpate/record/replay.hpp"

#include "tests/record/loop_session.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_golden {

// What decides the last bits of a build beside the source: compiler and vector set. Empty where the
// build is not one whose hashes are kept.
std::string build_name() {
#if !defined(NDEBUG) || !defined(__OPTIMIZE__) || defined(PALPATE_SANITIZED)
  return {};
#else
  std::string name;
#if defined(__clang__)
  name = "clang-" + std::to_string(__clang_major__);
#elif defined(__GNUC__)
  name = "gcc-" + std::to_string(__GNUC__);
#endif
#if !defined(__x86_64__) || !defined(__linux__)
  return {};
#else
  return name + " " + std::string(vector_set_in_use());
#endif
#endif
}

// FNV-1a over the bits of a tick's numbers, from its time to the flags of the hand.
void add(std::uint64_t& hash, const ServoTick& tick) {
  static const auto count =
      std::find(tick_columns().begin(), tick_columns().end(), "hand") - tick_columns().begin() + 1;
  const std::vector<double> row = row_of(tick);
  for (const double number : std::span(row).first(static_cast<std::size_t>(count))) {
    const auto bits = std::bit_cast<std::uint64_t>(number);
    for (int byte = 0; byte < 8; ++byte)
      hash = (hash ^ (bits >> 8 * byte & 0xffU)) * 0x100000001b3U;
  }
}

// Of a recorded session that was replayed.
std::string hash_of(const std::string& method) {
  const test::TemporaryFolder folder;
  test::LoopSession session(method);
  session.record(folder.path() / "bag");
  session.run(600);
  session.recorder().stop();
  SessionReader reader(folder.path() / "bag");
  const ReplayReport report = replay(reader);
  EXPECT_TRUE(report.identical()) << test::text_of(report);
  EXPECT_EQ(report.ticks, 600U);
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (std::size_t i = 0; i < reader.ticks(); ++i) add(hash, reader.tick(i));
  std::array<char, 17> text{};
  std::snprintf(text.data(), text.size(), "%016llx", static_cast<unsigned long long>(hash));
  return text.data();
}

// The line's hash, empty if there is none.
std::string stored(const std::string& build, const std::string& method) {
  std::ifstream file(PALPATE_GOLDEN_HASHES);
  for (std::string line; std::getline(file, line);) {
    const std::string key = build + " " + method + " ";
    if (line.starts_with(key)) return line.substr(key.size());
  }
  return {};
}

class Golden : public ::testing::TestWithParam<std::string> {};

TEST_P(Golden, TicksOfAFixedSessionAreTheSameToTheBit) {
  const std::string build = build_name();
  if (build.empty()) GTEST_SKIP() << "hashes are kept of optimised builds for x86-64 Linux alone";
  const std::string hash = hash_of(GetParam());
  if (std::getenv("PALPATE_PRINT_GOLDEN") != nullptr) {
    std::printf("%s %s %s\n", build.c_str(), GetParam().c_str(), hash.c_str());
    return;
  }
  const std::string expected = stored(build, GetParam());
  if (expected.empty())
    GTEST_SKIP() << "no hash is stored for " << build << "; golden_hashes.txt says how to print it";
  EXPECT_EQ(hash, expected) << "the ticks of " << GetParam() << " have changed (" << build
                            << "); golden_hashes.txt says what to do if that was meant";
}

std::vector<std::string> names_of_methods() {
  std::vector<std::string> names;
  for (const MethodInfo& method : standard_methods().entries()) names.push_back(method.name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(Methods, Golden, ::testing::ValuesIn(names_of_methods()),
                         [](const auto& each) {
                           std::string name = each.param;
                           for (char& c : name) c = c == '-' ? '_' : c;
                           return name;
                         });

}  // namespace test_golden
}  // namespace palpate
