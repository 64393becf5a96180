// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/viewer/protocol.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <tuple>
#include <utility>

#include <nlohmann/json.hpp>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
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
  Writer& put_lens(const Intrinsics& k) {
    return put_float(k.fx).put_float(k.fy).put_float(k.cx).put_float(k.cy);
  }
  Writer& put_pose(const Eigen::Isometry3d& pose) {
    for (int i = 0; i < 12; ++i) put_float(pose(i / 4, i % 4));
    return *this;
  }

 private:
  std::vector<std::byte>& out_;
};

template <class Number>
Number read(std::span<const std::byte> message, std::size_t at) {
  Number value;
  std::memcpy(&value, message.data() + at, sizeof(Number));
  return value;
}

std::size_t pixels_of(int width, int height) {
  return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
}

void append(const Vec3& v, std::vector<float>& numbers) {
  for (const double number : v) numbers.push_back(static_cast<float>(number));
}

// Behind the points, in the same payload.
void append(const std::array<std::uint32_t, 3>& triangle, std::vector<float>& numbers) {
  for (const std::uint32_t corner : triangle) numbers.push_back(std::bit_cast<float>(corner));
}

// What is drawn of points without an image.
struct DrawnPoints {
  std::vector<float> numbers = {};  // x y z of each, then of each face its corners
  std::size_t points = 0;
  std::uint32_t faces = 0;
  std::shared_ptr<const ColourImage> colour = {};  // of each
};

DrawnPoints drawn_points(const PointCloud& cloud, const ColourImage* colour) {
  DrawnPoints drawn;
  const Surface* surface = cloud.surface();
  if (surface == nullptr) {
    for (std::size_t i = 0; i < cloud.size(); ++i) append(cloud.point(i), drawn.numbers);
    drawn.points = cloud.size();
    return drawn;
  }
  const std::vector<Vec3>& all = surface->points;
  const bool has_colour = colour != nullptr && colour->rgb.size() == 3 * all.size();
  auto kept = has_colour ? std::make_shared<ColourImage>() : nullptr;
  std::vector<std::uint32_t> place(all.size());  // among those that are finite
  for (std::size_t i = 0; i < all.size(); ++i) {
    place[i] = static_cast<std::uint32_t>(drawn.points);
    if (!all[i].allFinite()) continue;
    append(all[i], drawn.numbers);
    ++drawn.points;
    if (kept) kept->rgb.insert(kept->rgb.end(), &colour->rgb[3 * i], &colour->rgb[3 * i] + 3);
  }
  for (const auto& [a, b, c] : surface->triangles) {
    if (!all[a].allFinite() || !all[b].allFinite() || !all[c].allFinite()) continue;
    append(std::array{place[a], place[b], place[c]}, drawn.numbers);
    ++drawn.faces;
  }
  if (kept) {
    kept->width = static_cast<int>(drawn.points);
    kept->height = 1;
    drawn.colour = std::move(kept);
  }
  return drawn;
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

ViewerMessage frame_message(std::uint8_t camera, std::uint32_t number, const Frame& frame) {
  ViewerMessage message{.is_frame = true, .owner = frame.cloud, .colour = frame.colour};
  Format format = Format::points;
  Intrinsics lens{.height = 1, .fx = 1.0, .fy = 1.0};
  double metres_per_unit = 1.0;
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  std::uint32_t faces = 0;
  if (const DepthImage* image = frame.cloud->image()) {
    lens = image->intrinsics();
    format = lens.distorted() ? Format::depth_with_rays : Format::depth;
    metres_per_unit = 1.0 / image->units_per_metre();
    world_from_camera = image->world_from_camera();
    message.payload = std::as_bytes(std::span(image->depth()));
  } else {
    DrawnPoints drawn = drawn_points(*frame.cloud->point_cloud(), frame.colour.get());
    lens.width = static_cast<int>(drawn.points);
    faces = drawn.faces;
    message.colour = std::move(drawn.colour);
    std::tie(message.payload, message.owner) = shared_bytes(std::move(drawn.numbers));
  }
  const ColourImage* colour = message.colour.get();
  const Colours colours = colour == nullptr ? Colours::none
                          : colour->camera  ? Colours::own_camera
                                            : Colours::registered;
  if (colour != nullptr && (colour->rgb.size() != 3 * pixels_of(colour->width, colour->height) ||
                            (!colour->camera && pixels_of(colour->width, colour->height) !=
                                                    pixels_of(lens.width, lens.height))))
    throw Error("colour for the viewer", "its size is not that of its image");
  Writer writer(message.head);
  writer.put(Kind::frame).put(camera).put(format).put(colours).put(number).put(frame.stamp);
  writer.put(lens.width).put(lens.height).put_lens(lens).put_float(metres_per_unit);
  writer.put_pose(world_from_camera).put(faces);
  if (colours == Colours::own_camera) {
    writer.put(colour->width).put(colour->height).put_lens(colour->camera->intrinsics);
    writer.put_pose(colour->camera->world_from_camera.inverse());
  }
  return message;
}

ViewerMessage path_message(std::uint8_t camera, std::vector<float> txyz) {
  if (txyz.size() % 4 != 0) throw Error("path for the viewer", "each point needs four numbers");
  const std::size_t places = txyz.size() / 4;
  return numbers_message(Kind::path, camera, std::move(txyz), places);
}

ViewerMessage tool_message(const ToolShape* tool) {
  const Triangles surface = tool == nullptr ? Triangles() : tool->surface();
  std::vector<float> values;
  for (const Vec3& point : surface.points) append(point, values);
  for (const auto& triangle : surface.triangles) append(triangle, values);
  return numbers_message(Kind::tool, 0, std::move(values), surface.points.size(),
                         surface.triangles.size());
}

ViewerMessage rays_message(std::uint8_t camera, const ViewingRays& rays) {
  const Intrinsics& lens = rays.intrinsics();
  std::vector<float> xy;
  xy.reserve(2 * pixels_of(lens.width, lens.height));
  for (int v = 0; v < lens.height; ++v) {
    for (int u = 0; u < lens.width; ++u) {
      for (const double number : rays.ray(u, v)) xy.push_back(static_cast<float>(number));
    }
  }
  return numbers_message(Kind::rays, camera, std::move(xy), lens.width, lens.height);
}

ViewerMessage ticks_message(const TickBatch& batch) {
  const std::size_t count = std::min(batch.samples.size(), TickBatch::max_samples);
  const ServoTick& record = batch.newest;
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
  batch_.add(record);
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
