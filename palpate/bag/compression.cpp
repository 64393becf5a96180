// SPDX-License-Identifier: Apache-2.0
#include "palpate/bag/compression.hpp"

#include <algorithm>
#include <array>
#include <memory>

#include <zstd.h>

#include "palpate/core/error.hpp"

namespace palpate {
namespace {

constexpr std::array zstd_magic{std::byte{0x28}, std::byte{0xb5}, std::byte{0x2f}, std::byte{0xfd}};
constexpr std::size_t usual_ratio = 8;  // of depth images; memory begins at it and doubles

struct FreeContext {
  void operator()(ZSTD_DCtx* context) const noexcept { ZSTD_freeDCtx(context); }
};

}  // namespace

bool is_zstd(std::span<const std::byte> bytes) noexcept {
  return bytes.size() >= zstd_magic.size() &&
         std::equal(zstd_magic.begin(), zstd_magic.end(), bytes.begin());
}

std::vector<std::byte> decompress_zstd(std::span<const std::byte> packed, std::size_t max_bytes,
                                       const std::string& name) {
  const auto too_large = [&] {
    return Error(name, "holds more than " + std::to_string(max_bytes) + " bytes when decompressed",
                 "it may be damaged");
  };
  const unsigned long long declared = ZSTD_getFrameContentSize(packed.data(), packed.size());
  if (declared == ZSTD_CONTENTSIZE_ERROR)
    throw Error(name, "is not compressed with zstd", "it may be damaged");
  if (declared != ZSTD_CONTENTSIZE_UNKNOWN && declared > max_bytes) throw too_large();

  const std::unique_ptr<ZSTD_DCtx, FreeContext> context(ZSTD_createDCtx());
  if (!context) throw Error(name, "cannot be decompressed: no memory", "end other programs");
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
      throw Error(name, "cannot be decompressed: it ends too early", "it may be damaged");
    }
    if (bytes.size() == max_bytes) throw too_large();
    bytes.resize(std::min(2 * bytes.size(), max_bytes));
    out = {bytes.data(), bytes.size(), out.pos};
  }
  bytes.resize(out.pos);
  return bytes;
}

}  // namespace palpate
