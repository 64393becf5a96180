// SPDX-License-Identifier: Apache-2.0
// adversarial_ticks [TICKS [SEED]]: runs two hands of the Adversary for long, by hand; exits 1 at
// the first promise broken.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "tests/servo/adversary.hpp"

int main(int argc, char** argv) {
  using palpate::test::Adversary;
  const std::uint64_t ticks = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 1'000'000;
  const std::uint64_t seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  Adversary hands[] = {Adversary(2 * seed - 1), Adversary(2 * seed)};
  Adversary::link(hands[0], hands[1]);
  while (hands[0].ticks() + hands[1].ticks() < ticks) {
    for (Adversary& hand : hands) {
      const std::string broken = hand.step();
      if (broken.empty()) continue;
      std::fprintf(stderr, "adversarial_ticks: %s\n", broken.c_str());
      return 1;
    }
  }
  for (const Adversary& hand : hands) {
    const auto& statistics = hand.statistics();
    std::printf(
        "%llu ticks, %llu with force, %llu with torque, %llu of a tool, strongest %.3f N "
        "and %.4f N m\n",
        static_cast<unsigned long long>(hand.ticks()),
        static_cast<unsigned long long>(hand.forceful_ticks()),
        static_cast<unsigned long long>(hand.turning_ticks()),
        static_cast<unsigned long long>(hand.tool_ticks()), hand.strongest(),
        hand.strongest_torque());
    for (std::size_t i = 0; i < palpate::safety_flag_count; ++i)
      std::printf("%-16s %llu\n", palpate::safety_flag_table()[i].name.data(),
                  static_cast<unsigned long long>(statistics.interventions[i].load()));
  }
  return 0;
}
