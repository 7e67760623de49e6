/// A rig program that can be pickled, since it has kept what it was made from.
#pragma once

#include <pybind11/pybind11.h>

#include <memory>
#include <string>

#include "sinew/rig_program.h"

namespace sinew::bindings {

/// Of each RigProgram that Python has. All text is pickled: the caller may change a dictionary later.
struct KeptProgram : RigProgram {
  std::string description;  ///< empty if it was not to be kept
  std::string edits;        ///< a dictionary of values and one of curves, the latest last; empty if there are none
};

/// Makes a program of a dictionary as docs/rigs.md has it, or of a file's text, as bytes. Throws InputError.
std::shared_ptr<RigProgram> kept_program(const pybind11::object& description, bool keeps_description);

/// Returns RigProgram::edited, with the edit kept. set, curves: what it was made from.
std::shared_ptr<RigProgram> kept_edit(const RigProgram& program, RigProgram edited, const pybind11::dict& set,
                                      const pybind11::list& curves);

/// Returns (description, set, curves). Throws type_error if the description was not kept.
pybind11::tuple state_of(const RigProgram& program);

}  // namespace sinew::bindings
