#include "rig_descriptions.h"

#include <algorithm>

#include "sinew/rig_values.h"

namespace sinew {

int add_bone(RigDescription& rig, const std::string& name, int parent, rig::Vec3 head) {
  BoneDescription bone;
  bone.name = name;
  bone.parent = parent;
  bone.rest = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, head[0], head[1], head[2], 1};
  bone.rest_in_parent = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  bone.head_in_armature = {head[0], head[1], head[2]};
  bone.tail_in_armature = {head[0], head[1] + 1, head[2]};
  bone.head = bone.head_in_armature;
  if (parent >= 0) {
    for (int k = 0; k < 3; ++k) bone.head[k] -= rig.bones[parent].tail_in_armature[k];
  }
  bone.length = 1;
  bone.rotation_mode = RotationMode::xyz;
  std::size_t place = 0;
  for (const RigSetting& setting : bone_settings()) {
    for (int i = 0; i < setting.count; ++i) bone.values[place++] = setting.initial;
  }
  bone.values[kQuaternion] = 1;
  rig.bones.push_back(bone);
  return static_cast<int>(rig.bones.size()) - 1;
}

ConstraintDescription& add_constraint(RigDescription& rig, ConstraintType type, int bone, int target) {
  ConstraintDescription constraint;
  constraint.bone = bone;
  constraint.type = type;
  constraint.name = std::string(constraint_name(type)) + " " + std::to_string(rig.constraints.size());
  for (const RigSetting& setting : constraint_settings(type)) {
    const bool is_axis = setting.name.starts_with("use_") && setting.name.size() > 2 &&
                         setting.name[setting.name.size() - 2] == '_' && !setting.name.starts_with("use_min") &&
                         !setting.name.starts_with("use_max");
    constraint.settings.insert(constraint.settings.end(), setting.count, is_axis ? 1.0F : setting.initial);
  }
  constraint.settings[kValid] = 1;
  if (target >= 0) constraint.targets.push_back({RigTarget::Type::bone, target});
  rig.constraints.push_back(std::move(constraint));
  return rig.constraints.back();
}

void set(ConstraintDescription& constraint, std::string_view name, float value, int index) {
  std::size_t place = 0;
  for (const RigSetting& setting : constraint_settings(constraint.type)) {
    if (setting.name == name) {
      constraint.settings.at(place + index) = value;
      return;
    }
    place += setting.count;
  }
  throw InputError("a test sets " + std::string(name) + ", which the constraint does not have");
}

DriverDescription driver(const std::string& path, int index, const std::vector<std::string>& properties,
                         const std::string& expression) {
  DriverDescription driver;
  driver.value = {path, index};
  driver.type = expression.empty() ? DriverType::sum : DriverType::scripted;
  driver.expression = expression;
  for (const std::string& property : properties) {
    VariableDescription variable;
    variable.name = static_cast<char>('a' + driver.variables.size());
    variable.path = property;
    driver.variables.push_back(variable);
  }
  return driver;
}

AnimatedValue curve(const std::string& path, int index, const std::vector<std::pair<float, float>>& points) {
  AnimatedValue animated{{path, index}, {}};
  for (const auto& [frame, value] : points) {
    CurveKey key;
    key.interpolation = KeyInterpolation::linear;
    for (float(*point)[2] : {&key.left, &key.point, &key.right}) {
      (*point)[0] = frame;
      (*point)[1] = value;
    }
    animated.curve.keys.push_back(key);
  }
  return animated;
}

std::string bone_path(const std::string& name, const std::string& property) {
  return "pose.bones[\"" + name + "\"]." + property;
}

std::vector<rig::Mat4> poses_of(const RigProgram& program, float frame, const GivenInputs& given) {
  std::vector<Matrix4<float>> matrices(program.bone_count());
  RigOutputs outputs;
  outputs.poses = MatrixStack<float>::of(matrices.data(), 1, program.bone_count());
  program.evaluate({&frame, 1}, given, outputs);
  std::vector<rig::Mat4> poses(matrices.size());
  for (std::size_t i = 0; i < poses.size(); ++i) std::copy_n(matrices[i].data(), 16, &poses[i].columns[0][0]);
  return poses;
}

std::vector<rig::Mat4> poses_of(const RigDescription& rig, float frame) { return poses_of(RigProgram(rig), frame); }

}  // namespace sinew
