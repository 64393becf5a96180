// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/bag/c_sample.hpp"
#include "palpate/bag/messages.hpp"

// ROS 2's topics without ROS: by Eclipse Cyclone DDS's library, which is loaded when it is asked
// for. Topics and types have the names that ROS gives them: /camera/depth/image_raw,
// sensor_msgs/msg/Image.
namespace palpate::dds {

/// What a reader asks for, or a writer offers. A best-effort reader takes from every writer, and
/// every reader takes from a reliable writer; both are ROS's rules.
struct Quality {
  bool reliable = false;
  bool keeps_for_late = false;  ///< transient local: those that come later get the last ones, too
  int depth = 1;                ///< how many are kept
  std::optional<double> lifespan{};  ///< [s] of a message; afterwards no reader gets it
  std::optional<double> deadline{};  ///< [s] within which the next one is promised
};

/// What somebody publishes.
struct Publication {
  std::string topic, type;
  friend bool operator==(const Publication&, const Publication&) = default;
};

struct Library;

/// Takes part in a domain: what reads and writes, and what the others publish. The domain is
/// ROS_DOMAIN_ID's (0 without). Settings of CYCLONEDDS_URI come behind the library's own, and so
/// count; with ROS_LOCALHOST_ONLY=1 nothing leaves this machine. Not for two threads at a time;
/// `wait`, each Reader and each Writer may have a thread of their own.
class Participant {
 public:
  /// @param who  for errors: a URI
  /// @throws Error if the library is missing, or has no network.
  explicit Participant(const std::string& who);
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  [[nodiscard]] const std::string& library_path() const;
  [[nodiscard]] std::uint32_t domain() const { return domain_; }
  /// What was heard of so far, by name: others are heard of within some 0.1 s, distant ones later.
  [[nodiscard]] std::vector<Publication> publications();
  /// Waits for a message, up to `seconds`; may return early.
  void wait(double seconds);

 private:
  friend class Reader;
  friend class Writer;
  [[nodiscard]] int topic(const std::string& name, std::string_view type,
                          const ros::CSample& example);
  void check(int entity, const std::string& what) const;

  std::string who_;
  std::unique_ptr<Library> library_;
  std::uint32_t domain_ = 0;
  int entity_ = 0, publications_ = 0, waitset_ = 0;
};

/// Reads a topic.
class Reader {
 public:
  /// @param participant  must outlive this
  /// @param example      any message of the type
  /// @throws Error if the topic's name is none.
  template <class Message>
  Reader(Participant& participant, const std::string& topic, const Message& example,
         const Quality& quality)
      : Reader(participant, topic, Message::type, ros::CSample(example), quality) {}
  ~Reader();
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  /// Takes the oldest message that is there, if any, and hands its CDR to `use`.
  bool take(const std::function<void(std::span<const std::byte>)>& use);
  /// @throws Error if it is damaged.
  template <class Message>
  std::optional<Message> take() {
    std::optional<Message> message;
    take([&](std::span<const std::byte> cdr) { message = ros::decode<Message>(cdr, topic_); });
    return message;
  }
  /// How many writers there are now.
  [[nodiscard]] int writers() const;

 private:
  Reader(Participant& participant, const std::string& topic, std::string_view type,
         const ros::CSample& example, const Quality& quality);

  Participant& participant_;
  std::string topic_;
  int entity_ = 0;
};

/// Writes a topic.
class Writer {
 public:
  /// As for Reader.
  template <class Message>
  Writer(Participant& participant, const std::string& topic, const Message& example,
         const Quality& quality)
      : Writer(participant, topic, Message::type, ros::CSample(example), quality) {}
  ~Writer();
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  /// @return false if it could not be sent.
  template <class Message>
  bool write(const Message& message) {
    return write_sample(ros::CSample(message));
  }
  /// Waits until all reliable readers have what was written, up to `seconds`.
  bool wait_for_readers(double seconds);
  /// How many readers there are now.
  [[nodiscard]] int readers() const;

 private:
  Writer(Participant& participant, const std::string& topic, std::string_view type,
         const ros::CSample& example, const Quality& quality);
  bool write_sample(const ros::CSample& sample);

  Participant& participant_;
  int entity_ = 0;
};

/// The instructions by which Cyclone DDS writes and reads such a struct.
std::vector<std::uint32_t> instructions(const std::vector<ros::CField>& fields);

/// A type's name in DDS: "sensor_msgs::msg::dds_::Image_".
std::string dds_type(std::string_view type);

}  // namespace palpate::dds
