// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/depth_png.hpp"

#include <array>
#include <bit>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <new>
#include <string_view>

#include <png.h>

#include "palpate/io/sources/files.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

constexpr std::uint32_t largest_png_side = 16384;  // [px] as in validate(Intrinsics)
constexpr std::uintmax_t largest_png_file = std::uintmax_t{1} << 30;
constexpr std::size_t signature_size = 8;

// libpng reports an error by a longjmp, which must not pass over a destructor: functions that call
// setjmp have trivial locals only, and leave the throwing to their caller.
struct Failure {
  std::array<char, 160> text{};

  [[noreturn]] static void keep(png_structp png, png_const_charp message) {
    auto* failure = static_cast<Failure*>(png_get_error_ptr(png));
    std::snprintf(failure->text.data(), failure->text.size(), "%s", message);
    png_longjmp(png, 1);
  }
  static void ignore(png_structp /*png*/, png_const_charp /*warning*/) {}
};

class PngReader {
 public:
  struct Header {
    png_uint_32 width = 0, height = 0;
    int bits = 0, colour = 0;
  };

  explicit PngReader(std::span<const std::byte> bytes) : rest_(bytes) {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, &failure_, Failure::keep, Failure::ignore);
    info_ = png_ == nullptr ? nullptr : png_create_info_struct(png_);
    if (info_ == nullptr) {
      png_destroy_read_struct(&png_, nullptr, nullptr);
      throw std::bad_alloc();
    }
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  bool read_header(Header& header) noexcept {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    png_set_read_fn(png_, &rest_, take);
    png_set_user_limits(png_, PNG_UINT_31_MAX, PNG_UINT_31_MAX);  // checked by the caller
    // Colour profiles and texts are not wanted, nor what they might unpack to.
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
    png_read_info(png_, info_);
    png_get_IHDR(png_, info_, &header.width, &header.height, &header.bits, &header.colour, nullptr,
                 nullptr, nullptr);
    return true;
  }

  // Makes its rows of 8 bits, in grey or in colour.
  bool turn(const Header& header, bool to_colour) noexcept {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    png_set_expand(png_);
    png_set_scale_16(png_);
    png_set_strip_alpha(png_);
    const bool is_colour = (header.colour & PNG_COLOR_MASK_COLOR) != 0;
    if (to_colour && !is_colour) png_set_gray_to_rgb(png_);
    if (!to_colour && is_colour)
      png_set_rgb_to_gray_fixed(png_, PNG_ERROR_ACTION_NONE, PNG_RGB_TO_GRAY_DEFAULT,
                                PNG_RGB_TO_GRAY_DEFAULT);
    return true;
  }

  bool read_rows(png_bytepp rows) noexcept {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    if constexpr (std::endian::native == std::endian::little) png_set_swap(png_);
    png_read_image(png_, rows);
    png_read_end(png_, nullptr);
    // Newer versions of libpng read on over damage in the last chunk, which is always the same.
    constexpr std::string_view last_chunk("\0\0\0\0IEND\xae\x42\x60\x82", 12);
    const std::string_view read(reinterpret_cast<const char*>(rest_.data()) - last_chunk.size(),
                                last_chunk.size());
    if (read != last_chunk) png_error(png_, "its last chunk is damaged");
    return true;
  }

  [[nodiscard]] std::string message() const { return failure_.text.data(); }

 private:
  static void take(png_structp png, png_bytep to, std::size_t count) {
    auto* rest = static_cast<std::span<const std::byte>*>(png_get_io_ptr(png));
    if (count > rest->size()) png_error(png, "it ends too early");
    std::memcpy(to, rest->data(), count);
    *rest = rest->subspan(count);
  }

  std::span<const std::byte> rest_;
  Failure failure_;
  png_structp png_;
  png_infop info_;
};

// Of PNG's types of colour, by their numbers.
constexpr std::array<const char*, 7> colour_names{
    "grey", "", "colour", "palette", "grey and alpha", "", "colour and alpha"};

void append(png_structp png, png_bytep from, std::size_t count) {
  auto* to = static_cast<std::vector<std::byte>*>(png_get_io_ptr(png));
  const auto* bytes = reinterpret_cast<const std::byte*>(from);
  try {
    to->insert(to->end(), bytes, bytes + count);
  } catch (const std::bad_alloc&) {
    png_error(png, "no memory");
  }
}

bool write_rows(std::vector<std::byte>& to, Failure& failure, png_uint_32 width, png_uint_32 height,
                png_bytepp rows) noexcept {
  png_structp png =
      png_create_write_struct(PNG_LIBPNG_VER_STRING, &failure, Failure::keep, Failure::ignore);
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  if (info == nullptr || setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_write_struct(&png, &info);
    return false;
  }
  png_set_write_fn(png, &to, append, nullptr);
  // Level 1 takes 5.6 ms for 640x480; level 6 takes 54 ms to save 13 %.
  png_set_compression_level(png, 1);
  png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_UP);
  png_set_IHDR(png, info, width, height, 16, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  if constexpr (std::endian::native == std::endian::little) png_set_swap(png);
  png_write_image(png, rows);
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  return true;
}

