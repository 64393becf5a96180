// SPDX-License-Identifier: Apache-2.0
#include <optional>
#include <utility>

#include "palpate/core/error.hpp"
#include "palpate/core/pose.hpp"
#include "palpate/core/text.hpp"
#include "palpate/core/uri.hpp"
#include "palpate/sources/bag_camera.hpp"
#include "palpate/sources/depth_recording.hpp"
#include "palpate/sources/material_file.hpp"
#include "palpate/sources/point_file_source.hpp"
#include "palpate/sources/source.hpp"
#include "palpate/sources/synthetic_camera.hpp"

namespace palpate {

std::string_view name_of(StampClock clock) noexcept {
  switch (clock) {
    case StampClock::recording:
      return "recording";
    case StampClock::monotonic:
      return "monotonic";
    case StampClock::system:
      return "system";
    case StampClock::sensor:
      break;
  }
  return "sensor";
}

SensorKind sensor_option(const Uri& uri, SensorKind known) {
  if (!uri.has("sensor")) return known;
  const std::string name = uri.text_option("sensor", "");
  if (const std::optional<SensorKind> kind = sensor_named(name)) return *kind;
  throw Error(uri.text(), "option 'sensor' is '" + name + "'",
              "give stereo, structured-light, time-of-flight or unknown");
}

std::size_t Source::skip(std::size_t /*count*/) {
  return 0;
}

void Source::cancel() noexcept {}

const Registry<SourceScheme>& standard_sources() {
  static const Registry<SourceScheme> schemes(
      "type of source", ":",
      {{"synthetic", "synthetic:SCENE, a simulated depth camera", open_synthetic},
       {"pcd", "pcd:FILE|DIR, point clouds of the Point Cloud Library", open_point_files},
       {"ply", "ply:FILE|DIR, point clouds and meshes", open_point_files},
       {"tum", "tum:DIR, a recording of the TUM RGB-D layout", open_tum},
       {"depth", "depth:DIR|FILE.png, depth images as 16-bit PNG", open_depth},
       {"recording", "recording:BAG, a session of palpate's, or another bag of ROS",
        open_recording}});
  return schemes;
}

std::string uri_of_file(const std::filesystem::path& file) {
  const std::string ending = lower_case(file.extension().string());
  for (const auto& [known, scheme] :
       {std::pair(".pcd", "pcd:"), std::pair(".ply", "ply:"), std::pair(".db3", "recording:"),
        std::pair(".mcap", "recording:"), std::pair(".bag", "recording:")}) {
    if (ending != known) continue;
    const std::string path = file.string();
    return scheme + path + (path.find('?') == std::string::npos ? "" : "?");
  }
  std::string remedy = "give a .pcd, .ply, .db3, .mcap or .bag file";
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
  auto source =
      schemes.find(uri.scheme(), uri.text()).open(uri.without("pose").without("material"));
  if (pose) source = with_pose(std::move(source), *pose, uri.text());
  return materials ? with_materials(std::move(source), std::move(*materials)) : std::move(source);
}

}  // namespace palpate
