#include "rig/constraints/spline_ik.h"

#include "rig/constraints/kind.h"

namespace sinew::rig {
namespace spline_ik {
namespace {

constexpr auto kSettings = settings_with(
    whole_setting("chain_count", 1, 255), flag_setting("use_even_divisions"), flag_setting("use_chain_offset"),
    flag_setting("use_curve_radius"), choice_setting("y_scale_mode", 2), choice_setting("xz_scale_mode", 3),
    flag_setting("use_original_scale"), real_setting("bulge", 1, 0, 100), flag_setting("use_bulge_min"),
    flag_setting("use_bulge_max"), real_setting("bulge_min", 1, 0, 1), real_setting("bulge_max", 1, 1, 100),
    real_setting("bulge_smooth", 0, 0, 1));

}  // namespace
}  // namespace spline_ik

const ConstraintKind kSplineIk = {"SPLINE_IK", spline_ik::kSettings, nullptr};

}  // namespace sinew::rig
