/// Helpers that the bindings of the skinning functions share.
#pragma once

#include <memory>
#include <vector>

#include "arrays.h"
#include "sinew/skin.h"

namespace sinew::bindings {

/// Returns the shape of the result: (V, 3), or (F, V, 3) if the matrices have a frame axis.
inline std::vector<py::ssize_t> positions_shape(const Skin& skin, const py::array& matrices) {
  std::vector<py::ssize_t> shape{skin.vertex_count(), 3};
  if (matrices.ndim() == 4) shape.insert(shape.begin(), matrices.shape(0));
  return shape;
}

/// Calls skin(matrices, positions) without the GIL and returns the positions.
template <class Call>
py::array skinned(const Skin& skin, const py::array& matrices, const py::object& out, const Call& call) {
  const auto stack = matrix_stack<const float>("matrices", matrices);
  const auto shape = positions_shape(skin, matrices);
  const py::array result = out.is_none() ? py::array(py::dtype::of<float>(), shape) : given_array("out", out);
  const std::span<float> positions = written_span<float>("out", result, shape);
  {
    const py::gil_scoped_release release;
    call(stack, positions);
  }
  return result;
}

inline std::shared_ptr<Skin> skin_from_dense(const py::array& rest_positions, const py::array& weights) {
  require_shape("weights", weights, "(V, J)");
  check_counts(weights.shape(0), 0, weights.shape(1));
  const Numbers<double> numbers("weights", weights);
  const auto points = points_of<float>("rest_positions", rest_positions);
  const auto rows = weights.shape(0), columns = weights.shape(1);
  const py::gil_scoped_release release;
  return std::make_shared<Skin>(
      Skin::from_dense(points, std::span<const double>(numbers).data(), rows, columns, columns, 1));
}

constexpr const char* kSkinArguments =
    "matrices: F(j) A(j)^-1, (J, 4, 4) or (F, J, 4, 4), float32, indexed m[j, row, column]; any "
    "strides, a transposed view is read in place; the last row is taken to be 0 0 0 1.\n"
    "out: where to write, (V, 3) or (F, V, 3), float32, C-contiguous, space of the mesh; made if "
    "None.\n";

constexpr const char* kSkinReturns = "Returns out. Raises ValueError if a shape or dtype does not fit.";

}  // namespace sinew::bindings
