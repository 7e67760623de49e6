/// The settings of an IK constraint. The tree of bones that it moves is solved by ik_tree.h.
#pragma once

#include "rig/constraints/constraint.h"

namespace sinew::rig {

enum IkSetting : int {
  kIkChainLength = kCommonValueCount,
  kIkUseTail,
  kIkUseStretch,
  kIkIterations,
  kIkPoleAngle,
  kIkWeight,
  kIkOrientWeight,
  kIkUseLocation,
  kIkUseRotation,
};

}  // namespace sinew::rig
