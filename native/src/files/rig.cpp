#include "sinew/rig.h"

#include <algorithm>
#include <cmath>

#include "base/text.h"
#include "files/write_files.h"
#include "mesh/faces.h"
#include "sinew/dmat.h"

namespace sinew {
namespace {

std::string name_of(const Path& path, const char* usual) { return path.empty() ? usual : shown(path.filename()); }

void check_mesh(const PolygonMesh& mesh, const Path& path) {
  const std::string name = name_of(path, "mesh.obj");
  if (mesh.face_offsets.empty()) fail(name, ": face_offsets is empty; expected one number more than there are faces");
  naming(name, [&] { check_faces({mesh.face_offsets, mesh.face_vertices}, mesh.vertex_count()); });
  const auto& materials = mesh.face_materials;
  if (!materials.empty() && static_cast<std::ptrdiff_t>(materials.size()) != mesh.face_count()) {
    fail(name, " has ", plural(mesh.face_count(), "face"), " and ", plural(materials.size(), "face material"));
  }
  for (const std::int32_t material : materials) {
    if (material < -1 || material >= static_cast<std::int32_t>(mesh.material_names.size())) {
      fail(name, ": a face has material ", material, "; there are ", plural(mesh.material_names.size(), "material"));
    }
  }
}

void check_numbers(const Rig& rig, const RigPaths& paths) {
  const auto is_finite = [](float number) { return std::isfinite(number); };
  if (!std::ranges::all_of(rig.mesh.positions, is_finite)) {
    fail(name_of(paths.mesh, "mesh.obj"), ": a position is not finite");
  }
  if (!rig.weights.allFinite()) {
    fail(name_of(paths.weights, "weights.dmat"), ": a weight is not finite");
  }
}

void check_weights(const Rig& rig, const RigPaths& paths) {
  const std::string weights = name_of(paths.weights, "weights.dmat");
  const std::string skeleton = name_of(paths.skeleton, "the skeleton");
  if (rig.weights.cols() == 0) fail(weights, " has no columns; expected one per bone");
  if (rig.weights.rows() != rig.mesh.vertex_count()) {
    fail(weights, " has ", plural(rig.weights.rows(), "row"), ", ", name_of(paths.mesh, "mesh.obj"), " has ",
         plural(rig.mesh.vertex_count(), "vertex"));
  }
  std::vector<bool> owned(rig.weights.cols(), false);
  for (std::ptrdiff_t j = 0; j < rig.skeleton.joint_count(); ++j) {
    const auto column = rig.skeleton.weight_columns()[j];
    if (column >= rig.weights.cols()) {
      fail(skeleton, ": joint ", j, " has weight column ", column, ", ", weights, " has ",
           plural(rig.weights.cols(), "column"));
    }
    if (column >= 0) owned[column] = true;
  }
  const auto orphan = std::find(owned.begin(), owned.end(), false);
  if (orphan != owned.end()) {
    fail(weights, " has ", plural(rig.weights.cols(), "column"), ", but no joint of ", skeleton, " has weight column ",
         orphan - owned.begin());
  }
}

/// Clamps weights to 0 to 1; see read_rig. Returns how many were outside.
std::ptrdiff_t clamp_weights(Eigen::MatrixXd& weights) {
  constexpr double kRounding = 1e-7;  // about that of float32
  std::ptrdiff_t count = 0;
  for (Eigen::Index v = 0; v < weights.rows(); ++v) {
    auto row = weights.row(v);
    const std::ptrdiff_t outside = (row.array() < -kRounding || row.array() > 1 + kRounding).count();
    row = row.cwiseMax(0).cwiseMin(1).eval();
    if (outside > 0 && row.sum() > 0) row /= row.sum();
    count += outside;
  }
  return count;
}

std::ptrdiff_t bone_count(const RigSkeleton& skeleton) {
  return std::ranges::count_if(skeleton.weight_columns(), [](auto column) { return column >= 0; });
}

/// A joint without weights also gets a matrix, which is not in the file: a small file could require any amount of
/// memory.
void check_animation_size(const Path& path, std::ptrdiff_t frames, std::ptrdiff_t bones, std::ptrdiff_t joints) {
  constexpr std::ptrdiff_t kMostJointsPerBone = 16, kAlwaysFits = 1 << 20;
  if (joints <= kMostJointsPerBone * bones || frames <= kAlwaysFits / joints) return;
  fail(shown(path.filename()), " has ", plural(frames, "frame"), " of ", plural(bones, "bone"), ", the skeleton has ",
       plural(joints, "joint"), ": too many matrices for joints without weights; remove such joints from the skeleton");
}

/// `skeleton` has passed check_rig: its weight columns are 0 to bones - 1, each once.
/// A frame is a column-major (4 * bones) x 3 matrix that stacks the transposed 3x4 matrices.
MatrixClip unpack_animation(const Path& path, const Eigen::MatrixXd& table, const RigSkeleton& skeleton) {
  const auto& columns = skeleton.weight_columns();
  const std::ptrdiff_t bones = bone_count(skeleton);
  if (table.rows() != 12 * bones) {
    fail(shown(path.filename()), " has ", plural(table.rows(), "row"), "; expected ", 12 * bones, ", 12 for each of ",
         plural(bones, "bone"));
  }
  const std::ptrdiff_t joints = skeleton.joint_count();
  check_animation_size(path, table.cols(), bones, joints);
  MatrixClip clip{table.cols(), {}};
  clip.matrices.assign(table.cols() * joints, Matrix4<double>::Identity());
  for (Eigen::Index frame = 0; frame < table.cols(); ++frame) {
    const Eigen::Map<const Eigen::MatrixXd> stacked(table.col(frame).data(), 4 * bones, 3);
    for (const std::int32_t j : skeleton.order()) {
      Matrix4<double>& matrix = clip.matrices[frame * joints + j];
      if (columns[j] >= 0) {
        matrix.topRows<3>() = stacked.middleRows<4>(4 * columns[j]).transpose();
      } else if (skeleton.parents()[j] >= 0) {
        matrix = clip.matrices[frame * joints + skeleton.parents()[j]];
      }
    }
  }
  return clip;
}

Eigen::MatrixXd pack_animation(const MatrixClip& clip, const RigSkeleton& skeleton) {
  const auto& columns = skeleton.weight_columns();
  const std::ptrdiff_t bones = bone_count(skeleton);
  const std::ptrdiff_t joints = skeleton.joint_count();
  Eigen::MatrixXd table(12 * bones, clip.frames);
  for (Eigen::Index frame = 0; frame < clip.frames; ++frame) {
    Eigen::Map<Eigen::MatrixXd> stacked(table.col(frame).data(), 4 * bones, 3);
    for (std::ptrdiff_t j = 0; j < joints; ++j) {
      if (columns[j] < 0) continue;
      const Matrix4<double>& matrix = clip.matrices[frame * joints + j];
      stacked.middleRows<4>(4 * columns[j]) = matrix.topRows<3>().transpose();
    }
  }
  return table;
}

}  // namespace

RigPaths find_rig(const Path& folder) {
  std::error_code error;
  if (!std::filesystem::is_directory(folder, error)) fail("there is no folder ", shown(folder));
  const auto if_there = [&](const char* name) {
    const Path path = folder / name;
    return std::filesystem::exists(path, error) ? path : Path();
  };
  RigPaths paths{folder / "mesh.obj", if_there("skeleton.bf"), folder / "weights.dmat", if_there("pose.dmat"),
                 if_there("anim.dmat")};
  if (paths.skeleton.empty()) paths.skeleton = if_there("skeleton.tgf");
  return paths;
}

void check_rig(const Rig& rig, const RigPaths& paths) {
  const std::ptrdiff_t joints = rig.skeleton.joint_count();
  check_mesh(rig.mesh, paths.mesh);
  check_weights(rig, paths);
  check_numbers(rig, paths);
  if (rig.poses && rig.poses->joint_count() != joints) {
    fail(name_of(paths.poses, "pose.dmat"), " has poses of ", plural(rig.poses->joint_count(), "joint"),
         "; the skeleton has ", joints);
  }
  if (rig.animation) {
    const auto matrices = static_cast<std::ptrdiff_t>(rig.animation->matrices.size());
    if (matrices != rig.animation->frames * joints) {
      fail(name_of(paths.animation, "anim.dmat"), " has ", plural(matrices, "matrix"), " for ",
           plural(rig.animation->frames, "frame"), " of ", plural(joints, "joint"));
    }
    const auto is_finite = [](const Matrix4<double>& matrix) { return matrix.allFinite(); };
    if (!std::ranges::all_of(rig.animation->matrices, is_finite)) {
      fail(name_of(paths.animation, "anim.dmat"), ": a matrix is not finite");
    }
  }
}

Rig read_rig(const RigPaths& paths, std::optional<Convention> convention, QuaternionOrder order,
             const WeightsMaker& make_weights) {
  if (paths.skeleton.empty()) {
    fail("there is neither skeleton.bf nor skeleton.tgf in ", shown(paths.mesh.parent_path()));
  }
  Rig rig{read_obj(paths.mesh), read_skeleton(paths.skeleton, convention), {}, std::nullopt, std::nullopt};
  rig.weights = make_weights ? make_weights(rig.mesh, rig.skeleton) : read_dmat(paths.weights);
  if (!paths.poses.empty()) {
    const Eigen::MatrixXd table = read_dmat(paths.poses);
    rig.poses = naming(paths.poses, [&] { return PoseClip::from_table(table, rig.skeleton.joint_count(), order); });
  }
  check_rig(rig, paths);
  rig.clamped_weights = clamp_weights(rig.weights);
  if (!paths.animation.empty()) {
    rig.animation = unpack_animation(paths.animation, read_dmat(paths.animation), rig.skeleton);
  }
  return rig;
}

void write_rig(const RigPaths& paths, const Rig& rig) {
  check_rig(rig, paths);
  FilesToWrite files;
  files.add(paths.skeleton, skeleton_text(paths.skeleton, rig.skeleton));
  files.add(paths.mesh, obj_text(rig.mesh));
  files.add(paths.weights, dmat_bytes(paths.weights, rig.weights, /*binary=*/false));
  if (rig.poses && !paths.poses.empty()) {
    files.add(paths.poses, dmat_bytes(paths.poses, rig.poses->to_table(), /*binary=*/false));
  }
  if (rig.animation && !paths.animation.empty()) {
    const Eigen::MatrixXd table = pack_animation(*rig.animation, rig.skeleton);
    files.add(paths.animation, dmat_bytes(paths.animation, table, /*binary=*/true));
  }
  files.replace();
}

}  // namespace sinew
