// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <deque>
#include <functional>
#include <string>
#include <string_view>
#include <utility>

#include "palpate/drivers/dds.hpp"
#include "palpate/io/bag/node_messages.hpp"

namespace palpate::dds {

/// What a node's services and their clients have in common: ROS's quality of services, and the name
/// by which a request's reader and its replies' writer are known to belong together.
inline Quality service_quality(std::string_view identity) {
  constexpr int requests_kept = 10;  // as ROS's own services
  return {.reliable = true, .depth = requests_kept, .user_data = identity};
}
/// @param number  of the service among those of its participant
inline std::string service_identity(const Guid& participant, unsigned number) {
  std::string text = "serviceid=";
  std::array<char, 8> piece{};
  for (std::size_t i = 0; i < 12; ++i) {  // the rest is the same for all participants
    std::snprintf(piece.data(), piece.size(), "%02x.", static_cast<unsigned>(participant[i]));
    text += piece.data();
  }
  return text + std::to_string(number) + ";";
}

/// A service of a node, asked and answered as rmw_cyclonedds_cpp does: each message begins with who
/// asked and the number of the request. (rmw_fastrtps_cpp says that outside of the message, where
/// Cyclone's C API cannot write.)
template <class Type>
class Service {
 public:
  using Request = typename Type::Request;
  using Reply = typename Type::Reply;

  /// @param number  of the service among those of the participant
  /// @param answer  must not throw
  Service(Participant& participant, const std::string& name, unsigned number,
          std::function<Reply(const Request&)> answer)
      : name_(name),
        identity_(service_identity(participant.guid(), number)),
        requests_(participant, name, Request{}, service_quality(identity_)),
        replies_(participant, name, Reply{}, service_quality(identity_)),
        answer_(std::move(answer)) {}

  /// Answers what was asked since the last call. A client that does not read its replies yet gets
  /// its own with a later call, up to `patience` from now on.
  /// @param now  [s] on any one clock
  void serve(double now) {
    while (const auto request = requests_.template take_whole<Request>()) {
      Reply reply = answer_(*request);
      reply.header = request->header;
      waiting_.push_back({std::move(reply), requests_.sender(), now});
      if (waiting_.size() > most_waiting) waiting_.pop_front();
    }
    for (std::size_t left = waiting_.size(); left > 0; --left) {
      Waiting first = std::move(waiting_.front());
      waiting_.pop_front();
      const Listening client = listening(requests_, first.client, replies_);
      if (client == Listening::yes)
        replies_.write(first.reply);
      else if (client == Listening::not_yet && now - first.since < patience)
        waiting_.push_back(std::move(first));
    }
  }

  [[nodiscard]] Guid reader() const { return requests_.guid(); }
  [[nodiscard]] Guid writer() const { return replies_.guid(); }

 private:
  static constexpr double patience = 10.0;  // [s] as a busy machine may need
  static constexpr std::size_t most_waiting = 64;

  struct Waiting {
    Reply reply;
    std::uint64_t client;
    double since;
  };

  std::string name_, identity_;
  Reader requests_;
  Writer replies_;
  std::function<Reply(const Request&)> answer_;
  std::deque<Waiting> waiting_;
};

}  // namespace palpate::dds
