// SPDX-License-Identifier: Apache-2.0
#include "robot/simulation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>
#include <numbers>
#include <stdexcept>

#include <Eigen/Eigenvalues>
#include <mujoco/mujoco.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/pose.hpp"
#include "palpate/kernel/core/rotation.hpp"
#include "palpate/servo/mailbox.hpp"
#include "palpate/servo/periodic_thread.hpp"
#include "palpate/servo/realtime.hpp"

#include "robot/models.hpp"

namespace palpate::robot {
namespace {

constexpr int arm_joints = 6;
constexpr int arm_group = 1;  // of geoms
constexpr double pi = std::numbers::pi;

// How the reference follows commands: critically damped, 4 Hz. With the velocity of the command fed
// forward its gain is within 3 dB up to 10 Hz; a position without velocity is followed up to 2.6
// Hz.
constexpr double reference_rate = 2.0 * pi * 4.0;  // [rad/s]
constexpr double max_acceleration = 20.0;          // [m/s^2] of the reference
// The spring between tip and reference: stiffer, the loop of 1 kHz rings against a stiff contact.
constexpr double stiffness = 1500.0;       // [N/m]
constexpr double hold_stiffness = 300.0;   // [N/m] without commands: can be pushed aside
constexpr double turn_stiffness = 60.0;    // [N m/rad]
constexpr double longest_turn = 0.05;      // [rad] that the reference leads the tool by at most
constexpr double max_spin = 2.0;           // [rad/s] of the reference
constexpr double max_turning = 20.0;       // [rad/s^2] of it
constexpr double turn_damping = 3.0;       // [N m s/rad] critical for the hand's 0.03 kg m^2
constexpr double singular_damping = 0.01;  // [1/kg] bounds the tip's apparent mass by 100 kg
constexpr double touching = 0.5;           // [N] from here on accelerations are not fed forward
constexpr double force_filter = 2.0 * pi * 80.0;  // [rad/s] of the force that the state tells
// The plate's drive: 5 N press it down by 0.1 mm.
constexpr double plate_stiffness = 5e4;  // [N/m]
constexpr double plate_damping = 600.0;  // [N s/m]

// Of a soft skin. In MuJoCo a contact is the softer the less of its acceleration is its own; what
// it has adds to the mass that meets the skin.
constexpr double skin_impedance = 0.05;  // [-]
constexpr double skin_damping = 5.0;     // [N s/m]

constexpr double largest_lag = 0.05;  // [s] that is caught up in real time

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

struct Deleter {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using Model = std::unique_ptr<mjModel, Deleter>;

// What MuJoCo calls where it would end the process. The exception passes through its C frames,
// which hold nothing but memory of the mjData that is not used again.
void throw_error(const char* message) { throw std::runtime_error(message); }

// Else it writes to MUJOCO_LOG.TXT. Warnings are counted in mjData, where `failure` reads them.
void ignore_warning(const char* /*message*/) {}

void install_handlers() {
  static std::once_flag once;
  std::call_once(once, [] {
    mju_user_error = throw_error;
    mju_user_warning = ignore_warning;
  });
}

Model compile(std::string_view mjcf) {
  install_handlers();
  constexpr const char* name = "cell.xml";
  const auto files = std::make_unique<mjVFS>();  // 2 MB
  mj_defaultVFS(files.get());
  std::array<char, 1000> message{};
  Model model;
  try {
    // An empty text would make a file without data.
    if (!mjcf.empty() &&
        mj_makeEmptyFileVFS(files.get(), name, static_cast<int>(mjcf.size())) == 0) {
      std::copy(mjcf.begin(), mjcf.end(), static_cast<char*>(files->filedata[0]));
      model.reset(mj_loadXML(name, files.get(), message.data(), message.size()));
    }
  } catch (const std::exception& error) {
    const std::string text = error.what();
    std::copy_n(text.begin(), std::min(text.size(), message.size() - 1), message.begin());
  }
  mj_deleteVFS(files.get());
  if (!model) {
    const std::string reason = message.data();
    throw Error("robot's model", reason.empty() ? "it is empty" : reason, "correct the MJCF text");
  }
  return model;
}

int find(const mjModel& model, int type, const char* name) {
  const int id = mj_name2id(&model, type, name);
  if (id < 0)
    throw Error("robot's model", "it has no " + std::string(mju_type2Str(type)) + " '" + name + "'",
                "give it one, as robot/models/desk.xml does");
  return id;
}

std::vector<double> numbers(const mjModel& model, const char* name, int count) {
  const int id = find(model, mjOBJ_NUMERIC, name);
  const double* const first = model.numeric_data + model.numeric_adr[id];
  if (model.numeric_size[id] != count)
    throw Error("robot's model: numeric '" + std::string(name) + "'",
                "it has " + std::to_string(model.numeric_size[id]) + " numbers",
                "give it " + std::to_string(count));
  return {first, first + count};
}

Vec3 vector(const mjtNum* from) { return Eigen::Map<const Vec3>(from); }

Eigen::Isometry3d isometry(const mjtNum* position, const mjtNum* quaternion) {
  return Eigen::Translation3d(vector(position)) *
         Eigen::Quaterniond(quaternion[0], quaternion[1], quaternion[2], quaternion[3])
             .normalized();
}

// Capsules and cylinders of MuJoCo lie along z, ours along y.
std::optional<VisibleGeom> visible(const mjModel& model, int geom) {
  const mjtNum* const size = model.geom_size + 3 * static_cast<std::ptrdiff_t>(geom);
  Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
  std::optional<Shape> shape;
  switch (model.geom_type[geom]) {
    case mjGEOM_PLANE:
      shape = HalfSpace{};
      break;
    case mjGEOM_SPHERE:
      shape = Sphere{size[0]};
      break;
    case mjGEOM_BOX:
      shape = block(vector(size));
      break;
    case mjGEOM_CAPSULE:
      shape = Capsule{size[0], size[1]};
      turn.rotate(Eigen::AngleAxisd(0.5 * pi, Vec3::UnitX()));
      break;
    case mjGEOM_CYLINDER:
      shape = Cylinder{size[0], size[1]};
      turn.rotate(Eigen::AngleAxisd(0.5 * pi, Vec3::UnitX()));
      break;
    default:
      return std::nullopt;
  }
  const int body = model.geom_bodyid[geom];
  return VisibleGeom{*shape, static_cast<std::size_t>(body),
                     isometry(model.geom_pos + 3 * static_cast<std::ptrdiff_t>(geom),
                              model.geom_quat + 4 * static_cast<std::ptrdiff_t>(geom)) *
                         turn,
                     model.geom_group[geom] == arm_group, model.body_weldid[body] == 0};
}

void check_range(double value, double least, double most, const std::string& what,
                 const std::string& unit) {
  if (!(value >= least && value <= most))
    throw Error(what, shortest(value) + " " + unit + " is out of range",
                "give " + shortest(least) + " to " + shortest(most) + " " + unit);
}

double checked_hole(const SimulationSetup& setup) {
  check_range(setup.hole, 0.011, 0.06, "board's hole", "m");
  return setup.hole;
}

}  // namespace

void validate(const PlateMotion& plate) {
  check_range(plate.height, 0.0, 0.2, "plate's height", "m");
  check_range(plate.stroke, 0.0, 0.2, "plate's stroke", "m");
  check_range(plate.frequency, 0.0, 5.0, "plate's frequency", "Hz");
  check_range(plate.height + plate.stroke, 0.0, 0.25, "plate's height and stroke together", "m");
}

class Simulation::Implementation {
 public:
  Implementation(std::string_view mjcf, const SimulationSetup& setup)
      : setup_(setup), model_(compile(mjcf)) {
    validate(setup.plate);
    check_range(setup.max_force, 0.5, 30.0, "robot's max_force", "N");
    check_range(setup.max_speed, 0.01, 1.0, "robot's max_speed", "m/s");
    check_range(setup.plate_stiffness.value_or(1e3), 50.0, 5e3, "plate's stiffness", "N/m");
    data_.reset(mj_makeData(model_.get()));
    if (!data_) throw Error("robot's model", "there is no memory for it", "free some");
    find_parts();
    begin();
  }

