// SPDX-License-Identifier: Apache-2.0
#include "palpate/record/session_writer.hpp"

#include <cmath>
#include <cstring>

#include "palpate/io/bag/messages.hpp"
#include "palpate/io/sources/bag_camera.hpp"
#include "palpate/io/sources/depth_png.hpp"
#include "palpate/io/sources/depth_rvl.hpp"
#include "palpate/io/sources/material_file.hpp"
#include "palpate/io/sources/ros_frames.hpp"
#include "palpate/io/sources/transforms.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {

PackedImage packed_image(const Cloud& image) {
  const DepthImage* depth = image.image();
  if (depth == nullptr) throw Error("cloud", "is not a depth image", "pack depth images alone");
  const Intrinsics& k = depth->intrinsics();
  PackedImage packed{.depth = encode_depth_rvl(k.width, k.height, depth->depth()), .materials = {}};
  if (depth->noise()) packed.noise = encode_depth_rvl(k.width, k.height, *depth->noise());
  const MaterialMap* map = depth->materials().get();
  if (map == nullptr && !depth->has_brightness()) return packed;
  std::vector<std::uint16_t> pixels(depth->depth().size());
  for (int v = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u) {
      const std::size_t i = static_cast<std::size_t>(v) * static_cast<std::size_t>(k.width) +
                            static_cast<std::size_t>(u);
      const Vec3 point = map == nullptr || map->is_by_pixel()
                             ? Vec3(Vec3::Zero())
                             : depth->deproject(u, v).value_or(Vec3::Zero());
      const unsigned label = map == nullptr ? 0U : map->label(i, point);
      const unsigned bright = !depth->has_brightness()                  ? 0U
                              : map != nullptr && map->has_brightness() ? map->brightness(i, point)
                                                                        : depth->brightness()[i];
      pixels[i] = static_cast<std::uint16_t>(label | bright << 8U);
    }
  }
  packed.materials = encode_depth_png(k.width, k.height, pixels);
  return packed;
}

SessionWriter::SessionWriter(const std::filesystem::path& folder, const SessionInfo& info, double t,
                             double commit_interval)
    : epoch_(info.epoch), bag_(folder), commit_interval_(commit_interval) {
  write(session_topic::session, nanoseconds(t), ros::String{to_json(info)}, true);
  commit();
}

template <class Message>
void SessionWriter::write(std::string_view topic, std::int64_t nanoseconds, const Message& message,
                          bool latched) {
  bag_.write(bag_.topic(std::string(topic), Message::type, latched), nanoseconds,
             ros::encode(message));
}

// On the clock of the wall, for whoever sorts messages by it; the exact time is in the message.
std::int64_t SessionWriter::nanoseconds(double t) const {
  constexpr double farthest = 1e9;  // [s]
  if (!(std::abs(t) <= farthest)) return epoch_;
  return epoch_ + std::llround(1e9 * t);
}

void SessionWriter::commands(const ServoCommands& commands, double t) {
  write(session_topic::settings, nanoseconds(t), ros::String{to_json(commands)}, true);
}

void SessionWriter::frame(std::uint64_t number, double stamp, std::size_t index,
                          const std::shared_ptr<const Cloud>& cloud, const PackedImage* packed) {
  if (cameras_.size() <= index) cameras_.resize(index + 1);
  Camera& camera = cameras_[index];
  if (camera.newest != cloud) {
    if (const DepthImage* image = cloud->image()) {
      depth(index, stamp, *image, packed == nullptr ? packed_image(*image) : *packed);
    } else if (const PointCloud* unordered = cloud->point_cloud()) {
      points(index, stamp, *unordered);
    } else {
      throw Error("frame " + std::to_string(number), "has a type that cannot be recorded",
                  "record depth images or points");
    }
    camera.newest = cloud;
    ++camera.frames;
  }
  write(session_topic::frame, nanoseconds(stamp),
        ros::Float64MultiArray{
            .label = "number,stamp,camera,frame",
            .data = {static_cast<double>(number), stamp, static_cast<double>(index),
                     static_cast<double>(camera.frames - 1)}});
  ++frames_;
}

void SessionWriter::left_out(std::uint64_t number, double stamp) {
  // The row of a frame that names no camera.
  write(session_topic::frame, nanoseconds(stamp),
        ros::Float64MultiArray{.label = "number,stamp,camera,frame",
                               .data = {static_cast<double>(number), stamp}});
}

// What has not changed since the camera's frame before is not written again.
void SessionWriter::materials(std::size_t camera, double stamp, const DepthImage& image,
                              const PackedImage& packed) {
  const CameraTopics topics(camera);
  const std::int64_t at = nanoseconds(stamp);
  Camera& written = cameras_[camera];
  const auto table = image.materials() ? image.materials()->table() : nullptr;
  if (table && table != written.table) {
    write(topics.material_table, at, ros::String{materials_json(*table)}, true);
    written.table = table;
    ++written.tables;
  }
  if (packed.materials == written.materials) return;
  write(topics.materials, at,
        ros::CompressedImage{
            .header = {ros::Time::at(at), topics.optical_frame},
            .format = std::string(image.has_brightness() ? material_format_with_brightness
                                                         : material_format),
            .data = packed.materials});
  written.materials = packed.materials;
  ++written.material_images;
}

