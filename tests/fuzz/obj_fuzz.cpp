/// A file for read_obj. What can be read is written and reads back the same.
#include "files.h"
#include "sinew/obj.h"

using namespace sinew;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto path = fuzz::folder().file("a.obj", fuzz::as_text(data, size));
  PolygonMesh mesh;
  if (!fuzz::reads(size, [&] { mesh = read_obj(path); })) return 0;
  write_obj(path, mesh);
  const PolygonMesh again = read_obj(path);
  fuzz::require(again.positions == mesh.positions, "positions that are written read back the same");
  fuzz::require(again.face_offsets == mesh.face_offsets && again.face_vertices == mesh.face_vertices,
                "faces that are written read back the same");
  return 0;
}
