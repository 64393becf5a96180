// SPDX-License-Identifier: Apache-2.0
#include "app/lab_rendering.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "palpate/core/error.hpp"

namespace palpate::app {
namespace {

bool same(const Parameters& a, const Parameters& b) {
  return std::all_of(parameter_table().begin(), parameter_table().end(),
                     [&](const ParameterInfo& row) { return row.get(a) == row.get(b); });
}

class LabRendering final : public Rendering {
 public:
  LabRendering(std::string name, const Parameters& parameters)
      : name_(std::move(name)), parameters_(parameters), method_(make(parameters)) {}

  void seat(const Vec3& proxy) noexcept override {
    proxy_ = proxy;
    method_->seat(proxy);
  }

  void frame(const Cloud& cloud, double stamp) noexcept override {
    cloud_ = &cloud;
    stamp_ = stamp;
    try {
      method_->frame(cloud, stamp);
    } catch (const Error&) {  // such as points that nothing joins: there is nothing to touch
      cloud_ = nullptr;
      begin_anew(parameters_);
    }
  }

  Tick tick(const Vec3& hip, double t) noexcept override {
    const Tick tick = method_->tick(hip, t);
    proxy_ = tick.proxy;
    return tick;
  }

  // The lab's methods take their parameters when they are made.
  void set_parameters(const Parameters& parameters) override {
    if (same(parameters, parameters_)) return;
    begin_anew(parameters);
    parameters_ = parameters;
  }

 private:
  [[nodiscard]] std::unique_ptr<lab::TouchMethod> make(const Parameters& parameters) const {
    return lab::make_method(name_, {parameters, nullptr});
  }
  void begin_anew(const Parameters& parameters) {
    method_ = make(parameters);
    if (proxy_) method_->seat(*proxy_);
    if (cloud_ != nullptr) method_->frame(*cloud_, stamp_);
  }

  std::string name_;
  Parameters parameters_;
  std::unique_ptr<lab::TouchMethod> method_;
  std::optional<Vec3> proxy_;
  const Cloud* cloud_ = nullptr;  // in use
  double stamp_ = 0.0;
};

}  // namespace

std::unique_ptr<Rendering> open_rendering(const std::string& method, const Parameters& parameters,
                                          const std::vector<std::shared_ptr<const Cloud>>& seen) {
  if (is_of_the_kernel(method)) return rendering_by<Renderer>(parameters);
  const auto trial = lab::make_method(method, {parameters, nullptr});
  for (const auto& cloud : seen) {
    if (cloud) trial->frame(*cloud, 0.0);
  }
  return std::make_unique<LabRendering>(method, parameters);
}

bool is_of_the_kernel(std::string_view method) {
  return std::any_of(method_table().begin(), method_table().end(),
                     [&](const palpate::MethodInfo& row) { return row.name == method; });
}

std::vector<lab::MethodInfo> live_methods() {
  std::vector<lab::MethodInfo> methods = lab::known_methods();
  std::erase_if(methods, [](const auto& method) { return method.name == "ideal"; });
  return methods;
}

}  // namespace palpate::app
