// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "palpate/kernel/core/method.hpp"
#include "palpate/kernel/fixtures/fixture_stage.hpp"
#include "palpate/servo/cycle_state.hpp"
#include "palpate/servo/device.hpp"
#include "palpate/servo/freshness.hpp"
#include "palpate/servo/histogram.hpp"
#include "palpate/servo/last_gate.hpp"
#include "palpate/servo/mailbox.hpp"
#include "palpate/servo/passivity_observer.hpp"
#include "palpate/servo/periodic_thread.hpp"
#include "palpate/servo/safety.hpp"
#include "palpate/servo/tick_ring.hpp"
#include "palpate/servo/weight_support.hpp"
#include "palpate/servo/workspace.hpp"

namespace palpate {

class ToolShape;

/// What a user sets, also while the loop runs.
struct ServoSettings {
  /// The method's name, for the record: a new method object is what switches.
  std::string method = "sight";
  Parameters parameters;
  SafetyParameters safety;
  Placement placement;
  /// Virtual fixtures: forbidden regions, guides, viscous regions. Null: none.
  std::shared_ptr<const FixtureSet> fixtures = {};
  /// What the method touches with, for the record, as `method` is. Null: a ball.
  std::shared_ptr<const ToolShape> tool = {};
};

/// @throws Error if one of them does not validate.
void validate(const ServoSettings& settings);

/// All that a cycle has been told. A snapshot, of which the newest is enough however many come
/// between two ticks: what happens once is counted. A tick applies it in this order: method,
/// settings, scene, hold.
struct ServoCommands {
  std::uint64_t number = 0;  ///< as ServoTick::settings_number
  ServoSettings settings;
  /// Counts changes of the whole scene, as where another recording is opened or time jumps in one:
  /// the hand is disengaged, and the proxy starts again on the free side of the surface.
  std::uint64_t scene = 0;
  /// An operator keeps the force off: the hand is disengaged, and everything else continues.
  bool hold = false;
};

/// What was done with the hand in a cycle; bits of `ServoTick::hand`.
enum HandFlag : std::uint32_t {
  hand_present = 1u << 0,
  hand_clutched = 1u << 1,
  /// The proxy was reset to the free side of the surface before the tick, because ticks were
  /// missed.
  proxy_reseated = 1u << 2,
  /// Another method took over before the tick, with the proxy where it was; see Cycle::set_method.
  method_switched = 1u << 3,
  /// The device reported a fault, so there was no force; fault_of() says which.
  hand_fault = 1u << 4,
  /// A latched fault of the safety chain was reset before the tick; see Cycle::reset_faults.
  faults_reset = 1u << 5,
  force_on_hold = 1u << 6,  ///< ServoCommands::hold
};
constexpr unsigned hand_fault_shift = 8;  ///< bits 8 to 15 of `ServoTick::hand`: the DeviceFault

/// The device's fault in a tick's HandFlag bits.
constexpr DeviceFault fault_of(std::uint32_t hand) {
  return static_cast<DeviceFault>((hand >> hand_fault_shift) & 0xffU);
}

/// All that happened in one cycle: what viewers and recorders read.
struct ServoTick {
  Tick tick;                     ///< the method's; `tick.force` is the force asked for
  Vec3 region = Vec3::Zero();    ///< [N] world: asked for by forbidden regions
  Vec3 guidance = Vec3::Zero();  ///< [N] world: asked for by guides and viscous regions
  /// [m] world: the proxy position, additionally displaced out of the forbidden regions. This
  /// position is sent to a robot.
  Vec3 place = Vec3::Zero();
  Vec3 force = Vec3::Zero();  ///< [N] world: the force sent to the device
  /// [N m] world: the torque sent. Zero on a device without motors for it.
  Vec3 torque = Vec3::Zero();
  Vec3 position = Vec3::Zero();  ///< [m] of the hand, device frame
  /// device_from_handle; of a device that tells none the identity
  Rotation handle = Rotation::Identity();
  double gain = 0.0;                  ///< [-] of the safety chain
  ServoEnergy energy;                 ///< that the forces sent before have given to the hand
  double frame_stamp = 0.0;           ///< [s] of the frame taken last; 0 before the first
  double frame_age = 0.0;             ///< [s] of the oldest camera's; infinite before the first
  std::uint64_t number = 0;           ///< of the cycle, from 0
  std::uint64_t frame_number = 0;     ///< of the newest in use, from 1 as put; 0 before the first
  std::uint64_t settings_number = 0;  ///< of those in use, from 1 as set; 0: the first ones
  std::uint32_t safety = 0;           ///< SafetyFlag bits
  std::uint32_t wake_up_ns = 0;       ///< as in Wake
  std::uint32_t previous_compute_ns = 0;  ///< as in Wake
  std::uint32_t fixtures = 0;             ///< bit i: fixture i of the settings gives a force
  std::uint32_t hand = 0;                 ///< HandFlag bits, and the device's fault: see fault_of()
};

/// What is said of several ticks together.
struct TickReport {
  ServoTick newest = {};
  std::uint32_t flags = 0;   ///< TickFlag bits of any of them
  std::uint32_t safety = 0;  ///< SafetyFlag bits of any of them

