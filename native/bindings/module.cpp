#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <exception>
#include <new>

#include "sinew/instruction_set.h"
#include "sinew/threads.h"
#include "sinew/types.h"
#include "texts.h"

namespace sinew::bindings {
void bind_skeleton(pybind11::module_& module);
void bind_files(pybind11::module_& module);
void bind_host(pybind11::module_& module);
void bind_method_data(pybind11::module_& module);
void bind_direct_delta_mush(pybind11::module_& module);
void bind_rigs(pybind11::module_& module);
void bind_skinning(pybind11::module_& module);
void bind_stages(pybind11::module_& module);
void bind_stencils(pybind11::module_& module);
void bind_automatic_weights(pybind11::module_& module);
void bind_bvh(pybind11::module_& module);
void bind_cages(pybind11::module_& module);
void bind_deformer(pybind11::module_& module);
void bind_decompose(pybind11::module_& module);
void bind_tasks(pybind11::module_& module);
void bind_weight_tools(pybind11::module_& module);
void explain_arguments(const pybind11::object& module);
}  // namespace sinew::bindings

namespace {

/// Replaces pybind11's own message, "std::bad_alloc".
void translate_no_memory(std::exception_ptr thrown) {
  try {
    std::rethrow_exception(thrown);
  } catch (const std::bad_alloc&) {
    PyErr_SetString(PyExc_MemoryError, "there is not enough memory; close what is not needed, or take a smaller mesh");
  }
}

/// Keeps the text of an error short: names and files may be of any length. HalfTurn has a class of its own.
void translate_input_error(std::exception_ptr thrown) {
  try {
    std::rethrow_exception(thrown);
  } catch (const sinew::InputError& error) {
    const std::string text = sinew::bindings::shortened(error.what());
    const pybind11::object said = pybind11::reinterpret_steal<pybind11::object>(
        PyUnicode_DecodeUTF8(text.data(), static_cast<pybind11::ssize_t>(text.size()), "backslashreplace"));
    PyErr_SetObject(PyExc_ValueError, said.ptr());
  }
}

/// pybind11 raises RuntimeError for an object of another class.
void translate_wrong_object(std::exception_ptr thrown) {
  try {
    std::rethrow_exception(thrown);
  } catch (const pybind11::cast_error&) {
    PyErr_SetString(PyExc_TypeError, "an object is not of the class that is expected here");
  }
}

/// Replaces pybind11's allocation. An object from cls.__new__(cls) has no C++ instance, and pybind11 would allocate
/// memory for one that no constructor has initialized.
void* refuse_to_allocate(std::size_t) { throw pybind11::type_error("__init__ was not called; call the class itself"); }

/// Applies refuse_to_allocate to the classes of a module or submodule.
void refuse_unmade_objects(const pybind11::object& module) {
  for (const auto& [name, member] : pybind11::dict(module.attr("__dict__"))) {
    if (!PyType_Check(member.ptr())) continue;
    auto* const info = pybind11::detail::get_type_info(reinterpret_cast<PyTypeObject*>(member.ptr()));
    if (info) info->operator_new = &refuse_to_allocate;
  }
}

}  // namespace

PYBIND11_MODULE(sinew_native, module) {
  module.doc() =
      "Skeletal deformation: forward kinematics, skinning, shape keys, smoothing and the files of "
      "a rig "
      "folder.";
  pybind11::register_local_exception_translator(&translate_no_memory);
  pybind11::register_local_exception_translator(&translate_input_error);
  pybind11::register_local_exception_translator(&translate_wrong_object);
  module.attr("__version__") = SINEW_VERSION;
  sinew::bindings::bind_skeleton(module);
  sinew::bindings::bind_files(module);
  sinew::bindings::bind_bvh(module);
  sinew::bindings::bind_host(module);
  sinew::bindings::bind_skinning(module);
  sinew::bindings::bind_method_data(module);
  sinew::bindings::bind_direct_delta_mush(module);
  sinew::bindings::bind_stages(module);
  sinew::bindings::bind_stencils(module);
  sinew::bindings::bind_cages(module);
  sinew::bindings::bind_deformer(module);
  sinew::bindings::bind_decompose(module);
  sinew::bindings::bind_weight_tools(module);
  sinew::bindings::bind_automatic_weights(module);
  sinew::bindings::bind_rigs(module);
  sinew::bindings::bind_tasks(module);
  module.def("set_thread_count", &sinew::set_thread_count, pybind11::arg("count"),
             "Lets later calls use at most `count` threads, the calling one included, and never more "
             "than the machine has; 0 means as many as it has. Results never depend on it. Raises "
             "ValueError for a "
             "negative number.");
  module.def("instruction_sets", &sinew::instruction_sets,
             "The names of the instruction sets that this machine can run, best first.");
  module.def("instruction_set", &sinew::instruction_set, "The instruction set in use.");
  module.def("set_instruction_set", &sinew::set_instruction_set, pybind11::arg("name"),
             pybind11::call_guard<pybind11::gil_scoped_release>(),
             "Uses this instruction set from now on, or the best for \"auto\". Results of two sets "
             "agree to rounding, not to the bit. Waits until skinning calls in other threads have ended. Raises "
             "ValueError for an unknown name.");
  module.def("thread_count", &sinew::thread_count, "The number of threads the next call may use, at least 1.");
  for (const pybind11::object& own : {pybind11::object(module), pybind11::object(module.attr("host"))}) {
    refuse_unmade_objects(own);
    sinew::bindings::explain_arguments(own);
  }
}
