// SPDX-License-Identifier: Apache-2.0
// Haptic devices end to end: the program, a driver, and a fake of the vendor's library.
#include <cerrno>
#include <chrono>
#include <csignal>
#include <functional>
#include <memory>
#include <thread>

#include <nlohmann/json.hpp>
#include <spawn.h>
#include <unistd.h>

#include "tests/app/program.hpp"
#include "tests/fakes/workbench.hpp"
#include "tests/support/environment.hpp"

namespace palpate {
namespace {

using test::clock_now;
using test::Environment;
using test::Workbench;

constexpr double limit = 1.0;      // [N] that the sessions allow
constexpr double reaction = 0.05;  // [s] after the last good tick in which a force has to be gone
const std::string fakes = PALPATE_FAKES;

// The program in the background, beside a workbench with fakes.
class Hands : public test::Program {
 protected:
  ~Hands() override {
    if (session_ <= 0) return;
    kill(session_, SIGKILL);
    waitpid(session_, nullptr, 0);
  }

  // A slope that rises by 20 degrees along x, touched for as long as the test likes.
  void start(const std::string& device, const std::string& more = "") {
    const std::string command =
        "exec " PALPATE_PROGRAM
        " run --headless --json --duration 60 "
        "--camera 'synthetic:tilt?size=160x120&slope=20deg' --limit max_device_force=1 --device '" +
        device + "' " + more + " >" + path("stdout") + " 2>" + path("stderr");
    const std::array<char*, 4> arguments = {const_cast<char*>("sh"), const_cast<char*>("-c"),
                                            const_cast<char*>(command.c_str()), nullptr};
    ASSERT_EQ(posix_spawn(&session_, "/bin/sh", nullptr, nullptr, arguments.data(), environ), 0);
  }

