/// A rig folder in one file: mesh.obj, skeleton.bf, weights.dmat, pose.dmat and anim.dmat, each but the last ending in
/// a line "====". What is not there is no file.
#include "files.h"
#include "sinew/rig.h"
#include "sinew/skin.h"

using namespace sinew;

namespace {

constexpr const char* kNames[] = {"mesh.obj", "skeleton.bf", "weights.dmat", "pose.dmat", "anim.dmat"};
constexpr std::string_view kSeparator = "====\n";

void unpack(std::string_view text) {
  bool there = true;
  for (const char* name : kNames) {
    const std::size_t end = text.find(kSeparator);
    if (there) {
      fuzz::folder().file(name, text.substr(0, end));
    } else {
      std::filesystem::remove(fuzz::folder().path(name));
    }
    there = end != text.npos;
    text.remove_prefix(there ? end + kSeparator.size() : text.size());
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  unpack(fuzz::as_text(data, size));
  const RigPaths paths = find_rig(fuzz::folder().path());
  std::optional<Rig> rig;
  if (!fuzz::reads(size, [&] { rig = read_rig(paths); })) return 0;
  fuzz::require(rig->weights.size() == 0 || (rig->weights.minCoeff() >= 0 && rig->weights.maxCoeff() <= 1),
                "weights are from 0 to 1");
  Skin::from_dense(rig->mesh.positions, rig->weights.data(), rig->weights.rows(), rig->weights.cols(), 1,
                   rig->weights.rows());
  try {
    write_rig(paths, *rig);
  } catch (const InputError&) {
    return 0;  // .bf cannot hold it
  }
  const Rig again = read_rig(paths);
  fuzz::require(again.mesh.positions == rig->mesh.positions && again.weights.rows() == rig->weights.rows(),
                "a rig that is written reads back");
  return 0;
}
