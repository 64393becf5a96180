// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "app/machine.hpp"

#include "tests/support/temporary_folder.hpp"

namespace palpate::app {
namespace test_machine {

// A system's folders as a test wants them.
class FakeSystem {
 public:
  void write(const std::string& file, const std::string& text) const {
    const std::filesystem::path path = folder_.path() / file;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path) << text;
  }
  void link(const std::string& file, const std::string& target) const {
    std::filesystem::create_symlink(target, folder_.path() / file);
  }
  [[nodiscard]] Machine look() const { return look_at_machine(folder_.path()); }
  [[nodiscard]] std::uint64_t times_throttled() const {
    return app::times_throttled(folder_.path());
  }
  [[nodiscard]] std::map<std::string, std::uint64_t> interrupts_on(int core) const {
    return app::interrupts_on(core, folder_.path());
  }

 private:
  test::TemporaryFolder folder_;
};

TEST(Machine, IsDescribedByWhatItsSystemSays) {
  const FakeSystem system;
  system.write("proc/cpuinfo",
               "processor\t: 0\nmodel name\t: Some CPU @ 3 GHz\nflags\t\t: fpu avx2 hypervisor\n\n"
               "processor\t: 1\nmodel name\t: Some CPU @ 3 GHz\n");
  system.write("proc/sys/kernel/osrelease", "6.1.0-rt\n");
  system.write("proc/sys/kernel/version", "#1 SMP PREEMPT_RT Debian\n");
  system.write("proc/sys/kernel/sched_rt_runtime_us", "950000\n");
  system.write("proc/sys/kernel/sched_rt_period_us", "1000000\n");
  system.write("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave\n");
  system.write("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave\n");
  system.write("sys/devices/system/cpu/isolated", "1\n");
  const Machine machine = system.look();
  EXPECT_EQ(machine.processor, "Some CPU @ 3 GHz");
  EXPECT_TRUE(machine.is_virtual);
  EXPECT_EQ(machine.kernel, "6.1.0-rt");
  EXPECT_EQ(machine.preemption, "PREEMPT_RT");
  EXPECT_DOUBLE_EQ(machine.fifo_share, 0.95);
  EXPECT_EQ(machine.governors, std::vector<std::string>{"powersave"});
  EXPECT_EQ(machine.isolated_cores, "1");
}

TEST(Machine, SaysWhatDelaysALoop) {
  const FakeSystem system;
  const std::string cpu = "sys/devices/system/cpu/";
  system.write(cpu + "cpu0/cpuidle/state1/latency", "2\n");
  system.write(cpu + "cpu0/cpuidle/state2/latency", "133\n");
  system.write(cpu + "cpu0/cpuidle/state3/latency", "900\n");
  system.write(cpu + "cpu0/cpuidle/state3/disable", "1\n");
  system.write(cpu + "cpu0/thermal_throttle/core_throttle_count", "3\n");
  system.write(cpu + "cpu1/thermal_throttle/package_throttle_count", "4\n");
  system.write(cpu + "smt/active", "1\n");
  system.write("sys/bus/pci/drivers/r8169/bind", "");
  system.write("sys/class/net/lo/mtu", "65536\n");
  system.write("sys/class/net/enp3s0/device/vendor", "0x10ec\n");
  system.link("sys/class/net/enp3s0/device/driver", "../../../../bus/pci/drivers/r8169");
  const Machine machine = system.look();
  EXPECT_DOUBLE_EQ(machine.deepest_sleep, 133e-6);
  EXPECT_EQ(system.times_throttled(), 7U);
  EXPECT_TRUE(machine.threads_share_cores);
  ASSERT_EQ(machine.network.size(), 1U);
  EXPECT_EQ(machine.network[0].name, "enp3s0");
  EXPECT_EQ(machine.network[0].driver, "r8169");
}

TEST(Machine, CountsTheInterruptsOfACore) {
  const FakeSystem system;
  system.write("proc/interrupts",
               "           CPU0       CPU2\n"
               " 28:          5         70  PCI-MSI 524288-edge      enp3s0\n"
               " 29:          9          0  PCI-MSI 524289-edge      nvme0q1\n"
               "LOC:     123456     654321   Local timer interrupts\n");
  using Counts = std::map<std::string, std::uint64_t>;
  EXPECT_EQ(system.interrupts_on(2), (Counts{{"28: enp3s0", 70}}));
  EXPECT_EQ(system.interrupts_on(0), (Counts{{"28: enp3s0", 5}, {"29: nvme0q1", 9}}));
  EXPECT_EQ(system.interrupts_on(1), Counts{});
}

TEST(Machine, ShowsItsCamerasAndHapticDevicesAndNothingElse) {
  const FakeSystem system;
  system.write("sys/class/video4linux/video0/name", "Integrated Webcam\n");
  system.write("sys/bus/usb/devices/1-1/idVendor", "8086\n");
  system.write("sys/bus/usb/devices/1-1/idProduct", "0b07\n");
  system.write("sys/bus/usb/devices/1-2/idVendor", "046d\n");  // a mouse
  system.write("sys/bus/usb/devices/1-2/idProduct", "c077\n");
  system.write("sys/bus/usb/devices/1-3/idVendor", "1451\n");
  system.write("sys/bus/usb/devices/1-3/idProduct", "0301\n");
  system.write("sys/bus/usb/devices/1-0:1.0/bInterfaceClass", "09\n");
  const Machine machine = system.look();
  ASSERT_EQ(machine.devices.size(), 3U);
  EXPECT_EQ(machine.devices[0].where, "/dev/video0");
  EXPECT_EQ(machine.devices[0].name, "Integrated Webcam");
  EXPECT_EQ(machine.devices[1].where, "usb 8086:0b07");
  EXPECT_EQ(machine.devices[1].name, "Intel RealSense D435");
  EXPECT_EQ(machine.devices[2].kind, "haptic device");
  EXPECT_EQ(machine.devices[2].name, "Force Dimension");
}

TEST(Machine, ThatSaysNothingIsNoError) {
  const FakeSystem system;
  const Machine machine = system.look();
  EXPECT_TRUE(machine.devices.empty());
  EXPECT_EQ(machine.fifo_share, 1.0);
  EXPECT_FALSE(machine.is_virtual);
}

}  // namespace test_machine
}  // namespace palpate::app
