// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/dds.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "palpate/drivers/cyclone_api.hpp"
#include "palpate/drivers/shared_library.hpp"
#include "palpate/kernel/core/text.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate::dds {

using cyclone::Duration, cyclone::Endpoint, cyclone::Entity, cyclone::Qos, cyclone::Result,
    cyclone::SampleInfo, cyclone::Serdata, cyclone::TopicDescriptor;

// Cyclone's C API, and at the end what it hands out messages by as they came.
struct Library {
  SharedLibrary library{
      {.name = "ros2: (Cyclone DDS)",
       .files = {"libddsc.so.0debian", "libddsc.so.0t64", "libddsc.so.0", "libddsc.so"},
       .variable = "PALPATE_CYCLONEDDS",
       .remedy = "install it: apt install libddsc0debian, or libddsc0t64 (the package "
                 "that cyclonedds-dev needs)"}};
  void (*set_log_mask)(std::uint32_t) = library.find("dds_set_log_mask");
  Entity (*create_domain)(std::uint32_t, const char*) = library.find("dds_create_domain");
  Entity (*create_participant)(std::uint32_t, const Qos*,
                               const void*) = library.find("dds_create_participant");
  Result (*remove)(Entity) = library.find("dds_delete");
  Entity (*create_topic)(Entity, const TopicDescriptor*, const char*, const Qos*,
                         const void*) = library.find("dds_create_topic");
  Entity (*create_reader)(Entity, Entity, const Qos*,
                          const void*) = library.find("dds_create_reader");
  Entity (*create_writer)(Entity, Entity, const Qos*,
                          const void*) = library.find("dds_create_writer");
  Entity (*create_waitset)(Entity) = library.find("dds_create_waitset");
  Result (*attach)(Entity, Entity, std::intptr_t) = library.find("dds_waitset_attach");
  Result (*wait)(Entity, std::intptr_t*, std::size_t, Duration) = library.find("dds_waitset_wait");
  Result (*set_status_mask)(Entity, std::uint32_t) = library.find("dds_set_status_mask");
  Result (*read)(Entity, void**, SampleInfo*, std::size_t,
                 std::uint32_t) = library.find("dds_read");
  Result (*return_loan)(Entity, void**, std::int32_t) = library.find("dds_return_loan");
  Result (*write)(Entity, const void*) = library.find("dds_write");
  Result (*wait_for_acks)(Entity, Duration) = library.find("dds_wait_for_acks");
  Result (*matched_readers)(Entity, std::uint64_t*,
                            std::size_t) = library.find("dds_get_matched_subscriptions");
  Result (*matched_writers)(Entity, std::uint64_t*,
                            std::size_t) = library.find("dds_get_matched_publications");
  const char* (*reason)(Result) = library.find("dds_strretcode");
  Qos* (*create_qos)() = library.find("dds_create_qos");
  void (*delete_qos)(Qos*) = library.find("dds_delete_qos");
  void (*set_reliability)(Qos*, int, Duration) = library.find("dds_qset_reliability");
  void (*set_durability)(Qos*, int) = library.find("dds_qset_durability");
  void (*set_history)(Qos*, int, std::int32_t) = library.find("dds_qset_history");
  void (*set_lifespan)(Qos*, Duration) = library.find("dds_qset_lifespan");
  void (*set_deadline)(Qos*, Duration) = library.find("dds_qset_deadline");
  void (*set_user_data)(Qos*, const void*, std::size_t) = library.find("dds_qset_userdata");
  bool (*user_data)(const Qos*, void**, std::size_t*) = library.find("dds_qget_userdata");
  Result (*guid)(Entity, cyclone::Guid*) = library.find("dds_get_guid");
  Endpoint* (*matched_reader)(Entity,
                              std::uint64_t) = library.find("dds_get_matched_subscription_data");
  Endpoint* (*matched_writer)(Entity,
                              std::uint64_t) = library.find("dds_get_matched_publication_data");
  void (*free_endpoint)(Endpoint*) = library.find("dds_builtintopic_free_endpoint");
  void (*free)(void*) = library.find("dds_free");
  Result (*take_cdr)(Entity, Serdata**, std::uint32_t, SampleInfo*,
                     std::uint32_t) = library.find("dds_takecdr");
  Serdata* (*cdr_reference)(const Serdata*, std::size_t, std::size_t,
                            iovec*) = library.find("ddsi_serdata_to_ser_ref");
  void (*cdr_unreference)(Serdata*, const iovec*) = library.find("ddsi_serdata_to_ser_unref");
  std::uint32_t (*cdr_size)(const Serdata*) = library.find("ddsi_serdata_size");
  void (*cdr_release)(Serdata*) = library.find("ddsi_serdata_unref");
};

