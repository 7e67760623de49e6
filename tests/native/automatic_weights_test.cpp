#include "sinew/automatic_weights.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <random>

#include "failures.h"
#include "sinew/threads.h"
#include "weights/heat.h"
#include "weights/outward.h"
#include "weights/panel_solver.h"

namespace sinew {
namespace {

/// Triangles in the caller's form.
struct TestMesh {
  std::vector<double> positions;
  std::vector<std::int32_t> offsets{0}, corners;

  void add_face(std::initializer_list<std::int32_t> face) {
    corners.insert(corners.end(), face);
    offsets.push_back(static_cast<std::int32_t>(corners.size()));
  }
  std::size_t vertex_count() const { return positions.size() / 3; }
};

/// A closed tube along x from 0 to `length`.
TestMesh tube(int around = 12, int along = 24, double radius = 0.3, double length = 4) {
  TestMesh mesh;
  for (int i = 0; i < along; ++i) {
    for (int j = 0; j < around; ++j) {
      const double angle = 2 * std::numbers::pi * j / around;
      mesh.positions.insert(mesh.positions.end(),
                            {length * i / (along - 1), radius * std::cos(angle), radius * std::sin(angle)});
    }
  }
  mesh.positions.insert(mesh.positions.end(), {0, 0, 0, length, 0, 0});
  for (int j = 0; j < around; ++j) {
    const int k = (j + 1) % around, last = (along - 1) * around;
    for (int i = 0; i + 1 < along; ++i) {
      mesh.add_face({i * around + j, i * around + k, (i + 1) * around + k, (i + 1) * around + j});
    }
    mesh.add_face({k, j, along * around});
    mesh.add_face({last + j, last + k, along * around + 1});
  }
  return mesh;
}

const std::vector<double> kHeads{0, 0, 0, 2, 0, 0}, kTails{2, 0, 0, 4, 0, 0};

WeldedMesh welded(const TestMesh& mesh) {
  return weld(UnitFrame(mesh.positions), mesh.positions, {mesh.offsets, mesh.corners});
}

std::vector<Segment> unit_bones(const TestMesh& mesh) {
  const UnitFrame frame(mesh.positions);
  return {{frame(&kHeads[0]), frame(&kTails[0])}, {frame(&kHeads[3]), frame(&kTails[3])}};
}

double cotangent(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::clamp(a.dot(b) / a.cross(b).norm(), 0.0, 20.0);
}

/// The weights of all places by the formula, P x J, with a dense matrix.
Eigen::MatrixXd dense_heat(const WeldedMesh& mesh, const NearestBones& nearest, double stiffness, int joints) {
  const auto count = std::ssize(mesh.points);
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(count, count);
  Eigen::VectorXd areas = Eigen::VectorXd::Zero(count);
  for (const auto& triangle : mesh.triangles) {
    for (int i = 0; i < 3; ++i) {
      const auto at = triangle[i], from = triangle[(i + 1) % 3], to = triangle[(i + 2) % 3];
      const Eigen::Vector3d a = mesh.points[from] - mesh.points[at], b = mesh.points[to] - mesh.points[at];
      areas[at] += a.cross(b).norm() / 6;
      const double half = cotangent(a, b) / 2;
      matrix(from, from) += half;
      matrix(to, to) += half;
      matrix(from, to) -= half;
      matrix(to, from) -= half;
    }
  }
  Eigen::MatrixXd sources = Eigen::MatrixXd::Zero(count, joints);
  for (std::ptrdiff_t p = 0; p < count; ++p) {
    const double heat = areas[p] * stiffness / (nearest.distances[p] * nearest.distances[p]);
    matrix(p, p) += heat;
    for (auto i = nearest.begin[p]; i < nearest.begin[p + 1]; ++i)
      sources(p, nearest.bones[i]) += heat * nearest.shares[i];
  }
  return matrix.ldlt().solve(sources);
}

struct Heated {
  WeldedMesh mesh;
  NearestBones nearest;
  FixedPlaces fixed;