// The pixels of an image, `channels` values each; `set_up` checks its header and configures the
// reader, false where libpng fails.
template <class Value, class SetUp>
std::vector<Value> decode(std::span<const std::byte> bytes, const std::string& name,
                          const char* needed, int& width, int& height, std::size_t channels,
                          const SetUp& set_up) {
  const auto* signature = reinterpret_cast<png_const_bytep>(bytes.data());
  if (bytes.size() < signature_size || png_sig_cmp(signature, 0, signature_size) != 0)
    throw Error(name, bytes.empty() ? "is empty" : "is not a PNG image", needed);
  PngReader reader(bytes);
  PngReader::Header header;
  const auto damaged = [&] {
    return Error(name, "is a damaged PNG: " + reader.message(),
                 "copy or record it again, it may have been cut short");
  };
  if (!reader.read_header(header) || !set_up(reader, header)) throw damaged();
  const std::string size = size_text(header.width, header.height);
  if (header.width > largest_png_side || header.height > largest_png_side)
    throw Error(name, "is an image of " + size + " pixels",
                "images up to 16384x16384 can be read; it may be damaged");
  // Deflate compresses by 1032 at most: a header that declares more pixels is wrong.
  constexpr std::size_t best_ratio = 1032;
  const std::size_t pixels = std::size_t{header.width} * header.height;
  if (pixels * static_cast<std::size_t>(header.bits) / 8 / best_ratio > bytes.size())
    throw Error(name,
                "promises " + size + " pixels, more than its " + std::to_string(bytes.size()) +
                    " bytes can hold",
                "copy or record it again, it may have been cut short");
  width = static_cast<int>(header.width);
  height = static_cast<int>(header.height);
  std::vector<Value> values(channels * pixels);
  std::vector<png_bytep> rows(header.height);
  for (std::size_t v = 0; v < rows.size(); ++v)
    rows[v] = reinterpret_cast<png_bytep>(values.data() + v * channels * header.width);
  if (!reader.read_rows(rows.data())) throw damaged();
  return values;
}

}  // namespace

void check_size(const Intrinsics& camera, std::int64_t width, std::int64_t height,
                const std::string& subject, const std::string& remedy) {
  if (width == camera.width && height == camera.height) return;
  throw Error(subject,
              "has an image of " + size_text(width, height) + " pixels, but the camera has " +
                  size_text(camera.width, camera.height),
              remedy);
}

DepthPng parse_depth_png(std::span<const std::byte> bytes, const std::string& name) {
  const char* const needed = "a 16-bit grey PNG is needed";
  const auto check = [&](PngReader& /*reader*/, const PngReader::Header& header) {
    if (header.bits == 16 && header.colour == PNG_COLOR_TYPE_GRAY) return true;
    const char* const colour = colour_names.at(static_cast<std::size_t>(header.colour));
    throw Error(name,
                "is a PNG of " + std::to_string(header.bits) + "-bit " + colour + ", not of depth",
                needed);
  };
  DepthPng image;
  image.depth = decode<std::uint16_t>(bytes, name, needed, image.width, image.height, 1, check);
  return image;
}

DepthPng read_depth_png(const std::filesystem::path& path) {
  return parse_depth_png(read_file(path, largest_png_file), path.string());
}

LightPng read_light_png(const std::filesystem::path& path, bool in_colour) {
  LightPng image;
  image.values = decode<std::uint8_t>(
      read_file(path, largest_png_file), path.string(), "a PNG is needed", image.width,
      image.height, in_colour ? 3 : 1,
      [&](PngReader& reader, const auto& header) { return reader.turn(header, in_colour); });
  return image;
}

std::vector<std::byte> encode_depth_png(int width, int height,
                                        std::span<const std::uint16_t> depth) {
  const std::string name = "depth image";
  constexpr auto largest = static_cast<int>(largest_png_side);
  if (width < 1 || height < 1 || width > largest || height > largest ||
      depth.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {
    throw Error(name,
                std::to_string(depth.size()) + " values do not make an image of " +
                    size_text(width, height),
                "give width*height values, sides up to 16384");
  }
  std::vector<png_bytep> rows(static_cast<std::size_t>(height));
  for (std::size_t v = 0; v < rows.size(); ++v) {
    // libpng only reads them, but its interface does not say so.
    rows[v] = reinterpret_cast<png_bytep>(
        const_cast<std::uint16_t*>(depth.data() + v * static_cast<std::size_t>(width)));
  }
  std::vector<std::byte> bytes;
  Failure failure;
  if (!write_rows(bytes, failure, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height),
                  rows.data()))
    throw Error(name, "cannot be packed: " + std::string(failure.text.data()));
  return bytes;
}

}  // namespace palpate
