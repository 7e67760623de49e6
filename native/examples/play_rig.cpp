/// Prints where the bones of a rig are, in armature space: play_rig RIG.json FIRST_FRAME LAST_FRAME
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "sinew/rig_file.h"

int main(int count, char** arguments) {
  if (count != 4) {
    std::fputs("usage: play_rig RIG.json FIRST_FRAME LAST_FRAME\n", stderr);
    return 2;
  }
  try {
    const sinew::RigProgram rig = sinew::read_rig_program(arguments[1]);
    std::vector<float> frames;
    for (int frame = std::atoi(arguments[2]); frame <= std::atoi(arguments[3]); ++frame) {
      frames.push_back(static_cast<float>(frame));
    }
    const std::vector<std::string>& names = rig.bone_names();
    std::vector<sinew::Matrix4<float>> poses(frames.size() * names.size());
    sinew::RigOutputs outputs;
    outputs.poses = sinew::MatrixStack<float>::of(poses.data(), std::ssize(frames), std::ssize(names));
    rig.evaluate(frames, {}, outputs);
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const auto head = poses[i].col(3);
      std::printf("%g %s %g %g %g\n", frames[i / names.size()], names[i % names.size()].c_str(), head[0], head[1],
                  head[2]);
    }
  } catch (const sinew::InputError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
