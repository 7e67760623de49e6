/// Laws of all readers.
#include <gtest/gtest.h>

#include "failures.h"
#include "files.h"
#include "memory.h"
#include "sinew/bvh.h"
#include "sinew/dmat.h"
#include "sinew/rig.h"
#include "sinew/rig_file.h"

namespace sinew {
namespace {

std::string repeated(const std::string& text, int times) {
  std::string all;
  for (int i = 0; i < times; ++i) all += text;
  return all;
}

/// Each makes as much as it can of few bytes.
std::string many_joints(int count) { return "0 -1 0 0 0\n" + repeated("-1 0 0 0 0\n", count - 1); }
[[maybe_unused]] std::string tgf_joints(int count) {
  std::string text, edges = "#\n";
  for (int j = 1; j <= count; ++j) text += std::to_string(j) + " 0 0 0\n";
  for (int j = 2; j <= count; ++j) edges += "1 " + std::to_string(j) + "\n";
  return text + edges;
}
[[maybe_unused]] std::string joints_without_channels(int count) {
  return "HIERARCHY\n" + repeated("ROOT a{\nOFFSET 0 0 0 CHANNELS 0 }\n", count);
}
[[maybe_unused]] std::string many_materials(int count) {
  std::string text = "v 0 0 0\n";
  for (int i = 0; i < count; ++i) text += "usemtl " + std::to_string(i) + "\n";
  return text;
}

TEST(Readers, MemoryIsInProportionToTheFile) {
#ifndef SINEW_COUNTS_MEMORY
  GTEST_SKIP() << "the address sanitizer counts";
#else
  const TemporaryFolder folder;
  for (const int count : {1, 1000, 20000}) {
    const auto check = [&](const std::string& name, const std::string& bytes, const auto& read) {
      const auto path = folder.file(name, bytes);
      const std::size_t allocated = bytes_allocated_by([&] { complaint([&] { read(path); }); });
      EXPECT_LE(allocated, most_bytes_to_read(bytes.size())) << name << ", " << bytes.size() << " bytes";
      EXPECT_GE(allocated, bytes.size()) << name;  // it does count
    };
    const auto dmat = [](const auto& path) { read_dmat(path); };
    check("text.dmat", "1 " + std::to_string(count) + "\n" + repeated("0\n", count), dmat);
    check("binary.dmat", "0 0\n1 " + std::to_string(count) + "\n" + std::string(8 * count, '\0'), dmat);
    check("huge.dmat", "2000000 2000000\n" + repeated("0\n", count), dmat);
    check("huge binary.dmat", "0 0\n2000000 2000000\n" + repeated("0\n", count), dmat);
    const auto skeleton = [](const auto& path) { read_skeleton(path); };
    check("joints.bf", many_joints(count), skeleton);
    check("joints.tgf", tgf_joints(count), skeleton);
    const auto rig = [](const auto& path) { read_rig_program(path); };
    check("lists.json", "[" + repeated("[],", count) + "0]", rig);
    check("lists of one.json", "[" + repeated("[1],", count) + "0]", rig);
    check("values.json", "{\"values\":[" + repeated("{},", count) + "0]}", rig);
    const auto bvh = [](const auto& path) { read_bvh(path); };
    check("joints.bvh", joints_without_channels(count) + "MOTION\nFrames: 1\nFrame Time: 1\n", bvh);
    check("frames.bvh", joints_without_channels(count) + "MOTION\nFrames: 2000000000\nFrame Time: 1\n", bvh);
    const auto obj = [](const auto& path) { read_obj(path); };
    check("vertices.obj", repeated("v 0 0 0\n", count), obj);
    check("faces.obj", "v 0 0 0\n" + repeated("f 1 1 1\n", count), obj);
    check("materials.obj", many_materials(count), obj);
    check("latin1.obj", "v 0 0 0\n" + repeated("\xF6", count), obj);
  }
#endif
}

TEST(Readers, AnAnimationOfManyJointsWithoutWeightsIsRefused) {
  const TemporaryFolder folder;
  const RigPaths paths{folder.file("mesh.obj", "v 0 0 0\n"),
                       folder.file("skeleton.bf", many_joints(4000)),
                       folder.file("weights.dmat", "1 1\n1\n"),
                       {},
                       folder.file("anim.dmat", "4000 12\n" + repeated("0\n", 4000 * 12))};
  EXPECT_EQ(complaint([&] { read_rig(paths); }),
            "anim.dmat has 4,000 frames of 1 bone, the skeleton has 4,000 joints: too many matrices for joints without "
            "weights; remove such joints from the skeleton");
  folder.file("anim.dmat", "40 12\n" + repeated("0\n", 40 * 12));
  EXPECT_EQ(read_rig(paths).animation->matrices.size(), 40 * 4000u);
}

}  // namespace
}  // namespace sinew
