// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "palpate/io/bag/compression.hpp"
#include "palpate/io/sources/files.hpp"
#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/point_file_detail.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace {

constexpr const char* write_again = "write the volume again as NRRD: raw or gzip, numbers, 3 axes";
constexpr std::uint64_t most_voxels = std::uint64_t{1} << 20U;  // [voxels] products do not overflow

struct Volume {
  const detail::Scalar* type = nullptr;
  std::array<std::size_t, 3> sizes{};  // [voxels]
  std::endian order = std::endian::little;
  bool is_gzip = false;
  Eigen::Matrix3d steps = Eigen::Matrix3d::Identity();  // from a voxel to the next ones
  Vec3 origin = Vec3::Zero();                           // of the first voxel
  std::string data_file;                                // empty: behind the header
  std::vector<float> values;                            // above the level; NaN: unseen

  [[nodiscard]] std::uint64_t count() const {
    return std::uint64_t{sizes[0]} * sizes[1] * sizes[2];
  }
};

// "unsigned short int", "uint16_t", "ushort" and others are names of the same.
const detail::Scalar* type_named(std::string name) {
  std::erase(name, ' ');
  if (name.starts_with("unsigned")) name.replace(0, 8, "u");
  if (name.starts_with("signed")) name.erase(0, 6);
  if (name.ends_with("_t")) name.resize(name.size() - 2);
  if (name.ends_with("int") && name.size() > 4) name.resize(name.size() - 3);
  if (name.ends_with("longlong")) name.replace(name.size() - 8, 8, "int64");
  return detail::find_scalar(
      [&](const auto& each) { return !name.empty() && (each.name == name || each.ply == name); });
}

void take_field(const detail::Cursor& file, const std::string& key, std::string value,
                Volume& volume) {
  const auto fail = [&](const std::string& reason) {
    file.fail_in_line("'" + key + "' is " + detail::quoted(value) + ": " + reason, write_again);
  };
  const auto numbers = [&](std::size_t count) {
    std::vector<double> all = detail::to_numbers(value, count);
    if (all.empty()) fail("it has to be " + std::to_string(count) + " numbers, for 3 axes");
    return all;
  };
  if (key == "type") {
    volume.type = type_named(value);
    if (volume.type == nullptr) fail("it is no type of numbers");
  } else if (key == "dimension") {
    if (value != "3") fail("a volume has 3 axes, and one value in each voxel");
  } else if (key == "sizes") {
    const std::vector<double> sizes = numbers(3);
    for (std::size_t i = 0; i < 3; ++i) {
      if (!(sizes[i] >= 2.0 && sizes[i] <= double{most_voxels} && sizes[i] == std::floor(sizes[i])))
        fail("each axis has 2 to " + std::to_string(most_voxels) + " voxels");
      volume.sizes[i] = static_cast<std::size_t>(sizes[i]);
    }
  } else if (key == "encoding") {
    volume.is_gzip = value == "gzip" || value == "gz";
    if (!volume.is_gzip && value != "raw") fail("raw and gzip are read");
  } else if (key == "endian") {
    volume.order = value == "big" ? std::endian::big : std::endian::little;
  } else if (key == "spacings") {
    volume.steps = Vec3(numbers(3).data()).asDiagonal();
  } else if (key == "space directions") {
    volume.steps = Eigen::Matrix3d(numbers(9).data());
  } else if (key == "space origin") {
    volume.origin = Vec3(numbers(3).data());
  } else if (key == "data file" || key == "datafile") {
    volume.data_file = value;
  } else if ((key.starts_with("byte") || key.starts_with("line")) && key.ends_with("skip")) {
    if (value != "0") fail("nothing can be skipped");
  }
}

Volume read_header(detail::Cursor& file) {
  const auto first = file.next_line();
  if (!first || !first->starts_with("NRRD000"))
    file.fail("it is no NRRD: it does not begin with NRRD000", "give a volume as FILE.nrrd");
  Volume volume;
  while (const auto line = file.next_line()) {
    if (line->empty()) break;
    const std::size_t colon = line->find(": ");
    if (line->front() == '#' || colon == std::string_view::npos) continue;
    std::string value(line->substr(colon + 2));
    value.erase(0, value.find_first_not_of(' '));
    value.erase(value.find_last_not_of(" \r") + 1);
    take_field(file, lower_case(line->substr(0, colon)), value, volume);
  }
  if (volume.type == nullptr || volume.count() == 0)
    file.fail("its header lacks 'type' or 'sizes'", write_again);
  if (!(std::abs(volume.steps.determinant()) > 0.0))
    file.fail("its axes do not span a volume", "correct 'space directions' or 'spacings'");
  return volume;
}

// At level 0 values are distances, and the largest is where they end: nothing was seen there.
void take_values(Volume& volume, const std::byte* at, double level) {
  constexpr float unseen = std::numeric_limits<float>::quiet_NaN();
  volume.values.resize(volume.count());
  double most = 0.0;
  for (float& value : volume.values) {
    const double stored = volume.type->value(at, volume.order);
    at += volume.type->size;
    value = std::isfinite(stored) ? static_cast<float>(stored - level) : unseen;
    if (std::isfinite(value)) most = std::max(most, std::abs(double{value}));
  }
  constexpr double nearly = 0.999;  // of the end, by which the two signs may differ
  if (level != 0.0) return;
  for (float& value : volume.values)
    if (!(std::abs(double{value}) < nearly * most)) value = unseen;
}

