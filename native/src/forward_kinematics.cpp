#include "sinew/forward_kinematics.h"

#include "check.h"
#include "parallel.h"

namespace sinew {
namespace {

// One joint costs some 20 ns; a range should outweigh the few microseconds that it costs to hand it
// to another thread.
constexpr std::ptrdiff_t kJointsPerTask = 1024;

template <class T>
void check_shapes(const Skeleton& skeleton, MatrixStack<const T> in, std::ptrdiff_t out_frames,
                  std::ptrdiff_t out_joints) {
  if (in.joints != skeleton.joint_count()) {
    fail("there are ", plural(in.joints, "matrix"), " a frame; the skeleton has ",
         plural(skeleton.joint_count(), "joint"));
  }
  if (out_frames != in.frames || out_joints != in.joints) {
    fail("the result holds ", out_frames, " x ", out_joints, " matrices; expected ", in.frames,
         " x ", in.joints);
  }
}

/// Joints order[begin..end), whose parents are all done.
template <class T>
void pose_joints(const Skeleton& skeleton, MatrixStack<const T> local, MatrixStack<T> world,
                 std::ptrdiff_t frame, std::ptrdiff_t begin, std::ptrdiff_t end) {
  const auto order = skeleton.order();
  const auto parents = skeleton.parents();
  const auto rest = skeleton.rest<T>();
  for (std::ptrdiff_t i = begin; i < end; ++i) {
    const std::int32_t j = order[i];
    const Matrix4<T> own = rest[j] * Matrix4<T>(local.at(frame, j));
    if (parents[j] < 0) {
      world.at(frame, j) = own;
    } else {
      world.at(frame, j).noalias() = Matrix4<T>(world.at(frame, parents[j])) * own;
    }
  }
}

}  // namespace

template <class T>
void forward_kinematics(const Skeleton& skeleton, MatrixStack<const T> local,
                        MatrixStack<T> world) {
  check_shapes(skeleton, local, world.frames, world.joints);
  const std::ptrdiff_t joints = skeleton.joint_count();
  if (joints == 0) return;
  if (local.frames == 1) {
    const auto level = skeleton.level_begin();
    for (std::size_t l = 0; l + 1 < level.size(); ++l) {
      parallel_for(level[l + 1] - level[l], kJointsPerTask, [&](auto begin, auto end) {
        pose_joints(skeleton, local, world, 0, level[l] + begin, level[l] + end);
      });
    }
    return;
  }
  const std::ptrdiff_t frames_per_task = std::max<std::ptrdiff_t>(1, kJointsPerTask / joints);
  parallel_for(local.frames, frames_per_task, [&](auto begin, auto end) {
    for (auto frame = begin; frame < end; ++frame) {
      pose_joints(skeleton, local, world, frame, 0, joints);
    }
  });
}

template <class T>
void skinning_matrices(const Skeleton& skeleton, MatrixStack<const T> world,
                       MatrixStack<float> matrices) {
  check_shapes(skeleton, world, matrices.frames, matrices.joints);
  const auto inverse_rest = skeleton.inverse_rest();
  const std::ptrdiff_t joints = skeleton.joint_count();
  parallel_for(world.frames * joints, kJointsPerTask, [&](auto begin, auto end) {
    for (auto i = begin; i < end; ++i) {
      const auto frame = i / joints, j = i % joints;
      const Matrix4<double> posed = world.at(frame, j).template cast<double>();
      matrices.at(frame, j) = (posed * inverse_rest[j]).template cast<float>();
    }
  });
}

template void forward_kinematics(const Skeleton&, MatrixStack<const float>, MatrixStack<float>);
template void forward_kinematics(const Skeleton&, MatrixStack<const double>, MatrixStack<double>);
template void skinning_matrices(const Skeleton&, MatrixStack<const float>, MatrixStack<float>);
template void skinning_matrices(const Skeleton&, MatrixStack<const double>, MatrixStack<float>);

}  // namespace sinew
