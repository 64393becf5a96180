// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/ros2_publisher.hpp"

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cmath>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "palpate/drivers/dds.hpp"
#include "palpate/drivers/link_estimates.hpp"
#include "palpate/io/sources/depth_png.hpp"
#include "palpate/io/sources/depth_rvl.hpp"
#include "palpate/io/sources/ros_frames.hpp"
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

std::string clock_question_topic(const std::string& camera) {
  return camera + "/clock/question";
}
std::string clock_answer_topic(const std::string& camera) {
  return camera + "/clock/answer";
}
std::string report_topic(const std::string& camera) {
  return camera + "/slices/report";
}

// Others hear of what is published in this order: whoever has heard of the images has heard of all.
struct Ros2CameraPublisher::Topics {
  Topics(const std::string& wanted, DepthPacking packed_as)
      : name(checked_name(wanted)),
        packing(packed_as),
        participant("ros2:" + name),
        topic("/" + name + "/depth/image_raw/compressedDepth"),
        slices_topic("/" + name + "/depth/image_raw/slices"),
        questions(participant, clock_question_topic("/" + name + "/depth"), ros::TimeReference{},
                  best_effort),
        answers(participant, clock_answer_topic("/" + name + "/depth"), ros::TimeReference{},
                best_effort),
        reports(participant, report_topic("/" + name + "/depth"), ros::Float64MultiArray{},
                best_effort),
        transforms(participant, std::string(transforms_topic), ros::TFMessage{}, reliable),
        lenses(participant, "/" + name + "/depth/camera_info", ros::CameraInfo{}, reliable),
        images(participant, topic, ros::CompressedImage{}, resent),
        slices(participant, slices_topic, ros::CompressedImage{}, best_effort),
        listener([this] { listen(); }) {}
  ~Topics() {
    ends = true;
    listener.join();
  }
  Topics(const Topics&) = delete;
  Topics& operator=(const Topics&) = delete;

  void listen() {
    while (!ends) {
      participant.wait(longest_wait);
      while (const auto report = reports.take_whole<ros::Float64MultiArray>()) {
        if (report->data.size() != 3) continue;
        const std::lock_guard lock(rate_mutex);
        rate.report(monotonic_now(), report->data[0], report->data[1], report->data[2]);
      }
      while (const auto question = questions.take_whole<ros::TimeReference>())
        answers.write(ros::TimeReference{.header = {ros::Time::now(), ""},
                                         .time_ref = question->header.stamp,
                                         .source = question->source});
    }
  }

  // How often the slices of an image that is captured now are to be sent.
  int copies() {
    const std::lock_guard lock(rate_mutex);
    return rate.allows(monotonic_now()) ? rate.copies() : 0;
  }

  std::string name;
  DepthPacking packing;
  dds::Participant participant;
  std::string topic, slices_topic;
  dds::Reader questions;
  dds::Writer answers;
  dds::Reader reports;
  dds::Writer transforms, lenses, images, slices;
  std::mutex rate_mutex;
  SendRate rate;
  std::uint32_t number = 0;  // of an image in slices
  std::atomic<bool> ends{false};
  std::thread listener;
};

Ros2CameraPublisher::Ros2CameraPublisher(const std::string& name, DepthPacking packing)
    : topics_(std::make_unique<Topics>(name, packing)) {}
Ros2CameraPublisher::~Ros2CameraPublisher() = default;

void Ros2CameraPublisher::publish(const DepthImage& image, double stamp) {
  const Intrinsics& k = image.intrinsics();
  const auto nanoseconds = static_cast<std::int64_t>(std::llround(1e9 * stamp));
  const std::string frame = topics_->name + "_optical_frame";
  const ros::Header header{ros::Time::at(nanoseconds), frame};
  topics_->transforms.write(
      ros::TFMessage{{transform_of({header.stamp, "world"}, frame, image.world_from_camera())}});
  topics_->lenses.write(camera_info_of(header, k));
  if (topics_->images.readers() > 0) {
    const bool is_rvl = topics_->packing == DepthPacking::rvl;
    topics_->images.write(compressed_depth(header,
                                           is_rvl
                                               ? encode_depth_rvl(k.width, k.height, image.depth())
                                               : encode_depth_png(k.width, k.height, image.depth()),
                                           image.units_per_metre(), topics_->packing));
  }
  const int copies = topics_->slices.readers() > 0 ? topics_->copies() : 0;
  if (copies == 0) return;
  // Copies come when all have been sent once: a link often loses some in a row
  std::vector<ros::CompressedImage> again;
  encode_depth_slices(topics_->number++, k.width, k.height, image.depth(),
                      [&](std::span<const std::byte> slice) {
                        auto message = depth_slice(header, slice, image.units_per_metre());
                        topics_->slices.write(message);
                        if (copies > 1) again.push_back(std::move(message));
                      });
  for (const ros::CompressedImage& message : again) topics_->slices.write(message);
}

const std::string& Ros2CameraPublisher::topic() const {
  return topics_->topic;
}
const std::string& Ros2CameraPublisher::slices_topic() const {
  return topics_->slices_topic;
}
std::uint32_t Ros2CameraPublisher::domain() const {
  return topics_->participant.domain();
}
int Ros2CameraPublisher::readers() const {
  return topics_->images.readers() + topics_->slices.readers();
}

}  // namespace palpate
