// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/organised.hpp"
#include "palpate/kernel/core/uri.hpp"

namespace palpate {

/// PCD or PLY files as frames. An organised PCD whose points a pinhole camera could have seen is a
/// DepthImage of that camera (fit_camera); all others are a PointCloud, with the faces and normals
/// of a PLY and the image layout of an organised PCD beside its points. Where one of these is
/// there, so are the points' colours, as Frame::colour.
///
/// The files of a folder (.pcd or .ply, upper or lower case) come in natural order of their names;
/// frame k is stamped k / fps, even if a file before it could not be read.
class PointFileSource final : public Source {
 public:
  struct Options {
    double fps = 30.0;   ///< [Hz] > 0
    double scale = 1.0;  ///< [m] length of one unit of the files: 0.001 for millimetres; > 0
  };
  using Reader = PointFile (*)(const std::filesystem::path&);

  /// @param files  in the order of capture
  PointFileSource(std::vector<std::filesystem::path> files, Reader reader, const Options& options,
                  SourceInfo info);

  std::optional<Frame> next(double timeout = no_timeout) override;
  std::size_t skip(std::size_t count) override;
  [[nodiscard]] const SourceInfo& info() const override { return info_; }

 private:
  std::vector<std::filesystem::path> files_;
  Reader reader_;
  Options options_;
  SourceInfo info_;
  std::size_t next_ = 0;
  OrganisedClouds organised_;
};

/// Opens `pcd:FILE|DIR` or `ply:FILE|DIR`, with `?fps=30` and `scale=1mm` (the
/// length of one unit of the files).
/// @throws Error if there is no such file or folder, the folder holds no such file, or an option
///         is not known or out of range. The files themselves are read by `next`.
std::unique_ptr<Source> open_point_files(const Uri& uri);

/// The URI of a source whose lengths are `times` as long as those of this one; empty: it is neither
/// of point files nor a body, which have an option for that.
std::string rescaled(const std::string& uri, double times);

}  // namespace palpate
