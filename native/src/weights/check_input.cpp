#include "weights/check_input.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "mesh/faces.h"
#include "sinew/skin.h"

namespace sinew {
namespace {

void check_points(const char* name, std::span<const double> numbers, const char* of) {
  if (numbers.size() % 3 != 0) {
    fail(name, " has ", plural(std::ssize(numbers), "number"), "; expected three for each ", of);
  }
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (!std::isfinite(numbers[i])) fail(name, " is not finite at ", of, " ", i / 3);
  }
}

std::int32_t check_bones(const WeightBones& bones) {
  check_points("heads", bones.heads, "bone");
  check_points("tails", bones.tails, "bone");
  const auto count = std::ssize(bones.heads) / 3;
  if (bones.tails.size() != bones.heads.size()) {
    fail("there are ", plural(count, "head"), " and ", plural(std::ssize(bones.tails) / 3, "tail"),
         "; expected as many of each");
  }
  if (count == 0) fail("there are no bones; expected at least one");
  if (count > kMostJoints) fail("there are ", plural(count, "bone"), "; expected ", grouped(kMostJoints), " at most");
  if (bones.joints.empty()) return static_cast<std::int32_t>(count);
  if (std::ssize(bones.joints) != count) {
    fail("joints has ", plural(std::ssize(bones.joints), "number"), "; there are ", plural(count, "bone"));
  }
  std::int32_t largest = 0;
  for (std::size_t bone = 0; bone < bones.joints.size(); ++bone) {
    if (bones.joints[bone] < 0 || bones.joints[bone] >= kMostJoints) {
      fail("bone ", bone, " has joint ", bones.joints[bone], "; expected 0 to ", grouped(kMostJoints - 1));
    }
    largest = std::max(largest, bones.joints[bone]);
  }
  return largest + 1;
}

void check_fixed(const FixedWeights& fixed, std::ptrdiff_t vertices, std::int32_t joints) {
  check_vertices("fixed_vertices", fixed.vertices, vertices);
  const auto rows = std::ssize(fixed.vertices);
  if (fixed.weights.vertices() != rows || (rows > 0 && fixed.weights.bones() != joints)) {
    fail("fixed_weights has ", plural(fixed.weights.vertices(), "row"), " of ", plural(fixed.weights.bones(), "joint"),
         "; expected ", grouped(rows), " of ", grouped(joints));
  }
  for (std::ptrdiff_t row = 0; row < rows; ++row) {
    if (fixed.weights.row(row).empty()) {
      fail("fixed_weights has the sum 0 in row ", row, ", of vertex ", fixed.vertices[row], "; expected more than 0");
    }
  }
}

void check_settings(const WeightSettings& settings, std::ptrdiff_t vertices) {
  check_range("resolution", settings.resolution, 8, 256);
  check_range("stiffness", settings.stiffness, 1e-3, 1e6);
  if (settings.max_influences < 0) {
    fail("max_influences is ", settings.max_influences, "; expected 0 (any number) or more");
  }
  check_range("least_weight", settings.least_weight, 0, 0.5);
  check_range("rigid_size", settings.rigid_size, 0, 1);
  if (!settings.rigid_parts.empty() && std::ssize(settings.rigid_parts) != vertices) {
    fail("rigid_parts has ", plural(std::ssize(settings.rigid_parts), "number"), "; the mesh has ",
         plural(vertices, "vertex"));
  }
}

}  // namespace

std::int32_t check_weight_input(std::span<const double> positions, std::span<const std::int32_t> face_offsets,
                                std::span<const std::int32_t> face_vertices, const WeightBones& bones,
                                const FixedWeights& fixed, const WeightSettings& settings) {
  check_points("positions", positions, "vertex");
  const auto vertices = std::ssize(positions) / 3;
  if (vertices > kMostNumbers / 4) {
    fail("there are ", plural(vertices, "vertex"), "; expected ", grouped(kMostNumbers / 4), " at most");
  }
  check_faces({face_offsets, face_vertices}, vertices);
  const std::int32_t joints = check_bones(bones);
  check_fixed(fixed, vertices, joints);
  check_settings(settings, vertices);
  return joints;
}

}  // namespace sinew
