// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/drivers.hpp"

#include <exception>
#include <utility>

#include "palpate/drivers/camera_drivers.hpp"
#include "palpate/drivers/device_drivers.hpp"

namespace palpate {

Registry<Driver> standard_drivers() {
  Registry<Driver> drivers("driver", ":", camera_drivers());
  for (Driver& driver : device_drivers()) drivers.add(std::move(driver));
  return drivers;
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
