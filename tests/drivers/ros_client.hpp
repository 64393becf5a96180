// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "palpate/drivers/dds.hpp"
#include "palpate/io/bag/node_messages.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate::test {

constexpr double long_enough = 60.0;  ///< [s] for a slow machine under load

/// Asks as a client of rmw_cyclonedds_cpp does.
template <class Service>
class RosClient {
 public:
  RosClient(dds::Participant& participant, const std::string& name)
      : participant_(participant),
        replies_(participant, name, typename Service::Reply{}, named),
        requests_(participant, name, typename Service::Request{}, named) {}

  /// None if no answer comes.
  std::optional<typename Service::Reply> ask(typename Service::Request request) {
    const double end = monotonic_now() + long_enough;
    while (requests_.readers() == 0 && monotonic_now() < end) participant_.wait(0.02);
    request.header = {0xabcdef0123456789U, ++sequence_};
    requests_.write(request);
    while (monotonic_now() < end) {
      while (auto reply = replies_.template take<typename Service::Reply>()) {
        if (reply->header.client == request.header.client &&
            reply->header.sequence == request.header.sequence)
          return reply;
      }
      participant_.wait(0.02);
    }
    return std::nullopt;
  }

 private:
  static constexpr dds::Quality named{
      .reliable = true, .depth = 10, .user_data = "clientid=01.02;typehash=RIHS01_0;"};
  dds::Participant& participant_;
  dds::Reader replies_;
  dds::Writer requests_;
  std::int64_t sequence_ = 0;
};

}  // namespace palpate::test
