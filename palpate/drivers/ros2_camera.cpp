// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "palpate/drivers/dds.hpp"
#include "palpate/drivers/link_estimates.hpp"
#include "palpate/drivers/live_camera.hpp"
#include "palpate/drivers/ros2.hpp"
#include "palpate/drivers/ros2_publisher.hpp"
#include "palpate/io/sources/depth_png.hpp"
#include "palpate/io/sources/depth_rvl.hpp"
#include "palpate/io/sources/ros_frames.hpp"
#include "palpate/io/sources/transforms.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/organised.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/text.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {
namespace ros2 {
namespace {

constexpr double least_patience = 0.05;  // [s] between two looks at what is published
// [s] for which a frame waits for a transform that covers it: /tf comes at 10 to 100 Hz
constexpr double longest_wait_for_tf = 0.1;
constexpr double kept_transforms = 5.0;  // [s] before the newest
constexpr double time_to_settle = 2.0;   // [s] within which TF leads to a camera
// [s] within which other nodes are heard of: one that publishes TF may be heard after the camera
constexpr double time_to_be_heard = 1.0;
constexpr double time_to_answer = 1.0;  // [s] of a camera's machine that is asked for its time
// [s] between two questions for the time of a camera's machine: at first, and later, when 100 ppm
// make 0.05 ms of it
constexpr double first_pause = 0.02, later_pause = 0.5;
constexpr int first_questions = 10;
// [s] after its last slice for which an image waits for those that are missing
constexpr double patience_of_slices = 0.01;
constexpr double least_of_image = 0.5;   // share of its rows without which an image is left out
constexpr double report_pause = 0.1;     // [s]
constexpr double least_growth = 0.5e-3;  // [-] by which the least delay grows: clocks drift
constexpr dds::Quality best_effort{};
constexpr dds::Quality many{.depth = 2048};  // slices of some images
// /tf has a message from each of its nodes: the last one alone would lose theirs
constexpr dds::Quality of_tf{.reliable = true, .depth = 100};
constexpr dds::Quality of_static_tf{.reliable = true, .keeps_for_late = true, .depth = 100};

struct CameraOptions {
  std::string uri = {}, topic = {}, info_topic = {}, fixed_frame = {}, stamps = {};
  std::optional<double> units = {};  // [1/m]
  double patience = 5.0;             // [s] for the camera to be there
  bool reliable = false;             // what is lost on the way is sent again
};

CameraOptions camera_options(const Uri& uri) {
  uri.allow_only(std::to_array<std::string_view>(
      {"reliable", "info", "units", "fixed_frame", "stamps", "wait", "sensor"}));
  CameraOptions wanted{.uri = uri.text(), .topic = uri.path()};
  if (wanted.topic.size() < 2 || wanted.topic.front() != '/')
    throw Error(uri.text(), "names no topic",
                "write ros2:/camera/camera/depth/image_rect_raw; palpate doctor lists those of "
                "depth that are published");
  wanted.info_topic = uri.text_option("info", "");
  wanted.reliable = uri.has("reliable");
  if (uri.has("units")) wanted.units = uri.number_option("units", 1000.0, 1.0, 1e6);
  wanted.fixed_frame = uri.text_option("fixed_frame", "");
  wanted.patience = uri.number_option("wait", wanted.patience, 0.1, 600.0, "s");
  wanted.stamps = uri.text_option("stamps", "");
  if (!wanted.stamps.empty() && wanted.stamps != "system" && wanted.stamps != "sensor")
    throw Error(uri.text(), "stamps=" + wanted.stamps + " is not known",
                "write stamps=system, or stamps=sensor for a camera with a clock of its own");
  return wanted;
}

bool is_of_camera(const std::string& type) {
  return type == ros::Image::type || type == ros::CompressedImage::type ||
         type == ros::PointCloud2::type;
}

// Asks the machine of a palpate that serves a camera what time it is.
class RemoteClock {
 public:
  RemoteClock(dds::Participant& participant, const std::string& camera, const std::string& uri)
      : questions_(participant, clock_question_topic(camera), ros::TimeReference{}, best_effort),
        answers_(participant, clock_answer_topic(camera), ros::TimeReference{}, best_effort),
        id_(uri + " " + std::to_string(nanoseconds(monotonic_now()))) {}

