/// Which side of a surface is outside.
#pragma once

#include <vector>

#include "sinew/progress.h"
#include "weights/bone_distances.h"
#include "weights/triangle_tree.h"

namespace sinew {

/// Orients patches with borders by the winding numbers beside them. Returns for each patch whether both sides are
/// outside, as those of a sheet. Changes triangles, for which a new tree is needed if it sets has_changed.
std::vector<std::uint8_t> turn_outward(WeldedMesh& mesh, const TriangleTree& tree, const Progress* progress,
                                       bool& has_changed);

/// Returns the points with their normals, means of the triangles' by area.
std::vector<Place> places_of(const WeldedMesh& mesh, const std::vector<std::uint8_t>& is_two_sided);

}  // namespace sinew