  void add(const ServoTick& record) {
    newest = record;
    flags |= record.tick.flags;
    safety |= record.safety;
  }
};

/// What the cycles have done so far. The servo's thread writes, any may look.
struct CycleStatistics {
  std::atomic<std::uint64_t> ticks{0};
  std::atomic<std::uint64_t> frames_adopted{0};
  std::atomic<std::uint64_t> frames_dropped{0};  ///< overtaken by a newer one before any tick
  std::atomic<std::uint32_t> hand{0};            ///< HandFlag bits of the last tick
  std::atomic<std::uint32_t> safety{0};          ///< SafetyFlag bits of the last tick
  std::atomic<double> last_t{0.0};               ///< [s] of the last tick, once `ticks` are not 0
  Histogram hand_over;  ///< [ns] from put_frame to the tick that uses the frame
  std::array<std::atomic<std::uint64_t>, safety_flag_count> interventions{};
  std::atomic<bool> force_out{false};  ///< the last tick sent a force or torque other than zero
  std::atomic<std::uint32_t> latched_by{0};  ///< SafetyFlag bits, as SafetyChain::latched_by
  std::atomic<std::uint64_t> gate_cuts{0};   ///< ticks in which the LastGate sent less than asked
  std::atomic<double> heat{0.0};             ///< [-] of the motors, as SafetyChain::heat
};

/// Is something wrong with a hand, so that the others of its session must not push either?
///
/// Its device reports a fault, its safety chain has latched or rejects its input, or its ticks have
/// stopped. Not: nobody holds the device, or it is clutched; nor a late frame, which every hand of
/// a session detects itself. [servo]
/// @param t        [s] now
/// @param silence  [s] without a tick, the first included; infinite where no clock drives the ticks
bool is_in_trouble(const CycleStatistics& hand, double t, double silence) noexcept;

/// A frame that a cycle has in use.
struct FrameInUse {
  std::shared_ptr<const Cloud> cloud;
  double stamp = 0.0;      ///< [s] as the method got it
  std::size_t camera = 0;  ///< which captured it
};

/// Reads all that went into a loop's cycles and came out of them: what a recorder needs. Each part
/// is of one thread; none must outlive the cycle.
struct CycleReader {
  TickRing<ServoTick>::Reader ticks;
  /// Those that ticks use, pushed before the first of these ticks.
  TickRing<AdoptedFrame>::Reader frames;
  /// Before each tick with `method_switched`, pushed before it.
  TickRing<CycleState>::Reader states;
};

/// One cycle of the loop: device read, each camera's newest frame, renderer, fixtures, safety
/// chain, device write.
///
/// Knows no clock: a thread, a test or a free-running session calls `run` with the time. `run` is
/// one thread's, the servo's; what comes from elsewhere goes through mailboxes and out by the ring,
/// so that nothing outside can hold up a cycle.
class Cycle {
 public:
  /// @param method  given the settings' parameters
  /// @param device  must outlive this
  /// @param ring    [ticks] that a reader can fall behind
  /// @throws Error if the settings do not validate or the method refuses its parameters.
  Cycle(std::shared_ptr<Method> method, Device& device, const ServoSettings& settings = {},
        std::size_t ring = 8192);
  /// The same of one that has been told more: for replays.
  Cycle(std::shared_ptr<Method> method, Device& device, const ServoCommands& commands,
        std::size_t ring = 8192);

