#include "sinew/obj.h"

#include <gtest/gtest.h>

#include <cmath>

#include "failures.h"
#include "files.h"

namespace sinew {
namespace {

using Floats = std::vector<float>;
using Integers = std::vector<std::int32_t>;
using Names = std::vector<std::string>;

const std::string kFour = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

class Obj : public testing::Test {
 protected:
  PolygonMesh read(const std::string& bytes) { return read_obj(folder_.file("a.obj", bytes)); }
  std::string said(const std::string& bytes) {
    return complaint([&] { read(bytes); });
  }
  /// What is written and read again.
  PolygonMesh again(const PolygonMesh& mesh) {
    write_obj(folder_.path("b.obj"), mesh);
    return read_obj(folder_.path("b.obj"));
  }
  TemporaryFolder folder_;
};

void expect_same(const PolygonMesh& a, const PolygonMesh& b) {
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.face_offsets, b.face_offsets);
  EXPECT_EQ(a.face_vertices, b.face_vertices);
  EXPECT_EQ(a.face_materials, b.face_materials);
  EXPECT_EQ(a.material_names, b.material_names);
  EXPECT_EQ(a.material_library, b.material_library);
}

TEST_F(Obj, EveryFormOfAFace) {
  const PolygonMesh mesh = read("# a comment\no thing\n" + kFour +
                                "vt 0 0\nvn 0 0 1\ns off\n"
                                "f 1 2 3\n"
                                "f 2/1 3/1 4/1\n"
                                "f 1//1 3//1 4//1\n"
                                "f 1/1/1 2/1/1 3/1/1 4/1/1\n"
                                "f -4 -3 -1\n"
                                "f +1 -2 4/1\n");
  EXPECT_EQ(mesh.vertex_count(), 4);
  EXPECT_EQ(mesh.face_count(), 6);
  EXPECT_EQ(mesh.positions, (Floats{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}));
  EXPECT_EQ(mesh.face_offsets, (Integers{0, 3, 6, 9, 13, 16, 19}));
  EXPECT_EQ(mesh.face_vertices, (Integers{0, 1, 2, 1, 2, 3, 0, 2, 3, 0, 1, 2, 3, 0, 1, 3, 0, 2, 3}));
  EXPECT_EQ(mesh.face_materials, Integers(6, -1));
}

TEST_F(Obj, NegativeNumbersCountFromWhereTheyStand) {
  const PolygonMesh mesh = read("v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\nv 0 1 0\nf -3 -2 -1\n");
  EXPECT_EQ(mesh.face_vertices, (Integers{0, 1, 2, 1, 2, 3}));
}

TEST_F(Obj, AFaceMayComeBeforeItsVertices) { EXPECT_EQ(read("f 1 2 3\n" + kFour).face_vertices, (Integers{0, 1, 2})); }

TEST_F(Obj, VerticesWithoutFacesStay) {
  const PolygonMesh mesh = read(kFour + "v 9 9 9\nf 1 2 4\n");
  EXPECT_EQ(mesh.vertex_count(), 5);
  EXPECT_EQ(read(kFour).face_count(), 0);
}

TEST_F(Obj, LineEndsBlanksAndExtraNumbers) {
  const PolygonMesh mesh = read(
      "\xEF\xBB\xBF"
      "v +1.5\t2 3 1.0\r\n\r\n  v 4 5 6 0.1 0.2 0.3\r\nv 7 8 9e-60\r\nf 1 2 3\r");
  EXPECT_EQ(mesh.positions, (Floats{1.5f, 2, 3, 4, 5, 6, 7, 8, 0}));
  EXPECT_EQ(mesh.face_vertices, (Integers{0, 1, 2}));
}

TEST_F(Obj, Materials) {
  const PolygonMesh mesh = read("mtllib my skin.mtl\n" + kFour +
                                "f 1 2 3\nusemtl green skin\r\nf 1 2 4\nusemtl eye\nf 2 3 4\n"
                                "usemtl green skin\nf 1 3 4\nusemtl\nf 1 2 3\n");
  EXPECT_EQ(mesh.material_library, "my skin.mtl");
  EXPECT_EQ(mesh.material_names, (Names{"green skin", "eye"}));
  EXPECT_EQ(mesh.face_materials, (Integers{-1, 0, 1, 0, -1}));
  expect_same(again(mesh), mesh);
}

TEST_F(Obj, RoundTripsBitForBit) {
  const PolygonMesh mesh = read(
      "v 0.1 -0.33333334 1e-45\nv 3.4028235e38 -0 16777217\nv 1 2 3\nv 9 9 9\n"
      "v 5 5 5\nf 1 2 3\nf 4 3 2 1 5\n");
  const PolygonMesh back = again(mesh);
  expect_same(back, mesh);
  EXPECT_TRUE(std::signbit(back.positions[4]));
}

TEST_F(Obj, RefusesWhatIsNoMesh) {
  EXPECT_EQ(complaint([&] { read_obj(folder_.path("none.obj")); }),
            "there is no file " + folder_.path("none.obj").string());
  EXPECT_EQ(said(""), "a.obj holds no vertices");
  EXPECT_EQ(said("# nothing\nvn 1 2 3\n"), "a.obj holds no vertices");
}

TEST_F(Obj, RefusesVerticesThatAreNone) {
  EXPECT_EQ(said("v 0 0 0\nv 1 2\n"), "a.obj, line 2: the line ends where a coordinate is expected");
  EXPECT_EQ(said("\nv 1 x 2\n"), "a.obj, line 2: expected a coordinate, found \"x\"");
  EXPECT_EQ(said("v 1 nan 2\n"), "a.obj, line 1: expected a coordinate, found \"nan\"");
}

TEST_F(Obj, RefusesFacesThatAreNone) {
  for (const std::string word : {"x", "0", "/1", "1.5", "99999999999", "#"}) {
    EXPECT_EQ(said(kFour + "f 1 2 " + word + "\n"), "a.obj, line 5: expected a vertex number, found \"" + word + "\"");
  }
  EXPECT_EQ(said(kFour + "f 1 2\n"), "a.obj, line 5: a face has 2 corners; expected 3 or more");
  EXPECT_EQ(said(kFour + "f\n"), "a.obj, line 5: a face has 0 corners; expected 3 or more");
  EXPECT_EQ(said(kFour + "f 1 2 -5\n"), "a.obj, line 5: vertex -5 does not exist; 4 vertices so far");
  EXPECT_EQ(said(kFour + "f 1 2 3\nf 1 2 5\n"), "a.obj: face 2 names vertex 5; there are 4 vertices");
}

TEST_F(Obj, AWriteThatFailsSaysSo) {
  EXPECT_EQ(complaint([&] { write_obj(folder_.path("none") / "a.obj", read(kFour)); }),
            (folder_.path("none") / "a.obj").string() + " cannot be written: No such file or directory");
}

}  // namespace
}  // namespace sinew
