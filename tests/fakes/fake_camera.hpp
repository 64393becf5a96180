// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <sstream>
#include <string>
#include <thread>

/// What the cameras of a fake library see and do, as the variable FAKE_CAMERA of the environment
/// says in words such as `cameras=2 width=64 unplug_after=20 back_after=2`. A new text begins anew.
///
/// They see a wall at 0.6 m (`wall=` [m]) with noise of up to 1.5 mm.
class FakeCamera {
 public:
  static FakeCamera& instance() {
    static FakeCamera camera;
    return camera;
  }

  /// Somebody begins to use the library.
  void begin() {
    const char* given = std::getenv("FAKE_CAMERA");
    const std::string text = given == nullptr ? "" : given;
    if (text != text_ || !has_begun_) {
      *this = FakeCamera();
      has_begun_ = true;
      text_ = text;
    }
  }
  /// Somebody looks for cameras. One that was unplugged is back after `back_after` looks.
  void look() {
    begin();
    if (is_unplugged_ && looks_since_++ >= static_cast<int>(number("back_after", 2)))
      is_back_ = true;
  }

  [[nodiscard]] bool has(const std::string& key) const {
    std::istringstream words(text_);
    for (std::string word; words >> word;) {
      if (word.substr(0, word.find('=')) == key) return true;
    }
    return false;
  }
  [[nodiscard]] std::string text(const std::string& key, const std::string& otherwise) const {
    std::istringstream words(text_);
    for (std::string word; words >> word;) {
      if (word.substr(0, word.find('=')) == key && word.size() > key.size())
        return word.substr(key.size() + 1);
    }
    return otherwise;
  }
  [[nodiscard]] double number(const std::string& key, double otherwise) const {
    const std::string value = text(key, "");
    return value.empty() ? otherwise : std::strtod(value.c_str(), nullptr);
  }

  [[nodiscard]] int width() const { return static_cast<int>(number("width", 96)); }
  [[nodiscard]] int height() const { return static_cast<int>(number("height", 72)); }
  [[nodiscard]] double focal() const { return 1.2 * width(); }  ///< [px]
  /// How many are plugged in.
  [[nodiscard]] int cameras() const {
    return is_gone() ? 0 : static_cast<int>(number("cameras", 1));
  }
  /// How often what was plugged in came back: a handle of before is none of its.
  [[nodiscard]] int generation() const { return is_back_ ? 1 : 0; }
  [[nodiscard]] bool is_gone() const { return is_unplugged_ && !is_back_; }

  /// Waits for the next frame, at most `seconds`; false if there is none by then.
  bool wait(double seconds) {
    if (!is_unplugged_ && has("unplug_after") &&
        frames_ >= static_cast<int>(number("unplug_after", 0)))
      is_unplugged_ = true;
    const Clock::time_point limit =
        Clock::now() + std::chrono::duration_cast<Clock::duration>(
                           std::chrono::duration<double>(std::max(seconds, 0.0)));
    if (is_gone() || has("silent")) {
      if (!has("fast")) std::this_thread::sleep_until(limit);
      return false;
    }
    if (!has("fast")) {
      const auto period = std::chrono::duration_cast<Clock::duration>(
          std::chrono::duration<double>(1.0 / number("fps", 30)));
      if (last_ == Clock::time_point()) last_ = Clock::now();
      const Clock::time_point due = std::max(last_ + period, Clock::now() - period);
      if (due > limit) {
        std::this_thread::sleep_until(limit);
        return false;
      }
      std::this_thread::sleep_until(due);
      last_ = due;
    }
    ++frames_;
    return true;
  }
  [[nodiscard]] int frames() const { return frames_; }

  /// Depth of a pixel [m] in the frame that was waited for; 0 in the column of holes at the left.
  [[nodiscard]] double depth(int u, int v) const {
    if (u == 0) return 0.0;
    std::uint32_t mix = static_cast<std::uint32_t>(u) * 73856093U ^
                        static_cast<std::uint32_t>(v) * 19349663U ^
                        static_cast<std::uint32_t>(frames_) * 83492791U;
    mix = (mix ^ (mix >> 13U)) * 1274126177U;
    const double even = static_cast<double>((mix ^ (mix >> 16U)) % 1000U) / 999.0;  // 0 to 1
    return number_wall_() + 1.5e-3 * (2.0 * even - 1.0);
  }

 private:
  using Clock = std::chrono::steady_clock;

  [[nodiscard]] double number_wall_() const {
    if (wall_ == 0.0) wall_ = number("wall", 0.6);
    return wall_;
  }

  std::string text_;
  bool has_begun_ = false, is_unplugged_ = false, is_back_ = false;
  int looks_since_ = 0;
  int frames_ = 0;
  mutable double wall_ = 0.0;
  Clock::time_point last_{};
};

#define FAKE_EXPORT extern "C" __attribute__((visibility("default")))
