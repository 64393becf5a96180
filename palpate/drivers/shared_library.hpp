// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <type_traits>
#include <vector>

namespace palpate {

/// A vendor's library that is loaded when it is asked for, and how a person gets it.
struct LibraryNames {
  std::string name;                ///< as people call it: "Force Dimension SDK"
  std::vector<std::string> files;  ///< tried in this order: names for the loader, or paths
  /// Variable of the environment. Where it is set it counts alone: a file, or the folder of one of
  /// `files`.
  std::string variable;
  std::string remedy;  ///< what to install: "install the SDK from www.forcedimension.com"
};

/// A library loaded into this process, until that ends: vendors' libraries have threads of their
/// own and do not survive being unloaded. Two objects for the same file share it.
class SharedLibrary {
 public:
  /// @throws Error in one line: the library, where it was looked for or what the loader said, and
  ///         the remedy.
  explicit SharedLibrary(const LibraryNames& names);

  /// The file that was loaded.
  [[nodiscard]] const std::string& path() const { return path_; }

  /// Points `function` at the library's function `symbol`; the pointer's type is its C signature.
  /// @throws Error naming library and symbol if there is none of that name.
  template <class Function>
  void find(Function*& function, const char* symbol) const {
    static_assert(std::is_function_v<Function>);
    function = reinterpret_cast<Function*>(address_of(symbol, true));
  }
  /// As `find`, for what older versions lack: null then.
  template <class Function>
  void try_find(Function*& function, const char* symbol) const {
    static_assert(std::is_function_v<Function>);
    function = reinterpret_cast<Function*>(address_of(symbol, false));
  }

 private:
  [[nodiscard]] void* address_of(const char* symbol, bool needed) const;

  std::string name_, remedy_, path_;
  void* handle_ = nullptr;
};

}  // namespace palpate
