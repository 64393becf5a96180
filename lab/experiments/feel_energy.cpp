// SPDX-License-Identifier: Apache-2.0
// The scene of `feel` that counts energy: hands that press and come off, again and again.
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "lab/closed_loop.hpp"
#include "lab/experiments/feel_scenes.hpp"
#include "lab/experiments/pop_cases.hpp"
#include "palpate/servo/passivity_observer.hpp"

namespace palpate::lab {
namespace {

constexpr double first = 2.0;    // [s] the chain's ramp and the first frames are over
constexpr double clear = 0.015;  // [m] above the surface, before and after a contact
constexpr int contacts_a_hand = 8;

struct Holding {
  std::string_view loop;
  std::string_view device;
  std::string_view grip;
  bool by_chain;  // through the safety chain
};
constexpr std::array holdings = {
    Holding{"light", "touch", "light", false}, Holding{"firm", "touch", "firm", false},
    Holding{"omega", "omega", "light", false}, Holding{"chain", "touch", "light", true}};

struct Presses {
  HipPath path;
  std::vector<double> ends;  // [s]
};

Presses presses(std::uint64_t seed) {
  Chance between(seed);
  std::vector<double> ends;
  const Vec3 place(between(-0.02, 0.02), between(-0.02, 0.02), clear);
  std::vector<HipPath::Sample> samples = {{0.0, place}, {first, place}};
  for (int i = 0; i < contacts_a_hand; ++i) {
    // A light grip of 100 N/m leads 4 to 40 mm deep: 0.3 to 3 N.
    const double depth = 0.04 * std::pow(0.1, between(0.0, 1.0));
    const double speed = 0.3 * std::pow(0.1, between(0.0, 1.0));
    const double way = (depth + clear) / speed;
    const Vec3 down(place.x(), place.y(), -depth);
    double t = samples.back().t;
    samples.push_back({t += way, down});
    samples.push_back({t += between(0.05, 0.4), down});
    samples.push_back({t += way, place});
    samples.push_back({t += 0.15, place});
    ends.push_back(t);
  }
  return {HipPath(std::move(samples)), std::move(ends)};
}

// What the forces of one loop have given to its hand, contact by contact.
class Meter {
 public:
  explicit Meter(const std::vector<double>& ends) : ends_(&ends) {}

  void add(const Felt& felt) {
    if (last_) sum_ += sent_.dot(felt.hip - *last_);
    last_ = felt.hip;
    sent_ = felt.force;
    if (made.size() < ends_->size() && felt.t >= (*ends_)[made.size()]) {
      made.push_back(sum_);
      sum_ = 0.0;
    }
  }

  std::vector<double> made;  // [J]

 private:
  const std::vector<double>* ends_;
  std::optional<Vec3> last_;
  Vec3 sent_ = Vec3::Zero();
  double sum_ = 0.0;
};

}  // namespace

FeelFigures play_energy(const FeelOptions& options, double distance, const std::string& sensor) {
  struct Counted {
    std::vector<double> above;  // [mJ]
    double sum = 0.0;           // [mJ]
    double ruler = 0.0;         // [mJ] the same of the exact surface
  };
  std::vector<double> by_chain;  // [mJ] of the exact surface, above the same without the chain
  std::vector<std::vector<Counted>> counted(options.contestants.size(),
                                            std::vector<Counted>(holdings.size()));
  for (int k = 0; k < options.repeats; ++k) {
    const std::uint64_t seed = options.seed_of(k);
    const FeelStage stage("synthetic:plane?" + camera_options(distance, 0.3, sensor, seed));
    const Truth truth = truth_of(stage.scene);
    std::vector<Presses> hands;
    for (int i = 0; i < std::max(options.phases / 4, 1); ++i)
      hands.push_back(presses(1000 * seed + static_cast<std::uint64_t>(i)));
    std::vector<std::unique_ptr<TouchLoop>> loops;
    std::vector<Meter> meters;
    double duration = 0.0;
    for (const Holding& holding : holdings) {
      for (const Presses& hand : hands) {
        duration = std::max(duration, hand.ends.back());
        const auto held = [&] {
          return in_hand(hand.path, grip_preset(holding.grip), device_preset(holding.device), seed);
        };
        // The ruler first: an exact surface in the same hand, by the same way.
        const auto add = [&](std::unique_ptr<Method> method) {
          loops.push_back(holding.by_chain
                              ? safe_loop(std::move(method), held(), options.parameters)
                              : straight_loop(std::move(method), held()));
          meters.emplace_back(hand.ends);
        };
        add(make_method("ideal", {options.parameters, truth}));
        for (const OwnMethod& contestant : options.contestants)
          add(contestant.make({options.parameters, truth}));
      }
    }
    play_to(loops, stage.scenario(duration + 0.01),
            [&](std::size_t loop, const Felt& felt) { meters[loop].add(felt); });
    const std::size_t group = 1 + options.contestants.size();
    for (std::size_t i = 0; i < hands.size(); ++i) {
      const std::vector<double>& straight = meters[i * group].made;
      const std::vector<double>& chain = meters[(3 * hands.size() + i) * group].made;
      for (std::size_t c = 0; c < chain.size(); ++c)
        by_chain.push_back(1e3 * (chain[c] - straight[c]));
    }
    for (std::size_t h = 0; h < holdings.size(); ++h) {
      for (std::size_t i = 0; i < hands.size(); ++i) {
        const std::size_t ruler = (h * hands.size() + i) * group;
        for (std::size_t m = 0; m < options.contestants.size(); ++m) {
          Counted& counts = counted[m][h];
          for (std::size_t c = 0; c < meters[ruler].made.size(); ++c) {
            const double made = 1e3 * meters[ruler + 1 + m].made[c];
            const double exact = 1e3 * meters[ruler].made[c];
            counts.sum += made;
            counts.ruler += exact;
            counts.above.push_back(made - exact);
          }
        }
      }
    }
  }
  FeelFigures figures;
  for (std::size_t m = 0; m < options.contestants.size(); ++m) {
    for (std::size_t h = 0; h < holdings.size(); ++h) {
      Counted& counts = counted[m][h];
      std::sort(counts.above.begin(), counts.above.end());
      const auto n = counts.above.size();
      const auto add = [&](std::string_view measure, double value) {
        figures.push_back(
            {options.contestants[m].name, holdings[h].loop, std::string(measure), value});
      };
      constexpr double much = 1e3 * PortEnergy::least_made;  // [mJ]
      const auto many = std::count_if(counts.above.begin(), counts.above.end(),
                                      [](double above) { return above > much; });
      add("above", counts.above.back());
      add("above-99%", counts.above[n - 1 - n / 100]);
      add("above-median", counts.above[n / 2]);
      add("over-0.1mJ", 100.0 * static_cast<double>(many) / static_cast<double>(n));
      add("made", counts.sum / static_cast<double>(n));
      add("exact", counts.ruler / static_cast<double>(n));
      add("contacts", static_cast<double>(n));
      if (holdings[h].by_chain)
        add("chain-above", *std::max_element(by_chain.begin(), by_chain.end()));
    }
  }
  return figures;
}

}  // namespace palpate::lab