  /// Couples this hand to others of its session; before the first `run`. While one of them is in
  /// trouble, this one has the fault DeviceFault::another_hand, as if its device reported it: if
  /// only one of two opposing forces stopped, the other would give the user a sudden push.
  /// @param others   of their cycles
  /// @param silence  [s] as is_in_trouble's
  void link(std::vector<std::shared_ptr<const CycleStatistics>> others, double silence) {
    others_ = std::move(others);
    silence_ = silence;
  }

  /// [servo] No allocation, deallocation, lock, system call or exception (as far as the device
  /// keeps its word). `wake.t` is on the clock of the frames' stamps.
  void run(const Wake& wake) noexcept;

  /// Hands a frame of the only camera over; the newest wins. One thread at a time.
  /// Frames are released here or on destruction, never in a tick.
  /// @param stamp  [s] when it was captured, on the loop's clock
  /// @param now    [s] on the loop's clock: measures how long the hand-over takes
  /// @return its number, as in ServoTick::frame_number
  std::uint64_t put_frame(std::shared_ptr<const Cloud> cloud, double stamp, double now);

  /// The same of one of several cameras: of each the newest wins, and a tick takes those that came
  /// in the order of their stamps and then of the cameras' numbers. Each camera's freshness is
  /// judged by itself, and the one that is worst off decides.
  /// @param cameras  the camera that captured it, then the others that have to be alive, each with
  ///                 the stamp of its newest frame; one that is left out is no longer waited for
  /// @throws Error if there are none, or a number is not below Freshness::max_cameras.
  std::uint64_t put_frame(std::shared_ptr<const Cloud> cloud, double stamp,
                          std::span<const CameraFrame> cameras, double now);

  /// Resets a latched fault of the safety chain in the next cycle, by an operator. Any thread.
  void reset_faults() noexcept { fault_resets_.fetch_add(1, std::memory_order_relaxed); }

  /// Tells the cycle what `edit` makes of what it was told last; all of it takes effect in the same
  /// cycle, the next one. Any thread but the servo's.
  /// @param method  replaces the method; null: the same goes on. The new one has no history: it
  ///                gets the parameters, the current proxy position and the newest frame of each
  ///                camera, so a recording can start here in mid-session. The user may feel a
  ///                change: the method `sight` raises the force over most of one frame interval.
  /// @throws Error, changing nothing, if the settings do not validate
  ServoCommands command(const std::function<void(ServoCommands&)>& edit,
                        std::shared_ptr<Method> method = nullptr);
  /// The same for settings alone. @return their number, as in ServoTick::settings_number
  std::uint64_t set_settings(const ServoSettings& settings);
  /// What it was told last. Any thread but the servo's.
  [[nodiscard]] ServoCommands commands() const;

  /// Sees every cycle from the next one on. Any thread.
  [[nodiscard]] TickRing<ServoTick>::Reader reader() const { return ring_.reader(); }
  [[nodiscard]] CycleReader full_reader() const {
    return {ring_.reader(), adopted_.reader(), states_.reader()};
  }
  [[nodiscard]] const CycleStatistics& statistics() const { return statistics_; }
  /// The same for who may live longer than this.
  [[nodiscard]] std::shared_ptr<const CycleStatistics> shared_statistics() const {
    return kept_statistics_;
  }
  [[nodiscard]] const Device& device() const { return device_; }