namespace {

constexpr std::uint32_t largest_domain = 232;
// [s] that a reliable writer waits for room at most. Not the protocol's default of 0.1 s, which
// Cyclone does not tell others: @foxglove/rtps does not read a writer without it.
constexpr double blocking_time = 0.05;
constexpr std::size_t most_publications = 4096;

Duration duration(double seconds) { return static_cast<Duration>(std::llround(1e9 * seconds)); }

std::string variable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

// What a link lost is asked for again, and sent again, within milliseconds: with Cyclone's own
// delays, which spare a network of many readers, a camera's images stay incomplete until they are
// too old, at 5 % loss all of them.
// 640 x 480 depth at 30 Hz comes in bursts of 0.6 MB, a cloud in ones of 5 MB, which the usual
// buffer of 208 kB does not hold: a larger one is asked for, and the kernel gives what it may.
// Several programs on a machine without multicast find each other by their index.
std::string settings() {
  std::string text = "<CycloneDDS><Domain Id=\"any\"><General>";
  if (variable("ROS_LOCALHOST_ONLY") == "1")
    text += "<Interfaces><NetworkInterface name=\"lo\"/></Interfaces>";
  text +=
      "</General><Discovery><MaxAutoParticipantIndex>99</MaxAutoParticipantIndex></Discovery>"
      "<Internal><SocketReceiveBufferSize max=\"8MB\"/>"
      "<NackDelay>3ms</NackDelay><AutoReschedNackDelay>20ms</AutoReschedNackDelay>"
      "<PreEmptiveAckDelay>2ms</PreEmptiveAckDelay>"
      "<HeartbeatInterval min=\"1ms\" minsched=\"2ms\">5ms</HeartbeatInterval>"
      "<Watermarks><WhcHigh>16MB</WhcHigh></Watermarks></Internal></Domain></CycloneDDS>";
  if (const std::string own = variable("CYCLONEDDS_URI"); !own.empty()) text += "," + own;
  return text;
}

std::uint32_t domain_wanted() {
  const std::string text = variable("ROS_DOMAIN_ID");
  if (text.empty()) return 0;
  std::uint32_t domain = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), domain);
  if (error != std::errc() || end != text.data() + text.size() || domain > largest_domain)
    throw Error("ROS_DOMAIN_ID", "'" + text + "' is no domain", "give a number from 0 to 232");
  return domain;
}

// "/camera/points" of ROS is "rt/camera/points" of DDS.
constexpr std::string_view prefix = "rt/";

// Nodes are announced on a topic whose name has no such prefix.
constexpr std::string_view nodes_type = "rmw_dds_common/msg/ParticipantEntitiesInfo";
constexpr std::string_view nodes_topic = "ros_discovery_info";

std::string ros_type(std::string type) {
  constexpr std::string_view middle = "::msg::dds_::";
  const std::size_t at = type.find(middle);
  if (at == std::string::npos || !type.ends_with('_')) return {};
  type.pop_back();
  return type.replace(at, middle.size(), "/msg/");
}

using OwnedQos = std::unique_ptr<Qos, void (*)(Qos*)>;

OwnedQos offer_of(const Library& library, const Quality& quality) {
  OwnedQos qos(library.create_qos(), library.delete_qos);
  library.set_reliability(qos.get(), quality.reliable ? cyclone::reliable : cyclone::best_effort,
                          duration(blocking_time));
  library.set_durability(
      qos.get(), quality.keeps_for_late ? cyclone::transient_local : cyclone::volatile_data);
  library.set_history(qos.get(), cyclone::keep_last, quality.depth);
  if (quality.lifespan) library.set_lifespan(qos.get(), duration(*quality.lifespan));
  if (quality.deadline) library.set_deadline(qos.get(), duration(*quality.deadline));
  if (!quality.user_data.empty())
    library.set_user_data(qos.get(), quality.user_data.data(), quality.user_data.size());
  return qos;
}

std::string user_data_of(const Library& library, const Qos* qos) {
  void* data = nullptr;
  std::size_t size = 0;
  if (!library.user_data(qos, &data, &size) || data == nullptr) return {};
  std::string text(static_cast<const char*>(data), size);
  library.free(data);
  return text;
}