  void find_parts() {
    const mjModel& m = *model_;
    if (m.nu != arm_joints || m.njnt < arm_joints + 1 || m.nv < arm_joints + 1)
      throw Error("robot's model", "it has not six motors and more than six joints",
                  "drive the arm by six motors, as robot/models/desk.xml does");
    for (int i = 0; i < arm_joints; ++i) {
      if (m.jnt_type[i] != mjJNT_HINGE || m.actuator_trnid[2 * i] != i)
        throw Error("robot's model", "its first six joints are not hinges with a motor each",
                    "put the arm first, as robot/models/desk.xml does");
      info_.joint_names.emplace_back(mj_id2name(&m, mjOBJ_JOINT, i));
      const int body = m.jnt_bodyid[i];
      // Joints that share a place make no link.
      const mjtNum* const offset = m.body_pos + 3 * static_cast<std::ptrdiff_t>(body);
      if (chain_.empty() || vector(offset).norm() > 0.0) chain_.push_back(body);
    }
    tip_site_ = find(m, mjOBJ_SITE, "tip");
    base_site_ = find(m, mjOBJ_SITE, "base");
    tip_geom_ = find(m, mjOBJ_GEOM, "tip");
    plate_joint_ = find(m, mjOBJ_JOINT, "plate");
    if (m.jnt_type[plate_joint_] != mjJNT_SLIDE)
      throw Error("robot's model: joint 'plate'", "it does not slide", "make it a slide joint");
    if (setup_.plate_stiffness) soften_plate(*setup_.plate_stiffness);
    plate_dof_ = m.jnt_dofadr[plate_joint_];
    plate_mass_ = m.body_subtreemass[m.jnt_bodyid[plate_joint_]];
    const std::vector<double> home = numbers(m, "home", arm_joints);
    std::copy(home.begin(), home.end(), data_->qpos);
    const std::vector<double> reach = numbers(m, "reach", 6);
    reach_ = Eigen::AlignedBox3d(vector(reach.data()), vector(reach.data() + 3));
    if (reach_.isEmpty())
      throw Error("robot's model: numeric 'reach'", "a least number is above its largest",
                  "give least x, y, z and then largest x, y, z");
    info_.kind = "simulated arm";
    info_.turns = true;
    info_.reach = reach_;
    info_.max_speed = setup_.max_speed;
    info_.lag = 0.0;  // with the velocity fed forward
    info_.stiffness = stiffness;
    info_.max_force = setup_.max_force;
    info_.tool_radius = m.geom_size[3 * static_cast<std::ptrdiff_t>(tip_geom_)];
    for (int i = 0; i < m.ngeom; ++i) {
      if (auto geom = visible(m, i)) geoms_.push_back(std::move(*geom));
    }
  }

