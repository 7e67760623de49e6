#include "sinew/bends.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "each_instruction_set.h"
#include "failures.h"
#include "rigs.h"
#include "sinew/deformer.h"
#include "skinned.h"

namespace sinew {
namespace {

using Floats = std::vector<float>;
using Points = Eigen::MatrixX3d;
using Rows = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;
using Space = std::optional<Matrix4<double>>;

constexpr double kSize = 2 * std::numbers::sqrt3;  // of the box in which the points are
constexpr std::int32_t kJoints = 11;

/// Two ordinary bones, and two of four and three segments, shorter than the box is wide: many
/// points lie beyond an end. A third of the vertices has no bone with segments.
struct Rig {
  std::vector<std::int64_t> vertices, offsets{0};
  std::vector<std::int32_t> bones, first_joints{0, 1, 6, 10}, segments{1, 4, 3, 1};
  Floats weights;
  std::vector<double> axes;
  Floats rest;
  std::vector<std::vector<std::pair<std::int32_t, float>>> whole;  // of each vertex

  Rig(rigs::Random& random, std::ptrdiff_t count) {
    for (int b = 0; b < 4; ++b) {
      const Matrix4<double> inverse = rigs::random_rigid(random, 0.5).inverse();
      for (int i = 0; i < 4; ++i) axes.push_back(inverse(1, i) / 0.7);
    }
    const std::vector<std::vector<std::int32_t>> kinds{{0, 3}, {1, 0}, {3, 2, 1}};
    for (std::ptrdiff_t v = 0; v < count; ++v) {
      for (int i = 0; i < 3; ++i) rest.push_back(static_cast<float>(rigs::uniform(random, -1, 1)));
      whole.emplace_back();
      double left = 1;
      for (const std::int32_t bone : kinds[v % 3]) {
        const double weight = bone == kinds[v % 3].back() ? left : left * rigs::uniform(random, 0, 1);
        whole.back().emplace_back(bone, static_cast<float>(weight));
        left -= weight;
      }
      if (v % 3 == 0) continue;
      vertices.push_back(v);
      for (const auto& [bone, weight] : whole.back()) {
        bones.push_back(bone);
        weights.push_back(weight);
      }
      offsets.push_back(std::ssize(bones));
    }
  }

  std::shared_ptr<const Bends> bends() const {
    return std::make_shared<Bends>(vertices, offsets, bones, weights, first_joints, segments, axes);
  }

  /// The influences as they are at these points, for a mesh that is at rest.
  std::shared_ptr<const Skin> split_at(const Floats& points, const Space& space) const {
    const Matrix4<double> back = space ? Matrix4<double>(space->inverse()) : Matrix4<double>::Identity();
    std::vector<std::int64_t> own_offsets{0};
    std::vector<std::int32_t> joints;
    Floats own_weights;
    for (std::size_t v = 0; v < whole.size(); ++v) {
      const Eigen::Vector4d point = back * Eigen::Vector4d(points[3 * v], points[3 * v + 1], points[3 * v + 2], 1);
      for (const auto& [bone, weight] : whole[v]) {
        const int n = segments[bone];
        const double share = Eigen::Map<const Eigen::Vector4d>(&axes[4 * bone]).dot(point);
        const double place = std::fmin(std::fmax(share, 0), 1) * n;
        const int index = n == 1 ? 0 : std::min(n - 1, static_cast<int>(place));
        const double blend = n == 1 ? 0 : place - index;
        for (const int end : {0, 1}) {
          const double part = weight * (end == 0 ? 1 - blend : blend);
          if (part == 0) continue;
          joints.push_back(first_joints[bone] + index + end);
          own_weights.push_back(static_cast<float>(part));
        }
      }
      own_offsets.push_back(std::ssize(joints));
    }
    return std::make_shared<Skin>(rest, own_offsets, joints, own_weights, kJoints);
  }
};

/// Motions near each other, scaled along the axes of the rest frames unless there are none.
struct Motion {
  rigs::Matrices frames;
  std::unique_ptr<rigs::Stack<float>> stack;

