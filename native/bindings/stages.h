/// A stage and its settings, as Python holds them.
#pragma once

#include <memory>

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

}  // namespace sinew::bindings
