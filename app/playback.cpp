// SPDX-License-Identifier: Apache-2.0
#include "app/playback.hpp"

#include <utility>

#include "palpate/cloud/point_cloud.hpp"
#include "palpate/core/error.hpp"
#include "palpate/drivers/drivers.hpp"

namespace palpate::app {

Playback::Playback(const std::vector<std::string>& uris) {
  if (uris.empty())
    throw Error("--camera", "no camera is given", "give one, such as --camera synthetic:desk");
  if (uris.size() > Patch::max_views)
    throw Error("--camera", std::to_string(uris.size()) + " cameras are too many",
                "give at most " + std::to_string(Patch::max_views));
  for (const std::string& uri : uris) {
    Camera camera;
    camera.source = open_source(uri, all_sources());
    camera.next = camera.source->next();
    if (!camera.next) throw Error(uri, "it has no frames", "give a source with at least one");
    camera.first_stamp = camera.next->stamp;
    cameras_.push_back(std::move(camera));
  }
  newest_.resize(cameras_.size());
}

void Playback::adopt_until(double t, const std::function<void(const Cloud&, double)>& adopt) {
  for (;;) {
    Camera* due = nullptr;
    for (Camera& camera : cameras_) {
      if (!camera.next || camera.next->stamp > t) continue;
      if (due == nullptr || camera.next->stamp < due->next->stamp) due = &camera;
    }
    if (due == nullptr) return;
    due->newest = std::move(*due->next);
    due->next = due->source->next();

    std::vector<std::shared_ptr<const Cloud>> clouds;
    for (const Camera& camera : cameras_) {
      if (camera.newest.cloud) clouds.push_back(camera.newest.cloud);
    }
    std::shared_ptr<const Cloud> cloud =
        clouds.size() == 1 ? clouds.front() : std::make_shared<CloudSet>(std::move(clouds));
    adopt(*cloud, due->newest.stamp);
    in_use_ = std::move(cloud);  // only now may the frame before go
    newest_[static_cast<std::size_t>(due - cameras_.data())] = due->newest.cloud;
    ++due->adopted;
    ++adopted_;
  }
}

std::vector<ShownFrames> Playback::shown() const {
  std::vector<ShownFrames> all;
  for (const Camera& camera : cameras_)
    all.push_back({.count = camera.adopted,
                   .first = camera.first_stamp,
                   .last = camera.newest.stamp,
                   .ended = !camera.next});
  return all;
}

void Playback::check(const Method& method) const {
  for (const Camera& camera : cameras_) method.check(*camera.next->cloud);
}

}  // namespace palpate::app