  // What touches the plate sinks in by its force over `wanted` [N/m]. With an impedance d and the
  // inverse mass 1/m of what meets, MuJoCo's contact with solref = (-k, -b) is a spring of
  // k m / (1 - d) and a damper of b m / (1 - d).
  void soften_plate(double wanted) {
    mjModel& m = *model_;
    const int plate = find(m, mjOBJ_GEOM, "plate");
    const double inverse_mass =
        m.body_invweight0[2 * static_cast<std::ptrdiff_t>(m.geom_bodyid[tip_geom_])] +
        m.body_invweight0[2 * static_cast<std::ptrdiff_t>(m.geom_bodyid[plate])];
    const double scale = inverse_mass * (1.0 - skin_impedance);
    mjtNum* const solref = m.geom_solref + mjNREF * static_cast<std::ptrdiff_t>(plate);
    solref[0] = -wanted * scale;
    solref[1] = -skin_damping * scale;
    mjtNum* const solimp = m.geom_solimp + mjNIMP * static_cast<std::ptrdiff_t>(plate);
    solimp[0] = solimp[1] = skin_impedance;
    m.geom_priority[plate] = m.geom_priority[tip_geom_] + 1;
  }

  void begin() {
    jacobian_position_.setZero(3, model_->nv);
    jacobian_rotation_.setZero(3, model_->nv);
    full_mass_.setZero(model_->nv, model_->nv);
    kept_.resize(static_cast<std::size_t>(history / model_->opt.timestep));
    for (BodyPoses& poses : kept_)
      poses.world_from_body.resize(static_cast<std::size_t>(model_->nbody));
    data_->qpos[model_->jnt_qposadr[plate_joint_]] = plate_at(0.0).height;
    data_->qvel[plate_dof_] = plate_at(0.0).velocity;
    plate_height_ = plate_at(0.0).height;
    mj_forward(model_.get(), data_.get());
    reference_ = tip();
    goal_ = reference_;
    goal_turn_ = reference_turn_ = tip_turn();
    last_tip_ = {reference_, goal_turn_};
    state_.joints.resize(arm_joints);
    state_.links.resize(chain_.size() + 2);
    tell(0.0);
    keep();
  }

