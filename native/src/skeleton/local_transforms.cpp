#include "sinew/local_transforms.h"

#include <Eigen/LU>

#include "base/check.h"
#include "base/parallel.h"
#include "base/polar.h"

namespace sinew {
namespace {

// A joint with a smaller scale has no inverse that could be relied on.
constexpr double kSmallestScale = 1e-6;

constexpr std::size_t kFramesPerTask = 4;

/// Splits a matrix into the nearest rotation and the scale along its columns that is nearest then.
void split(const Eigen::Matrix3d& linear, Eigen::Matrix3d& turn, Eigen::Vector3d& scale) {
  const double sign = linear.determinant() < 0 ? -1 : 1;
  turn = nearest_rotation(sign * linear);
  scale = turn.cwiseProduct(linear).colwise().sum();
}

/// Turns quaternions to the side on which the ones of the frame before are.
void make_continuous(std::vector<double>& rotations, std::ptrdiff_t joints) {
  using Numbers = Eigen::Map<Eigen::Vector4d>;
  const std::ptrdiff_t count = std::ssize(rotations) / 4;
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    Numbers q(&rotations[4 * i]);
    if (i < joints ? q[0] < 0 : q.dot(Numbers(&rotations[4 * (i - joints)])) < 0) q *= -1;
  }
}

void refuse(const Skeleton& skeleton, const LocalTransforms& found) {
  const std::ptrdiff_t joints = skeleton.joint_count();
  std::vector<char> has_children(joints);
  for (const std::int32_t parent : skeleton.parents()) {
    if (parent >= 0) has_children[parent] = 1;
  }
  for (std::ptrdiff_t i = 0; i < std::ssize(found.played); ++i) {
    const Eigen::Map<const Eigen::Vector3d> scale(&found.scales[3 * i]);
    if (has_children[i % joints] && scale.cwiseAbs().minCoeff() < kSmallestScale) {
      fail("world: joint ", i % joints, " has a scale of 0 along an axis in frame ", i / joints,
           ", and other joints follow it");
    }
  }
}

}  // namespace

template <class T>
LocalTransforms local_transforms(const Skeleton& skeleton, MatrixStack<const T> world,
                                 std::span<const std::uint8_t> may_move) {
  const std::ptrdiff_t joints = skeleton.joint_count();
  if (world.joints != joints) {
    fail("there are ", plural(world.joints, "matrix"), " per frame; the skeleton has ", plural(joints, "joint"));
  }
  if (!may_move.empty() && std::ssize(may_move) != joints) {
    fail("may_move has ", may_move.size(), " values; the skeleton has ", plural(joints, "joint"));
  }
  const std::size_t count = world.frames * joints;
  LocalTransforms found{std::vector<double>(3 * count), std::vector<double>(4 * count), std::vector<double>(3 * count),
                        std::vector<Matrix4<double>>(count)};
  for (std::ptrdiff_t i = 0; i < std::ssize(found.played); ++i) {
    if (!world.at(i / joints, i % joints).allFinite()) {
      fail("world: joint ", i % joints, " is not at a finite place in frame ", i / joints);
    }
  }
  const auto rest = skeleton.rest<double>();
  parallel_for(world.frames, kFramesPerTask, [&](auto begin, auto end) {
    for (auto frame = begin; frame < end; ++frame) {
      const auto first = static_cast<std::ptrdiff_t>(frame) * joints;
      for (const std::int32_t j : skeleton.order()) {
        const std::int32_t parent = skeleton.parents()[j];
        const Matrix4<double> before = parent < 0 ? rest[j] : Matrix4<double>(found.played[first + parent] * rest[j]);
        const Matrix4<double> wanted = world.at(static_cast<std::ptrdiff_t>(frame), j).template cast<double>();
        const Eigen::Matrix3d inverse = before.topLeftCorner<3, 3>().inverse();
        Eigen::Map<Eigen::Vector3d> location(&found.locations[3 * (first + j)]), scale(&found.scales[3 * (first + j)]);
        if (may_move.empty() || may_move[j]) {
          location = inverse * (wanted.topRightCorner<3, 1>() - before.topRightCorner<3, 1>());
        }
        Eigen::Matrix3d turn;
        Eigen::Vector3d sizes;
        split(inverse * wanted.topLeftCorner<3, 3>(), turn, sizes);
        scale = sizes;
        const Eigen::Quaterniond rotation = Eigen::Quaterniond(turn).normalized();
        Eigen::Map<Eigen::Vector4d>(&found.rotations[4 * (first + j)]) << rotation.w(), rotation.x(), rotation.y(),
            rotation.z();
        Matrix4<double> local = Matrix4<double>::Identity();
        local.topLeftCorner<3, 3>() = turn * sizes.asDiagonal();
        local.topRightCorner<3, 1>() = location;
        found.played[first + j] = before * local;
      }
    }
  });
  refuse(skeleton, found);
  make_continuous(found.rotations, joints);
  return found;
}

template LocalTransforms local_transforms(const Skeleton&, MatrixStack<const float>, std::span<const std::uint8_t>);
template LocalTransforms local_transforms(const Skeleton&, MatrixStack<const double>, std::span<const std::uint8_t>);

}  // namespace sinew
