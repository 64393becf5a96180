// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <utility>
#include <vector>

#include "palpate/io/sources/depth_png.hpp"
#include "palpate/io/sources/files.hpp"
#include "palpate/io/sources/intrinsics_file.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/io/sources/trajectory.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t largest_text = std::uintmax_t{1} << 28;

constexpr std::array<std::string_view, 8> distortion_options{"k1", "k2", "p1", "p2",
                                                             "k3", "k4", "k5", "k6"};

struct RecordedImage {
  fs::path file;
  double stamp = 0.0;  // [s]
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  // Images in visible light; empty where none was asked for, or none is near in time.
  fs::path brightness{}, colour{};
  fs::path labels{};  // of materials; empty where none was asked for
};

// Where nobody asked for colour, there is touching without it.
std::string colour_left_out(const Error& error) {
  return std::string("colour is skipped: ") + error.what();
}

class DepthRecording final : public NumberedSource {
 public:
  DepthRecording(const RecordedCamera& camera, std::vector<RecordedImage> images, SourceInfo info,
                 bool colour_is_asked_for)
      : NumberedSource(std::move(info)),
        camera_(camera),
        rays_(std::make_shared<const ViewingRays>(camera.intrinsics)),
        images_(std::move(images)),
        colour_is_asked_for_(colour_is_asked_for) {
    info_.sensor = camera.sensor;
  }

  std::optional<Frame> next(double /*timeout*/) override {
    if (next_ == images_.size()) return std::nullopt;
    const RecordedImage& image = images_[next_++];  // before anything can throw
    DepthPng png = read_depth_png(image.file);
    check(image.file, png);
    std::vector<std::uint8_t> grey;
    if (!image.brightness.empty()) grey = light(image.brightness, false);
    for (const std::uint16_t no_value : {camera_.invalid_value, camera_.saturated_value}) {
      if (is_measured(no_value))
        std::replace(png.depth.begin(), png.depth.end(), no_value, std::uint16_t{0});
    }
    Frame frame{image.stamp,
                std::make_shared<DepthImage>(rays_, std::move(png.depth), camera_.units_per_metre,
                                             image.world_from_camera, std::move(grey))};
    if (!image.labels.empty())
      frame.labels = std::make_shared<const std::vector<std::uint8_t>>(light(image.labels, false));
    if (image.colour.empty()) return frame;
    try {
      const Intrinsics& k = camera_.intrinsics;
      frame.colour = std::make_shared<const ColourImage>(
          ColourImage{k.width, k.height, light(image.colour, true)});
    } catch (const Error& error) {
      if (colour_is_asked_for_) throw;
      for (RecordedImage& each : images_) each.colour.clear();
      info_.notes.push_back(colour_left_out(error));
    }
    return frame;
  }

 private:
  [[nodiscard]] std::vector<std::uint8_t> light(const fs::path& file, bool in_colour) const {
    LightPng png = read_light_png(file, in_colour);
    check(file, png);
    return std::move(png.values);
  }

  template <class Png>
  void check(const fs::path& file, const Png& png) const {
    check_size(camera_.intrinsics, png.width, png.height, file.string(),
               "write an intrinsics.json for this camera");
  }

  RecordedCamera camera_;
  std::shared_ptr<const ViewingRays> rays_;
  std::vector<RecordedImage> images_;
  bool colour_is_asked_for_;
};

void allow_only(const Uri& uri, std::initializer_list<std::string_view> own) {
  std::vector<std::string_view> known(own);
  known.insert(known.end(), {"fx", "fy", "cx", "cy", "units", "sensor", "start", "frames"});
  known.insert(known.end(), distortion_options.begin(), distortion_options.end());
  uri.allow_only(known);
}

