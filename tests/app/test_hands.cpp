// SPDX-License-Identifier: Apache-2.0
// Haptic devices end to end: the program, a driver, and a fake of the vendor's library.
#include <cerrno>
#include <chrono>
#include <csignal>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <thread>

#include <fcntl.h>
#include <nlohmann/json.hpp>
#include <spawn.h>
#include <sys/mman.h>
#include <unistd.h>

#include "tests/app/program.hpp"
#include "tests/fakes/workbench.hpp"
#include "tests/support/environment.hpp"

namespace palpate {
namespace test_hands {

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
  // Sends a signal that ends or stops the session on `device` in mid-contact, and waits until the
  // device has `fallen` to no `force`. @param longest_gap  [s] between the device's commands
  // meanwhile
  // @return [s] from the last good tick on, which was up to a period before the signal, without
  //         what signal and commands were late because the machine was
  double reaction_to(int signal, const std::string& device, const std::function<double()>& force,
                     std::atomic<double>& fallen, std::atomic<double>& longest_gap) {
    constexpr double period = 1e-3;
    for (int attempt = 0; attempt < 10; ++attempt) {
      if (!reaches([&] { return force() > 0.95 * limit; })) break;
      longest_gap = 0.0;
      const double before = clock_now();
      send(signal);
      const double sent = clock_now();
      if (signal == SIGKILL) wait_for_end();
      if (!reaches([&] { return force() == 0.0; })) break;
      for (int i = 0; i < 500 && fallen <= before; ++i)  // it is told after the force
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
      const double time = fallen - (sent - period) - std::max(longest_gap - 5.0 * period, 0.0);
      if (fallen > before) {
        RecordProperty(signal == SIGKILL ? "killed_us" : "stopped_us",
                       static_cast<int>(1e6 * time));
        return time;
      }
      // The hand had lifted, or a stall had taken the force off, before the signal came.
      if (signal == SIGKILL)
        start(device);
      else
        send(SIGCONT);
    }
    ADD_FAILURE() << "it was never in contact when the signal came";
    return std::numeric_limits<double>::infinity();
  }
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

TEST_F(ForceDimensionHands, GiveNoSuddenForceToAHandThatBeginsWithinTheSurface) {
  bench.path = test::Path::inside;
  start("force-dimension:");
  ASSERT_TRUE(reaches([&] { return bench.commands > 1500; }));
  EXPECT_EQ(end(), 0);
  // None at all, unless a late tick seats the proxy on the free side: then it rises from nothing.
  EXPECT_LE(bench.largest_first, 0.05);
  EXPECT_LE(bench.largest, limit + 1e-9);
}

// Hazard: dead-process
TEST_F(ForceDimensionHands, LetGoWhenTheProgramIsKilled) {
  // The hand lifts once a second, and a stall takes the force off: it is to be killed with a force.
  double force = 0.0;
  for (int attempt = 0; attempt < 10 && force <= 0.5; ++attempt) {
    start("force-dimension:");
    ASSERT_TRUE(reaches([&] { return motor_force() > 0.95 * limit; }));
    send(SIGKILL);
    wait_for_end();
    force = std::hypot(bench.force[0], bench.force[1], bench.force[2]);
  }
  EXPECT_GT(force, 0.5) << "it was killed so";
  EXPECT_EQ(bench.motor_force(bench.commanded + reaction), 0.0);
}

// Hazard: dead-process
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
  const std::string said = test::read(path("stderr"));
  EXPECT_NE(said.find("at most 3.3 N, 0.88 N continuously, walls up to 400 N/m"), std::string::npos)
      << said;
  EXPECT_NE(said.find("tested with a mock library only"), std::string::npos) << said;
  EXPECT_NE(said.find("set stiffness to 400 N/m"), std::string::npos) << said;

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

// Hazard: dead-process
TEST_F(TouchHands, LetGoWhenTheProgramIsStoppedOrKilled) {
  start("touch:");
  const auto time_after = [&](int signal) {
    return reaction_to(
        signal, "touch:", [&] { return motor_force(); }, bench.fell, bench.longest_gap);
  };
  EXPECT_LE(time_after(SIGSTOP), reaction) << "by the guard";
  send(SIGCONT);
  ASSERT_TRUE(reaches([&] { return motor_force() > 0.95 * limit; }));
  EXPECT_LE(bench.largest_first, 0.25);
  EXPECT_LE(time_after(SIGKILL), reaction) << "by the guard";
  EXPECT_TRUE(reaches([&] { return bench.closes == bench.opens; }));
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

// ---- Haply

class HaplyHands : public Hands {
 protected:
  // Places in the file that test and service share: see inverse_service.py.
  enum Place : std::size_t {
    plugged_in,
    calibrated,
    hangs,
    drops,
    version,
    says_version,
    port,
    force_x,
    force_y,
    force_z,
    largest,
    largest_first,
    commands,
    connections,
    dropped,
    began,
    late,
    behind,
    fell,
    heard,
    longest_gap
  };

  void SetUp() override {
    const std::string file = write("service", std::string(24 * sizeof(double), '\0'));
    const int descriptor = open(file.c_str(), O_RDWR | O_CLOEXEC);
    void* memory =
        mmap(nullptr, 24 * sizeof(double), PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
    close(descriptor);
    ASSERT_NE(memory, MAP_FAILED);
    places_ = static_cast<std::atomic<double>*>(memory);
    at(plugged_in) = at(calibrated) = at(says_version) = 1.0;
    at(version) = 3.4;
    const std::string script = PALPATE_FAKE_SCRIPTS "/inverse_service.py";
    const std::array<char*, 4> arguments = {const_cast<char*>("python3"),
                                            const_cast<char*>(script.c_str()),
                                            const_cast<char*>(file.c_str()), nullptr};
    ASSERT_EQ(posix_spawnp(&service_, "python3", nullptr, nullptr, arguments.data(), environ), 0);
    ASSERT_TRUE(reaches([&] { return at(port) > 0.0; }));
  }
  void TearDown() override {
    kill(service_, SIGKILL);
    waitpid(service_, nullptr, 0);
    munmap(places_, 24 * sizeof(double));
  }

  [[nodiscard]] std::atomic<double>& at(Place place) const { return places_[place]; }
  [[nodiscard]] double force() const {
    return std::hypot(at(force_x).load(), at(force_y).load(), at(force_z).load());
  }
  [[nodiscard]] std::string uri(const std::string& id = "") const {
    return "haply:" + id + "?port=" + std::to_string(static_cast<int>(at(port)));
  }

 private:
  std::atomic<double>* places_ = nullptr;
  pid_t service_ = 0;
};

TEST_F(HaplyHands, TouchASlopeAndSurviveLostAnswersAndBeingUnplugged) {
  start(uri());
  ASSERT_TRUE(reaches([&] { return force() > 0.95 * limit; }));
  expect_along_the_normal(at(force_x), at(force_y), at(force_z));

  at(drops) = 1.0;  // an answer is lost
  ASSERT_TRUE(reaches([&] { return at(dropped) == 1.0 && force() == 0.0; }));
  ASSERT_TRUE(reaches([&] { return force() > 0.5 * limit; }));

  at(late) = 1.0;  // and one comes when it was asked for again
  ASSERT_TRUE(reaches([&] { return at(late) == 0.0 && force() == 0.0; }));
  ASSERT_TRUE(reaches([&] { return force() > 0.5 * limit; }));
  EXPECT_LE(at(behind), 0.1 * at(commands)) << "no state is a message old from then on";

  at(plugged_in) = 0.0;
  ASSERT_TRUE(reaches([&] { return force() == 0.0; }));
  at(plugged_in) = 1.0;
  ASSERT_TRUE(reaches([&] { return force() > 0.5 * limit; }));

  at(hangs) = 1.0;  // the service answers nobody, and the servo goes on
  ASSERT_TRUE(reaches([&] { return at(connections) > 1.0; }));
  at(hangs) = 0.0;
  ASSERT_TRUE(reaches([&] { return force() > 0.5 * limit; }));

  EXPECT_EQ(end(), 0) << test::read(path("stderr"));
  EXPECT_TRUE(reaches([&] { return force() == 0.0; }));
  EXPECT_LE(at(largest), limit + 1e-4);
  EXPECT_LE(at(largest_first), 0.25);
}

TEST_F(HaplyHands, FindTheFormOfTheCommandThatTheServiceTakes) {
  at(version) = 3.5;  // wants 'vector', and does not say that it is 3.5
  at(says_version) = 0.0;
  start(uri("049D"));
  ASSERT_TRUE(reaches([&] { return force() > 0.95 * limit; }));
  EXPECT_EQ(end(), 0) << test::read(path("stderr"));
  EXPECT_LE(at(largest_first), 0.25);
}

// Hazard: dead-process
TEST_F(HaplyHands, LetGoWhenTheProgramIsStoppedOrKilled) {
  at(version) = 3.5;
  start(uri());
  const auto time_after = [&](int signal) {
    return reaction_to(
        signal, uri(), [&] { return force(); }, at(fell), at(longest_gap));
  };
  EXPECT_LE(time_after(SIGSTOP), reaction) << "by the guard";
  send(SIGCONT);
  EXPECT_LE(time_after(SIGKILL), reaction) << "by the guard";
  EXPECT_EQ(force(), 0.0);
  EXPECT_LE(at(largest_first), 0.25);
}

TEST_F(HaplyHands, AreRefusedInOneLineThatSaysWhatToDo) {
  const std::string arguments = "run --headless --camera synthetic:plane?size=160x120 --device ";
  expect_refusal(arguments + "'" + uri("0BAD") + "'", {"no device '0BAD'", "049D"});
  at(calibrated) = 0.0;
  expect_refusal(arguments + "'" + uri() + "'", {"not calibrated", "Haply's Hub"});
  at(plugged_in) = 0.0;
  expect_refusal(arguments + "'" + uri() + "'", {"sees no Inverse3", "cable"});
  expect_refusal(arguments + "haply:?port=1",
                 {"no Inverse Service at localhost:1", "haply-inverse"});
  EXPECT_EQ(at(commands), 0.0);
}

// ---- SpaceMouse and game controllers: hands without motors

class SpacenavHands : public Hands {
  Environment library_{"PALPATE_SPNAV", PALPATE_FAKES "/spnav"};
};

TEST_F(SpacenavHands, TouchASlopeAndSurviveADaemonThatEnds) {
  start("spacenav:");
  ASSERT_TRUE(reaches([&] { return bench.began > 0.0 && clock_now() - bench.began > 2.5; }));
  bench.plugged_in = false;
  ASSERT_TRUE(reaches([&] { return bench.closes == 1; }));
  bench.plugged_in = true;
  ASSERT_TRUE(reaches([&] { return bench.opens == 2; }));
  EXPECT_EQ(end(), 0) << test::read(path("stderr"));
  const auto summary = nlohmann::json::parse(test::read(path("stdout")));
  EXPECT_GT(summary["max_force_sent"], 0.3) << summary;
}

TEST_F(SpacenavHands, AreRefusedInOneLineThatSaysWhatToDo) {
  const std::string arguments = "run --headless --camera synthetic:plane?size=160x120 --device ";
  bench.plugged_in = false;
  expect_refusal(arguments + "spacenav:", {"spacenavd does not answer", "systemctl start"});
  const Environment none("PALPATE_SPNAV", path("none"));
  expect_refusal(arguments + "spacenav:", {"is not there", "apt install libspnav0"});
}

class GamepadHands : public Hands {
  Environment library_{"PALPATE_SDL2", PALPATE_FAKES "/sdl2"};
};

TEST_F(GamepadHands, RumbleAtAContactAndSurviveBeingUnplugged) {
  start("gamepad:");
  ASSERT_TRUE(reaches([&] { return bench.force[1] == 65535.0; })) << "the knock of the contact";
  ASSERT_TRUE(reaches([&] { return bench.force[0] > 2000.0 && bench.force[1] == 0.0; }));
  bench.plugged_in = false;
  ASSERT_TRUE(reaches([&] { return bench.closes == 1; }));
  bench.plugged_in = true;
  ASSERT_TRUE(reaches([&] { return bench.opens == 2; }));
  EXPECT_EQ(end(), 0) << test::read(path("stderr"));
  EXPECT_EQ(bench.closes, 2);
}

TEST_F(GamepadHands, AreRefusedInOneLineThatSaysWhatToDo) {
  const std::string arguments = "run --headless --camera synthetic:plane?size=160x120 --device ";
  expect_refusal(arguments + "gamepad:1", {"no game controller of that number", "/dev/input"});
  expect_refusal(arguments + "gamepad:x", {"'x'", "gamepad:1"});
}

// The fake arm goes where it wants, so nothing can be learned of it; but safely.
TEST_F(ForceDimensionHands, AreMeasuredBelowHalfANewtonAndLetGo) {
  bench.path = test::Path::inside;
  Outcome outcome;
  for (int attempt = 0; attempt < 10; ++attempt) {
    outcome = run("doctor --json --yes --device force-dimension:");
    // It says where the machine stood still, and ends then.
    if (outcome.code == 0 || (outcome.out + outcome.err).find("too busy") == std::string::npos)
      break;
    EXPECT_EQ(motor_force(), 0.0);
  }
  ASSERT_EQ(outcome.code, 0) << outcome.out << outcome.err;
  const nlohmann::json report = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(report["sure"], false);
  EXPECT_FALSE(report["doubts"].empty());
  EXPECT_TRUE(report["proposal"].is_null());
  EXPECT_GT(bench.largest, 0.3) << "it was pushed";
  EXPECT_LT(bench.largest, 0.5);
  EXPECT_EQ(motor_force(), 0.0);
  EXPECT_FALSE(bench.force_on);
  EXPECT_EQ(bench.closes, bench.opens);
}

TEST_F(ForceDimensionHands, AreNotMovedWithoutConsent) {
  expect_refusal("doctor --device force-dimension:", {"was not confirmed", "--yes"});
  EXPECT_EQ(bench.largest, 0.0);
  expect_refusal("doctor --yes", {"--device URI"});
  expect_refusal("doctor --yes --device spacenav:0", {"spacenav:0"});
  expect_refusal("doctor --yes --device mouse:", {"mouse:", "no motors"});
}

// ---- The doctor

class DoctorAndHands : public HaplyHands {
 protected:
  // The drivers of hands, as the doctor lists them, by name.
  [[nodiscard]] std::map<std::string, nlohmann::json> drivers() {
    const Outcome outcome = run("doctor --json --seconds 0.1");
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    std::map<std::string, nlohmann::json> drivers;
    const nlohmann::json report = nlohmann::json::parse(outcome.out);
    for (const auto& driver : report["drivers"]) {
      if (driver["kind"] == "haptic device") drivers[driver["name"]] = driver;
    }
    return drivers;
  }

 private:
  test::NoVendorsUnderASanitizer ours_alone_;
};

TEST_F(DoctorAndHands, ShowsEachThatIsPluggedIn) {
  bench.devices = 2;
  const Environment force_dimension("PALPATE_FORCE_DIMENSION", PALPATE_FAKES "/force-dimension");
  const Environment touch("PALPATE_OPENHAPTICS", PALPATE_FAKES "/openhaptics");
  const Environment spnav("PALPATE_SPNAV", PALPATE_FAKES "/spnav");
  const Environment sdl("PALPATE_SDL2", PALPATE_FAKES "/sdl2");
  const Environment haply("PALPATE_HAPLY",
                          "localhost:" + std::to_string(static_cast<int>(at(port))));
  auto found = drivers();
  ASSERT_EQ(found.size(), 5U);
  for (const auto& [name, driver] : found) EXPECT_EQ(driver["problem"], "") << name;
  EXPECT_EQ(found["force-dimension:"]["library"], fakes + "/force-dimension/libdrd.so.3");
  EXPECT_EQ(found["force-dimension:"]["version"], "3.17.5");
  ASSERT_EQ(found["force-dimension:"]["found"].size(), 2U);
  EXPECT_EQ(found["force-dimension:"]["found"][1]["uri"], "force-dimension:10518");
  EXPECT_EQ(found["force-dimension:"]["found"][1]["name"], "omega.3");
  EXPECT_EQ(found["touch:"]["found"][0]["serial"], "20230117");
  EXPECT_EQ(found["touch:"]["found"][0]["rate_hz"], 1000.0);
  EXPECT_EQ(found["haply:"]["found"][0]["uri"], "haply:049D");
  EXPECT_EQ(found["spacenav:"]["found"].size(), 1U);
  EXPECT_EQ(found["gamepad:"]["found"][0]["name"], "Fake Controller");
  EXPECT_FALSE(bench.force_on);
  EXPECT_EQ(bench.largest, 0.0);
}

TEST_F(DoctorAndHands, SaysWhatToInstallOnAnEmptyMachine) {
  std::vector<std::unique_ptr<Environment>> none;
  for (const char* variable :
       {"PALPATE_FORCE_DIMENSION", "PALPATE_OPENHAPTICS", "PALPATE_SPNAV", "PALPATE_SDL2"})
    none.push_back(std::make_unique<Environment>(variable, path("none")));
  none.push_back(std::make_unique<Environment>("PALPATE_HAPLY", "localhost:1"));
  const std::map<std::string, std::string> remedies = {{"force-dimension:", "forcedimension.com"},
                                                       {"touch:", "support.3dsystems.com"},
                                                       {"haply:", "haply-inverse-service"},
                                                       {"spacenav:", "apt install libspnav0"},
                                                       {"gamepad:", "apt install libsdl2-2.0-0"}};
  auto found = drivers();
  ASSERT_EQ(found.size(), remedies.size());
  for (const auto& [name, remedy] : remedies) {
    EXPECT_TRUE(found[name]["found"].empty()) << name;
    EXPECT_NE(found[name]["problem"].get<std::string>().find(remedy), std::string::npos)
        << found[name];
  }
}

}  // namespace test_hands
}  // namespace palpate
