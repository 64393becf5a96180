// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/bag_camera.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdlib>
#include <utility>

#include "palpate/io/sources/depth_png.hpp"
#include "palpate/io/sources/material_file.hpp"
#include "palpate/io/sources/realsense_lens.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {

namespace {

constexpr std::int64_t farthest = 100'000'000;  // [ns] from a depth image

bool is_colour(const BagReader::Topic& topic) {
  const std::string name = lower_case(topic.name);
  return topic.type == ros::Image::type && !is_topic_of_depth(topic.name, topic.type) &&
         (name.find("color") != std::string::npos || name.find("colour") != std::string::npos ||
          name.find("rgb") != std::string::npos);
}

std::ptrdiff_t alike(const std::string& a, const std::string& b) {
  return std::mismatch(a.begin(), a.end(), b.begin(), b.end()).first - a.begin();
}

// The lens that a message tells: a CameraInfo, or a text of librealsense's, whose distortions have
// names of their own.
// @param is_plain      the distortion is left out
// @param is_rectified  as intrinsics_of has it
Intrinsics lens_at(BagReader& bag, const std::string& topic, const BagReader::Place& place,
                   bool is_plain, bool is_realsense, bool is_rectified) {
  const std::string name = bag.name(topic, place);
  const std::vector<std::byte> bytes = bag.read(place);
  RealSenseLens lens;
  if (bag.find(topic)->type == ros::String::type) {
    lens = parse_realsense_lens(ros::decode<ros::String>(bytes, name).data, name);
  } else {
    auto info = ros::decode<ros::CameraInfo>(bytes, name);
    if (!is_plain && !is_realsense) return intrinsics_of(info, is_rectified, name);
    lens.model = info.distortion_model;
    std::copy_n(info.d.begin(), std::min(info.d.size(), lens.coeffs.size()), lens.coeffs.begin());
    info.d.clear();
    lens.pinhole = intrinsics_of(info, false, name);
  }
  return is_plain ? lens.pinhole : intrinsics_of(lens, name);
}

}  // namespace

// The colour images that a bag has beside a topic of depth: rgb8, bgr8, rgba8 and bgra8, with a
// CameraInfo, whose distortion is left out as colour is to be looked at. Where their camera stands
// librealsense's own transforms tell, or TF, or a frame_id that is also that of the depth.
class BagColour {
 public:
  // Their topic, of several the one whose name is most like that of the depth; empty: none.
  static std::string topic_beside(BagReader& bag, const std::string& depth) {
    std::string best;
    for (const BagReader::Topic& topic : bag.topics()) {
      if (!is_colour(topic) || bag.places(topic.name).empty()) continue;
      if (best.empty() || alike(topic.name, depth) > alike(best, depth)) best = topic.name;
    }
    return best;
  }

  // @param frame  of the images of depth, as their headers name it
  // @param pose   of the depth camera by TF; null: not used
  // @throws Error if they cannot be used
  BagColour(BagReader& bag, const std::string& topic, const std::string& depth,
            const std::string& frame, const BagTransforms* pose)
      : bag_(bag), topic_(topic), places_(bag.places(topic)) {
    const std::string camera = camera_of_topic(topic, std::string(ros::Image::type));
    std::string info = camera + "/info/camera_info";
    if (bag.places(info).empty()) info = camera + "/camera_info";
    if (bag.places(info).empty())
      throw Error("topic " + topic, "has no CameraInfo", "record that topic too");
    intrinsics_ = lens_at(bag, info, bag.places(info).front(), true, false, false);
    const std::string name = bag_.name(topic_, places_.front());
    const auto first = ros::decode<ros::Image>(bag_.read(places_.front()), name);
    static_cast<void>(rgb_of(first, name));
    if (const auto first_from_colour = realsense_pose(camera)) {
      const auto first_from_depth = realsense_pose(camera_of_topic(depth, bag.find(depth)->type));
      if (first_from_depth) depth_from_colour_ = first_from_depth->inverse();
      depth_from_colour_ = depth_from_colour_ * *first_from_colour;
      return;
    }
    const std::string& own = first.header.frame_id;
    if (plain_frame(own) == plain_frame(frame)) return;
    if (pose == nullptr)
      throw Error("topic " + topic_, "its camera pose relative to the depth camera is unknown",
                  "record /tf_static, too");
    const bool in_world = !pose->fixed_frame().empty();
    const std::string& fixed = in_world ? pose->fixed_frame() : pose->root();
    colour_in_.emplace(bag_, own, fixed);
    if (!in_world) depth_in_.emplace(bag_, frame, fixed);
  }

