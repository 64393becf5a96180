// SPDX-License-Identifier: Apache-2.0
// adversarial_ticks [TICKS [SEED]]: runs the Adversary for long, by hand; exits 1 at the first
// promise broken.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "tests/servo/adversary.hpp"

int main(int argc, char** argv) {
  const std::uint64_t ticks = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 1'000'000;
  palpate::test::Adversary adversary(argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1);
  while (adversary.ticks() < ticks) {
    const std::string broken = adversary.step();
    if (broken.empty()) continue;
    std::fprintf(stderr, "adversarial_ticks: %s\n", broken.c_str());
    return 1;
  }
  const auto& statistics = adversary.statistics();
  std::printf("%llu ticks, %llu with force, %llu in contact, strongest %.3f N\n",
              static_cast<unsigned long long>(adversary.ticks()),
              static_cast<unsigned long long>(adversary.forceful_ticks()),
              static_cast<unsigned long long>(statistics.contact_ticks.load()),
              adversary.strongest());
  for (std::size_t i = 0; i < palpate::safety_flag_count; ++i) {
    std::printf("%-16s %llu\n", palpate::safety_flag_names()[i].data(),
                static_cast<unsigned long long>(statistics.interventions[i].load()));
  }
  return 0;
}
