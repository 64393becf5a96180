// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/methods/methods.hpp"

#include <string>
#include <utility>
#include <vector>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/feel/feel.hpp"
#include "palpate/kernel/paper/paper.hpp"
#include "palpate/kernel/sight/sight.hpp"
#include "palpate/kernel/tool/shape_touch.hpp"

namespace palpate {

std::vector<MethodInfo> listed_methods();  // made by CMake of files *_method.cpp

namespace {

template <Paper::Variant variant>
std::unique_ptr<Method> make_paper(const Parameters& parameters) {
  return std::make_unique<Paper>(parameters, variant);
}

MethodRegistry with_listed(MethodRegistry methods) {
  for (const MethodInfo& method : listed_methods()) methods.add(method);
  return methods;
}

}  // namespace

const MethodRegistry& standard_methods() {
  static const MethodRegistry methods = with_listed(
      {"method",
       "",
       {{"paper", "Rydén and Chizeck 2013, errata corrected",
         make_paper<Paper::Variant::corrected>},
        {"paper-as-printed", "Rydén and Chizeck 2013, to the letter",
         make_paper<Paper::Variant::as_printed>},
        {"fixed-step", "Rydén 2011 [1]: steps of 0.1 r_1, no velocity",
         make_paper<Paper::Variant::fixed_step>},
        {"sight", "tracks the surface along the camera's lines of sight (docs/sight.md)",
         [](const Parameters& parameters) { return std::make_unique<Sight>(parameters); }}}});
  return methods;
}

std::unique_ptr<Method> make_method(std::string_view name, const Parameters& parameters,
                                    const MethodRegistry& methods,
                                    std::shared_ptr<const ToolShape> tool) {
  if (tool) {
    static_cast<void>(methods.find(name));
    if (name != default_method)
      throw Error("method '" + std::string(name) + "'",
                  "it touches with a ball, not with the tool '" + tool->text() + "'",
                  "use the method 'sight', or the tool ball");
    return std::make_unique<ShapeTouch>(std::move(tool), parameters);
  }
  return std::make_unique<Feel>(methods.find(name).make(parameters), parameters);
}

}  // namespace palpate
