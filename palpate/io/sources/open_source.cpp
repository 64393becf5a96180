// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "palpate/io/sources/material_file.hpp"
#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/pose.hpp"
#include "palpate/kernel/core/text.hpp"
#include "palpate/kernel/core/uri.hpp"

namespace palpate {
namespace {

class PosedSource final : public Source {
 public:
  PosedSource(std::unique_ptr<Source> source, const Eigen::Isometry3d& pose, std::string uri)
      : source_(std::move(source)), pose_(pose), uri_(std::move(uri)) {
    look_at_info();
  }

  std::optional<Frame> next(double timeout) override {
    std::optional<Frame> frame = source_->next(timeout);
    look_at_info();
    if (!frame) return frame;
    if (frame->colour && frame->colour->camera)
      frame->colour = posed(*frame->colour, *frame->cloud);
    frame->cloud = posed(*frame->cloud);
    return frame;
  }
  std::size_t skip(std::size_t count) override { return source_->skip(count); }
  void cancel() noexcept override { source_->cancel(); }
  void follow(const Vec3& hand) override { source_->follow(hand); }
  [[nodiscard]] const SourceInfo& info() const override { return info_; }

 private:
  // Its details change from frame to frame.
  void look_at_info() {
    info_ = source_->info();
    if (uri_.empty()) return;
    info_.uri = uri_;
    info_.notes.emplace_back("the camera pose is set by ?pose=; other poses are ignored");
  }
  // A colour camera stays where it is beside the depth camera.
  [[nodiscard]] std::shared_ptr<const ColourImage> posed(const ColourImage& colour,
                                                         const Cloud& cloud) const {
    auto moved = std::make_shared<ColourImage>(colour);
    Eigen::Isometry3d world_from_depth = Eigen::Isometry3d::Identity();
    if (const DepthImage* image = cloud.image()) world_from_depth = image->world_from_camera();
    moved->camera->world_from_camera =
        pose_ * world_from_depth.inverse() * colour.camera->world_from_camera;
    return moved;
  }
  [[nodiscard]] std::shared_ptr<const Cloud> posed(const Cloud& cloud) const {
    if (const DepthImage* image = cloud.image()) {
      auto moved = std::make_shared<DepthImage>(*image);
      moved->set_world_from_camera(pose_);
      return moved;
    }
    const PointCloud* points = cloud.point_cloud();
    if (points == nullptr)
      throw Error(info().uri, "its frames are neither depth images nor points",
                  "remove the camera pose");
    std::optional<Vec3> viewpoint = points->viewpoint();
    if (viewpoint) viewpoint = pose_ * *viewpoint;
    if (const Surface* surface = points->surface()) {
      Surface moved = *surface;
      for (Vec3& point : moved.points) point = pose_ * point;
      for (Vec3& normal : moved.normals) normal = pose_.linear() * normal;
      return std::make_shared<PointCloud>(std::move(moved), viewpoint);
    }
    std::vector<Vec3> moved;
    moved.reserve(points->size());
    for (std::size_t i = 0; i < points->size(); ++i) moved.push_back(pose_ * points->point(i));
    return std::make_shared<PointCloud>(moved, viewpoint);
  }

