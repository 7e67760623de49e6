#include "sinew/mixed_layers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "each_instruction_set.h"
#include "failures.h"
#include "rigs.h"
#include "sinew/deformer.h"

namespace sinew {
namespace {

using Floats = std::vector<float>;
using Layers = std::vector<std::shared_ptr<const Layer>>;

Floats random_numbers(rigs::Random& random, std::ptrdiff_t count) {
  Floats numbers;
  for (std::ptrdiff_t i = 0; i < count; ++i) numbers.push_back(static_cast<float>(rigs::uniform(random, 0, 1)));
  return numbers;
}

/// One bone of three segments along z, which all vertices follow.
std::shared_ptr<const Bends> bends_of(std::ptrdiff_t vertices) {
  std::vector<std::int64_t> all, offsets{0};
  for (std::int64_t v = 0; v < vertices; ++v) {
    all.push_back(v);
    offsets.push_back(v + 1);
  }
  const std::vector<std::int32_t> bones(vertices, 0), first{0}, segments{3};
  const std::vector<double> axes{0, 0, 0.5, 0.5};
  return std::make_shared<Bends>(all, offsets, bones, Floats(vertices, 1), first, segments, axes);
}

/// Three layers of nine joints: a linear one with a mask, one of dual quaternions in a space of its own, and one with
/// bends.
struct Mixing {
  explicit Mixing(std::ptrdiff_t vertices) : random(31) {
    const auto skin = std::make_shared<const Skin>(rigs::coherent_skin(random, vertices, 9, 3));
    const Floats mask = random_numbers(random, vertices), share = random_numbers(random, vertices);
    layers = {std::make_shared<Layer>(skin, SkinningMethod::linear, StretchRule{}, mask),
              std::make_shared<Layer>(skin, SkinningMethod::dual_quaternion, StretchRule{}, std::nullopt, share),
              std::make_shared<Layer>(skin, SkinningMethod::linear, StretchRule{}, mask, share, bends_of(vertices))};
    for (int i = 0; i < 3; ++i) {
      stacks.push_back(std::make_unique<rigs::Stack<float>>(rigs::through_float(rigs::random_pose(random, 9)), 1));
      poses.push_back({stacks.back()->read()});
    }
    poses[1].mesh_from_armature = rigs::turn(40, {1, 2, 3}, {0.3, -0.2, 0.1});
    input = random_numbers(random, 3 * vertices);
  }

  /// By a deformer that gets the input as its rest positions.
  Floats expected(const Layers& own) const {
    Floats positions(input.size());
    Deformer(own).deform(std::span(poses).first(own.size()), positions, {}, input);
    return positions;
  }

  Floats applied(const Layers& own) const {
    Floats positions = input;
    MixedLayers(own).apply({std::span(poses).first(own.size())}, positions);
    return positions;
  }

