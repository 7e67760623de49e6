/// A file for read_bvh. What can be read is written, and reads back as the same motion.
#include <optional>

#include "files.h"
#include "sinew/bvh.h"

using namespace sinew;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto path = fuzz::folder().file("a.bvh", fuzz::as_text(data, size));
  std::optional<BvhClip> clip;
  if (!fuzz::reads(size, [&] { clip = read_bvh(path); })) return 0;
  write_bvh(path, *clip);
  const BvhClip again = read_bvh(path);
  fuzz::require(again.names() == clip->names() && again.offsets() == clip->offsets() &&
                    again.frame_count() == clip->frame_count() && again.frame_time() == clip->frame_time(),
                "joints that are written read back the same, in order");
  for (std::size_t i = 0; i < clip->rotations().size(); ++i) {
    fuzz::require(again.rotations()[i].angularDistance(clip->rotations()[i]) < 1e-6, "and so do rotations");
  }
  return 0;
}