  explicit Heated(const TestMesh& source) : mesh(welded(source)) {
    const TriangleTree tree(mesh.points, mesh.triangles);
    VoxelSolid solid(mesh.points, mesh.triangles, tree, 64, nullptr);
    const auto bones = unit_bones(source);
    const std::vector<std::int32_t> joints{0, 1};
    const BoneDistances distances(solid, {mesh.points, mesh.triangles, tree}, bones, joints, nullptr);
    nearest = distances.nearest(places_of(mesh, std::vector<std::uint8_t>(mesh.patch_count())), 0.25, nullptr, 0);
    fixed.row_of.assign(mesh.points.size(), -1);
  }
  Eigen::MatrixXd solve() const {
    const std::vector<std::int32_t> joints{0, 1};
    const std::vector<std::uint8_t> has_heat(mesh.points.size(), 1);
    Eigen::MatrixXd result = Eigen::MatrixXd::Zero(std::ssize(mesh.points), 2);
    const Lists<BoneWeight> rows =
        heat_on_surface(mesh.points, mesh.triangles, has_heat, {nearest, joints, 2}, fixed, {8, 0}, nullptr, 0);
    for (std::size_t p = 0; p < rows.size(); ++p) {
      for (const auto& [joint, weight] : rows[p]) result(static_cast<Eigen::Index>(p), joint) = weight;
    }
    return result;
  }
};

TEST(AutomaticWeights, HeatOnTheSurfaceIsWhatTheFormulaSays) {
  TestMesh mesh = tube();
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 0.02);
  for (double& number : mesh.positions) number += noise(random);
  const Heated heated(mesh);
  const Eigen::MatrixXd expected = dense_heat(heated.mesh, heated.nearest, 8, 2), found = heated.solve();
  EXPECT_LT((found - expected).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT((expected.rowwise().sum().array() - 1).abs().maxCoeff(), 1e-9);
}

TEST(AutomaticWeights, FixedPlacesAreConditionsOfTheSolve) {
  Heated heated(tube());
  // What was found before, given for some places, changes nothing for the others.
  const Eigen::MatrixXd free = heated.solve();
  std::vector<std::size_t> others;
  for (std::size_t p = 0; p < heated.mesh.points.size(); ++p) {
    if (p % 5 != 0) {
      others.push_back(p);
      continue;
    }
    heated.fixed.row_of[p] = static_cast<std::int32_t>(heated.fixed.rows.vertices());
    heated.fixed.rows.add_row(
        std::array{BoneWeight{0, static_cast<float>(free(p, 0))}, BoneWeight{1, static_cast<float>(free(p, 1))}});
  }
  const Eigen::MatrixXd given = heated.solve();
  for (const std::size_t p : others) EXPECT_NEAR(given(p, 0), free(p, 0), 1e-6);
  // Other values do, and the maximum principle still holds.
  for (BoneWeight& own : heated.fixed.rows.entries()) own.weight = 1 - own.weight;
  const Eigen::MatrixXd changed = heated.solve();
  double most = 0;
  for (const std::size_t p : others) {
    most = std::max(most, std::abs(changed(p, 0) - free(p, 0)));
    EXPECT_NEAR(changed.row(p).sum(), 1, 1e-6);
    EXPECT_GE(changed.row(p).minCoeff(), 0);
  }
  EXPECT_GT(most, 0.3);
}

TEST(AutomaticWeights, PanelSolverLeavesOutOnlyWhatIsNegligible) {
  // A long chain with a source at one end, whose solution falls by a factor at each step.
  constexpr int kCount = 400;
  std::vector<Eigen::Triplet<double>> entries;
  for (int i = 0; i < kCount; ++i) {
    entries.emplace_back(i, i, 2.1);
    if (i > 0) entries.emplace_back(i, i - 1, -1);
  }
  Eigen::SparseMatrix<double> lower(kCount, kCount);
  lower.setFromTriplets(entries.begin(), entries.end());
  const Eigen::MatrixXd half(lower), dense = half.selfadjointView<Eigen::Lower>();
  const PanelSolver solver(lower);
  for (const double negligible : {0.0, 1e-3}) {
    PanelSolver::Scratch scratch;
    scratch.values.assign(kCount, Lanes::Zero());
    Eigen::MatrixXd sources = Eigen::MatrixXd::Zero(kCount, kLanes);
    for (int lane = 0; lane < 3; ++lane) {
      sources(lane, lane) = 1;
      scratch.values[solver.position(lane)][lane] = 1;
    }
    solver.solve(scratch, negligible);
    const Eigen::MatrixXd expected = dense.llt().solve(sources);
    int skipped = 0;
    for (int i = 0; i < kCount; ++i) {
      const Eigen::VectorXd own = scratch.values[solver.position(i)].matrix();
      skipped += own.isZero(0);
      EXPECT_LE((own.transpose() - expected.row(i)).cwiseAbs().maxCoeff(), std::max(negligible, 1e-12)) << i;
    }
    EXPECT_EQ(skipped > kCount / 2, negligible > 0);
  }
}

TEST(AutomaticWeights, WindingNumbersAreSumsOfSolidAngles) {
  TestMesh source = tube();
  source.offsets.resize(source.offsets.size() - 9);  // with a hole
  source.corners.resize(source.offsets.back());
  const WeldedMesh mesh = welded(source);
  const TriangleTree tree(mesh.points, mesh.triangles);
  std::mt19937 random(2);
  std::uniform_real_distribution<double> anywhere(-0.6, 0.6);
  double errors = 0;
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d point(anywhere(random), anywhere(random) / 4, anywhere(random) / 4);
    double expected = 0;
    for (const auto& triangle : mesh.triangles) {
      const Eigen::Vector3d a = mesh.points[triangle[0]] - point, b = mesh.points[triangle[1]] - point,
                            c = mesh.points[triangle[2]] - point;
      expected += 2 * std::atan2(a.dot(b.cross(c)), a.norm() * b.norm() * c.norm() + a.dot(b) * c.norm() +
                                                        b.dot(c) * a.norm() + c.dot(a) * b.norm());
    }
    const double error = std::abs(tree.winding_number(point) - expected / (4 * std::numbers::pi));
    EXPECT_LT(error, 0.03);
    errors += error;
  }
  EXPECT_LT(errors / 300, 0.004);
}

TEST(AutomaticWeights, ClosestPointsAreThoseOfAllTriangles) {
  const WeldedMesh mesh = welded(tube());
  const TriangleTree tree(mesh.points, mesh.triangles);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> anywhere(-0.6, 0.6);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d point(anywhere(random), anywhere(random), anywhere(random));
    const SurfacePoint found = tree.closest(point);
    Eigen::Vector3d at = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k) at += found.shares[k] * mesh.points[mesh.triangles[found.triangle][k]];
    EXPECT_NEAR(found.shares.sum(), 1, 1e-12);
    EXPECT_GE(found.shares.minCoeff(), 0);
    EXPECT_NEAR((at - point).squaredNorm(), found.squared_distance, 1e-12);
    // No point of a fine sample of any triangle is closer.
    double closest = 1e9;
    for (const auto& triangle : mesh.triangles) {
      for (int u = 0; u <= 8; ++u) {
        for (int v = 0; u + v <= 8; ++v) {
          const Eigen::Vector3d sample =
              (u * mesh.points[triangle[0]] + v * mesh.points[triangle[1]] + (8 - u - v) * mesh.points[triangle[2]]) /
              8;
          closest = std::min(closest, (sample - point).norm());
        }
      }
    }
    EXPECT_LE(std::sqrt(found.squared_distance), closest + 1e-12);
    EXPECT_GE(std::sqrt(found.squared_distance), closest - 0.01);
    EXPECT_EQ(tree.closest(point, found.squared_distance * 0.99).triangle, 0xffffffffu);
  }
}

