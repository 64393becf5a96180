// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/shared_library.hpp"

#include <cstdlib>
#include <filesystem>

#include <dlfcn.h>
#include <link.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace {

namespace fs = std::filesystem;

// What is to be given to the loader, in this order.
std::vector<std::string> candidates(const LibraryNames& names) {
  const char* given = names.variable.empty() ? nullptr : std::getenv(names.variable.c_str());
  if (given == nullptr || *given == '\0') return names.files;
  std::error_code error;
  if (!fs::is_directory(given, error)) return {fs::absolute(given, error).string()};
  std::vector<std::string> files;
  for (const std::string& file : names.files) {
    const fs::path path = fs::absolute(given, error) / fs::path(file).filename();
    if (fs::exists(path, error)) files.push_back(path.string());
  }
  if (files.empty())
    throw Error(names.name,
                std::string("the folder ") + given + " of " + names.variable + " has no " +
                    names.files.front(),
                "set " + names.variable + " to the library's file or folder");
  return files;
}

std::string path_of(void* handle, const std::string& asked) {
  const link_map* map = nullptr;
  if (dlinfo(handle, RTLD_DI_LINKMAP, static_cast<void*>(&map)) == 0 && map != nullptr &&
      *map->l_name != '\0')
    return map->l_name;
  return asked;
}

}  // namespace

SharedLibrary::SharedLibrary(const LibraryNames& names) : name_(names.name), remedy_(names.remedy) {
  const std::vector<std::string> files = candidates(names);
  std::string list;
  std::string refusal;  // of a file that is there
  for (const std::string& file : files) {
    handle_ = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
    if (handle_ != nullptr) {
      path_ = path_of(handle_, file);
      return;
    }
    const char* said = dlerror();
    const std::string text = said == nullptr ? "" : said;
    if (refusal.empty() && !text.starts_with(file + ": cannot open shared object file"))
      refusal = text;
    add_to_list(list, file);
  }
  const std::string set =
      names.variable.empty() ? "" : ", or set " + names.variable + " to its file or folder";
  if (!refusal.empty())
    throw Error(name_, "its library cannot be loaded (" + refusal + ")", remedy_ + set);
  throw Error(name_, "its library is not there (looked for " + list + ")", remedy_ + set);
}

SharedLibrary::Symbol SharedLibrary::find(const char* symbol) const {
  const Symbol found = try_find(symbol);
  if (found.address == nullptr)
    throw Error(name_, path_ + " has no function " + symbol + ": it is of another version",
                remedy_);
  return found;
}

SharedLibrary::Symbol SharedLibrary::try_find(const char* symbol) const {
  return {dlsym(handle_, symbol)};
}

}  // namespace palpate
