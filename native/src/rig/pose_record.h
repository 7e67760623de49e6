/// Records of poses: what Blender's evaluation leaves in the memory of an armature's bones.
#pragma once

#include <cstddef>
#include <span>

#include "rig/state.h"
#include "sinew/rig_program.h"

namespace sinew::rig {

/// The size of a record in bytes. Throws InputError for a field that bones do not have.
std::ptrdiff_t record_size(const Program& program, std::span<const RecordField> fields);

/// Writes the record of the frame that was evaluated last. The formulas are those of Blender's
/// BKE_pose_bone_done and BKE_pchan_bbone_segments_cache_compute.
void write_record(const Program& program, State& state, std::span<const RecordField> fields, std::byte* to);

/// Writes what moves vertices from rest to pose in that frame: of each bone, or of each end of a B-bone's segments.
void write_motions(const Program& program, State& state, const MatrixStack<float>& out, std::ptrdiff_t frame);

}  // namespace sinew::rig