  // Takes what was answered, and asks when it is time to.
  void look() {
    while (const auto answer = answers_.take<ros::TimeReference>()) {
      if (answer->source != id_) continue;  // somebody else's
      relation_.add(answer->time_ref.seconds(), answer->header.stamp.seconds(), monotonic_now());
    }
    const double now = monotonic_now();
    if (now < next_) return;
    next_ = now + (asked_ < first_questions ? first_pause : later_pause);
    if (questions_.readers() == 0) return;
    ++asked_;
    questions_.write(ros::TimeReference{.header = {ros::Time::at(nanoseconds(monotonic_now())), ""},
                                        .time_ref = {},
                                        .source = id_});
  }
  [[nodiscard]] bool is_known() const { return relation_.is_known() && asked_ >= first_questions; }
  [[nodiscard]] const ClockRelation& relation() const { return relation_; }
  // [s] until the next question.
  [[nodiscard]] double pause() const { return std::max(next_ - monotonic_now(), 0.0); }

 private:
  static std::int64_t nanoseconds(double seconds) {
    return static_cast<std::int64_t>(std::llround(1e9 * seconds));
  }

  dds::Writer questions_;
  dds::Reader answers_;
  std::string id_;
  ClockRelation relation_;
  double next_ = 0.0;  // [s, monotonic] of a question
  int asked_ = 0;
};

// Puts a camera's slices together, and tells it how they come.
class SliceReader {
 public:
  SliceReader(dds::Participant& participant, const std::string& topic, const std::string& camera)
      : slices_(participant, topic, ros::CompressedImage{}, many),
        reports_(participant, report_topic(camera), ros::Float64MultiArray{}, best_effort) {}

  // Of an image: its header and its format are those of its last slice.
  struct Taken {
    SliceAssembler::Image image;
    ros::Header header;
    std::string format;
  };

  // The newest image that is as whole as it will be, if any.
  // @throws Error if a message is none of a slice, or damaged
  std::optional<Taken> take(const std::string& name) {
    std::optional<SliceAssembler::Image> newest;
    ros::Header header = header_;
    while (const auto message = slices_.take<ros::CompressedImage>()) {
      if (!is_depth_slice(*message))
        throw Error(name, "is an image of format '" + message->format + "', not a slice of depth",
                    "name a topic that palpate serve-camera publishes");
      const double stamp = message->header.stamp.seconds();
      if (auto before = assembler_.add(message->data, stamp, monotonic_now(), name)) {
        count(*before);
        newest = std::move(before);
        header = header_;
      }
      header_ = message->header;
      format_ = message->format;
    }
    const double now = monotonic_now();
    if (auto image = assembler_.take(now, patience_of_slices)) {
      count(*image);
      newest = std::move(image);
      header = header_;
    }
    report(now);
    if (!newest || newest->missing > (1.0 - least_of_image) * newest->height) return std::nullopt;
    return Taken{std::move(*newest), header, format_};
  }

  // [s] for which it may be waited at most.
  [[nodiscard]] double pause() const {
    const std::optional<double> since = assembler_.waits_since();
    return since ? std::max(*since + patience_of_slices - monotonic_now(), 0.0) : report_pause;
  }

 private:
  void count(const SliceAssembler::Image& image) {
    const std::uint32_t lost = number_ ? image.number - *number_ - 1 : 0;
    number_ = image.number;
    expected_ += image.height * (1.0 + std::min(lost, 100U));
    received_ += image.height - image.missing;
    const double delay = image.last_slice - image.stamp;  // and what the clocks differ by
    least_delay_ = std::min(delay, least_delay_ + least_growth * (image.last_slice - last_slice_));
    last_slice_ = image.last_slice;
    lateness_[0] = std::min(lateness_[0], delay - least_delay_);
  }