void override_camera(const Uri& uri, RecordedCamera& camera) {
  Intrinsics& k = camera.intrinsics;
  k.fx = uri.number_option("fx", k.fx, 1e-3, 1e7, "px");
  k.fy = uri.number_option("fy", k.fy, 1e-3, 1e7, "px");
  k.cx = uri.number_option("cx", k.cx, -1e7, 1e7, "px");
  k.cy = uri.number_option("cy", k.cy, -1e7, 1e7, "px");
  for (std::size_t i = 0; i < k.distortion.size(); ++i)
    k.distortion[i] = uri.number_option(distortion_options[i], k.distortion[i], -1e6, 1e6, "px");
  camera.units_per_metre = uri.number_option("units", camera.units_per_metre, 1e-3, 1e7, "px");
  camera.sensor = sensor_option(uri, camera.sensor);
}

std::size_t count_option(const Uri& uri, std::string_view key, double fallback, double min) {
  const double count = uri.number_option(key, fallback, min, 1e9, "px");
  if (count != std::floor(count))
    throw Error(uri.text(), "option '" + std::string(key) + "' is not a whole number",
                "give a number of frames");
  return static_cast<std::size_t>(count);
}

// Keeps the frames that the options `start` and `frames` select.
void select(const Uri& uri, std::vector<RecordedImage>& images) {
  const std::size_t start = count_option(uri, "start", 0.0, 0.0);
  const std::size_t frames = count_option(uri, "frames", 1e9, 1.0);
  if (start >= images.size())
    throw Error(uri.text(),
                "has " + std::to_string(images.size()) +
                    " frames, none remains after start=" + std::to_string(start),
                "start earlier");
  images.erase(images.begin(), images.begin() + static_cast<std::ptrdiff_t>(start));
  images.resize(std::min(images.size(), frames));
}

// Gives each image the pose at its stamp; those without one are left out, which a note says.
void place(const Uri& uri, const fs::path& file, const std::string& trajectory_name,
           std::vector<RecordedImage>& images, SourceInfo& info) {
  const Trajectory trajectory = parse_trajectory(read_text(file, largest_text), file.string());
  const double delay = uri.number_option("pose_delay", 0.0, -1.0, 1.0, "s");
  const std::size_t all = images.size();
  std::erase_if(images, [&](RecordedImage& image) {
    const auto pose = trajectory.at(image.stamp + delay);
    if (pose) image.world_from_camera = *pose;
    return !pose;
  });
  const std::size_t lost = all - images.size();
  if (images.empty())
    throw Error(uri.text(), "no frame has a pose in " + trajectory_name + " at its timestamp",
                "check that both use the same clock, or give poses=none");
  if (lost > 0)
    info.notes.push_back(std::to_string(lost) + " of " + std::to_string(all) +
                         " frames are dropped: " + trajectory_name +
                         " has no pose at their timestamps");
}

// Gives each depth image the visible one that was taken nearest to it in time; a note says how many
// have none. @param what  "brightness" or "colour", the same as the member
void associate(const fs::path& list, const std::string& what, fs::path RecordedImage::*member,
               std::vector<RecordedImage>& images, SourceInfo& info) {
  constexpr double apart = 0.02;  // [s] at most, as the benchmark's own scripts have it
  const std::vector<StampedFile> listed =
      parse_image_list(read_text(list, largest_text), list.string());
  std::size_t without = 0;
  for (RecordedImage& image : images) {
    const auto off = [&](const StampedFile& file) { return std::abs(file.stamp - image.stamp); };
    const auto nearest =
        std::min_element(listed.begin(), listed.end(),
                         [&](const auto& a, const auto& b) { return off(a) < off(b); });
    if (nearest != listed.end() && off(*nearest) <= apart)
      image.*member = list.parent_path() / nearest->file;
    else
      ++without;
  }
  if (without > 0)
    info.notes.push_back(std::to_string(without) + " of " + std::to_string(images.size()) +
                         " frames have no " + what + ": " + list.filename().string() +
                         " has no image within 20 ms");
}

