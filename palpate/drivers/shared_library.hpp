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
  /// Of the environment. Where it is set it counts alone: a file, or the folder of one of `files`.
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

  /// A function of the library: becomes a pointer of whatever type it is given to, which is to be
  /// its C signature: int (*close)(char) = library.find("dhdClose").
  struct Symbol {
    void* address;
    template <class Function>
    requires std::is_function_v<Function>
    operator Function*() const { return reinterpret_cast<Function*>(address); }
  };
  /// @throws Error naming library and symbol if there is none of that name.
  [[nodiscard]] Symbol find(const char* symbol) const;
  /// As `find`, for what older versions lack: null then.
  [[nodiscard]] Symbol try_find(const char* symbol) const;

 private:
  std::string name_, remedy_, path_;
  void* handle_ = nullptr;
};

}  // namespace palpate