  // Waits up to a minute, which is for tests that hang; false if the program ended before.
  [[nodiscard]] bool reaches(const std::function<bool()>& condition) {
    for (int i = 0; i < 30'000; ++i) {
      if (condition()) return true;
      if (session_ > 0 && waitpid(session_, nullptr, WNOHANG) == session_) {
        session_ = 0;
        break;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    ADD_FAILURE() << "not reached; the program says: " << test::read(path("stderr"));
    return false;
  }

  // [N] on the motors now
  [[nodiscard]] double motor_force() const { return bench.motor_force(clock_now()); }

  // Ends the program as Ctrl-C does. @return its exit code
  int end() {
    if (session_ <= 0) return -1;
    kill(session_, SIGINT);
    int status = 0;
    waitpid(session_, &status, 0);
    session_ = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  void send(int signal) const { kill(session_, signal); }
  void wait_for_end() {
    waitpid(session_, nullptr, 0);
    session_ = 0;
  }

  // The slope's normal is (-sin 20 deg, 0, cos 20 deg) in the world, whose axes are the device's
  // x to the right, y away and z up.
  // @param right, away, up  [N] the force of the motors along these
  static void expect_along_the_normal(double right, double away, double up) {
    const double size = std::hypot(right, away, up);
    EXPECT_NEAR(right / size, -0.342, 0.06);
    EXPECT_NEAR(away / size, 0.0, 0.06);
    EXPECT_NEAR(up / size, 0.940, 0.03);
  }

  Workbench& bench = test::open_workbench(path("workbench").c_str());

 private:
  Environment place_{Workbench::variable, path("workbench")};
  pid_t session_ = 0;
};

// ---- Force Dimension

class ForceDimensionHands : public Hands {
  Environment library_{"PALPATE_FORCE_DIMENSION", PALPATE_FAKES "/force-dimension"};
};

TEST_F(ForceDimensionHands, TouchASlopeAndSurviveBeingUnplugged) {
  start("force-dimension:");
  ASSERT_TRUE(reaches([&] { return motor_force() > 0.95 * limit; }));
  // The arm's axes: x towards the user, y to the right, z up.
  expect_along_the_normal(bench.force[1], -bench.force[0], bench.force[2]);

  bench.plugged_in = false;
  ASSERT_TRUE(reaches([&] { return motor_force() == 0.0; }));
  bench.plugged_in = true;
  ASSERT_TRUE(reaches([&] { return bench.opens == 2 && motor_force() > 0.5 * limit; }));

  bench.too_fast = true;  // the firmware brakes and takes its forces off
  ASSERT_TRUE(reaches([&] { return motor_force() == 0.0; }));
  ASSERT_TRUE(reaches([&] { return motor_force() > 0.5 * limit; }));

  EXPECT_EQ(end(), 0) << test::read(path("stderr"));
  EXPECT_EQ(motor_force(), 0.0);
  EXPECT_FALSE(bench.force_on);
  EXPECT_LE(bench.largest, limit + 1e-9);
  EXPECT_LE(bench.largest_first, 0.25) << "a force begins small, each time";
}

TEST_F(ForceDimensionHands, GiveNoForceToAHandThatBeginsWithinTheSurface) {
  bench.path = test::Path::inside;
  start("force-dimension:");
  ASSERT_TRUE(reaches([&] { return bench.commands > 1500; }));
  EXPECT_EQ(end(), 0);
  EXPECT_EQ(bench.largest, 0.0);
}

TEST_F(ForceDimensionHands, LetGoWhenTheProgramIsKilled) {
  start("force-dimension:");
  ASSERT_TRUE(reaches([&] { return motor_force() > 0.95 * limit; }));
  send(SIGKILL);
  wait_for_end();
  EXPECT_GT(std::hypot(bench.force[0], bench.force[1], bench.force[2]), 0.5) << "it was killed so";
  EXPECT_EQ(bench.motor_force(bench.commanded + reaction), 0.0);
}

TEST_F(ForceDimensionHands, LetGoWhenTheProgramIsStoppedAndBeginAnewAfter) {
  start("force-dimension:");
  ASSERT_TRUE(reaches([&] { return motor_force() > 0.95 * limit; }));
  send(SIGSTOP);
  ASSERT_TRUE(reaches([&] { return clock_now() > bench.commanded + reaction; }));
  EXPECT_EQ(motor_force(), 0.0);
  send(SIGCONT);
  ASSERT_TRUE(reaches([&] { return motor_force() > 0.5 * limit; }));
  EXPECT_EQ(end(), 0) << test::read(path("stderr"));
  EXPECT_LE(bench.largest, limit + 1e-9);
  EXPECT_LE(bench.largest_first, 0.25) << "also the first after it went on";
}

TEST_F(ForceDimensionHands, AreRefusedInOneLineThatSaysWhatToDo) {
  const std::string arguments = "run --headless --camera synthetic:plane?size=160x120 --device ";
  bench.calibrated = false;
  expect_refusal(arguments + "force-dimension:", {"omega.3 is not calibrated", "?calibrate"});
  EXPECT_EQ(bench.calibrations, 0);
  bench.calibrated = true;
  expect_refusal(arguments + "force-dimension:4711", {"no arm of that serial", "10517"});
  expect_refusal(arguments + "force-dimension:abc", {"'abc'", "force-dimension:12345"});
  bench.plugged_in = false;
  expect_refusal(arguments + "force-dimension:", {"no arm is plugged in", "USB cable"});
  bench.plugged_in = true;
  {
    const Environment old("PALPATE_FORCE_DIMENSION", PALPATE_FAKES "/force-dimension-old");
    expect_refusal(arguments + "force-dimension:", {"dhdSetWatchdog", "another version"});
  }
  {
    const Environment none("PALPATE_FORCE_DIMENSION", path("none"));
    expect_refusal(arguments + "force-dimension:", {"is not there", "www.forcedimension.com"});
  }
  EXPECT_EQ(bench.commands, 0);
}

TEST_F(ForceDimensionHands, AreShownByTheDoctor) {
  bench.devices = 2;
  const Outcome outcome = run("doctor --json --seconds 0.1");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto report = nlohmann::json::parse(outcome.out);
  for (const auto& driver : report["drivers"]) {
    if (driver["name"] != "force-dimension:") continue;
    EXPECT_EQ(driver["library"], fakes + "/force-dimension/libdrd.so.3");
    EXPECT_EQ(driver["version"], "3.17.5");
    EXPECT_EQ(driver["problem"], "");
    ASSERT_EQ(driver["found"].size(), 2U);
    EXPECT_EQ(driver["found"][1]["uri"], "force-dimension:10518");
    EXPECT_EQ(driver["found"][1]["name"], "omega.3");
    EXPECT_FALSE(bench.force_on);
    return;
  }
  ADD_FAILURE() << outcome.out;
}

// ---- Touch

class TouchHands : public Hands {
 protected:
  // OpenHaptics' axes: x to the right, y up, z towards the user.
  void expect_along_the_normal_now() const {
    expect_along_the_normal(bench.force[0], -bench.force[2], bench.force[1]);
  }

 private:
  Environment library_{"PALPATE_OPENHAPTICS", PALPATE_FAKES "/openhaptics"};
};

TEST_F(TouchHands, TouchASlopeByAGuardAndSurviveBeingUnplugged) {
  start("touch:");
  ASSERT_TRUE(reaches([&] { return motor_force() > 0.95 * limit; }));
  expect_along_the_normal_now();

  bench.error = 0x202;  // the driver took the force off: too sudden
  ASSERT_TRUE(reaches([&] { return motor_force() == 0.0; }));
  ASSERT_TRUE(reaches([&] { return motor_force() > 0.5 * limit; }));

  bench.plugged_in = false;
  bench.force_on = false;  // without power
  ASSERT_TRUE(reaches([&] { return bench.opens > 1 || bench.closes > 0; }));
  bench.plugged_in = true;
  ASSERT_TRUE(reaches([&] { return bench.opens == 2 && motor_force() > 0.5 * limit; }));

  EXPECT_EQ(end(), 0) << test::read(path("stderr"));
  EXPECT_TRUE(reaches([&] { return bench.closes == bench.opens; })) << "the guard has ended";
  EXPECT_FALSE(bench.force_on);
  EXPECT_LE(bench.largest, limit + 1e-9);
  EXPECT_LE(bench.largest_first, 0.25);
}

TEST_F(TouchHands, TouchASlopeInTheDriversOwnCallback) {
  start("touch:", "--without-watchdog");
  ASSERT_TRUE(reaches([&] { return motor_force() > 0.95 * limit; }));
  expect_along_the_normal_now();
  EXPECT_EQ(end(), 0) << test::read(path("stderr"));
  EXPECT_FALSE(bench.force_on);
  EXPECT_EQ(bench.closes, 1);
  EXPECT_LE(bench.largest, limit + 1e-9);
}

TEST_F(TouchHands, LetGoWhenTheProgramIsStoppedOrKilled) {
  start("touch:");
  ASSERT_TRUE(reaches([&] { return motor_force() > 0.95 * limit; }));
  send(SIGSTOP);
  ASSERT_TRUE(reaches([&] { return motor_force() == 0.0; })) << "by the guard";
  send(SIGCONT);
  ASSERT_TRUE(reaches([&] { return motor_force() > 0.95 * limit; }));
  EXPECT_LE(bench.largest_first, 0.25);
  send(SIGKILL);
  wait_for_end();
  EXPECT_TRUE(reaches([&] { return bench.closes == 1; })) << "by the guard";
  EXPECT_EQ(motor_force(), 0.0);
}

TEST_F(TouchHands, AreRefusedInOneLineThatSaysWhatToDo) {
  const std::string arguments = "run --headless --camera synthetic:plane?size=160x120 --device ";
  bench.calibrated = false;
  expect_refusal(arguments + "touch:", {"not calibrated", "inkwell"});
  bench.calibrated = true;
  expect_refusal(arguments + "'touch:Left'", {"cannot be opened (no such device)", "Touch_Setup"});
  bench.plugged_in = false;
  expect_refusal(arguments + "touch:", {"cannot be opened (device fault)", "power and cable"});
  const Environment none("PALPATE_OPENHAPTICS", path("none"));
  expect_refusal(arguments + "touch:", {"is not there", "support.3dsystems.com"});
  EXPECT_EQ(bench.commands, 1) << "a zero force while it looked at the calibration";
  EXPECT_EQ(bench.largest, 0.0);
}

}  // namespace
}  // namespace palpate
