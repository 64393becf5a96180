// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

namespace palpate {

/// A file of the page that the program carries inside itself.
struct PageFile {
  std::string_view path;  ///< as in a request, e.g. "/palpate.js"
  std::string_view type;  ///< as in Content-Type
  std::string_view content;
};

/// All of them; "/" is first. If the page was not built, there is only one that says so.
std::span<const PageFile> page_files();

}  // namespace palpate
