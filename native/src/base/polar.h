/// The rotation of a matrix, as in its polar decomposition.
#pragma once

#include "sinew/types.h"

namespace sinew {

/// Returns the rotation nearest to a matrix, by singular values; if it mirrors or is flat, one of the nearest.
Eigen::Matrix3d nearest_rotation_to_any(const Eigen::Matrix3d& linear);

/// Likewise, by Newton's iteration if the matrix does neither: a few steps instead of a decomposition. Higham,
/// "Computing the polar decomposition with applications", SIAM J. Sci. Stat. Comput. 7(4), 1986, section 3.
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& linear);

}  // namespace sinew
