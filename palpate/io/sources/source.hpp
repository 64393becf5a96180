// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "palpate/kernel/cloud/frame.hpp"
#include "palpate/kernel/core/registry.hpp"
#include "palpate/kernel/core/sensor.hpp"
#include "palpate/kernel/core/uri.hpp"

namespace palpate {

class Body;

/// Whose clock the stamps of a source are on.
enum class StampClock : std::uint8_t {
  recording,  ///< seconds since the beginning of a recording or simulation
  monotonic,  ///< this machine's CLOCK_MONOTONIC, which the servo loop uses too
  system,     ///< this machine's wall clock, CLOCK_REALTIME: seconds since 1970
  sensor,     ///< the camera's own: any origin, drifts against this machine's clocks, may jump
  session,    ///< that of the session, whose caller gives the frames: `next` never waits
};

/// Distances between which a camera can measure [m].
struct DepthRange {
  double nearest = 0.0;
  double farthest = std::numeric_limits<double>::infinity();
};

/// "recording", "monotonic", "system", "sensor", "session".
[[nodiscard]] std::string_view name_of(StampClock clock) noexcept;

/// What is known of a source before, or without, reading all of it.
struct SourceInfo {
  std::string uri;                      ///< as it was opened
  std::string kind;                     ///< e.g. "TUM RGB-D recording"
  std::optional<std::size_t> frames{};  ///< how many there are; none if endless
  std::optional<double> frame_rate{};   ///< [Hz] nominal, or the median of the stamps
  double start_time = 0.0;              ///< [s] stamp 0 by the recording's own clock
  std::vector<std::string> notes{};     ///< remarks for the user, such as frames left out
  std::string assumed{};  ///< of unit and axes, where nothing says them; shown while it plays
  std::string details{};  ///< of the frame read last: its file's encoding, fields
  /// True for a camera that captures now: frames come when the camera has them, and one that is not
  /// taken in time is lost. False for a recording or simulation, which waits for its reader.
  bool live = false;
  StampClock clock = StampClock::recording;
  SensorKind sensor = SensorKind::unknown;
  /// What the camera can measure, where it is known: depth elsewhere is in another unit.
  std::optional<DepthRange> range{};
  std::shared_ptr<const Body> body{};  ///< what a virtual camera looks at
};

/// Where frames come from: a camera, a simulation, a recording. Used on one thread, but `cancel`.
///
/// A camera of your own is a class derived from this. To open it by a URI, add a SourceScheme to a
/// copy of standard_sources().
class Source {
 public:
  static constexpr double no_timeout = std::numeric_limits<double>::infinity();

  virtual ~Source() = default;

  /// The next frame in the order of capture.
  ///
  /// A recording or simulation reads and decodes it at once and ignores `timeout`; it never waits
  /// for the time of its stamp, which is the caller's task. A live camera waits up to `timeout` [s]
  /// for a frame that has not been given yet; 0 looks without waiting.
  /// @return none: the end (recording), or no frame yet (live camera: time-out or `cancel`)
  /// @throws Error naming the file or camera that cannot be used. The source can be asked again: a
  ///         recording continues with the frame after it.
  virtual std::optional<Frame> next(double timeout = no_timeout) = 0;

  /// Leaves out up to `count` frames without decoding them, for a reader that is too slow.
  /// @return how many were left out; 0 where the source cannot, or at the end
  virtual std::size_t skip(std::size_t /*count*/) { return 0; }

  /// Makes a `next` that waits return soon, and all later ones at once, without a frame. Any
  /// thread; returns at once. A source that never waits need not override it.
  virtual void cancel() noexcept {}

  /// Where the hand is [m, world], for a source that looks where it goes; called before `next`.
  virtual void follow(const Vec3& /*hand*/) {}

  /// Puts what a source of its own frame shows elsewhere, where poses of a camera mean nothing.
  /// @param uri  the source's from now on; empty: its own
  /// @return false: it is none such, its frames have poses
  virtual bool place(const Eigen::Isometry3d& /*world_from_source*/, const std::string& /*uri*/) {
    return false;
  }

  [[nodiscard]] virtual const SourceInfo& info() const = 0;
};

/// A recording or simulation, whose frames have numbers, from 0 up to SourceInfo::frames.
class NumberedSource : public Source {
 public:
  std::size_t skip(std::size_t count) override {
    const std::size_t skipped = info_.frames ? std::min(count, *info_.frames - next_) : count;
    next_ += skipped;
    return skipped;
  }
  [[nodiscard]] const SourceInfo& info() const override { return info_; }

