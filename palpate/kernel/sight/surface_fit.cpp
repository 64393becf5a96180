// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/sight/surface_fit.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "palpate/kernel/core/lanes.hpp"
#include "palpate/kernel/core/linear.hpp"
#include "palpate/kernel/core/vectorise.hpp"

namespace palpate {
namespace {

// Exponents of x and y in each monomial, by degree.
struct Exponents {
  int x, y;
};
constexpr std::array<Exponents, 15> monomials = {{{0, 0},
                                                  {1, 0},
                                                  {0, 1},
                                                  {2, 0},
                                                  {1, 1},
                                                  {0, 2},
                                                  {3, 0},
                                                  {2, 1},
                                                  {1, 2},
                                                  {0, 3},
                                                  {4, 0},
                                                  {3, 1},
                                                  {2, 2},
                                                  {1, 3},
                                                  {0, 4}}};

constexpr std::size_t index_of(int x, int y) {
  const int degree = x + y;
  return static_cast<std::size_t>(degree * (degree + 1) / 2 + y);
}

// The sums of Moments: 15 of xy, then 6 of z.
constexpr std::size_t moment_count = 21;
using FloatMoments = std::array<float, moment_count>;

struct Rows {
  float x[3], y[3], z[3], offset[3];
};

template <bool is_weighted>
PALPATE_VECTORISED FloatMoments sum_moments(const float* px, const float* py, const float* pz,
                                            const float* weight, std::size_t size, const Rows rows,
                                            const float* coefficients, float centre_x,
                                            float centre_y, float inner_squared,
                                            float outer_squared, float inverse_cut) {
  std::array<FloatLanes, moment_count> sums{};
  const std::array<float, 6> c{coefficients[0], coefficients[1], coefficients[2],
                               coefficients[3], coefficients[4], coefficients[5]};
  const std::size_t end = whole_blocks(size);
  for (std::size_t block = 0; block < end; block += sum_lanes) {
#pragma omp simd
    for (std::size_t lane = 0; lane < sum_lanes; ++lane) {
      const std::size_t i = block + lane;
      float x = rows.x[0] * px[i] + rows.x[1] * py[i] + rows.x[2] * pz[i] + rows.offset[0];
      float y = rows.y[0] * px[i] + rows.y[1] * py[i] + rows.y[2] * pz[i] + rows.offset[1];
      float z = rows.z[0] * px[i] + rows.z[1] * py[i] + rows.z[2] * pz[i] + rows.offset[2];
      // A weight of 0 does not make a point harmless that is no number.
      const bool sound = std::abs(x) + std::abs(y) + std::abs(z) < 1e6F;
      x = sound ? x : 1e6F;
      y = sound ? y : 0.0F;
      z = sound ? z : 0.0F;
      const float xx = x * x;
      const float xy = x * y;
      const float yy = y * y;
      const float r = z - (c[0] + c[1] * x + c[2] * y + c[3] * xx + c[4] * xy + c[5] * yy);
      const float away = (x - centre_x) * (x - centre_x) + (y - centre_y) * (y - centre_y);
      const float in_disc = ((away >= inner_squared) & (away < outer_squared)) ? 1.0F : 0.0F;
      float t = r * inverse_cut;
      t = t * t;
      t = t < 1.0F ? 1.0F - t : 0.0F;
      float w = in_disc * t * t;  // Tukey's biweight
      if constexpr (is_weighted) w *= weight[i];
      const float wx = w * x;
      const float wy = w * y;
      const float wxx = w * xx;
      const float wxy = w * xy;
      const float wyy = w * yy;
      sums[0][lane] += w;
      sums[1][lane] += wx;
      sums[2][lane] += wy;
      sums[3][lane] += wxx;
      sums[4][lane] += wxy;
      sums[5][lane] += wyy;
      sums[6][lane] += wxx * x;
      sums[7][lane] += wxx * y;
      sums[8][lane] += wyy * x;
      sums[9][lane] += wyy * y;
      sums[10][lane] += wxx * xx;
      sums[11][lane] += wxx * xy;
      sums[12][lane] += wxx * yy;
      sums[13][lane] += wxy * yy;
      sums[14][lane] += wyy * yy;
      sums[15][lane] += w * r;
      sums[16][lane] += wx * r;
      sums[17][lane] += wy * r;
      sums[18][lane] += wxx * r;
      sums[19][lane] += wxy * r;
      sums[20][lane] += wyy * r;
    }
  }
  FloatMoments moments;
  for (std::size_t k = 0; k < moment_count; ++k) moments[k] = sum_of_lanes(sums[k]);
  return moments;
}

// The frame's axes in `unit`s [m]: local = rows * p + offset, for points relative to `centre`.
Rows rows_of(const LocalFrame& frame, const Vec3& centre, double unit) {
  const Vec3 offset = frame.local_from_world(centre) / unit;
  Rows rows{};
  for (int i = 0; i < 3; ++i) {
    rows.x[i] = static_cast<float>(frame.x[i] / unit);
    rows.y[i] = static_cast<float>(frame.y[i] / unit);
    rows.z[i] = static_cast<float>(frame.up[i] / unit);
    rows.offset[i] = static_cast<float>(offset[i]);
  }
  return rows;
}

PALPATE_VECTORISED
void transform(const float* px, const float* py, const float* pz, std::size_t size, const Rows rows,
               float* x, float* y, float* z) {
#pragma omp simd
  for (std::size_t i = 0; i < size; ++i) {
    x[i] = rows.x[0] * px[i] + rows.x[1] * py[i] + rows.x[2] * pz[i] + rows.offset[0];
    y[i] = rows.y[0] * px[i] + rows.y[1] * py[i] + rows.y[2] * pz[i] + rows.offset[1];
    z[i] = rows.z[0] * px[i] + rows.z[1] * py[i] + rows.z[2] * pz[i] + rows.offset[2];
  }
}

// Bisection over the values' bits, which are in the order of the values once those of negative ones
// are turned round.
PALPATE_VECTORISED
std::int32_t kth_key(const std::int32_t* keys, std::size_t size, std::size_t k) {
  std::int64_t low = std::numeric_limits<std::int32_t>::min();
  std::int64_t high = std::numeric_limits<std::int32_t>::max();
  while (low < high) {
    const std::int64_t middle = low + (high - low) / 2;
    const auto key = static_cast<std::int32_t>(middle);
    std::uint32_t count = 0;  // of those up to the middle
    std::int32_t last = std::numeric_limits<std::int32_t>::min();
#pragma omp simd reduction(+ : count) reduction(max : last)
    for (std::size_t i = 0; i < size; ++i) {
      const bool below = keys[i] <= key;
      count += below ? 1U : 0U;
      const std::int32_t candidate = below ? keys[i] : std::numeric_limits<std::int32_t>::min();
      last = candidate > last ? candidate : last;
    }
    if (count == k + 1) return last;
    if (count > k) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return static_cast<std::int32_t>(low);
}

constexpr std::int32_t ordered(std::int32_t bits) { return bits ^ ((bits >> 31) & 0x7fffffff); }

// Coefficients from metres to units [m]: a term of degree d has the unit m^(1-d).
Vec6 in_units(const Vec6& metres, double unit) {
  Vec6 c = metres;
  c[0] /= unit;
  c.tail<3>() *= unit;
  return c;
}

}  // namespace

void LocalPoints::take(const Patch& patch, const LocalFrame& frame) noexcept {
  size = std::min(patch.size(), capacity);
  vectorised<transform>(patch.x(), patch.y(), patch.z(), size,
                        rows_of(frame, patch.ball().centre, 1.0), x.data(), y.data(), z.data());
}

float kth_smallest(std::span<const float> values, std::size_t k) noexcept {
  constexpr std::size_t most = 512;
  std::array<std::int32_t, most> keys;
  const std::size_t size = std::min(values.size(), most);
  for (std::size_t i = 0; i < size; ++i) keys[i] = ordered(std::bit_cast<std::int32_t>(values[i]));
  return std::bit_cast<float>(ordered(vectorised<kth_key>(keys.data(), size, k)));
}

LocalFrame LocalFrame::about(const Vec3& origin, const Vec3& up) noexcept {
  int smallest = 0;
  up.cwiseAbs().minCoeff(&smallest);
  const Vec3 x = Vec3::Unit(smallest).cross(up).normalized();
  return {origin, x, up.cross(x), up};
}

Vec2 Quadric::nearest(const Vec3& point, const Vec2& start, const Vec2& centre,
                      double reach) const noexcept {
  const auto within = [&](const Vec2& p) -> Vec2 {
    const Vec2 d = p - centre;
    const double length = d.norm();
    return length <= reach ? p : Vec2(centre + reach / length * d);
  };
  constexpr double settled = 1e-6;  // [reach]
  Vec2 at = within(start);
  for (int i = 0; i < 8; ++i) {
    // Half the squared distance: its gradient, and its Hessian without (with) the curvature term.
    const double above = height(at) - point.z();
    const Vec2 g = gradient(at);
    const Vec2 slope = at - point.head<2>() + above * g;
    const double xx = 1.0 + g.x() * g.x();
    const double xy = g.x() * g.y();
    const double yy = 1.0 + g.y() * g.y();
    double hxx = xx + 2.0 * above * c[3];
    double hxy = xy + above * c[4];
    double hyy = yy + 2.0 * above * c[5];
    double determinant = hxx * hyy - hxy * hxy;
    if (!(hxx > 0.1 && determinant > 0.1)) {  // beyond a centre of curvature
      hxx = xx;
      hxy = xy;
      hyy = yy;
      determinant = hxx * hyy - hxy * hxy;
    }
    const Vec2 step((hyy * slope.x() - hxy * slope.y()) / determinant,
                    (hxx * slope.y() - hxy * slope.x()) / determinant);
    const Vec2 next = within(at - step);
    const double moved = (next - at).norm();
    at = next;
    if (moved <= settled * reach) break;
  }
  return at;
}

void Moments::add(const Moments& other) noexcept {
  for (std::size_t i = 0; i < xy.size(); ++i) xy[i] += other.xy[i];
  for (std::size_t i = 0; i < z.size(); ++i) z[i] += other.z[i];
}

Eigen::Matrix<double, 6, 6> Moments::normal_matrix() const noexcept {
  Eigen::Matrix<double, 6, 6> a;
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < 6; ++j) {
      a(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          xy[index_of(monomials[i].x + monomials[j].x, monomials[i].y + monomials[j].y)];
    }
  }
  return a;
}

Vec6 Moments::right_side() const noexcept { return Eigen::Map<const Vec6>(z.data()); }

void Moments::raise(const Quadric& surface, double unit) noexcept {
  const Vec6 c = in_units(surface.c, unit);
  const Vec6 ac = normal_matrix() * c;
  Eigen::Map<Vec6>(z.data()) += ac;
}

Moments Moments::moved(const Vec3& s) const noexcept {
  // Powers of x - s_x and y - s_y by the binomial theorem.
  constexpr std::array<std::array<double, 5>, 5> choose = {
      {{1, 0, 0, 0, 0}, {1, 1, 0, 0, 0}, {1, 2, 1, 0, 0}, {1, 3, 3, 1, 0}, {1, 4, 6, 4, 1}}};
  std::array<double, 5> px{1.0};
  std::array<double, 5> py{1.0};
  for (std::size_t i = 1; i < 5; ++i) {
    px[i] = -s.x() * px[i - 1];
    py[i] = -s.y() * py[i - 1];
  }
  const auto expand = [&](const auto& sums, std::size_t k) {
    const auto a = static_cast<std::size_t>(monomials[k].x);
    const auto b = static_cast<std::size_t>(monomials[k].y);
    double total = 0.0;
    for (std::size_t i = 0; i <= a; ++i) {
      for (std::size_t j = 0; j <= b; ++j) {
        total += choose[a][i] * choose[b][j] * px[a - i] * py[b - j] *
                 sums[index_of(static_cast<int>(i), static_cast<int>(j))];
      }
    }
    return total;
  };
  Moments result;
  for (std::size_t k = 0; k < xy.size(); ++k) result.xy[k] = expand(xy, k);
  for (std::size_t k = 0; k < z.size(); ++k) {
    result.z[k] = expand(z, k) - s.z() * result.xy[k];
  }
  return result;
}

Moments disc_moments(const Patch& patch, const LocalFrame& frame, const Quadric& surface,
                     const Disc& disc, double unit, const float* weight) noexcept {
  const Rows rows = rows_of(frame, patch.ball().centre, unit);
  const Eigen::Matrix<float, 6, 1> c = in_units(surface.c, unit).cast<float>();
  const auto squared = [unit](double r) { return static_cast<float>((r / unit) * (r / unit)); };
  const auto sum = [&](const auto& loop) {
    return loop(patch.x(), patch.y(), patch.z(), weight, patch.padded_size(), rows, c.data(),
                static_cast<float>(disc.centre.x() / unit),
                static_cast<float>(disc.centre.y() / unit), squared(disc.inner),
                squared(disc.outer), static_cast<float>(unit / disc.cut));
  };
  const FloatMoments sums =
      weight == nullptr ? sum(vectorised<sum_moments<false>>) : sum(vectorised<sum_moments<true>>);
  Moments moments;
  const auto z = sums.begin() + static_cast<std::ptrdiff_t>(moments.xy.size());
  std::copy(sums.begin(), z, moments.xy.begin());
  std::copy(z, sums.end(), moments.z.begin());
  return moments;
}

Quadric fit_quadric(const Moments& moments, double curvature_prior, double unit) noexcept {
  Eigen::Matrix<double, 6, 6> a = moments.normal_matrix();
  // A very weak prior keeps coefficients at 0 that no point determines.
  for (int i = 0; i < 6; ++i) a(i, i) += 1e-9;
  a.diagonal().tail<3>().array() += curvature_prior;
  Quadric quadric;
  quadric.c = solve_symmetric<6>(a, moments.right_side());
  quadric.c[0] *= unit;
  quadric.c.tail<3>() /= unit;
  return quadric;
}

}  // namespace palpate
