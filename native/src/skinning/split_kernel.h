/// Splits joints' motions along their rest frames, several at a time, compiled for several instruction sets like the
/// kernels of kernels.h. All give the same bits.
#pragma once

#include <cstddef>

namespace sinew {

/// How far the dot products of a rotation's columns may be from those of orthonormal ones. Matrices that went through
/// float32 are orthonormal to about 1e-6. Blender has the same bound.
constexpr float kRigidTolerance = 1e-5f;

/// How many joints are split at a time.
constexpr std::size_t kSplitTogether = 8;

/// One number of each joint.
template <class T>
struct alignas(64) OfEach {
  T joint[kSplitTogether];
};

/// The upper rows of the joints' matrices, of their rest frames, which turn and move, and of the inverses of these:
/// [row][column].
struct MotionsToSplit {
  OfEach<float> matrix[3][4];
  OfEach<double> rest[3][4];
  OfEach<float> from_rest[3][4];  ///< Eigen's inverse in float32: Blender uses the same
};

/// matrix = rigid motion * stretch, the stretch along the axes of the rest frame: what is left of (matrix * rest) when
/// its axes are made orthonormal.
struct SplitMotions {
  OfEach<float> real[4];  ///< of the rigid motion's dual quaternion, w x y z
  OfEach<float> dual[4];
  OfEach<float> displacement[3][4];  ///< by the stretch: its upper rows less the identity's
  OfEach<float> is_rigid;            ///< 1: nothing is stretched, and the displacement is 0
};

void split_motions(const MotionsToSplit& motions, SplitMotions& split);

}  // namespace sinew
