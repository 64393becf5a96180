// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/ros2_service.hpp"

#include <array>
#include <cstdio>

namespace palpate::dds {
namespace {

constexpr int requests_kept = 10;  // as ROS's own services

}  // namespace

Quality service_quality(std::string_view identity) {
  return {.reliable = true, .depth = requests_kept, .user_data = identity};
}

std::string service_identity(const Guid& participant, unsigned number) {
  std::string text = "serviceid=";
  std::array<char, 8> piece{};
  for (std::size_t i = 0; i < 12; ++i) {  // the rest is the same for all participants
    std::snprintf(piece.data(), piece.size(), "%02x.", static_cast<unsigned>(participant[i]));
    text += piece.data();
  }
  return text + std::to_string(number) + ";";
}

}  // namespace palpate::dds