  std::unique_ptr<Source> source_;
  Eigen::Isometry3d pose_;
  std::string uri_;
  SourceInfo info_;
};

}  // namespace

std::string_view name_of(StampClock clock) noexcept {
  constexpr std::array<std::string_view, 5> names{"recording", "monotonic", "system", "sensor",
                                                  "session"};
  return names[static_cast<std::size_t>(clock)];
}

SensorKind sensor_option(const Uri& uri, SensorKind known) {
  if (!uri.has("sensor")) return known;
  const std::string name = uri.text_option("sensor", "");
  if (const std::optional<SensorKind> kind = sensor_named(name)) return *kind;
  throw Error(uri.text(), "option 'sensor' is '" + name + "'",
              "give stereo, structured-light, time-of-flight or unknown");
}

const Registry<SourceScheme>& standard_sources() {
  static const Registry<SourceScheme> schemes(
      "type of source", ":",
      {{"synthetic", "synthetic:SCENE, a simulated depth camera", open_synthetic},
       {"pcd", "pcd:FILE|DIR, point clouds of the Point Cloud Library", open_point_files},
       {"ply", "ply:FILE|DIR, point clouds and meshes", open_point_files},
       {"map",
        "map:FILE, a mesh (PLY, STL, OBJ, glTF) or volume (NRRD), looked at where the hand is",
        open_map},
       {"splat", "splat:FILE, Gaussians as PLY, SPZ or glTF, looked at where the hand is",
        open_splat},
       {"tum", "tum:DIR, a recording of the TUM RGB-D layout", open_tum},
       {"depth", "depth:DIR|FILE.png, depth images as 16-bit PNG", open_depth},
       {"recording", "recording:BAG, a session of palpate's, or another bag of ROS",
        open_recording}});
  return schemes;
}

std::string uri_of_file(const std::filesystem::path& file) {
  const std::string ending = lower_case(file.extension().string());
  for (auto [known, scheme] :
       {std::pair(".pcd", "pcd:"), std::pair(".ply", "ply:"), std::pair(".stl", "map:"),
        std::pair(".obj", "map:"), std::pair(".spz", "splat:"), std::pair(".glb", "map:"),
        std::pair(".gltf", "map:"), std::pair(".nrrd", "map:"), std::pair(".nhdr", "map:"),
        std::pair(".db3", "recording:"), std::pair(".mcap", "recording:"),
        std::pair(".bag", "recording:")}) {
    if (ending != known) continue;
    if ((ending == ".ply" || is_gltf(file)) && holds_splat(file)) scheme = "splat:";
    const std::string path = file.string();
    return scheme + path + (path.find('?') == std::string::npos ? "" : "?");
  }
  std::string remedy = "give a .pcd, .ply, .stl, .obj, .glb, .nrrd, .spz, .db3, .mcap or .bag file";
  if (ending == ".png" || ending == ".txt")
    remedy = "start the program with --camera depth:FOLDER or tum:FOLDER, of all its images";
  if (ending == ".mkv")
    remedy = "write its depth as 16-bit PNGs, then start the program with --camera depth:FOLDER";
  throw Error(file.filename().string(), "cannot be opened as a single file", remedy);
}

std::string source_uri(const std::string& text, const Registry<SourceScheme>& schemes) {
  namespace fs = std::filesystem;
  std::error_code error;
  if (text.find(':') != std::string::npos) return text;
  if (!fs::exists(text, error)) {
    if (text.find_first_of("./") == std::string::npos) return schemes.with_scheme(text);
    throw Error("'" + text + "'", "there is no such file or folder",
                "check the path; a source that is not a file is SCHEME:, such as synthetic:desk");
  }
  if (!fs::is_directory(text, error)) return uri_of_file(text);
  const fs::path folder(text);
  for (const auto& [file, scheme] :
       {std::pair("depth.txt", "tum:"), std::pair("metadata.yaml", "recording:"),
        std::pair("intrinsics.json", "depth:"), std::pair("../intrinsics.json", "depth:")}) {
    if (fs::exists(folder / file, error)) return scheme + text;
  }
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const fs::path ending = entry.path().extension();
    if (ending == ".pcd" || ending == ".ply") return ending.string().substr(1) + ":" + text;
  }
  throw Error(text, "this folder has nothing to touch",
              "give one with depth.txt (TUM), intrinsics.json and depth images, metadata.yaml "
              "(ROS 2 bag), .pcd or .ply files");
}

std::unique_ptr<Source> open_source(std::string_view text, const Registry<SourceScheme>& schemes) {
  const Uri uri(source_uri(std::string(text), schemes));
  std::optional<Eigen::Isometry3d> pose;
  if (uri.has("pose"))
    pose = parse_pose(uri.text_option("pose", ""), uri.text() + ": option 'pose'");
  std::optional<Materials> materials;
  if (uri.has("material")) materials = materials_of(uri.text_option("material", ""));
  auto source = schemes.find(uri.scheme(), uri.text())
                    .open(uri.without("pose").without("material").without("scale_reference"));
  if (uri.has("scale_reference"))
    source =
        with_scale_reference(std::move(source), uri.text_option("scale_reference", ""), uri.text());
  if (pose) source = with_pose(std::move(source), *pose, uri.text());
  return materials ? with_materials(std::move(source), std::move(*materials)) : std::move(source);
}

std::unique_ptr<Source> with_pose(std::unique_ptr<Source> source,
                                  const Eigen::Isometry3d& world_from_camera, std::string uri) {
  if (source->place(world_from_camera, uri)) return source;
  return std::make_unique<PosedSource>(std::move(source), world_from_camera, std::move(uri));
}

}  // namespace palpate
