// SPDX-License-Identifier: Apache-2.0
#include "lab/experiments/pop.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "lab/experiments/pop_cases.hpp"
#include "lab/method.hpp"
#include "lab/play.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate::lab {
namespace {

constexpr int usual_cases = 50;  // of each family
constexpr int cases_a_row = 50;
constexpr double noticed =
    0.3;  // [N] largest change of force by an occluder that counts as unnoticed

struct Outcome {
  ForceJudge force;
  bool lost = false;
  int dips = 0;         // times that it was behind for more than a frame, and came back
  double step = 0.0;    // [N] largest change of the force in a tick, from contact on
  double change = 0.0;  // [N] between the largest and the smallest force while nothing moves
  double caused = 0.0;  // [N] of it, by what passes: largest difference from the same without it
};

std::vector<double> forces_of(const std::string& name, const ExperimentOptions& options,
                              const PopStage& stage) {
  const auto method = make_method(name, {options.parameters, stage.truth}, options.own_methods);
  method->seat(stage.seat);
  std::vector<double> forces;
  play(*method, stage.scenario, [&](const Tick& tick) {
    forces.push_back(tick.force.norm());
    return true;
  });
  return forces;
}

// The proxy is behind if its centre is inside a body, in truth now and as the newest frame showed
// it (between frames nobody can know), while the ruler's is not.
// @param compare  play it without what passes, too, to say what that causes
Outcome play_case(const std::string& name, const PopCase& c, const ExperimentOptions& options,
                  bool compare) {
  const PopStage stage = find_pop_family(c.family).stage(c, options.parameters);
  const auto method = make_method(name, {options.parameters, stage.truth}, options.own_methods);
  const auto ruler = make_method("ideal", {options.parameters, stage.truth});
  method->seat(stage.seat);
  ruler->seat(stage.seat);
  const double frame = stage.scenario.tick_rate / stage.scenario.frame_rate;  // [ticks]
  Outcome outcome{.force = {options.parameters.proxy.r_c(), stage.scenario.tick_rate, frame}};
  int behind = 0;
  bool touched = false;
  double last_force = 0.0;
  double least = 1e9;
  double most = -1e9;
  const std::vector<double> undisturbed = compare && stage.undisturbed
                                              ? forces_of(name, options, *stage.undisturbed)
                                              : std::vector<double>();
  std::size_t ticks = 0;
  play(*method, stage.scenario, [&](const Tick& tick) {
    const Tick truly = ruler->tick(tick.hip, tick.t);
    const auto inside = [&](const Vec3& at) {
      return stage.truth(at, tick.t).distance < 0.0 && stage.truth(at, *stage.shown).distance < 0.0;
    };
    if (inside(tick.proxy) && stage.truth(truly.proxy, tick.t).distance > 0.0) {
      ++behind;
    } else {
      if (behind > frame) ++outcome.dips;
      behind = 0;
    }
    const double force = tick.force.norm();
    outcome.force.add(tick, truly,
                      std::min(stage.truth(tick.hip, tick.t).distance,
                               stage.truth(tick.hip, *stage.shown).distance));
    if (touched) outcome.step = std::max(outcome.step, std::abs(force - last_force));
    touched = touched || truly.state != ContactState::free_motion;
    last_force = force;
    if (tick.t >= stage.steady_from) {
      least = std::min(least, force);
      most = std::max(most, force);
      if (ticks < undisturbed.size())
        outcome.caused = std::max(outcome.caused, std::abs(force - undisturbed[ticks]));
    }
    ++ticks;
    outcome.lost = behind > patience * stage.scenario.tick_rate;
    return !outcome.lost;
  });
  if (stage.judged_at_end) {
    // Section 5.2 ends with the last frame: a proxy that is behind then counts as lost.
    outcome.lost = outcome.lost || behind > 0;
  } else if (behind > frame && !outcome.lost) {
    ++outcome.dips;
  }
  if (most > least) outcome.change = most - least;
  return outcome;
}

// The simplest case that is still lost: each value in turn is made simple, or brought half way
// there as often as it is still lost, until nothing more can be done. At most `most_tries` plays.
PopCase shrink(const std::string& name, PopCase c, const ExperimentOptions& options) {
  constexpr int most_tries = 60;
  int tries = 0;
  const auto still_lost = [&](const PopCase& simpler) {
    return ++tries <= most_tries && play_case(name, simpler, options, false).lost;
  };
  for (bool simpler = true; simpler && tries < most_tries;) {
    simpler = false;
    for (const PopRange& range : find_pop_family(c.family).ranges) {
      const double value = c[range.key];
      if (value == range.simple) continue;
      const bool whole = range.draw == PopRange::Draw::whole;
      for (const double share : {1.0, 0.5}) {
        if (whole && share != 1.0) break;
        PopCase next = c;
        const double shrunk = std::strtod(
            fmt::format("{:.2g}", value + share * (range.simple - value)).c_str(), nullptr);
        if (std::abs(shrunk - range.simple) >= std::abs(value - range.simple)) continue;
        next.values.find(range.key)->second = shrunk;
        if (!still_lost(next)) continue;
        c = next;
        // Halving continues only while it gains something.
        simpler = simpler || std::abs(shrunk - value) > 0.2 * std::abs(range.simple) + 1e-4;
        break;
      }
    }
  }
  return c;
}

PopCase with_fixed(PopCase c, const std::vector<std::string>& fixed) {
  if (fixed.empty()) return c;
  // Through the text, so that the same limits hold.
  std::string text = c.text();
  for (const std::string& assignment : fixed) {
    const std::string key = assignment.substr(0, assignment.find('='));
    if (c.values.find(key) == c.values.end()) continue;
    std::size_t at = text.find("?" + key + "=");
    if (at == std::string::npos) at = text.find("&" + key + "=");
    const std::size_t end = text.find('&', at + 1);
    text = text.substr(0, at + 1) + assignment + (end == std::string::npos ? "" : text.substr(end));
  }
  return parse_pop_case(text);
}

std::string row_of(const std::string& method, const PopFamily& family, int from, int count,
                   const std::function<PopCase(int)>& draw, const ExperimentOptions& options) {
  int lost = 0, dipped = 0, noticeable = 0, ghosts = 0, numb = 0, wrong = 0, right = 0;
  double step = 0.0, change = 0.0, caused = 0.0, worst_ghost = 0.0;
  std::string first_not_right = "-", first = "-", simplest = "-";
  for (int i = from; i < from + count; ++i) {
    const PopCase c = draw(i);
    const Outcome outcome = play_case(method, c, options, true);
    ghosts += outcome.force.ghost() ? 1 : 0;
    numb += outcome.force.numb() ? 1 : 0;
    wrong += outcome.force.wrong_side() ? 1 : 0;
    worst_ghost = std::max(worst_ghost, outcome.force.worst_ghost());
    if (outcome.lost) {
      if (lost++ > 0) continue;
      first = c.text();
      simplest = shrink(method, c, options).text();
      continue;
    }
    right += outcome.force.right() ? 1 : 0;
    if (!outcome.force.right() && first_not_right == "-") first_not_right = c.text();
    dipped += outcome.dips > 0 ? 1 : 0;
    step = std::max(step, outcome.step);
    change = std::max(change, outcome.change);
    caused = std::max(caused, outcome.caused);
    noticeable += outcome.caused > noticed ? 1 : 0;
  }
  return csv_row(method, family.name, from, count, lost, dipped, step, change, caused, noticeable,
                 first, simplest, ghosts, numb, wrong, right, worst_ghost, first_not_right);
}

std::vector<const PopFamily*> families_of(const ExperimentOptions& options) {
  std::vector<const PopFamily*> families;
  for (const PopFamily& family : pop_families())
    if (options.families.empty()) families.push_back(&family);
  for (const std::string& name : options.families) families.push_back(&find_pop_family(name));
  for (const std::string& fixed : options.fixed) {
    const std::string key = fixed.substr(0, fixed.find('='));
    const bool known = std::any_of(families.begin(), families.end(), [&](const PopFamily* family) {
      return std::any_of(family->ranges.begin(), family->ranges.end(),
                         [&](const PopRange& range) { return range.key == key; });
    });
    if (!known || fixed.find('=') == std::string::npos)
      throw Error("--fix " + fixed, "none of the families has a value '" + key + "'",
                  "write KEY=VALUE with a key of docs/pop.md");
  }
  return families;
}

std::vector<Cell> pop_cells(const Experiment& experiment, const ExperimentOptions& options) {
  std::optional<PopCase> given;
  if (!options.case_text.empty()) given = parse_pop_case(options.case_text);
  const int cases = given ? 1 : options.cases.value_or(usual_cases);
  const std::vector<const PopFamily*> families =
      given ? std::vector{&find_pop_family(given->family)} : families_of(options);
  std::vector<Cell> cells;
  for (const std::string& name : methods_of(experiment, options)) {
    for (const PopFamily* family : families) {
      const auto draw = [=](int i) {
        const auto index = static_cast<std::uint64_t>(i);
        return given ? *given
                     : with_fixed(draw_pop_case(*family, options.seed, index), options.fixed);
      };
      for (int from = 0; from < cases; from += cases_a_row)
        cells.emplace_back([=] {
          return row_of(name, *family, from, std::min(cases_a_row, cases - from), draw, options);
        });
    }
  }
  return cells;
}

// Two digits, rounded down: 100 means all.
std::string percent_held(double held, double cases) {
  return fmt::format("{:.2f}", std::floor(1e4 * held / cases) / 100.0);
}

Scores pop_scores(const Table& table) {
  const std::vector<std::string> methods = texts_in(table, "method");
  const std::vector<Table> families = table.by({"family"});
  Scores scores;
  scores.columns = {"family", "cases"};
  for (const std::string& method : methods)
    for (const std::string& column :
         {method + " held [%]", std::string("dips [%]"), std::string("right [%]")})
      scores.columns.push_back(column);
  std::vector<double> held(methods.size(), 0.0);
  std::vector<double> right(methods.size(), 0.0);
  scores.note =
      "The score is the mean over the families of the share held, and of the share right: no "
      "pop-through, no force in free space, none in the opposite direction, none missing. "
      "docs/pop.md has the rules.";
  for (const Table& of_family : families) {
    const std::string& family = of_family.text(0, "family");
    std::vector<std::string> line = {family};
    for (std::size_t m = 0; m < methods.size(); ++m) {
      const Table rows = of_family.where({{"method", methods[m]}});
      const auto total = [&](std::string_view column) { return sum(rows.numbers(column)); };
      const auto most = [&](std::string_view column) { return largest(rows.numbers(column)); };
      const double cases = total("cases");
      if (m == 0) line.push_back(fmt::format("{:g}", cases));
      line.push_back(percent_held(cases - total("lost"), cases));
      line.push_back(fmt::format("{:.1f}", 100.0 * total("dipped") / cases));
      line.push_back(percent_held(total("right"), cases));
      held[m] += (cases - total("lost")) / cases;
      right[m] += total("right") / cases;
      if (total("ghost") + total("numb") + total("wrong") > 0.0)
        scores.note += fmt::format(
            "\n{}, {}: {:g} cases: {:g} with a force in free space (up to {:.2f} N), {:g} with a "
            "missing force, {:g} with a force in the opposite direction",
            methods[m], family, cases, total("ghost"), most("worst_ghost_n"), total("numb"),
            total("wrong"));
      // None where all of them are lost, too: the next line plays one of those.
      for (const auto& [column, begin] :
           {std::pair("first_not_right", "; "), std::pair("simplest", "\n")}) {
        const std::vector<std::string> texts = texts_in(rows, column);
        const auto first = std::find_if(texts.begin(), texts.end(),
                                        [](const std::string& text) { return text != "-"; });
        if (first != texts.end())
          scores.note +=
              fmt::format("{}palpate eval pop --methods {} --case '{}'", begin, methods[m], *first);
      }
      if (most("worst_change_n") > 0.0)
        scores.note += fmt::format(
            "\n{}, {}: in cases without pop-through the force changed by up to {:.3f} N; the "
            "change caused by the occluder was at most {:.3f} N, and above {:g} N in {:g} of {:g}",
            methods[m], family, most("worst_change_n"), most("worst_caused_n"), noticed,
            total("noticeable"), cases);
    }
    scores.rows.push_back(std::move(line));
  }
  std::vector<std::string> line = {"score", ""};
  for (std::size_t m = 0; m < methods.size(); ++m) {
    const auto count = static_cast<double>(families.size());
    line.push_back(percent_held(held[m], count));
    line.emplace_back("");
    line.push_back(percent_held(right[m], count));
  }
  scores.rows.push_back(std::move(line));
  return scores;
}

}  // namespace

