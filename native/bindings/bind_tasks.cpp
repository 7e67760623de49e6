#include <pybind11/stl.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "arrays.h"
#include "interruptible.h"
#include "sinew/driver_expression.h"

// What the add-on needs of Python that an add-on must not use: threads of its own, and the evaluation of expressions.

namespace sinew::bindings {
namespace {

/// How many tasks run. Python waits for them when it ends.
class Running {
 public:
  void add(int count) {
    count_.fetch_add(count);
    count_.notify_all();
  }
  // Not by std::condition_variable, whose wait() would need the libstdc++ of GCC 12; wait_for() does not.
  void wait() {
    const py::gil_scoped_release release;
    for (int now = count_.load(); now != 0; now = count_.load()) count_.wait(now);
  }

 private:
  std::atomic<int> count_ = 0;
};

Running& running() {
  static auto& own = *new Running;
  return own;
}

class Task {
 public:
  /// Throws system_error if no thread can be started.
  explicit Task(py::function work) : state_(std::make_shared<State>()) {
    auto* const both = new std::pair(state_, std::move(work));  // whose Python objects go while the thread has the GIL
    running().add(1);
    try {
      std::thread([both] {
        {
          const py::gil_scoped_acquire acquire;
          run(*both->first, both->second);
          delete both;
        }
        running().add(-1);
      }).detach();
    } catch (...) {
      delete both;
      running().add(-1);
      throw;
    }
  }

  bool is_done() const {
    const std::lock_guard lock(state_->mutex);
    return state_->is_done;
  }

  bool wait(std::optional<double> seconds) const {
    using Clock = std::chrono::steady_clock;
    const auto end = Clock::now() + std::chrono::duration<double>(std::clamp(seconds.value_or(1e9), 0.0, 1e9));
    const bool handles_signals = is_main_thread();
    while (!is_done()) {
      const auto left = end - Clock::now();
      if (left.count() <= 0) return false;
      {
        const py::gil_scoped_release release;
        std::unique_lock lock(state_->mutex);
        state_->changed.wait_for(lock, std::min<std::chrono::duration<double>>(left, kBetweenSignals),
                                 [this] { return state_->is_done; });
      }
      if (handles_signals && PyErr_CheckSignals() != 0) throw py::error_already_set();
    }
    return true;
  }

  py::object result() const {
    wait(std::nullopt);
    if (state_->has_raised) {
      PyErr_SetObject(py::type::handle_of(state_->result).ptr(), state_->result.ptr());
      throw py::error_already_set();
    }
    return state_->result;
  }

 private:
  struct State {
    std::mutex mutex;
    std::condition_variable changed;
    bool is_done = false;
    py::object result;  // or what was raised; the GIL guards both
    bool has_raised = false;
  };

  static void run(State& state, const py::function& work) {
    try {
      state.result = work();
    } catch (const py::error_already_set& error) {
      state.result = error.value();
      state.has_raised = true;
      if (error.trace()) PyException_SetTraceback(error.value().ptr(), error.trace().ptr());
    }
    const std::lock_guard lock(state.mutex);
    state.is_done = true;
    state.changed.notify_all();
  }

  std::shared_ptr<State> state_;
};

/// With how many variables it has.
struct ExpressionOfPython {
  ExpressionOfPython(const std::string& text, const std::vector<std::string>& names)
      : expression(text, names), count(names.size()) {}

  std::optional<double> value(const std::vector<float>& variables, double frame) const {
    if (variables.size() != count) {
      throw InputError("variables has " + std::to_string(variables.size()) + " numbers; expected " +
                       std::to_string(count));
    }
    return expression.value(variables, frame);
  }

  DriverExpression expression;
  std::size_t count;
};

}  // namespace

void bind_tasks(py::module_& module) {
  py::class_<Task>(module, "Task", "A function that runs in a thread of the library's own.")
      .def(py::init<py::function>(), py::arg("work"),
           "Begins at once, and returns. Python waits for it before it ends.\n\n"
           "work: what is called, without arguments. It must not use Blender's data.")
      .def_property_readonly("is_done", &Task::is_done, "Whether the function has returned or raised.")
      .def("wait", &Task::wait, py::arg("seconds") = py::none(),
           "Waits until the function has returned or raised.\n\n"
           "seconds: at most so long, or None. Returns whether it has.")
      .def("result", &Task::result, "Waits, and returns what the function has returned, or raises what it has raised.");
  py::class_<ExpressionOfPython>(
      module, "DriverExpression",
      "The expression of a scripted driver, in the part of Python that Blender computes itself. Immutable.")
      .def(py::init<const std::string&, const std::vector<std::string>&>(), py::arg("text"), py::arg("names"),
           "names: of the variables.\n"
           "Raises ValueError for what is not one of Blender's simple expressions, with the place.")
      .def_property_readonly(
          "reads_frame", [](const ExpressionOfPython& self) { return self.expression.reads_frame(); },
          "Whether it depends on the frame, other than by a variable of that name.")
      .def("value", &ExpressionOfPython::value, py::arg("variables"), py::arg("frame") = 0.0,
           "Returns the value. None if something is divided by 0 or has no value, such as the root of -1: Blender then "
           "switches the driver off.\n\n"
           "variables: a number for each name.\n"
           "frame: the time.\n"
           "Raises ValueError for another number of variables.");
  py::module_::import("atexit").attr("register")(py::cpp_function([] { running().wait(); }));
}

}  // namespace sinew::bindings
