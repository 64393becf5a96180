// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag/compression.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <memory>

#include <bzlib.h>
#include <lz4frame.h>
#include <zlib.h>
#include <zstd.h>

#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

constexpr std::array zstd_magic{std::byte{0x28}, std::byte{0xb5}, std::byte{0x2f}, std::byte{0xfd}};
constexpr std::size_t usual_ratio = 8;  // of depth images; memory begins at it and doubles

struct FreeContext {
  void operator()(ZSTD_DCtx* context) const noexcept { ZSTD_freeDCtx(context); }
  void operator()(LZ4F_dctx* context) const noexcept { LZ4F_freeDecompressionContext(context); }
  void operator()(bz_stream* context) const noexcept { BZ2_bzDecompressEnd(context); }
  void operator()(z_stream* context) const noexcept { inflateEnd(context); }
};

Error too_large(const std::string& name, std::size_t max_bytes) {
  return {name, "holds more than " + std::to_string(max_bytes) + " bytes when decompressed",
          "it may be damaged"};
}

Error no_memory(const std::string& name) {
  return {name, "cannot be decompressed: no memory", "end other programs"};
}

Error damaged(const std::string& name, const std::string& why) {
  return {name, "cannot be decompressed: " + why, "it may be damaged"};
}

using Bytes = std::span<const std::byte>;

// What a library did with what is left to take, and the room left for what it makes.
struct Step {
  std::size_t taken, made;
  bool whole;  // a frame ended with it
};

// Frames one after another, by a library's step(Bytes, std::span<std::byte>).
template <class Take>
std::vector<std::byte> decompress(Bytes packed, std::size_t max_bytes, const std::string& name,
                                  const Take& step) {
  if (packed.empty()) throw damaged(name, "it ends too early");
  std::vector<std::byte> bytes(std::min(usual_ratio * packed.size(), max_bytes));
  std::size_t in = 0;
  std::size_t out = 0;
  for (;;) {
    const Step done = step(packed.subspan(in), std::span(bytes).subspan(out));
    in += done.taken;
    out += done.made;
    if (done.whole && in == packed.size()) break;
    if (done.taken > 0 || done.made > 0) continue;
    if (out < bytes.size()) throw damaged(name, "it ends too early");
    if (bytes.size() == max_bytes) throw too_large(name, max_bytes);
    bytes.resize(std::min(2 * bytes.size(), max_bytes));
  }
  bytes.resize(out);
  return bytes;
}

// The same by bzip2 or zlib, which have alike streams. @param go_on  true where a frame ended
template <class Stream, class GoOn>
std::vector<std::byte> decompress_stream(Stream& stream, Bytes packed, std::size_t max_bytes,
                                         const std::string& name, const GoOn& go_on) {
  const std::unique_ptr<Stream, FreeContext> context(&stream);
  return decompress(packed, max_bytes, name, [&](Bytes in, std::span<std::byte> out) {
    constexpr std::size_t most = std::numeric_limits<unsigned>::max();
    const auto in_size = static_cast<unsigned>(std::min(in.size(), most));
    const auto out_size = static_cast<unsigned>(std::min(out.size(), most));
    using Place = decltype(stream.next_in);
    stream.next_in = reinterpret_cast<Place>(const_cast<std::byte*>(in.data()));  // is only read
    stream.avail_in = in_size;
    std::byte none{};  // zlib refuses no place at all
    stream.next_out = reinterpret_cast<decltype(stream.next_out)>(out.empty() ? &none : out.data());
    stream.avail_out = out_size;
    const bool whole = go_on();
    return Step{in_size - stream.avail_in, out_size - stream.avail_out, whole};
  });
}

}  // namespace

bool is_zstd(std::span<const std::byte> bytes) noexcept {
  return bytes.size() >= zstd_magic.size() &&
         std::equal(zstd_magic.begin(), zstd_magic.end(), bytes.begin());
}

std::vector<std::byte> decompress_zstd(std::span<const std::byte> packed, std::size_t max_bytes,
                                       const std::string& name) {
  const unsigned long long declared = ZSTD_getFrameContentSize(packed.data(), packed.size());
  if (declared == ZSTD_CONTENTSIZE_ERROR)
    throw Error(name, "is not compressed with zstd", "it may be damaged");
  if (declared != ZSTD_CONTENTSIZE_UNKNOWN && declared > max_bytes)
    throw too_large(name, max_bytes);
  const std::unique_ptr<ZSTD_DCtx, FreeContext> context(ZSTD_createDCtx());
  if (!context) throw no_memory(name);
  return decompress(packed, max_bytes, name, [&](Bytes in, std::span<std::byte> out) {
    ZSTD_inBuffer taken{in.data(), in.size(), 0};
    ZSTD_outBuffer made{out.data(), out.size(), 0};
    const std::size_t left = ZSTD_decompressStream(context.get(), &made, &taken);
    if (ZSTD_isError(left) != 0) throw damaged(name, ZSTD_getErrorName(left));
    return Step{taken.pos, made.pos, left == 0};
  });
}

std::vector<std::byte> decompress_lz4(std::span<const std::byte> packed, std::size_t max_bytes,
                                      const std::string& name) {
  LZ4F_dctx* made_context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made_context, LZ4F_VERSION)) != 0)
    throw no_memory(name);
  const std::unique_ptr<LZ4F_dctx, FreeContext> context(made_context);
  return decompress(packed, max_bytes, name, [&](Bytes in, std::span<std::byte> out) {
    std::size_t taken = in.size();
    std::size_t made = out.size();
    const std::size_t left =
        LZ4F_decompress(context.get(), out.data(), &made, in.data(), &taken, nullptr);
    if (LZ4F_isError(left) != 0) throw damaged(name, LZ4F_getErrorName(left));
    return Step{taken, made, left == 0};
  });
}

std::vector<std::byte> decompress_bz2(std::span<const std::byte> packed, std::size_t max_bytes,
                                      const std::string& name) {
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) throw no_memory(name);
  return decompress_stream(stream, packed, max_bytes, name, [&] {
    const int result = BZ2_bzDecompress(&stream);
    if (result != BZ_OK && result != BZ_STREAM_END)
      throw damaged(name, "bzip2's error " + std::to_string(result));
    return result == BZ_STREAM_END;
  });
}

std::vector<std::byte> decompress_gzip(std::span<const std::byte> packed, std::size_t max_bytes,
                                       const std::string& name) {
  constexpr int gzip = 16;  // added to the window's bits, of which 0 are the header's
  z_stream stream{};
  if (inflateInit2(&stream, gzip) != Z_OK) throw no_memory(name);
  return decompress_stream(stream, packed, max_bytes, name, [&] {
    const int result = inflate(&stream, Z_NO_FLUSH);
    if (result != Z_OK && result != Z_STREAM_END && result != Z_BUF_ERROR)
      throw damaged(name, "it is no gzip, or a damaged one");
    if (result == Z_STREAM_END) inflateReset(&stream);
    return result == Z_STREAM_END;
  });
}

}  // namespace palpate
