/// Fills in weights where a surface has none.
#pragma once

#include <Eigen/Core>

#include "sinew/faces.h"
#include "sinew/progress.h"
#include "sinew/weight_table.h"
#include "weights/welded_mesh.h"

namespace sinew {

/// Gives the points without weights the smoothest ones that agree with those of the others on their part of the mesh:
/// L M^-1 L w = 0, or L w = 0 where that would take too long. Sums become 1. Parts without any weights stay so.
/// rows  of the points of the mesh, each empty or with sum 1. faces  of its vertices. The progress is advanced by `steps`
/// at most.
void inpaint_weights(const WeldedMesh& mesh, const Faces& faces, WeightTable& rows, Progress* progress,
                     std::int64_t steps);

/// Changes numbers, at least one, into those nearest to them that are not negative and sum to 1.
void project_on_simplex(Eigen::Ref<Eigen::VectorXd> numbers);

}  // namespace sinew
