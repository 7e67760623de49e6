/// Parts of build_program: each checks a part of a description and adds it to a program. They throw InputError.
#pragma once

#include <string>

#include "base/check.h"
#include "rig/program.h"

namespace sinew::rig {

void add_spline(const RigDescription& rig, int index, Program& program);

/// The places along NURBS at which Blender computes them. Its settings were checked.
std::vector<NurbsPlace> nurbs_places(const SplineDescription& given);

/// Finds the chains of Spline IK, after the constraints. Throws InputError for bones that several constraints would move
/// together.
void add_chains(const RigDescription& rig, Program& program);

void add_driver(const RigDescription& rig, const DriverDescription& given, Program& program);

/// The number that something sets. what  sets it, for messages.
int place_of(const ValueMap& map, const ValuePath& value, const char* what);

inline std::string bone_text(const RigDescription& rig, int bone) { return "bone \"" + rig.bones[bone].name + "\""; }

/// owner: returns what has the target, for messages. To write them takes longer than all else.
template <class Owner>
void check_target(const RigDescription& rig, const RigTarget& target, const Owner& owner) {
  const auto check = [&](std::size_t count, const char* what) {
    if (target.index < 0 || target.index >= static_cast<int>(count)) {
      fail(owner(), " looks at ", what, " ", target.index, "; the rig has ", grouped(static_cast<long long>(count)));
    }
  };
  if (target.type == RigTarget::Type::bone) check(rig.bones.size(), "bone");
  if (target.type == RigTarget::Type::outside) check(rig.matrices.size(), "matrix");
}

/// Builds a part whose errors do not say where they are. owner: as for check_target.
template <class Owner, class Build>
auto named(const Owner& owner, const Build& build) {
  try {
    return build();
  } catch (const InputError& error) {
    fail(owner(), ": ", error.what());
  }
}

}  // namespace sinew::rig
