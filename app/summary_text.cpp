// SPDX-License-Identifier: Apache-2.0
#include "app/summary_text.hpp"

#include <algorithm>
#include <bit>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace palpate::app {
namespace {

std::uint64_t ticks_with(const Summary& summary, TickFlag flag) {
  return summary.flag_ticks[static_cast<std::size_t>(std::countr_zero(std::uint32_t{flag}))];
}

// What only a camera that captures now has; empty for others.
std::string camera_line(const CameraStatus& camera) {
  if (camera.latency == 0.0 && camera.opened_again == 0 && camera.doubt.empty()) return {};
  std::string text =
      fmt::format("{}: {}, {} frames at {:.1f} Hz, {:.0f} ms from capture to arrival", camera.uri,
                  camera.kind, camera.frames, camera.rate, 1e3 * camera.latency);
  if (camera.dropped > 0) text += fmt::format(", {} dropped", camera.dropped);
  if (camera.opened_again > 0)
    text += fmt::format(", opened again {}", camera.opened_again == 1
                                                 ? "once"
                                                 : fmt::format("{} times", camera.opened_again));
  for (const std::string& remark : {camera.doubt, camera.trouble}) {
    if (!remark.empty()) text += "; " + remark;
  }
  return text + "\n";
}

nlohmann::ordered_json object_of(const PortEnergy& port, double worst) {
  return {
      {"made_j", port.made}, {"worst_contact_j", worst}, {"generating_contacts", port.generating}};
}

// What a hand's session amounted to.
nlohmann::ordered_json object_of(const Summary& summary) {
  nlohmann::ordered_json safety;
  for (std::size_t i = 0; i < safety_flag_count; ++i)
    safety[std::string(safety_flag_table()[i].name)] = summary.safety_ticks[i];
  const Vec3 mean =
      summary.sum_sent / static_cast<double>(std::max<std::size_t>(summary.force_ticks, 1));
  return {{"ticks", summary.ticks},
          {"frames", summary.frames},
          {"duration_s", summary.duration()},
          {"late_ticks", summary.late_ticks},
          {"contact_ticks", summary.contact_ticks},
          {"force_ticks", summary.force_ticks},
          {"steps", summary.steps},
          {"step_budget_hits", ticks_with(summary, step_budget_hit)},
          {"patch_thinned_ticks", ticks_with(summary, patch_thinned)},
          {"max_force_asked", summary.largest_asked},
          {"max_force_sent", summary.largest_sent},
          {"mean_force_sent", {mean.x(), mean.y(), mean.z()}},
          {"pop_throughs", summary.pop_throughs},
          {"energy",
           {{"contacts", summary.energy.contacts},
            {"relative", object_of(summary.energy.relative, summary.worst_relative)},
            {"absolute", object_of(summary.energy.absolute, summary.worst_absolute)}}},
          {"safety_ticks", safety}};
}

std::string hand_line(const Summary& summary) {
  const auto ticks = static_cast<double>(std::max<std::size_t>(summary.ticks, 1));
  std::string text = fmt::format(
      "{} ticks over {:.3f} s, {} frames, in contact {:.1f} % of the time, largest force requested "
      "{:.3f} N, sent {:.3f} N, {:.2f} steps per tick, suspected pop-throughs {}",
      summary.ticks, summary.duration(), summary.frames,
      100.0 * static_cast<double>(summary.contact_ticks) / ticks, summary.largest_asked,
      summary.largest_sent, static_cast<double>(summary.steps) / ticks, summary.pop_throughs);
  if (summary.late_ticks > 0) text += fmt::format(", late ticks {}", summary.late_ticks);
  if (const auto hits = ticks_with(summary, step_budget_hit); hits > 0)
    text += fmt::format(", step limit reached in {} ticks", hits);
  if (const auto thinned = ticks_with(summary, patch_thinned); thinned > 0)
    text += fmt::format(", points thinned in {} ticks", thinned);
  if (const ServoEnergy& energy = summary.energy; energy.contacts > 0)
    text += fmt::format(
        "; {} contacts, energy generated relative to the moving surface {:.2f} mJ, {:.2f} mJ in "
        "the worst contact, more than {:.1f} mJ in {} contacts",
        energy.contacts, 1e3 * energy.relative.made, 1e3 * summary.worst_relative,
        1e3 * PortEnergy::least_made, energy.relative.generating);
  return text;
}

}  // namespace

std::string text_of(std::span<const SessionHandState> hands,
                    std::span<const CameraStatus> cameras) {
  std::string text = hand_line(hands.front().summary) + "\n";
  for (const SessionHandState& hand : hands.subspan(1))
    text += hand.name + ": " + hand_line(hand.summary) + "\n";
  for (const CameraStatus& camera : cameras) text += camera_line(camera);
  return text;
}

nlohmann::ordered_json json_of(const Timing& timing) {
  nlohmann::ordered_json object = {{"ticks", timing.wake_up.count()},
                                   {"late_ticks", timing.late_ticks.load()},
                                   {"late_by_compute", timing.late_by_compute.load()},
                                   {"late_by_interruption", timing.late_by_interruption.load()}};
  for (const auto& [name, histogram] :
       {std::pair{"wake_up", &timing.wake_up}, std::pair{"compute", &timing.compute}}) {
    for (const auto& [suffix, share] :
         {std::pair{"_p50_s", 0.5}, {"_p99_s", 0.99}, {"_p999_s", 0.999}, {"_max_s", 1.0}})
      object[std::string(name) + suffix] = 1e-9 * static_cast<double>(histogram->quantile(share));
  }
  return object;
}

std::string json_of(std::span<const SessionHandState> hands, const std::string& recording,
                    std::span<const CameraStatus> cameras, const Timing* timing,
                    const Histogram* hand_over) {
  const auto seconds = [&](double share) {
    return 1e-9 * static_cast<double>(hand_over->quantile(share));
  };
  nlohmann::ordered_json object = object_of(hands.front().summary);
  for (const SessionHandState& hand : hands.subspan(1)) {
    nlohmann::ordered_json other = {{"name", hand.name}};
    other.update(object_of(hand.summary));
    object["more_hands"].push_back(std::move(other));
  }
  for (const CameraStatus& camera : cameras)
    object["cameras"].push_back({{"uri", camera.uri},
                                 {"kind", camera.kind},
                                 {"sensor", name_of(camera.sensor)},
                                 {"frames", camera.frames},
                                 {"dropped", camera.dropped},
                                 {"rate_hz", camera.rate},
                                 {"latency_s", camera.latency},
                                 {"opened_again", camera.opened_again},
                                 {"doubt", camera.doubt},
                                 {"trouble", camera.trouble}});
  if (timing != nullptr) object["servo"] = json_of(*timing);
  if (timing != nullptr && hand_over != nullptr)
    object["servo"].update({{"hand_over_p50_s", seconds(0.5)}, {"hand_over_p99_s", seconds(0.99)}});
  if (!recording.empty()) object["recording"] = recording;
  return object.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace palpate::app
