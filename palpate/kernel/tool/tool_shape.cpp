// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/tool/tool_shape.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <span>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/mathematics.hpp"
#include "palpate/kernel/core/rotation.hpp"
#include "palpate/kernel/core/uri.hpp"

namespace palpate {
namespace {

constexpr double longest = 2.0;      // [m] of a tool: more is a wrong unit
constexpr double thinnest = 2e-4;    // [m] of a tool: less is a wrong unit
constexpr double same_place = 1e-6;  // [m] between two candidates that are one
constexpr double candidates = 2.0;   // for each point that is kept
constexpr int around = 48;           // facets of a round tool
constexpr int along_cap = 12;        // of a quarter circle

// [-] length of the mean of a candidate's normals: less is a corner or a tip, where three faces or
// more meet; 0.71 is a square edge.
constexpr double blunt = 0.66;
constexpr std::size_t most_corners = ToolShape::most_patches / 2;

struct Candidate {
  Vec3 at;
  Vec3 outward = Vec3::Zero();  // sum of the normals about it
  double normals = 0.0;
};
using Candidates = std::map<std::array<std::int64_t, 3>, Candidate>;  // one for each place

void add(Candidates& all, const Vec3& at, const Vec3& outward) {
  std::array<std::int64_t, 3> key{};
  for (int i = 0; i < 3; ++i)
    key[static_cast<std::size_t>(i)] =
        static_cast<std::int64_t>(std::floor(at[i] / same_place + 0.5));
  Candidate& candidate = all.try_emplace(key, Candidate{at}).first->second;
  candidate.outward += outward;
  candidate.normals += 1.0;
}

// The corners of triangles halved across their longest side until none is longer than `pitch`.
Candidates lattice(const Triangles& surface, double pitch) {
  Candidates all;
  std::vector<std::array<Vec3, 3>> left;
  for (const auto& triangle : surface.triangles) {
    left.push_back(
        {surface.points[triangle[0]], surface.points[triangle[1]], surface.points[triangle[2]]});
    const Vec3 normal = (left.back()[1] - left.back()[0]).cross(left.back()[2] - left.back()[0]);
    const bool is_flat = !(normal.norm() > 0.0);
    while (!left.empty()) {
      const auto [a, b, c] = left.back();
      left.pop_back();
      if (is_flat) continue;
      const double ab = (a - b).norm(), bc = (b - c).norm(), ca = (c - a).norm();
      if (std::max({ab, bc, ca}) <= pitch) {
        for (const Vec3& corner : {a, b, c}) add(all, corner, normal.normalized());
      } else if (ab >= bc && ab >= ca) {
        left.insert(left.end(), {{a, 0.5 * (a + b), c}, {0.5 * (a + b), b, c}});
      } else if (bc >= ca) {
        left.insert(left.end(), {{b, 0.5 * (b + c), a}, {0.5 * (b + c), c, a}});
      } else {
        left.insert(left.end(), {{c, 0.5 * (c + a), b}, {0.5 * (c + a), a, b}});
      }
    }
  }
  return all;
}

double area_of(const Triangles& surface) {
  double area = 0.0;
  for (const auto& t : surface.triangles)
    area += 0.5 * (surface.points[t[1]] - surface.points[t[0]])
                      .cross(surface.points[t[2]] - surface.points[t[0]])
                      .norm();
  return area;
}

Triangles box(const Vec3& centre, const Vec3& sides) {
  Triangles mesh;
  for (int corner = 0; corner < 8; ++corner)
    mesh.points.emplace_back(centre + 0.5 * Vec3((corner & 1) != 0 ? sides.x() : -sides.x(),
                                                 (corner & 2) != 0 ? sides.y() : -sides.y(),
                                                 (corner & 4) != 0 ? sides.z() : -sides.z()));
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

Triangles together(Triangles a, const Triangles& b) {
  const auto first = static_cast<std::uint32_t>(a.points.size());
  a.points.insert(a.points.end(), b.points.begin(), b.points.end());
  for (const auto& t : b.triangles)
    a.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  return a;
}

// The surface that a profile of (x, radius) draws around the x axis; both ends on the axis.
Triangles turned(const std::vector<std::array<double, 2>>& profile) {
  Triangles mesh;
  for (const auto& [x, radius] : profile)
    for (int i = 0; i < around; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / around;
      mesh.points.emplace_back(x, radius * math::cos(angle), radius * math::sin(angle));
    }
  for (std::size_t ring = 0; ring + 1 < profile.size(); ++ring)
    for (int i = 0; i < around; ++i) {
      const auto index = [&](std::size_t r, int k) {
        return static_cast<std::uint32_t>(r * around + static_cast<std::size_t>(k % around));
      };
      mesh.triangles.push_back({index(ring, i), index(ring, i + 1), index(ring + 1, i)});
      mesh.triangles.push_back({index(ring, i + 1), index(ring + 1, i + 1), index(ring + 1, i)});
    }
  return mesh;
}

Triangles capsule(double length, double radius) {
  std::vector<std::array<double, 2>> profile;
  const double straight = 0.5 * length - radius;
  for (int i = 0; i <= 2 * along_cap; ++i) {
    const double angle = std::numbers::pi * i / (2 * along_cap);
    const double x = -math::cos(angle) * radius;
    const double r = i == 0 || i == 2 * along_cap ? 0.0 : math::sin(angle) * radius;
    if (i == along_cap) profile.push_back({-straight, radius});
    profile.push_back({i < along_cap ? x - straight : x + straight, r});
  }
  return turned(profile);
}

constexpr std::string_view remedy =
    "give ball, box:40x20x5mm, capsule:80x8mm, cylinder:80x8mm, cone:60x6mm, "
    "gripper:40x30x8mm or mesh:FILE.stl?unit=mm";

[[noreturn]] void refuse(const std::string& text, const std::string& wrong) {
  throw Error("tool '" + text + "'", wrong, std::string(remedy));
}

double metres_of(std::string_view unit) {
  if (unit == "mm") return 1e-3;
  if (unit == "cm") return 1e-2;
  if (unit == "m") return 1.0;
  if (unit == "in") return 25.4e-3;
  return 0.0;
}

// "40x20x5mm": so many lengths [m].
std::vector<double> lengths_of(const std::string& text, std::string_view path, std::size_t count) {
  std::vector<double> lengths;
  const char* at = path.data();
  const char* end = at + path.size();
  for (;;) {
    double value = 0.0;
    const auto [next, fault] = std::from_chars(at, end, value);
    if (fault != std::errc()) refuse(text, "'" + std::string(at, end) + "' is no length");
    lengths.push_back(value);
    at = next;
    if (at == end || *at != 'x') break;
    ++at;
  }
  const double unit = metres_of(std::string_view(at, static_cast<std::size_t>(end - at)));
  if (unit == 0.0)
    refuse(text, at == end ? "it has no unit" : "'" + std::string(at, end) + "' is no unit");
  if (lengths.size() != count)
    refuse(text, "it has " + std::to_string(lengths.size()) + " lengths and needs " +
                     std::to_string(count));
  for (double& length : lengths) {
    length *= unit;
    if (!(length >= thinnest && length <= longest))
      refuse(text, "a length is not between 0.2 mm and 2 m");
  }
  return lengths;
}

Triangles mesh_of(const std::string& text, const Uri& uri, const MeshReader& read) {
  const std::string unit = uri.text_option("unit", "");
  if (metres_of(unit) == 0.0)
    throw Error("tool '" + text + "'",
                unit.empty() ? "the unit of the mesh is not told" : "'" + unit + "' is no unit",
                "add ?unit=mm, or cm, m or in");
  const std::string origin = uri.text_option("origin", "centre");
  if (origin != "centre" && origin != "file")
    throw Error("tool '" + text + "'", "origin '" + origin + "' is not known",
                "give origin=centre, the middle of the mesh's box, or origin=file");
  if (!read) refuse(text, "a mesh cannot be read here");
  Triangles mesh = read(uri.path());
  if (mesh.points.empty()) refuse(text, "the mesh is empty");
  Vec3 low = mesh.points.front(), high = low;
  for (const Vec3& p : mesh.points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const Vec3 middle = origin == "centre" ? Vec3(0.5 * (low + high)) : Vec3(Vec3::Zero());
  for (Vec3& p : mesh.points) p = metres_of(unit) * (p - middle);
  const double extent = metres_of(unit) * (high - low).maxCoeff();
  if (!(extent >= thinnest && extent <= longest))
    throw Error("tool '" + text + "'",
                "the mesh is " + std::to_string(extent) + " m long in that unit",
                "give the unit of the file's numbers; a tool is 0.2 mm to 2 m long");
  return mesh;
}

}  // namespace

ToolShape::ToolShape(const Triangles& surface, std::size_t count, std::string text, double turning,
                     double margin)
    : surface_(surface), text_(std::move(text)), turning_(turning) {
  if (count < 4 || count > most_points)
    refuse(text_, std::to_string(count) + " points are not between 4 and 10000");
  const double area = area_of(surface);
  if (!(area > 0.0 && std::isfinite(area))) refuse(text_, "its surface has no area");
  const Candidates all =
      lattice(surface, std::sqrt(area / (candidates * static_cast<double>(count))));
  std::vector<Point> places;
  std::vector<std::size_t> corners, every;
  Vec3 middle = Vec3::Zero();
  for (const auto& [key, candidate] : all) {
    const double length = candidate.outward.norm();
    if (length < blunt * candidate.normals) corners.push_back(places.size());
    every.push_back(places.size());
    places.push_back(
        {candidate.at, length > 0.0 ? Vec3(-candidate.outward / length) : Vec3(Vec3::Zero()), 0});
    middle += candidate.at / static_cast<double>(all.size());
  }
  // Each next point is the one farthest from all before it; the corners come first.
  std::vector<float> away(places.size(), std::numeric_limits<float>::max());
  const auto place = [&](std::size_t i) { return places[i].at; };
  const auto take = [&](const std::vector<std::size_t>& from, std::size_t most, std::size_t next) {
    while (!from.empty() && points_.size() < most && away[next] > 0.0F) {
      points_.push_back(places[next]);
      const Vec3 at = place(next);
      float farthest = -1.0F;
      for (const std::size_t i : from) {
        away[i] = std::min(away[i], static_cast<float>((place(i) - at).squaredNorm()));
        if (away[i] <= farthest) continue;
        farthest = away[i];
        next = i;
      }
      spacing_ = std::sqrt(static_cast<double>(std::max(farthest, 0.0F)));
    }
  };
  const auto outermost = [&](const std::vector<std::size_t>& from) {
    return from.empty() ? 0 : *std::max_element(from.begin(), from.end(), [&](auto a, auto b) {
      return (place(a) - middle).squaredNorm() < (place(b) - middle).squaredNorm();
    });
  };
  take(corners, std::min(count, most_corners), outermost(corners));
  std::size_t next = outermost(every);
  for (const std::size_t i : every) {
    for (const Point& taken : points_)
      away[i] = std::min(away[i], static_cast<float>((place(i) - taken.at).squaredNorm()));
    if (!points_.empty() && away[i] > away[next]) next = i;
  }
  take(every, count, next);
  for (Point& point : points_) point.at -= margin * point.inward;
  finish();
}

ToolShape::ToolShape(std::vector<Point> points, std::string text, double turning)
    : points_(std::move(points)), text_(std::move(text)), turning_(turning) {
  if (!(turning_ >= 0.01 && turning_ <= 1e3))
    refuse(text_, "its turning is not within 0.01 to 1000");
  if (points_.empty() || points_.size() > most_points)
    refuse(text_, "it has no points or too many");
  for (const Point& point : points_)
    if (!point.at.allFinite() || !point.inward.allFinite() || point.at.norm() > longest)
      refuse(text_, "a point is not finite");
  finish();
}

ToolShape ToolShape::turned(const Rotation& turn) const {
  ToolShape tool = *this;
  for (Point& point : tool.points_) {
    point.at = turn * point.at;
    point.inward = turn * point.inward;
  }
  for (Vec3& point : tool.surface_.points) point = turn * point;
  return tool;
}

void ToolShape::finish() {
  const std::size_t patches = std::min(points_.size(), most_patches);
  for (Point& point : points_) {
    reach_ = std::max(reach_, point.at.norm());
    double nearest = std::numeric_limits<double>::max();
    for (std::size_t k = 0; k < patches; ++k) {
      const double distance = (point.at - points_[k].at).squaredNorm();
      if (distance < nearest) {
        nearest = distance;
        point.patch = static_cast<std::uint32_t>(k);
      }
    }
  }
  turn_length_ = std::max(std::sqrt(turning_) * reach_, 1e-6);
}

std::shared_ptr<const ToolShape> make_tool(std::string_view given, const MeshReader& read) {
  const std::string text(given);
  if (text == "ball") return nullptr;
  if (text.find(':') == std::string::npos) refuse(text, "it is no tool");
  const Uri uri(text);
  const std::string& kind = uri.scheme();
  const auto count = static_cast<std::size_t>(uri.number_option(
      "points", double{ToolShape::usual_points}, 4.0, double{ToolShape::most_points}, ""));
  const auto lengths = [&](std::size_t n) { return lengths_of(text, uri.path(), n); };
  Triangles surface;
  constexpr std::array<std::string_view, 11> options = {
      "points", "turning", "margin", "x", "y", "z", "roll", "pitch", "yaw", "unit", "origin"};
  uri.allow_only(std::span(options).first(kind == "mesh" ? options.size() : options.size() - 2));
  if (kind == "mesh") surface = mesh_of(text, uri, read);
  if (kind == "box") {
    std::vector<double> sides = lengths(3);
    std::sort(sides.rbegin(), sides.rend());
    surface = box(Vec3::Zero(), Vec3(sides[0], sides[1], sides[2]));
  } else if (kind == "capsule") {
    const std::vector<double> l = lengths(2);
    if (l[0] < l[1]) refuse(text, "it is shorter than its diameter");
    surface = capsule(l[0], 0.5 * l[1]);
  } else if (kind == "cylinder" || kind == "cone") {
    const std::vector<double> l = lengths(2);
    const double x = 0.5 * l[0], r = 0.5 * l[1];
    surface = turned(
        kind == "cone" ? std::vector<std::array<double, 2>>{{-x, 0.0}, {-x, r}, {x, 0.0}}
                       : std::vector<std::array<double, 2>>{{-x, 0.0}, {-x, r}, {x, r}, {x, 0.0}});
  } else if (kind == "gripper") {
    const std::vector<double> l = lengths(3);
    const Vec3 finger(l[0], l[2], l[2]);
    const Vec3 beside(0.0, 0.5 * (l[1] + l[2]), 0.0);
    surface = together(box(beside, finger), box(-beside, finger));
  } else if (kind != "mesh") {
    refuse(text, "'" + kind + "' is no tool");
  }
  const auto pose = [&](std::string_view key, double most, std::string_view unit) {
    return uri.number_option(key, 0.0, -most, most, unit);
  };
  const auto angle = [&](std::string_view key, const Vec3& axis) {
    return rotation_by(pose(key, std::numbers::pi, "rad") * axis);
  };
  const Rotation turn = product(angle("yaw", Vec3::UnitZ()), product(angle("pitch", Vec3::UnitY()),
                                                                     angle("roll", Vec3::UnitX())));
  const Vec3 at(pose("x", 0.5, "m"), pose("y", 0.5, "m"), pose("z", 0.5, "m"));
  for (Vec3& p : surface.points) p = turn * p + at;
  return std::make_shared<const ToolShape>(
      surface, count, text, uri.number_option("turning", ToolShape::usual_turning, 0.01, 1e3, ""),
      uri.number_option("margin", 0.0, 0.0, 0.05, "m"));
}

}  // namespace palpate
