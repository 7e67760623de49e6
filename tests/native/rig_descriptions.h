/// Small rigs to test programs with: bones of length 1 that point along Y and have no rotation at rest.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "rig/matrix.h"
#include "rig/rotation.h"
#include "sinew/rig_program.h"

namespace sinew {

/// Adds a bone with its head at a place in armature space, and returns its number.
int add_bone(RigDescription& rig, const std::string& name, int parent, rig::Vec3 head);

/// Adds a constraint without targets, or with a bone as its only one. Settings not given have their initial values; it
/// is valid, and where a type asks whether it uses an axis, it does.
ConstraintDescription& add_constraint(RigDescription& rig, ConstraintType type, int bone, int target = -1);

/// Sets a constraint's setting by name; `index` counts in it.
void set(ConstraintDescription& constraint, std::string_view setting, float value, int index = 0);

/// A driver that sums properties, or has an expression in which they are a, b and so on.
DriverDescription driver(const std::string& path, int index, const std::vector<std::string>& properties,
                         const std::string& expression = "");

/// A curve of straight lines through points of frame and value.
AnimatedValue curve(const std::string& path, int index, const std::vector<std::pair<float, float>>& points);

/// A path such as pose.bones["name"].location.
std::string bone_path(const std::string& name, const std::string& property);

/// All bones in one frame.
std::vector<rig::Mat4> poses_of(const RigProgram& program, float frame = 1, const GivenInputs& given = {});
std::vector<rig::Mat4> poses_of(const RigDescription& rig, float frame = 1);

}  // namespace sinew
