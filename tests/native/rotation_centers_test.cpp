#include "sinew/rotation_centers.h"

#include <gtest/gtest.h>

#include <limits>

#include "each_instruction_set.h"
#include "failures.h"
#include "skinned.h"

namespace sinew {
namespace {

using Floats = std::vector<float>;
using Integers = std::vector<std::int32_t>;
using rigs::Matrices;
using rigs::skinned;

/// FacesOfMesh as the library takes them and as the oracle does.
struct FacesOfMesh {
  Integers offsets{0}, vertices;
  std::vector<Integers> lists;

  void add(const Integers& corners) {
    vertices.insert(vertices.end(), corners.begin(), corners.end());
    offsets.push_back(static_cast<std::int32_t>(vertices.size()));
    lists.push_back(corners);
  }
};

struct Mesh {
  Skin skin;
  FacesOfMesh faces;
};

/// Rings around the x axis from -1 to 1, of quads, and a polygon at either end. Joints follow each other
/// along it, each reaching to its neighbours; `overlap`: how far, in joints.
Mesh tube(int rings, int sides, std::int32_t joints, double overlap, double size = 1) {
  Floats points, weights;
  Integers influences;
  std::vector<std::int64_t> offsets{0};
  for (int ring = 0; ring < rings; ++ring) {
    const double along = static_cast<double>(ring) / (rings - 1);
    for (int side = 0; side < sides; ++side) {
      const double angle = 2 * std::numbers::pi * (side + 0.3 * ring) / sides;
      const double radius = 0.3 + 0.1 * std::sin(3 * along);
      for (const double x : {2 * along - 1, radius * std::cos(angle), radius * std::sin(angle)}) {
        points.push_back(static_cast<float>(size * x));
      }
      double sum = 0;
      const std::size_t first = weights.size();
      for (std::int32_t j = 0; j < joints; ++j) {
        const double apart = std::abs(along * (joints - 1) - j) + 0.1 * std::sin(angle);
        if (apart >= overlap) continue;
        influences.push_back(j);
        weights.push_back(static_cast<float>(overlap - apart));
        sum += weights.back();
      }
      for (std::size_t i = first; i < weights.size(); ++i) weights[i] = static_cast<float>(weights[i] / sum);
      offsets.push_back(std::ssize(weights));
    }
  }
  Mesh mesh{Skin(points, offsets, influences, weights, joints), {}};
  Integers head, tail;
  for (int side = 0; side < sides; ++side) {
    head.push_back(side);
    tail.push_back((rings - 1) * sides + side);
    for (int ring = 0; ring + 1 < rings; ++ring) {
      const int a = ring * sides + side, b = ring * sides + (side + 1) % sides;
      mesh.faces.add({a, b, b + sides, a + sides});
    }
  }
  mesh.faces.add(head);
  mesh.faces.add(tail);
  return mesh;
}

std::shared_ptr<const RotationCenters> computed(const Mesh& mesh, double sigma = 0.1, Progress* progress = nullptr) {
  return RotationCenters::compute(mesh.skin, mesh.faces.offsets, mesh.faces.vertices, sigma, progress);
}

/// One triangle from (0, 0, 0) over (3, 0, 0) to (0, 3, 0), and vertices besides.
struct OneTriangle {
  FacesOfMesh faces;
  Floats points{0, 0, 0, 3, 0, 0, 0, 3, 0}, weights;
  std::vector<std::int64_t> offsets{0};
  Integers joints;

