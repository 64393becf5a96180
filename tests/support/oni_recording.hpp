// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>

#include "palpate/drivers/drivers.hpp"
#include "palpate/drivers/shared_library.hpp"

namespace palpate::test {

/// Lets OpenNI2's own recorder write what its first camera sees into an .oni file.
/// @param library  the runtime's file, which PALPATE_OPENNI2 names, too
/// @param frames   how many go by meanwhile at least
/// @throws std::runtime_error if the runtime refuses.
inline void record_oni(const std::string& library, const std::string& file, int frames) {
  using Handle = void*;
  const SharedLibrary runtime(
      {.name = "OpenNI2", .files = {library}, .variable = {}, .remedy = {}});
  const auto ask = [&runtime]<class... Arguments>(const char* symbol, Arguments... arguments) {
    int (*function)(Arguments...) = runtime.find(symbol);
    if (function(arguments...) != 0) throw std::runtime_error(symbol);
  };
  const auto end = [&runtime](const char* symbol, Handle handle) {
    void (*function)(Handle) = runtime.find(symbol);
    function(handle);
  };
  const auto camera = open_source("openni2:", all_sources());  // keeps the runtime alive
  Handle device = nullptr;
  Handle stream = nullptr;
  Handle recorder = nullptr;
  const char* first = nullptr;
  ask("oniDeviceOpen", first, &device);
  ask("oniDeviceCreateStream", device, 3, &stream);
  ask("oniCreateRecorder", file.c_str(), &recorder);
  ask("oniRecorderAttachStream", recorder, stream, 0);
  ask("oniRecorderStart", recorder);
  ask("oniStreamStart", stream);
  for (int i = 0; i < frames; ++i) {
    if (!camera->next(2.0)) throw std::runtime_error("the camera gives no frames");
  }
  ask("oniRecorderDestroy", &recorder);
  end("oniStreamStop", stream);
  end("oniStreamDestroy", stream);
  ask("oniDeviceClose", device);
}

}  // namespace palpate::test
