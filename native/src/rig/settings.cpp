#include <array>
#include <span>

#include "rig/constraints/constraint.h"
#include "sinew/rig_description.h"

namespace sinew {
namespace {

constexpr float kTurns = 3.4e38F;

constexpr RigSetting number(std::string_view name, float initial = 0, float low = -kTurns, float high = kTurns) {
  return {name, 1, ValueKind::real, low, high, initial};
}
constexpr RigSetting numbers(std::string_view name, int count, float initial = 0, float low = -kTurns) {
  return {name, count, ValueKind::real, low, kTurns, initial};
}
constexpr RigSetting flag(std::string_view name) { return {name, 1, ValueKind::boolean, 0, 1, 0}; }

constexpr float kPi = 3.14159274F;

constexpr std::array kBoneSettings = {
    numbers("location", 3),
    numbers("rotation_quaternion", 4),
    numbers("rotation_axis_angle", 4),
    numbers("rotation_euler", 3),
    numbers("scale", 3, 1),
    number("bbone_curveinx"),
    number("bbone_curveinz"),
    number("bbone_curveoutx"),
    number("bbone_curveoutz"),
    number("bbone_rollin"),
    number("bbone_rollout"),
    number("bbone_easein"),
    number("bbone_easeout"),
    numbers("bbone_scalein", 3, 1),
    numbers("bbone_scaleout", 3, 1),
    number("ik_stretch", 0, 0, 1),
    number("ik_stiffness_x", 0, 0, 0.99F),
    number("ik_stiffness_y", 0, 0, 0.99F),
    number("ik_stiffness_z", 0, 0, 0.99F),
    number("ik_min_x", -kPi, -kPi, 0),
    number("ik_max_x", kPi, 0, kPi),
    number("ik_min_y", -kPi, -kPi, 0),
    number("ik_max_y", kPi, 0, kPi),
    number("ik_min_z", -kPi, -kPi, 0),
    number("ik_max_z", kPi, 0, kPi),
    flag("lock_ik_x"),
    flag("lock_ik_y"),
    flag("lock_ik_z"),
    flag("use_ik_limit_x"),
    flag("use_ik_limit_y"),
    flag("use_ik_limit_z"),
    number("bbone_curveinx"),
    number("bbone_curveinz"),
    number("bbone_curveoutx"),
    number("bbone_curveoutz"),
    number("bbone_rollin"),
    number("bbone_rollout"),
    number("bbone_easein", 1),
    number("bbone_easeout", 1),
    numbers("bbone_scalein", 3, 1),
    numbers("bbone_scaleout", 3, 1),
};

}  // namespace

std::span<const RigSetting> bone_settings() { return kBoneSettings; }

std::span<const RigSetting> constraint_settings(ConstraintType type) { return rig::kind_of(type).settings; }

std::string_view constraint_name(ConstraintType type) { return rig::kind_of(type).name; }

}  // namespace sinew
