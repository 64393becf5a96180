// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// One column of a point file, as its header declares it.
struct PointField {
  std::string name;       ///< e.g. "x", "rgba"; PCD's padding is called "_"
  std::string type;       ///< "int8" .. "uint64", "float32", "float64"; "list of TYPE" in a PLY
  std::size_t count = 1;  ///< how many values of that type a point has; 1 for a list
};

/// Of each Gaussian of a splat, as stored.
struct SplatColumns {
  std::vector<Vec3> log_scales;  ///< natural logarithms of the deviations along its axes
  std::vector<Vec3> heads;       ///< w of its rotation, logit of its opacity, and 0
  std::vector<Vec3> rotations;   ///< x, y, z of its rotation, a quaternion of any length

  void add(const Vec3& logs, double opacity, const Eigen::Quaterniond& turn);
};

/// The content of a PCD or PLY file, in its own coordinates and unit (usually metres).
struct PointFile {
  /// Every point in the order of the file; holes of an organised cloud stay, as NaN, so that the
  /// point of pixel (u, v) is points[v * width + u].
  std::vector<Vec3> points;
  std::size_t width = 0;   ///< [points] in a row of an organised cloud; else their number
  std::size_t height = 1;  ///< [points] rows of an organised cloud; else 1
  /// A PLY's nx, ny, nz of each point as stored: of any length, perhaps not finite. Empty without.
  std::vector<Vec3> normals;
  /// A PLY's faces: indices of points, in the order of the file. Polygons are fanned, strips cut.
  std::vector<std::array<std::uint32_t, 3>> triangles;
  /// Red, green and blue of each point in its order, 3 values each: a PCD's rgb or rgba, a PLY's
  /// red, green and blue, of bytes or of floats from 0 to 1, a splat's spherical harmonics of
  /// degree 0. Empty without.
  std::vector<std::uint8_t> colours;
  /// Position of the camera in the frame of the points: the translation of PCD's VIEWPOINT, or
  /// view_px view_py view_pz of the `camera` element that PCL writes into a PLY. As in PCL, but not
  /// its viewer, nothing is transformed by it, and the orientation is not used.
  std::optional<Vec3> viewpoint;
  std::optional<SplatColumns> splat;  ///< of a splat that is read as one
  std::string encoding;               ///< as in the header, e.g. "binary_compressed"
  std::vector<PointField> fields;     ///< of a point, in the order of the file
  std::size_t non_finite = 0;         ///< how many points have a coordinate that is NaN or infinite
  /// Bytes after the data that the header declares, not counting white space. They are not read:
  /// PCL pads binary files to a whole page.
  std::size_t bytes_unread = 0;
};

// All parsers take bytes in memory, of which `name` is what an error calls them, allocate in
// proportion to their size, whatever a header declares, and throw an Error that names the file, the
// line or offset, and what was wrong.

/// Reads a file by a parser.
/// @param largest  [bytes] larger files are refused  @throws Error also if it cannot be read.
PointFile read_by(PointFile (*parse)(std::span<const std::byte> bytes, std::string_view name),
                  const std::filesystem::path& path,
                  std::uintmax_t largest = std::uintmax_t{1} << 32U);

/// Reads a PCD file, versions 0.5 to 0.7: ascii, binary (little endian) or binary_compressed;
/// fields of any order, type, size and count, as long as x, y and z are among them.
PointFile parse_pcd(std::span<const std::byte> bytes, std::string_view name);
inline PointFile read_pcd(const std::filesystem::path& path) { return read_by(parse_pcd, path); }

/// Reads a PLY file, version 1.0: ascii, little or big endian. Of element `vertex` x, y, z and
/// nx, ny, nz and red, green, blue; of `face` and `tristrips` vertex_indices or vertex_index; of
/// `camera` its position. Other elements, lists and properties are checked and passed over.
PointFile parse_ply(std::span<const std::byte> bytes, std::string_view name);
inline PointFile read_ply(const std::filesystem::path& path) { return read_by(parse_ply, path); }

/// Reads a PLY whose points are Gaussians as 3D Gaussian splatting writes them: `opacity`,
/// `scale_0` to `scale_2`, `rot_0` to `rot_3`, w first, and perhaps `f_dc_0` to `f_dc_2`. Otherwise
/// as parse_ply.
PointFile parse_splat(std::span<const std::byte> bytes, std::string_view name);
/// Does a PLY or glTF file declare Gaussians in its first 64 kB? False too of what cannot be read.
bool holds_splat(const std::filesystem::path& path);

/// Reads an STL file, binary or ascii, into `points` and `triangles`. Corners at the same place are
/// one point. Normals and attributes are passed over.
PointFile parse_stl(std::span<const std::byte> bytes, std::string_view name);
inline PointFile read_stl(const std::filesystem::path& path) {
  return read_by(parse_stl, path, std::uintmax_t{1} << 28U);
}

/// Reads a Wavefront OBJ's `v` and `f` into `points` and `triangles`; polygons are fanned. All else
/// is passed over.
PointFile parse_obj(std::span<const std::byte> bytes, std::string_view name);

/// Reads an SPZ of versions 1 to 4 as parse_splat does a PLY.
PointFile parse_spz(std::span<const std::byte> bytes, std::string_view name);

/// Is a file, by its name, a glTF or GLB?
bool is_gltf(const std::filesystem::path& path);
/// Reads a glTF 2.0 or GLB: the triangles of its scene or, `as_splat`, the Gaussians of its
/// KHR_gaussian_splatting, each moved by its nodes. Buffers are inside, or files beside or below.
PointFile read_gltf(const std::filesystem::path& path, bool as_splat);
/// The same for bytes in memory. @param folder  of the buffers
PointFile parse_gltf(std::span<const std::byte> bytes, std::string_view name,
                     const std::filesystem::path& folder, bool as_splat);

/// Is a file, by its name, an NRRD?
bool is_nrrd(const std::filesystem::path& path);
/// Reads an NRRD's volume, raw or gzip, behind its header or in a file beside or below, and makes
/// triangles of where its values pass `level`, by surface nets (docs/sources.md).
/// @throws Error also if there is no such place.
PointFile read_nrrd(const std::filesystem::path& path, double level = 0.0);
/// The same for bytes in memory. @param folder  of the data
PointFile parse_nrrd(std::span<const std::byte> bytes, std::string_view name,
                     const std::filesystem::path& folder, double level = 0.0);

}  // namespace palpate
