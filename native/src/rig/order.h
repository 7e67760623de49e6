/// The order in which a rig's operations run, so that each comes after what it reads.
#pragma once

#include <vector>

#include "rig/program.h"

namespace sinew::rig {

/// Finds the bones that IK may solve together: those of chains that share bones. Notes in each bone which tree it is
/// in.
std::vector<Tree> find_trees(std::vector<Bone>& bones, const std::vector<Constraint>& constraints, const ValueMap& map);

/// Finds what is solved at once in trees, from Program::trees.
std::vector<Solve> find_solves(const Program& program);

/// Sorts bones, drivers, trees, chains and B-bones' segments. Throws InputError for a cycle, and names what is in it.
std::vector<Operation> put_in_order(const Program& program);

/// Whether a curve or a driver sets each number.
std::vector<char> written_values(const Program& program);

/// Whether a number is always on, or always off. written: as written_values returns it.
bool stays(const Program& program, const std::vector<char>& written, int value, bool is_on);

/// Whether a constraint ever acts. first: the first of its numbers.
bool may_act(const Program& program, const std::vector<char>& written, int first);

}  // namespace sinew::rig
