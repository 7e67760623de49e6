/// What evaluating a rig writes: one for each thread. Nothing in it changes a result; what is kept from frame to frame
/// is only kept while the numbers that it was computed from are the same to the bit.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "rig/ik_plan.h"
#include "rig/program.h"

namespace sinew::rig {

/// Where a point of a B-bone's rest shape is: between segment + 0 and + 1.
struct Place {
  int segment = 0;
  float fraction = 0;
};

/// What is kept of a bone's channels.
struct KeptChannels {
  std::array<float, kPoseBend> values = {};
  Mat4 matrix;
  bool is_known = false;
  bool is_identity = false;
};

/// A B-bone's shape at rest and what follows from it.
struct RestShape {
  std::array<float, kBendValueCount + 1> values =
      {};                      ///< from which it was computed; the last one is the handle's roll
  std::uint32_t edition = 0;   ///< 0: not yet
  std::vector<Mat4> segments;  ///< relative to the bone
  std::vector<Mat4> inverses;
  std::vector<Mat4> in_armature;
  // Of the curved mapping: the segments' boundary planes.
  std::vector<Vec3> normals;
  std::vector<float> offsets;
  std::vector<float> slopes;
  float inverse_length = 0;
};

/// A kept Place, for an Armature constraint's target.
struct Binding {
  std::uint32_t edition = 0;
  Place place;
};

/// A tree's plans by which of its constraints act.
struct KeptPlans {
  std::vector<char> acts;
  std::vector<std::pair<std::vector<char>, std::vector<IkPlan>>> plans;
};

/// A number that the caller gives, as the property holds it.
struct GivenNumber {
  int value;
  float number;
};

struct State {
  explicit State(const Program& program);

  float frame = 0;
  std::uint32_t pass = 0;     ///< counts evaluations
  int undefined_driver = -1;  ///< the first driver that divided by 0 in this frame
  std::vector<float> base;    ///< the numbers before curves and drivers
  std::vector<float> values;
  std::vector<GivenNumber> given;  ///< replace what curves set
  std::vector<Mat4> outside;       ///< world matrices from outside
  std::vector<Mat4> poses;         ///< of each bone, in armature space
  std::vector<Mat4> channels;      ///< of each bone: pose relative to rest
  std::vector<Vec3> tails;
  std::vector<Mat4> segments;  ///< of each B-bone, relative to its pose
  std::vector<float> variables;

  // Of each bone, while `pass` is that of this evaluation.
  struct Lazy {
    std::uint32_t inverse = 0;
    std::uint32_t local = 0;
    std::uint32_t local_sizes = 0;
  };
  std::vector<Lazy> lazy;
  std::vector<Mat4> parents;  ///< of a plain bone: parent's pose * offset
  std::vector<Mat4> parent_inverses;
  std::vector<Mat4> locals;
  std::vector<Vec3> local_sizes;

  std::vector<KeptChannels> kept_channels;
  std::vector<RestShape> rest_shapes;
  std::vector<Binding> bindings;
  std::vector<char> is_posed;  ///< of the bones of the tree that is being solved
  std::vector<KeptPlans> plans;
  IkTreeSolver ik;
  std::vector<Mat4> ik_poses;
};

/// Computes a frame from state.base, state.outside and the program.
void evaluate(const Program& program, State& state, float frame);

}  // namespace sinew::rig
