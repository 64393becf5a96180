// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <system_error>
#include <utility>

#include "palpate/io/sources/depth_png.hpp"
#include "palpate/io/sources/files.hpp"
#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/organised.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/parameters.hpp"

namespace palpate {
namespace {

namespace fs = std::filesystem;

// For example "640x480 points, binary, x float32, y float32, z float32, _ uint8 x 4".
std::string details_of(const PointFile& file) {
  std::string text = size_text(file.width, file.height) + " points, " + file.encoding;
  for (const PointField& field : file.fields) {
    text += ", " + field.name + " " + field.type;
    if (field.count != 1) text += " x " + std::to_string(field.count);
  }
  if (!file.triangles.empty()) text += "; " + std::to_string(file.triangles.size()) + " triangles";
  if (file.bytes_unread != 0)
    text += "; " + std::to_string(file.bytes_unread) + " bytes after them not read";
  return text;
}

// [m] length of one unit of the files
double scale_of(const Uri& uri) { return uri.number_option("scale", 1.0, 1e-9, 1e9, "m"); }

// PCD or PLY files as frames. An organised PCD whose points a pinhole camera could have seen is a
// DepthImage of that camera (fit_camera); all others are a PointCloud, with the faces and normals
// of a PLY and the image layout of an organised PCD beside its points.
class PointFileSource final : public NumberedSource {
 public:
  using Reader = PointFile (*)(const fs::path&);

  // @param scale  [m] length of one unit of the files
  PointFileSource(std::vector<fs::path> files, Reader reader, double scale, SourceInfo info)
      : NumberedSource(std::move(info)), files_(std::move(files)), reader_(reader), scale_(scale) {}

  std::optional<Frame> next(double /*timeout*/) override {
    if (next_ == files_.size()) return std::nullopt;
    const std::size_t k = next_++;  // before anything can throw: the next call takes the file after
    info_.details.clear();
    PointFile file = reader_(files_[k]);
    info_.details = details_of(file);
    for (Vec3& point : file.points) point *= scale_;
    if (file.viewpoint) *file.viewpoint *= scale_;
    const double stamp = static_cast<double>(k) / *info_.frame_rate;
    const bool is_image = file.width > 1 && file.height > 1;
    if (!is_image && file.normals.empty() && file.triangles.empty() && file.colours.empty())
      return Frame{stamp, std::make_shared<PointCloud>(file.points, file.viewpoint)};
    for (Vec3& normal : file.normals) {
      const double length = normal.norm();
      normal = length > 0.0 && std::isfinite(length) ? Vec3(normal / length) : Vec3::Zero();
    }
    const int columns = static_cast<int>(file.width);
    const int rows = static_cast<int>(file.height);
    std::shared_ptr<ColourImage> colour;
    if (!file.colours.empty())
      colour = std::make_shared<ColourImage>(ColourImage{columns, rows, std::move(file.colours)});
    if (is_image) {
      auto image = organised_.image(file.points, file.width, file.height, file.viewpoint);
      if (image) return Frame{stamp, std::move(image), std::move(colour)};
    }
    Surface surface{.points = std::move(file.points),
                    .columns = is_image ? columns : 0,
                    .rows = is_image ? rows : 0,
                    .normals = std::move(file.normals),
                    .triangles = std::move(file.triangles)};
    return Frame{stamp, std::make_shared<PointCloud>(std::move(surface), file.viewpoint),
                 std::move(colour)};
  }

 private:
  std::vector<fs::path> files_;
  Reader reader_;
  double scale_;
  OrganisedClouds organised_;
};

}  // namespace

std::unique_ptr<Source> open_point_files(const Uri& uri) {
  uri.allow_only(std::to_array<std::string_view>({"fps", "scale", "sensor"}));
  const double fps = uri.number_option("fps", 30.0, 1e-3, 1e6, "Hz");
  const double scale = scale_of(uri);
  const bool is_pcd = uri.scheme() == "pcd";
  const std::string kind = is_pcd ? "PCD" : "PLY";

  if (uri.path().empty())
    throw Error(uri.text(), "names no file or folder",
                "write " + uri.scheme() + ":FILE or " + uri.scheme() + ":DIR");
  const fs::path path = uri.path();
  std::error_code error;
  std::vector<fs::path> files{path};
  if (fs::is_directory(path, error)) {
    files = files_in(path, "." + uri.scheme());
    if (files.empty())
      throw Error(path.string(), "holds no ." + uri.scheme() + " file",
                  "name a folder of " + kind + " files, or one file");
  } else if (!fs::exists(path, error)) {
    throw Error(path.string(), "no such file or folder", "check the path");
  }
  SourceInfo info{.uri = uri.text(),
                  .kind = kind + " files",
                  .frames = files.size(),
                  .frame_rate = fps,
                  .sensor = sensor_option(uri, SensorKind::unknown)};
  return std::make_unique<PointFileSource>(std::move(files), is_pcd ? read_pcd : read_ply, scale,
                                           std::move(info));
}

std::string rescaled(const std::string& uri, double times) {
  const Uri parsed(uri);
  constexpr std::array<std::string_view, 4> with_scale{"pcd", "ply", "map", "splat"};
  if (std::find(with_scale.begin(), with_scale.end(), parsed.scheme()) == with_scale.end())
    return {};
  const std::string source = parsed.scheme() + ":" + parsed.path();
  std::string options = uri.substr(source.size());  // empty, or from '?' on
  if (const std::size_t old = options.find("scale="); parsed.has("scale"))
    options.erase(old, options.find('&', old) - old + 1);
  if (options.empty()) options = "?";
  if (options.back() != '?' && options.back() != '&') options += '&';
  return source + options + "scale=" + number_text(times * scale_of(parsed));
}

}  // namespace palpate
