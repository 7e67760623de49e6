/// A rig's file. What can be read is read from the same values again, and becomes a program or is refused.
#include "files.h"
#include "sinew/rig_file.h"

using namespace sinew;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text = fuzz::as_text(data, size);
  RigDescription rig;
  if (!fuzz::reads(size, [&] { rig = rig_description_of(text); })) return 0;
  const RigDescription again = rig_description_of(parse_json(text));
  fuzz::require(again.bones.size() == rig.bones.size() && again.curves.size() == rig.curves.size(),
                "values are read as their text is");
  fuzz::accepts([&] { const RigProgram program(rig); });
  return 0;
}