  // One step. Whatever is told belongs to the time at its beginning, for which MuJoCo has computed
  // positions and forces that fit each other.
  void step() noexcept {
    if (!state_.fault.empty()) return;
    try {
      mj_step1(model_.get(), data_.get());
      keep();
      take_command();
      lead();
      drive_plate();
      mj_step2(model_.get(), data_.get());
      tell(model_->opt.timestep);
      if (const std::string why = failure(); !why.empty()) fail(why);
    } catch (const std::exception& error) {
      fail(error.what());
    }
    ++steps_;
  }

  void fail(const std::string& why) {
    state_.fault = "the simulation has failed: " + why + "; open the robot again";
  }

  [[nodiscard]] std::string failure() const {
    for (const int warning : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC, mjWARN_BADCTRL,
                              mjWARN_CONTACTFULL, mjWARN_CNSTRFULL}) {
      const mjWarningStat& stat = data_->warning[warning];
      if (stat.number > 0) return mju_warningText(warning, stat.lastinfo);
    }
    return {};
  }

  [[nodiscard]] Vec3 tip() const {
    return vector(data_->site_xpos + 3 * static_cast<std::ptrdiff_t>(tip_site_));
  }

  [[nodiscard]] Rotation tip_turn() const {
    return Rotation(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(
        data_->site_xmat + 9 * static_cast<std::ptrdiff_t>(tip_site_)));
  }

