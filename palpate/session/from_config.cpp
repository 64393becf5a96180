// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/from_config.hpp"

#include "palpate/sources/fixture_file.hpp"

namespace palpate {

SessionOptions session_options(const SessionConfig& config) {
  validate(config);
  SessionOptions options;
  for (const CameraConfig& camera : config.cameras)
    options.cameras.push_back({.uri = camera.uri, .world_from_camera = camera.world_from_camera});
  if (!config.device.empty()) options.device_uri = config.device;
  for (const HandConfig& hand : config.more_hands)
    options.more_hands.push_back(
        {.name = hand.name, .device_uri = hand.device, .placement = hand.placement});
  options.settings.method = config.method;
  options.settings.parameters = config.parameters;
  options.radii_chosen = config.radii_chosen;
  options.settings.safety = config.safety;
  options.settings.placement = config.placement;
  if (!config.fixtures.empty())
    options.settings.fixtures = std::make_shared<const FixtureSet>(read_fixtures(config.fixtures));
  options.servo.rate = config.rate;
  options.without_watchdog = config.without_watchdog;
  options.record = config.record;
  return options;
}

}  // namespace palpate
