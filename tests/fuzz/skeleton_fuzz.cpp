/// The same file as .bf, in each convention, and as .tgf. What can be read poses, and what can be written reads back.
#include <algorithm>
#include <optional>
#include <vector>

#include "files.h"
#include "sinew/forward_kinematics.h"
#include "sinew/rig_skeleton.h"

using namespace sinew;

namespace {

void check(const RigSkeleton& skeleton, const std::filesystem::path& path) {
  std::vector<Matrix4<double>> local(skeleton.joint_count(), Matrix4<double>::Identity()), world = local;
  const auto joints = skeleton.joint_count();
  forward_kinematics<double>(skeleton, MatrixStack<double>::of(local.data(), 1, joints),
                             MatrixStack<double>::of(world.data(), 1, joints));
  try {
    write_skeleton(path, skeleton);
  } catch (const InputError&) {
    return;  // the format cannot hold it
  }
  const RigSkeleton again = read_skeleton(path);
  fuzz::require(
      std::ranges::equal(again.parents(), skeleton.parents()) && again.weight_columns() == skeleton.weight_columns(),
      "joints that are written read back the same");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  for (const auto convention : {Convention::bone, Convention::joint}) {
    for (const char* name : {"a.bf", "a.tgf"}) {
      const auto path = fuzz::folder().file(name, fuzz::as_text(data, size));
      std::optional<RigSkeleton> skeleton;
      if (fuzz::reads(size, [&] { skeleton = read_skeleton(path, convention); })) check(*skeleton, path);
    }
  }
  return 0;
}
