// SPDX-License-Identifier: Apache-2.0
// contact_population [CONTACTS [SEED]]: honest contacts, of which the energy link may cut none, and
// free handles, of which it has to stop all, by hand. Exits 1 if one is wrong.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "tests/servo/haptic_loop.hpp"

int main(int argc, char** argv) {
  using palpate::test::HapticLoop;
  const std::uint64_t contacts = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 3000;
  const std::uint64_t first = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 200'000;
  std::uint64_t cut = 0;
  for (std::uint64_t seed = first; seed < first + contacts; ++seed) {
    const double when = palpate::test::honest_contact(seed).run(4.0, 0.012).first_cut;
    if (when < 0.0) continue;
    ++cut;
    std::printf("honest contact %llu was cut at %.2f s\n", static_cast<unsigned long long>(seed),
                when);
  }
  std::printf("%llu honest contacts of 4 s, %llu cut\n", static_cast<unsigned long long>(contacts),
              static_cast<unsigned long long>(cut));

  std::uint64_t missed = 0;
  std::vector<double> found_at;
  std::vector<double> left;
  for (std::uint64_t seed = first; seed < first + contacts / 4; ++seed) {
    HapticLoop loop = palpate::test::free_swing(seed);
    HapticLoop without = loop;
    without.links &= ~std::uint32_t{palpate::energy_cut};
    const HapticLoop::Result alone = without.run(5.0, 0.005);
    if (alone.swings[4] < 2e-3 || alone.swings[9] < 2e-3) continue;
    const HapticLoop::Result result = loop.run(8.0, 0.005);
    left.push_back(*std::max_element(result.swings.begin() + 8, result.swings.end()));
    if (result.first_cut < 0.0) {
      ++missed;
      std::printf("free handle %llu was not found\n", static_cast<unsigned long long>(seed));
    } else {
      found_at.push_back(result.first_cut);
    }
  }
  if (found_at.empty() || left.empty()) return 1;
  std::sort(found_at.begin(), found_at.end());
  std::sort(left.begin(), left.end());
  std::printf(
      "%zu free handles that swing more than 2 mm, %llu missed; found after %.2f s (median), %.2f "
      "s "
      "(last); swing after 4 s %.2f mm (median), %.2f mm (largest)\n",
      left.size(), static_cast<unsigned long long>(missed), found_at[found_at.size() / 2],
      found_at.back(), 1e3 * left[left.size() / 2], 1e3 * left.back());
  return cut + missed > 0 ? 1 : 0;
}
