// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/viewer/protocol.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

#include <nlohmann/json.hpp>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/rotation.hpp"

namespace palpate {
namespace {

static_assert(std::endian::native == std::endian::little,
              "depths and points are sent as they lie in memory");

enum Kind : std::uint8_t {
  frame = 1,
  ticks = 2,
  rays = 3,
  path = 4,
  tool = 5,
  hand = 16,
  shown = 17
};
enum Grip : std::uint8_t { let_go = 0, held = 1, let_go_towards = 2 };
enum Format : std::uint8_t { depth = 0, depth_with_rays = 1, points = 2 };
// Whose pixels colours are: nobody's, those of the depth or the points, another camera's.
enum class Colours : std::uint8_t { none = 0, registered = 1, own_camera = 2 };

constexpr std::size_t hand_size = 32;
constexpr std::size_t turned_hand_size = 64;  // with an orientation
constexpr std::size_t shown_size = 8;

// Writes numbers one after the other, each aligned as docs/protocol.md says.
class Writer {
 public:
  explicit Writer(std::vector<std::byte>& out) : out_(out) {}

  template <class Number>
  Writer& put(Number value) {
    const std::size_t at = out_.size();
    out_.resize(at + sizeof(Number));
    std::memcpy(out_.data() + at, &value, sizeof(Number));
    return *this;
  }
  Writer& put_float(double value) { return put(static_cast<float>(value)); }
  Writer& put_vec3(const Vec3& v) { return put_float(v.x()).put_float(v.y()).put_float(v.z()); }
  Writer& put_rotation(const Rotation& q) { return put_vec3(q.vec()).put_float(q.w()); }

 private:
  std::vector<std::byte>& out_;
};

template <class Number>
Number read(std::span<const std::byte> message, std::size_t at) {
  Number value;
  std::memcpy(&value, message.data() + at, sizeof(Number));
  return value;
}

Writer& put_pose(Writer& writer, const Eigen::Isometry3d& pose) {
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) writer.put_float(pose(row, column));
  }
  return writer;
}

ViewerMessage frame_message(const FrameHeader& header, Format format,
                            std::span<const std::byte> payload, std::shared_ptr<const void> owner,
                            std::uint32_t triangles = 0) {
  ViewerMessage message;
  Writer writer(message.head);
  const ColourImage* colour = header.colour.get();
  const Colours colours = colour == nullptr ? Colours::none
                          : colour->camera  ? Colours::own_camera
                                            : Colours::registered;
  if (colour != nullptr) {
    const auto count =
        static_cast<std::size_t>(colour->width) * static_cast<std::size_t>(colour->height);
    if (colour->rgb.size() != 3 * count ||
        (!colour->camera && count != std::size_t{header.width} * header.height))
      throw Error("colour for the viewer", "its size is not that of its image");
  }
  writer.put(Kind::frame).put(header.camera).put(format).put(colours);
  writer.put(header.number).put(header.stamp).put(header.width).put(header.height);
  writer.put_float(header.fx).put_float(header.fy).put_float(header.cx).put_float(header.cy);
  writer.put_float(header.metres_per_unit);
  put_pose(writer, header.world_from_camera).put(triangles);
  if (colours == Colours::own_camera) {
    const Intrinsics& k = colour->camera->intrinsics;
    writer.put(static_cast<std::uint32_t>(colour->width));
    writer.put(static_cast<std::uint32_t>(colour->height));
    writer.put_float(k.fx).put_float(k.fy).put_float(k.cx).put_float(k.cy);
    put_pose(writer, colour->camera->world_from_camera.inverse());
  }
  message.is_frame = true;
  message.colour = header.colour;
  message.payload = payload;
  message.owner = std::move(owner);
  return message;
}

// The float arrays' bytes, owned by the message.
std::pair<std::span<const std::byte>, std::shared_ptr<const void>> shared_bytes(
    std::vector<float> values) {
  const auto owner = std::make_shared<const std::vector<float>>(std::move(values));
  return {std::as_bytes(std::span<const float>(*owner)), owner};
}

// @param counts  what says how many numbers there are
template <class... Counts>
ViewerMessage numbers_message(Kind kind, std::uint8_t camera, std::vector<float> numbers,
                              Counts... counts) {
  ViewerMessage message;
  Writer writer(message.head);
  writer.put(kind).put(camera).put(std::uint16_t{0});
  (writer.put(static_cast<std::uint32_t>(counts)), ...);
  std::tie(message.payload, message.owner) = shared_bytes(std::move(numbers));
  return message;
}

}  // namespace