TEST(AutomaticWeights, TheSolidIsTheInside) {
  for (const bool flip : {false, true}) {
    TestMesh source = tube();
    for (std::size_t f = 0; flip && f + 1 < source.offsets.size(); f += 2) {
      std::reverse(source.corners.begin() + source.offsets[f], source.corners.begin() + source.offsets[f + 1]);
    }
    const WeldedMesh mesh = welded(source);
    const TriangleTree tree(mesh.points, mesh.triangles);
    const VoxelSolid solid(mesh.points, mesh.triangles, tree, 64, nullptr);
    const VoxelGrid& grid = solid.grid();
    for (std::int32_t cell = 0; cell < static_cast<std::int32_t>(grid.cell_count()); ++cell) {
      const Eigen::Vector3d centre = grid.centre(cell);
      const double radius = std::hypot(centre.y(), centre.z()), margin = grid.voxel();
      const double inner = 0.3 / 4 * std::cos(std::numbers::pi / 12);
      if (std::abs(centre.x()) < 0.5 - margin && radius < inner - margin) {
        EXPECT_GE(solid.index_of(cell), 0);
      }
      if (std::abs(centre.x()) > 0.5 + margin || radius > 0.3 / 4 + margin) {
        EXPECT_LT(solid.index_of(cell), 0);
      }
    }
  }
}