void ForceJudge::add(const Tick& tick, const Tick& ruler, double clear) {
  constexpr double clear_space = 6.0;     // [r_c] a hand this far from every body feels nothing
  constexpr double felt = 0.01;           // [N] a force that counts there
  constexpr double firm = 1.0;            // [N] the ruler's force from which a hand must feel some
  constexpr double least_share = 0.25;    // [-] of it, or the hand is numb
  constexpr double has_direction = 0.05;  // [N]
  constexpr double opposite = -0.5;       // [-] cosine between a force and the ruler's
  const double force = tick.force.norm();
  const double truth = ruler.force.norm();
  if (force > felt && truth == 0.0 && clear > clear_space * r_c_)
    worst_ghost_ = std::max(worst_ghost_, force);
  numb_for_ = truth > firm && force < least_share * truth ? numb_for_ + 1 : 0;
  numb_ = numb_ || numb_for_ > patience * tick_rate_;
  const bool opposed = force > has_direction && truth > has_direction &&
                       tick.force.dot(ruler.force) < opposite * force * truth;
  wrong_for_ = opposed ? wrong_for_ + 1 : 0;
  wrong_ = wrong_ || wrong_for_ > frame_;
}

Judgement judge(const std::string& method, const PopCase& c, const ExperimentOptions& options) {
  const Outcome outcome = play_case(method, c, options, false);
  return {.held = !outcome.lost, .right = !outcome.lost && outcome.force.right()};
}

Experiment pop_experiment() {
  return {.name = "pop",
          .summary = "pop-through in families of random cases, failures reduced to simple ones",
          .header =
              "method,family,from,cases,lost,dipped,worst_step_n,worst_change_n,worst_caused_n,"
              "noticeable,first_lost,simplest,ghost,numb,wrong,right,worst_ghost_n,first_not_right",
          .default_methods = {"paper", "sight"},
          .cells = pop_cells,
          .scores = pop_scores,
          .plays_programs = true};
}

}  // namespace palpate::lab