  // The image nearest in time, by the times of recording [ns]; null: none is within 0.1 s, or it is
  // damaged. @param stamp  [s] of the depth image, for TF
  [[nodiscard]] std::shared_ptr<const ColourImage> at(std::int64_t nanoseconds, double stamp,
                                                      const Eigen::Isometry3d& world_from_depth) {
    const auto away = [&](const BagReader::Place& place) {
      return std::abs(place.nanoseconds - nanoseconds);
    };
    const auto nearest =
        std::min_element(places_.begin(), places_.end(),
                         [&](const auto& a, const auto& b) { return away(a) < away(b); });
    if (away(*nearest) > farthest) return nullptr;
    ColourImage::Camera camera{intrinsics_, world_from_depth * depth_from_colour_};
    if (colour_in_) {
      const auto in_fixed = colour_in_->at(stamp);
      const auto depth_in_fixed = depth_in_ ? depth_in_->at(stamp) : std::nullopt;
      if (!in_fixed || (depth_in_ && !depth_in_fixed)) return nullptr;
      camera.world_from_camera =
          depth_in_ ? world_from_depth * depth_in_fixed->inverse() * *in_fixed : *in_fixed;
    }
    try {
      const std::string name = bag_.name(topic_, *nearest);
      const auto image = ros::decode<ros::Image>(bag_.read(*nearest), name);
      return std::make_shared<ColourImage>(ColourImage{static_cast<int>(image.width),
                                                       static_cast<int>(image.height),
                                                       rgb_of(image, name), camera});
    } catch (const Error&) {
      return nullptr;
    }
  }

 private:
  // Where the stream stands from the device's first, as librealsense has it; none: not told.
  [[nodiscard]] std::optional<Eigen::Isometry3d> realsense_pose(const std::string& camera) const {
    for (const BagReader::Topic& topic : bag_.topics()) {
      if (!topic.name.starts_with(camera + "/tf/") || topic.type != ros::Transform::type) continue;
      const std::vector<BagReader::Place> places = bag_.places(topic.name);
      if (places.empty()) continue;
      const std::string name = bag_.name(topic.name, places.front());
      const auto told = ros::decode<ros::Transform>(bag_.read(places.front()), name);
      ros::TransformStamped stream_from_first;
      stream_from_first.translation = told.translation;
      stream_from_first.rotation = told.rotation;
      return sample_of(stream_from_first, name).pose().inverse();
    }
    return std::nullopt;
  }

  BagReader& bag_;
  std::string topic_;
  std::vector<BagReader::Place> places_;
  Intrinsics intrinsics_;
  Eigen::Isometry3d depth_from_colour_ = Eigen::Isometry3d::Identity();  // unless TF tells
  std::optional<BagTransforms> colour_in_, depth_in_;  // depth_in_: where the world is its frame
};

namespace {

constexpr double least_unit = 1e-6, largest_unit = 0.1;  // [m] of a RealSense's depth

std::string parent(const std::string& topic) { return topic.substr(0, topic.rfind('/')); }

class Recording final : public NumberedSource {
 public:
  Recording(const Uri& uri, const BagCamera::Options& options, SourceInfo info)
      : NumberedSource(std::move(info)),
        bag_(uri.path()),
        camera_(bag_, choose(uri.text_option("topic", "")), options) {
    if (camera_.frames() == 0)
      throw Error(info_.uri, "holds no frames on " + camera_.topic(),
                  "name another topic with ?topic=");
    info_.kind = camera_.is_ours()        ? "recording of palpate's"
                 : camera_.is_realsense() ? "RealSense recording"
                                          : std::string(bag_.kind());
    info_.sensor = sensor_option(uri, camera_.sensor());
    info_.frames = camera_.frames();
    info_.frame_rate = camera_.frame_rate();
    if (std::string note = camera_.pose_note(); !note.empty())
      info_.notes.push_back(std::move(note));
    if (!camera_.colour_note().empty()) info_.notes.push_back(camera_.colour_note());
    std::optional<Frame> first;
    while (!(first = camera_.frame(next_)) && next_ + 1 < camera_.frames()) ++next_;
    if (!first)
      throw Error(info_.uri, "its TF has no transform for the time of any frame",
                  "ignore TF with ?fixed_frame=none");
    first_ = first->stamp;
    info_.start_time = first_;
  }

