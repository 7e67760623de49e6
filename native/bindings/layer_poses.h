/// Reads the poses of layers from Python's arguments.
#pragma once

#include <cstring>
#include <string>

#include "arrays.h"
#include "sinew/layer.h"

namespace sinew::bindings {

/// Returns pose i, a tuple (matrices (J, 4, 4) float32, space (4, 4) float64 or None), which it refers to. Throws
/// InputError.
inline LayerPose pose_of(const py::handle& given, std::size_t i) {
  const std::string where = "pose " + std::to_string(i);
  if (!py::isinstance<py::tuple>(given) || py::len(given) != 2) {
    throw InputError(where + " is not a tuple (matrices, space)");
  }
  const auto tuple = py::reinterpret_borrow<py::tuple>(given);
  const std::string name = where + ": matrices";
  const py::array matrices = given_array(name.c_str(), tuple[0]);
  LayerPose pose{matrix_stack<const float>(name.c_str(), matrices, "(J, 4, 4)")};
  if (tuple[1].is_none()) return pose;
  const std::string space_name = where + ": space";
  const py::array space = given_array(space_name.c_str(), tuple[1]);
  require_shape(space_name.c_str(), space, "(4, 4)");
  require_dtype<double>(space_name.c_str(), space);
  auto& matrix = pose.mesh_from_armature.emplace();
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      std::memcpy(&matrix(row, column), space.data(row, column), sizeof(double));
    }
  }
  return pose;
}

}  // namespace sinew::bindings