  void lead() {
    const mjModel& m = *model_;
    mjData& d = *data_;
    const double dt = m.opt.timestep;
    mj_jacSite(&m, &d, jacobian_position_.data(), jacobian_rotation_.data(), tip_site_);
    Matrix6 jacobian;
    jacobian.topRows<3>() = jacobian_position_.leftCols<6>();
    jacobian.bottomRows<3>() = jacobian_rotation_.leftCols<6>();
    mj_fullM(&m, full_mass_.data(), d.qM);
    const Matrix6 mass = full_mass_.topLeftCorner<6, 6>();
    const Matrix6 mobility =
        jacobian * mass.ldlt().solve(Matrix6(jacobian.transpose()));  // [1/kg, 1/(kg m^2)]
    tip_mobility_ = mobility.topLeftCorner<3, 3>();
    const Matrix6 apparent_mass =
        (mobility + singular_damping * Matrix6::Identity()).ldlt().solve(Matrix6::Identity());
    const Vector6 velocity = jacobian * Eigen::Map<const Vector6>(d.qvel);
    const Vec3 tip_velocity = velocity.head<3>();
    const Vec3 tip_position = tip();
    const Rotation turned = tip_turn();

    const bool led = commanded_ && d.time - commanded_at_ < command_timeout;
    if (led != led_ && !led) {
      // Where the reference comes to rest from its velocity without overshoot.
      goal_ = tip_position + no_longer_than(tip_velocity, setup_.max_speed) / reference_rate;
      goal_velocity_.setZero();
      goal_turn_ = turned;
    }
    led_ = led;
    const double spring = led ? stiffness : hold_stiffness;
    const double longest_lead = setup_.max_force / spring;

    const Vec3 old_velocity = reference_velocity_;
    const Vec3 acceleration =
        no_longer_than(reference_rate * (reference_rate * (goal_ - reference_) +
                                         2.0 * (goal_velocity_ - reference_velocity_)),
                       max_acceleration);
    reference_velocity_ = no_longer_than(old_velocity + acceleration * dt, setup_.max_speed);
    reference_ += reference_velocity_ * dt;
    Vec3 advance = (reference_velocity_ - old_velocity) / dt;
    Vec3 lead = reference_ - tip_position;
    if (lead.norm() > longest_lead) {
      const Vec3 away = lead.normalized();
      lead = longest_lead * away;
      reference_ = tip_position + lead;
      const double gaining = (reference_velocity_ - tip_velocity).dot(away);
      if (gaining > 0.0) reference_velocity_ -= gaining * away;
      advance.setZero();
    }

    const double mean_mass = apparent_mass.topLeftCorner<3, 3>().trace() / 3.0;
    const double damping = 2.0 * std::sqrt(spring * mean_mass);
    const Vec3 old_spin = reference_spin_;
    const Vec3 left = rotation_vector(between(goal_turn_, reference_turn_));
    const Vec3 turning =
        no_longer_than(reference_rate * (reference_rate * left - 2.0 * old_spin), max_turning);
    reference_spin_ = no_longer_than(old_spin + turning * dt, max_spin);
    reference_turn_ = unit(product(rotation_by(reference_spin_ * dt), reference_turn_));
    Vec3 turn = rotation_vector(between(reference_turn_, turned));
    if (turn.norm() > longest_turn) {
      turn = no_longer_than(turn, longest_turn);
      reference_turn_ = unit(product(rotation_by(turn), turned));
      reference_spin_ = velocity.tail<3>();
    }
    Vector6 feed_forward;
    feed_forward << advance, (reference_spin_ - old_spin) / dt;
    if (tip_force_.norm() > touching) feed_forward.setZero();
    Vector6 wrench = apparent_mass * feed_forward;
    wrench.head<3>() += no_longer_than(
        spring * lead + damping * (reference_velocity_ - tip_velocity), setup_.max_force);
    wrench.tail<3>() +=
        turn_stiffness * turn + turn_damping * (reference_spin_ - velocity.tail<3>());

    const Vector6 torque = jacobian.transpose() * wrench + Eigen::Map<const Vector6>(d.qfrc_bias) -
                           Eigen::Map<const Vector6>(d.qfrc_passive);
    for (int i = 0; i < arm_joints; ++i) {
      const double most = m.actuator_ctrlrange[2 * i + 1];
      const double share = std::abs(torque[i]) / most;
      max_torque_share_ = std::max(max_torque_share_, std::min(share, 1.0));
      d.ctrl[i] = std::clamp(torque[i], -most, most);
    }
    tip_velocity_ = tip_velocity;
    last_tip_ = {tip_position, turned};
  }

  struct PlateState {
    double height, velocity, acceleration;
  };
  [[nodiscard]] PlateState plate_at(double t) const {
    const PlateMotion& plate = setup_.plate;
    const double rate = 2.0 * pi * plate.frequency;
    const double phase = rate * (t - plate_since_);
    const double half = 0.5 * plate.stroke;
    return {plate.height + half * (1.0 - std::cos(phase)), half * rate * std::sin(phase),
            half * rate * rate * std::cos(phase)};
  }

