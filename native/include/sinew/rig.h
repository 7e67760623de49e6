/// A rig folder: mesh, skeleton, weights and poses that belong together.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "sinew/obj.h"
#include "sinew/pose_clip.h"
#include "sinew/rig_skeleton.h"

namespace sinew {

/// Ready-made skinning matrices, frame by frame, which need no forward kinematics.
struct MatrixClip {
  std::ptrdiff_t frames = 0;
  std::vector<Matrix4<double>> matrices;  ///< F x J
};

/// The contents of a rig folder. `weights` is V x columns; column c belongs to the joint whose
/// weight_columns() entry is c. `clamped_weights`: see read_rig.
struct Rig {
  PolygonMesh mesh;
  RigSkeleton skeleton;
  Eigen::MatrixXd weights;
  std::optional<PoseClip> poses;
  std::optional<MatrixClip> animation;
  std::ptrdiff_t clamped_weights = 0;
};

/// The files of the parts; an empty path means that the part is missing.
struct RigPaths {
  std::filesystem::path mesh;
  std::filesystem::path skeleton;
  std::filesystem::path weights;
  std::filesystem::path poses;
  std::filesystem::path animation;
};

/// Finds the parts of a folder by their usual names: mesh.obj, skeleton.bf or skeleton.tgf,
/// weights.dmat and, if they exist, pose.dmat and anim.dmat. Throws InputError if there is no such
/// folder.
RigPaths find_rig(const std::filesystem::path& folder);

/// Checks that the parts fit each other: faces name vertices that exist, there is a row of weights
/// for each vertex and a column for each joint that has a weight column, and no other, and poses and
/// animation have the same number of joints. Throws InputError with the files' names, or their usual
/// names where `paths` is empty.
void check_rig(const Rig& rig, const RigPaths& paths = {});

/// Makes weights for a rig that has none: V x columns, one column for each joint that has a weight column.
using WeightsMaker = std::function<Eigen::MatrixXd(const PolygonMesh&, const RigSkeleton&)>;

/// Reads and checks all parts. With `make_weights`, weights are made by it instead of read. Weights are returned as the vertex groups of modelling programs can
/// hold them: those below 0 or above 1 become 0 or 1, and the weights of such a vertex are divided by
/// their sum. `clamped_weights` counts them, except those that were off by no more than a rounding of
/// float32. Throws InputError.
Rig read_rig(const RigPaths& paths, std::optional<Convention> convention = std::nullopt,
             QuaternionOrder order = QuaternionOrder::wxyz, const WeightsMaker& make_weights = {});

/// Writes mesh, skeleton and weights, and poses and animation if the rig has them and they have a
/// path. Poses are written as quaternions, w x y z. The files replace existing ones together, once all
/// are written: a failure leaves the existing files as they were. Throws InputError.
void write_rig(const RigPaths& paths, const Rig& rig);

}  // namespace sinew
