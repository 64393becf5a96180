// SPDX-License-Identifier: Apache-2.0
#include "palpate/bag/compression.hpp"

#include <algorithm>
#include <array>
#include <memory>

#include <lz4frame.h>
#include <zstd.h>

#include "palpate/core/error.hpp"

namespace palpate {
namespace {

constexpr std::array zstd_magic{std::byte{0x28}, std::byte{0xb5}, std::byte{0x2f}, std::byte{0xfd}};
constexpr std::size_t usual_ratio = 8;  // of depth images; memory begins at it and doubles

struct FreeContext {
  void operator()(ZSTD_DCtx* context) const noexcept { ZSTD_freeDCtx(context); }
  void operator()(LZ4F_dctx* context) const noexcept { LZ4F_freeDecompressionContext(context); }
};

Error too_large(const std::string& name, std::size_t max_bytes) {
  return {name, "holds more than " + std::to_string(max_bytes) + " bytes when decompressed",
          "it may be damaged"};
}

Error no_memory(const std::string& name) {
  return {name, "cannot be decompressed: no memory", "end other programs"};
}

Error ends_early(const std::string& name) {
  return {name, "cannot be decompressed: it ends too early", "it may be damaged"};
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
  std::vector<std::byte> bytes(std::min(usual_ratio * packed.size(), max_bytes));
  ZSTD_inBuffer in{packed.data(), packed.size(), 0};
  ZSTD_outBuffer out{bytes.data(), bytes.size(), 0};
  for (;;) {
    const std::size_t left = ZSTD_decompressStream(context.get(), &out, &in);
    if (ZSTD_isError(left) != 0)
      throw Error(name, std::string("cannot be decompressed: ") + ZSTD_getErrorName(left),
                  "it may be damaged");
    if (left == 0 && in.pos == in.size) break;
    if (out.pos < out.size) {
      if (in.pos < in.size) continue;  // the next frame
      throw ends_early(name);
    }
    if (bytes.size() == max_bytes) throw too_large(name, max_bytes);
    bytes.resize(std::min(2 * bytes.size(), max_bytes));
    out = {bytes.data(), bytes.size(), out.pos};
  }
  bytes.resize(out.pos);
  return bytes;
}

std::vector<std::byte> decompress_lz4(std::span<const std::byte> packed, std::size_t max_bytes,
                                      const std::string& name) {
  LZ4F_dctx* made_context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made_context, LZ4F_VERSION)) != 0)
    throw no_memory(name);
  const std::unique_ptr<LZ4F_dctx, FreeContext> context(made_context);
  if (packed.empty()) throw ends_early(name);
  std::vector<std::byte> bytes(std::min(usual_ratio * packed.size(), max_bytes));
  std::size_t in = 0;
  std::size_t out = 0;
  for (;;) {
    std::size_t taken = packed.size() - in;
    std::size_t made = bytes.size() - out;
    const std::size_t left = LZ4F_decompress(context.get(), bytes.data() + out, &made,
                                             packed.data() + in, &taken, nullptr);
    if (LZ4F_isError(left) != 0)
      throw Error(name, std::string("cannot be decompressed: ") + LZ4F_getErrorName(left),
                  "it may be damaged");
    in += taken;
    out += made;
    if (left == 0 && in == packed.size()) break;
    if (taken > 0 || made > 0) continue;
    if (out < bytes.size()) throw ends_early(name);
    if (bytes.size() == max_bytes) throw too_large(name, max_bytes);
    bytes.resize(std::min(2 * bytes.size(), max_bytes));
  }
  bytes.resize(out);
  return bytes;
}

}  // namespace palpate
