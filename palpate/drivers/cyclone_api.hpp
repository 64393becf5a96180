// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <sys/uio.h>

// What palpate uses of the C API of Cyclone DDS 0.10, as dds/dds.h has it: written out, so that
// building needs no package of it. The tests hold it against those headers.
namespace palpate::cyclone {

using Entity = std::int32_t;
using Result = std::int32_t;
using Duration = std::int64_t;  // [ns]
struct Qos;
struct Serdata;

struct SerialisedType {
  unsigned char* data;
  std::uint32_t size;
};

struct TopicDescriptor {
  std::uint32_t size = 0, align = 0, flags = 0, keys = 0;
  const char* type_name = nullptr;
  const void* key_descriptors = nullptr;
  std::uint32_t instruction_count = 0;
  const std::uint32_t* instructions = nullptr;
  const char* meta = nullptr;
  SerialisedType type_information{}, type_mapping{};
  std::uint32_t data_representation = 0;
};

struct SampleInfo {
  std::uint32_t sample_state, view_state, instance_state;
  bool valid_data;
  std::int64_t source_timestamp;
  std::uint64_t instance_handle, publication_handle;
  std::uint32_t disposed_generation_count, no_writers_generation_count;
  std::uint32_t sample_rank, generation_rank, absolute_generation_rank;
};

// What is told about a reader or writer.
struct Endpoint {
  unsigned char key[16];
  unsigned char participant_key[16];
  std::uint64_t participant_instance_handle;
  char* topic_name;
  char* type_name;
  Qos* qos;
};

struct Guid {
  unsigned char bytes[16];
};

constexpr Entity publications_topic = 0x7fff0003;
constexpr Result precondition_not_met = -4;
constexpr int data_kind = 2;  // of a Serdata
constexpr std::uint32_t any_state = 127;
constexpr std::uint32_t alive_state = 16;
constexpr std::uint32_t data_available = 1U << 8;
constexpr std::uint32_t no_optimise = 1;  // flag of a topic
constexpr std::uint32_t log_errors = 3;   // fatal ones among them
constexpr int volatile_data = 0, transient_local = 1, keep_last = 0, best_effort = 0, reliable = 1;

// Instructions: a field, its type, the type of its elements, where the next one is.
constexpr std::uint32_t op_return = 0, op_field = 1U << 24;
constexpr std::uint32_t of_1_byte = 1, of_2_bytes = 2, of_4_bytes = 3, of_8_bytes = 4;
constexpr std::uint32_t of_text = 5, of_sequence = 7, of_array = 8, of_struct = 10, of_flag = 14;

}  // namespace palpate::cyclone
