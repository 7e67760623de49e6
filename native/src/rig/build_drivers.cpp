#include "rig/build.h"

namespace sinew::rig {
namespace {

/// owner: as for check_target.
template <class Owner>
Variable variable_of(const RigDescription& rig, const VariableDescription& given, const ValueMap& map,
                     const Owner& owner) {
  const auto refuse_unknown = [&](const std::string& name) {
    fail(owner(), " reads ", name, ", which is not among the rig's values from outside; describe it there");
  };
  Variable variable;
  for (std::size_t i = 0; i < variable.targets.size(); ++i) {
    const VariableTarget& target = given.targets[i];
    variable.targets[i] = {target.target, target.channel, target.space, target.rotation, target.order};
  }
  switch (given.type) {
    case VariableType::property: {
      for (ReadTarget& target : variable.targets) target.target = {};
      if (!given.outside.empty()) {
        variable.value = map.find_outside(given.outside);
        if (variable.value < 0) refuse_unknown(given.outside);
        return variable;
      }
      variable.value = map.find_element(given.path);
      if (variable.value >= 0) return variable;
      constexpr std::string_view kLength = ".length";
      if (given.path.starts_with("pose.bones[") && given.path.ends_with(kLength)) {
        const ValueMap::Found bone = map.find(given.path.substr(0, given.path.size() - kLength.size()) + ".location");
        if (bone.first >= 0) {
          variable.type = Variable::Type::bone_length;
          variable.value = bone.first / kBoneValueCount;
          return variable;
        }
      }
      fail(owner(), " reads ", given.path, ", which the rig does not have; remove it or describe the property");
    }
    case VariableType::transform:
      variable.type = Variable::Type::transform;
      for (std::size_t i = 0; i < variable.angles.size(); ++i) {
        const std::string& angle = given.targets[0].angles[i];
        variable.angles[i] = map.find_outside(angle);
        if (variable.angles[i] < 0) variable.angles[i] = map.find_element(angle);
        if (variable.angles[i] < 0 && !angle.empty()) refuse_unknown(angle);
      }
      variable.targets[1].target = {};
      break;
    case VariableType::location_difference:
      variable.type = Variable::Type::location_difference;
      break;
    case VariableType::rotation_difference:
      variable.type = Variable::Type::rotation_difference;
      break;
  }
  for (const ReadTarget& target : variable.targets) check_target(rig, target.target, owner);
  return variable;
}

}  // namespace

void add_driver(const RigDescription& rig, const DriverDescription& given, Program& program) {
  const int value = place_of(program.map, given.value, "driver");
  if (given.value.path.starts_with("objects[")) {
    fail("a driver sets ", given.value.path, ", which is not computed; use keyframes");
  }
  const auto owner = [&] { return "the driver of " + program.map.name(value); };
  std::vector<Variable> variables;
  for (const VariableDescription& variable : given.variables) {
    variables.push_back(variable_of(rig, variable, program.map, owner));
  }
  program.drivers.push_back({value, std::move(variables), named(owner, [&] { return Driver(given); })});
}

}  // namespace sinew::rig
