// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <sstream>
#include <string>

#include "palpate/io/devices/hip_path.hpp"

#include "tests/fuzz/expect.hpp"

// A path's CSV gives an Error of one line, or finite places at increasing times.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace palpate;
  test::succeeds([&] {
    std::istringstream text{std::string(test::text_of(data, size))};
    const HipPath path = HipPath::parse_csv(text, "fuzz");
    for (std::size_t i = 0; i < path.samples().size(); ++i) {
      const HipPath::Sample& sample = path.samples()[i];
      test::expect(sample.hip.allFinite() && (i == 0 || sample.t > path.samples()[i - 1].t));
    }
    const double middle = 0.5 * (path.first_time() + path.last_time());
    test::expect(path.at(middle).allFinite());
  });
  return 0;
}
