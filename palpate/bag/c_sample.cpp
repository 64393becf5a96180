// SPDX-License-Identifier: Apache-2.0
#include "palpate/bag/c_sample.hpp"

#include "palpate/bag/message_walks.hpp"

namespace palpate::ros {

CSample::CSample(const Image& message) {
  lay(message, image);
}
CSample::CSample(const CompressedImage& message) {
  lay(message, compressed);
}
CSample::CSample(const CameraInfo& message) {
  lay(message, camera);
}
CSample::CSample(const PointCloud2& message) {
  lay(message, points);
}
CSample::CSample(const PoseStamped& message) {
  lay(message, pose);
}
CSample::CSample(const WrenchStamped& message) {
  lay(message, wrench);
}
CSample::CSample(const TimeReference& message) {
  lay(message, time_reference);
}
CSample::CSample(const TFMessage& message) {
  lay(message, transforms);
}
CSample::CSample(const Float64MultiArray& message) {
  lay(message, multi_array);
}
CSample::CSample(const Bool& message) {
  lay(message, boolean);
}
CSample::CSample(const Point& message) {
  lay(message, point);
}
CSample::CSample(const Vector3& message) {
  lay(message, point);
}
CSample::CSample(const Wrench& message) {
  lay(message, plain_wrench);
}
CSample::CSample(const OmniFeedback& message) {
  lay(message, omni_feedback);
}

}  // namespace palpate::ros
