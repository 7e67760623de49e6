#include "sinew/object_place.h"

#include "rig/eigen.h"

namespace sinew {
namespace {

rig::Mat4 own_of(const Matrix4<float>& m) { return rig::matrix_of(std::span<const float, 16>(m.data(), 16)); }

/// Blender moves a matrix without an inverse by this much, and keeps the identity if there is still none.
constexpr float kNudge = 1e-8F;

ObjectPlace place_at(const rig::Mat4& world) {
  constexpr rig::Mat4 kNone = {};
  rig::Mat4 inverse = rig::inverse(world);
  const bool has_inverse = !(inverse == kNone);
  if (!has_inverse) {
    rig::Mat4 nudged = world;
    for (int i = 0; i < 3; ++i) nudged[i][i] += kNudge;
    inverse = rig::inverse(nudged);
    if (inverse == kNone) inverse = rig::kIdentity4;
  }
  const bool is_mirrored = dot(cross(world.axis(0), world.axis(1)), world.axis(2)) < 0;
  return {rig::eigen_of(world), rig::eigen_of(inverse), has_inverse, is_mirrored};
}

}  // namespace

ObjectPlace place_of(const Matrix4<float>& world) { return place_at(own_of(world)); }

ObjectPlace place_of_child(const Matrix4<float>& parent, const Matrix4<float>& parent_inverse,
                           const Matrix4<float>& basis) {
  return place_at((own_of(parent) * own_of(parent_inverse)) * own_of(basis));
}

}  // namespace sinew
