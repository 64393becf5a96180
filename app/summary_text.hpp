// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "palpate/session/camera_feed.hpp"
#include "palpate/session/summary.hpp"

namespace palpate::app {

/// A summary in one line, for people, and one for each live camera.
std::string text_of(const Summary& summary, std::span<const CameraStatus> cameras = {});
/// The same as a JSON object, SI units.
/// @param recording  how it went; empty: there was none
std::string json_of(const Summary& summary, const std::string& recording = {},
                    std::span<const CameraStatus> cameras = {});

}  // namespace palpate::app
