/// What evaluating a rig writes: one for each thread. Nothing in it changes a result; what is kept from frame to frame
/// is only kept while the numbers that it was computed from are the same to the bit.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "rig/ik_tree.h"
#include "rig/program.h"
#include "rig/spline_path.h"
#include "sinew/rig_program.h"

namespace sinew::rig {

/// Where a point of a B-bone's rest shape is: between segment + 0 and + 1.
struct Place {
  int segment = 0;
  float fraction = 0;
};

/// What is kept of a bone's channels.
struct KeptChannels {
  Mat4 matrix;
  bool is_known = false;
  bool is_identity = false;
  std::array<float, kPoseBend> values = {};  ///< from which it was computed
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

/// A spline as a path.
struct KeptPath {
  std::uint32_t pass = 0;                   ///< in which it was last right
  std::vector<std::array<Vec3, 3>> points;  ///< from which it was built, as its radii
  std::vector<float> radii;
  SplinePath path;
};

/// A tree that is being solved.
struct TreeWork {
  const std::vector<IkPlan>* plans = nullptr;
  int root = 0;          ///< only plans that begin there count
  std::size_t next = 0;  ///< plan
  bool is_solving = false;
  IkTree settings;
  IkTreeSolver solver;
  std::vector<Mat4> poses;
};

/// A number that the caller gives, as the property holds it.
struct GivenNumber {
  int value;
  float number;
};

/// Measures how long each part of an evaluation takes.
class PartClock {
 public:
  std::array<double, kRigPartCount> seconds{};

  void enter(RigPart part) {
    if (part == part_) return;
    const auto now = std::chrono::steady_clock::now();
    seconds[static_cast<int>(part_)] += std::chrono::duration<double>(now - since_).count();
    part_ = part;
    since_ = now;
  }

 private:
  RigPart part_ = RigPart::curves;
  std::chrono::steady_clock::time_point since_ = std::chrono::steady_clock::now();
};

struct State {
  explicit State(const Program& program);

  /// Says where the armature object is.
  void put(const Mat4& place);

  float frame = 0;
  std::uint32_t pass = 0;          ///< counts evaluations
  int undefined_driver = -1;       ///< the first driver that divided by 0 in this frame
  std::vector<float> base;         ///< the numbers before curves and drivers
  std::vector<float> values;       ///< those that nothing sets are as in `base` between evaluations, too
  std::vector<GivenNumber> given;  ///< replace what curves set
  std::vector<Mat4> outside;       ///< world matrices from outside
  std::vector<char> is_given;      ///< of those: objects do not replace them
  Mat4 world;                      ///< the armature object's
  Mat4 inverse_world;
  bool is_at_origin = true;  ///< that is the identity
  std::vector<Mat4> poses;   ///< of each bone, in armature space
  std::vector<Vec3> tails;
  std::vector<Mat4> segments;  ///< of each B-bone, relative to its pose
  std::vector<float> variables;
  MixedStrips mixed;

  // Of each bone, while `pass` is that of this evaluation.
  struct Lazy {
    std::uint32_t channel = 0;
    std::uint32_t inverse = 0;
    std::uint32_t local = 0;
    std::uint32_t local_sizes = 0;
  };
  std::vector<Lazy> lazy;
  std::vector<Mat4> channels;  ///< pose relative to rest
  std::vector<Mat4> parents;   ///< of a plain bone: parent's pose * offset
  std::vector<Mat4> parent_inverses;
  std::vector<Mat4> locals;
  std::vector<Vec3> local_sizes;

  std::vector<KeptChannels> kept_channels;
  std::vector<RestShape> rest_shapes;
  std::vector<Binding> bindings;
  std::vector<std::uint32_t> posed_in;  ///< of the bones of trees: the pass in which a solver has last begun with it
  std::vector<TreeWork> tree_work;      ///< of trees that are solved at the same time
  std::vector<IkTreeSolver*> ik_solvers;
  std::vector<DampedLeastSquares*> ik_systems;

  std::vector<KeptPath> paths;  ///< of each spline
  std::vector<std::array<Vec3, 3>> spline_points;
  std::vector<float> spline_radii;

  PartClock* clock = nullptr;
  void enter(RigPart part) const {
    if (clock) clock->enter(part);
  }
};

/// States between evaluations: as many as have been used at the same time.
class States {
 public:
  std::unique_ptr<State> borrow(const Program& program);
  void give_back(std::unique_ptr<State> state);

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<State>> idle_;
};

/// Computes a frame from state.base, state.outside and the program. has_segments: also those segments that are only
/// shown.
void evaluate(const Program& program, State& state, float frame, bool has_segments);

}  // namespace sinew::rig
