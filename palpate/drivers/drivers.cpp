// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/drivers.hpp"

#include <algorithm>
#include <exception>
#include <fstream>
#include <utility>

namespace palpate {

std::vector<Driver> listed_drivers();  // made by CMake of this folder's files *_driver.cpp

Registry<Driver> standard_drivers() {
  std::vector<Driver> drivers = listed_drivers();
  std::stable_partition(drivers.begin(), drivers.end(),
                        [](const Driver& driver) { return driver.open_camera != nullptr; });
  return {"driver", ":", std::move(drivers)};
}

Registry<SourceScheme> all_sources(const Registry<Driver>& drivers) {
  Registry<SourceScheme> sources = standard_sources();
  for (const Driver& driver : drivers.entries()) {
    if (driver.open_camera) sources.add({driver.name, driver.summary, driver.open_camera});
  }
  return sources;
}

Registry<DeviceScheme> all_devices(const Registry<Driver>& drivers) {
  Registry<DeviceScheme> devices = standard_devices();
  for (const Driver& driver : drivers.entries()) {
    if (driver.open_device)
      devices.add({driver.name, driver.summary,
                   [open = driver.open_device](const Uri& uri, const std::optional<HipPath>&) {
                     return open(uri);
                   }});
  }
  return devices;
}

std::function<DriverReport()> reporting(std::function<DriverReport()> look) {
  return [look = std::move(look)]() -> DriverReport {
    try {
      return look();
    } catch (const std::exception& error) {
      return {.problem = error.what()};
    }
  };
}

namespace fs = std::filesystem;

std::string first_line(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

std::vector<fs::path> entries_of(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code error;
  for (auto entry = fs::directory_iterator(folder, error); !error && entry != fs::end(entry);
       entry.increment(error))
    found.push_back(entry->path());
  std::sort(found.begin(), found.end());
  return found;
}

std::vector<std::string> usb_ids(const fs::path& root) {
  std::vector<std::string> ids;
  for (const fs::path& entry : entries_of(root / "sys/bus/usb/devices")) {
    const std::string vendor = first_line(entry / "idVendor");
    if (!vendor.empty()) ids.push_back(vendor + ":" + first_line(entry / "idProduct"));
  }
  return ids;
}

bool is_usb_of(const std::string& id, std::span<const std::string> known) {
  return !id.empty() && std::any_of(known.begin(), known.end(),
                                    [&](const std::string& one) { return id.starts_with(one); });
}

std::string usb_permission_remedy(const std::string& id) {
  return "to allow it, put SUBSYSTEM==\"usb\", ATTRS{idVendor}==\"" + id.substr(0, 4) +
         "\", MODE=\"0666\" into /etc/udev/rules.d/60-palpate.rules, run udevadm control --reload "
         "and plug it in again; also close other programs that use it";
}

std::string unopened_by_usb(std::string_view scheme, std::span<const std::string> known,
                            const std::string& why) {
  for (const std::string& found : usb_ids()) {
    if (is_usb_of(found, known))
      return std::string(scheme) + " it is plugged in (USB " + found + ") but cannot be opened" +
             (why.empty() ? "" : " (" + why + ")") + "; " + usb_permission_remedy(found);
  }
  return {};
}

}  // namespace palpate
