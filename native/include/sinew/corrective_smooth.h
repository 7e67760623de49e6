/// Blender's Corrective Smooth modifier.
#pragma once

#include <memory>
#include <span>

#include "sinew/topology.h"
#include "sinew/vertex_group.h"

namespace sinew {

enum class SmoothType {
  simple,           ///< towards the mean of the neighbours
  length_weighted,  ///< neighbours are weighted by their distance
};

/// How Blender computes the weight of a vertex's corner, which is the angle between the sides of the
/// face, from the angle's cosine.
enum class CornerAngle {
  polynomial,  ///< accurate to 5e-5, never NaN: Blender 4.1 and later
  arc_cosine,  ///< exact, but a cosine that was rounded to more than 1 gives NaN, and then the vertex
               ///< is not corrected: Blender before 4.1
};

/// Smooths the shape, then adds what smoothing removes from the rest shape, turned with the faces:
///   x_v += scale sum over the corners c of v of (T_c d_c) angle_c / (sum of the angles),
/// where T_c is the frame of a corner in the smoothed shape and d_c what the rest shape lost, in the
/// same frame of the smoothed rest shape. All of it is float32 in Blender's order, so the result
/// equals Blender's to the bit, except with the arc cosine. Immutable except for set_rest_positions;
/// several threads may use one object at once.
class CorrectiveSmooth {
 public:
  struct Settings {
    float factor = 0.5f;  ///< any finite number, even outside of 0 to 1
    int iterations = 5;   ///< if 0 or less, nothing happens
    float scale = 1;      ///< multiplies what is added
    SmoothType type = SmoothType::simple;
    bool only_smooth = false;  ///< nothing is added
  };

  /// topology        V vertices.
  /// rest_positions  V x 3; empty if every call uses only_smooth.
  /// group           V weights, by which the factor is multiplied. Vertices of weight 0 do not move,
  ///                 and cost nothing.
  /// pin_boundary    vertices on the boundary of the surface get weight 0.
  /// Everything except the topology is copied. Throws InputError for sizes that do not fit and for a
  /// number that is not finite.
  CorrectiveSmooth(std::shared_ptr<const Topology> topology, std::span<const float> rest_positions,
                   const VertexGroup& group = {}, bool pin_boundary = false,
                   CornerAngle angle = CornerAngle::polynomial);
  CorrectiveSmooth(CorrectiveSmooth&&) noexcept;
  ~CorrectiveSmooth();

  /// V.
  std::ptrdiff_t vertex_count() const;

  /// Sets another rest shape, V x 3. Must not be called while another thread uses the object. Throws
  /// as above.
  void set_rest_positions(std::span<const float> positions);

  /// Throws what apply() would throw for invalid settings, and does nothing else.
  void check(const Settings& settings) const;

  /// The approximate time of apply() on one thread.
  double microseconds(const Settings& settings) const;

  /// positions  in and out, V x 3. What the rest shape loses is kept from call to call while factor,
  ///            iterations and type stay the same; apart from that, only the first call, and the
  ///            first that runs concurrently with others, allocate anything. The result has the same
  ///            bits for any number of threads.
  /// Throws InputError if the shape does not fit, if there are no rest positions (unless only_smooth),
  /// and for a factor or scale that is not finite.
  void apply(const Settings& settings, std::span<float> positions) const;

 private:
  class Body;
  std::unique_ptr<Body> body_;
};

}  // namespace sinew