Guid guid_of(const Library& library, Entity entity) {
  cyclone::Guid guid{};
  library.guid(entity, &guid);
  Guid bytes{};
  std::copy(std::begin(guid.bytes), std::end(guid.bytes), bytes.begin());
  return bytes;
}

// Who a client of services is: its participant, and its own name where it says one.
std::optional<std::string> client_of(const Library& library, Endpoint* endpoint) {
  if (endpoint == nullptr) return std::nullopt;
  std::string client(reinterpret_cast<const char*>(endpoint->participant_key),
                     sizeof(endpoint->participant_key));
  client += value_of(user_data_of(library, endpoint->qos), "clientid").value_or("");
  library.free_endpoint(endpoint);
  return client;
}

}  // namespace

ros::Time stamp_of(double monotonic) { return ros::Time::at(since_1970(monotonic)); }

std::string dds_type(std::string_view type) {
  std::string name(type);
  for (const std::string_view kind : {"msg", "srv"}) {
    const std::string middle = "/" + std::string(kind) + "/";
    const std::size_t at = name.find(middle);
    if (at != std::string::npos)
      name.replace(at, middle.size(), "::" + std::string(kind) + "::dds_::");
  }
  return name + "_";
}

std::string dds_topic(const std::string& topic, std::string_view type) {
  if (type == nodes_type) return std::string(nodes_topic);
  const std::string name = topic.substr(topic.starts_with('/') ? 1 : 0);
  if (type.ends_with("_Request")) return "rq/" + name + "Request";
  if (type.ends_with("_Response")) return "rr/" + name + "Reply";
  return std::string(prefix) + name;
}

Participant::Participant(const std::string& who, std::string_view user_data)
    : who_(who), library_(std::make_unique<Library>()), domain_(domain_wanted()) {
  library_->set_log_mask(cyclone::log_errors);  // it says much on stderr that is no fault
  // A domain lives until the process ends, and belongs to all that take part in it.
  const Entity domain = library_->create_domain(domain_, settings().c_str());
  if (domain != cyclone::precondition_not_met) check(domain, "it cannot take part in the network");
  const OwnedQos offer = offer_of(*library_, {.user_data = user_data});
  entity_ =
      library_->create_participant(domain_, user_data.empty() ? nullptr : offer.get(), nullptr);
  check(entity_, "it cannot take part in domain " + std::to_string(domain_));
  waitset_ = library_->create_waitset(entity_);
  publications_ = library_->create_reader(entity_, cyclone::publications_topic, nullptr, nullptr);
  check(std::min(waitset_, publications_), "it cannot look at the network");
}

Participant::~Participant() { library_->remove(entity_); }

void Participant::check(int entity, const std::string& what) const {
  if (entity >= 0) return;
  throw Error(who_, what + " (Cyclone DDS: " + library_->reason(entity) + ")",
              "check CYCLONEDDS_URI, ROS_LOCALHOST_ONLY and the network interfaces");
}

const std::string& Participant::library_path() const { return library_->library.path(); }

void Participant::each_publication(const std::function<void(const Endpoint&)>& use) {
  std::vector<void*> samples(most_publications, nullptr);
  std::vector<SampleInfo> infos(most_publications);
  const int count = library_->read(publications_, samples.data(), infos.data(), samples.size(),
                                   static_cast<std::uint32_t>(samples.size()));
  for (int i = 0; i < count; ++i) {
    const SampleInfo& info = infos[static_cast<std::size_t>(i)];
    if (!info.valid_data || info.instance_state != cyclone::alive_state) continue;
    use(*static_cast<const Endpoint*>(samples[static_cast<std::size_t>(i)]));
  }
  if (count > 0) library_->return_loan(publications_, samples.data(), count);
}

std::vector<Publication> Participant::publications() {
  std::vector<Publication> heard;
  each_publication([&](const Endpoint& endpoint) {
    const std::string topic = endpoint.topic_name;
    if (topic.starts_with(prefix))
      heard.push_back({topic.substr(prefix.size() - 1), ros_type(endpoint.type_name)});
  });
  std::sort(heard.begin(), heard.end());
  heard.erase(std::unique(heard.begin(), heard.end()), heard.end());
  return heard;
}

