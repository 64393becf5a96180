// SPDX-License-Identifier: Apache-2.0
#include "app/point_remarks.hpp"

#include <fmt/format.h>

#include "palpate/io/sources/point_file_source.hpp"
#include "palpate/kernel/cloud/proposed_touch.hpp"

namespace palpate::app {

std::string length_text(double metres) {
  return metres < 1.0 ? fmt::format("{:.3g} mm", 1e3 * metres) : fmt::format("{:.4g} m", metres);
}

std::string radius_remark(const Cloud& cloud, double r_c) {
  const auto* points = dynamic_cast<const PointCloud*>(&cloud);
  const double usual = ProxyParameters{}.r_c();
  if (points == nullptr || r_c <= usual) return {};
  return fmt::format(
      "its points are {} apart, so the proxy has r_c = {} and cannot fall between them; "
      "--set r_c={:.3g} sets the default",
      length_text(proposed_touch(*points).spacing), length_text(r_c), usual);
}

std::string sparse_remark(const Cloud& cloud, const std::string& uri, double r_c) {
  const auto* points = dynamic_cast<const PointCloud*>(&cloud);
  if (points == nullptr) return {};
  const ProposedTouch proposed = proposed_touch(*points);
  if (proposed.spacing == 0.0)
    return fmt::format("{} points are too few for a surface; use a file with more points",
                       points->size());
  if (proposed.scale == 1.0 && proposed.radius <= r_c) return {};
  const bool has_proxy = proposed.scale == 1.0;
  const std::string what = fmt::format(
      "it is {} long with points {} apart, too {} for {}; ", length_text(proposed.extent),
      length_text(proposed.spacing), proposed.scale > 1.0 ? "small" : "sparse",
      has_proxy ? "a proxy with r_c = " + length_text(r_c) : "any proxy");
  if (has_proxy)
    return what + fmt::format("give --set r_c={:.2g}, or leave r_c out", proposed.radius);
  const std::string larger = rescaled(uri, proposed.scale);
  if (larger.empty()) return what + "press where they are denser";
  return what + fmt::format("give --camera '{}' to touch it {} long", larger,
                            length_text(proposed.scale * proposed.extent));
}

}  // namespace palpate::app