  rigs::Random random;
  Layers layers;
  std::vector<std::unique_ptr<rigs::Stack<float>>> stacks;
  std::vector<LayerPose> poses;
  Floats input;
};

class MixedLayersOnEachInstructionSet : public OnEachInstructionSet {};

INSTANTIATE_TEST_SUITE_P(Kernels, MixedLayersOnEachInstructionSet, each_instruction_set(), set_name);

TEST_P(MixedLayersOnEachInstructionSet, SkinInPlaceWhatTheyGet) {
  for (const std::ptrdiff_t vertices : {1, 17, 4097, 9001}) {
    const Mixing mixing(vertices);
    EXPECT_EQ(mixing.applied({mixing.layers[0]}), mixing.expected({mixing.layers[0]}));
    EXPECT_EQ(mixing.applied(mixing.layers), mixing.expected(mixing.layers));
  }
}

TEST(MixedLayers, AnyNumberOfThreadsGivesTheSameBits) {
  const ThreadsOfATest threads_of_a_test;
  const Mixing mixing(30001);
  set_thread_count(1);
  const Floats one = mixing.applied(mixing.layers);
  for (const int threads : {2, 8}) {
    set_thread_count(threads);
    EXPECT_EQ(mixing.applied(mixing.layers), one) << threads << " threads";
  }
}

TEST(MixedLayers, LeaveAloneWhatNothingMoves) {
  // Influences in the middle alone, of a mesh of several tiles; in a space that shears, points are carried there and
  // back.
  const std::ptrdiff_t vertices = 20000;
  std::vector<std::int64_t> offsets;
  for (std::int64_t v = 0; v <= vertices; ++v) offsets.push_back(std::clamp<std::int64_t>(v - 9000, 0, 100));
  rigs::Random random(5);
  const Floats rest = random_numbers(random, 3 * vertices);
  const auto skin = std::make_shared<const Skin>(rest, offsets, std::vector<std::int32_t>(100, 1), Floats(100, 1), 2);
  rigs::Stack<float> stack({rigs::identities(1)[0], rigs::turn(90, {0, 0, 1}, {3, 4, 5})}, 1);
  LayerPose pose{stack.read(), rigs::turn(40, {1, 2, 3}, {0.3, -0.2, 0.1})};
  pose.mesh_from_armature->col(1) *= 1.4;
  const MixedLayers layers({std::make_shared<Layer>(skin, SkinningMethod::dual_quaternion)});
  Floats positions = rest, expected(rest.size());
  layers.apply({{&pose, 1}}, positions);
  Deformer(layers.layers()).deform({&pose, 1}, expected, {}, rest);
  for (std::size_t v = 0; v < rest.size() / 3; ++v) {
    const bool is_in_its_tile = v >= 8192 && v < 12288, is_moved = v >= 9000 && v < 9100;
    for (std::size_t i = 3 * v; i < 3 * v + 3; ++i) {
      ASSERT_NEAR(positions[i], expected[i], 1e-6) << v;
      ASSERT_NEAR(positions[i], rest[i], is_moved ? 100 : is_in_its_tile ? 1e-6 : 0) << v;
    }
  }
  EXPECT_GT(std::abs(positions[3 * 9050] - rest[3 * 9050]), 0.1);
}

TEST(MixedLayers, FollowTheDeformerAndEachOther) {
  const Mixing mixing(5000);
  const MixedLayers first({mixing.layers[0]}), second({mixing.layers[0], mixing.layers[1]});
  const std::span<const LayerPose> poses(mixing.poses);
  const std::vector<Stage> stages{Staged<MixedLayers>{&first, {poses.first(1)}},
                                  Staged<MixedLayers>{&second, {poses.first(2)}}};
  const Deformer deformer({mixing.layers[0]});
  Floats positions(mixing.input.size()), expected = mixing.expected({mixing.layers[0]});
  std::vector<double> milliseconds(3, -1);
  deformer.deform(poses.first(1), positions, {}, mixing.input, stages, milliseconds);
  first.apply({poses.first(1)}, expected);
  second.apply({poses.first(2)}, expected);
  EXPECT_EQ(positions, expected);
  EXPECT_GT(milliseconds[2], 0);
}

TEST(MixedLayers, OfNoVertices) {
  const auto skin =
      std::make_shared<const Skin>(Floats{}, std::vector<std::int64_t>{0}, std::vector<std::int32_t>{}, Floats{}, 9);
  const Mixing mixing(1);
  const LayerPose& pose = mixing.poses[0];
  Floats none;
  MixedLayers({std::make_shared<Layer>(skin, SkinningMethod::linear)}).apply({{&pose, 1}}, none);
  EXPECT_EQ(none, Floats{});
}

TEST(MixedLayers, RefuseWhatDoesNotFit) {
  const Mixing mixing(10), other(11);
  EXPECT_EQ(complaint([] { MixedLayers({}); }), "there are no layers; expected at least one");
  EXPECT_EQ(complaint([&] { MixedLayers({mixing.layers[1]}); }),
            "layer 0 has a share; there is nothing that it could be mixed with");
  EXPECT_EQ(complaint([&] {
              MixedLayers({mixing.layers[0], mixing.layers[0]});
            }),
            "layer 1 has no share; only the first has none");
  EXPECT_EQ(complaint([&] {
              MixedLayers({mixing.layers[0], other.layers[1]});
            }),
            "layer 1 has 11 vertices; layer 0 has 10");
  const MixedLayers layers(mixing.layers);
  const std::span<const LayerPose> poses(mixing.poses);
  Floats positions(30, 7);
  EXPECT_EQ(complaint([&] { layers.apply({poses.first(2)}, positions); }), "there are 2 poses; the stage has 3 layers");
  EXPECT_EQ(complaint([&] { layers.apply({poses}, std::span(positions).first(27)); }),
            "positions has 27 numbers; expected 30 (10 x 3)");
  const std::vector<Stage> stages{Staged<MixedLayers>{&layers}};
  EXPECT_EQ(complaint([&] { Deformer(std::ptrdiff_t{10}).deform({}, positions, {}, mixing.input, stages); }),
            "stage 0: there are 0 poses; the stage has 3 layers");
  EXPECT_EQ(positions, Floats(30, 7));
}

}  // namespace
}  // namespace sinew