  /// Makes a new cycle remember what another one did. Before its first `run`, then with set_method
  /// as at that time: for replays.
  /// @param state  as a CycleReader gave it
  /// @param frames  of each camera, the one in use at that time
  /// @throws Error if the state is damaged or of another version.
  void restore(const CycleState& state, std::span<const FrameInUse> frames);

 private:
  struct CapturedFrame {
    std::shared_ptr<const Cloud> cloud;
    double stamp = 0.0;
    double put_at = 0.0;
    std::array<CameraFrame, Freshness::max_cameras> cameras{};  // its own first
    std::size_t camera_count = 0;
    std::uint64_t number = 0;  // among all that were put
  };

  /// What it was told, and the method that this is for.
  struct Change {
    ServoCommands commands;
    std::shared_ptr<Method> method;
  };

  struct Now;
  [[nodiscard]] HandState read_hand(double t) noexcept;
  void adopt(Now& now) noexcept;
  void touch(Now& now) noexcept;
  void protect(Now& now) noexcept;
  void send(Now& now) noexcept;
  void keep(const Now& now, const Wake& wake) noexcept;
  bool adopt_change(const Change& change) noexcept;
  bool adopt_frames(bool method_switched, double t) noexcept;
  void adopt_frame(const CapturedFrame& frame, double t) noexcept;
  void tell_of(const CapturedFrame& frame) noexcept;
  void keep_statistics(const ServoTick& record, const Wrench& wrench) noexcept;
  template <class Way, class Self>
  static void walk(Way& way, Self& self);
  friend std::vector<std::string> cycle_state_names();

  std::shared_ptr<Method> first_method_;
  Method* method_;                                    // in use: that one, or the newest of changes_
  std::shared_ptr<const FixtureSet> first_fixtures_;  // kept as that method is
  Device& device_;
  std::vector<std::shared_ptr<const CycleStatistics>> others_;  // as `link` was told
  double silence_ = 0.0;
  SafetyChain safety_;
  Workspace workspace_;
  WeightSupport support_;
  LastGate gate_;
  Parameters parameters_;  // in use
  Patch patch_;            // for seating the proxy again

  mutable std::mutex writers_;  // of changes, kept apart; the servo never takes it
  Change newest_change_;        // guarded by writers_
  Mailbox<Change> changes_;
  std::array<Mailbox<CapturedFrame>, Freshness::max_cameras> frames_;  // by camera
  std::uint64_t frames_put_ = 0;                                       // of who puts them
  TickRing<ServoTick> ring_;
  TickRing<AdoptedFrame> adopted_{1024};
  TickRing<CycleState> states_{8};
  std::shared_ptr<CycleStatistics> kept_statistics_ = std::make_shared<CycleStatistics>();
  CycleStatistics& statistics_ = *kept_statistics_;

  std::uint64_t number_ = 0;
  Vec3 last_proxy_ = Vec3::Zero();
  Vec3 last_normal_ = Vec3::Zero();
  double last_stamp_ = 0.0;                                       // [s] of the frame taken last
  Rotation last_orientation_ = Rotation::Identity();              // world_from_handle
  std::uint64_t frame_number_ = 0;                                // the highest taken
  ObservedClouds seen_;                                           // in use
  std::array<std::uint64_t, Freshness::max_cameras> taken_in_{};  // tick that took each of them
  std::uint64_t scene_ = 0;                                       // in use, as ServoCommands::scene
  bool on_hold_ = false;                                          // as ServoCommands::hold
  bool placement_changed_ = false;                                // or the scene, before this tick
  Freshness freshness_;
  PassivityObserver passivity_;
  FixtureStage fixtures_;
  std::atomic<std::uint64_t> fault_resets_{0};  // asked for
  std::uint64_t fault_resets_done_ = 0;
};

/// What the numbers of a CycleState are called, in their order; those of equal things are alike.
std::vector<std::string> cycle_state_names();

}  // namespace palpate
