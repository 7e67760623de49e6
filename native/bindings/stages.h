/// Defines the Python object for a stage and its settings.
#pragma once

#include <pybind11/pybind11.h>

#include <memory>
#include <string>
#include <vector>

#include "sinew/stage.h"

namespace sinew::bindings {

struct StageOfPython {
  template <class Kind>
  StageOfPython(std::shared_ptr<const Kind> own, const typename Kind::Settings& settings)
      : StageOfPython(*own, settings, own) {}

  /// keeper: keeps `own` and what its settings refer to.
  template <class Kind>
  StageOfPython(const Kind& own, const typename Kind::Settings& settings, std::shared_ptr<const void> keeper)
      : stage(Staged<Kind>{&own, settings}), owner(std::move(keeper)) {
    own.check(settings);
  }

  Stage stage;
  std::shared_ptr<const void> owner;
};

/// Returns the stages of Stage objects, which must outlive the result.
inline std::vector<Stage> stages_of(const pybind11::tuple& objects) {
  std::vector<Stage> stages;
  for (const pybind11::handle stage : objects) {
    if (!pybind11::isinstance<StageOfPython>(stage)) {
      throw InputError("stage " + std::to_string(stages.size()) +
                       " is not a Stage; expected what stage(...) of a Smooth or another stage returns");
    }
    stages.push_back(stage.cast<const StageOfPython&>().stage);
  }
  return stages;
}

}  // namespace sinew::bindings
