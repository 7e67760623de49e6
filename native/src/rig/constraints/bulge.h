/// The limits of a change of width that keeps a volume, of Stretch To and Spline IK.
#pragma once

#include "rig/constraints/constraint.h"

namespace sinew::rig {

/// Between hard limits and limits that are approached slowly, by `bulge_smooth`.
///
/// first  of the settings use_bulge_min, use_bulge_max, bulge_min, bulge_max and bulge_smooth.
float limited_bulge(const Acting& acting, int first, float bulge);

}  // namespace sinew::rig
