// SPDX-License-Identifier: Apache-2.0
#include "palpate/viewer/admission.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

namespace palpate {
namespace {

constexpr std::size_t remembered_tokens = 16;  // of an address: pages left open from before

using Padded = std::array<unsigned char, longest_token>;

Padded padded(std::string_view token) {
  Padded bytes{};
  std::copy_n(token.begin(), std::min(token.size(), bytes.size()), bytes.begin());
  return bytes;
}

}  // namespace

bool is_token(std::string_view given, std::string_view token) {
  const Padded a = padded(given);
  const Padded b = padded(token);
  unsigned difference = given.size() == token.size() ? 0U : 1U;
  for (std::size_t i = 0; i < a.size(); ++i) difference |= static_cast<unsigned>(a[i] ^ b[i]);
  // The token's own length is no secret to who set it, and is not shown to anybody else.
  return difference == 0 && !token.empty() && token.size() <= longest_token;
}

double GuessLimit::pause(const std::string& address, double t) const {
  const auto found = addresses_.find(address);
  return found == addresses_.end() ? 0.0 : std::max(found->second.until - t, 0.0);
}

void GuessLimit::wrong(const std::string& address, std::string_view token, double t) {
  if (addresses_.size() >= max_addresses && addresses_.find(address) == addresses_.end())
    addresses_.erase(std::min_element(
        addresses_.begin(), addresses_.end(),
        [](const auto& a, const auto& b) { return a.second.last < b.second.last; }));
  Address& known = addresses_[address];
  if (t - known.last > memory) known = {};
  known.last = t;
  const std::size_t hash = std::hash<std::string_view>{}(token.substr(0, longest_token + 1));
  if (std::find(known.hashes.begin(), known.hashes.end(), hash) != known.hashes.end()) return;
  known.hashes.push_back(hash);
  if (known.hashes.size() > remembered_tokens) known.hashes.pop_front();
  if (++known.guesses <= free_guesses) return;
  const auto beyond = static_cast<double>(known.guesses - free_guesses - 1);
  known.until = t + std::min(std::exp2(std::min(beyond, 30.0)), longest_pause);
}

}  // namespace palpate
