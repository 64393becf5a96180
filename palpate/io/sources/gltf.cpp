// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include <nlohmann/json.hpp>

#include "palpate/io/sources/files.hpp"
#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/point_file_detail.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace {

using nlohmann::json;
using Bytes = std::span<const std::byte>;
constexpr auto little = std::endian::little;
constexpr std::size_t most_values = std::size_t{1} << 26;  // points or triangles, of all nodes
constexpr int most_deep = 1000;                            // nodes below one another
constexpr const char* splatting = "KHR_gaussian_splatting";

std::vector<std::byte> of_base64(std::string_view text) {
  std::vector<std::byte> bytes;
  std::uint32_t bits = 0;
  int count = 0;  // of them
  for (const char c : text) {
    constexpr std::string_view digits =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const std::size_t value = digits.find(c);
    if (value == std::string_view::npos) break;  // of the padding
    bits = bits << 6U | static_cast<std::uint32_t>(value);
    count += 6;
    if (count < 8) continue;
    count -= 8;
    bytes.push_back(static_cast<std::byte>(bits >> count));
  }
  return bytes;
}

class GltfReader {
 public:
  GltfReader(Bytes file, std::string_view name, std::filesystem::path folder, bool as_splat)
      : name_(name), folder_(std::move(folder)), as_splat_(as_splat) {
    constexpr std::size_t header = 12, chunk = 8;
    std::string_view text(reinterpret_cast<const char*>(file.data()), file.size());
    out_.encoding = "glTF";
    if (text.starts_with("glTF")) {
      out_.encoding = "GLB";
      if (file.size() < header || detail::load<std::uint32_t>(&file[4], little) != 2)
        fail("it is no GLB of version 2", "write it as glTF 2.0");
      text = {};
      for (file = file.subspan(header); file.size() >= chunk;) {
        const std::size_t size = detail::load<std::uint32_t>(file.data(), little);
        if (size > file.size() - chunk) fail("ends within a chunk", detail::cut_short);
        const std::string_view kind(reinterpret_cast<const char*>(&file[4]), 4);
        const Bytes content = file.subspan(chunk, size);
        if (kind == "JSON" && text.empty())
          text = {reinterpret_cast<const char*>(content.data()), size};
        if (kind == std::string_view("BIN\0", 4)) binary_ = content;
        file = file.subspan(chunk + size);
      }
    }
    root_ = json::parse(text);
    for (const json& each : root_.value("extensionsRequired", json::array()))
      if (each.get<std::string>().find("compression") != std::string::npos)
        fail("it needs " + each.get<std::string>() + ", which is not read",
             "write it without compression");
  }

  PointFile read() {
    const json& nodes = root_.at("nodes");
    if (root_.contains("scenes")) {
      for (const json& node : root_["scenes"].at(root_.value("scene", 0U)).at("nodes"))
        visit(node.get<std::size_t>(), Eigen::Affine3d::Identity());
    } else {
      for (std::size_t i = 0; i < nodes.size(); ++i) visit(i, Eigen::Affine3d::Identity());
    }
    out_.width = out_.points.size();
    out_.non_finite = detail::count_non_finite(out_.points);
    if (as_splat_ && out_.points.empty())
      fail("it has no Gaussians of " + std::string(splatting), "open a mesh by map:");
    return std::move(out_);
  }

  [[noreturn]] void fail(const std::string& reason, const std::string& remedy) const {
    throw Error(name_, reason, remedy);
  }

 private:
  struct Values {
    std::vector<double> values;
    std::size_t width = 1, count = 0;
    [[nodiscard]] double operator()(std::size_t i, std::size_t k) const {
      return values[i * width + k];
    }
    [[nodiscard]] Vec3 vec3(std::size_t i) const {
      return {(*this)(i, 0), (*this)(i, 1), (*this)(i, 2)};
    }
  };

  // Of a node and all below it, each once.
  void visit(std::size_t number, const Eigen::Affine3d& world_from_parent, int depth = 0) {
    if (++visited_ > root_["nodes"].size() || depth > most_deep)
      fail("its nodes are no tree, or too deep a one",
           "write it again, each node below one other at most");
    const json& node = root_["nodes"].at(number);
    const Eigen::Affine3d pose = world_from_parent * pose_of(node);
    if (node.contains("mesh"))
      for (const json& each :
           root_.at("meshes").at(node["mesh"].get<std::size_t>()).at("primitives"))
        add(each, pose);
    if (node.contains("children") && root_.contains("scenes"))
      for (const json& child : node["children"]) visit(child.get<std::size_t>(), pose, depth + 1);
  }

