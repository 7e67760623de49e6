#include "sinew/bends.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "base/offsets.h"
#include "sinew/skin.h"

namespace sinew {
namespace {

void check_vertices(std::span<const std::int64_t> vertices, std::span<const std::int64_t> offsets,
                    std::int64_t influences) {
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    if (vertices[i] < 0) fail("entry ", i, " of vertices is ", vertices[i], "; expected 0 or more");
    if (i > 0 && vertices[i] <= vertices[i - 1]) fail("vertices does not increase at entry ", i);
  }
  check_offsets("offsets", offsets, influences, "influences", std::ssize(vertices), "vertices");
}

void check_influences(std::span<const std::int32_t> bones, std::span<const float> weights, std::ptrdiff_t bone_count) {
  if (bones.size() != weights.size()) {
    fail("bones has ", grouped(std::ssize(bones)), " entries and weights has ", grouped(std::ssize(weights)),
         "; expected as many of each");
  }
  for (std::size_t i = 0; i < bones.size(); ++i) {
    if (bones[i] < 0 || bones[i] >= bone_count) {
      fail("influence ", i, " names bone ", bones[i], "; there are ", plural(bone_count, "bone"));
    }
    if (!std::isfinite(weights[i])) fail("the weight of influence ", i, " is not finite");
  }
}

void check_bones(std::span<const std::int32_t> first_joints, std::span<const std::int32_t> segments,
                 std::span<const double> axes) {
  if (first_joints.size() != segments.size()) {
    fail("first_joints has ", grouped(std::ssize(first_joints)), " entries and segments has ",
         grouped(std::ssize(segments)), "; expected as many of each");
  }
  if (axes.size() != 4 * segments.size()) {
    fail("axes has ", plural(std::ssize(axes), "number"), "; expected four for each of ",
         plural(std::ssize(segments), "bone"));
  }
  for (std::size_t b = 0; b < segments.size(); ++b) {
    if (first_joints[b] < 0 || first_joints[b] >= kMostJoints) {
      fail("the first joint of bone ", b, " is ", first_joints[b], "; expected 0 to ", grouped(kMostJoints - 1));
    }
    if (segments[b] < 1 || segments[b] >= kMostJoints) {
      fail("bone ", b, " has ", plural(segments[b], "segment"), "; expected 1 to ", grouped(kMostJoints - 1));
    }
    for (std::size_t i = 4 * b; i < 4 * b + 4; ++i) {
      if (!std::isfinite(axes[i])) fail("the axis of bone ", b, " is not finite");
    }
  }
}

}  // namespace

Bends::Bends(std::span<const std::int64_t> vertices, std::span<const std::int64_t> offsets,
             std::span<const std::int32_t> bones, std::span<const float> weights,
             std::span<const std::int32_t> first_joints, std::span<const std::int32_t> segments,
             std::span<const double> axes)
    : vertices_(vertices.begin(), vertices.end()),
      offsets_(offsets.begin(), offsets.end()),
      bones_(bones.begin(), bones.end()),
      weights_(weights.begin(), weights.end()) {
  check_bones(first_joints, segments, axes);
  for (std::size_t b = 0; b < segments.size(); ++b) {
    const Eigen::RowVector4d axis = Eigen::Map<const Eigen::RowVector4d>(axes.data() + 4 * b);
    by_number_.push_back({axis, first_joints[b], segments[b]});
    const std::ptrdiff_t own = segments[b] > 1 ? segments[b] + 1 : 1;
    joint_count_ = std::max(joint_count_, first_joints[b] + own);
  }
  check_influences(bones_, weights_, std::ssize(by_number_));
  check_vertices(vertices_, offsets_, std::ssize(bones_));
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    most_influences_ = std::max(most_influences_, static_cast<std::size_t>(offsets_[i + 1] - offsets_[i]));
  }
}

std::vector<std::pair<std::uint32_t, std::uint32_t>> Bends::joint_pairs() const {
  std::set<std::pair<std::int32_t, std::int32_t>> bone_pairs;
  std::span<const std::int32_t> before;
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    const auto own = std::span(bones_).subspan(offsets_[i], offsets_[i + 1] - offsets_[i]);
    if (std::ranges::equal(own, before)) continue;  // most have the bones of the vertex beside them
    before = own;
    for (std::size_t a = 0; a < own.size(); ++a) {
      for (std::size_t b = 0; b <= a; ++b) bone_pairs.insert(std::minmax(own[a], own[b]));
    }
  }
  std::vector<std::pair<std::uint32_t, std::uint32_t>> found;
  const auto last_of = [](const Bone& bone) { return bone.first_joint + (bone.segments > 1 ? bone.segments : 0); };
  for (const auto& [a, b] : bone_pairs) {
    const Bone &one = by_number_[a], &other = by_number_[b];
    for (std::int32_t j = one.first_joint; j <= last_of(one); ++j) {
      const std::int32_t end = a == b ? std::min(j + 1, last_of(other)) : last_of(other);
      for (std::int32_t k = a == b ? j + 1 : other.first_joint; k <= end; ++k) found.emplace_back(j, k);
    }
  }
  return found;
}

void Bends::split(std::size_t i, const Eigen::Vector3d& point, Split& split) const {
  split.joints.clear();
  split.weights.clear();
  split.joints.reserve(2 * most_influences_);
  split.weights.reserve(2 * most_influences_);
  const auto add = [&](std::int32_t joint, double weight) {
    if (static_cast<float>(weight) == 0) return;
    split.joints.push_back(joint);
    split.weights.push_back(static_cast<float>(weight));
  };
  for (auto k = offsets_[i]; k < offsets_[i + 1]; ++k) {
    const Bone& bone = by_number_[bones_[k]];
    if (bone.segments == 1) {
      add(bone.first_joint, weights_[k]);
      continue;
    }
    const double share = bone.axis.head<3>().dot(point.transpose()) + bone.axis[3];
    // In this order, a share that is NaN gives 1.
    const double place = std::max(0.0, std::min(1.0, share)) * bone.segments;
    const auto index = std::min(static_cast<std::int32_t>(place), bone.segments - 1);
    const double blend = place - index;
    add(bone.first_joint + index, weights_[k] * (1 - blend));
    add(bone.first_joint + index + 1, weights_[k] * blend);
  }
}

}  // namespace sinew
