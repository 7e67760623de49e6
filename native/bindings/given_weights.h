/// Weights as Python has them: a WeightTable, a Skin or an array.
#pragma once

#include <pybind11/numpy.h>

#include "arrays.h"
#include "sinew/skin.h"
#include "sinew/weight_table.h"

namespace sinew::bindings {

/// Returns a WeightTable as it is, the influences of a Skin, or what of an array (V, B) is above 0. wanted  the shape, for
/// messages.
inline WeightTable given_table(const char* name, const py::object& given, const char* wanted = "(V, B)") {
  if (py::isinstance<WeightTable>(given)) return given.cast<const WeightTable&>();
  if (py::isinstance<Skin>(given)) {
    const auto& skin = given.cast<const Skin&>();
    return WeightTable::from_lists(skin.offsets(), skin.joints(), skin.weights(), skin.joint_count());
  }
  const py::array array = given_array(name, given);
  if (array.ndim() != 2) wrong_shape(name, array, wanted);
  const Numbers<float> numbers(name, array);
  return WeightTable::from_dense(name, numbers, array.shape(0), array.shape(1));
}

/// Views of a table's offsets, bones and weights, which `owner` keeps alive.
inline py::array offsets_view(const WeightTable& table, const py::object& owner) {
  return view_list(table.offsets(), owner);
}
template <class T>
py::array entries_view(const WeightTable& table, T BoneWeight::*member, const py::object& owner) {
  static_assert(sizeof(BoneWeight) == 2 * sizeof(T));
  const auto entries = table.entries();
  const T* const first = entries.empty() ? nullptr : &(entries.front().*member);
  return view(first, {std::ssize(entries)}, {2}, owner);
}

}  // namespace sinew::bindings
