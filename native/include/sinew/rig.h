/// A rig folder: mesh, skeleton, weights and poses that belong together.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "sinew/obj.h"
#include "sinew/pose_clip.h"
#include "sinew/rig_skeleton.h"

namespace sinew {

/// Skinning matrices given outright, frame by frame: no forward kinematics is left to do.
struct MatrixClip {
  std::ptrdiff_t frames = 0;
  std::vector<Matrix4<double>> matrices;  ///< F x J
};

/// What a rig folder says. `weights` is V x columns; column c belongs to the joint whose
/// weight_columns() entry is c. `clamped_weights`: see read_rig.
struct Rig {
  PolygonMesh mesh;
  RigSkeleton skeleton;
  Eigen::MatrixXd weights;
  std::optional<PoseClip> poses;
  std::optional<MatrixClip> animation;
  std::ptrdiff_t clamped_weights = 0;
};

/// Where the parts lie; an empty path is a part that is not there.
struct RigPaths {
  std::filesystem::path mesh;
  std::filesystem::path skeleton;
  std::filesystem::path weights;
  std::filesystem::path poses;
  std::filesystem::path animation;
};

/// The parts of a folder by their usual names: mesh.obj, skeleton.bf or skeleton.tgf, weights.dmat,
/// and, if they exist, pose.dmat and anim.dmat. Throws InputError if there is no such folder.
RigPaths find_rig(const std::filesystem::path& folder);

/// Checks that the parts fit each other: faces that name vertices, a row of weights for each
/// vertex, a column for each joint that asks for one and none besides, poses and animation for as
/// many joints. Throws InputError with the files' names, or their usual names where `paths` is
/// empty.
void check_rig(const Rig& rig, const RigPaths& paths = {});

/// Reads and checks all parts. Weights come out as the vertex groups of modelling programs hold
/// them: those below 0 or above 1 become 0 or 1, and the weights of such a vertex are divided by
/// their sum. `clamped_weights` counts them, less those that were off by a rounding of float32
/// only. Throws InputError.
Rig read_rig(const RigPaths& paths, std::optional<Convention> convention = std::nullopt,
             QuaternionOrder order = QuaternionOrder::wxyz);

/// Writes mesh, skeleton and weights, and those of poses and animation that the rig has and that
/// have a path. Poses are written as quaternions, w x y z. All files go to their places together,
/// when they are written: a failure leaves those that were there. Throws InputError.
void write_rig(const RigPaths& paths, const Rig& rig);

}  // namespace sinew
