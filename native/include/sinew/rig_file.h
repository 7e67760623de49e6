/// Rigs in files, as `sinew rig` writes them. docs/rigs.md explains their entries.
#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "sinew/json.h"
#include "sinew/rig_program.h"

namespace sinew {

/// The newest version of the format that is read. The entry "format" has a file's own; without it, it is the first.
inline constexpr int kRigFormat = 1;

/// Throws InputError, which says where something is missing, unknown or of the wrong kind, or that the format is newer.
RigDescription rig_description_of(const Json& rig);

/// The same of a file's text. Throws InputError, with line and column, if it is not JSON.
RigDescription rig_description_of(std::string_view text);

/// The same of a list as the entry "curves" is one.
std::vector<AnimatedValue> animated_values_of(const Json& rows);

/// Throws InputError, which begins with the path, if the file cannot be read, is no rig, or holds what is not computed.
RigProgram read_rig_program(const std::filesystem::path& path);

}  // namespace sinew