TEST(AutomaticWeights, DistancesInAConvexSolidAreStraight) {
  const TestMesh source = tube();
  const Heated heated(source);
  const auto bones = unit_bones(source);
  for (std::size_t p = 0; p + 2 < heated.mesh.points.size(); ++p) {
    const Eigen::Vector3d point = heated.mesh.points[p];
    if (std::abs(point.x()) > 0.4 || std::abs(point.x()) < 0.05) continue;
    double straight = 1e9;
    for (const Segment& bone : bones) straight = std::min(straight, (point - bone.closest(point)).norm());
    EXPECT_NEAR(heated.nearest.distances[p], straight, 0.01 * straight) << p;
  }
}

TEST(AutomaticWeights, DistancesGoAroundWhatIsNotSolid) {
  // Two bars with a gap in between, joined at one end; a bone in each.
  TestMesh mesh;
  const auto add_box = [&](Eigen::Vector3d low, Eigen::Vector3d high) {
    const auto first = static_cast<std::int32_t>(mesh.vertex_count());
    for (int i = 0; i < 8; ++i) {
      for (int axis = 0; axis < 3; ++axis) mesh.positions.push_back((i >> axis & 1) ? high[axis] : low[axis]);
    }
    for (const auto& face :
         {std::array{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}) {
      mesh.add_face({first + face[0], first + face[1], first + face[2], first + face[3]});
    }
  };
  add_box({0, 0, 0}, {10, 1, 1});
  add_box({0, 1.5, 0}, {10, 2.5, 1});
  add_box({0, 0, 0}, {0.7, 2.5, 1});
  const std::vector<double> heads{9, 1, 0.5, 5, 2, 0.5}, tails{9.5, 1, 0.5, 6, 2, 0.5};
  const auto result = automatic_weights(mesh.positions, mesh.offsets, mesh.corners, {heads, tails, {}});
  // The end of the second bar is closer to the first bone through the air.
  for (const std::size_t v : {8 + 1, 8 + 3, 8 + 5, 8 + 7}) {
    ASSERT_EQ(result->weights.row(v).size(), 1u);
    EXPECT_EQ(result->weights.row(v).front().bone, 1);
  }
}

TEST(AutomaticWeights, CloseVerticesAreOneWhereverTheCellsEnd) {
  // Pairs, of which many have a border of the cells that vertices are sorted into between them.
  TestMesh mesh;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> place(0, 1);
  constexpr std::size_t kPairs = 500;
  for (std::size_t pair = 0; pair < kPairs; ++pair) {
    const std::array point{place(random), place(random), place(random)};
    for (const double away : {0.0, 4e-7}) {
      for (const double number : point) mesh.positions.push_back(number + away);
    }
  }
  const WeldedMesh own = welded(mesh);
  EXPECT_EQ(own.points.size(), kPairs);
  for (std::size_t pair = 0; pair < kPairs; ++pair) EXPECT_EQ(own.point_of[2 * pair], own.point_of[2 * pair + 1]);
}

/// A sheet of n x n quads about the origin in the plane z = `height`.
void add_sheet(TestMesh& mesh, int n, double size, double height) {
  const auto first = static_cast<std::int32_t>(mesh.vertex_count());
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j <= n; ++j) {
      mesh.positions.insert(mesh.positions.end(), {size * (i - 0.5 * n) / n, size * (j - 0.5 * n) / n, height});
    }
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const std::int32_t at = first + i * (n + 1) + j;
      mesh.add_face({at, at + 1, at + n + 2, at + n + 1});
    }
  }
}