  void drive_plate() {
    const PlateState want = plate_at(data_->time);
    const double height = data_->qpos[model_->jnt_qposadr[plate_joint_]];
    const double velocity = data_->qvel[plate_dof_];
    plate_height_ = height;
    data_->qfrc_applied[plate_dof_] =
        data_->qfrc_bias[plate_dof_] + plate_mass_ * want.acceleration +
        plate_stiffness * (want.height - height) + plate_damping * (want.velocity - velocity);
  }

  // The forces of the step, and the state that goes with them.
  void tell(double dt) {
    const mjModel& m = *model_;
    const mjData& d = *data_;
    tip_force_.setZero();
    penetration_ = 0.0;
    for (int i = 0; i < d.ncon; ++i) {
      const mjContact& contact = d.contact[i];
      if (contact.geom1 != tip_geom_ && contact.geom2 != tip_geom_) continue;
      std::array<mjtNum, 6> in_contact{};
      mj_contactForce(&m, &d, i, in_contact.data());
      const Vec3 on_second =
          Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(contact.frame)
              .transpose() *
          vector(in_contact.data());
      tip_force_ += contact.geom2 == tip_geom_ ? on_second : Vec3(-on_second);
      penetration_ = std::max(penetration_, -contact.dist);
    }
    filtered_force_ += std::min(1.0, force_filter * dt) * (tip_force_ - filtered_force_);
    told_at_ = kept_count_ == 0 ? 0.0 : newest().t;
    state_.t = origin_ + told_at_;
    state_.position = last_tip_.position;
    state_.orientation = last_tip_.orientation;
    state_.velocity = tip_velocity_;
    state_.force = filtered_force_;
    std::copy_n(d.qpos, arm_joints, state_.joints.begin());
    state_.links.front() = vector(d.site_xpos + 3 * static_cast<std::ptrdiff_t>(base_site_));
    for (std::size_t i = 0; i < chain_.size(); ++i)
      state_.links[i + 1] = vector(d.xpos + 3 * static_cast<std::ptrdiff_t>(chain_[i]));
    state_.links.back() = state_.position;
  }

  void keep() {
    BodyPoses& poses = kept_[kept_count_++ % kept_.size()];
    poses.t = data_->time;
    for (std::size_t i = 0; i < poses.world_from_body.size(); ++i) {
      const auto at = static_cast<std::ptrdiff_t>(i);
      poses.world_from_body[i] = isometry(data_->xpos + 3 * at, data_->xquat + 4 * at);
    }
  }

  [[nodiscard]] const BodyPoses& newest() const { return kept_[(kept_count_ - 1) % kept_.size()]; }

  [[nodiscard]] BodyPoses poses(double t) const {
    const std::size_t count = std::min(kept_count_, kept_.size());
    std::size_t back = 0;
    // Half a microsecond: times are sums of steps.
    while (back + 1 < count && kept_[(kept_count_ - 1 - back) % kept_.size()].t > t + 5e-7) ++back;
    BodyPoses found = kept_[(kept_count_ - 1 - back) % kept_.size()];
    found.t += origin_;
    return found;
  }

  [[nodiscard]] int body(std::string_view name) const {
    return find(*model_, mjOBJ_BODY, std::string(name).c_str());
  }

  void place(std::string_view name, const Eigen::Isometry3d& world_from_body) {
    check_rigid(world_from_body, "pose of '" + std::string(name) + "'");
    const int joint = model_->body_jntadr[body(name)];
    if (joint < 0 || model_->jnt_type[joint] != mjJNT_FREE)
      throw Error("robot's model: body '" + std::string(name) + "'", "it is not free to move",
                  "place a body that is, such as 'box' or 'ball'");
    mjtNum* const q = data_->qpos + model_->jnt_qposadr[joint];
    const Eigen::Quaterniond turn(world_from_body.linear());
    Eigen::Map<Vec3>{q} = world_from_body.translation();
    q[3] = turn.w();
    q[4] = turn.x();
    q[5] = turn.y();
    q[6] = turn.z();
    std::fill_n(data_->qvel + model_->jnt_dofadr[joint], 6, 0.0);
    mj_kinematics(model_.get(), data_.get());
    --kept_count_;  // the same time again, with the body at its new place
    keep();
  }

