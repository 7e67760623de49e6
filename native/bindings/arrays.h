/// Converts between numpy arrays and the library's views. Arguments of the functions that are called each frame are
/// never copied or converted. Constructors copy their arguments anyway, so they accept any real dtype.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <algorithm>
#include <cctype>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "objects.h"
#include "sinew/types.h"
#include "texts.h"

namespace sinew::bindings {

namespace py = pybind11;

inline std::string shape_text(const std::vector<py::ssize_t>& shape) {
  std::string text;
  for (const py::ssize_t size : shape) text += (text.empty() ? "" : ", ") + std::to_string(size);
  return "(" + text + (shape.size() == 1 ? ",)" : ")");
}

inline std::string dtype_text(const py::array& array) { return py::str(array.dtype()); }

/// Whether the sizes are those that are written, such as "F, J, 4, 4" or "V,": a word may be any size.
inline bool are_sizes(std::span<const py::ssize_t> shape, std::string_view written) {
  while (!written.empty() && !shape.empty()) {
    const std::string_view size = written.substr(0, written.find(','));
    if (std::isdigit(static_cast<unsigned char>(size[0])) && size != std::to_string(shape[0])) return false;
    written.remove_prefix(std::min(written.size(), size.size() + 2));
    shape = shape.subspan(1);
  }
  return written.empty() && shape.empty();
}

/// Requires a shape as docstrings have it, or one of several: "(J, 4, 4) or (F, J, 4, 4)".
inline void require_shape(const char* name, const py::array& array, std::string_view expected) {
  const std::span<const py::ssize_t> shape(array.shape(), static_cast<std::size_t>(array.ndim()));
  for (std::size_t end = 0, begin; (begin = expected.find('(', end)) != expected.npos;) {
    end = expected.find(')', begin);
    if (are_sizes(shape, expected.substr(begin + 1, end - begin - 1))) return;
  }
  throw InputError(std::string(name) + " has shape " + shape_text({shape.begin(), shape.end()}) + "; expected " +
                   std::string(expected));
}

template <class T>
void require_dtype(const char* name, const py::array& array) {
  if (!py::isinstance<py::array_t<T>>(array)) {
    throw InputError(std::string(name) + " is " + dtype_text(array) + "; expected " +
                     std::string(py::str(py::dtype::of<T>())));
  }
}

/// Requires an array that is aligned in numpy's sense: its address and strides are multiples of the item size.
inline void require_aligned(const char* name, const py::array& array) {
  if (!(array.flags() & py::detail::npy_api::NPY_ARRAY_ALIGNED_)) {
    throw InputError(std::string(name) + " is not aligned in memory; pass " + std::string(name) + ".copy()");
  }
}

/// Casts an object, which must already be an array. pybind11 would copy a list, and the caller would not see what is
/// written to the copy.
inline py::array given_array(const char* name, const py::object& object) {
  if (!py::isinstance<py::array>(object)) {
    throw InputError(std::string(name) + " is " + type_text(object) + "; expected a numpy array");
  }
  return py::reinterpret_borrow<py::array>(object);
}

/// Returns a view of a stack of 4x4 matrices with any strides, in place.
template <class T>
MatrixStack<T> matrix_stack(const char* name, const py::array& array, const char* shape = "(J, 4, 4) or (F, J, 4, 4)") {
  using Scalar = std::remove_const_t<T>;
  require_dtype<Scalar>(name, array);
  const py::ssize_t axes = array.ndim();
  require_shape(name, array, shape);
  require_aligned(name, array);
  const auto stride = [&](py::ssize_t axis) { return array.strides(axis) / static_cast<py::ssize_t>(sizeof(T)); };
  MatrixStack<T> stack;
  stack.frames = axes == 4 ? array.shape(0) : 1;
  stack.joints = array.shape(axes - 3);
  stack.frame_stride = axes == 4 ? stride(0) : 0;
  stack.joint_stride = stride(axes - 3);
  stack.row_stride = stride(axes - 2);
  stack.column_stride = stride(axes - 1);
  if constexpr (std::is_const_v<T>) {
    stack.data = static_cast<T*>(array.data());
  } else {
    if (!array.writeable()) throw InputError(std::string(name) + " is read-only; pass a writable array");
    stack.data = static_cast<T*>(const_cast<py::array&>(array).mutable_data());
  }
  return stack;
}

/// Copies numbers of any real dtype as T, for a constructor.
template <class T>
std::vector<T> copied(const char* name, const py::array& array) {
  const char kind = array.dtype().kind();
  if (std::is_integral_v<T> ? (kind != 'i' && kind != 'u') : (kind != 'f' && kind != 'i' && kind != 'u')) {
    throw InputError(std::string(name) + " is " + dtype_text(array) + "; expected " +
                     (std::is_integral_v<T> ? "integers" : "real numbers"));
  }
  const auto from = [&]<class Wide>(Wide) {
    const auto wide = py::array_t<Wide, py::array::c_style | py::array::forcecast>(array);
    std::vector<T> result;
    result.reserve(wide.size());
    for (py::ssize_t i = 0; i < wide.size(); ++i) {
      const Wide number = wide.data()[i];
      if constexpr (std::is_integral_v<T>) {
        if (!std::in_range<T>(number)) {
          throw InputError(std::string(name) + " holds " + std::to_string(number) + ", which is out of range");
        }
      }
      result.push_back(static_cast<T>(number));
    }
    return result;
  };
  if constexpr (std::is_integral_v<T>) {
    return kind == 'u' ? from(std::uint64_t{}) : from(std::int64_t{});
  } else {
    return from(double{});
  }
}

/// Numbers of any real dtype as T: the array's own memory if it contains consecutive T, otherwise a converted copy.
template <class T>
class Numbers {
 public:
  Numbers(const char* name, const py::array& array) : array_(array) {
    in_place_ = array.dtype().is(py::dtype::of<T>()) && (array.flags() & py::array::c_style) &&
                (array.flags() & py::detail::npy_api::NPY_ARRAY_ALIGNED_);
    if (!in_place_) converted_ = copied<T>(name, array);
  }
  operator std::span<const T>() const {
    if (!in_place_) return converted_;
    return {static_cast<const T*>(array_.data()), static_cast<std::size_t>(array_.size())};
  }
  operator std::vector<T>() const {
    const std::span<const T> numbers = *this;
    return {numbers.begin(), numbers.end()};
  }