ViewerMessage depth_message(const FrameHeader& header, std::span<const std::uint16_t> depth,
                            std::shared_ptr<const void> owner) {
  if (depth.size() != std::size_t{header.width} * header.height)
    throw Error("depth image for the viewer", "its size is not width x height");
  return frame_message(header, header.has_rays ? Format::depth_with_rays : Format::depth,
                       std::as_bytes(depth), std::move(owner));
}

ViewerMessage points_message(const FrameHeader& header, std::vector<float> xyz,
                             std::span<const std::uint32_t> triangles) {
  const std::size_t count = std::size_t{header.width} * header.height;
  if (xyz.size() != 3 * count)
    throw Error("points for the viewer", "there are not three numbers for each");
  if (triangles.size() % 3 != 0 ||
      std::any_of(triangles.begin(), triangles.end(), [&](auto corner) { return corner >= count; }))
    throw Error("triangles for the viewer", "they are not of the points");
  // Behind the points, in the same payload.
  for (const std::uint32_t corner : triangles) xyz.push_back(std::bit_cast<float>(corner));
  auto [bytes, owner] = shared_bytes(std::move(xyz));
  return frame_message(header, Format::points, bytes, std::move(owner),
                       static_cast<std::uint32_t>(triangles.size() / 3));
}

ViewerMessage path_message(std::uint8_t camera, std::vector<float> txyz) {
  if (txyz.size() % 4 != 0) throw Error("path for the viewer", "each point needs four numbers");
  const std::size_t places = txyz.size() / 4;
  return numbers_message(Kind::path, camera, std::move(txyz), places);
}

ViewerMessage tool_message(const ToolShape* tool) {
  const Triangles surface = tool == nullptr ? Triangles() : tool->surface();
  std::vector<float> values;
  for (const Vec3& point : surface.points)
    for (int axis = 0; axis < 3; ++axis) values.push_back(static_cast<float>(point[axis]));
  for (const auto& corners : surface.triangles)
    for (const std::uint32_t corner : corners) values.push_back(std::bit_cast<float>(corner));
  return numbers_message(Kind::tool, 0, std::move(values), surface.points.size(),
                         surface.triangles.size());
}

ViewerMessage rays_message(std::uint8_t camera, std::uint32_t width, std::uint32_t height,
                           std::vector<float> rays) {
  if (rays.size() != 2 * std::size_t{width} * height)
    throw Error("rays for the viewer", "there are not two numbers for each pixel");
  return numbers_message(Kind::rays, camera, std::move(rays), width, height);
}

ViewerMessage ticks_message(const TickBatch& batch) {
  const std::size_t count = std::min(batch.samples.size(), TickBatch::max_samples);
  const ServoTick& record = batch.tick;
  const Tick& tick = record.tick;
  const auto contacts = std::span(tick.contacts).first(tick.contact_count);
  ViewerMessage message;
  Writer writer(message.head);
  Vec3 asked = record.region;
  join(tick.force, asked);
  asked += record.guidance;
  writer.put(Kind::ticks).put(static_cast<std::uint8_t>(tick.state));
  writer.put(static_cast<std::uint16_t>(count)).put(batch.flags).put(tick.t);
  writer.put(batch.safety).put(static_cast<std::uint32_t>(tick.steps));
  writer.put_vec3(tick.hip).put_vec3(tick.proxy).put_vec3(tick.normal).put_vec3(record.force);
  writer.put_float(tick.surface_velocity).put(static_cast<std::int32_t>(tick.frame));
  writer.put_float(record.gain).put_float(asked.norm()).put_vec3(record.place);
  writer.put_float(record.region.norm()).put_float(record.guidance.norm()).put(record.fixtures);
  writer.put_rotation(tick.orientation).put_rotation(tick.proxy_orientation);
  writer.put_vec3(record.torque).put(tick.contact_count);
  for (const ContactPush& contact : contacts) {
    writer.put_vec3(tick.proxy + contact.lever.cast<double>());
    writer.put_vec3(record.gain * contact.force.cast<double>());
  }
  const std::span<const TickSample> samples(batch.samples);
  for (const TickSample& sample : samples.last(count)) {
    writer.put_float(tick.t - sample.t).put(sample.force).put(sample.penetration);
    writer.put(sample.steps).put(sample.tick_time);
    writer.put(sample.relative).put(sample.absolute);
  }
  return message;
}

ViewerMessage text_message(const nlohmann::json& words) {
  ViewerMessage message;
  message.text = true;
  const std::string text = words.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  const auto bytes = std::as_bytes(std::span(text));
  message.head.assign(bytes.begin(), bytes.end());
  return message;
}