  void take_command() {
    const Command* const command = commands_.take();
    if (command == nullptr) return;
    goal_ = command->pose.position.cwiseMax(reach_.min()).cwiseMin(reach_.max());
    goal_turn_ = command->pose.orientation;
    goal_velocity_ = no_longer_than(command->velocity, setup_.max_speed);
    for (int i = 0; i < 3; ++i) {
      if (goal_[i] != command->pose.position[i]) goal_velocity_[i] = 0.0;
    }
    commanded_ = true;
    commanded_at_ = data_->time;
  }

  // [real time]
  void catch_up(double now) {
    const double dt = model_->opt.timestep;
    {
      const std::lock_guard lock(mutex_);
      const double late = now - origin_ - data_->time - dt;
      if (late > largest_lag) origin_ += late;
    }
    for (;;) {
      const std::lock_guard lock(mutex_);
      if (!state_.fault.empty() || origin_ + data_->time + dt > now) break;
      step();
    }
  }

  SimulationSetup setup_;
  Model model_;
  std::unique_ptr<mjData, Deleter> data_;
  RobotInfo info_;
  Eigen::AlignedBox3d reach_;
  std::vector<VisibleGeom> geoms_;
  std::vector<int> chain_;  // bodies of the arm at its bends
  int tip_site_ = 0, base_site_ = 0, tip_geom_ = 0, plate_joint_ = 0, plate_dof_ = 0;
  double plate_mass_ = 0.0, plate_since_ = 0.0;

  struct Command {
    HandPose pose;
    Vec3 velocity = Vec3::Zero();
  };
  Mailbox<Command> commands_;  // so that whoever leads the arm never waits for a step

