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
      : stage(Staged<Kind>{own.get(), settings}), owner(std::move(own)) {
    std::get<Staged<Kind>>(stage).stage->check(settings);
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
                       " is not a Stage; expected what stage(...) of a CorrectiveSmooth, Smooth or Hook returns");
    }
    stages.push_back(stage.cast<const StageOfPython&>().stage);
  }
  return stages;
}

}  // namespace sinew::bindings
