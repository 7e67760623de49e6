/// A rig's description as Python has it: the dictionaries of docs/rigs.md.
#pragma once

#include <pybind11/pybind11.h>

#include <filesystem>

#include "sinew/rig_description.h"

namespace sinew::bindings {

/// Throws InputError, which says where something is missing, unknown or of the wrong kind.
RigDescription rig_description_of(const pybind11::dict& description);

/// Reads a JSON file as a dictionary. Throws InputError.
pybind11::dict rig_file(const std::filesystem::path& path);

/// The same for rows of its "curves".
std::vector<AnimatedValue> animated_values_of(const pybind11::list& rows);

}  // namespace sinew::bindings
