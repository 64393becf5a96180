// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "palpate/net/viewer/server.hpp"

#ifdef PALPATE_WEB_DIST
// The assembler puts a file between two labels; the compiler need not read it.
#define PALPATE_EMBED(name, file)                                                        \
  __asm__(".pushsection .rodata\n" #name "_begin:\n.incbin \"" PALPATE_WEB_DIST "/" file \
          "\"\n" #name "_end:\n.popsection\n");                                          \
  extern "C" {                                                                           \
  extern const char name##_begin[];                                                      \
  extern const char name##_end[];                                                        \
  }

PALPATE_EMBED(palpate_page_html, "index.html")
PALPATE_EMBED(palpate_page_js, "palpate.js")
PALPATE_EMBED(palpate_page_css, "palpate.css")
#endif

namespace palpate {

std::span<const PageFile> page_files() {
#ifdef PALPATE_WEB_DIST
  const auto between = [](const char* begin, const char* end) {
    return std::string_view(begin, static_cast<std::size_t>(end - begin));
  };
  static const std::array files = {
      PageFile{"/", "text/html; charset=utf-8",
               between(palpate_page_html_begin, palpate_page_html_end)},
      PageFile{"/palpate.js", "text/javascript; charset=utf-8",
               between(palpate_page_js_begin, palpate_page_js_end)},
      PageFile{"/palpate.css", "text/css; charset=utf-8",
               between(palpate_page_css_begin, palpate_page_css_end)}};
#else
  static constexpr std::array files = {
      PageFile{"/", "text/html; charset=utf-8",
               "<!doctype html><title>palpate</title><p>This program was built without its page. "
               "Build it with scripts/run, which needs npm.</p>"}};
#endif
  return files;
}

}  // namespace palpate
