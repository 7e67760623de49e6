/// Python's objects as the values that the library reads.
#pragma once

#include <pybind11/pybind11.h>

#include "sinew/json.h"

namespace sinew::bindings {

/// Copies dictionaries, lists and tuples, arrays, text and numbers. Anything else becomes Json::Other. Throws InputError if
/// they are nested without end, and for an array that holds no numbers.
Json json_of(const pybind11::handle& object);

}  // namespace sinew::bindings