  void report(double now) {
    if (now < next_report_ || expected_ == 0.0) return;
    next_report_ = now + report_pause;
    const double lateness = *std::min_element(lateness_.begin(), lateness_.end());
    const auto heard = static_cast<double>(assembler_.rows_heard() - rows_reported_);
    rows_reported_ = assembler_.rows_heard();
    reports_.write(ros::Float64MultiArray{"received,lateness,heard",
                                          {received_ / expected_, lateness, heard / expected_}});
    expected_ = received_ = 0.0;
    std::rotate(lateness_.begin(), lateness_.end() - 1, lateness_.end());
    lateness_[0] = std::numeric_limits<double>::infinity();
  }

  dds::Reader slices_;
  dds::Writer reports_;
  SliceAssembler assembler_;
  ros::Header header_;  // of the last slice
  std::string format_;
  std::optional<std::uint32_t> number_;     // of the last image
  double expected_ = 0.0, received_ = 0.0;  // rows since the last report
  // [s] least since the last report, and before the two before: a queue that does not empty makes
  // all of them late, a link that holds some of them up does not
  std::array<double, 3> lateness_{};
  double least_delay_ = std::numeric_limits<double>::infinity();  // [s]
  std::uint64_t rows_reported_ = 0;
  double last_slice_ = 0.0, next_report_ = 0.0;  // [s, monotonic]
};

class Camera final : public LiveCamera {
 public:
  explicit Camera(const Uri& uri)
      : LiveCamera({.uri = uri.text(), .kind = "ROS 2"}),
        wanted_(camera_options(uri)),
        participant_(uri.text()),
        opened_(monotonic_now()) {
    info_.sensor = sensor_option(uri, SensorKind::unknown);
    info_.clock = wanted_.stamps == "sensor" ? StampClock::sensor : StampClock::system;
    const std::string type = wait_for_type();
    info_.kind = "ROS 2, " + type;
    info_name_ = wanted_.info_topic.empty() ? camera_of_topic(wanted_.topic, type) + "/camera_info"
                                            : wanted_.info_topic;
    const dds::Quality quality{.reliable = wanted_.reliable};
    type_ = type;
    if (wanted_.topic.ends_with("/slices"))
      slices_.emplace(participant_, wanted_.topic, camera_of_topic(wanted_.topic, type));
    else if (type == ros::Image::type)
      frames_.emplace(participant_, wanted_.topic, ros::Image{}, quality);
    else if (type == ros::CompressedImage::type)
      frames_.emplace(participant_, wanted_.topic, ros::CompressedImage{}, quality);
    else
      frames_.emplace(participant_, wanted_.topic, ros::PointCloud2{}, quality);
    if (type != ros::PointCloud2::type)
      lenses_.emplace(participant_, info_name_, ros::CameraInfo{}, best_effort);
    if (wanted_.fixed_frame != "none") {
      tf_.emplace(participant_, std::string(transforms_topic), ros::TFMessage{}, of_tf);
      static_tf_.emplace(participant_, std::string(static_transforms_topic), ros::TFMessage{},
                         of_static_tf);
    }
    if (wanted_.stamps.empty()) relate_clocks(camera_of_topic(wanted_.topic, type));
  }

 private:
  std::string wait_for_type() {
    const double end = monotonic_now() + wanted_.patience;
    for (;;) {
      const std::vector<dds::Publication> heard = participant_.publications();
      std::string others;
      std::string other_type;
      for (const dds::Publication& one : heard) {
        if (one.topic == wanted_.topic) {
          if (is_of_camera(one.type)) return one.type;
          other_type = one.type;
        }
        if (is_topic_of_depth(one.topic, one.type)) add_to_list(others, one.topic);
      }
      if (!other_type.empty())
        throw Error(wanted_.uri, wanted_.topic + " is of " + other_type + ", not of a camera",
                    "name a topic of Image, CompressedImage or PointCloud2");
      if (monotonic_now() > end)
        throw Error(wanted_.uri,
                    "nobody publishes " + wanted_.topic + " in domain " +
                        std::to_string(participant_.domain()),
                    others.empty()
                        ? "start the camera's driver, or set ROS_DOMAIN_ID to its domain; nothing "
                          "of depth is published there"
                        : "there are: " + others);
      participant_.wait(least_patience);
    }
  }