  std::optional<Frame> next(double /*timeout*/) override {
    while (next_ < camera_.frames()) {
      std::optional<Frame> frame = camera_.frame(next_++);
      if (!frame) continue;
      frame->stamp -= first_;
      info_.details = camera_.details();
      return frame;
    }
    return std::nullopt;
  }

 private:
  std::string choose(const std::string& wanted) {
    const std::vector<std::string> topics = BagCamera::topics_of(bag_);
    if (!wanted.empty()) return wanted;
    if (topics.empty())
      throw Error(info_.uri, "has no topic of depth images or points",
                  "record one, or name it with ?topic=");
    std::string others;
    for (std::size_t i = 1; i < topics.size(); ++i) others += " " + topics[i];
    if (!others.empty())
      info_.notes.push_back(topics.front() + " is read; also there, by ?topic=:" + others);
    return topics.front();
  }

  BagReader bag_;
  BagCamera camera_;
  double first_ = 0.0;
};

}  // namespace

CameraTopics::CameraTopics(std::size_t number) : CameraTopics("camera_" + std::to_string(number)) {}

CameraTopics::CameraTopics(const std::string& camera) {
  depth = "/" + camera + "/depth/image_raw/compressedDepth";
  camera_info = "/" + camera + "/depth/camera_info";
  points = "/" + camera + "/depth/points";
  exact = "/" + camera + "/depth/exact";
  materials = "/" + camera + "/material/image/compressed";
  material_table = "/" + camera + "/material/table";
  noise = "/" + camera + "/noise/image/compressed";
  optical_frame = camera + "_optical_frame";
}

std::vector<std::string> BagCamera::topics_of(const BagReader& bag) {
  std::vector<std::string> topics;
  for (const BagReader::Topic& topic : bag.topics()) {
    if (is_topic_of_depth(topic.name, topic.type)) topics.push_back(topic.name);
  }
  return topics;
}

BagCamera::BagCamera(BagReader& bag, const std::string& topic, const Options& options)
    : bag_(bag), topic_(topic), options_(options) {
  const BagReader::Topic* found = bag.find(topic);
  if (found == nullptr) {
    std::string known;
    for (const std::string& name : topics_of(bag)) add_to_list(known, name);
    throw Error("topic " + topic, "is not in the bag",
                known.empty() ? "it has no depth images or points" : "give one of " + known);
  }
  type_ = found->type;
  if (type_ != ros::Image::type && type_ != ros::CompressedImage::type &&
      type_ != ros::PointCloud2::type)
    throw Error("topic " + topic, "is of " + type_ + ", not of a camera",
                "name one of Image, CompressedImage or PointCloud2");
  places_ = bag.places(topic);
  const std::string camera = camera_of_topic(topic, type_);
  exact_topic_ = camera + "/exact";
  if (const BagReader::Topic* exact = bag.find(exact_topic_);
      exact != nullptr && exact->type == ros::Float64MultiArray::type)
    exact_places_ = bag.places(exact_topic_);
  if (type_ != ros::PointCloud2::type) find_lens(camera);
  follow_transforms();
  if (type_ != ros::PointCloud2::type && !is_ours() && !places_.empty()) find_colour();
}

BagCamera::~BagCamera() = default;

void BagCamera::find_colour() {
  const std::string topic = BagColour::topic_beside(bag_, topic_);
  if (topic.empty()) return;
  try {
    colour_ = std::make_unique<BagColour>(bag_, topic, topic_, first_header().frame_id,
                                          transforms_ ? &*transforms_ : nullptr);
  } catch (const Error& error) {
    colour_note_ = std::string("colour is skipped: ") + error.what();
  }
}

