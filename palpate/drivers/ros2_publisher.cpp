// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/ros2_publisher.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <utility>
#include <vector>

#include "palpate/io/sources/depth_png.hpp"
#include "palpate/io/sources/depth_rvl.hpp"
#include "palpate/io/sources/transforms.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {
namespace {

constexpr dds::Quality reliable{.reliable = true};
// What was lost is sent again, while newer images are on their way
constexpr dds::Quality resent{.reliable = true, .depth = 16};
constexpr dds::Quality best_effort{};  // a question that is late is no use
constexpr double longest_wait = 0.1;   // [s] for a question, until the end is looked at

// @throws Error if it is no name.
std::string checked_name(const std::string& name) {
  const bool is_good =
      !name.empty() &&
      std::all_of(name.begin(), name.end(),
                  [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '/'; }) &&
      name.front() != '/' && name.back() != '/' && name.find("//") == std::string::npos;
  if (!is_good)
    throw Error("name", "'" + name + "' is not a valid topic name",
                "write letters, digits and _, such as robot/camera");
  return name;
}

}  // namespace

std::string clock_question_topic(const std::string& camera) { return camera + "/clock/question"; }
std::string clock_answer_topic(const std::string& camera) { return camera + "/clock/answer"; }
std::string report_topic(const std::string& camera) { return camera + "/slices/report"; }

Ros2CameraPublisher::Ros2CameraPublisher(const std::string& name, DepthPacking packing)
    : name_(checked_name(name)),
      packing_(packing),
      participant_("ros2:" + name_),
      camera_("/" + name_ + "/depth"),
      topic_(camera_ + "/image_raw/compressedDepth"),
      slices_topic_(camera_ + "/image_raw/slices"),
      questions_(participant_, clock_question_topic(camera_), ros::TimeReference{}, best_effort),
      answers_(participant_, clock_answer_topic(camera_), ros::TimeReference{}, best_effort),
      reports_(participant_, report_topic(camera_), ros::Float64MultiArray{}, best_effort),
      transforms_(participant_, std::string(transforms_topic), ros::TFMessage{}, reliable),
      lenses_(participant_, camera_ + "/camera_info", ros::CameraInfo{}, reliable),
      images_(participant_, topic_, ros::CompressedImage{}, resent),
      slices_(participant_, slices_topic_, ros::CompressedImage{}, best_effort),
      listener_([this] { listen(); }) {}

Ros2CameraPublisher::~Ros2CameraPublisher() {
  ends_ = true;
  listener_.join();
}

void Ros2CameraPublisher::listen() {
  while (!ends_) {
    participant_.wait(longest_wait);
    while (const auto report = reports_.take_whole<ros::Float64MultiArray>()) {
      if (report->data.size() != 3) continue;
      const std::lock_guard lock(rate_mutex_);
      rate_.report(monotonic_now(), report->data[0], report->data[1], report->data[2]);
    }
    while (const auto question = questions_.take_whole<ros::TimeReference>())
      answers_.write(ros::TimeReference{.header = {ros::Time::now(), ""},
                                        .time_ref = question->header.stamp,
                                        .source = question->source});
  }
}

// How often the slices of an image that is captured now are to be sent.
int Ros2CameraPublisher::copies_wanted() {
  const std::lock_guard lock(rate_mutex_);
  return rate_.allows(monotonic_now()) ? rate_.copies() : 0;
}

void Ros2CameraPublisher::publish(const DepthImage& image, double stamp) {
  const Intrinsics& k = image.intrinsics();
  const auto nanoseconds = static_cast<std::int64_t>(std::llround(1e9 * stamp));
  const std::string frame = name_ + "_optical_frame";
  const ros::Header header{ros::Time::at(nanoseconds), frame};
  transforms_.write(
      ros::TFMessage{{transform_of({header.stamp, "world"}, frame, image.world_from_camera())}});
  lenses_.write(camera_info_of(header, k));
  if (images_.readers() > 0) {
    const bool is_rvl = packing_ == DepthPacking::rvl;
    images_.write(compressed_depth(header,
                                   is_rvl ? encode_depth_rvl(k.width, k.height, image.depth())
                                          : encode_depth_png(k.width, k.height, image.depth()),
                                   image.units_per_metre(), packing_));
  }
  const int copies = slices_.readers() > 0 ? copies_wanted() : 0;
  if (copies == 0) return;
  // Copies come when all have been sent once: a link often loses some in a row
  std::vector<ros::CompressedImage> again;
  encode_depth_slices(number_++, k.width, k.height, image.depth(),
                      [&](std::span<const std::byte> slice) {
                        auto message = depth_slice(header, slice, image.units_per_metre());
                        slices_.write(message);
                        if (copies > 1) again.push_back(std::move(message));
                      });
  for (const ros::CompressedImage& message : again) slices_.write(message);
}

}  // namespace palpate
