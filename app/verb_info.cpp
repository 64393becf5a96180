// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/remarks.hpp"
#include "app/verbs.hpp"
#include "palpate/drivers/drivers.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/pixel_probe.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/cloud/proposed_touch.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/uri.hpp"
#include "palpate/record/replay.hpp"
#include "palpate/session/press.hpp"

namespace palpate::app {
namespace {

using Json = nlohmann::ordered_json;

constexpr double first_frame_timeout = 10.0;  // [s] for a live camera to start up

struct InfoOptions {
  std::string uri;
  bool json = false;
  std::string at;  // "U,V", or empty
};

// To six digits: what a camera measures has fewer.
double rounded(double value) { return std::strtod(fmt::format("{:.6g}", value).c_str(), nullptr); }

Json numbers(const Vec3& v) {
  return Json::array({rounded(v.x()), rounded(v.y()), rounded(v.z())});
}

// What the points of a cloud span: count, corners of their box.
Json extent(const std::vector<Vec3>& points) {
  Eigen::AlignedBox3d box;
  for (const Vec3& point : points) box.extend(point);
  Json json = {{"points", points.size()}};
  if (!points.empty()) {
    json["lowest_m"] = numbers(box.min());
    json["highest_m"] = numbers(box.max());
  }
  return json;
}

Json describe(const DepthImage& image) {
  const Intrinsics& k = image.intrinsics();
  std::vector<std::uint16_t> measured;
  for (const std::uint16_t raw : image.depth()) {
    if (is_measured(raw)) measured.push_back(raw);
  }
  Json json = extent(image.points());
  json["image"] = fmt::format("{}x{}", k.width, k.height);
  json["focal_length_px"] = Json::array({k.fx, k.fy});
  json["principal_point_px"] = Json::array({k.cx, k.cy});
  json["distorted"] = k.distorted();
  json["units_per_metre"] = image.units_per_metre();
  json["brightness"] = !image.brightness().empty();
  json["measured_percent"] = rounded(100.0 * static_cast<double>(measured.size()) /
                                     static_cast<double>(image.depth().size()));
  if (!measured.empty()) {
    const auto middle = measured.begin() + static_cast<std::ptrdiff_t>(measured.size() / 2);
    std::nth_element(measured.begin(), middle, measured.end());
    json["median_depth_m"] = *middle / image.units_per_metre();
  }
  json["camera_at_m"] = numbers(image.world_from_camera().translation());
  return json;
}

Json describe(const PointCloud& cloud) {
  std::vector<Vec3> points;
  const Surface* given = cloud.surface();  // whose faces have further points
  for (std::size_t i = 0; given == nullptr && i < cloud.size(); ++i)
    points.push_back(cloud.point(i));
  if (given != nullptr)
    std::copy_if(given->points.begin(), given->points.end(), std::back_inserter(points),
                 [](const Vec3& point) { return point.allFinite(); });
  Json json = extent(points);
  const ProposedTouch proposed = proposed_touch(cloud);
  json["extent_m"] = rounded(proposed.extent);
  json["spacing_m"] = rounded(proposed.spacing);
  json["proposed_scale"] = rounded(proposed.scale);
  json["proposed_r_c_m"] = rounded(proposed.radius);
  json["non_finite"] = cloud.non_finite();
  if (cloud.viewpoint()) json["seen_from_m"] = numbers(*cloud.viewpoint());
  if (given == nullptr) return json;
  if (given->columns > 0) json["image"] = fmt::format("{}x{}", given->columns, given->rows);
  if (!given->triangles.empty()) {
    json["triangles"] = given->triangles.size();
    json["points_on_triangles"] = cloud.size() - points.size();
  }
  if (!given->normals.empty())
    json["normals"] = std::count_if(given->normals.begin(), given->normals.end(),
                                    [](const Vec3& normal) { return !normal.isZero(); });
  return json;
}

Json describe(const PixelProbe& probe, int u, int v) {
  Json json = {{"pixel", Json::array({u, v})}, {"hole", !probe.in_world}};
  if (probe.depth) json["depth_m"] = rounded(*probe.depth);
  if (probe.in_camera) json["in_camera_m"] = numbers(*probe.in_camera);
  if (probe.in_world) json["in_world_m"] = numbers(*probe.in_world);
  if (probe.normal) {
    json["normal"] = numbers(*probe.normal);
    json["normal_from_px"] = 2 * probe.normal_radius + 1;
  }
  json["neighbours"] = probe.neighbours;
  json["neighbours_measured"] = probe.measured;
  return json;
}

Json describe_pixel(const Cloud& cloud, const std::string& text, const std::string& uri) {
  const auto [u, v] = parse_pixel(text, "--at");
  if (const DepthImage* image = cloud.image()) return describe(probe_pixel(*image, u, v), u, v);
  if (const PointCloud* points = cloud.point_cloud();
      points != nullptr && points->surface() != nullptr && points->surface()->columns > 0)
    return describe(probe_pixel(*points, u, v), u, v);
  throw Error(uri, "its points are not an image, so there is no pixel " + text,
              "remove --at, or use a source of depth images");
}

void print(const Json& object, const std::string& indent) {
  for (const auto& [key, value] : object.items()) {
    if (value.is_object()) {
      fmt::print("{}{}:\n", indent, key);
      print(value, indent + "  ");
    } else {
      fmt::print("{}{}: {}\n", indent, key,
                 value.is_string() ? value.get<std::string>() : value.dump());
    }
  }
}

int info(InfoOptions options) {
  if (options.uri.empty())
    throw Error(
        "info", "no source is given",
        "name one, such as `palpate info synthetic:desk`; docs/sources.md lists all sources");
  options.uri = source_uri(options.uri, all_sources());
  const std::unique_ptr<Source> source = open_source(options.uri, all_sources());
  const SourceInfo& about = source->info();
  Json json = {{"uri", about.uri}, {"kind", about.kind}, {"live", about.live}};
  if (about.live) json["clock"] = name_of(about.clock);
  if (about.sensor != SensorKind::unknown) json["sensor"] = name_of(about.sensor);
  json["usual_noise"] = noise_text(about.sensor);
  if (about.frames) json["frames"] = *about.frames;
  if (about.frame_rate) json["frame_rate_hz"] = *about.frame_rate;
  if (about.start_time != 0.0) json["start_time_s"] = about.start_time;
  // Before a damaged frame ends it.
  if (const Uri uri(options.uri); uri.scheme() == "recording") {
    json["checksums"] = text_of(BagReader(uri.path()).check());
    if (!options.json) fmt::print("checksums: {}\n", json["checksums"].get<std::string>());
  }
  const auto frame = source->next(first_frame_timeout);
  if (!frame && about.live)
    throw Error(options.uri, fmt::format("it has delivered no frame in {} s", first_frame_timeout),
                "check the camera, its cable and its permissions");
  if (!frame) throw Error(options.uri, "it has no frames", "use a source with at least one frame");
  if (!about.assumed.empty()) json["assumed"] = about.assumed;
  if (!about.notes.empty()) json["notes"] = about.notes;  // a live camera's come with its frame
  Json first = {{"stamp_s", frame->stamp}};
  if (!about.details.empty()) first["details"] = about.details;
  if (const DepthImage* image = frame->cloud->image()) {
    first.update(describe(*image));
    if (about.frames != 1 && image->world_from_camera().matrix().isIdentity(0.0))
      json["poses"] = "none: the world frame is the camera frame, so the HIP moves with the camera";
  } else if (const PointCloud* cloud = frame->cloud->point_cloud()) {
    first.update(describe(*cloud));
    const std::string remark = sparse_remark(*cloud, options.uri, proposed_touch(*cloud).radius);
    if (!remark.empty()) json["advice"] = remark;
  }
  if (frame->colour)
    first["colour"] = fmt::format("{}x{}", frame->colour->width, frame->colour->height);
  json["first_frame"] = first;
  if (!options.at.empty()) json["at"] = describe_pixel(*frame->cloud, options.at, options.uri);

  if (options.json)
    fmt::print("{}\n", json.dump(2));
  else
    print(json, "");
  return 0;
}

}  // namespace

Verb add_info(CLI::App& program) {
  CLI::App* command = program.add_subcommand("info", "what is in a source");
  const auto options = std::make_shared<InfoOptions>();
  command->add_option("source", options->uri, "e.g. tum:DIR, pcd:FILE, synthetic:desk");
  command->add_flag("--json", options->json, "print a JSON object");
  command->add_option("--at", options->at,
                      "U,V: what is at this pixel of the first frame: depth [m], point in the "
                      "camera's and the world's frame, normal, measured neighbours");
  return {command, [options] { return info(*options); }};
}

}  // namespace palpate::app
