/// Weights as Python has them: an array, a WeightTable or a Skin.
#pragma once

#include <pybind11/numpy.h>

#include <string>
#include <vector>

#include "arrays.h"
#include "sinew/skin.h"
#include "sinew/weight_table.h"

namespace sinew::bindings {

/// The influences of V vertices, as a Skin keeps them.
struct SparseWeights {
  std::vector<std::int64_t> offsets;
  std::vector<std::int32_t> joints;
  std::vector<float> weights;
  std::int32_t joint_count = 0;
};

/// Returns a WeightTable as it is, or what of an array (V, B) is above 0. wanted  the shape, for messages.
inline WeightTable given_table(const char* name, const py::object& given, const char* wanted = "(V, B)") {
  if (py::isinstance<WeightTable>(given)) return given.cast<const WeightTable&>();
  const py::array array = given_array(name, given);
  if (array.ndim() != 2) wrong_shape(name, array, wanted);
  const Numbers<float> numbers(name, array);
  return WeightTable::from_dense(name, numbers, array.shape(0), array.shape(1));
}

/// Returns the influences of a Skin, or those of a table (V, J) that are not 0.
inline SparseWeights sparse_weights(const char* name, const py::object& given) {
  SparseWeights sparse;
  if (py::isinstance<Skin>(given)) {
    const auto& skin = given.cast<const Skin&>();
    sparse.offsets.assign(skin.offsets().begin(), skin.offsets().end());
    sparse.joints.assign(skin.joints().begin(), skin.joints().end());
    sparse.weights.assign(skin.weights().begin(), skin.weights().end());
    sparse.joint_count = static_cast<std::int32_t>(skin.joint_count());
    return sparse;
  }
  const py::array table = given_array(name, given);
  if (table.ndim() != 2) wrong_shape(name, table, "(V, J)");
  const Numbers<float> numbers(name, table);
  const std::span<const float> all = numbers;
  const auto joints = static_cast<std::size_t>(table.shape(1));
  sparse.joint_count = static_cast<std::int32_t>(joints);
  sparse.offsets.push_back(0);
  for (std::size_t v = 0; v < static_cast<std::size_t>(table.shape(0)); ++v) {
    for (std::size_t j = 0; j < joints; ++j) {
      if (all[v * joints + j] == 0) continue;
      sparse.joints.push_back(static_cast<std::int32_t>(j));
      sparse.weights.push_back(all[v * joints + j]);
    }
    sparse.offsets.push_back(std::ssize(sparse.joints));
  }
  return sparse;
}

}  // namespace sinew::bindings