  OneTriangle() { faces.add({0, 1, 2}); }
  void add_influences(const Integers& own, const Floats& own_weights) {
    joints.insert(joints.end(), own.begin(), own.end());
    weights.insert(weights.end(), own_weights.begin(), own_weights.end());
    offsets.push_back(std::ssize(joints));
    points.resize(std::max(points.size(), 3 * (offsets.size() - 1)), 9);
  }
  Mesh mesh() const { return {Skin(points, offsets, joints, weights, 4), faces}; }
};

TEST(RotationCenters, AreTheMeanOfTheTriangleThatIsLikeTheVertex) {
  OneTriangle one;
  for (int corner = 0; corner < 3; ++corner) one.add_influences({0, 1}, {0.5f, 0.5f});
  one.add_influences({1, 0}, {0.5f, 0.5f});             // in another order
  one.add_influences({0, 1, 2}, {0.25f, 0.25f, 0.5f});  // shares two of three
  one.add_influences({0, 1, 0}, {0.25f, 0.5f, 0.25f});  // a joint twice
  one.add_influences({0}, {1});                         // one joint
  one.add_influences({0, 2}, {0.5f, 0.5f});             // no two joints in common
  one.add_influences({}, {});                           // nothing moves it
  one.add_influences({0, 1}, {1.5f, -0.5f});            // below 0 is 0: one joint
  const auto centers = computed(one.mesh());
  EXPECT_EQ(centers->count(), 6);
  for (int v = 0; v < 10; ++v) {
    ASSERT_EQ(centers->has_center(v), v < 6) << v;
    if (v >= 6) continue;
    EXPECT_NEAR(centers->centers()[3 * v], 1, 1e-6) << v;
    EXPECT_NEAR(centers->centers()[3 * v + 1], 1, 1e-6) << v;
    EXPECT_NEAR(centers->centers()[3 * v + 2], 0, 1e-6) << v;
  }
}

TEST(RotationCenters, AreThoseOfTheFormulaOverAllPairs) {
  for (const auto& mesh : {tube(40, 9, 2, 1), tube(30, 12, 5, 2.2), tube(12, 7, 12, 20)}) {
    for (const double sigma : {0.03, 0.1, 0.5}) {
      const Eigen::MatrixX3d expected = reference::rotation_centers(mesh.skin, mesh.faces.lists, sigma);
      const auto centers = computed(mesh, sigma);
      double most = 0;
      for (std::ptrdiff_t v = 0; v < mesh.skin.vertex_count(); ++v) {
        ASSERT_EQ(centers->has_center(v), !std::isnan(expected(v, 0))) << v;
        if (!centers->has_center(v)) continue;
        most = std::max(most, (rigs::points_of(*centers).row(v) - expected.row(v)).cwiseAbs().maxCoeff());
      }
      EXPECT_LT(most, 1e-3) << sigma;
    }
  }
}

TEST(RotationCenters, OfATubeAreNearItsAxis) {
  const Mesh mesh = tube(60, 16, 3, 1.2);
  const auto centers = computed(mesh);
  EXPECT_GT(centers->count(), 500);
  for (std::ptrdiff_t v = 0; v < centers->vertex_count(); ++v) {
    if (!centers->has_center(v)) continue;
    EXPECT_LT(std::hypot(centers->centers()[3 * v + 1], centers->centers()[3 * v + 2]), 0.2) << v;
  }
}

TEST(RotationCenters, GrowWithTheMesh) {
  const Eigen::MatrixX3d one = rigs::points_of(*computed(tube(20, 8, 3, 2)));
  for (const double size : {1e-6, 1e-3, 1e3, 1e6}) {
    const Eigen::MatrixX3d other = rigs::points_of(*computed(tube(20, 8, 3, 2, size)));
    EXPECT_LT((other / size - one).cwiseAbs().maxCoeff(), 1e-6) << size;
  }
}

TEST(RotationCenters, NeedASurface) {
  Mesh mesh = tube(10, 6, 3, 2);
  mesh.faces = {};
  EXPECT_EQ(computed(mesh)->count(), 0);
  mesh.faces.offsets.clear();
  EXPECT_EQ(computed(mesh)->count(), 0);
  mesh.faces.offsets = {0};
  mesh.faces.add({0, 0, 0});
  mesh.faces.add({1, 2, 1});
  EXPECT_EQ(computed(mesh)->count(), 0);
  const Mesh empty{Skin(Floats{}, std::vector<std::int64_t>{0}, {}, {}, 2), {}};
  EXPECT_EQ(computed(empty)->vertex_count(), 0);
}

TEST(RotationCenters, AnyNumberOfThreadsGivesTheSameBits) {
  const ThreadsOfATest threads_of_a_test;
  const Mesh mesh = tube(100, 10, 4, 2);
  set_thread_count(1);
  const auto one = computed(mesh);
  for (const int threads : {2, 3, 8}) {
    set_thread_count(threads);
    const auto other = computed(mesh);
    EXPECT_EQ(std::memcmp(other->centers().data(), one->centers().data(), one->centers().size_bytes()), 0);
  }
}

TEST(RotationCenters, GivenBackAreTheSame) {
  const auto centers = computed(tube(10, 6, 3, 1));
  Floats numbers;
  std::vector<std::uint8_t> has_center;
  for (std::ptrdiff_t v = 0; v < centers->vertex_count(); ++v) {
    has_center.push_back(centers->has_center(v));
    for (int axis = 0; axis < 3; ++axis) numbers.push_back(has_center.back() ? centers->centers()[3 * v + axis] : 7);
  }
  const RotationCenters again(numbers, has_center);
  EXPECT_EQ(again.count(), centers->count());
  EXPECT_EQ(std::memcmp(again.centers().data(), centers->centers().data(), centers->centers().size_bytes()), 0);
}

TEST(RotationCenters, ProgressRunsFrom0To1) {
  Progress progress;
  EXPECT_EQ(progress.fraction(), 0);
  computed(tube(20, 8, 3, 2), 0.1, &progress);
  EXPECT_EQ(progress.fraction(), 1);
}

TEST(RotationCenters, EndWhenTheyAreCancelled) {
  const ThreadsOfATest threads_of_a_test;
  const Mesh mesh = tube(40, 10, 4, 2);
  for (const int threads : {1, 4}) {
    set_thread_count(threads);
    Progress progress;
    progress.cancel();
    EXPECT_EQ(computed(mesh, 0.1, &progress), nullptr);
  }
}

TEST(RotationCenters, RefuseWhatDoesNotFit) {
  const Mesh mesh = tube(4, 5, 2, 1);
  const auto said = [&](const Integers& offsets, const Integers& vertices, double sigma = 0.1) {
    return complaint([&] { RotationCenters::compute(mesh.skin, offsets, vertices, sigma); });
  };
  EXPECT_EQ(said({0, 3}, {0, 1, 20}), "face_vertices names vertex 20; the mesh has 20 vertices");
  EXPECT_EQ(said({0, 3}, {0, 1, -1}), "face_vertices names vertex -1; the mesh has 20 vertices");
  EXPECT_EQ(said({0, 4}, {0, 1, 2}), "face_offsets goes from 0 to 4; expected 0 to 3, the number of corners");
  EXPECT_EQ(said({0, 2, 5}, {0, 1, 2, 3, 4}), "face 0 has 2 corners; expected three at least");
  EXPECT_EQ(said({0, 3}, {0, 1, 2}, 0), "sigma is 0; expected a number above 0");
  EXPECT_EQ(said({0, 3}, {0, 1, 2}, std::numeric_limits<double>::quiet_NaN()),
            "sigma is nan; expected a number above 0");
  EXPECT_EQ(said({0, 3}, {0, 1, 2}, std::numeric_limits<double>::infinity()),
            "sigma is inf; expected a number above 0");
  const auto made = [](const Floats& centers, const std::vector<std::uint8_t>& has_center) {
    return complaint([&] { RotationCenters(centers, has_center); });
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(made({1, 2, 3, 4, nan, 6}, {1, 1}), "the center of vertex 1 is not finite");
  EXPECT_EQ(made({1, 2, 3, 4, nan, 6}, {1, 0}), "(no complaint)");
  EXPECT_EQ(made({1, 2, 3, 4, 5}, {1, 1}), "centers has 5 numbers; expected 6, three a vertex of has_center");
}

/// Joints near each other, but for every `wild`th; every `scaled`th is larger than the others. 0: none is.
Matrices pose_of(rigs::Random& random, std::int32_t joints, int wild, int scaled) {
  Matrices pose;
  for (std::int32_t j = 0; j < joints; ++j) {
    const double most = wild > 0 && j % wild == 0 ? 180 : 60;
    pose.push_back(rigs::turn(rigs::uniform(random, -most, most), rigs::vector(random, 1), rigs::vector(random, 1)));
    if (scaled > 0 && j % scaled == 0) pose.back().topLeftCorner<3, 3>() *= 1.5;
  }
  return rigs::through_float(pose);
}

class RotationCenterSkinning : public OnEachInstructionSet {};

INSTANTIATE_TEST_SUITE_P(Kernels, RotationCenterSkinning, each_instruction_set(), set_name);

TEST_P(RotationCenterSkinning, EqualsTheReference) {
  rigs::Random random(1);
  const auto expect_reference = [](const Skin& skin, const Matrices& pose, double tolerance) {
    const Eigen::MatrixX3d centers = rigs::points_of(rigs::random_centers(skin));
    EXPECT_LT(rigs::distance(skinned(rigs::skin_about_centers, skin, pose),
                             reference::skin_rotation_centers(skin, pose, centers)),
              tolerance * rigs::kDiagonal)
        << skin.vertex_count() << " vertices";
  };
  for (const std::ptrdiff_t vertices : {1, 15, 16, 17, 100, 5000}) {
    for (const std::int32_t influences : {1, 3, 8, 14}) {
      expect_reference(rigs::coherent_skin(random, vertices, 20, influences), pose_of(random, 20, 0, 0), 1e-6);
    }
    expect_reference(rigs::coherent_skin(random, vertices, 20, 3), pose_of(random, 20, 0, 3), 1e-6);
    expect_reference(rigs::random_skin(random, vertices, 40), pose_of(random, 40, 0, 0), 1e-6);
  }
  expect_reference(rigs::coherent_skin(random, 300, 20, 3), pose_of(random, 20, 2, 0), 2e-5);
}

TEST_P(RotationCenterSkinning, WithoutCentersItIsLinearToTheBit) {
  rigs::Random random(2);
  for (const int wild : {0, 2}) {
    for (const Skin& skin : {rigs::coherent_skin(random, 5000, 20, 3), rigs::random_skin(random, 500, 20)}) {
      const Matrices pose = pose_of(random, 20, wild, wild);
      const Floats linear = skinned(skin_linear, skin, pose), own = skinned(rigs::skin_about_centers, skin, pose);
      const RotationCenters centers = rigs::random_centers(skin);
      for (std::ptrdiff_t v = 0; v < skin.vertex_count(); ++v) {
        if (centers.has_center(v)) continue;
        for (std::ptrdiff_t i = 3 * v; i < 3 * v + 3; ++i) EXPECT_EQ(own[i], linear[i]) << "vertex " << v;
      }
    }
  }
}

TEST_P(RotationCenterSkinning, OfARigidMeshIsLinear) {
  rigs::Random random(3);
  const Skin skin = rigs::coherent_skin(random, 1000, 20, 1);
  const Matrices pose = pose_of(random, 20, 2, 3);
  const Floats linear = skinned(skin_linear, skin, pose), own = skinned(rigs::skin_about_centers, skin, pose);
  for (std::size_t i = 0; i < own.size(); ++i) EXPECT_NEAR(own[i], linear[i], 5e-6);
}

TEST_P(RotationCenterSkinning, ACharacterMayBeScaledAsAWhole) {
  rigs::Random random(4);
  const Skin skin = rigs::coherent_skin(random, 1000, 20, 3);
  Matrices larger(20, rigs::turn(30, {1, 2, 3}, {1, 0, 0}));
  for (auto& matrix : larger) matrix.topLeftCorner<3, 3>() *= 3;
  const Floats linear = skinned(skin_linear, skin, larger), own = skinned(rigs::skin_about_centers, skin, larger);
  for (std::size_t i = 0; i < own.size(); ++i) EXPECT_NEAR(own[i], linear[i], 5e-6);
}

TEST(RotationCenters, KeepTheRadiusOfATwistedTube) {
  // Linear blending draws the middle of a tube into its axis that is twisted by half a turn.
  const Mesh mesh = tube(41, 16, 2, 1);
  const auto centers = computed(mesh);
  rigs::Stack<float> pose({rigs::identities(1)[0], rigs::turn(179, {1, 0, 0})}, 1);
  Floats linear(3 * mesh.skin.vertex_count()), own(linear.size());
  skin_linear(mesh.skin, pose.read(), linear);
  skin_rotation_centers(mesh.skin, *centers, pose.read(), own);
  const auto radius = [](const Floats& points, int v) { return std::hypot(points[3 * v + 1], points[3 * v + 2]); };
  const auto rest = mesh.skin.rest_positions();
  for (int v = 20 * 16; v < 21 * 16; ++v) {
    EXPECT_LT(radius(linear, v), 0.1) << v;
    EXPECT_NEAR(radius(own, v), radius(Floats(rest.begin(), rest.end()), v), 0.1) << v;
  }
}

}  // namespace
}  // namespace sinew
