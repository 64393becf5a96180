// SPDX-License-Identifier: Apache-2.0
// Hands that press, slide and are lifted: what they feel where nothing is.
#include <algorithm>
#include <map>

#include "lab/closed_loop.hpp"
#include "lab/experiments/feel_scenes.hpp"
#include "lab/experiments/pop_cases.hpp"

namespace palpate::lab {
namespace {

constexpr double clear = 0.03;      // [m] a hand this far from every body is in free space
constexpr double felt_at = 0.01;    // [N] a force that counts there
constexpr double at_the_end = 0.1;  // [s] still felt then: it is trapped

// What a method did in a run.
struct Run {
  bool felt = false;     // a force in free space
  bool trapped = false;  // and to the end
};

// Case number `index`, but with the camera and the body of another, so that they share frames.
PopCase with_camera_of(const PopCase& camera, const PopFamily& family, std::uint64_t seed,
                       int index) {
  PopCase c = draw_pop_case(family, seed, static_cast<std::uint64_t>(index));
  for (const char* key : {"sensor", "tilt", "distance", "fps", "body"})
    c.values.find(key)->second = camera[key];
  c.seed = camera.seed;
  return c;
}

}  // namespace

FeelFigures play_free_hands(const std::vector<Contestant>& contestants, const FeelOptions& options,
                            int from, int count) {
  const PopFamily& family = find_pop_family("lift-off");
  std::map<std::string, int> felt;
  std::map<std::string, int> trapped;
  std::map<std::string, std::string> first;
  for (int begin = from; begin < from + count; begin += hands_a_camera) {
    const PopCase camera = draw_pop_case(family, options.seed, static_cast<std::uint64_t>(begin));
    const int hands = std::min(hands_a_camera, from + count - begin);
    std::vector<PopCase> cases;
    std::vector<PopStage> stages;
    double longest = 0.0;  // [s]
    for (int i = 0; i < hands; ++i) {
      cases.push_back(with_camera_of(camera, family, options.seed, begin + i));
      stages.push_back(family.stage(cases.back(), options.parameters));
      longest = std::max(longest, stages.back().scenario.duration);
    }
    struct Player {
      const Contestant* contestant;
      std::size_t hand;
      std::unique_ptr<Method> method;
      Run run;
    };
    std::vector<Player> players;
    for (const Contestant& contestant : contestants) {
      for (std::size_t hand = 0; hand < stages.size(); ++hand) {
        players.push_back(
            {&contestant, hand, contestant.make({options.parameters, stages[hand].truth}), Run{}});
        players.back().method->seat(stages[hand].seat);
      }
    }
    Arrivals arrivals(stages.front().scenario);
    for (int i = 0; i <= static_cast<int>(1000.0 * longest); ++i) {
      const double t = 1e-3 * i;
      arrivals.until(t, [&](const std::shared_ptr<const Cloud>& cloud, double stamp) {
        for (Player& player : players) {
          if (t <= stages[player.hand].scenario.duration) player.method->observe({*cloud, stamp});
        }
      });
      for (Player& player : players) {
        const PopStage& stage = stages[player.hand];
        if (t > stage.scenario.duration) continue;
        const Tick tick = player.method->tick(stage.scenario.hip(t), t);
        if (tick.force.norm() <= felt_at || stage.truth(tick.hip, t).distance <= clear) continue;
        player.run.felt = true;
        if (t > stage.scenario.duration - at_the_end) player.run.trapped = true;
      }
    }
    for (const Player& player : players) {
      const std::string& name = player.contestant->name;
      felt[name] += player.run.felt ? 1 : 0;
      trapped[name] += player.run.trapped ? 1 : 0;
      if (player.run.felt && first[name].empty()) first[name] = cases[player.hand].text();
    }
  }
  FeelFigures figures;
  for (const Contestant& contestant : contestants) {
    const std::string& name = contestant.name;
    const std::string text = first[name].empty() ? "-" : first[name];
    figures.push_back({name, "path", "runs", static_cast<double>(count)});
    figures.push_back({name, "path", "felt", static_cast<double>(felt[name]), text});
    figures.push_back({name, "path", "trapped", static_cast<double>(trapped[name]), text});
  }
  return figures;
}

}  // namespace palpate::lab