// Poses that belong to images by their numbers, or none at all, have no stamps to correct.
void refuse_delay(const Uri& uri) {
  if (!uri.has("pose_delay")) return;
  throw Error(uri.text(), "option 'pose_delay' has no trajectory to apply to",
              "give poses=FILE with timestamps, or leave pose_delay out");
}

// Counts stamps from the first image.
void start_clock(std::vector<RecordedImage>& images, SourceInfo& info) {
  info.start_time = images.front().stamp;
  for (RecordedImage& image : images) image.stamp -= info.start_time;
}

double median_rate(const std::vector<RecordedImage>& images) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < images.size(); ++i)
    intervals.push_back(images[i].stamp - images[i - 1].stamp);
  const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
  std::nth_element(intervals.begin(), middle, intervals.end());
  return 1.0 / *middle;
}

}  // namespace

std::unique_ptr<Source> open_tum(const Uri& uri) {
  allow_only(uri, {"poses", "pose_delay", "stamps", "brightness", "colour", "labels"});
  const fs::path folder = uri.path();
  std::error_code error;
  if (uri.path().empty())
    throw Error("'" + uri.text() + "'", "names no folder", "write tum:FOLDER, which has depth.txt");
  if (!fs::is_directory(folder, error))
    throw Error(uri.text(), "is not a folder", "name the folder that holds depth.txt");
  const fs::path list = folder / "depth.txt";
  if (!fs::exists(list, error))
    throw Error(
        uri.text(), "has no depth.txt",
        "name a recording of the TUM RGB-D layout, or write depth:DIR for a folder of PNGs");
  const std::string stamps = uri.text_option("stamps", "relative");
  if (stamps != "relative" && stamps != "absolute")
    throw Error(uri.text(), "option 'stamps' is '" + stamps + "'", "give relative or absolute");

  RecordedCamera camera{
      .intrinsics = {.width = 640, .height = 480, .fx = 525, .fy = 525, .cx = 319.5, .cy = 239.5},
      .units_per_metre = 5000.0};
  const fs::path intrinsics = folder / "intrinsics.json";
  if (fs::exists(intrinsics, error)) camera = read_intrinsics(intrinsics);
  override_camera(uri, camera);

  SourceInfo info{.uri = uri.text(), .kind = "TUM RGB-D recording"};
  std::vector<RecordedImage> images;
  for (const StampedFile& listed : parse_image_list(read_text(list, largest_text), list.string()))
    images.push_back({.file = folder / listed.file, .stamp = listed.stamp});
  select(uri, images);
  const std::string poses = uri.text_option("poses", "groundtruth.txt");
  if (poses != "none") {
    const fs::path file = folder / poses;
    if (!fs::exists(file, error))
      throw Error(uri.text(), "has no " + poses, "use poses=none for the camera frame");
    place(uri, file, poses, images, info);
  } else {
    refuse_delay(uri);
  }
  for (const auto& [what, member] :
       {std::pair("brightness", &RecordedImage::brightness),
        std::pair("colour", &RecordedImage::colour), std::pair("labels", &RecordedImage::labels)}) {
    const bool is_usual =
        what == std::string_view("colour") && fs::exists(folder / "rgb.txt", error);
    const std::string named = uri.text_option(what, is_usual ? "rgb.txt" : "none");
    if (named == "none") continue;
    const fs::path file = folder / named;
    if (!fs::is_regular_file(file, error))
      throw Error(uri.text(), "has no list of images " + file.filename().string(),
                  "name one as depth.txt is, such as " + std::string(what) + "=rgb.txt");
    try {
      associate(file, what, member, images, info);
    } catch (const Error& damaged) {
      if (uri.has(what)) throw;
      info.notes.push_back(colour_left_out(damaged));
    }
  }
  if (images.size() > 1) info.frame_rate = median_rate(images);
  if (stamps == "relative") start_clock(images, info);
  info.frames = images.size();
  return std::make_unique<DepthRecording>(camera, std::move(images), std::move(info),
                                          uri.has("colour"));
}