std::optional<std::variant<HandMessage, ShownMessage>> parse_binary(
    std::span<const std::byte> message) {
  if (message.empty()) return std::nullopt;
  const auto kind = read<std::uint8_t>(message, 0);
  if (kind == Kind::hand && (message.size() == hand_size || message.size() == turned_hand_size)) {
    const auto grip = read<std::uint8_t>(message, 1);
    if (grip > Grip::let_go_towards) return std::nullopt;
    if (grip == Grip::let_go) return HandMessage{};
    const Vec3 target(read<double>(message, 8), read<double>(message, 16),
                      read<double>(message, 24));
    // Also false for what is not a number.
    if (!(target.cwiseAbs().maxCoeff() <= max_hand_distance) || !target.allFinite())
      return std::nullopt;
    if (message.size() == hand_size) return HandMessage{grip == Grip::held, target};
    const Rotation turned(read<double>(message, 56), read<double>(message, 32),
                          read<double>(message, 40), read<double>(message, 48));
    if (!is_rotation(turned)) return std::nullopt;
    return HandMessage{grip == Grip::held, target, turned.normalized()};
  }
  if (kind == Kind::shown && message.size() == shown_size) {
    const auto camera = read<std::uint8_t>(message, 1);
    if (camera >= Patch::max_views) return std::nullopt;
    return ShownMessage{camera, read<std::uint32_t>(message, 4)};
  }
  return std::nullopt;
}

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SetParameter, name, value)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SetSafetyParameter, name, value)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SetPlacement, name, value)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SetPlayback, paused, loop, speed)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SetBrush, material, radius)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Forbid, size, margin)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Guide, slack)

namespace {

using nlohmann::json;

// @throws json::exception if a member is not there or of another type
template <class Asked>
std::optional<Command> asked(const json& what) {
  const auto command = what.get<Asked>();
  if (json(command).size() != what.size()) return std::nullopt;  // it has other members, too
  return command;
}

std::optional<Command> asked(const std::string& verb, const json& what) {
  if (verb == "set") return asked<SetParameter>(what);
  if (verb == "set_safety") return asked<SetSafetyParameter>(what);
  if (verb == "place") return asked<SetPlacement>(what);
  if (verb == "play") return asked<SetPlayback>(what);
  if (verb == "forbid") return asked<Forbid>(what);
  if (verb == "guide") return asked<Guide>(what);
  if (verb == "brush") return what.is_null() ? DropBrush{} : asked<SetBrush>(what);
  if (verb == "method") return SetMethod{what.get<std::string>()};
  if (verb == "tool") return SetTool{what.get<std::string>()};
  if (verb == "open") return OpenScene{what.get<std::string>()};
  if (verb == "rescale") return Rescale{what.get<double>()};
  if (verb == "remove_fixture") return RemoveFixture{what.get<std::string>()};
  if (verb == "record") return SetRecording{what.get<bool>()};
  if (verb == "seek") return Seek{what.get<double>()};
  if (what != true) return std::nullopt;
  if (verb == "clear_paint") return ClearPaint{};
  if (verb == "reset") return ResetHand{};
  if (verb == "reset_faults") return ResetFaults{};
  return std::nullopt;
}

}  // namespace

std::optional<Command> parse_command(std::string_view message) {
  if (message.size() > max_page_message) return std::nullopt;
  try {
    const json object = json::parse(message);
    if (!object.is_object() || object.size() != 1) return std::nullopt;
    return asked(object.begin().key(), object.front());
  } catch (const json::exception&) {
    return std::nullopt;
  }
}

void TickBatcher::add(const ServoTick& record, double contact_radius) {
  const Tick& tick = record.tick;
  batch_.tick = record;
  batch_.flags |= tick.flags;
  batch_.safety |= record.safety;
  any_ = true;

  // How far the HIP is below the surface, which is one contact radius below the proxy.
  const Vec3 out = tick.proxy - tick.hip;
  const double below = tick.normal.isZero() ? out.norm() : out.dot(tick.normal);
  const bool touches = tick.state != ContactState::free_motion;
  const double penetration = touches ? std::max(0.0, below - contact_radius) : 0.0;
  sample_.t = tick.t;
  sample_.force = std::max(sample_.force, static_cast<float>(record.force.norm()));
  sample_.penetration = std::max(sample_.penetration, static_cast<float>(penetration));
  sample_.steps = std::max(sample_.steps, static_cast<float>(tick.steps));
  sample_.tick_time =
      std::max(sample_.tick_time, 1e-9F * static_cast<float>(record.previous_compute_ns));
  sample_.relative = static_cast<float>(record.energy.relative.excess);
  sample_.absolute = static_cast<float>(record.energy.absolute.excess);
  if (++pending_ < ticks_per_sample_) return;
  batch_.samples.push_back(std::exchange(sample_, {}));
  pending_ = 0;
}

std::optional<TickBatch> TickBatcher::take() {
  if (!std::exchange(any_, false)) return std::nullopt;
  return std::exchange(batch_, {});
}

}  // namespace palpate
