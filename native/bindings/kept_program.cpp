#include "kept_program.h"

#include <utility>

#include "arrays.h"
#include "json_of.h"
#include "sinew/rig_file.h"

namespace sinew::bindings {
namespace {

/// Returns nothing for what cannot be pickled, such as a number of an unknown class.
std::string pickled(const py::object& object) {
  try {
    return py::bytes(py::module_::import("pickle").attr("dumps")(object, -1));
  } catch (const py::error_already_set&) {
    return {};
  }
}

py::object unpickled(const std::string& text) { return py::module_::import("pickle").attr("loads")(py::bytes(text)); }

std::pair<py::dict, py::dict> edits_of(const KeptProgram& program) {
  if (program.edits.empty()) return {};
  const py::tuple both = unpickled(program.edits);
  return {both[0], both[1]};
}

const KeptProgram& kept(const RigProgram& program) { return static_cast<const KeptProgram&>(program); }

}  // namespace

std::shared_ptr<RigProgram> kept_program(const py::object& description, bool keeps_description) {
  const bool is_text = py::isinstance<py::bytes>(description);
  const RigDescription read = is_text
                                  ? rig_description_of(std::string_view(py::reinterpret_borrow<py::bytes>(description)))
                                  : rig_description_of(json_of(description));
  const auto program = std::make_shared<KeptProgram>(KeptProgram{RigProgram(read), {}, {}});
  if (keeps_description) program->description = pickled(description);
  return program;
}

std::shared_ptr<RigProgram> kept_edit(const RigProgram& program, RigProgram edited, const py::dict& set,
                                      const py::list& curves) {
  const KeptProgram& before = kept(program);
  const auto after = std::make_shared<KeptProgram>(KeptProgram{std::move(edited), before.description, {}});
  if (before.description.empty()) return after;
  auto [values, rows] = edits_of(before);
  for (const auto& [path, value] : set) {
    values.attr("pop")(path, py::none());  // the one that counts comes last
    values[path] = value;
  }
  for (const py::handle row : curves) {
    const auto own = py::reinterpret_borrow<py::dict>(row);
    rows[py::make_tuple(own["path"], own.attr("get")("index", 0))] = own;
  }
  after->edits = pickled(py::make_tuple(values, rows));
  if (after->edits.empty()) after->description.clear();
  return after;
}

py::tuple state_of(const RigProgram& program) {
  if (kept(program).description.empty()) {
    throw py::type_error("this RigProgram cannot be pickled; make it with keep_description=True");
  }
  const auto [values, rows] = edits_of(kept(program));
  return py::make_tuple(unpickled(kept(program).description), values, py::list(rows.attr("values")()));
}

}  // namespace sinew::bindings
