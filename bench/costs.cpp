// SPDX-License-Identifier: Apache-2.0
#include "bench/costs.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <functional>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/kernel/paper/proxy.hpp"

#include "bench/pcl_searches.hpp"
#include "search/kd_tree.hpp"

namespace palpate::bench {
namespace {

// What the samples [us] say; `batch` is passed on.
Distribution distribution(std::vector<double> samples, std::size_t batch) {
  if (samples.empty()) return {};
  std::sort(samples.begin(), samples.end());
  const auto at = [&samples](double part) {
    return samples[static_cast<std::size_t>(part * static_cast<double>(samples.size() - 1))];
  };
  return {at(0.5), at(0.99), at(0.999), samples.back(), samples.size(), batch};
}

// What reading the thread's clock costs [us]: the median of many.
double clock_cost() {
  static const double cost = [] {
    std::vector<double> costs(2001);
    for (double& each : costs) {
      const double begin = thread_time();
      each = thread_time() - begin;
    }
    return distribution(costs, 1).median;
  }();
  return cost;
}

// Calls `operation` over and over for about `budget` seconds of thread time, at least five times
// `batch`. Its times are means over `batch` calls, less the clock's own cost: take a batch for what
// is shorter than that.
Distribution measure(double budget, std::size_t batch, const std::function<void()>& operation) {
  constexpr std::size_t fewest = 5;
  constexpr std::size_t most = 200000;
  const double cost = clock_cost();
  std::vector<double> samples;
  samples.reserve(most);
  const double end = thread_time() + budget * 1e6;
  while (samples.size() < most) {
    const double begin = thread_time();
    if (begin > end && samples.size() >= fewest) break;
    for (std::size_t i = 0; i < batch; ++i) operation();
    const double taken = std::max(thread_time() - begin - cost, 0.0);
    samples.push_back(taken / static_cast<double>(batch));
  }
  return distribution(std::move(samples), batch);
}

// Keeps the compiler from dropping a result.
template <class T>
void use(const T& value) {
  asm volatile("" : : "r,m"(value) : "memory");
}

// How many calls go into a sample of something that takes a fraction of a microsecond.
constexpr std::size_t many = 64;

class CountedCloud final : public Cloud {
 public:
  explicit CountedCloud(const Cloud& cloud) : cloud_(&cloud) {}
  void gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept override {
    ++gathers;
    cloud_->gather(ball, max_points, patch);
  }
  void gather(const Beam& beam, std::size_t max_points, Patch& patch) const noexcept override {
    ++gathers;
    cloud_->gather(beam, max_points, patch);
  }
  mutable std::size_t gathers = 0;

 private:
  const Cloud* cloud_;
};

Vec3 hip_at(const Subject& subject, const Hand& hand, double t) {
  // To and fro at constant speed.
  const double lap = 4.0 * hand.amplitude / hand.speed;
  const double phase = std::fmod(t, lap) / lap;
  const double position = hand.amplitude * (1.0 - 4.0 * std::abs(phase - 0.5));
  return subject.surface + hand.depth * subject.into + position * subject.along;
}

// The hand's session: comes down on the surface, then moves.
class Session {
 public:
  Session(const Subject& subject, const MethodChoice& method, const Hand& hand)
      : subject_(subject), hand_(hand), touch(make_method(method.name, method.parameters)) {
    touch->observe({*subject.frames.front(), 0.0});
    const Vec3 start = hip_at(subject, hand, 0.0);
    touch->seat(start - (std::max(hand.depth, 0.0) + 0.03) * subject.into);
    constexpr int settling = 200;
    for (int i = 0; i < settling; ++i) touch->tick(start, 0.0);
  }

  [[nodiscard]] bool frame_is_due() const {
    return static_cast<double>(frames_) <= (now() + 1.0 / hand_.tick_rate) * hand_.frame_rate;
  }
  void frame(const std::vector<const Cloud*>& clouds) {
    touch->observe(
        {*clouds[frames_ % clouds.size()], static_cast<double>(frames_) / hand_.frame_rate});
    ++frames_;
  }
  [[nodiscard]] Vec3 next_hip() const {
    return hip_at(subject_, hand_, static_cast<double>(ticks_ + 1) / hand_.tick_rate);
  }
  Tick tick(const Vec3& hip) {
    ++ticks_;
    return touch->tick(hip, now());
  }
  [[nodiscard]] double now() const { return static_cast<double>(ticks_) / hand_.tick_rate; }

 private:
  const Subject& subject_;
  Hand hand_;
  std::size_t ticks_ = 0;
  std::size_t frames_ = 1;