  static Eigen::Affine3d pose_of(const json& node) {
    Eigen::Affine3d pose = Eigen::Affine3d::Identity();
    if (node.contains("matrix")) {
      for (std::size_t i = 0; i < 16; ++i)
        pose.matrix()(static_cast<Eigen::Index>(i % 4), static_cast<Eigen::Index>(i / 4)) =
            node["matrix"].at(i).get<double>();
      return pose;
    }
    const auto numbers = [&](const char* key, std::vector<double> otherwise) {
      auto given = node.value(key, otherwise);
      given.resize(otherwise.size());
      return given;
    };
    const auto t = numbers("translation", {0, 0, 0});
    const auto q = numbers("rotation", {0, 0, 0, 1});
    const auto s = numbers("scale", {1, 1, 1});
    pose = Eigen::Translation3d(t[0], t[1], t[2]) * Eigen::Quaterniond(q[3], q[0], q[1], q[2]) *
           Eigen::Scaling(s[0], s[1], s[2]);
    return pose;
  }

  void add(const json& primitive, const Eigen::Affine3d& pose) {
    const auto mode = primitive.value("mode", 4U);
    const bool is_splat =
        primitive.contains("extensions") && primitive["extensions"].contains(splatting);
    if (is_splat != as_splat_ || (!is_splat && (mode < 4 || mode > 6))) return;
    const json& attributes = primitive.at("attributes");
    const Values places = accessor(attributes.at("POSITION"), "VEC3");
    const std::size_t first = out_.points.size();
    if (std::max(first + places.count, out_.triangles.size()) > most_values)
      fail("it has more points or triangles than can be read",
           "give at most " + std::to_string(most_values));
    for (std::size_t i = 0; i < places.count; ++i) out_.points.push_back(pose * places.vec3(i));
    if (is_splat) {
      add_gaussians(attributes, places.count, pose);
      return;
    }
    Values corners;
    if (primitive.contains("indices")) {
      corners = accessor(primitive["indices"], "SCALAR");
    } else {
      for (std::size_t i = 0; i < places.count; ++i)
        corners.values.push_back(static_cast<double>(i));
    }
    std::vector<std::uint32_t> at;
    for (const double corner : corners.values) {
      if (!(corner >= 0.0 && corner < static_cast<double>(places.count)))
        fail("a triangle has a corner that is not there", "mend the mesh");
      at.push_back(static_cast<std::uint32_t>(first + static_cast<std::size_t>(corner)));
    }
    for (std::size_t i = 2; i < at.size(); i += mode == 4 ? 3 : 1) {
      const std::size_t turn = mode == 5 && i % 2 == 1 ? 1 : 0;  // of every other one of a strip
      out_.triangles.push_back({at[mode == 6 ? 0 : i - 2 + turn], at[i - 1 - turn], at[i]});
    }
  }

  void add_gaussians(const json& attributes, std::size_t count, const Eigen::Affine3d& pose) {
    const auto of = [&](const char* name, const char* type) {
      Values values = accessor(attributes.at(std::string(splatting) + ":" + name), type);
      if (values.count != count)
        fail(std::string(name) + " has " + std::to_string(values.count) + " values for " +
                 std::to_string(count) + " Gaussians",
             "write it again");
      return values;
    };
    const Values scales = of("SCALE", "VEC3");
    const Values turns = of("ROTATION", "VEC4");
    const Values opacities = of("OPACITY", "SCALAR");
    const auto* const harmonic = "SH_DEGREE_0_COEF_0";
    const bool has_harmonic = attributes.contains(std::string(splatting) + ":" + harmonic);
    const Values colours = has_harmonic ? of(harmonic, "VEC3") : Values{};
    constexpr double even = 1e-3;  // [-] by which a node's scales may differ
    const double scale = std::cbrt(pose.linear().determinant());
    const Eigen::Matrix3d rotation = pose.linear() / scale;
    if (!(scale > 0.0) || !(rotation * rotation.transpose()).isIdentity(even))
      fail("a node stretches or mirrors its Gaussians", "apply the node's scale before writing");
    // Drafts of the extension had logarithms, which are negative for all that is smaller than 1.
    const bool are_logs = std::any_of(scales.values.begin(), scales.values.end(),
                                      [](double each) { return each < 0.0; });
    SplatColumns& splat = out_.splat ? *out_.splat : out_.splat.emplace();
    for (std::size_t i = 0; i < count; ++i) {
      const Vec3 logs =
          are_logs ? scales.vec3(i) : Vec3(scales.vec3(i).array().max(1e-12).log().matrix());
      const Eigen::Quaterniond turn =
          Eigen::Quaterniond(rotation) *
          Eigen::Quaterniond(turns(i, 3), turns(i, 0), turns(i, 1), turns(i, 2));
      splat.add(logs + Vec3::Constant(std::log(scale)), opacities(i, 0), turn);
      for (std::size_t k = 0; k < 3; ++k)
        out_.colours.push_back(
            detail::colour_byte(detail::colour_share(has_harmonic ? colours(i, k) : 0.0)));
    }
  }

