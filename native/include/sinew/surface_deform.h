/// Blender's Surface Deform modifier.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sinew/types.h"
#include "sinew/vertex_group.h"

namespace sinew {

/// How a vertex is attached to a face of the target.
enum class Attachment : std::int32_t {
  corner_triangle = 0,  ///< to the first three of the corners, which have a weight each
  polygon = 1,          ///< to all corners, which have a weight each
  centroid = 2,         ///< to the first two of the corners and the mean of all: three weights
};

/// Attaches vertices to the faces of a target:
///   x_v += strength weight_v (sum_b influence_b (place_b + distance_b normal_b) - x_v),
/// where place_b is a weighted sum of the face's corners, in float32 as Blender does, up to the order of the sums.
/// Immutable; several threads may use one object at once.
class SurfaceDeform {
 public:
  /// A target in one frame.
  struct Shape {
    std::vector<float> points;   // T x 4, in the space of the mesh
    std::vector<float> normals;  // one x 4 for each of the faces, as SurfaceDeform numbers them
  };

  struct Settings {
    std::shared_ptr<const Shape> shape;  ///< as `shape_of` returns
    float strength = 1;                  ///< any finite number
  };

  /// What a mesh was bound with.
  struct Binding {
    std::span<const std::int32_t> vertices;        ///< B: the bound ones
    std::span<const std::int32_t> offsets;         ///< B + 1: where the attachments of each begin
    std::span<const std::int32_t> attachments;     ///< N
    std::span<const std::int32_t> corner_offsets;  ///< N + 1: where the corners of each attachment begin
    std::span<const std::int32_t> corners;         ///< vertices of the target
    std::span<const float> weights;  ///< of the attachments in turn: one for each corner of a polygon, otherwise three
    std::span<const float> distances, influences;  ///< N
  };

  /// vertex_count  V.
  /// group         V weights. Vertices of weight 0 do not move, and cost nothing.
  /// Throws InputError for sizes that do not fit, for what is out of range and for numbers that are not finite.
  SurfaceDeform(std::ptrdiff_t vertex_count, const Binding& binding, const VertexGroup& group = {});

  /// V.
  std::ptrdiff_t vertex_count() const { return vertex_count_; }
  /// How many vertices a target must have at least.
  std::ptrdiff_t least_target_count() const { return least_target_count_; }

  /// Returns what Settings need of a target. target: T x 3, in its own space; mesh_from_target: as when it was bound.
  /// Throws InputError if the target has too few vertices.
  std::shared_ptr<const Shape> shape_of(std::span<const float> target, const Matrix4<float>& mesh_from_target) const;

  /// Throws what apply() would throw for invalid settings, and does nothing else.
  void check(const Settings& settings) const;

  /// The approximate time of apply() on one thread.
  double microseconds(const Settings& settings) const;

  /// positions  in and out, V x 3. Allocates nothing. The result has the same bits for any number of threads.
  /// Throws InputError if the shape does not fit, for a strength that is not finite and without a shape.
  void apply(const Settings& settings, std::span<float> positions) const;

 private:
  struct Term {
    std::uint32_t index;
    float weight;
  };

  std::ptrdiff_t vertex_count_, least_target_count_ = 0;
  std::vector<std::uint32_t> vertices_;
  std::vector<float> weights_;         // of vertices_, in the group
  std::vector<std::size_t> first_;     // of vertices_, and the end: where their terms begin
  std::vector<std::uint32_t> points_;  // of vertices_: how many of the terms are points of the target; then normals
  std::vector<Term> terms_;
  std::vector<std::size_t> first_corner_;  // of each face, and the end
  std::vector<std::uint32_t> corners_;
};

}  // namespace sinew