  Motion(rigs::Random& random, bool scaled) {
    rigs::Matrices pose;
    for (int j = 0; j < kJoints; ++j) {
      pose.push_back(rigs::turn(rigs::uniform(random, -60, 60), rigs::vector(random, 1), rigs::vector(random, 0.5)));
      if (!scaled) continue;
      frames.push_back(rigs::random_rigid(random));
      Matrix4<double> scale = Matrix4<double>::Identity();
      scale.diagonal() << 1.1, 0.8 + 0.03 * j, 0.95, 1;
      pose.back() = pose.back() * frames.back() * scale * frames.back().inverse();
    }
    stack = std::make_unique<rigs::Stack<float>>(pose, 1);
  }
};

struct How {
  SkinningMethod method;
  Stretch stretch;
  bool scaled;
};

const How kHows[] = {{SkinningMethod::linear, Stretch::polar, false},
                     {SkinningMethod::dual_quaternion, Stretch::polar, false},
                     {SkinningMethod::dual_quaternion, Stretch::frame, true},
                     {SkinningMethod::dual_quaternion, Stretch::frame_each, true},
                     {SkinningMethod::blended, Stretch::frame, true},
                     {SkinningMethod::rotation_centers, Stretch::polar, false}};

/// One layer, made and posed.
struct Character {
  How how;
  Motion motion;
  Floats mask;

  std::shared_ptr<const Layer> layer(std::shared_ptr<const Skin> skin, std::shared_ptr<const Bends> bends = nullptr,
                                     const Space& split_space = std::nullopt) const {
    const StretchRule rule{how.stretch, motion.frames};
    const auto data = rigs::data_of(how.method, *skin);
    return std::make_shared<Layer>(std::move(skin), how.method, rule,
                                   mask.empty() ? std::nullopt : std::optional<std::span<const float>>(mask),
                                   std::nullopt, std::move(bends), split_space, data);
  }

