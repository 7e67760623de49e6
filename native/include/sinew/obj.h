/// .obj files: positions and polygons of a mesh.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sinew/types.h"

namespace sinew {

/// Vertices are in the order of the file, whether a face uses them or not: weights rely on it.
struct PolygonMesh {
  std::vector<float> positions;               ///< V x 3
  std::vector<std::int32_t> face_offsets{0};  ///< faces + 1: where each face's vertices begin
  std::vector<std::int32_t> face_vertices;    ///< vertex numbers, face after face
  std::vector<std::int32_t> face_materials;   ///< per face: index into material_names, or -1
  std::vector<std::string> material_names;    ///< in order of first use (`usemtl`)
  std::string material_library;               ///< file that describes the materials (`mtllib`), or empty

  std::ptrdiff_t vertex_count() const { return static_cast<std::ptrdiff_t>(positions.size()) / 3; }
  std::ptrdiff_t face_count() const { return static_cast<std::ptrdiff_t>(face_offsets.size()) - 1; }
};

/// Reads `v`, `f` (a, a/b, a//c, a/b/c, negative, any number of corners), `usemtl` and
/// `mtllib`; skips the rest. Throws InputError, naming file and line, for a missing file, no
/// vertices, text that is not a number, too few numbers, and a face with fewer than three corners or
/// with a vertex that does not exist.
PolygonMesh read_obj(const std::filesystem::path& path);

/// Writes a file from which read_obj reads the same mesh.
void write_obj(const std::filesystem::path& path, const PolygonMesh& mesh);

}  // namespace sinew
