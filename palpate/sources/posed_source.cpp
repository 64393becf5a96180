// SPDX-License-Identifier: Apache-2.0
#include <string>
#include <utility>
#include <vector>

#include "palpate/cloud/depth_image.hpp"
#include "palpate/cloud/point_cloud.hpp"
#include "palpate/core/error.hpp"
#include "palpate/sources/source.hpp"

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
      auto moved =
          std::make_shared<DepthImage>(image->shared_rays(), image->depth(),
                                       image->units_per_metre(), pose_, image->brightness());
      moved->set_materials(image->materials());
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

std::unique_ptr<Source> with_pose(std::unique_ptr<Source> source,
                                  const Eigen::Isometry3d& world_from_camera, std::string uri) {
  return std::make_unique<PosedSource>(std::move(source), world_from_camera, std::move(uri));
}

}  // namespace palpate
