// SPDX-License-Identifier: Apache-2.0
#include "app/machine.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <string_view>

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

std::string first_line(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

std::vector<fs::path> entries(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code error;
  for (auto entry = fs::directory_iterator(folder, error); !error && entry != fs::end(entry);
       entry.increment(error))
    found.push_back(entry->path());
  std::sort(found.begin(), found.end());
  return found;
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
  for (const fs::path& core : entries(root / "sys/devices/system/cpu")) {
    const std::string governor = first_line(core / "cpufreq/scaling_governor");
    const auto known = std::find(machine.governors.begin(), machine.governors.end(), governor);
    if (!governor.empty() && known == machine.governors.end())
      machine.governors.push_back(governor);
  }
  machine.isolated_cores = first_line(root / "sys/devices/system/cpu/isolated");
}

void look_at_kernel(const fs::path& root, Machine& machine) {
  machine.kernel = first_line(root / "proc/sys/kernel/osrelease");
  const std::string version = first_line(root / "proc/sys/kernel/version");
  for (const std::string_view kind : {"PREEMPT_RT", "PREEMPT_DYNAMIC", "PREEMPT"}) {
    if (!machine.preemption.empty() || version.find(kind) == std::string::npos) continue;
    machine.preemption = kind;
  }
  const auto number = [&](const char* name) {
    const std::string text = first_line(root / "proc/sys/kernel" / name);
    double value = 0.0;
    std::from_chars(text.data(), text.data() + text.size(), value);
    return value;
  };
  const double runtime = number("sched_rt_runtime_us");
  const double period = number("sched_rt_period_us");
  if (runtime >= 0.0 && period > 0.0) machine.fifo_share = std::min(runtime / period, 1.0);
}

void look_at_devices(const fs::path& root, Machine& machine) {
  for (const fs::path& entry : entries(root / "sys/class/video4linux"))
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

}  // namespace

Machine look_at_machine(const fs::path& root) {
  Machine machine;
  look_at_processor(root, machine);
  look_at_kernel(root, machine);
  look_at_devices(root, machine);
  return machine;
}

}  // namespace palpate::app
