// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/devices/devices.hpp"

#include <array>

#include "palpate/io/devices/mouse_device.hpp"
#include "palpate/io/devices/simulated_hand.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

using Path = std::optional<HipPath>;

// What a message tells to whoever gave no device that is simulated.
constexpr const char* add_a_device =
    "add device=touch, device=omega, device=falcon or device=sigma";

HipPath path_of(const Uri& uri, const Path& path) {
  if (!uri.path().empty()) return HipPath::read_csv(uri.path());
  if (path) return *path;
  throw Error("'" + uri.text() + "'", "there is no path to follow",
              "write " + uri.scheme() + ":FILE.csv");
}

std::unique_ptr<Device> open_script(const Uri& uri, const Path& path) {
  uri.allow_only(std::to_array<std::string_view>({"repeat"}));
  return std::make_unique<ScriptedDevice>(path_of(uri, path), uri.has("repeat"), uri.text());
}

std::unique_ptr<Device> open_hand(const Uri& uri, const Path& path) {
  uri.allow_only(std::to_array<std::string_view>(
      {"mass", "stiffness", "damping", "tremor", "seed", "device", "grip", "device_mass",
       "device_damping", "friction", "resolution", "delay", "inertia", "device_turn_damping",
       "turn_stiffness", "turn_damping"}));
  HandModel model;
  const std::string device = uri.text_option("device", "none");
  const std::string grip = uri.text_option("grip", "");
  const DevicePreset* preset = nullptr;
  if (device != "none") {
    preset = &device_preset(device);
    DeviceBody& body = model.body.emplace(preset->body);
    body.mass = uri.number_option("device_mass", body.mass, 1e-3, 10.0, "kg");
    body.damping = uri.number_option("device_damping", body.damping, 0.0, 100.0, "N s/m");
    body.friction = uri.number_option("friction", body.friction, 0.0, 10.0, "N");
    body.resolution = uri.number_option("resolution", body.resolution, 0.0, 0.01, "m");
    body.delay = uri.number_option("delay", body.delay, 0.0, 0.01, "s");
    body.inertia = uri.number_option("inertia", body.inertia, 0.0, 0.1, "kg m^2");
    body.turn_damping =
        uri.number_option("device_turn_damping", body.turn_damping, 0.0, 1.0, "N m s/rad");
  } else {
    for (const std::string_view of_a_body :
         {"device_mass", "device_damping", "friction", "resolution", "delay", "inertia",
          "device_turn_damping", "turn_stiffness", "turn_damping"}) {
      if (uri.has(of_a_body))
        throw Error(uri.text(), "option '" + std::string(of_a_body) + "' needs a device model",
                    add_a_device);
    }
  }
  if (!grip.empty()) {
    const Grip& held = grip_preset(grip);
    model.mass = held.mass;
    model.stiffness = held.stiffness;
    model.damping = held.damping;
    model.turn_stiffness = held.turn_stiffness;
    model.turn_damping = held.turn_damping;
    if (held.mass == 0.0) {
      if (preset == nullptr)
        throw Error(uri.text(), "with grip=none and no device there is nothing to move",
                    add_a_device);
      model.tremor = 0.0;
    }
  }
  const bool held = model.mass > 0.0;
  model.mass = uri.number_option("mass", model.mass, held ? 0.01 : 0.0, 10.0, "kg");
  model.stiffness = uri.number_option("stiffness", model.stiffness, held ? 1.0 : 0.0, 1e4, "N/m");
  model.damping = uri.number_option("damping", model.damping, 0.0, 1e3, "N s/m");
  model.turn_stiffness =
      uri.number_option("turn_stiffness", model.turn_stiffness, 0.0, 100.0, "N m/rad");
  model.turn_damping = uri.number_option("turn_damping", model.turn_damping, 0.0, 1.0, "N m s/rad");
  model.tremor = uri.number_option("tremor", model.tremor, 0.0, 0.01, "m");
  model.seed = static_cast<std::uint64_t>(uri.number_option("seed", 1.0, 0.0, 1e9, "-"));
  auto hand = std::make_unique<SimulatedHand>(path_of(uri, path), model, uri.text());
  if (preset != nullptr) hand->set_device(*preset);
  return hand;
}

std::unique_ptr<Device> open_mouse(const Uri& uri, const Path& /*path*/) {
  uri.allow_only(
      std::to_array<std::string_view>({"x", "y", "z", "response", "max_speed", "silence"}));
  if (!uri.path().empty()) {
    throw Error(uri.text(), "a mouse has no '" + uri.path() + "'", "write only mouse:");
  }
  const auto coordinate = [&](std::string_view key) {
    return uri.number_option(key, 0.0, -1e6, 1e6, "m");
  };
  const Vec3 start(coordinate("x"), coordinate("y"), coordinate("z"));
  return std::make_unique<MouseDevice>(start, uri.number_option("response", 0.025, 1e-3, 1.0, "s"),
                                       uri.number_option("max_speed", 1.0, 0.01, 10.0, "m/s"),
                                       uri.text(),
                                       uri.number_option("silence", 0.5, 0.2, 60.0, "s"));
}

}  // namespace

Registry<DeviceScheme> standard_devices() {
  return {"type of device",
          ":",
          {{"script", "follows a recorded path, independent of the force", open_script},
           {"hand", "a simulated person that follows a path and yields to the force", open_hand},
           {"mouse", "controlled from the page, smoothed", open_mouse}}};
}

std::unique_ptr<Device> open_device(std::string_view text, const Path& path,
                                    const Registry<DeviceScheme>& registry) {
  const Uri uri(text);
  return registry.find(uri.scheme(), uri.text()).open(uri, path);
}

}  // namespace palpate
