// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "palpate/io/bag/bag_reader.hpp"
#include "palpate/io/bag/messages.hpp"
#include "palpate/io/sources/ros_frames.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/io/sources/transforms.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/frame.hpp"
#include "palpate/kernel/cloud/organised.hpp"

namespace palpate {

class BagColour;

/// Names of the topics of camera `number`, from 0, in a recording of palpate's own.
struct CameraTopics {
  explicit CameraTopics(std::size_t number);
  explicit CameraTopics(const std::string& camera);  ///< by its name, such as `camera_0`

  std::string depth;  ///< CompressedImage, "16UC1; compressedDepth png": the camera's own bits
  std::string camera_info;  ///< CameraInfo, one for each depth image
  std::string points;       ///< PointCloud2 of float64, where the camera gives points
  /// Float64MultiArray, one for each image or cloud: values that standard messages lack or round.
  /// Depth: stamp [s], units per metre, world_from_camera (3 x 4, row by row); where something is
  /// known of the materials, which message of `materials` and which of `material_table` they are,
  /// from 1, 0 for none; 1 where the scale is in doubt; which message of `noise`. What is not known
  /// is left out from the end.
  /// Points: stamp [s], an unused number, 1 if a viewpoint follows, the viewpoint [m].
  std::string exact;
  /// CompressedImage, "mono16; png": of each pixel the label of its material, and in the upper
  /// eight bits the brightness, if `format` ends with that. Written when it changes.
  std::string materials;
  std::string material_table;  ///< String: materials_json(), written when it changes
  /// CompressedImage, "16UC1; compressedDepth rvl": DepthImage::noise(), written when it changes.
  std::string noise;
  std::string optical_frame;  ///< in TF
};

/// CompressedImage::format of CameraTopics::materials.
constexpr std::string_view material_format = "mono16; png; labels";
constexpr std::string_view material_format_with_brightness = "mono16; png; labels; brightness";

/// The frames of one topic of a bag, recorded by palpate (restored to the bit) or by others.
///
/// Depth images of encoding 16UC1, mono16 [mm] and 32FC1 [m], raw or compressedDepth (PNG), with a
/// CameraInfo beside them; PointCloud2 with x, y and z. In other bags the camera's pose is what
/// their transforms say (transforms.hpp); where they lead from no fixed frame to the camera,
/// points are in the camera's own frame.
///
/// Recordings of librealsense (2.58 and later) keep the lens and the unit of depth in texts:
/// `.../Depth_0/camera_info` (realsense_lens.hpp) and `.../option/Depth_Units/value`, metres per
/// unit, which may change during a recording. Before, they were bags of ROS 1, with a CameraInfo on
/// `.../Depth_0/info/camera_info` and a Float32 on `.../option/Depth Units/value`.
class BagCamera {
 public:
  struct Options {
    std::optional<double> units;  ///< [1/m] of raw depth; 32FC1 is rounded to it
    std::string fixed_frame{};    ///< of TF; "none": TF is left aside; empty: the one that is there
  };

  /// @param bag  must outlive this
  /// @throws Error if the topic is not there, is none of a camera's, or has no CameraInfo.
  BagCamera(BagReader& bag, const std::string& topic, const Options& options);
  ~BagCamera();

  /// The topics that can be opened.
  static std::vector<std::string> topics_of(const BagReader& bag);

  [[nodiscard]] std::size_t frames() const { return places_.size(); }
  [[nodiscard]] const std::string& topic() const { return topic_; }
  /// Its stamp is on the session's clock in palpate's own bags, else in seconds since 1970. None
  /// where the bag's transforms do not say where the camera was then: never in palpate's own.
  /// @throws Error if it cannot be read.
  [[nodiscard]] std::optional<Frame> frame(std::size_t number);
  /// [Hz] from the median interval of the times of recording; none for less than two frames.
  [[nodiscard]] std::optional<double> frame_rate() const;
  [[nodiscard]] bool is_ours() const { return !exact_places_.empty(); }
  /// Recorded by librealsense.
  [[nodiscard]] bool is_realsense() const { return is_realsense_; }
  /// How it measures, where the bag tells.
  [[nodiscard]] SensorKind sensor() const;
  /// In which frame the points are, in a line; empty where the bag itself says it with each frame.
  [[nodiscard]] std::string pose_note() const;
  /// Why there is no colour although the bag has images of it; else empty.
  [[nodiscard]] const std::string& colour_note() const { return colour_note_; }
  /// The encoding of the frame read last.
  [[nodiscard]] const std::string& details() const { return details_; }

 private:
  void find_lens(const std::string& camera);
  void follow_transforms();
  void find_colour();
  [[nodiscard]] ros::Header first_header() const;
  Frame own_frame(std::size_t number, RosFrame seen);
  [[nodiscard]] std::optional<Eigen::Isometry3d> pose_at(double stamp) const;
  [[nodiscard]] std::vector<double> exact(std::size_t number, std::size_t size);
  std::shared_ptr<const MaterialMap> materials(std::size_t number, double image, double table);
  DepthImage::Noise noise(std::size_t number, double image);
  [[nodiscard]] CameraTopics topics() const {
    return CameraTopics(topic_.substr(1, topic_.find('/', 1) - 1));
  }
  /// The message of frame `number` on one of its camera's topics that are written when they change.
  BagReader::Place changed(std::size_t number, const std::string& topic, double count);
  const std::shared_ptr<const ViewingRays>& rays(std::size_t number, const RosFrame& image);
  [[nodiscard]] std::string text(const BagReader::Place& place, const std::string& topic) const;
  [[nodiscard]] double realsense_units(std::size_t number) const;
  [[nodiscard]] double stamp(std::size_t number, const ros::Header& header) const;
  [[nodiscard]] std::string name(std::size_t number) const;

  BagReader& bag_;
  std::string topic_, type_, info_topic_, exact_topic_, units_topic_;
  Options options_;
  std::vector<BagReader::Place> places_, info_places_, exact_places_, units_places_;
  bool is_realsense_ = false;
  std::optional<BagTransforms> transforms_;
  std::unique_ptr<BagColour> colour_;
  std::string colour_note_;
  std::shared_ptr<const ViewingRays> rays_;  // of the frame read last
  OrganisedClouds organised_;
  std::map<std::string, std::vector<BagReader::Place>> changed_places_;
  std::shared_ptr<const MaterialMap> materials_;        // of the frame read last
  double material_image_ = 0.0, material_table_ = 0.0;  // its messages
  DepthImage::Noise noise_;                             // likewise
  double noise_image_ = 0.0;
  std::string details_;
};

}  // namespace palpate
