/// The conventions of the whole library.
///
/// Letters       V vertices, J joints, P poses, F frames, N influences (all vertices together),
///               K shape keys.
/// Vectors       columns: a transform moves a point by M * p. The translation is the last column.
/// Positions     V x 3 float32, row by row (x y z x y z ...), in the space of the rest mesh.
/// Matrices      4x4. Eigen's own are column-major; a caller's may have any layout and are
///               accessed through MatrixStack, indexed [frame, joint, row, column].
/// Rest pose     the pose in which the mesh was bound. R(j) is joint j's rest transform relative to
///               its parent, A(j) the same relative to the world: A(j) = A(parent) R(j).
/// Pose          T(j), joint j's own transform on top of its rest transform.
/// Skinning matrix of joint j: F(j) A(j)^-1, where F(j) = F(parent) R(j) T(j).
/// Parents       -1 marks a root. There may be several roots.
///
/// There are two kinds of failure: a caller's mistake always throws InputError (ValueError in Python);
/// a bug of our own is caught by an assert. Raw input is checked once, when an object is built; the
/// functions that run in each frame trust those objects and check only shapes.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <stdexcept>

namespace sinew {

/// A mistake in the caller's arguments or in a file. The message is one readable sentence.
class InputError : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

/// Which way lies between two joints that are half a turn apart depends on rounding, and the caller wants to know.
class HalfTurn : public InputError {
 public:
  using InputError::InputError;
};

template <class T>
using Matrix4 = Eigen::Matrix<T, 4, 4>;

/// A view of F x J 4x4 matrices in the caller's memory. Strides count elements, not bytes, and may
/// have any value: row-major, column-major (as in Blender) and slices are all read in place.
template <class T>
struct MatrixStack {
  T* data = nullptr;
  std::ptrdiff_t frames = 0;
  std::ptrdiff_t joints = 0;
  std::ptrdiff_t frame_stride = 0;
  std::ptrdiff_t joint_stride = 0;
  std::ptrdiff_t row_stride = 0;
  std::ptrdiff_t column_stride = 0;

  using Scalar = std::remove_const_t<T>;
  using Strides = Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>;
  using Element = std::conditional_t<std::is_const_v<T>, const Matrix4<Scalar>, Matrix4<Scalar>>;
  using ElementMap = Eigen::Map<Element, Eigen::Unaligned, Strides>;

  /// Returns the matrix of one joint in one frame, as an Eigen expression that reads and writes in place.
  ElementMap at(std::ptrdiff_t frame, std::ptrdiff_t joint) const {
    return ElementMap(data + frame * frame_stride + joint * joint_stride, Strides(column_stride, row_stride));
  }

  /// Whether each matrix is 16 consecutive numbers, column after column.
  bool is_packed() const { return row_stride == 1 && column_stride == 4; }

  /// Makes a stack of contiguous column-major matrices, frame after frame.
  static MatrixStack of(Element* first, std::ptrdiff_t frames, std::ptrdiff_t joints) {
    return {first->data(), frames, joints, 16 * joints, 16, 1, 4};
  }

  operator MatrixStack<const T>() const requires(!std::is_const_v<T>) {
    return {data, frames, joints, frame_stride, joint_stride, row_stride, column_stride};
  }
};

}  // namespace sinew
