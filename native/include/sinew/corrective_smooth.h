/// Blender's Corrective Smooth modifier.
#pragma once

#include <memory>
#include <span>

#include "sinew/topology.h"
#include "sinew/vertex_group.h"

namespace sinew {

enum class SmoothType {
  simple,           ///< towards the mean of the neighbours
  length_weighted,  ///< neighbours count by their distance
};

/// How Blender has weighted the corners of a vertex: by the angle between the sides of the face,
/// from its cosine.
enum class CornerAngle {
  polynomial,  ///< near to 5e-5, never NaN: Blender 4.1 and later
  arc_cosine,  ///< exact; a cosine that was rounded to more than 1 gives NaN, and with it a vertex
               ///< that is not corrected: Blender before 4.1
};

/// Smooths the shape, then adds what smoothing takes from the rest shape, turned with the faces:
///   x_v += scale sum over the corners c of v of (T_c d_c) angle_c / (sum of the angles),
/// T_c the frame of a corner in the smoothed shape, d_c what the rest shape had lost, in that same
/// frame of the smoothed rest shape. All in float32 in Blender's order, so to the bit, but for the
/// arc cosine. Immutable but for set_rest_positions; several threads may use one at once.
class CorrectiveSmooth {
 public:
  struct Settings {
    float factor = 0.5f;  ///< any finite number, also outside of 0 to 1
    int iterations = 5;   ///< 0 or fewer: nothing happens
    float scale = 1;      ///< of what is added
    SmoothType type = SmoothType::simple;
    bool only_smooth = false;  ///< adds nothing
  };

  /// topology        V vertices.
  /// rest_positions  V x 3; empty: for only_smooth.
  /// group           V weights, which the factor is multiplied by. Vertices of weight 0 stay, and
  ///                 cost nothing.
  /// pin_boundary    vertices on the edge of the surface have weight 0.
  /// All but the topology is copied. Throws InputError for sizes that do not fit and for a number
  /// that is not finite.
  CorrectiveSmooth(std::shared_ptr<const Topology> topology, std::span<const float> rest_positions,
                   const VertexGroup& group = {}, bool pin_boundary = false,
                   CornerAngle angle = CornerAngle::polynomial);
  CorrectiveSmooth(CorrectiveSmooth&&) noexcept;
  ~CorrectiveSmooth();

  /// V.
  std::ptrdiff_t vertex_count() const;

  /// Another rest shape, V x 3. Not while another thread uses the object. Throws as above.
  void set_rest_positions(std::span<const float> positions);

  /// What apply() throws for settings that are wrong, without doing anything.
  void check(const Settings& settings) const;

  /// positions  in and out, V x 3. What the rest shape loses is kept from call to call, for as long
  ///            as factor, iterations and type stay; apart from that, only the first call, and the
  ///            first that runs beside others, allocate anything. The same bits for any number of
  ///            threads.
  /// Throws InputError if the shape does not fit, without rest positions unless only_smooth, and
  /// for a factor or scale that is not finite.
  void apply(const Settings& settings, std::span<float> positions) const;

 private:
  class Body;
  std::unique_ptr<Body> body_;
};

}  // namespace sinew
