// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/core/uri.hpp"

namespace palpate {

// Options of both kinds of recording. The camera is described by `intrinsics.json`
// (intrinsics_file.hpp), which these override:
//   fx, fy, cx, cy                  [px] focal lengths and principal point
//   k1, k2, p1, p2, k3, k4, k5, k6  Brown-Conrady distortion; those not given keep their value
//   units                           raw depth units per metre
//   start, frames                   number of the first frame, from 0; most frames to give
// The raw values that intrinsics.json calls invalid or saturated become 0, a hole. For an image
// that is missing, damaged or not of the camera's size, next() throws an Error; the call after it
// continues with the next image.

/// Opens `tum:DIR`, the layout of the TUM RGB-D benchmark: depth.txt lists the images,
/// groundtruth.txt the poses of the optical frame in the world (trajectory.hpp).
///
/// Without intrinsics.json: 640x480, f = 525 px, centre (319.5, 239.5), 5000 units per metre.
/// Stamps count from the first frame given; SourceInfo::start_time is the time of that frame on the
/// recording's clock. `stamps=absolute` gives the recording's own stamps.
/// `poses=FILE` reads another trajectory, named relative to DIR; `poses=none` gives points in the
/// camera's own frame. `pose_delay` [s] is by how much later than images the trajectory's clock
/// stamps poses: the image of stamp t gets the pose of stamp t + pose_delay. Frames at whose stamp
/// the trajectory has no pose are left out, and SourceInfo::notes says how many. `colour=rgb.txt`
/// reads that list of images in visible light, registered to the depth and of its size, and gives
/// each frame the one nearest to it within 20 ms, if any, as Frame::colour; so it is without the
/// option, too, where that list is there, and frames have no colour from the first image on that
/// cannot be read; `colour=none` reads none. `brightness=rgb.txt` gives the same in grey, as
/// DepthImage::brightness; `labels=FILE` the same of 8-bit images whose values are labels of
/// materials, as Frame::labels.
/// @throws Error if the lists, poses or intrinsics cannot be used, or no frame is left.
std::unique_ptr<Source> open_tum(const Uri& uri);

/// Opens `depth:DIR`, the PNG images of DIR/depth, or of DIR, in natural order of their names, or
/// `depth:FILE.png`, one image.
///
/// intrinsics.json is looked for beside the images and one folder above. Without it, fx, fy, cx, cy
/// and units must be given; the size is that of the first image.
/// `labels=PLACE`, named relative to DIR, is a folder of 8-bit images with the names of the depth
/// images, or one image for all, whose values are labels of materials: Frame::labels.
/// `colour=PLACE` is the same of images in visible light: Frame::colour. Stamps are k/fps of the
/// k-th frame given: `fps=30`, or fps_nominal of intrinsics.json, or 30. Points are in the camera's
/// own frame unless `poses=FILE`, named relative to DIR, says where the camera was: a .json of one
/// matrix for each image of the folder (parse_pose_matrices), or a trajectory in the TUM
/// benchmark's format whose stamps count from the first image of the folder.
/// @throws Error if the folder, poses or intrinsics cannot be used, or no frame is left.
std::unique_ptr<Source> open_depth(const Uri& uri);

}  // namespace palpate
