#include "sinew/corrective_smooth.h"

#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <thread>

#include "failures.h"
#include "meshes.h"
#include "sinew/instruction_set.h"

namespace sinew {
namespace {

using meshes::Floats;
using Settings = CorrectiveSmooth::Settings;

constexpr SmoothType kSimple = SmoothType::simple, kLength = SmoothType::length_weighted;

/// A bumpy sheet at rest and bent, near each other as a character's shapes are.
struct Sheet {
  explicit Sheet(std::uint32_t seed, std::int32_t rows = 17, std::int32_t columns = 23) {
    rigs::Random random(seed);
    mesh = meshes::sheet(random, rows, columns);
    topology = mesh.topology();
    rest = meshes::random_positions(random, mesh.vertices);
    const Floats moves = meshes::random_positions(random, mesh.vertices);
    for (std::size_t i = 0; i < rest.size(); ++i) shape.push_back(rest[i] + 0.3f * moves[i]);
    weights = meshes::some_weights(random, mesh.vertices);
    ones.assign(mesh.vertices, 1.0f);
  }

  meshes::Mesh mesh;
  std::shared_ptr<const Topology> topology;
  Floats rest, shape, weights, ones;
};

Floats applied(const CorrectiveSmooth& smooth, const Settings& settings, Floats shape) {
  smooth.apply(settings, shape);
  return shape;
}

TEST(CorrectiveSmooth, IsTheSlowFormula) {
  const Sheet sheet(1);
  Floats inverted;
  for (const float weight : sheet.weights) inverted.push_back(1 - weight);
  const std::pair<VertexGroup, Floats> groups[] = {
      {{}, sheet.ones}, {{sheet.weights}, sheet.weights}, {{sheet.weights, true}, inverted}};
  for (const auto& [group, effective] : groups) {
    for (const bool pin : {false, true}) {
      const Floats weights = pin ? meshes::pinned(sheet.mesh, effective) : effective;
      for (const CornerAngle angle : {CornerAngle::polynomial, CornerAngle::arc_cosine}) {
        const CorrectiveSmooth smooth(sheet.topology, sheet.rest, group, pin, angle);
        EXPECT_EQ(smooth.vertex_count(), sheet.mesh.vertices);
        for (const Settings& settings :
             {Settings{}, Settings{0.3f, 2, 0.4f, kLength}, Settings{1.2f, 1, -1}, Settings{-0.2f, 3, 1, kLength}}) {
          const auto expected = meshes::corrected(sheet.mesh, meshes::points_of(sheet.rest),
                                                  meshes::points_of(sheet.shape), weights, settings);
          const double error = meshes::largest_difference(applied(smooth, settings, sheet.shape), expected);
          EXPECT_LT(error, angle == CornerAngle::polynomial ? 5e-5 : 5e-6);
        }
      }
    }
  }
}

TEST(CorrectiveSmooth, OnlySmooths) {
  const Sheet sheet(2);
  const CorrectiveSmooth smooth(sheet.topology, {}, {sheet.weights});
  for (const SmoothType type : {kSimple, kLength}) {
    const Settings settings{0.5f, 6, 1, type, true};
    const auto expected = meshes::smoothed(sheet.mesh, meshes::points_of(sheet.shape), sheet.weights, settings);
    EXPECT_LT(meshes::largest_difference(applied(smooth, settings, sheet.shape), expected), 2e-6);
  }
}

TEST(CorrectiveSmooth, RestAndARigidMotionOfItAreKept) {
  rigs::Random random(3);
  // What has no face loses its detail, so this mesh has faces everywhere.
  meshes::Mesh mesh;
  mesh.vertices = 400;
  for (std::int32_t v = 0; v < 380; ++v) {
    if (v % 20 != 19) mesh.add_face({v, v + 1, v + 21, v + 20});
  }
  const Floats rest = meshes::random_positions(random, 400);
  const CorrectiveSmooth smooth(mesh.topology(), rest);
  const Matrix4<double> motion = rigs::random_rigid(random);
  Floats moved;
  for (const auto& point : meshes::points_of(rest)) {
    const Eigen::Vector3f there = (motion * point.homogeneous()).head<3>().cast<float>();
    moved.insert(moved.end(), there.data(), there.data() + 3);
  }
  for (const SmoothType type : {kSimple, kLength}) {
    for (const Floats& shape : {rest, moved}) {
      const Floats own = applied(smooth, {0.5f, 5, 1, type}, shape);
      EXPECT_LT(meshes::largest_difference(own, meshes::points_of(shape)), 5e-6);
    }
  }
}

TEST(CorrectiveSmooth, AStraightCornerSaysNothing) {
  // A quad with a vertex in the middle of one side, flat: that vertex has a straight corner alone.
  meshes::Mesh mesh;
  mesh.vertices = 5;
  mesh.add_face({0, 1, 2, 3, 4});
  const Floats rest{0, 0, 0, 1, 0, 0, 2, 0, 0, 2, 2, 0, 0, 2, 0};
  Floats weights(5);
  weights[1] = 1;
  const CorrectiveSmooth smooth(mesh.topology(), rest, {weights});
  Floats shape = rest;
  shape[3] = 0.5f;
  EXPECT_EQ(applied(smooth, {0.5f, 1}, shape)[3], 0.75f);  // smoothed, and no more
  shape[4] = -1;  // bent: it counts, with what was lost in the space of the mesh
  const auto expected = meshes::corrected(mesh, meshes::points_of(rest), meshes::points_of(shape), weights, {0.5f, 1});
  EXPECT_LT(meshes::largest_difference(applied(smooth, {0.5f, 1}, shape), expected), 1e-6);
}

/// The cosine of face 0, 1, 2 at vertex 1, in float32; 0 if that corner counts as straight.
float cosine_at_1(const Floats& shape) {
  using Vector = Eigen::Map<const Eigen::Vector3f>;
  const auto direction = [](const Eigen::Vector3f& v) {
    const float length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    return Eigen::Vector3f(v * (1 / length));
  };
  const Eigen::Vector3f in = direction(Vector(&shape[0]) - Vector(&shape[3]));
  const Eigen::Vector3f out = direction(Vector(&shape[3]) - Vector(&shape[6]));
  if ((in - out).cwiseAbs().maxCoeff() <= 1.1920929e-6f) return 0;
  return out[0] * in[0] + out[1] * in[1] + out[2] * in[2];
}

/// Where the cosine of a corner is rounded to more than 1, its arc cosine is NaN, and Blender only
/// smooths the vertex before 4.1.
TEST(CorrectiveSmooth, ACosineOfMoreThanOneWasNoAngle) {
  meshes::Mesh mesh;
  mesh.vertices = 6;
  mesh.add_face({0, 1, 2});
  mesh.add_face({3, 1, 4});
  mesh.edges.insert(mesh.edges.end(), {1, 5});  // keeps vertex 1 where it is
  const Floats weights{0, 1, 0, 0, 0, 0};
  rigs::Random random(5);
  int seen = 0;
  for (int i = 0; i < 1000; ++i) {
    // Almost straight in the first face, by a little more than counts as straight.
    const Eigen::Vector3f way = rigs::vector(random, 1).cast<float>();
    const Eigen::Vector3f aside = rigs::vector(random, 3e-6 * way.norm()).cast<float>();
    const Eigen::Vector3f a = rigs::vector(random, 1).cast<float>();
    const Eigen::Vector3f b = rigs::vector(random, 1).cast<float>();
    Floats shape;
    for (const Eigen::Vector3f& point : {Eigen::Vector3f(-way), Eigen::Vector3f(0, 0, 0), Eigen::Vector3f(way + aside),
                                         a, b, Eigen::Vector3f(-a - b)}) {
      shape.insert(shape.end(), point.data(), point.data() + 3);
    }
    const Floats rest = meshes::random_positions(random, 6);
    const auto corrected = [&](CornerAngle angle, bool only_smooth) {
      const CorrectiveSmooth smooth(mesh.topology(), rest, {weights}, false, angle);
      return applied(smooth, {0.5f, 1, 1, kSimple, only_smooth}, shape);
    };
    const Floats smooth = corrected(CornerAngle::arc_cosine, true);
    if (!(cosine_at_1(smooth) > 1)) continue;
    ++seen;
    EXPECT_EQ(corrected(CornerAngle::arc_cosine, false), smooth);
    EXPECT_NE(corrected(CornerAngle::polynomial, false), smooth);
  }
  EXPECT_GT(seen, 10);
}

TEST(CorrectiveSmooth, WhatHasNoWeightStaysToTheBit) {
  const Sheet sheet(6);
  const Floats own = applied({sheet.topology, sheet.rest, {sheet.weights}}, {}, sheet.shape);
  int moved = 0;
  for (std::int32_t v = 0; v < sheet.mesh.vertices; ++v) {
    const bool same = std::equal(&own[3 * v], &own[3 * v] + 3, &sheet.shape[3 * v]);
    moved += !same;
    EXPECT_TRUE(same || sheet.weights[v] != 0) << v;
  }
  EXPECT_GT(moved, sheet.mesh.vertices / 2);
}

/// Which vertices are worked on, and where they stand in blocks, makes no difference to any bit.
TEST(CorrectiveSmooth, AVertexDoesNotDependOnThoseWithoutWeight) {
  const Sheet sheet(7);
  Floats almost_none = sheet.weights;
  for (float& weight : almost_none) weight = weight == 0 ? 1e-30f : weight;
  for (const SmoothType type : {kSimple, kLength}) {
    const Settings settings{0.5f, 4, 1, type};
    EXPECT_EQ(applied({sheet.topology, sheet.rest, {sheet.weights}}, settings, sheet.shape),
              applied({sheet.topology, sheet.rest, {almost_none}}, settings, sheet.shape));
  }
}

TEST(CorrectiveSmooth, AnyNumberOfThreadsAndInstructionsMakesTheSame) {
  const ThreadsOfATest threads_of_a_test;
  const Sheet sheet(8, 60, 70);
  for (const CornerAngle angle : {CornerAngle::polynomial, CornerAngle::arc_cosine}) {
    for (const SmoothType type : {kSimple, kLength}) {
      const Settings settings{0.5f, 3, 1, type};
      set_thread_count(1);
      const Floats expected = applied({sheet.topology, sheet.rest, {}, true, angle}, settings, sheet.shape);
      for (const std::string& set : instruction_sets()) {
        set_instruction_set(set);
        for (const int threads : {1, 2, 8}) {
          set_thread_count(threads);
          const CorrectiveSmooth smooth(sheet.topology, sheet.rest, {}, true, angle);
          EXPECT_EQ(applied(smooth, settings, sheet.shape), expected) << set << ", " << threads;
        }
      }
      set_instruction_set("auto");
    }
  }
}

TEST(CorrectiveSmooth, SettingsMayChangeFromFrameToFrame) {
  const Sheet sheet(9);
  const CorrectiveSmooth kept(sheet.topology, sheet.rest);
  for (const Settings& settings :
       {Settings{}, Settings{0.3f}, Settings{0.3f, 4}, Settings{0.3f, 4, 2}, Settings{0.3f, 4, 2, kLength}, Settings{},
        Settings{0.5f, 5, 1, kSimple, true}, Settings{0.3f}}) {
    EXPECT_EQ(applied(kept, settings, sheet.shape), applied({sheet.topology, sheet.rest}, settings, sheet.shape));
  }
}

TEST(CorrectiveSmooth, TakesAnotherRestShape) {
  const Sheet sheet(10);
  CorrectiveSmooth smooth(sheet.topology, sheet.rest);
  const Floats before = applied(smooth, {}, sheet.shape);
  Floats other = sheet.rest;
  other[3 * 50] += 0.5f;
  smooth.set_rest_positions(other);
  const Floats after = applied(smooth, {}, sheet.shape);
  EXPECT_NE(after, before);
  EXPECT_EQ(after, applied({sheet.topology, other}, {}, sheet.shape));
}

/// With settings of their own, each of which needs the rest shape's losses anew. (What the thread
/// sanitizer looks at.)
TEST(CorrectiveSmooth, SeveralThreadsMayUseOneAtOnce) {
  const ThreadsOfATest threads_of_a_test;
  const Sheet sheet(11);
  const CorrectiveSmooth smooth(sheet.topology, sheet.rest);
  std::vector<Floats> expected;
  for (int k = 1; k <= 4; ++k) {
    expected.push_back(applied({sheet.topology, sheet.rest}, {0.2f * k}, sheet.shape));
  }
  std::vector<std::thread> threads;
  std::atomic<int> wrong = 0;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (int frame = 0; frame < 12; ++frame) {
        const int k = 1 + (t + frame / 3) % 4;
        wrong += applied(smooth, {0.2f * k}, sheet.shape) != expected[k - 1];
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

TEST(CorrectiveSmooth, LeavesAloneWhatItDoesNotMove) {
  const Sheet sheet(12);
  const CorrectiveSmooth smooth(sheet.topology, sheet.rest);
  for (const Settings& settings : {Settings{0}, Settings{1, 0}, Settings{1, -3}}) {
    EXPECT_EQ(applied(smooth, settings, sheet.shape), sheet.shape);
  }
  const auto none = std::make_shared<Topology>(0, std::span<const std::int32_t>{});
  EXPECT_EQ(applied({none, {}}, {0.5f, 5, 1, kSimple, true}, {}), Floats());
  EXPECT_EQ(applied({none, {}}, {}, {}), Floats());
}

TEST(CorrectiveSmooth, WithoutFacesOnlySmooths) {
  const std::vector<std::int32_t> edges{0, 1, 1, 2};
  const auto topology = std::make_shared<Topology>(4, edges);
  const Floats rest(12), shape{0, 0, 0, 1, 1, 0, 2, 0, 0, 5, 5, 5};
  const Floats own = applied({topology, rest}, {0.5f, 1}, shape);
  EXPECT_EQ(own, (Floats{0.5f, 0.5f, 0, 1, 0.5f, 0, 1.5f, 0.5f, 0, 5, 5, 5}));
}

TEST(CorrectiveSmooth, RefusesWhatIsWrong) {
  const auto topology = std::make_shared<Topology>(3, std::span<const std::int32_t>{});
  const Floats rest(9), two(2);
  Floats bad = rest, positions(9);
  bad[4] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(complaint([&] { CorrectiveSmooth(topology, two); }), "rest_positions has 2 numbers; expected 9 (3 x 3)");
  EXPECT_EQ(complaint([&] { CorrectiveSmooth(topology, bad); }), "rest_positions is not finite at vertex 1");
  EXPECT_EQ(complaint([&] { CorrectiveSmooth(topology, rest, {two}); }),
            "weights has 2 numbers; the mesh has 3 vertices");
  EXPECT_EQ(complaint([&] { CorrectiveSmooth(topology, {}).apply({}, positions); }),
            "there are no rest positions; pass some, or only_smooth");
  const CorrectiveSmooth smooth(topology, rest);
  EXPECT_EQ(complaint([&] { smooth.apply({bad[4]}, positions); }), "factor is nan; expected a finite number");
  EXPECT_EQ(complaint([&] { smooth.apply({1, 1, bad[4]}, positions); }), "scale is nan; expected a finite number");
  positions.pop_back();
  EXPECT_EQ(complaint([&] { smooth.apply({}, positions); }), "positions has 8 numbers; expected 9 (3 x 3)");
}

}  // namespace
}  // namespace sinew
