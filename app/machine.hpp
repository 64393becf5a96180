// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace palpate::app {

/// A camera or haptic device that the system shows.
struct FoundDevice {
  std::string where;  ///< such as /dev/video0 or usb 8086:0b07
  std::string name;
  std::string kind;      ///< "camera" or "haptic device"
  std::string usb = {};  ///< vendor and product, such as 8086:0b07; empty: not of that bus
};

/// A network interface with hardware behind it.
struct NetworkCard {
  std::string name;    ///< such as eth0
  std::string driver;  ///< such as e1000e
  /// [us] by which received packets may be held back to share an interrupt; none: it does not say
  std::optional<unsigned> coalescing = {};
};

/// What a machine says of itself; empty where it does not.
struct Machine {
  std::string processor;
  std::string kernel;                  ///< release
  std::string preemption;              ///< such as PREEMPT_RT
  std::vector<std::string> governors;  ///< of the cores' clocks, each once
  std::string isolated_cores;          ///< such as 2-3
  double fifo_share = 1.0;             ///< [-] of the time that real-time threads may take
  double deepest_sleep = 0.0;          ///< [s] to wake from the deepest idle state in use
  bool threads_share_cores = false;    ///< SMT is on
  std::vector<NetworkCard> network;
  bool is_virtual = false;
  std::vector<FoundDevice> devices;
};

/// Looks below `root` as at a system's own folders: dev, proc, sys. Never throws for what is
/// missing.
Machine look_at_machine(const std::filesystem::path& root = "/");

/// How often a core was slowed down by its heat since the system started.
std::uint64_t times_throttled(const std::filesystem::path& root = "/");

/// How many interrupts a core has served, by what they are called. Empty if nothing says so.
std::map<std::string, std::uint64_t> interrupts_on(int core,
                                                   const std::filesystem::path& root = "/");

}  // namespace palpate::app
