// SPDX-License-Identifier: Apache-2.0
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/core/nearest_name.hpp"
#include "palpate/core/parameters.hpp"
#include "palpate/core/uri.hpp"
#include "palpate/sources/depth_recording.hpp"
#include "palpate/sources/point_file_source.hpp"
#include "palpate/sources/recording.hpp"
#include "palpate/sources/source.hpp"
#include "palpate/sources/synthetic_camera.hpp"

namespace palpate {
namespace {

struct Scheme {
  std::string_view name;
  std::unique_ptr<Source> (*open)(const Uri&);
};

// One line for each kind of source.
const std::vector<Scheme>& schemes() {
  static const std::vector<Scheme> table{
      {"synthetic", open_synthetic}, {"pcd", open_point_files},
      {"ply", open_point_files},     {"tum", open_tum},
      {"depth", open_depth},         {"recording", open_recording},
  };
  return table;
}

}  // namespace

std::unique_ptr<Source> open_source(std::string_view text) {
  const Uri uri(text);
  std::vector<std::string_view> names;
  for (const Scheme& scheme : schemes()) {
    if (scheme.name == uri.scheme()) {
      return scheme.open(uri);
    }
    names.push_back(scheme.name);
  }
  const std::string_view nearest = nearest_name(uri.scheme(), names);
  std::string remedy =
      nearest.empty() ? "known here:" : "did you mean '" + std::string(nearest) + ":'? known here:";
  for (const std::string_view name : names) {
    remedy += " " + std::string(name) + ":";
  }
  throw Error(uri.text(), "unknown kind of source '" + uri.scheme() + ":'", remedy);
}

}  // namespace palpate