 public:
  std::unique_ptr<Method> touch;
};

void measure_ticks(const Subject& subject, const MethodChoice& method, const Hand& hand,
                   double budget, KernelCosts& costs) {
  std::vector<CountedCloud> counted;
  counted.reserve(subject.frames.size());
  std::vector<const Cloud*> clouds;
  for (const auto& frame : subject.frames) clouds.push_back(&counted.emplace_back(*frame));

  Session session(subject, method, hand);
  constexpr std::size_t most = 200000;
  std::vector<double> ticks;
  std::vector<double> after_frame;
  ticks.reserve(most);
  after_frame.reserve(most);
  double points = 0.0;
  double steps = 0.0;
  const double cost = clock_cost();
  const double end = thread_time() + budget * 1e6;
  const auto fewest = static_cast<std::size_t>(3.0 * hand.tick_rate / hand.frame_rate) + 20;
  while (ticks.size() < most && (ticks.size() < fewest || thread_time() < end)) {
    const bool new_frame = session.frame_is_due();
    if (new_frame) session.frame(clouds);
    const Vec3 hip = session.next_hip();
    const double begin = thread_time();
    const Tick tick = session.tick(hip);
    const double taken = std::max(thread_time() - begin - cost, 0.0);
    use(tick);
    ticks.push_back(taken);
    if (new_frame) after_frame.push_back(taken);
    steps += tick.steps;
    points += static_cast<double>(session.touch->patch()->size());
  }
  const auto count = static_cast<double>(ticks.size());
  std::size_t gathers = 0;
  for (const CountedCloud& cloud : counted) gathers += cloud.gathers;
  costs.points = points / count;
  costs.steps = steps / count;
  costs.gathers = static_cast<double>(gathers) / count;
  costs.tick = distribution(std::move(ticks), 1);
  costs.tick_after_frame = distribution(std::move(after_frame), 1);
}

}  // namespace

double thread_time() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e6 + static_cast<double>(now.tv_nsec) * 1e-3;
}

KernelCosts kernel_costs(const Subject& subject, const MethodChoice& method, const Hand& hand,
                         double budget) {
  KernelCosts costs;
  measure_ticks(subject, method, hand, budget, costs);

  Session session(subject, method, hand);
  Method& touch = *session.touch;
  const Tick rest = touch.tick(session.next_hip(), 0.0);
  const ProxyParameters& proxy = method.parameters.proxy;
  // What a slide gathers: r_3 and the least that the method leaves for the proxy to travel.
  const Ball ball{rest.proxy, proxy.r_3 + 0.2 * proxy.r_c()};
  Patch patch;
  costs.gather = measure(budget, many, [&] { gather(*subject.frames.front(), ball, patch); });
  // One step to the side and the look with which it ends: what a slide repeats.
  const double cos_theta = std::cos(proxy.theta);
  const Vec3 beside = rest.hip + 1e-3 * subject.along;
  const auto move = [&](ProxyMovement movement, int steps) {
    ProxyParameters limited = proxy;
    limited.step_budget = steps;
    move_proxy(patch, beside, limited, cos_theta, false, movement);
    return movement;
  };
  const ProxyMovement start = move({.at = rest.proxy}, 0);
  costs.step = measure(budget, many, [&] { use(move(start, 1)); });

  std::size_t frames = 0;
  costs.frame = measure(budget, many, [&] {
    ++frames;
    touch.observe({*subject.frames[frames % subject.frames.size()],
                   static_cast<double>(frames) / hand.frame_rate});
  });
  return costs;
}

std::vector<SearchCosts> search_costs(const Subject& subject, const Parameters& parameters,
                                      double budget) {
  const Cloud& frame = *subject.frames.front();
  const std::vector<Vec3> points = points_of(frame);
  // The ball that a tick gathers from: r_3 and the proxy's room, about a proxy at rest.
  const ProxyParameters& proxy = parameters.proxy;
  const Ball ball{subject.surface - proxy.r_c() * subject.into, proxy.r_3 + 0.2 * proxy.r_c()};
  std::vector<SearchCosts> rows;
  Patch patch;
  const auto add = [&](const std::string& name, std::optional<Distribution> build,
                       std::size_t batch, const std::function<std::size_t()>& query) {
    SearchCosts& row = rows.emplace_back();
    row.name = name;
    row.build = build;
    row.found = query();
    row.query = measure(budget, batch, [&] { use(query()); });
  };
  const auto gathered = [&](const Cloud& cloud) {
    gather(cloud, ball, patch);
    return patch.size();
  };

  if (frame.point_cloud() == nullptr)
    add("depth image", std::nullopt, many, [&] { return gathered(frame); });

  std::optional<PointCloud> boxes;
  const Distribution boxes_build = measure(budget, 1, [&] { boxes.emplace(points); });
  add("point cloud", boxes_build, many, [&] { return gathered(*boxes); });

  std::unique_ptr<KdTree> tree;
  const Distribution tree_build =
      measure(budget, 1, [&] { tree = std::make_unique<KdTree>(points); });
  add("nanoflann", tree_build, many, [&] { return tree->search(ball); });

  for (const PclSearch& pcl : pcl_searches(frame, points)) {
    const Distribution pcl_build = measure(budget, 1, pcl.build);
    add(pcl.name, pcl_build, many, [&] { return pcl.search(ball); });
  }

  const BruteForceCloud all(points);
  add("brute force", std::nullopt, 1, [&] { return gathered(all); });
  return rows;
}

}  // namespace palpate::bench