// Surface nets: in each cell of eight voxels that the surface passes, a point in the middle of
// where it crosses the cell's edges; about each crossed edge, a face through its four cells'
// points.
class SurfaceNet {
 public:
  SurfaceNet(const Volume& volume, PointFile& mesh) : volume_(volume), mesh_(mesh) {
    const auto& n = volume.sizes;
    for (auto& layer : points_) layer.resize(n[0] * n[1]);
    Place p{};
    for (p[2] = 0; p[2] + 1 < n[2]; ++p[2]) {
      for (p[1] = 0; p[1] + 1 < n[1]; ++p[1])
        for (p[0] = 0; p[0] + 1 < n[0]; ++p[0]) add_point(p);
      for (p[1] = 0; p[1] + 1 < n[1]; ++p[1])
        for (p[0] = 0; p[0] + 1 < n[0]; ++p[0])
          for (std::size_t axis = 0; axis < 3; ++axis) add_face(p, axis);
    }
  }

 private:
  using Place = std::array<std::size_t, 3>;

  [[nodiscard]] float value(const Place& p) const {
    return volume_.values[(p[2] * volume_.sizes[1] + p[1]) * volume_.sizes[0] + p[0]];
  }
  std::uint32_t& point(const Place& cell) {
    return points_[cell[2] % 2][cell[1] * volume_.sizes[0] + cell[0]];
  }
  // Where between two neighbours the surface is; none if it is not, or one of them is unseen.
  static std::optional<double> crossing(float a, float b) {
    if (std::isnan(a) || std::isnan(b) || (a < 0.0F) == (b < 0.0F)) return std::nullopt;
    return double{a} / (double{a} - double{b});
  }

  void add_point(const Place& cell) {
    Vec3 sum = Vec3::Zero();
    int count = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t corner = 0; corner < 8; ++corner) {
        if ((corner >> axis & 1U) != 0) continue;
        Place a{cell[0] + (corner & 1U), cell[1] + (corner >> 1U & 1U), cell[2] + (corner >> 2U)};
        Place b = a;
        ++b[axis];
        const auto along = crossing(value(a), value(b));
        if (!along) continue;
        const auto k = static_cast<Eigen::Index>(axis);
        sum +=
            Vec3(static_cast<double>(a[0]), static_cast<double>(a[1]), static_cast<double>(a[2])) +
            *along * Vec3::Unit(k);
        ++count;
      }
    }
    if (count == 0) return;
    point(cell) = static_cast<std::uint32_t>(mesh_.points.size());
    mesh_.points.emplace_back(volume_.origin + volume_.steps * (sum / count));
  }

  // About the edge from `p` along `axis`: none at the border, where cells are missing.
  void add_face(const Place& p, std::size_t axis) {
    const std::size_t i = (axis + 1) % 3, j = (axis + 2) % 3;
    Place next = p;
    ++next[axis];
    if (p[i] == 0 || p[j] == 0 || !crossing(value(p), value(next))) return;
    std::array<std::uint32_t, 4> corners{};
    for (std::size_t k = 0; k < 4; ++k) {  // once round the axis
      Place cell = p;
      cell[i] -= k == 0 || k == 3 ? 1 : 0;
      cell[j] -= k < 2 ? 1 : 0;
      corners[k] = point(cell);
    }
    // Values rise to the outside.
    if ((value(p) < 0.0F) != (volume_.steps.determinant() > 0.0)) std::swap(corners[1], corners[3]);
    mesh_.triangles.push_back({corners[0], corners[1], corners[2]});
    mesh_.triangles.push_back({corners[0], corners[2], corners[3]});
  }

  const Volume& volume_;
  PointFile& mesh_;
  // Numbers of the points of the cells of this layer and the one below.
  std::array<std::vector<std::uint32_t>, 2> points_;
};

}  // namespace

PointFile parse_nrrd(std::span<const std::byte> bytes, std::string_view name,
                     const std::filesystem::path& folder, double level) {
  detail::Cursor file(bytes, name);
  Volume volume = read_header(file);
  const std::uint64_t size = volume.count() * volume.type->size;
  std::vector<std::byte> other;
  std::span<const std::byte> data = bytes.last(file.left());
  if (!volume.data_file.empty())
    data = other = detail::read_beside(folder, volume.data_file, std::string(name));
  if (size > (volume.is_gzip ? detail::most_inflated(data.size()) : data.size()))
    file.fail("its header promises " + std::to_string(size) + " bytes of voxels, more than its " +
                  std::to_string(data.size()) + " can hold",
              detail::cut_short);
  if (volume.is_gzip) {
    data = other = decompress_gzip(data, static_cast<std::size_t>(size), std::string(name));
    if (data.size() < size) file.fail("ends within its voxels", detail::cut_short);
  }
  take_values(volume, data.data(), level);
  PointFile mesh;
  mesh.encoding = volume.is_gzip ? "gzip" : "raw";
  const SurfaceNet net(volume, mesh);
  if (mesh.triangles.empty())
    file.fail("no surface: its values do not pass " + number_text(level) + " where it was seen",
              "give the value at the surface as ?level=");
  mesh.width = mesh.points.size();
  return mesh;
}

bool is_nrrd(const std::filesystem::path& path) {
  const std::string ending = lower_case(path.extension().string());
  return ending == ".nrrd" || ending == ".nhdr";
}

PointFile read_nrrd(const std::filesystem::path& path, double level) {
  return parse_nrrd(read_file(path, detail::largest_file), path.string(), path.parent_path(),
                    level);
}

}  // namespace palpate
