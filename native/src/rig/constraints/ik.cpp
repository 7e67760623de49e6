#include "rig/constraints/ik.h"

#include "rig/constraints/kind.h"

namespace sinew::rig {
namespace ik {
namespace {

constexpr auto kSettings =
    settings_with(whole_setting("chain_count", 0, 255), flag_setting("use_tail"), flag_setting("use_stretch"),
                  whole_setting("iterations", 0, 10000), limited_setting("pole_angle", 3.14159274F),
                  real_setting("weight", 1, 0.01F, 1), real_setting("orient_weight", 1, 0.01F, 1),
                  flag_setting("use_location"), flag_setting("use_rotation"));

}  // namespace
}  // namespace ik

const ConstraintKind kIkConstraint = {"IK", ik::kSettings, nullptr};

}  // namespace sinew::rig
