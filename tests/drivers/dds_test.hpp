// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <unistd.h>

#include "tests/support/environment.hpp"

namespace palpate::test {

/// A network of this process's own, on this machine alone: tests that run side by side do not hear
/// one another. Multicast is off, as not every machine has it; each looks for the few beside it.
class OwnNetwork {
 public:
  OwnNetwork() = default;

 private:
  // Domains 100 to 229; two processes with the same one keep apart by the ports' base as well.
  static int number() { return static_cast<int>(getpid()); }
  Environment domain_{"ROS_DOMAIN_ID", std::to_string(100 + number() % 130)};
  Environment uri_{
      "CYCLONEDDS_URI",
      "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"lo\"/></Interfaces>"
      "<AllowMulticast>false</AllowMulticast></General><Discovery>"
      "<Tag>palpate-test-" +
          std::to_string(number()) +
          "</Tag>"
          "<ParticipantIndex>auto</ParticipantIndex>"
          "<MaxAutoParticipantIndex>20</MaxAutoParticipantIndex>"
          "<Peers><Peer address=\"localhost\"/></Peers></Discovery></Domain></CycloneDDS>"};
};

}  // namespace palpate::test
