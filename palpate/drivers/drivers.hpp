// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/io/devices/devices.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/core/registry.hpp"
#include "palpate/kernel/core/uri.hpp"

namespace palpate {

/// A camera or device that a driver sees now.
struct PluggedIn {
  std::string uri;   ///< what opens it: "force-dimension:12345"
  std::string name;  ///< as its driver says: "omega.3"
  std::string serial = {};
  std::string firmware = {};
  std::optional<double> rate = {};          ///< [Hz] at which it delivers or is updated
  SensorKind sensor = SensorKind::unknown;  ///< of a camera
  std::string note = {};  ///< why it cannot be used and what to do; empty if it can
};

/// What a driver finds on this machine.
struct DriverReport {
  std::string library = {};  ///< file of the vendor's library, or address of its service
  std::string version = {};  ///< of the library; empty if it does not say
  std::string problem = {};  ///< why nothing can be opened, with the remedy; empty if all is well
  std::vector<PluggedIn> found = {};
};

/// Cameras or haptic devices of one kind, driven by a vendor's library or service that is looked
/// for when it is asked for: a program needs none of them to start.
struct Driver {
  std::string name;     ///< scheme of its URIs, without ':'
  std::string summary;  ///< what it drives, in a line
  /// What it has been tested with, in a few words: "a mock library only", "a Kinect v1".
  std::string tried;
  /// What USB devices it drives: "1451" for all of a vendor's, or "0403:cb48".
  std::vector<std::string> usb = {};
  /// Opens a camera, or empty. @throws Error
  std::function<std::unique_ptr<Source>(const Uri&)> open_camera = {};
  /// Opens a device, or empty. @throws Error
  std::function<std::unique_ptr<Device>(const Uri&)> open_device = {};
  /// Looks at library and hardware without moving anything. Never throws: the report has it.
  std::function<DriverReport()> look = {};
  /// A device with motors that hold their force when this process dies: what opens it by name puts
  /// it into a guard's process (open_guarded) before it has other threads.
  bool needs_guard = false;
};

/// The library's own drivers, cameras first: what palpate/drivers/NAME_driver.cpp gives by a
/// function `Driver NAME_driver()`. A program adds to a copy.
Registry<Driver> standard_drivers();

/// Kinds of source: standard_sources() and the cameras among the drivers.
Registry<SourceScheme> all_sources(const Registry<Driver>& drivers = standard_drivers());
/// Kinds of device: standard_devices() and the devices among the drivers.
Registry<DeviceScheme> all_devices(const Registry<Driver>& drivers = standard_drivers());

/// Opens a Camera, which is made from its URI: for Driver::open_camera.
template <class Camera>
std::unique_ptr<Source> opened(const Uri& uri) {
  return std::make_unique<Camera>(uri);
}

/// A look that says what `look` throws as the report's problem.
std::function<DriverReport()> reporting(std::function<DriverReport()> look);

/// The first line of a file, such as the system's own; empty where there is none.
std::string first_line(const std::filesystem::path& file);
/// What is in a folder, by name; nothing where there is none.
std::vector<std::filesystem::path> entries_of(const std::filesystem::path& folder);

/// What is plugged in by USB: vendor and product of each, such as "8086:0b07", as the system below
/// `root` shows them. Never throws for what is missing.
std::vector<std::string> usb_ids(const std::filesystem::path& root = "/");

/// Does an id, such as "1451:0301", begin with one of `known`: "1451" or "0403:cb48"?
bool is_usb_of(const std::string& id, std::span<const std::string> known);

/// What to do where the system shows a device by USB that its library does not open: the rule for
/// udev that lets every user open each vendor's, and what else it may be.
std::string usb_permission_remedy(const std::string& id);

/// The problem of a driver whose device is plugged in but is not opened, with its remedy; empty if
/// none is plugged in.
/// @param scheme  of the driver's URIs  @param known  as for is_usb_of
/// @param why     what its library says; empty: nothing
std::string unopened_by_usb(std::string_view scheme, std::span<const std::string> known,
                            const std::string& why = {});

}  // namespace palpate
