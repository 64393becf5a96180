// SPDX-License-Identifier: Apache-2.0
#include "python/python_method.hpp"

#include <utility>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/methods/methods.hpp"

namespace palpate::python {

const Patch& CloudView::gathered(const Ball& ball) {
  if (cloud_ == nullptr)
    throw Error("cloud", "a newer frame has taken its place",
                "use a cloud only until the method's next frame");
  if (!patch_) patch_ = std::make_unique<Patch>();
  gather(*cloud_, ball, *patch_);
  return *patch_;
}

std::optional<Vec3> CloudView::viewpoint() {
  const Patch& patch = gathered(Ball{Vec3::Zero(), 1e-3});
  return patch.view_count() > 0 ? patch.view(0).viewpoint : std::nullopt;
}

Points CloudView::near(const Numbers& about, double radius) {
  const Vec3 centre = vector_of(about, "centre");
  const Patch& patch = gathered(Ball{centre, radius});
  std::vector<Vec3> points;
  for (std::size_t i = 0; i < patch.size(); ++i)
    points.emplace_back(centre + Vec3(patch.x()[i], patch.y()[i], patch.z()[i]));
  return rows_of(points);
}

namespace {

class PythonMethod final : public Method {
 public:
  PythonMethod(py::object object, std::shared_ptr<Trouble> trouble)
      : object_(std::move(object)), trouble_(std::move(trouble)) {
    for (const char* name : {"frame", "tick"}) {
      if (!py::hasattr(object_, name))
        throw Error("method", std::string("it has no function ") + name,
                    "derive its class from palpate.Method");
    }
    tick_ = object_.attr("tick");
  }

  ~PythonMethod() override {
    const py::gil_scoped_acquire gil;
    if (view_) view_->end();
    object_ = tick_ = view_object_ = py::object();
  }

  void seat(const Vec3& proxy) noexcept override {
    if (!proxy.allFinite()) return;
    attempt([&] {
      if (py::hasattr(object_, "seat")) object_.attr("seat")(proxy);
    });
  }

  void observe(const Observation& seen) noexcept override {
    clouds_.take(seen.camera, seen.cloud);
    ++frames_;
    attempt([&] {
      if (view_) view_->end();
      view_ = std::make_shared<CloudView>(&clouds_);
      view_object_ = py::cast(view_);
      object_.attr("frame")(view_object_, seen.stamp);
    });
  }

  Tick tick(const Vec3& hip, double t) noexcept override {
    Tick tick = free_tick(hip, t, frames_);
    if (trouble_->first || !hip.allFinite()) return tick;
    if (frames_ < 0) {
      tick.flags = no_frame;
      return tick;
    }
    attempt([&] {
      const auto answer = py::cast<py::tuple>(tick_(hip, t));
      if (answer.size() != 2 && answer.size() != 3)
        throw Error("method", "its tick gave " + std::to_string(answer.size()) + " values",
                    "return (proxy, force) or (proxy, force, normal)");
      const Vec3 proxy = vector_of(py::cast<Numbers>(answer[0]), "proxy");
      const Vec3 force = vector_of(py::cast<Numbers>(answer[1]), "force");
      const Vec3 normal = answer.size() == 3 ? vector_of(py::cast<Numbers>(answer[2]), "normal")
                                             : Vec3((proxy - hip).stableNormalized());
      if (!is_place(proxy) || !force.allFinite() || !normal.allFinite())
        throw Error("method", "its tick gave a number that is not finite",
                    "return a proxy [m] and a force [N]");
      tick.proxy = proxy;
      tick.force = force;
      if (force.squaredNorm() > 0.0) {
        tick.normal = normal;
        tick.state = ContactState::contact;
      }
    });
    return tick;
  }

  void set_parameters(const Parameters& parameters) noexcept override {
    attempt([&] {
      if (py::hasattr(object_, "set_parameters"))
        object_.attr("set_parameters")(values_of(parameter_table(), parameters));
    });
  }

 private:
  template <class Do>
  void attempt(const Do& act) noexcept {
    if (trouble_->first) return;
    const py::gil_scoped_acquire gil;
    try {
      act();
    } catch (...) {
      trouble_->first = std::current_exception();
    }
  }

  py::object object_;
  py::object tick_;
  ObservedClouds clouds_;
  std::shared_ptr<CloudView> view_;
  py::object view_object_;
  std::shared_ptr<Trouble> trouble_;
  std::int64_t frames_ = -1;
};

}  // namespace

std::unique_ptr<Method> method_of(const py::object& method, const Parameters& parameters,
                                  const std::shared_ptr<Trouble>& trouble) {
  if (py::isinstance<py::str>(method))
    return make_method(py::cast<std::string>(method), parameters);
  auto made = std::make_unique<PythonMethod>(method, trouble);
  validate(parameters);
  made->set_parameters(parameters);
  trouble->rethrow();
  return made;
}

py::dict summaries_of(const MethodRegistry& methods) {
  py::dict all;
  for (const MethodInfo& method : methods.entries()) all[py::str(method.name)] = method.summary;
  return all;
}

}  // namespace palpate::python
