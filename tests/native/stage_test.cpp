#include "sinew/stage.h"

#include <gtest/gtest.h>

#include <limits>
#include <numeric>

#include "failures.h"
#include "meshes.h"
#include "sinew/deformer.h"
#include "skinned.h"

namespace sinew {
namespace {

using meshes::Floats;

/// A mesh with something of each kind behind its skin.
struct Staging {
  explicit Staging(std::uint32_t seed) {
    rigs::Random random(seed);
    mesh = meshes::sheet(random, 70, 80);
    skin = std::make_shared<Skin>(rigs::random_skin(random, mesh.vertices, 5));
    pose = rigs::through_float(rigs::random_pose(random, 5));
    smooth.emplace(mesh.topology());
    corrective.emplace(mesh.topology(), skin->rest_positions());
    named.resize(mesh.vertices / 3);
    std::iota(named.begin(), named.end(), 0);
    hook.emplace(mesh.vertices, named);
    hooked.matrix = rigs::random_rigid(random).cast<float>();
    stages = {Staged<Hook>{&*hook, hooked}, Staged<CorrectiveSmooth>{&*corrective, {0.4f, 3}},
              Staged<Smooth>{&*smooth, {0.3f, 2}}, Staged<Hook>{&*hook, hooked}};
  }

  Deformer deformer() const { return Deformer({std::make_shared<Layer>(skin, SkinningMethod::linear)}); }

  /// One after the other, on what the deformer alone makes.
  Floats expected() const {
    Floats positions = deformed({});
    hook->apply(hooked, positions);
    corrective->apply({0.4f, 3}, positions);
    smooth->apply({0.3f, 2}, positions);
    hook->apply(hooked, positions);
    return positions;
  }

  Floats deformed(std::span<const Stage> wanted) const {
    rigs::Stack<float> stack(pose, 1);
    const LayerPose layer{stack.read()};
    Floats positions(3 * mesh.vertices);
    deformer().deform({&layer, 1}, positions, {}, {}, wanted);
    return positions;
  }

  meshes::Mesh mesh;
  std::shared_ptr<const Skin> skin;
  rigs::Matrices pose;
  std::optional<Smooth> smooth;
  std::optional<CorrectiveSmooth> corrective;
  std::vector<std::int32_t> named;
  std::optional<Hook> hook;
  Hook::Settings hooked;
  std::vector<Stage> stages;
};

TEST(Stages, WorkInTheirOrderOnTheDeformersResult) {
  const Staging staging(1);
  EXPECT_EQ(staging.deformed(staging.stages), staging.expected());
  auto other = staging.stages;
  std::swap(other[1], other[2]);
  EXPECT_NE(staging.deformed(other), staging.expected());
}

TEST(Stages, AnyNumberOfThreadsMakesTheSame) {
  const ThreadsOfATest threads_of_a_test;
  const Staging staging(2);
  set_thread_count(1);
  const Floats expected = staging.deformed(staging.stages);
  for (const int threads : {2, 8}) {
    set_thread_count(threads);
    EXPECT_EQ(staging.deformed(staging.stages), expected);
  }
}

TEST(Stages, NeedNoSkin) {
  const Staging staging(3);
  const Deformer alone(staging.mesh.vertices);
  EXPECT_EQ(alone.vertex_count(), staging.mesh.vertices);
  const Floats rest = staging.deformed({});
  Floats positions(rest.size());
  alone.deform({}, positions, {}, rest, staging.stages);
  EXPECT_EQ(positions, staging.expected());
  EXPECT_EQ(complaint([&] { alone.deform({}, positions); }),
            "there are no layers and no shape keys; expected rest_positions");
  Floats none;
  Deformer(std::ptrdiff_t{0}).deform({}, none);
  EXPECT_EQ(complaint([] { Deformer(std::ptrdiff_t{-1}); }), "vertex_count is -1; expected 0 to 536,870,912");
}

TEST(Stages, SayWhatTheyTook) {
  const Staging staging(4);
  const Floats rest = staging.deformed({});
  Floats positions(rest.size());
  std::vector<double> milliseconds(5, -1);
  Deformer(staging.mesh.vertices).deform({}, positions, {}, rest, staging.stages, milliseconds);
  for (const double one : milliseconds) EXPECT_GE(one, 0);
  EXPECT_GT(milliseconds[2], 0);
  milliseconds.resize(4);
  EXPECT_EQ(
      complaint([&] { Deformer(staging.mesh.vertices).deform({}, positions, {}, rest, staging.stages, milliseconds); }),
      "milliseconds has 4 numbers; expected 5, one more than there are stages");
}

TEST(Stages, WriteNothingIfOneIsWrong) {
  Staging staging(5);
  const Floats rest = staging.deformed({});
  const Deformer alone(staging.mesh.vertices);
  Floats positions(rest.size(), 7);
  const auto said = [&](const Stage& stage) {
    const std::vector<Stage> stages{staging.stages[0], stage};
    return complaint([&] { alone.deform({}, positions, {}, rest, stages); });
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(said(Staged<Smooth>{&*staging.smooth, {nan}}), "stage 1: factor is nan; expected a finite number");
  const Hook small(3, std::nullopt);
  EXPECT_EQ(said(Staged<Hook>{&small}), "stage 1 has 3 vertices; the deformer has " +
                                            std::to_string(staging.mesh.vertices / 1000) + "," +
                                            std::to_string(staging.mesh.vertices % 1000));
  const CorrectiveSmooth restless(staging.mesh.topology(), {});
  EXPECT_EQ(said(Staged<CorrectiveSmooth>{&restless}),
            "stage 1: there are no rest positions; pass some, or only_smooth");
  EXPECT_EQ(positions, Floats(rest.size(), 7));
}

}  // namespace
}  // namespace sinew
