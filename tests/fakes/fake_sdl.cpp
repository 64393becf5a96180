// SPDX-License-Identifier: Apache-2.0
// SDL2 with a game controller whose right stick is pushed down and up by turns. What it rumbles is
// the force's first two numbers: the slow and the quick motor, 0 to 65535.
#include <cmath>
#include <cstdint>

#include "tests/fakes/workbench.hpp"

namespace {

using palpate::test::clock_now;
using palpate::test::find_workbench;
using palpate::test::workbench;

int pad = 0;

}  // namespace

#define EXPORT extern "C" __attribute__((visibility("default")))

EXPORT int SDL_SetHint(const char*, const char*) { return 1; }
EXPORT int SDL_InitSubSystem(std::uint32_t flags) {
  find_workbench();
  return flags == 0x2000 ? 0 : -1;
}
EXPORT void SDL_QuitSubSystem(std::uint32_t) {}
EXPORT const char* SDL_GetError() { return ""; }
EXPORT void SDL_GetVersion(std::uint8_t* version) {
  version[0] = 2;
  version[1] = 26;
  version[2] = 5;
}
EXPORT int SDL_NumJoysticks() { return workbench().plugged_in ? 2 : 0; }
EXPORT int SDL_IsGameController(int index) {
  return index == 1 ? 1 : 0;  // the first is a joystick without a layout
}
EXPORT void* SDL_GameControllerOpen(int index) {
  if (index != 1 || !workbench().plugged_in) return nullptr;
  ++workbench().opens;
  return &pad;
}
EXPORT void SDL_GameControllerClose(void*) { ++workbench().closes; }
EXPORT const char* SDL_GameControllerName(void*) { return "Fake Controller"; }
EXPORT void SDL_GameControllerUpdate() {
  if (workbench().began == 0.0) workbench().began = clock_now();
}
EXPORT int SDL_GameControllerGetAttached(void*) { return workbench().plugged_in ? 1 : 0; }
EXPORT std::int16_t SDL_GameControllerGetAxis(void*, int axis) {
  if (axis != 3) return 0;
  const double t = clock_now() - workbench().began;
  return std::fmod(t, 1.5) < 1.0 ? 32767 : -32768;  // a second down and half a second up
}
EXPORT std::uint8_t SDL_GameControllerGetButton(void*, int button) { return button == 2 ? 1 : 0; }
EXPORT int SDL_GameControllerRumble(void*, std::uint16_t slow, std::uint16_t quick, std::uint32_t) {
  workbench().force_on = true;
  workbench().command(slow, quick, 0.0, clock_now());
  return 0;
}
