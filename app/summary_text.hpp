// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "palpate/servo/periodic_thread.hpp"
#include "palpate/session/session.hpp"

namespace palpate::app {

/// A line for each hand, for people, and one for each live camera.
std::string text_of(std::span<const SessionHandState> hands,
                    std::span<const CameraStatus> cameras = {});
/// The same as a JSON object, SI units.
/// @param recording  how it went; empty: there was none
/// @param timing     of a loop in real time; null: there was none
/// @param hand_over  [ns] from a frame's arrival to the tick that used it; null: not known
std::string json_of(std::span<const SessionHandState> hands, const std::string& recording = {},
                    std::span<const CameraStatus> cameras = {}, const Timing* timing = nullptr,
                    const Histogram* hand_over = nullptr);

/// How a loop kept its deadlines, SI units: ticks, late ticks and their causes, percentiles.
nlohmann::ordered_json json_of(const Timing& timing);

}  // namespace palpate::app
