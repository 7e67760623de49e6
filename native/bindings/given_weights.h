/// Weights as Python has them: a WeightTable, a Skin or an array.
#pragma once

#include <pybind11/numpy.h>

#include <memory>

#include "arrays.h"
#include "sinew/skin.h"
#include "sinew/weight_table.h"

namespace sinew::bindings {

/// Returns a WeightTable as it is, the influences of a Skin, or what of an array (V, B) is above 0. wanted  the shape, for
/// messages.
inline std::shared_ptr<const WeightTable> given_table(const char* name, const py::object& given,
                                                      const char* wanted = "(V, B)") {
  if (py::isinstance<WeightTable>(given)) return given.cast<std::shared_ptr<const WeightTable>>();
  if (py::isinstance<Skin>(given)) {
    const auto& skin = given.cast<const Skin&>();
    return std::make_shared<const WeightTable>(
        WeightTable::from_lists(skin.offsets(), skin.joints(), skin.weights(), skin.joint_count()));
  }
  const py::array array = given_array(name, given);
  require_shape(name, array, wanted);
  const Numbers<float> numbers(name, array);
  return std::make_shared<const WeightTable>(WeightTable::from_dense(name, numbers, array.shape(0), array.shape(1)));
}

/// Binds the lists of WeightTable, or of a class that has one as `weights`. bones  the name of the second. sums  what the
/// docstring says of a vertex's weights besides.
template <class T, class... Options>
void bind_entries(py::class_<T, Options...>& bound, const char* bones, const std::string& sums) {
  static constexpr auto table_of = [](const py::object& self) -> const WeightTable& {
    const auto& own = self.cast<const T&>();
    if constexpr (std::is_same_v<T, WeightTable>) {
      return own;
    } else {
      return own.weights;
    }
  };
  static constexpr auto view_of = []<class Number>(const py::object& self, Number BoneWeight::*member) {
    static_assert(sizeof(BoneWeight) == 2 * sizeof(Number));
    const auto entries = table_of(self).entries();
    const Number* const first = entries.empty() ? nullptr : &(entries.front().*member);
    return view(first, {std::ssize(entries)}, {2}, self);
  };
  bound
      .def_property_readonly(
          "offsets", [](const py::object& self) { return view_list(table_of(self).offsets(), self); },
          "(V + 1,) int64, read-only: where the entries of each vertex begin.")
      .def_property_readonly(
          bones, [](const py::object& self) { return view_of(self, &BoneWeight::bone); },
          "(N,) int32, read-only, ascending at each vertex.")
      .def_property_readonly(
          "weights", [](const py::object& self) { return view_of(self, &BoneWeight::weight); },
          ("(N,) float32, read-only, above 0" + sums).c_str());
}

}  // namespace sinew::bindings