  Floats deformed(std::shared_ptr<const Layer> layer, const Space& space,
                  std::shared_ptr<const ShapeKeys> keys = nullptr, const Floats& values = {},
                  const Floats& rest = {}) const {
    const Deformer deformer({std::move(layer)}, std::move(keys));
    Floats positions(3 * deformer.vertex_count());
    const LayerPose pose{motion.stack->read(), space};
    deformer.deform({&pose, 1}, positions, values, rest);
    return positions;
  }
};

double distance(const Floats& a, const Floats& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_TRUE(std::isfinite(a[i]) && std::isfinite(b[i]));
    most = std::max<double>(most, std::abs(a[i] - b[i]));
  }
  return most;
}

Floats random_points(rigs::Random& random, std::size_t numbers) {
  Floats points;
  for (std::size_t i = 0; i < numbers; ++i) {
    points.push_back(static_cast<float>(rigs::uniform(random, -1, 1)));
  }
  return points;
}

/// The base, and a key that moves vertices 1000 to 5499.
std::shared_ptr<const ShapeKeys> keys_on(const Floats& base) {
  Floats moved = base;
  for (std::size_t i = 3000; i < std::min<std::size_t>(moved.size(), 16500); ++i) moved[i] += 0.4f;
  const std::vector<std::span<const float>> positions{base, moved};
  return std::make_shared<ShapeKeys>(positions, std::vector<std::int64_t>{0, 0});
}

class BendsOnEachInstructionSet : public OnEachInstructionSet {};

INSTANTIATE_TEST_SUITE_P(Kernels, BendsOnEachInstructionSet, each_instruction_set(), set_name);

TEST_P(BendsOnEachInstructionSet, FollowOtherRestPositionsInEverySpace) {
  rigs::Random random(1);
  for (const std::ptrdiff_t count : {5, 9001}) {
    const Rig rig(random, count);
    for (const How& how : kHows) {
      const Character character{how, Motion(random, how.scaled), {}};
      for (const Space& space : {Space{}, Space(rigs::similarity()), Space(rigs::sheared())}) {
        const Floats points = random_points(random, rig.rest.size());
        const auto own = character.layer(rig.split_at(rig.rest, space), rig.bends(), space);
        const auto other = character.layer(rig.split_at(points, space));
        EXPECT_LT(distance(character.deformed(own, space, nullptr, {}, points),
                           character.deformed(other, space, nullptr, {}, points)),
                  1e-6 * kSize);
      }
    }
  }
}

TEST_P(BendsOnEachInstructionSet, FollowAnotherSpace) {
  rigs::Random random(2);
  const Rig rig(random, 9001);
  for (const How& how : kHows) {
    const Character character{how, Motion(random, how.scaled), {}};
    const auto layer = character.layer(rig.split_at(rig.rest, {}), rig.bends());
    for (const Space& space : {Space(rigs::similarity()), Space(rigs::sheared())}) {
      const auto other = character.layer(rig.split_at(rig.rest, space));
      EXPECT_LT(distance(character.deformed(layer, space), character.deformed(other, space)), 1e-6 * kSize);
      // And back to none.
      const auto back = character.layer(rig.split_at(rig.rest, space), rig.bends(), space);
      EXPECT_LT(distance(character.deformed(back, {}), character.deformed(layer, {})), 1e-6 * kSize);
    }
  }
}

TEST_P(BendsOnEachInstructionSet, FollowShapeKeysAndLeaveTheRestToTheBit) {
  rigs::Random random(3);
  const Rig rig(random, 9001);
  const auto keys = keys_on(rig.rest);
  const Floats values{0, 0.75f};
  for (const How& how : kHows) {
    Character character{how, Motion(random, how.scaled), {}};
    for (float& number : character.mask = random_points(random, 9001)) number = std::abs(number);
    for (const Space& space : {Space{}, Space(rigs::similarity()), Space(rigs::sheared())}) {
      Floats points(rig.rest.size());
      Deformer({}, keys).deform({}, points, values);
      const auto skin = rig.split_at(rig.rest, space);
      const auto layer = character.layer(skin, rig.bends(), space);
      const auto plain = character.layer(skin), split = character.layer(rig.split_at(points, space));
      const Floats own = character.deformed(layer, space, keys, values);
      EXPECT_LT(distance(own, character.deformed(split, space, keys, values)), 1e-6 * kSize);
      const Floats as_before = character.deformed(plain, space, keys, values);
      EXPECT_GT(distance(own, as_before), 0.01);
      for (std::size_t i = 0; i < own.size(); ++i) {
        const std::size_t v = i / 3;
        if (v % 3 != 0 && v >= 1000 && v < 5500) continue;
        ASSERT_EQ(own[i], as_before[i]) << "vertex " << v;
      }
      for (const Floats& still : {Floats{}, Floats{1, 0}}) {
        EXPECT_EQ(character.deformed(layer, space, keys, still), character.deformed(plain, space, keys, still));
      }
    }
  }
}

TEST(Bends, AreSharedByTheEndsOfASegment) {
  // A bone of four segments along Y, from 0 to 2, and an ordinary one.
  const std::vector<double> axes{0, 0.5, 0, 0, 0, 1, 0, 0};
  const Bends bends(std::vector<std::int64_t>{7}, std::vector<std::int64_t>{0, 3}, std::vector<std::int32_t>{1, 0, 0},
                    Floats{0.25f, 0.75f, 0}, std::vector<std::int32_t>{3, 5}, std::vector<std::int32_t>{4, 1}, axes);
  EXPECT_EQ(bends.joint_count(), 8);
  EXPECT_EQ(bends.influence_count(), 3);
  using Joints = std::vector<std::int32_t>;
  const auto expect = [&](double y, const Joints& joints, const Floats& weights) {
    Bends::Split split;
    bends.split(0, {9, y, -9}, split);
    EXPECT_EQ(split.joints, joints) << y;
    EXPECT_EQ(split.weights, weights) << y;
  };
  expect(-1, {5, 3}, {0.25f, 0.75f});
  expect(0, {5, 3}, {0.25f, 0.75f});
  expect(0.125, {5, 3, 4}, {0.25f, 0.5625f, 0.1875f});
  expect(0.5, {5, 4}, {0.25f, 0.75f});
  expect(1.75, {5, 6, 7}, {0.25f, 0.375f, 0.375f});
  expect(2, {5, 7}, {0.25f, 0.75f});
  expect(1e300, {5, 7}, {0.25f, 0.75f});
  expect(std::numeric_limits<double>::quiet_NaN(), {5, 7}, {0.25f, 0.75f});
}

TEST(Bends, AnyNumberOfThreadsGivesTheSameBits) {
  const ThreadsOfATest threads_of_a_test;
  rigs::Random random(4);
  const Rig rig(random, 30001);
  const auto keys = keys_on(rig.rest);
  for (const How& how : kHows) {
    const Character character{how, Motion(random, how.scaled), {}};
    const auto layer = character.layer(rig.split_at(rig.rest, {}), rig.bends());
    for (const Space& space : {Space{}, Space(rigs::sheared())}) {
      set_thread_count(1);
      const Floats one = character.deformed(layer, space, keys, {0, 1});
      for (const int threads : {2, 3, 8}) {
        set_thread_count(threads);
        EXPECT_EQ(character.deformed(layer, space, keys, {0, 1}), one) << threads << " threads";
      }
    }
  }
}

TEST(Bends, AVertexWithoutWeightStaysWhereItIs) {
  const auto bends = std::make_shared<Bends>(std::vector<std::int64_t>{0}, std::vector<std::int64_t>{0, 1},
                                             std::vector<std::int32_t>{0}, Floats{0}, std::vector<std::int32_t>{0},
                                             std::vector<std::int32_t>{2}, std::vector<double>{0, 1, 0, 0});
  const auto skin =
      std::make_shared<Skin>(Floats(3), std::vector<std::int64_t>{0, 0}, std::vector<std::int32_t>{}, Floats{}, 3);
  const rigs::Matrices pose(3, rigs::turn(50, {1, 0, 0}, {1, 2, 3}));
  rigs::Stack<float> stack(pose, 1);
  for (const auto method : {SkinningMethod::linear, SkinningMethod::dual_quaternion}) {
    const Deformer deformer({std::make_shared<Layer>(skin, method, StretchRule{}, std::nullopt, std::nullopt, bends)});
    const LayerPose posed{stack.read()};
    Floats positions(3);
    deformer.deform({&posed, 1}, positions, {}, Floats{1, 2, 3});
    EXPECT_EQ(positions, (Floats{1, 2, 3}));
  }
}

TEST(Bends, RefuseWhatDoesNotFit) {
  struct Given {
    std::vector<std::int64_t> vertices{1, 4}, offsets{0, 1, 3};
    std::vector<std::int32_t> bones{0, 1, 0}, first_joints{0, 3}, segments{2, 1};
    Floats weights{1, 0.5f, 0.5f};
    std::vector<double> axes = std::vector<double>(8);

    Bends made() const { return {vertices, offsets, bones, weights, first_joints, segments, axes}; }
  };
  const auto said = [](auto change) {
    Given given;
    change(given);
    return complaint([&] { given.made(); });
  };
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(said([](Given&) {}), "(no complaint)");
  EXPECT_EQ(said([](Given& g) { g.vertices[0] = -1; }), "entry 0 of vertices is -1; expected 0 or more");
  EXPECT_EQ(said([](Given& g) { g.vertices[1] = 1; }), "vertices does not increase at entry 1");
  EXPECT_EQ(said([](Given& g) { g.offsets.pop_back(); }),
            "offsets has 2 entries; expected 3, one more than there are vertices");
  EXPECT_EQ(said([](Given& g) { g.offsets[2] = 4; }),
            "offsets goes from 0 to 4; expected 0 to 3, the number of influences");
  EXPECT_EQ(said([](Given& g) { g.offsets[1] = 5; }), "offsets[2] is 3, below the one before");
  EXPECT_EQ(said([](Given& g) { g.bones.pop_back(); }),
            "bones has 2 entries and weights has 3; expected as many of each");
  EXPECT_EQ(said([](Given& g) { g.bones[1] = 2; }), "influence 1 names bone 2; there are 2 bones");
  EXPECT_EQ(said([](Given& g) { g.bones[2] = -1; }), "influence 2 names bone -1; there are 2 bones");
  EXPECT_EQ(said([](Given& g) { g.weights[1] = static_cast<float>(kInfinity); }),
            "the weight of influence 1 is not finite");
  EXPECT_EQ(said([](Given& g) { g.segments.pop_back(); }),
            "first_joints has 2 entries and segments has 1; expected as many of each");
  EXPECT_EQ(said([](Given& g) { g.axes.pop_back(); }), "axes has 7 numbers; expected four for each of 2 bones");
  EXPECT_EQ(said([](Given& g) { g.first_joints[1] = -1; }),
            "the first joint of bone 1 is -1; expected 0 to 16,777,215");
  EXPECT_EQ(said([](Given& g) { g.segments[1] = 0; }), "bone 1 has 0 segments; expected 1 to 16,777,215");
  EXPECT_EQ(said([](Given& g) { g.axes[5] = kInfinity; }), "the axis of bone 1 is not finite");

  const auto said_of_layer = [](std::ptrdiff_t vertices, std::int32_t joints) {
    const auto skin = std::make_shared<Skin>(Floats(3 * vertices), std::vector<std::int64_t>(vertices + 1),
                                             std::vector<std::int32_t>{}, Floats{}, joints);
    const auto bends = std::make_shared<Bends>(Given{}.made());
    return complaint([&] { Layer(skin, SkinningMethod::linear, {}, std::nullopt, std::nullopt, bends); });
  };
  EXPECT_EQ(said_of_layer(5, 4), "(no complaint)");
  EXPECT_EQ(said_of_layer(4, 4), "bends names vertex 4; the skin has 4 vertices");
  EXPECT_EQ(said_of_layer(5, 3), "bends names joint 3; the skin has 3 joints");
}

}  // namespace
}  // namespace sinew