Generation Participant::generation() {
  // From Iron on every endpoint says the hash of its type; before, none did.
  Generation found = Generation::unknown;
  const Guid own = guid();
  each_publication([&](const Endpoint& endpoint) {
    if (endpoint.topic_name != nodes_topic || found == Generation::from_iron ||
        std::equal(own.begin(), own.end(), std::begin(endpoint.participant_key)))
      return;
    const bool is_new =
        !value_of(user_data_of(*library_, endpoint.qos), "typehash").value_or("").empty();
    found = is_new ? Generation::from_iron : Generation::to_humble;
  });
  return found;
}

Guid Participant::guid() const { return guid_of(*library_, entity_); }

void Participant::wait(double seconds) {
  library_->wait(waitset_, nullptr, 0, duration(std::max(seconds, 0.0)));
}

int Participant::topic(const std::string& name, std::string_view type, const CSample& example) {
  const std::vector<std::uint32_t>& code = example.instructions();
  const std::string type_name = dds_type(type);
  const TopicDescriptor descriptor{.size = static_cast<std::uint32_t>(example.size()),
                                   .align = 8,
                                   .flags = cyclone::no_optimise,
                                   .type_name = type_name.c_str(),
                                   .instruction_count = static_cast<std::uint32_t>(code.size()),
                                   .instructions = code.data(),
                                   .meta = ""};
  const std::string dds_name = dds_topic(name, type);
  const int topic =
      library_->create_topic(entity_, &descriptor, dds_name.c_str(), nullptr, nullptr);
  check(topic, "'" + name + "' is no topic");
  return topic;
}

TopicEnd::TopicEnd(Participant& participant, const std::string& topic, std::string_view type,
                   const CSample& example, const Quality& quality, bool reads)
    : participant_(participant), topic_(topic) {
  const Library& library = *participant.library_;
  const OwnedQos offer = offer_of(library, quality);
  const int of_dds = participant.topic(topic, type, example);
  const auto create = reads ? library.create_reader : library.create_writer;
  entity_ = create(participant.entity_, of_dds, offer.get(), nullptr);
  library.remove(of_dds);  // it lives as long as what reads or writes it
  participant.check(entity_, (reads ? "it cannot read " : "it cannot write ") + topic);
  if (!reads) return;
  library.set_status_mask(entity_, cyclone::data_available);
  library.attach(participant.waitset_, entity_, 0);
}

TopicEnd::~TopicEnd() { participant_.library_->remove(entity_); }

Guid TopicEnd::guid() const { return guid_of(*participant_.library_, entity_); }

bool Reader::take(const std::function<void(std::span<const std::byte>)>& use) {
  const Library& library = *participant_.library_;
  Serdata* message = nullptr;
  SampleInfo info{};
  while (library.take_cdr(entity_, &message, 1, &info, cyclone::any_state) == 1) {
    const std::unique_ptr<Serdata, void (*)(Serdata*)> owned(message, library.cdr_release);
    if (!info.valid_data) continue;  // a writer that went
    sender_ = info.publication_handle;
    iovec place{};
    const auto unreference = [&](Serdata* referred) { library.cdr_unreference(referred, &place); };
    const std::unique_ptr<Serdata, decltype(unreference)> reference(
        library.cdr_reference(message, 0, library.cdr_size(message), &place), unreference);
    use({static_cast<const std::byte*>(place.iov_base), place.iov_len});
    return true;
  }
  return false;
}

int Reader::writers() const {
  return std::max(participant_.library_->matched_writers(entity_, nullptr, 0), 0);
}

bool Writer::write_sample(const CSample& sample) {
  return participant_.library_->write(entity_, sample.data()) >= 0;
}

bool Writer::wait_for_readers(double seconds) {
  return participant_.library_->wait_for_acks(entity_, duration(seconds)) >= 0;
}

int Writer::readers() const {
  return std::max(participant_.library_->matched_readers(entity_, nullptr, 0), 0);
}

Listening listening(const Reader& requests, std::uint64_t client, const Writer& replies) {
  const Library& library = *replies.participant_.library_;
  const std::optional<std::string> who =
      client_of(library, library.matched_writer(requests.entity_, client));
  if (!who) return Listening::gone;
  std::vector<std::uint64_t> readers(static_cast<std::size_t>(replies.readers()));
  const int count = library.matched_readers(replies.entity_, readers.data(), readers.size());
  for (std::size_t i = 0; i < readers.size() && static_cast<int>(i) < count; ++i) {
    if (client_of(library, library.matched_reader(replies.entity_, readers[i])) == who)
      return Listening::yes;
  }
  return Listening::not_yet;
}

}  // namespace palpate::dds
