// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "palpate/drivers/drivers.hpp"
#include "palpate/drivers/rate_hand.hpp"
#include "palpate/drivers/shared_library.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace gamepad {
namespace {

constexpr std::uint32_t game_controllers = 0x2000;  // SDL_INIT_GAMECONTROLLER
constexpr auto poll_interval = std::chrono::milliseconds(8);
constexpr int polls_of_retry = 60;       // before a pad that was unplugged is looked for
constexpr std::uint32_t rumble_ms = 60;  // [ms] it ends by itself if this process ends
constexpr int polls_of_rumble = 5;       // between two commands to rumble
constexpr int button_count = 15;

struct Version {
  std::uint8_t major, minor, patch;
};

struct Sdl {
  Sdl() {
    set_hint("SDL_NO_SIGNAL_HANDLERS", "1");  // Ctrl-C ends the session
    set_hint("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1");
    if (init(game_controllers) != 0)
      throw Error("gamepad:", std::string("SDL2 does not start (") + get_error() + ")",
                  "check that /dev/input can be read: your account in the group input");
  }
  ~Sdl() { quit(game_controllers); }
  Sdl(const Sdl&) = delete;
  Sdl& operator=(const Sdl&) = delete;

  // SDL's index of the pad of that number, counting pads alone; -1 if there is none.
  [[nodiscard]] int index_of(int number) const {
    const int joysticks = count();
    for (int i = 0; i < joysticks; ++i) {
      if (is_pad(i) != 0 && number-- == 0) return i;
    }
    return -1;
  }

  SharedLibrary library{{.name = "gamepad: (SDL2)",
                         .files = {"libSDL2-2.0.so.0", "libSDL2.so"},
                         .variable = "PALPATE_SDL2",
                         .remedy = "install it: apt install libsdl2-2.0-0"}};
  int (*set_hint)(const char* name, const char* value) = library.find("SDL_SetHint");
  int (*init)(std::uint32_t flags) = library.find("SDL_InitSubSystem");
  void (*quit)(std::uint32_t flags) = library.find("SDL_QuitSubSystem");
  const char* (*get_error)() = library.find("SDL_GetError");
  void (*get_version)(Version* version) = library.find("SDL_GetVersion");
  int (*count)() = library.find("SDL_NumJoysticks");
  int (*is_pad)(int index) = library.find("SDL_IsGameController");
  void* (*open)(int index) = library.find("SDL_GameControllerOpen");
  void (*close)(void* pad) = library.find("SDL_GameControllerClose");
  const char* (*name)(void* pad) = library.find("SDL_GameControllerName");
  void (*update)() = library.find("SDL_GameControllerUpdate");
  int (*is_attached)(void* pad) = library.find("SDL_GameControllerGetAttached");
  std::int16_t (*axis)(void* pad, int axis) = library.find("SDL_GameControllerGetAxis");
  std::uint8_t (*button)(void* pad, int button) = library.find("SDL_GameControllerGetButton");
  int (*rumble)(void* pad, std::uint16_t low, std::uint16_t high,
                std::uint32_t ms) = library.find("SDL_GameControllerRumble");
};

class Pad final : public Sticks {
 public:
  Pad(const std::string& uri, int number) : number_(number) {
    if (!open())
      throw Error(uri, "no game controller of that number is plugged in",
                  "plug one in, and check that /dev/input can be read: your account in the group "
                  "input");
  }
  ~Pad() override {
    if (pad_ != nullptr) sdl_.close(pad_);
  }

  [[nodiscard]] std::string name() const {
    const char* text = sdl_.name(pad_);
    return text == nullptr ? "game controller" : text;
  }

  StickState wait() noexcept override {
    std::this_thread::sleep_for(poll_interval);
    ++polls_;
    sdl_.update();
    if (pad_ != nullptr && sdl_.is_attached(pad_) == 0) {
      sdl_.close(pad_);
      pad_ = nullptr;
    }
    if (pad_ == nullptr && (polls_ % polls_of_retry != 0 || !open())) return {.plugged_in = false};
    const auto share = [this](int axis) { return sdl_.axis(pad_, axis) / 32768.0; };
    StickState state;
    // SDL's axes grow to the right and down: left stick 0 and 1, right stick 2 and 3.
    state.deflection = Vec3(share(0), -share(1), -share(3));
    for (int i = 0; i < button_count; ++i)
      if (sdl_.button(pad_, i) != 0) state.buttons |= 1U << static_cast<unsigned>(i);
    return state;
  }

  void feel(double share, bool begins) noexcept override {
    const bool ended = share == 0.0 && rumbles_;
    if (pad_ == nullptr || !(begins || ended || (share > 0.0 && polls_ % polls_of_rumble == 0)))
      return;
    rumbles_ = share > 0.0;
    const auto strength = static_cast<std::uint16_t>(20000.0 * share);
    const std::uint16_t knock = begins ? 65535 : 0;
    sdl_.rumble(pad_, strength, knock, rumbles_ ? rumble_ms : 0);
  }

 private:
  bool open() noexcept {
    const int index = sdl_.index_of(number_);
    pad_ = index < 0 ? nullptr : sdl_.open(index);
    return pad_ != nullptr;
  }

  Sdl sdl_;
  int number_;
  void* pad_ = nullptr;
  unsigned polls_ = 0;
  bool rumbles_ = false;
};

std::unique_ptr<Device> open_pad(const Uri& uri) {
  const RateOptions options = rate_options(uri);
  const std::string& number = uri.path();
  if (number.size() > 1 || number.find_first_not_of("0123456789") != std::string::npos)
    throw Error(uri.text(), "'" + number + "' is no number of a game controller",
                "write gamepad:, or gamepad:1 for the second");
  auto pad = std::make_unique<Pad>(uri.text(), number.empty() ? 0 : number.front() - '0');
  DeviceInfo info{.uri = uri.text(), .kind = pad->name() + " by SDL2", .limits = no_motors};
  return std::make_unique<RateHand>(std::move(pad), info, options);
}

DriverReport look() {
  const Sdl sdl;
  Version version{};
  sdl.get_version(&version);
  DriverReport report{.library = sdl.library.path(),
                      .version = version_text({version.major, version.minor, version.patch})};
  for (int number = 0; sdl.index_of(number) >= 0; ++number) {
    void* pad = sdl.open(sdl.index_of(number));
    if (pad == nullptr) continue;
    const char* name = sdl.name(pad);
    report.found.push_back({.uri = "gamepad:" + std::to_string(number),
                            .name = name == nullptr ? "game controller" : name});
    sdl.close(pad);
  }
  return report;
}

}  // namespace
}  // namespace gamepad

Driver gamepad_driver() {
  return {.name = "gamepad",
          .summary = "a game controller by SDL2: moves the hand, rumbles at a contact",
          .tried = "a mock library only",
          .open_device = gamepad::open_pad,
          .look = reporting(gamepad::look)};
}

}  // namespace palpate
