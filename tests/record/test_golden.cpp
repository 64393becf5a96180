// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/core/vectorise.hpp"
#include "palpate/record/replay.hpp"

#include "tests/record/loop_session.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_golden {

// Of a recorded session that was replayed.
std::string hash_of(const std::string& method) {
  const test::TemporaryFolder folder;
  test::LoopSession session(method);
  session.record(folder.path() / "bag");
  session.run(test::golden_ticks);
  session.recorder().stop();
  SessionReader reader(folder.path() / "bag");
  const ReplayReport report = replay(reader);
  EXPECT_TRUE(report.identical()) << text_of(report);
  EXPECT_EQ(report.ticks, static_cast<std::uint64_t>(test::golden_ticks));
  std::array<char, 17> text{};
  std::snprintf(text.data(), text.size(), "%016llx", static_cast<unsigned long long>(report.hash));
  return text.data();
}

// The method's hash, empty if there is none.
std::string stored(const std::string& method) {
  std::ifstream file(PALPATE_GOLDEN_HASHES);
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with(method + " ")) return line.substr(method.size() + 1);
  }
  return {};
}

class Golden : public ::testing::TestWithParam<std::string> {};

TEST_P(Golden, TicksOfAFixedSessionAreTheSameToTheBit) {
  for (const std::string_view set : vector_sets()) {  // the widest last: it stays in use
    use_vector_set(set);
    const std::string hash = hash_of(GetParam());
    if (std::getenv("PALPATE_PRINT_GOLDEN") != nullptr)
      std::printf("%s %s\n", GetParam().c_str(), hash.c_str());
    EXPECT_EQ(hash, stored(GetParam()))
        << "with " << set << " the ticks of " << GetParam()
        << " have changed; golden_hashes.txt says what to do if that was meant";
  }
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
