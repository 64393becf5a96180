// SPDX-License-Identifier: Apache-2.0
#include "app/machine.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <sstream>
#include <string_view>

#include <linux/ethtool.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "palpate/drivers/drivers.hpp"

namespace palpate::app {
namespace {

namespace fs = std::filesystem;

// The vendors and products, as in the public list of USB's numbers; an empty product is any.
struct UsbName {
  std::string_view vendor, product, kind, name;
};
constexpr std::array usb_names = {
    UsbName{"8086", "0ad3", "camera", "Intel RealSense D415"},
    UsbName{"8086", "0b07", "camera", "Intel RealSense D435"},
    UsbName{"8086", "0b3a", "camera", "Intel RealSense D435i"},
    UsbName{"8086", "0b5c", "camera", "Intel RealSense D455"},
    UsbName{"8086", "0b64", "camera", "Intel RealSense L515"},
    UsbName{"045e", "02ae", "camera", "Microsoft Kinect (Xbox 360)"},
    UsbName{"045e", "02c4", "camera", "Microsoft Kinect (Xbox One)"},
    UsbName{"045e", "02d8", "camera", "Microsoft Kinect (Xbox One)"},
    UsbName{"045e", "097c", "camera", "Microsoft Azure Kinect"},
    UsbName{"1d27", "0600", "camera", "ASUS Xtion"},
    UsbName{"1d27", "0601", "camera", "ASUS Xtion Pro Live"},
    UsbName{"1d27", "0609", "camera", "PrimeSense Carmine"},
    UsbName{"2bc5", "", "camera", "Orbbec"},
    UsbName{"2b03", "", "camera", "Stereolabs ZED"},
    UsbName{"03e7", "", "camera", "Luxonis OAK"},
    UsbName{"0403", "cb48", "haptic device", "Novint Falcon"},
    UsbName{"1451", "", "haptic device", "Force Dimension"},
    UsbName{"2988", "", "haptic device", "3D Systems Touch"},
};

// The number that a file consists of; 0 where there is none.
double number_in(const fs::path& file) {
  const std::string text = first_line(file);
  double value = 0.0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

void look_at_processor(const fs::path& root, Machine& machine) {
  std::ifstream in(root / "proc/cpuinfo");
  for (std::string line; std::getline(in, line);) {
    const std::size_t colon = line.find(':');
    if (colon == std::string::npos || colon + 2 > line.size()) continue;
    const std::string value = line.substr(colon + 2) + " ";
    if (line.rfind("model name", 0) == 0 && machine.processor.empty())
      machine.processor = value.substr(0, value.size() - 1);
    if (line.rfind("flags", 0) == 0 && value.find("hypervisor ") != std::string::npos)
      machine.is_virtual = true;
  }
  for (const fs::path& core : entries_of(root / "sys/devices/system/cpu")) {
    const std::string governor = first_line(core / "cpufreq/scaling_governor");
    const auto known = std::find(machine.governors.begin(), machine.governors.end(), governor);
    if (!governor.empty() && known == machine.governors.end())
      machine.governors.push_back(governor);
    for (const fs::path& state : entries_of(core / "cpuidle")) {
      if (first_line(state / "disable") != "1")
        machine.deepest_sleep =
            std::max(machine.deepest_sleep, 1e-6 * number_in(state / "latency"));
    }
  }
  machine.isolated_cores = first_line(root / "sys/devices/system/cpu/isolated");
  machine.threads_share_cores = first_line(root / "sys/devices/system/cpu/smt/active") == "1";
}

void look_at_kernel(const fs::path& root, Machine& machine) {
  machine.kernel = first_line(root / "proc/sys/kernel/osrelease");
  const std::string version = first_line(root / "proc/sys/kernel/version");
  for (const std::string_view kind : {"PREEMPT_RT", "PREEMPT_DYNAMIC", "PREEMPT"}) {
    if (!machine.preemption.empty() || version.find(kind) == std::string::npos) continue;
    machine.preemption = kind;
  }
  const double runtime = number_in(root / "proc/sys/kernel/sched_rt_runtime_us");
  const double period = number_in(root / "proc/sys/kernel/sched_rt_period_us");
  if (runtime >= 0.0 && period > 0.0) machine.fifo_share = std::min(runtime / period, 1.0);
}

void look_at_devices(const fs::path& root, Machine& machine) {
  for (const fs::path& entry : entries_of(root / "sys/class/video4linux"))
    machine.devices.push_back(
        {"/dev/" + entry.filename().string(), first_line(entry / "name"), "camera", {}});
  for (const std::string& id : usb_ids(root)) {
    const std::string vendor = id.substr(0, id.find(':'));
    const std::string product = id.substr(vendor.size() + 1);
    const auto known = std::find_if(usb_names.begin(), usb_names.end(), [&](const UsbName& usb) {
      return usb.vendor == vendor && (usb.product.empty() || usb.product == product);
    });
    if (known == usb_names.end()) continue;
    machine.devices.push_back(
        {"usb " + id, std::string(known->name), std::string(known->kind), id});
  }
}

// [us] that a network interface of this machine may hold packets back; none: it does not say.
std::optional<unsigned> coalescing_of(const std::string& name) {
  ethtool_coalesce asked{};
  asked.cmd = ETHTOOL_GCOALESCE;
  ifreq request{};
  if (name.size() >= sizeof request.ifr_name) return std::nullopt;
  std::copy(name.begin(), name.end(), request.ifr_name);
  request.ifr_data = reinterpret_cast<char*>(&asked);
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (socket < 0) return std::nullopt;
  const bool answered = ::ioctl(socket, SIOCETHTOOL, &request) == 0;
  ::close(socket);
  return answered ? std::optional<unsigned>(asked.rx_coalesce_usecs) : std::nullopt;
}

void look_at_network(const fs::path& root, Machine& machine) {
  for (const fs::path& card : entries_of(root / "sys/class/net")) {
    std::error_code error;
    const fs::path driver = fs::read_symlink(card / "device/driver", error);
    const std::string name = card.filename().string();
    if (!error) machine.network.push_back({name, driver.filename().string(), coalescing_of(name)});
  }
}

}  // namespace

std::map<std::string, std::uint64_t> interrupts_on(int core, const fs::path& root) {
  std::map<std::string, std::uint64_t> counts;
  std::ifstream in(root / "proc/interrupts");
  std::string line;
  std::getline(in, line);
  std::istringstream header(line);
  std::size_t columns = 0;
  std::size_t wanted = 0;  // from 1; 0: the core has none
  for (std::string cpu; header >> cpu;)
    if (++columns; cpu == "CPU" + std::to_string(core)) wanted = columns;
  while (wanted > 0 && std::getline(in, line)) {
    std::istringstream words(line);
    std::string number;
    std::uint64_t count = 0;
    words >> number;
    std::uint64_t on_core = 0;
    for (std::size_t i = 1; i <= columns && words >> count; ++i)
      if (i == wanted) on_core = count;
    std::string name;
    for (std::string word; words >> word;) name = word;  // the last one says whose it is
    if (on_core > 0 && number.size() > 1 && number[0] >= '0' && number[0] <= '9')
      counts[number + " " + name] += on_core;
  }
  return counts;
}

std::uint64_t times_throttled(const fs::path& root) {
  std::uint64_t times = 0;
  for (const fs::path& core : entries_of(root / "sys/devices/system/cpu"))
    for (const char* cause : {"core", "package"})
      times += static_cast<std::uint64_t>(
          number_in(core / "thermal_throttle" / (std::string(cause) + "_throttle_count")));
  return times;
}

Machine look_at_machine(const fs::path& root) {
  Machine machine;
  look_at_processor(root, machine);
  look_at_kernel(root, machine);
  look_at_devices(root, machine);
  look_at_network(root, machine);
  return machine;
}

}  // namespace palpate::app
