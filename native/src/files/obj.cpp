#include "sinew/obj.h"

#include <unordered_map>

#include "base/text.h"
#include "files/write_files.h"

namespace sinew {
namespace {

/// The numbers of the materials by their names in the file.
using MaterialNumbers = std::unordered_map<std::string_view, std::int32_t>;

std::int32_t material_index(PolygonMesh& mesh, MaterialNumbers& numbers, std::string_view name) {
  const auto [entry, is_new] = numbers.try_emplace(name, static_cast<std::int32_t>(numbers.size()));
  if (is_new) mesh.material_names.emplace_back(name);
  return entry->second;
}

void read_vertex(LineReader& file, PolygonMesh& mesh) {
  for (int axis = 0; axis < 3; ++axis) {
    mesh.positions.push_back(file.number<float>("a coordinate"));
  }
}

/// Positive numbers may name a vertex that comes later in the file; those are checked at its end.
void read_face(LineReader& file, PolygonMesh& mesh) {
  int corners = 0;
  for (auto word = file.word(); !word.empty(); word = file.word(), ++corners) {
    std::int32_t number = 0;
    if (!parse_number(word.substr(0, word.find('/')), number) || number == 0) {
      file.fail_here("expected a vertex number, found ", excerpt(word));
    }
    const auto vertices = static_cast<std::int32_t>(mesh.vertex_count());
    if (number < -vertices) {
      file.fail_here("vertex ", number, " does not exist; ", plural(vertices, "vertex"), " so far");
    }
    mesh.face_vertices.push_back(number > 0 ? number - 1 : vertices + number);
  }
  if (corners < 3) file.fail_here("a face has ", plural(corners, "corner"), "; expected 3 or more");
  mesh.face_offsets.push_back(static_cast<std::int32_t>(mesh.face_vertices.size()));
}

}  // namespace

PolygonMesh read_obj(const Path& path) {
  LineReader file(path);
  PolygonMesh mesh;
  MaterialNumbers numbers;
  std::int32_t material = -1;
  while (file.next_line()) {
    const std::string_view keyword = file.word();
    if (keyword == "v") {
      read_vertex(file, mesh);
    } else if (keyword == "f") {
      read_face(file, mesh);
      mesh.face_materials.push_back(material);
    } else if (keyword == "usemtl") {
      const std::string_view name = trimmed(file.rest());
      material = name.empty() ? -1 : material_index(mesh, numbers, name);
    } else if (keyword == "mtllib") {
      mesh.material_library = trimmed(file.rest());
    }
  }
  if (mesh.positions.empty()) fail(file.name(), " holds no vertices");
  for (std::ptrdiff_t face = 0; face < mesh.face_count(); ++face) {
    for (auto i = mesh.face_offsets[face]; i < mesh.face_offsets[face + 1]; ++i) {
      if (mesh.face_vertices[i] >= mesh.vertex_count()) {
        fail(file.name(), ": face ", face + 1, " names vertex ", mesh.face_vertices[i] + 1, "; there are ",
             plural(mesh.vertex_count(), "vertex"));
      }
    }
  }
  return mesh;
}

std::string obj_text(const PolygonMesh& mesh) {
  std::string text;
  if (!mesh.material_library.empty()) text += "mtllib " + mesh.material_library + '\n';
  for (std::ptrdiff_t v = 0; v < mesh.vertex_count(); ++v) {
    text += 'v';
    for (int axis = 0; axis < 3; ++axis) {
      text += ' ';
      append_number(text, mesh.positions[3 * v + axis]);
    }
    text += '\n';
  }
  std::int32_t material = -1;
  for (std::ptrdiff_t face = 0; face < mesh.face_count(); ++face) {
    if (!mesh.face_materials.empty() && mesh.face_materials[face] != material) {
      material = mesh.face_materials[face];
      text += material < 0 ? "usemtl\n" : "usemtl " + mesh.material_names[material] + '\n';
    }
    text += 'f';
    for (auto i = mesh.face_offsets[face]; i < mesh.face_offsets[face + 1]; ++i) {
      text += ' ';
      append_number(text, mesh.face_vertices[i] + 1);
    }
    text += '\n';
  }
  return text;
}

void write_obj(const Path& path, const PolygonMesh& mesh) { write_file(path, obj_text(mesh)); }

}  // namespace sinew