 private:
  py::array array_;
  bool in_place_;
  std::vector<T> converted_;
};

/// Returns (N,) numbers as T.
template <class T>
Numbers<T> list_of(const char* name, const py::array& array) {
  require_shape(name, array, "(N,)");
  return {name, array};
}

/// (V,) numbers of any real dtype, or None.
class OptionalNumbers {
 public:
  OptionalNumbers(const char* name, const std::optional<py::array>& array) {
    if (array) numbers_.emplace(list_of<float>(name, *array));
  }
  operator std::optional<std::span<const float>>() const {
    if (!numbers_) return std::nullopt;
    return std::span<const float>(*numbers_);
  }

 private:
  std::optional<Numbers<float>> numbers_;
};

/// Returns (V, 3) points as T, row by row.
template <class T>
Numbers<T> points_of(const char* name, const py::array& array) {
  require_shape(name, array, "(V, 3)");
  return {name, array};
}

/// Returns the numbers of an array, flattened, for writing.
template <class T>
std::span<T> written_span(const char* name, const py::array& array, const std::vector<py::ssize_t>& shape) {
  require_dtype<T>(name, array);
  require_shape(name, array, shape_text(shape));
  if (!(array.flags() & py::array::c_style)) {
    throw InputError(std::string(name) + " is not C-contiguous; pass a C-contiguous array");
  }
  require_aligned(name, array);
  if (!array.writeable()) throw InputError(std::string(name) + " is read-only; pass a writable array");
  return {static_cast<T*>(const_cast<py::array&>(array).mutable_data()), static_cast<std::size_t>(array.size())};
}

/// Returns numbers that are read in place each frame: float32, C-contiguous.
inline std::span<const float> numbers_span(const char* name, const py::array& array, const char* shape) {
  require_shape(name, array, shape);
  require_dtype<float>(name, array);
  if (!(array.flags() & py::array::c_style)) {
    throw InputError(std::string(name) + " is not C-contiguous; pass a C-contiguous array");
  }
  require_aligned(name, array);
  return {static_cast<const float*>(array.data()), static_cast<std::size_t>(array.size())};
}

/// Copies 4x4 matrices.
inline std::vector<Matrix4<double>> copied_matrices(const char* name, const py::array& array, const char* shape) {
  require_shape(name, array, shape);
  const std::vector<double> numbers = copied<double>(name, array);
  std::vector<Matrix4<double>> matrices(numbers.size() / 16);
  for (std::size_t i = 0; i < matrices.size(); ++i) {
    matrices[i] = Matrix4<double>::Map(numbers.data() + 16 * i).transpose();
  }
  return matrices;
}

/// Copies (rows, columns) numbers of any real dtype into a matrix.
template <int rows, int columns, class T = float>
Eigen::Matrix<T, rows, columns> matrix_of(const char* name, const py::array& array) {
  require_shape(name, array, shape_text({rows, columns}));
  const std::vector<T> numbers = copied<T>(name, array);
  return Eigen::Matrix<T, columns, rows>::Map(numbers.data()).transpose();
}

/// Returns a read-only array over memory that `owner` keeps alive.
template <class T>
py::array view(const T* data, std::vector<py::ssize_t> shape, std::vector<py::ssize_t> strides,
               const py::object& owner) {
  for (auto& stride : strides) stride *= sizeof(T);
  py::array array(py::dtype::of<T>(), std::move(shape), std::move(strides), data, owner);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

/// Moves a list of numbers into an array that Python owns.
template <class T>
py::array given_away(std::vector<T> numbers, std::vector<py::ssize_t> shape) {
  auto* const kept = new std::vector<T>(std::move(numbers));
  const py::capsule owner(kept, [](void* own) { delete static_cast<std::vector<T>*>(own); });
  return py::array(py::dtype::of<T>(), std::move(shape), kept->data(), owner);
}

template <class Numbers>
py::array view_list(const Numbers& numbers, const py::object& owner) {
  return view(std::data(numbers), {static_cast<py::ssize_t>(std::size(numbers))}, {1}, owner);
}

/// Returns a read-only (J, 4, 4) array over column-major matrices.
inline py::array view_matrices(std::span<const Matrix4<double>> matrices, const py::object& owner) {
  const double* data = matrices.empty() ? nullptr : matrices.front().data();
  return view(data, {static_cast<py::ssize_t>(matrices.size()), 4, 4}, {16, 1, 4}, owner);
}

inline py::array view_matrix(const Eigen::Ref<const Eigen::MatrixXd>& matrix, const py::object& owner) {
  return view(matrix.data(), {matrix.rows(), matrix.cols()}, {1, matrix.outerStride()}, owner);
}

}  // namespace sinew::bindings