  Values accessor(const json& number, std::string_view type) {
    const json& it = root_.at("accessors").at(number.get<std::size_t>());
    const std::string of = "accessor " + std::to_string(number.get<std::size_t>());
    if (it.at("type").get<std::string>() != type)
      fail(of + " is no " + std::string(type), "mend it");
    if (it.contains("sparse") || !it.contains("bufferView"))
      fail(of + " is sparse or has no data, which is not read", "write it with all of its values");
    Values values;
    values.width = type == "SCALAR" ? 1 : static_cast<std::size_t>(type.back() - '0');
    values.count = it.at("count").get<std::size_t>();
    const auto kind = it.at("componentType").get<unsigned>();
    const detail::Scalar* scalar = detail::find_scalar(
        [&](const detail::Scalar& each) { return kind != 0 && each.gltf == kind; });
    if (scalar == nullptr) fail(of + " is of no known component type", "mend it");
    const bool is_signed = scalar->name.front() == 'i';
    const double unit =
        it.value("normalized", false) && !scalar->is_float
            ? std::ldexp(1.0, static_cast<int>(8 * scalar->size) - (is_signed ? 1 : 0)) - 1.0
            : 1.0;
    const json& view = root_.at("bufferViews").at(it["bufferView"].get<std::size_t>());
    const Bytes buffer = this->buffer(view.value("buffer", std::size_t{0}));
    const std::size_t length = values.width * scalar->size;
    const auto stride = view.value("byteStride", length);
    const auto begin = view.value("byteOffset", std::size_t{0});
    const auto inside = it.value("byteOffset", std::size_t{0});
    const auto bytes = view.at("byteLength").get<std::size_t>();
    if (begin > buffer.size() || bytes > buffer.size() - begin || inside > bytes ||
        stride < length ||
        (values.count > 0 &&
         (bytes - inside < length || values.count - 1 > (bytes - inside - length) / stride)))
      fail(of + " reaches beyond its buffer", detail::cut_short);
    values.values.reserve(values.count * values.width);
    for (std::size_t i = 0; i < values.count; ++i)
      for (std::size_t k = 0; k < values.width; ++k)
        values.values.push_back(std::max(
            scalar->value(&buffer[begin + inside + i * stride + k * scalar->size], little) / unit,
            unit > 1.0 ? -1.0 : -HUGE_VAL));
    return values;
  }

  Bytes buffer(std::size_t number) {
    const auto known = buffers_.find(number);
    if (known != buffers_.end()) return known->second;
    const json& it = root_.at("buffers").at(number);
    if (!it.contains("uri")) return binary_;
    const auto uri = it["uri"].get<std::string>();
    std::vector<std::byte>& bytes = buffers_[number];
    if (uri.starts_with("data:")) return bytes = of_base64(uri.substr(uri.find(',') + 1));
    return bytes = detail::read_beside(folder_, uri, name_);
  }

  std::string name_;
  std::filesystem::path folder_;
  bool as_splat_;
  json root_;
  Bytes binary_;
  std::map<std::size_t, std::vector<std::byte>> buffers_;
  std::size_t visited_ = 0;
  PointFile out_;
};

}  // namespace

PointFile parse_gltf(std::span<const std::byte> bytes, std::string_view name,
                     const std::filesystem::path& folder, bool as_splat) {
  try {
    return GltfReader(bytes, name, folder, as_splat).read();
  } catch (const json::exception& wrong) {
    throw Error(std::string(name), std::string("its JSON is no glTF's: ") + wrong.what(),
                "check that this is a glTF or GLB file");
  }
}

bool is_gltf(const std::filesystem::path& path) {
  const std::string ending = lower_case(path.extension().string());
  return ending == ".glb" || ending == ".gltf";
}

PointFile read_gltf(const std::filesystem::path& path, bool as_splat) {
  return parse_gltf(read_file(path, detail::largest_file), path.string(), path.parent_path(),
                    as_splat);
}

}  // namespace palpate