std::unique_ptr<Source> open_depth(const Uri& uri) {
  allow_only(uri, {"fps", "poses", "pose_delay", "labels", "colour"});
  const fs::path path = uri.path();
  std::error_code error;
  const bool is_folder = fs::is_directory(path, error);
  if (!is_folder && !fs::exists(path, error))
    throw Error(uri.text(), "no such file or folder", "check the path");
  fs::path folder = is_folder ? path : path.parent_path();
  std::vector<fs::path> files{path};
  if (is_folder) {
    if (fs::is_directory(folder / "depth", error)) folder /= "depth";
    files = files_in(folder, ".png");
    if (files.empty())
      throw Error(folder.string(), "holds no PNG", "name a folder of 16-bit PNGs, or one file");
  }

  std::optional<RecordedCamera> camera;
  for (const fs::path& place : {folder, folder / ".."}) {
    const fs::path intrinsics = place / "intrinsics.json";
    if (!camera && fs::exists(intrinsics, error)) camera = read_intrinsics(intrinsics);
  }
  if (!camera) {
    for (const char* key : {"fx", "fy", "cx", "cy", "units"}) {
      if (uri.has(key)) continue;
      throw Error(
          uri.text(),
          "has no intrinsics.json in the image folder or one folder above, and no option '" +
              std::string(key) + "'",
          "give fx, fy, cx, cy [px] and units (raw values per metre)");
    }
    const DepthPng first = read_depth_png(files.front());
    camera.emplace().intrinsics = {.width = first.width, .height = first.height};
  }
  override_camera(uri, *camera);
  const double fps = uri.number_option("fps", camera->frame_rate.value_or(30.0), 1e-3, 1e6, "Hz");

  SourceInfo info{.uri = uri.text(), .kind = is_folder ? "folder of depth images" : "depth image"};
  std::vector<RecordedImage> images;
  for (std::size_t k = 0; k < files.size(); ++k)
    images.push_back({.file = files[k], .stamp = static_cast<double>(k) / fps});
  for (const auto& [what, member] :
       {std::pair("colour", &RecordedImage::colour), std::pair("labels", &RecordedImage::labels)}) {
    if (!uri.has(what)) continue;
    // A folder of images with the names of the depth images, or one image for all of them.
    const fs::path named = (is_folder ? path : folder) / uri.text_option(what, "");
    const bool one = fs::is_regular_file(named, error);
    for (RecordedImage& image : images) {
      const fs::path file = one ? named : named / image.file.filename();
      if (!fs::is_regular_file(file, error))
        throw Error(uri.text(), "there is no " + std::string(what) + " image " + file.string(),
                    "name a folder of PNGs that are called as the depth images are, or one PNG");
      image.*member = file;
    }
  }
  const std::string poses = uri.text_option("poses", "none");
  const fs::path poses_file = (is_folder ? path : folder) / poses;
  const bool matrices = poses != "none" && poses_file.extension() == ".json";
  if (matrices) {
    const auto world_from_camera =
        parse_pose_matrices(read_text(poses_file, largest_text), poses_file.string());
    if (world_from_camera.size() != images.size())
      throw Error(poses_file.string(),
                  "has " + std::to_string(world_from_camera.size()) + " poses for " +
                      std::to_string(images.size()) + " images",
                  "give one for each image");
    for (std::size_t k = 0; k < images.size(); ++k)
      images[k].world_from_camera = world_from_camera[k];
  }
  select(uri, images);
  if (poses != "none" && !matrices)
    place(uri, poses_file, poses, images, info);
  else
    refuse_delay(uri);
  start_clock(images, info);
  info.frames = images.size();
  if (is_folder) info.frame_rate = fps;
  return std::make_unique<DepthRecording>(*camera, std::move(images), std::move(info), true);
}

}  // namespace palpate