  // A camera that palpate serves is heard of after its clock.
  void relate_clocks(const std::string& camera) {
    if (!hears(
            [topic = clock_answer_topic(camera)](const auto& one) { return one.topic == topic; }))
      return;
    clock_.emplace(participant_, camera, wanted_.uri);
    const double end = monotonic_now() + time_to_answer;
    while (!clock_->is_known() && monotonic_now() < end) {
      clock_->look();
      participant_.wait(std::min(clock_->pause(), first_pause));
    }
    if (!clock_->is_known()) {
      clock_.reset();
      clock_note_ =
          "; its machine does not say what time it is there, so stamps are taken to be "
          "of this machine's clock";
      return;
    }
    info_.clock = StampClock::monotonic;
    clock_note_ =
        "; its machine's clock is known within " +
        number_text(std::ceil(1e5 * clock_->relation().uncertainty(monotonic_now())) / 100.0) +
        " ms by questions and answers";
  }
  template <class Which>
  bool hears(const Which& which) {
    const std::vector<dds::Publication> heard = participant_.publications();
    return std::any_of(heard.begin(), heard.end(), which);
  }

  std::optional<Frame> wait(double seconds) override {
    if (clock_) seconds = std::min(seconds, clock_->pause());
    if (slices_) seconds = std::min(seconds, slices_->pause());
    participant_.wait(pending_ ? std::min(seconds, 0.005) : seconds);
    if (clock_) clock_->look();
    take_transforms();
    take_lens();
    take_newest();
    if (!pending_) return std::nullopt;
    return frame_of_pending();
  }

  void take_transforms() {
    if (!tf_) return;
    const auto take_all = [&](dds::Reader& reader, std::string_view topic) {
      while (const auto message = reader.take<ros::TFMessage>()) {
        for (const ros::TransformStamped& transform : message->transforms)
          transforms_.add(transform, topic == transforms_topic,
                          wanted_.uri + ": " + std::string(topic));
      }
    };
    take_all(*static_tf_, static_transforms_topic);
    take_all(*tf_, transforms_topic);
  }

  void take_lens() {
    if (!lenses_) return;
    while (const auto info = lenses_->take<ros::CameraInfo>()) {
      const bool is_rectified = wanted_.topic.find("rect") != std::string::npos;
      const Intrinsics k = intrinsics_of(*info, is_rectified, wanted_.uri + ": " + info_name_);
      if (!rays_ || !(rays_->intrinsics() == k)) rays_ = std::make_shared<const ViewingRays>(k);
    }
  }

  // The newest message; one that a frame still waits with gives way to it.
  void take_newest() {
    const std::string name = wanted_.uri + ": message";
    if (!slices_) {
      while (frames_->take([&](std::span<const std::byte> cdr) {
        begin(ros_frame_of(type_, cdr, wanted_.units, name));
      })) {
      }
      return;
    }
    auto taken = slices_->take(name);
    if (!taken) return;
    begin({.header = std::move(taken->header),
           .details = taken->format,
           .width = static_cast<std::uint32_t>(taken->image.width),
           .height = static_cast<std::uint32_t>(taken->image.height),
           .depth = std::move(taken->image.depth),
           .units = wanted_.units ? *wanted_.units : depth_units(taken->format, name)});
  }