 protected:
  explicit NumberedSource(SourceInfo info) : info_(std::move(info)) {}

  SourceInfo info_;
  std::size_t next_ = 0;  // number of the frame that comes next
};

/// One kind of source that a URI can name.
struct SourceScheme {
  std::string name;     ///< the URI's scheme, without ':'
  std::string summary;  ///< one line, with the form of its URI
  /// @throws Error for an unknown option, or input that cannot be used
  std::function<std::unique_ptr<Source>(const Uri&)> open;
};

/// The library's own: `synthetic:SCENE?...`, `tum:DIR`, `depth:DIR`, `pcd:FILE|DIR`,
/// `ply:FILE|DIR`, `map:FILE`, `splat:FILE`, `recording:BAG`. To add to them, copy the registry.
const Registry<SourceScheme>& standard_sources();

/// What opens them; docs/sources.md has their options.
/// @throws Error if there is no such file or folder, or none that can be used, or an option is not
///         known or out of range.
std::unique_ptr<Source> open_synthetic(const Uri& uri);
std::unique_ptr<Source> open_point_files(const Uri& uri);
std::unique_ptr<Source> open_map(const Uri& uri);
std::unique_ptr<Source> open_splat(const Uri& uri);
std::unique_ptr<Source> open_tum(const Uri& uri);
std::unique_ptr<Source> open_depth(const Uri& uri);
std::unique_ptr<Source> open_recording(const Uri& uri);

/// The URI of a source whose lengths are `times` as long as those of this one; empty: it is neither
/// of point files nor a body, which have an option for that.
std::string rescaled(const std::string& uri, double times);

/// The kind of camera that a recording's option `sensor` names; without it, `known`.
/// @throws Error for another word.
SensorKind sensor_option(const Uri& uri, SensorKind known);

/// The URI of a single file by what its name ends with, and by whether it holds Gaussians.
/// @throws Error for any other ending, saying what to do with such a file.
std::string uri_of_file(const std::filesystem::path& file);

/// The URI of what a person names: a URI, a scheme without its colon, or a file or folder without a
/// scheme. A folder is a TUM sequence, depth images, a ROS 2 bag, or PCD or PLY files.
/// @throws Error if it is none of these.
std::string source_uri(const std::string& text,
                       const Registry<SourceScheme>& schemes = standard_sources());

/// Opens a source by its URI. Whatever the scheme, `pose=x,y,z,qx,qy,qz,qw` says where the camera
/// stands, as parse_pose reads it: see with_pose(); `scale_reference=` brings its depths to metres:
/// see with_scale_reference(); and `material=NAME` or `material=FILE.toml` says what its surfaces
/// are made of: see with_materials().
/// @throws Error for an unknown scheme or option (naming the nearest known one), or input that
///         cannot be used.
std::unique_ptr<Source> open_source(std::string_view uri,
                                    const Registry<SourceScheme>& schemes = standard_sources());

/// A source whose camera stands elsewhere than the source says: every frame's pose is replaced.
/// A source that can `place` itself does. Of others, depth images get the pose as their
/// world_from_camera; points and their viewpoint, which are in the world already, are moved by it.
/// Copies each frame, on the camera's thread.
/// @param world_from_camera  of the optical frame; of points, world_from_source
/// @param uri  the source's, if it says this pose; empty: the source's own
std::unique_ptr<Source> with_pose(std::unique_ptr<Source> source,
                                  const Eigen::Isometry3d& world_from_camera, std::string uri = {});

/// A source of depth images without a scale of their own, as a network makes them, brought to
/// metres by a plane or points whose place is known (docs/sources.md). Where the scale is in doubt,
/// so says Cloud::scale_unsure. A pose that it is given acts before the reference.
/// @param reference  [m, world] `plane:NX,NY,NZ,D`, all places p with n . p = D, or
///                   `points:X,Y,Z;X,Y,Z;X,Y,Z`
/// @param uri        the source's, for messages
/// @throws Error if the reference cannot be read; from next(), if frames are no depth images
std::unique_ptr<Source> with_scale_reference(std::unique_ptr<Source> source,
                                             const std::string& reference, std::string uri);

}  // namespace palpate