ros::Header BagCamera::first_header() const {
  const std::vector<std::byte> first = bag_.read(places_.front());
  return type_ == ros::PointCloud2::type ? ros::decode<ros::PointCloud2>(first, name(0)).header
         : type_ == ros::Image::type     ? ros::decode<ros::Image>(first, name(0)).header
                                         : ros::decode<ros::CompressedImage>(first, name(0)).header;
}

void BagCamera::find_lens(const std::string& camera) {
  const std::string in_ros1 = camera + "/info/camera_info";  // librealsense's bags of ROS 1
  is_realsense_ = bag_.find(in_ros1) != nullptr;
  info_topic_ = is_realsense_ ? in_ros1 : camera + "/camera_info";
  info_places_ = bag_.places(info_topic_);
  if (info_places_.empty())
    throw Error("topic " + topic_, "has no CameraInfo on " + info_topic_, "record that topic too");
  is_realsense_ = is_realsense_ || bag_.find(info_topic_)->type == ros::String::type;
  if (!is_realsense_) return;
  const char* name = info_topic_ == in_ros1 ? "Depth Units" : "Depth_Units";
  units_topic_ = parent(camera) + "/option/" + name + "/value";
  units_places_ = bag_.places(units_topic_);
  if (units_places_.empty() && !options_.units)
    throw Error("topic " + topic_, "has no depth unit on " + units_topic_,
                "give the raw values per metre, such as ?units=1000");
}

void BagCamera::follow_transforms() {
  if (is_ours() || is_realsense_ || places_.empty() || options_.fixed_frame == "none") return;
  if (!BagTransforms::are_in(bag_)) {
    if (options_.fixed_frame.empty()) return;
    throw Error("fixed frame " + options_.fixed_frame, "is not in the bag: it has no TF",
                "leave it out");
  }
  transforms_.emplace(bag_, first_header().frame_id, options_.fixed_frame);
}

std::string BagCamera::pose_note() const {
  if (is_ours() || is_realsense_) return {};
  if (!transforms_)
    return std::string(options_.fixed_frame == "none" ? "TF is not used"
                                                      : "the bag has no TF (/tf, /tf_static)") +
           ": points are in the camera frame";
  if (transforms_->fixed_frame().empty())
    return "TF connects none of map, odom and world with the camera: points are in the camera "
           "frame; ?fixed_frame=" +
           transforms_->root() + " transforms them to the topmost TF frame";
  return "points are in " + transforms_->fixed_frame() +
         ", by TF; frames without a transform at their time are dropped";
}

// The identity where TF does not lead to the camera; none where it does, but not at that time.
std::optional<Eigen::Isometry3d> BagCamera::pose_at(double stamp) const {
  if (!transforms_ || transforms_->fixed_frame().empty()) return Eigen::Isometry3d::Identity();
  return transforms_->at(stamp);
}

std::string BagCamera::text(const BagReader::Place& place, const std::string& topic) const {
  return ros::decode<ros::String>(bag_.read(place), bag_.name(topic, place)).data;
}

SensorKind BagCamera::sensor() const {
  if (!is_realsense_) return SensorKind::unknown;
  const std::string device_topic = topic_.substr(0, topic_.find('/', 1)) + "/info";
  const BagReader::Topic* topic = bag_.find(device_topic);
  if (topic == nullptr) return realsense_sensor("");
  std::string product;
  for (const BagReader::Place& place : bag_.places(device_topic)) {
    if (topic->type == ros::KeyValue::type) {
      const auto pair =
          ros::decode<ros::KeyValue>(bag_.read(place), bag_.name(device_topic, place));
      if (pair.key == "Name") product += pair.value;
    } else if (topic->type == ros::String::type) {
      product += text(place, device_topic);
    }
  }
  return realsense_sensor(product);
}