void SessionWriter::depth(std::size_t camera, double stamp, const DepthImage& image,
                          const PackedImage& packed_image) {
  const CameraTopics topics(camera);
  const Intrinsics& k = image.intrinsics();
  const std::int64_t at = nanoseconds(stamp);
  const ros::Header header{ros::Time::at(at), topics.optical_frame};

  const ros::CompressedImage packed =
      compressed_depth(header, packed_image.depth, image.units_per_metre(), DepthPacking::rvl);

  ros::Float64MultiArray exact{.label = "stamp,units_per_metre,world_from_camera",
                               .data = {stamp, image.units_per_metre()}};
  for (int i = 0; i < 12; ++i) exact.data.push_back(image.world_from_camera()(i / 4, i % 4));
  const bool has_materials = !packed_image.materials.empty();
  if (has_materials) materials(camera, stamp, image, packed_image);
  const bool has_noise = !packed_image.noise.empty();
  Camera& written = cameras_[camera];
  if (has_noise && packed_image.noise != written.noise) {
    write(topics.noise, at,
          compressed_depth(header, packed_image.noise,
                           image.units_per_metre() * DepthImage::noise_steps, DepthPacking::rvl));
    written.noise = packed_image.noise;
    ++written.noise_images;
  }
  if (has_materials || image.scale_unsure() || has_noise) {
    exact.label += ",material_image,material_table";
    exact.data.push_back(has_materials ? static_cast<double>(written.material_images) : 0.0);
    exact.data.push_back(image.materials() ? static_cast<double>(written.tables) : 0.0);
  }
  if (image.scale_unsure() || has_noise) {
    exact.label += ",scale_unsure";
    exact.data.push_back(image.scale_unsure() ? 1.0 : 0.0);
  }
  if (has_noise) {
    exact.label += ",noise_image";
    exact.data.push_back(static_cast<double>(written.noise_images));
  }

  const ros::Header world{header.stamp, std::string(world_frame)};
  write(topics.depth, at, packed);
  write(topics.camera_info, at, camera_info_of(header, k));
  write(topics.exact, at, exact);
  write(session_topic::transforms, at,
        ros::TFMessage{{transform_of(world, topics.optical_frame, image.world_from_camera())}});
}

void SessionWriter::points(std::size_t camera, double stamp, const PointCloud& cloud) {
  const CameraTopics topics(camera);
  const std::int64_t at = nanoseconds(stamp);
  constexpr std::uint8_t float64 = 8;
  constexpr std::uint32_t point_step = 24;
  ros::PointCloud2 message{.header = {ros::Time::at(at), std::string(world_frame)},
                           .width = static_cast<std::uint32_t>(cloud.size()),
                           .fields = {{"x", 0, float64}, {"y", 8, float64}, {"z", 16, float64}},
                           .point_step = point_step,
                           .row_step = static_cast<std::uint32_t>(cloud.size()) * point_step,
                           .data = std::vector<std::byte>(cloud.size() * point_step)};
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const std::array<double, 3> point = components(cloud.point(i));
    std::memcpy(message.data.data() + i * point_step, point.data(), point_step);
  }
  const Vec3 viewpoint = cloud.viewpoint().value_or(Vec3::Zero());
  const ros::Float64MultiArray exact{.label = "stamp,unused,has_viewpoint,viewpoint",
                                     .data = {stamp, 0.0, cloud.viewpoint() ? 1.0 : 0.0,
                                              viewpoint.x(), viewpoint.y(), viewpoint.z()}};
  write(topics.points, at, message);
  write(topics.exact, at, exact);
}

void SessionWriter::adopted(const AdoptedFrame& frame) {
  write(session_topic::adopted, nanoseconds(frame.put_at),
        ros::Float64MultiArray{"number,stamp,put_at,camera,captured,...,tick", row_of(frame)});
}

void SessionWriter::state(const CycleState& state, double t) {
  std::string names;
  for (const std::string& name : cycle_state_names()) names += (names.empty() ? "" : ",") + name;
  const auto end = state.numbers.begin() + static_cast<std::ptrdiff_t>(state.count);
  write(session_topic::state, nanoseconds(t),
        ros::Float64MultiArray{names, std::vector<double>(state.numbers.begin(), end)});
}

void SessionWriter::tick(const ServoTick& tick) {
  const std::int64_t at = nanoseconds(tick.tick.t);
  const ros::Header header{ros::Time::at(at), std::string(world_frame)};
  write(session_topic::tick, at, ros::Float64MultiArray{"tick", row_of(tick)});
  write(session_topic::hip, at, pose_of(header, tick.tick.hip, tick.tick.orientation));
  write(session_topic::proxy, at, pose_of(header, tick.tick.proxy, tick.tick.proxy_orientation));
  write(session_topic::force, at,
        ros::WrenchStamped{header, components(tick.force), components(tick.torque)});
  ++ticks_;
}

void SessionWriter::commit() {
  bag_.commit();
  committed_at_ = monotonic_now();
}

bool SessionWriter::commit_is_due() const {
  return monotonic_now() - committed_at_ >= commit_interval_;
}

bool SessionWriter::commit_if_due() {
  if (!commit_is_due()) return false;
  commit();
  return true;
}

}  // namespace palpate
