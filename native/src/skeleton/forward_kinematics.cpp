#include "sinew/forward_kinematics.h"

#include "base/check.h"
#include "base/parallel.h"
#include "sinew/threads.h"

namespace sinew {
namespace {

// A range of work should outweigh the few microseconds that handing it to another thread takes.
constexpr std::ptrdiff_t kJointsPerTask = 1024;

// The approximate cost of a joint on one thread.
constexpr double kMicroseconds = 0.011;

// With this many frames per thread, frames alone keep all threads busy.
constexpr std::ptrdiff_t kFramesAThread = 4;

std::ptrdiff_t grain_of(std::ptrdiff_t joints_an_item) {
  return std::max<std::ptrdiff_t>(1, kJointsPerTask / std::max<std::ptrdiff_t>(1, joints_an_item));
}

template <class T>
void check_shapes(const Skeleton& skeleton, MatrixStack<const T> in, std::ptrdiff_t out_frames,
                  std::ptrdiff_t out_joints) {
  if (in.joints != skeleton.joint_count()) {
    fail("there are ", plural(in.joints, "matrix"), " per frame; the skeleton has ",
         plural(skeleton.joint_count(), "joint"));
  }
  if (out_frames != in.frames || out_joints != in.joints) {
    fail("the result holds ", out_frames, " x ", out_joints, " matrices; expected ", in.frames, " x ", in.joints);
  }
}

/// Returns one matrix of a stack. `Packed`: its numbers are column after column without gaps, which the
/// compiler can exploit.
template <bool Packed, class T>
auto element(MatrixStack<T> stack, std::ptrdiff_t frame, std::ptrdiff_t joint) {
  if constexpr (Packed) {
    using Map = Eigen::Map<typename MatrixStack<T>::Element>;
    return Map(stack.data + frame * stack.frame_stride + joint * stack.joint_stride);
  } else {
    return stack.at(frame, joint);
  }
}

/// Poses these joints of one frame; parents that are not among them must already be posed.
template <bool Packed, class T>
void pose_joints(const Skeleton& skeleton, MatrixStack<const T> local, MatrixStack<T> world, std::ptrdiff_t frame,
                 std::span<const std::int32_t> joints) {
  const auto parents = skeleton.parents();
  const auto rest = skeleton.rest<T>();
  for (const std::int32_t j : joints) {
    Matrix4<T> posed = rest[j] * Matrix4<T>(element<Packed>(local, frame, j));
    if (parents[j] >= 0) posed = Matrix4<T>(element<Packed>(world, frame, parents[j])) * posed;
    element<Packed>(world, frame, j) = posed;
  }
}

template <class T>
void pose_joints(const Skeleton& skeleton, MatrixStack<const T> local, MatrixStack<T> world, std::ptrdiff_t frame,
                 std::span<const std::int32_t> joints) {
  const bool packed = local.is_packed() && world.is_packed();
  (packed ? pose_joints<true, T> : pose_joints<false, T>)(skeleton, local, world, frame, joints);
}

}  // namespace

template <class T>
void forward_kinematics(const Skeleton& skeleton, MatrixStack<const T> local, MatrixStack<T> world) {
  check_shapes(skeleton, local, world.frames, world.joints);
  const std::ptrdiff_t joints = skeleton.joint_count();
  if (joints == 0) return;
  const auto pose_frames = [&](std::span<const std::int32_t> which, std::ptrdiff_t grain) {
    parallel_for(local.frames, grain, [&, which](std::ptrdiff_t begin, std::ptrdiff_t end) {
      for (auto frame = begin; frame < end; ++frame) {
        pose_joints(skeleton, local, world, frame, which);
      }
    });
  };
  const auto order = skeleton.grouped_order();
  const auto begins = skeleton.group_begin();
  const std::ptrdiff_t groups = std::ssize(begins) - 1;
  const bool frames_suffice = local.frames >= kFramesAThread * thread_count();
  if (!threads_pay(kMicroseconds * static_cast<double>(local.frames * joints))) {
    pose_frames(skeleton.order(), local.frames);
  } else if (frames_suffice || groups == 1) {
    pose_frames(skeleton.order(), grain_of(joints));
  } else {
    // First the trunk of each frame; then all groups of all frames are independent.
    const auto trunk = order.first(begins.front());
    pose_frames(trunk, grain_of(std::ssize(trunk)));
    const std::ptrdiff_t grain = grain_of(joints / groups);
    parallel_for(local.frames * groups, grain, [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
      for (auto item = begin; item < end; ++item) {
        const auto group = item % groups;
        pose_joints(skeleton, local, world, item / groups,
                    order.subspan(begins[group], begins[group + 1] - begins[group]));
      }
    });
  }
}

template <class T>
void skinning_matrices(const Skeleton& skeleton, MatrixStack<const T> world, MatrixStack<float> matrices) {
  check_shapes(skeleton, world, matrices.frames, matrices.joints);
  const auto inverse_rest = skeleton.inverse_rest();
  const std::ptrdiff_t joints = skeleton.joint_count();
  const std::ptrdiff_t count = world.frames * joints;
  const bool parallel = threads_pay(kMicroseconds * static_cast<double>(count));
  parallel_for(count, parallel ? kJointsPerTask : count, [&](auto begin, auto end) {
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