// Raw values per metre at a frame.
double BagCamera::realsense_units(std::size_t number) const {
  BagReader::Place newest = units_places_.front();
  for (const BagReader::Place& place : units_places_) {
    if (place.nanoseconds <= places_[number].nanoseconds) newest = place;
  }
  const std::string name = bag_.name(units_topic_, newest);
  std::string metres;
  if (bag_.find(units_topic_)->type == ros::Float32::type) {
    std::array<char, 32> digits{};  // 0.001, not what is nearest to it in a double
    const float value = ros::decode<ros::Float32>(bag_.read(newest), name).data;
    metres.assign(digits.data(), std::to_chars(digits.begin(), digits.end(), value).ptr);
  } else {
    metres = text(newest, units_topic_);
  }
  double unit = 0.0;
  const auto [end, error] = std::from_chars(metres.data(), metres.data() + metres.size(), unit);
  if (error != std::errc() || !(unit >= least_unit && unit <= largest_unit))
    throw Error(name, "says '" + metres + "' metres for a unit of depth",
                "give the raw values per metre, such as ?units=1000");
  return 1.0 / unit;
}

std::string BagCamera::name(std::size_t number) const { return bag_.name(topic_, places_[number]); }

std::optional<double> BagCamera::frame_rate() const {
  std::vector<std::int64_t> intervals;
  for (std::size_t i = 1; i < places_.size(); ++i)
    intervals.push_back(places_[i].nanoseconds - places_[i - 1].nanoseconds);
  if (intervals.empty()) return std::nullopt;
  const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
  std::nth_element(intervals.begin(), middle, intervals.end());
  if (*middle <= 0) return std::nullopt;
  return 1e9 / static_cast<double>(*middle);
}

double BagCamera::stamp(std::size_t number, const ros::Header& header) const {
  const std::int64_t stamped = header.stamp.nanoseconds();
  return 1e-9 * static_cast<double>(stamped != 0 ? stamped : places_[number].nanoseconds);
}

// The numbers recorded with each frame of palpate's own bags (CameraTopics::exact).
std::vector<double> BagCamera::exact(std::size_t number, std::size_t size) {
  if (number >= exact_places_.size())
    throw Error(name(number), "has no message on " + exact_topic_, "the bag may be damaged");
  const BagReader::Place& place = exact_places_[number];
  const std::string name = bag_.name(exact_topic_, place);
  auto numbers = ros::decode<ros::Float64MultiArray>(bag_.read(place), name).data;
  // Materials, and behind them whether the scale was in doubt, and the noise.
  const bool has_more =
      numbers.size() >= size + 2 && numbers.size() <= size + 4 && type_ != ros::PointCloud2::type;
  if (numbers.size() != size && !has_more)
    throw Error(
        name,
        "has " + std::to_string(numbers.size()) + " numbers instead of " + std::to_string(size),
        "it may be damaged, or of another version of palpate");
  return numbers;
}

const std::shared_ptr<const ViewingRays>& BagCamera::rays(std::size_t number,
                                                          const RosFrame& image) {
  // In other bags the intrinsics are taken to be constant: those of the first CameraInfo.
  const std::size_t which = is_ours() ? number : 0;
  if (which >= info_places_.size())
    throw Error(name(number), "has no message on " + info_topic_, "the bag may be damaged");
  if (!rays_ || is_ours()) {
    const bool is_rectified = !is_ours() && topic_.find("rect") != std::string::npos;
    const Intrinsics k =
        lens_at(bag_, info_topic_, info_places_[which], false, is_realsense_, is_rectified);
    if (!rays_ || !(rays_->intrinsics() == k)) rays_ = std::make_shared<const ViewingRays>(k);
  }
  check_size(rays_->intrinsics(), image.width, image.height, name(number),
             "it may be damaged, or belong to another topic");
  return rays_;
}

// Of palpate's own bags.
Frame BagCamera::own_frame(std::size_t number, RosFrame seen) {
  if (seen.points) {
    const std::vector<double> numbers = exact(number, 6);
    std::optional<Vec3> viewpoint;
    if (numbers[2] != 0.0) viewpoint = Vec3(numbers[3], numbers[4], numbers[5]);
    return Frame{numbers[0], std::make_shared<PointCloud>(*seen.points, viewpoint)};
  }
  const std::shared_ptr<const ViewingRays>& rays = this->rays(number, seen);
  const std::vector<double> numbers = exact(number, 14);
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column)
      world_from_camera(row, column) = numbers[static_cast<std::size_t>(2 + 4 * row + column)];
  }
  auto cloud =
      std::make_shared<DepthImage>(rays, std::move(seen.depth), numbers[1], world_from_camera);
  if (numbers.size() > 14 && numbers[14] != 0.0)
    cloud->set_materials(materials(number, numbers[14], numbers[15]));
  if (numbers.size() > 16) cloud->set_scale_unsure(numbers[16] != 0.0);
  if (numbers.size() > 17) cloud->set_noise(noise(number, numbers[17]));
  return Frame{numbers[0], std::move(cloud)};
}

