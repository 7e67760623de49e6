/// Runs long computations so that Ctrl C cancels them.
#pragma once

#include <pybind11/pybind11.h>

#include <chrono>
#include <future>
#include <memory>
#include <optional>
#include <system_error>

#include "sinew/progress.h"

namespace sinew::bindings {

constexpr std::chrono::milliseconds kBetweenSignals(50);

/// Returns the result of compute(progress). Runs it in a separate thread, without the GIL, while the calling thread
/// lets Python handle signals. If a handler raises, as the one for Ctrl C does, the computation is cancelled, and the
/// error is raised here after it has ended.
template <class Compute>
auto interruptible(std::shared_ptr<Progress> progress, const Compute& compute) {
  namespace py = pybind11;
  using Result = decltype(compute(progress.get()));
  if (!progress) progress = std::make_shared<Progress>();
  std::optional<py::error_already_set> raised;
  std::optional<Result> result;
  {
    const py::gil_scoped_release release;
    std::future<Result> computation;
    try {
      computation = std::async(std::launch::async, [&] { return compute(progress.get()); });
    } catch (const std::system_error&) {  // no thread can be started
      result = compute(progress.get());
    }
    while (!result && !raised && computation.wait_for(kBetweenSignals) != std::future_status::ready) {
      const py::gil_scoped_acquire acquire;
      if (PyErr_CheckSignals() == 0) continue;
      raised.emplace();
      progress->cancel();
    }
    if (!result) result = computation.get();
  }
  if (raised) throw py::error_already_set(std::move(*raised));
  return std::move(*result);
}

}  // namespace sinew::bindings
