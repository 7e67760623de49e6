/// Runs long computations so that Ctrl C cancels them.
#pragma once

#include <pybind11/pybind11.h>

#include <chrono>
#include <future>
#include <memory>
#include <optional>
#include <system_error>
#include <thread>

#include "objects.h"
#include "sinew/progress.h"

namespace sinew::bindings {

constexpr std::chrono::milliseconds kBetweenSignals(50);

/// Python lets its main thread handle signals and no other.
inline bool is_main_thread() {
  const auto main = pybind11::module_::import("threading").attr("main_thread")();
  return main.attr("ident").cast<unsigned long>() == PyThread_get_thread_ident();
}

/// Whether Python has ended or is about to. May be called without the GIL.
inline bool python_ends() {
#if PY_VERSION_HEX >= 0x030D0000
  return Py_IsFinalizing() != 0;
#else
  return _Py_IsFinalizing() != 0;
#endif
}

/// Returns the result of compute(progress), which runs without the GIL. In the main thread Python handles signals
/// meanwhile: the computation runs in a separate thread, and if a handler raises, as the one for Ctrl C does, it is
/// cancelled, and the error is raised here after it has ended. If Python has ended meanwhile, this does not return.
template <class Compute>
auto interruptible(const OrNone<Progress>& given, const Compute& compute) {
  namespace py = pybind11;
  const auto progress = given ? *given : std::make_shared<Progress>();
  using Result = decltype(compute(progress.get()));
  std::optional<py::error_already_set> raised;
  std::optional<Result> result;
  std::future<Result> computation;
  const bool handles_signals = is_main_thread();
  {
    const py::gil_scoped_release release;
    if (handles_signals) {
      try {
        computation = std::async(std::launch::async, [&] { return compute(progress.get()); });
      } catch (const std::system_error&) {  // no thread can be started
      }
    }
    if (!computation.valid()) result = compute(progress.get());
    while (!result && !raised && computation.wait_for(kBetweenSignals) != std::future_status::ready) {
      const py::gil_scoped_acquire acquire;
      if (PyErr_CheckSignals() == 0) continue;
      raised.emplace();
      progress->cancel();
    }
    if (!result) result = computation.get();
    // A daemon thread: the GIL that it would take is gone, and the process is about to end.
    while (!handles_signals && python_ends()) std::this_thread::sleep_for(std::chrono::hours(1));
  }
  if (raised) throw py::error_already_set(std::move(*raised));
  return std::move(*result);
}

}  // namespace sinew::bindings
