// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/drivers.hpp"

#include <algorithm>
#include <exception>
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
      DriverReport report;
      report.problem = error.what();
      return report;
    }
  };
}

}  // namespace palpate