// The messages are counted from 1.
BagReader::Place BagCamera::changed(std::size_t number, const std::string& topic, double count) {
  std::vector<BagReader::Place>& places = changed_places_[topic];
  if (places.empty() && bag_.find(topic) != nullptr) places = bag_.places(topic);
  if (!(count >= 1.0 && count <= static_cast<double>(places.size())))
    throw Error(name(number), "has no message on " + topic, "the bag may be damaged");
  return places[static_cast<std::size_t>(count) - 1];
}

DepthImage::Noise BagCamera::noise(std::size_t number, double image) {
  if (noise_ && image == noise_image_) return noise_;
  const std::string topic = topics().noise;
  const BagReader::Place place = changed(number, topic, image);
  RosFrame read = ros_frame_of(ros::CompressedImage::type, bag_.read(place),
                               DepthImage::noise_steps, bag_.name(topic, place));
  noise_ = std::make_shared<const std::vector<std::uint16_t>>(std::move(read.depth));
  noise_image_ = image;
  return noise_;
}

// What was recorded of a frame's materials.
std::shared_ptr<const MaterialMap> BagCamera::materials(std::size_t number, double image,
                                                        double table) {
  if (image == material_image_ && table == material_table_) return materials_;
  const CameraTopics topics = this->topics();
  auto names = std::make_shared<MaterialTable>();
  if (table != 0.0) {
    const std::string& topic = topics.material_table;
    const BagReader::Place place = changed(number, topic, table);
    *names = materials_from_json(text(place, topic), bag_.name(topic, place));
  }
  const std::string& topic = topics.materials;
  const BagReader::Place place = changed(number, topic, image);
  const std::string where = bag_.name(topic, place);
  const auto packed = ros::decode<ros::CompressedImage>(bag_.read(place), where);
  const DepthPng png = parse_depth_png(packed.data, where);
  const bool bright = packed.format == material_format_with_brightness;
  std::vector<std::uint8_t> labels;
  std::vector<std::uint8_t> brightness;
  for (const std::uint16_t pixel : png.depth) {
    labels.push_back(static_cast<std::uint8_t>(pixel & 0xffU));
    if (bright) brightness.push_back(static_cast<std::uint8_t>(pixel >> 8U));
  }
  check_size(rays_->intrinsics(), png.width, png.height, where, "it may be damaged");
  materials_ =
      std::make_shared<LabelImage>(std::move(names), std::move(labels), std::move(brightness));
  material_image_ = image;
  material_table_ = table;
  return materials_;
}

std::optional<Frame> BagCamera::frame(std::size_t number) {
  std::optional<double> units = options_.units;
  if (!units && is_realsense_) units = realsense_units(number);
  RosFrame seen = ros_frame_of(type_, bag_.read(places_[number]), units, name(number));
  details_ = seen.details;
  if (is_ours()) return own_frame(number, std::move(seen));
  const double taken = stamp(number, seen.header);
  const std::optional<Eigen::Isometry3d> pose = pose_at(taken);
  if (!seen.points) rays(number, seen);
  if (!pose) return std::nullopt;
  std::shared_ptr<const ColourImage> colour = seen.colour();
  if (colour_) colour = colour_->at(places_[number].nanoseconds, taken, *pose);
  return Frame{taken, cloud_of(std::move(seen), rays_, *pose, organised_), std::move(colour)};
}

std::unique_ptr<Source> open_recording(const Uri& uri) {
  uri.allow_only(std::to_array<std::string_view>({"topic", "units", "fixed_frame", "sensor"}));
  BagCamera::Options options;
  if (uri.has("units")) options.units = uri.number_option("units", 1000.0, 1e-3, 1e7, "px");
  options.fixed_frame = uri.text_option("fixed_frame", "");
  return std::make_unique<Recording>(uri, options, SourceInfo{.uri = uri.text(), .kind = {}});
}

}  // namespace palpate
