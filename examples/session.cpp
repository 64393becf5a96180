// SPDX-License-Identifier: Apache-2.0
// A whole session: a simulated person strokes what a simulated camera sees.
#include <cstdio>

#include <palpate/session/session.hpp>

int main() {
  palpate::SessionOptions options;
  options.cameras.push_back({.uri = "synthetic:desk?noise=1mm"});
  options.hands[0].device = "hand:";
  options.pace = palpate::Pace::free_running;  // as fast as the machine can
  options.stroke_time = 6.0;
  palpate::Session session(std::move(options));
  session.run(6.0);
  const palpate::Summary summary = session.state().hands[0].summary;
  std::printf("%zu ticks, %zu in contact; asked for %.1f N at most, sent %.1f N\n", summary.ticks,
              summary.contact_ticks, summary.largest_asked, summary.largest_sent);
}
