// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "palpate/drivers/c_sample.hpp"
#include "palpate/io/bag/messages.hpp"
#include "palpate/kernel/core/error.hpp"

// ROS 2's topics without ROS, by Eclipse Cyclone DDS's library. Topics and types have the names
// that ROS gives them: /camera/depth/image_raw, sensor_msgs/msg/Image.
namespace palpate::dds {

/// What a reader asks for, or a writer offers. A best-effort reader takes from every writer, and
/// every reader takes from a reliable writer; both are ROS's rules.
struct Quality {
  bool reliable = false;
  bool keeps_for_late = false;  ///< transient local: those that come later get the last ones, too
  int depth = 1;                ///< how many are kept
  std::optional<double> lifespan{};  ///< [s] of a message; afterwards no reader gets it
  std::optional<double> deadline{};  ///< [s] within which the next one is promised
  std::string_view user_data{};      ///< told to all others, such as "serviceid=..."
};

/// What an entity is called in the whole network.
using Guid = std::array<std::uint8_t, 16>;

/// Of ROS, by how nodes are announced.
enum class Generation : std::uint8_t {
  unknown,    ///< there is no node
  to_humble,  ///< identities of 24 bytes
  from_iron,  ///< of 16; also where there are both
};

/// What somebody publishes.
struct Publication {
  std::string topic, type;
  // NOLINTNEXTLINE(modernize-use-nullptr): a false alarm of clang-tidy 14
  friend auto operator<=>(const Publication&, const Publication&) = default;
};

struct Library;
class Reader;
class Writer;

/// Does a service's client read its replies yet?
enum class Listening : std::uint8_t { yes, not_yet, gone };

/// Takes part in a domain: what reads and writes, and what the others publish. The domain is
/// ROS_DOMAIN_ID's (0 without). Settings of CYCLONEDDS_URI come behind the library's own, and so
/// count; with ROS_LOCALHOST_ONLY=1 nothing leaves this machine. Not for two threads at a time;
/// `wait`, each Reader and each Writer may have a thread of their own.
class Participant {
 public:
  /// @param who        for errors: a URI
  /// @param user_data  told to all others
  /// @throws Error if the library is missing, or has no network.
  explicit Participant(const std::string& who, std::string_view user_data = {});
  ~Participant();

  [[nodiscard]] const std::string& library_path() const;
  [[nodiscard]] std::uint32_t domain() const { return domain_; }
  /// What was heard of so far, by name: others are heard of within some 0.1 s, distant ones later.
  [[nodiscard]] std::vector<Publication> publications();
  /// Of the nodes of ROS 2 that were heard of so far, but for this participant's own.
  [[nodiscard]] Generation generation();
  [[nodiscard]] Guid guid() const;
  /// Waits for a message, up to `seconds`; may return early.
  void wait(double seconds);

 private:
  friend class TopicEnd;
  friend class Reader;
  friend class Writer;
  friend Listening listening(const Reader& requests, std::uint64_t client, const Writer& replies);
  void each_publication(const std::function<void(const cyclone::Endpoint&)>& use);
  [[nodiscard]] int topic(const std::string& name, std::string_view type, const CSample& example);
  void check(int entity, const std::string& what) const;

  std::string who_;
  std::unique_ptr<Library> library_;
  std::uint32_t domain_ = 0;
  int entity_ = 0, publications_ = 0, waitset_ = 0;
};

/// What reads or writes a topic.
class TopicEnd {
 public:
  TopicEnd(const TopicEnd&) = delete;
  TopicEnd& operator=(const TopicEnd&) = delete;
  [[nodiscard]] Guid guid() const;

 protected:
  TopicEnd(Participant& participant, const std::string& topic, std::string_view type,
           const CSample& example, const Quality& quality, bool reads);
  ~TopicEnd();

  Participant& participant_;
  std::string topic_;
  int entity_ = 0;

 private:
  friend Listening listening(const Reader& requests, std::uint64_t client, const Writer& replies);
};

/// Reads a topic.
class Reader : public TopicEnd {
 public:
  /// @param participant  must outlive this
  /// @param example      any message of the type
  /// @throws Error if the topic's name is none.
  template <class Message>
  Reader(Participant& participant, const std::string& topic, const Message& example,
         const Quality& quality)
      : TopicEnd(participant, topic, Message::type, CSample(example), quality, true) {}

  /// Takes the oldest message that is there, if any, and hands its CDR to `use`.
  bool take(const std::function<void(std::span<const std::byte>)>& use);
  /// @throws Error if it is damaged.
  template <class Message>
  std::optional<Message> take() {
    std::optional<Message> message;
    take([&](std::span<const std::byte> cdr) { message = ros::decode<Message>(cdr, topic_); });
    return message;
  }
  /// As `take`, but a message that is damaged counts as none.
  template <class Message>
  std::optional<Message> take_whole() {
    for (;;) {
      try {
        return take<Message>();
      } catch (const Error&) {
        continue;
      }
    }
  }
  /// How many writers there are now.
  [[nodiscard]] int writers() const;
  /// Whose the message was that was taken last: for `listening`.
  [[nodiscard]] std::uint64_t sender() const { return sender_; }

 private:
  std::uint64_t sender_ = 0;
};

/// Writes a topic.
class Writer : public TopicEnd {
 public:
  /// As for Reader.
  template <class Message>
  Writer(Participant& participant, const std::string& topic, const Message& example,
         const Quality& quality)
      : TopicEnd(participant, topic, Message::type, CSample(example), quality, false) {}

  /// @return false if it could not be sent.
  template <class Message>
  bool write(const Message& message) {
    return write_sample(CSample(message));
  }
  /// Waits until all reliable readers have what was written, up to `seconds`.
  bool wait_for_readers(double seconds);
  /// How many readers there are now.
  [[nodiscard]] int readers() const;

 private:
  bool write_sample(const CSample& sample);
};

/// @param client  Reader::sender of its request
Listening listening(const Reader& requests, std::uint64_t client, const Writer& replies);

/// A time of the servo loop's clock [s] on the wall's, which stamps of ROS are on.
ros::Time stamp_of(double monotonic);

/// A type's name in DDS: "sensor_msgs::msg::dds_::Image_".
std::string dds_type(std::string_view type);
/// A topic's name in DDS, which for services depends on the type: "rt/camera/points",
/// "rq/palpate/stopRequest", "rr/palpate/stopReply".
std::string dds_topic(const std::string& topic, std::string_view type);

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
/// asked and its number. (rmw_fastrtps_cpp says that where Cyclone's C API cannot write.)
template <class Type>
class Service {
 public:
  using Request = typename Type::Request;
  using Reply = typename Type::Reply;

  /// @param number  of the service among those of the participant
  /// @param answer  must not throw
  Service(Participant& participant, const std::string& name, unsigned number,
          std::function<Reply(const Request&)> answer)
      : identity_(service_identity(participant.guid(), number)),
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

  std::string identity_;
  Reader requests_;
  Writer replies_;
  std::function<Reply(const Request&)> answer_;
  std::deque<Waiting> waiting_;
};

}  // namespace palpate::dds