  mutable std::mutex mutex_;  // over all that follows, and data_
  double origin_ = 0.0;       // [s] time 0 of the simulation on the clock that the state tells
  std::uint64_t steps_ = 0;
  Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor> jacobian_position_, jacobian_rotation_;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> full_mass_;
  Eigen::Matrix3d tip_mobility_ = Eigen::Matrix3d::Identity();  // [1/kg]
  Vec3 goal_ = Vec3::Zero(), goal_velocity_ = Vec3::Zero();
  Vec3 reference_ = Vec3::Zero(), reference_velocity_ = Vec3::Zero();
  Rotation goal_turn_ = Rotation::Identity();
  Rotation reference_turn_ = Rotation::Identity();
  Vec3 reference_spin_ = Vec3::Zero();
  bool commanded_ = false, led_ = false;
  double commanded_at_ = 0.0;
  HandPose last_tip_;
  Vec3 tip_velocity_ = Vec3::Zero();
  Vec3 tip_force_ = Vec3::Zero(), filtered_force_ = Vec3::Zero();
  double penetration_ = 0.0, told_at_ = 0.0, max_torque_share_ = 0.0;
  double plate_height_ = 0.0;
  RobotState state_;
  std::vector<BodyPoses> kept_;  // a ring
  std::size_t kept_count_ = 0;
  std::unique_ptr<PeriodicThread> thread_;  // last: it uses the others
};

Simulation::Simulation(std::string_view mjcf, const SimulationSetup& setup)
    : implementation_(std::make_unique<Implementation>(mjcf, setup)) {}
Simulation::Simulation(const SimulationSetup& setup)
    : Simulation(desk_model(checked_hole(setup)), setup) {}

Simulation::~Simulation() { stop(); }

void Simulation::start() {
  if (runs()) return;
  Implementation& own = *implementation_;
  {
    const std::lock_guard lock(own.mutex_);
    own.origin_ = monotonic_now() - own.data_->time;
    own.state_.t = own.origin_ + own.told_at_;
  }
  RealtimeRequest ordinary;
  ordinary.enabled = false;  // the hand's loop comes first
  own.thread_ = std::make_unique<PeriodicThread>(
      1000.0, ordinary, [&own](const Wake& wake) { own.catch_up(wake.t); });
}

void Simulation::stop() { implementation_->thread_.reset(); }

bool Simulation::runs() const { return implementation_->thread_ != nullptr; }

void Simulation::advance(double t) {
  Implementation& own = *implementation_;
  const std::lock_guard lock(own.mutex_);
  const auto wanted = static_cast<std::uint64_t>(
      std::max(0.0, std::round((t - own.origin_) / own.model_->opt.timestep)));
  while (own.steps_ < wanted && own.state_.fault.empty()) own.step();
}

double Simulation::step_length() const { return implementation_->model_->opt.timestep; }

const RobotInfo& Simulation::info() const { return implementation_->info_; }

void Simulation::command(const HandPose& pose, const Vec3& velocity) noexcept {
  if (pose.position.allFinite() && velocity.allFinite() && is_rotation(pose.orientation))
    implementation_->commands_.put({{pose.position, unit(pose.orientation)}, velocity});
}

RobotState Simulation::state() const {
  const std::lock_guard lock(implementation_->mutex_);
  return implementation_->state_;
}

Truth Simulation::truth() const {
  const Implementation& own = *implementation_;
  const std::lock_guard lock(own.mutex_);
  Truth truth;
  truth.t = own.state_.t;
  truth.tip = own.state_.position;
  truth.tip_velocity = own.tip_velocity_;
  truth.tip_force = own.tip_force_;
  truth.penetration = own.penetration_;
  truth.plate_height = own.plate_height_;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> mobilities(own.tip_mobility_,
                                                                  Eigen::EigenvaluesOnly);
  truth.apparent_mass = 1.0 / std::max(mobilities.eigenvalues()[0], 1e-9);
  return truth;
}

Eigen::Isometry3d Simulation::pose(std::string_view body) const {
  const std::lock_guard lock(implementation_->mutex_);
  const auto at = static_cast<std::size_t>(implementation_->body(body));
  return implementation_->newest().world_from_body[at];
}

void Simulation::place(std::string_view body, const Eigen::Isometry3d& world_from_body) {
  const std::lock_guard lock(implementation_->mutex_);
  implementation_->place(body, world_from_body);
}

void Simulation::set_plate(const PlateMotion& plate) {
  validate(plate);
  const std::lock_guard lock(implementation_->mutex_);
  implementation_->setup_.plate = plate;
  implementation_->plate_since_ = implementation_->data_->time;
}

double Simulation::max_torque_share() const {
  const std::lock_guard lock(implementation_->mutex_);
  return implementation_->max_torque_share_;
}

const std::vector<VisibleGeom>& Simulation::geoms() const { return implementation_->geoms_; }

BodyPoses Simulation::poses(double t) const {
  const std::lock_guard lock(implementation_->mutex_);
  return implementation_->poses(t - implementation_->origin_);
}

std::optional<double> Simulation::ray(const Vec3& origin, const Vec3& direction, bool arm) const {
  const Implementation& own = *implementation_;
  const std::lock_guard lock(own.mutex_);
  const std::array<mjtByte, mjNGROUP> groups{1, static_cast<mjtByte>(arm ? 1 : 0), 1, 1, 1, 1};
  int geom = -1;
  const double along = mj_ray(own.model_.get(), own.data_.get(), origin.data(), direction.data(),
                              groups.data(), 1, -1, &geom);
  if (geom < 0) return std::nullopt;
  return along;
}

}  // namespace palpate::robot
