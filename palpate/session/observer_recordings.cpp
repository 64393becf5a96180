// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/observer_recordings.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <ctime>
#include <utility>

#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

// Named after the time, and in `folder` the first of that name.
std::filesystem::path new_folder(const std::filesystem::path& folder) {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  std::array<char, 64> name{};
  std::strftime(name.data(), name.size(), "palpate_%Y-%m-%d_%H-%M-%S", &local);
  std::filesystem::path made = folder / name.data();
  std::error_code unused;
  for (int i = 2; std::filesystem::exists(made, unused); ++i)
    made = folder / (name.data() + ("_" + std::to_string(i)));
  return made;
}

double size_of(const std::filesystem::path& folder) {
  double size = 0.0;
  std::error_code error;
  std::filesystem::directory_iterator file(folder, error);
  for (; !error && file != std::filesystem::directory_iterator(); file.increment(error)) {
    std::error_code gone;
    const std::uintmax_t bytes = file->file_size(gone);
    if (!gone) size += static_cast<double>(bytes);
  }
  return size;
}

}  // namespace

ObserverRecordings::ObserverRecordings(Session& session, RecordingRules rules)
    : session_(session), rules_(std::move(rules)) {
  if (!rules_.own_thread) return;
  thread_ = std::thread([this] {
    while (!end_.rest(std::chrono::duration<double>(rules_.interval))) look();
  });
}

ObserverRecordings::~ObserverRecordings() {
  end_.give();
  if (thread_.joinable()) thread_.join();
}

void ObserverRecordings::start() {
  if (session_.state().recording.on) return;
  if (!rules_.folder.empty()) {
    std::error_code error;
    std::filesystem::create_directories(rules_.folder, error);
    if (error)
      throw Error("--record-folder " + rules_.folder.string(), error.message(),
                  "use a folder with write permission");
  }
  const std::string reason = reason_to_end();
  if (!reason.empty())
    throw Error("recording", reason, "free some space, or start another session");
  const std::filesystem::path folder = new_folder(rules_.folder);
  session_.start_recording(folder.string());
  const std::lock_guard lock(mutex_);
  folders_.push_back(folder);
  ended_.clear();
  watching_ = true;
}

void ObserverRecordings::stop() {
  {
    const std::lock_guard lock(mutex_);
    watching_ = false;
  }
  session_.stop_recording();
}

std::string ObserverRecordings::ended() const {
  const std::lock_guard lock(mutex_);
  return ended_;
}

void ObserverRecordings::look() {
  {
    const std::lock_guard lock(mutex_);
    if (!watching_) return;
  }
  const std::string reason = reason_to_end();
  if (reason.empty()) return;
  session_.stop_recording();
  const std::lock_guard lock(mutex_);
  ended_ = "the recording was ended: " + reason;
  watching_ = false;
}

std::optional<double> ObserverRecordings::room() const {
  const std::lock_guard lock(mutex_);
  return room_;
}

std::string ObserverRecordings::reason_to_end() {
  std::vector<std::filesystem::path> folders;
  {
    const std::lock_guard lock(mutex_);
    folders = folders_;
  }
  double left = rules_.limit;
  for (const auto& folder : folders) left -= size_of(folder);
  if (left <= 0.0)
    return "the recordings of this session have reached " + size_text(rules_.limit) +
           " (--record-limit)";
  std::error_code error;
  const std::filesystem::space_info space =
      std::filesystem::space(rules_.folder.empty() ? "." : rules_.folder, error);
  if (!error && static_cast<double>(space.available) < rules_.keep_free)
    return "less than " + size_text(rules_.keep_free) + " is free on the disk";
  const std::lock_guard lock(mutex_);
  room_ = error ? left : std::min(left, static_cast<double>(space.available) - rules_.keep_free);
  return {};
}

}  // namespace palpate