std::vector<double> dense_of(const AutomaticWeights& made, std::size_t vertex, std::size_t joints) {
  std::vector<double> row(joints);
  for (const auto& [joint, weight] : made.weights.row(vertex)) row[joint] = weight;
  return row;
}

TEST(AutomaticWeights, BothSidesOfASheetAreAlike) {
  TestMesh mesh;
  add_sheet(mesh, 10, 2, 0);
  const std::vector<double> heads{-0.5, 0, 0.2, -0.5, 0, -0.2}, tails{0.5, 0, 0.2, 0.5, 0, -0.2};
  const auto made = automatic_weights(mesh.positions, mesh.offsets, mesh.corners, {heads, tails, {}});
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) EXPECT_NEAR(dense_of(*made, v, 2)[0], 0.5, 1e-3) << v;
}

TEST(AutomaticWeights, APartThatNoBonePassesThroughIsNotThatOfOneBesideItAlone) {
  // Two bones in a box, a sheet beside it, and a third bone beyond the sheet's lower end.
  TestMesh mesh;
  mesh.positions = {-1, -1, -1, 1, -1, -1, 1, 1, -1, -1, 1, -1, -1, -1, 1, 1, -1, 1, 1, 1, 1, -1, 1, 1};
  for (const auto& face :
       {std::array{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}}) {
    mesh.add_face({face[0], face[1], face[2], face[3]});
  }
  add_sheet(mesh, 16, 2, 1.1);
  const std::vector<double> heads{-0.8, 0, 0, 0.1, 0, 0, -0.9, 0, 1.4}, tails{-0.1, 0, 0, 0.8, 0, 0, -0.8, 0, 1.4};
  for (const int resolution : {32, 64, 128}) {
    WeightSettings settings;
    settings.resolution = resolution;
    const auto made = automatic_weights(mesh.positions, mesh.offsets, mesh.corners, {heads, tails, {}}, {}, settings);
    int right = 0, count = 0;
    for (std::size_t v = 8; v < mesh.vertex_count(); ++v) {
      if (mesh.positions[3 * v] < 0.3) continue;
      ++count;
      right += dense_of(*made, v, 3)[1] > 0.5;
    }
    EXPECT_GT(right, 0.9 * count) << resolution;
    EXPECT_GT(dense_of(*made, 8 + 8, 3)[2], 0.5);  // beside the third bone
  }
}

TEST(AutomaticWeights, SameBitsForAnyNumberOfThreads) {
  const TestMesh mesh = tube(24, 80);
  std::vector<double> heads, tails;
  for (int bone = 0; bone < 20; ++bone) {
    heads.insert(heads.end(), {bone / 5.0, 0, 0});
    tails.insert(tails.end(), {(bone + 1) / 5.0, 0, 0});
  }
  for (const WeightMethod method : {WeightMethod::heat, WeightMethod::volume}) {
    WeightSettings settings;
    settings.method = method;
    std::optional<AutomaticWeights> first;
    for (const int threads : {1, 0}) {
      set_thread_count(threads);
      const auto result =
          automatic_weights(mesh.positions, mesh.offsets, mesh.corners, {heads, tails, {}}, {}, settings);
      if (!first) first = result;
      EXPECT_EQ(first->weights, result->weights);
    }
  }
  set_thread_count(0);
}

TEST(AutomaticWeights, IsCancelledAtAnyTime) {
  const TestMesh mesh = tube(24, 80);
  Progress progress;
  progress.cancel();
  EXPECT_FALSE(automatic_weights(mesh.positions, mesh.offsets, mesh.corners, {kHeads, kTails, {}}, {}, {}, &progress));
  Progress other;
  EXPECT_TRUE(automatic_weights(mesh.positions, mesh.offsets, mesh.corners, {kHeads, kTails, {}}, {}, {}, &other));
  EXPECT_GT(other.fraction(), 0.5);
}

}  // namespace
}  // namespace sinew
