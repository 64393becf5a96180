// SPDX-License-Identifier: Apache-2.0
// The scene of `feel` that counts energy: hands that press and come off, again and again.
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "lab/closed_loop.hpp"
#include "lab/experiments/feel_scenes.hpp"
#include "lab/experiments/pop_cases.hpp"
#include "lab/statistics.hpp"
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

// Of the energies of all contacts.
double all_but_a_hundredth(std::span<const double> energies) {
  std::vector<double> sorted(energies.begin(), energies.end());
  std::sort(sorted.begin(), sorted.end());
  return sorted[sorted.size() - 1 - sorted.size() / 100];
}
double percent_of_many(std::span<const double> energies) {
  constexpr double much = 1e3 * PortEnergy::least_made;  // [mJ]
  const auto many =
      std::count_if(energies.begin(), energies.end(), [](double energy) { return energy > much; });
  return 100.0 * static_cast<double>(many) / static_cast<double>(energies.size());
}
double number_of(std::span<const double> energies) { return static_cast<double>(energies.size()); }

// Adds one repeat's contacts to those of each contestant, holding after holding.
// @param meters  of each holding and hand, the ruler's and then the contestants'
void count_energies(const std::vector<OwnMethod>& contestants, std::size_t hands,
                    const std::vector<Meter>& meters, std::vector<FeelRepeats>& counted) {
  const std::size_t group = 1 + contestants.size();
  for (std::size_t h = 0; h < holdings.size(); ++h) {
    for (std::size_t i = 0; i < hands; ++i) {
      const std::size_t ruler = (h * hands + i) * group;
      for (std::size_t m = 0; m < contestants.size(); ++m) {
        FeelRepeats& energies = counted[m * holdings.size() + h];
        const std::pair name(contestants[m].name, holdings[h].loop);
        for (std::size_t c = 0; c < meters[ruler].made.size(); ++c) {
          const double made = 1e3 * meters[ruler + 1 + m].made[c];
          const double exact = 1e3 * meters[ruler].made[c];
          energies.add(name, "above", made - exact);
          energies.add(name, "made", made);
          energies.add(name, "exact", exact);
          // The exact surface's, above the same without the chain.
          if (holdings[h].by_chain)
            energies.add(name, "chain-above",
                         1e3 * (meters[ruler].made[c] - meters[i * group].made[c]));
        }
      }
    }
  }
}

}  // namespace

FeelFigures play_energy(const FeelOptions& options, double distance, const std::string& sensor) {
  const std::vector<OwnMethod>& contestants = options.contestants;
  std::vector<FeelRepeats> counted(contestants.size() * holdings.size());  // [mJ]
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
        for (const OwnMethod& contestant : contestants)
          add(contestant.make({options.parameters, truth}));
      }
    }
    play_to(loops, stage.scenario(duration + 0.01),
            [&](std::size_t loop, const Felt& felt) { meters[loop].add(felt); });
    count_energies(contestants, hands.size(), meters, counted);
  }
  FeelFigures figures;
  for (const FeelRepeats& energies : counted) {
    const FeelFigures more = energies.figures({{"above", largest},
                                               {"above", all_but_a_hundredth, "above-99%"},
                                               {"above", median, "above-median"},
                                               {"above", percent_of_many, "over-0.1mJ"},
                                               {"made", mean},
                                               {"exact", mean},
                                               {"above", number_of, "contacts"},
                                               {"chain-above", largest}});
    figures.insert(figures.end(), more.begin(), more.end());
  }
  return figures;
}

}  // namespace palpate::lab
