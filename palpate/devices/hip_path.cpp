// SPDX-License-Identifier: Apache-2.0
#include "palpate/devices/hip_path.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "palpate/core/error.hpp"

namespace palpate {
namespace {

constexpr double farthest = 1e6;  // [m] where the renderer stops calling it a place
constexpr double longest = 1e6;   // [s] 10^9 ticks at 1 kHz
constexpr std::string_view bom = "\xEF\xBB\xBF";
constexpr std::array<std::string_view, 4> columns{"t", "x", "y", "z"};

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

std::vector<std::string_view> fields_of(std::string_view line) {
  std::vector<std::string_view> fields;
  for (;;) {
    const std::size_t comma = line.find(',');
    fields.push_back(trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return fields;
    line.remove_prefix(comma + 1);
  }
}

// Where in a line the values of t, x, y and z are.
std::array<std::size_t, 4> places_of_columns(std::string_view header, const std::string& subject) {
  const std::vector<std::string_view> names = fields_of(header);
  std::array<std::size_t, 4> places{};
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const auto found = std::find(names.begin(), names.end(), columns[i]);
    if (found == names.end()) {
      throw Error(subject, "its header has no column '" + std::string(columns[i]) + "'",
                  "begin the file with the line 't,x,y,z'");
    }
    places[i] = static_cast<std::size_t>(found - names.begin());
  }
  return places;
}

// What is wrong with a sample after another one, or nothing.
std::string fault(const HipPath::Sample& sample, std::span<const HipPath::Sample> before) {
  if (!std::isfinite(sample.t)) return "t is not finite";
  if (!sample.hip.allFinite()) return "x, y or z is not finite";
  if (sample.hip.cwiseAbs().maxCoeff() > farthest) return "the place is farther than 1000 km";
  if (before.empty()) return {};
  if (!(sample.t > before.back().t)) return "t does not increase";
  if (sample.t - before.front().t > longest) return "the path is longer than 1000000 s";
  return {};
}

constexpr const char* fault_remedy = "give seconds and metres, in the order of time";

void check_not_empty(const std::vector<HipPath::Sample>& samples, const std::string& subject) {
  if (!samples.empty()) return;
  throw Error(subject, "it has no samples", "give a line 't,x,y,z' and one such line for each");
}

}  // namespace

HipPath HipPath::read_csv(const std::filesystem::path& file) {
  const std::string subject = file.string();
  std::ifstream in(file);
  std::error_code unused;
  if (!in || std::filesystem::is_directory(file, unused)) {
    throw Error(subject, "it cannot be read", "name a CSV file with the columns t,x,y,z");
  }
  return parse_csv(in, subject);
}

HipPath HipPath::parse_csv(std::istream& in, const std::string& name) {
  const std::string& subject = name;
  std::string text;
  std::size_t number = 0;
  // The next line that is not blank.
  const auto next_line = [&](std::string_view& line) {
    while (std::getline(in, text)) {
      line = text;
      if (++number == 1 && line.starts_with(bom)) line.remove_prefix(bom.size());
      line = trimmed(line);
      if (!line.empty()) return true;
    }
    return false;
  };

  std::string_view line;
  std::vector<Sample> samples;
  if (!next_line(line)) check_not_empty(samples, subject);
  const std::array<std::size_t, 4> places = places_of_columns(line, subject);
  while (next_line(line)) {
    const std::string at_line = subject + ": line " + std::to_string(number);
    const std::vector<std::string_view> fields = fields_of(line);
    std::array<double, 4> values{};
    for (std::size_t i = 0; i < values.size(); ++i) {
      const std::string_view field =
          places[i] < fields.size() ? fields[places[i]] : std::string_view{};
      const auto [end, error] =
          std::from_chars(field.data(), field.data() + field.size(), values[i]);
      if (field.empty() || error != std::errc{} || end != field.data() + field.size()) {
        throw Error(at_line,
                    std::string(columns[i]) + (field.empty() ? " is missing" : " is not a number"),
                    "give a number for each of t,x,y,z");
      }
    }
    const Sample sample{values[0], Vec3(values[1], values[2], values[3])};
    const std::string wrong = fault(sample, samples);
    if (!wrong.empty()) throw Error(at_line, wrong, fault_remedy);
    samples.push_back(sample);
  }
  if (in.bad()) throw Error(subject, "it cannot be read to its end", "check the disk");
  check_not_empty(samples, subject);
  return HipPath(std::move(samples));
}

HipPath::HipPath(std::vector<Sample> samples) : samples_(std::move(samples)) {
  check_not_empty(samples_, "HIP path");
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const std::string wrong = fault(samples_[i], std::span(samples_).first(i));
    if (!wrong.empty()) {
      throw Error("HIP path: sample " + std::to_string(i + 1), wrong, fault_remedy);
    }
  }
}

Vec3 HipPath::at(double t) const noexcept {
  if (!(t > samples_.front().t)) return samples_.front().hip;
  if (t >= samples_.back().t) return samples_.back().hip;
  const auto next = std::upper_bound(samples_.begin(), samples_.end(), t,
                                     [](double time, const Sample& s) { return time < s.t; });
  const auto last = next - 1;
  return last->hip + (t - last->t) / (next->t - last->t) * (next->hip - last->hip);
}

}  // namespace palpate