  // @throws Error if the lens is of images of another size
  void begin(RosFrame seen) {
    info_.details = seen.details;
    if (!seen.points) {
      if (!rays_) return;  // its CameraInfo comes beside it
      check_size(rays_->intrinsics(), seen.width, seen.height, wanted_.uri,
                 "name the CameraInfo that belongs to it with ?info=/TOPIC, not " + info_name_);
    }
    arrival_ = monotonic_now();
    pending_ = std::move(seen);
  }

  // In which frame points are is decided once: a pose that came later would move the whole scene.
  // TF takes a moment to arrive, so the first frames wait for it where somebody publishes it.
  // @throws Error if the fixed frame that is wanted does not come.
  bool decide_pose(const std::string& tf_frame) {
    if (decided_) return true;
    const double open_for = monotonic_now() - opened_;
    const bool settled = open_for > time_to_settle;
    const TransformWay way = transforms_.way(tf_frame, "", "TF");
    if (!wanted_.fixed_frame.empty() && wanted_.fixed_frame != "none") {
      if (!settled && !leads(tf_frame)) return false;
      fixed_ = transforms_.way(tf_frame, wanted_.fixed_frame, "TF").fixed;
    } else if (tf_) {
      const bool is_there = hears([](const auto& one) {
        return one.topic == transforms_topic || one.topic == static_transforms_topic;
      });
      const bool waits = is_there ? !settled : open_for < time_to_be_heard;
      if (way.fixed.empty() && waits) return false;
      fixed_ = way.fixed;
    }
    decided_ = true;
    info_.notes = {fixed_.empty()
                       ? "points are in the camera's own frame" +
                             std::string(tf_ ? ", as TF leads from none of map, odom and world "
                                               "to it"
                                             : ", as TF is left aside")
                       : "points are in " + fixed_ +
                             ", by TF; frames for whose time it has no "
                             "transform are left out"};
    info_.notes.front() += clock_note_;
    return true;
  }
  [[nodiscard]] bool leads(const std::string& tf_frame) const {
    try {
      return !transforms_.way(tf_frame, wanted_.fixed_frame, "TF").fixed.empty();
    } catch (const Error&) {
      return false;
    }
  }

  std::optional<Frame> frame_of_pending() {
    const auto& [stamp, tf_frame] = pending_->header;
    if (!decide_pose(tf_frame)) return std::nullopt;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    if (!fixed_.empty()) {
      const TransformWay way = transforms_.way(tf_frame, fixed_, "TF");
      const bool late = monotonic_now() - arrival_ > longest_wait_for_tf;
      if (!late && !transforms_.reach(way, stamp.seconds())) return std::nullopt;
      const std::optional<Eigen::Isometry3d> found = transforms_.at(way, stamp.seconds());
      if (!found) {
        pending_.reset();
        return std::nullopt;
      }
      pose = *found;
    }
    Frame frame;
    frame.stamp = stamp.seconds() - (clock_ ? clock_->relation().difference() : 0.0);
    frame.arrival = arrival_;
    pending_->rgb.clear();  // shown of recordings alone
    frame.cloud = cloud_of(*std::exchange(pending_, std::nullopt), rays_, pose, organised_);
    return frame;
  }

  const CameraOptions wanted_;
  dds::Participant participant_;
  const double opened_;    // [s, monotonic]
  std::string info_name_;  // topic of CameraInfo
  std::string type_;
  std::optional<dds::Reader> frames_, lenses_, tf_, static_tf_;
  std::optional<SliceReader> slices_;
  std::optional<RemoteClock> clock_;
  std::string clock_note_;
  Transforms transforms_{kept_transforms};
  std::shared_ptr<const ViewingRays> rays_;
  std::optional<RosFrame> pending_;  // whose pose is still to come
  double arrival_ = 0.0;             // [s, monotonic] of it
  OrganisedClouds organised_;
  bool decided_ = false;
  std::string fixed_;  // frame of TF in which points are; empty: the camera's own
};

}  // namespace
}  // namespace ros2

std::unique_ptr<Source> open_ros2_camera(const Uri& uri) {
  return std::make_unique<ros2::Camera>(uri);
}

}  // namespace palpate
