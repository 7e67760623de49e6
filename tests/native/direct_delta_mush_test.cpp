#include "sinew/direct_delta_mush.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/SVD>

#include "each_instruction_set.h"
#include "failures.h"
#include "mush/direct_delta_mush_kernels.h"
#include "mush/implicit_smoothing.h"
#include "mush/laplacian.h"
#include "skinned.h"

namespace sinew {
namespace {

using Floats = std::vector<float>;
using rigs::Matrices;
using Numbers = std::vector<std::int32_t>;

/// A rolling sheet of quads, `size` vertices along each side, and joints along it.
struct Sheet {
  explicit Sheet(std::int32_t size, std::int32_t joints = 5, float length = 1) : joint_count(joints) {
    rigs::Random random(1);
    std::vector<std::int64_t> offsets{0};
    Numbers names;
    Floats weights;
    for (std::int32_t v = 0; v < size * size; ++v) {
      const float x = static_cast<float>(v / size) / static_cast<float>(size);
      const float y = static_cast<float>(v % size) / static_cast<float>(size);
      const auto shift = static_cast<float>(rigs::uniform(random, -0.2, 0.2)) / static_cast<float>(size);
      rest.insert(rest.end(), {x + shift, y - shift, 0.2f * std::sin(5 * x) + shift});
      const float at = x * static_cast<float>(joints - 1);
      const auto first = std::min(static_cast<std::int32_t>(at), joints - 2);
      names.insert(names.end(), {first, first + 1});
      weights.insert(weights.end(), {1 - (at - static_cast<float>(first)), at - static_cast<float>(first)});
      offsets.push_back(std::ssize(names));
      if (v % size + 1 == size || v / size + 1 == size) continue;
      face_vertices.insert(face_vertices.end(), {v, v + 1, v + size + 1, v + size});
      face_offsets.push_back(static_cast<std::int32_t>(face_vertices.size()));
    }
    for (float& coordinate : rest) coordinate *= length;
    skin = std::make_shared<const Skin>(rest, offsets, names, weights, joints);
  }

  std::int32_t joint_count;
  Floats rest;
  Numbers face_offsets{0}, face_vertices;
  std::shared_ptr<const Skin> skin;
};

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign = Eigen::Vector3d::Ones();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0) sign.z() = -1;
  return svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
}

/// The header's formulas, with a dense LU decomposition.
Eigen::MatrixX3d reference(const Sheet& sheet, const MushSettings& settings, const Matrices& matrices) {
  const std::ptrdiff_t vertices = sheet.skin->vertex_count();
  const Laplacian own = laplacian(sheet.rest, sheet.face_offsets, sheet.face_vertices, settings.laplacian);
  const auto solved = [&](double strength, Eigen::MatrixXd x) {
    Eigen::MatrixXd system = Eigen::MatrixXd::Identity(vertices, vertices);
    for (std::ptrdiff_t v = 0; v < vertices; ++v) {
      if (own.has_neighbours(v)) system(v, v) += strength;
      for (auto i = own.begin[v]; i < own.begin[v + 1]; ++i) system(v, own.columns[i]) += strength * own.values[i];
    }
    const Eigen::PartialPivLU<Eigen::MatrixXd> lu(system);
    for (int k = 0; k < settings.iterations; ++k) x = lu.solve(x).eval();
    return x;
  };
  const Eigen::MatrixXd weights = reference::dense_weights(*sheet.skin);
  std::vector<Matrix4<double>> q(vertices, Matrix4<double>::Zero());
  std::vector<Eigen::MatrixXd> psi;
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(vertices, 16);
  for (std::int32_t j = 0; j < sheet.joint_count; ++j) {
    Eigen::MatrixXd field(vertices, 16);
    for (std::ptrdiff_t v = 0; v < vertices; ++v) {
      const Eigen::Vector4d u = reference::rest_position(*sheet.skin, v).homogeneous();
      const Matrix4<double> own_field = weights(v, j) * u * u.transpose();
      field.row(v) = own_field.reshaped().transpose();
    }
    psi.push_back(solved(settings.smoothing, field));
    sum += psi.back();
  }
  const Eigen::MatrixXd smoothed = solved(settings.weight_smoothing, weights);
  Eigen::MatrixX3d positions(vertices, 3);
  for (std::ptrdiff_t v = 0; v < vertices; ++v) {
    const Eigen::Vector4d p = sum.row(v).tail<4>().transpose() / sum(v, 15);
    Matrix4<double> whole = Matrix4<double>::Zero();
    for (std::int32_t j = 0; j < sheet.joint_count; ++j) {
      const Matrix4<double> of_shape = psi[j].row(v).transpose().reshaped(4, 4);
      whole += matrices[j] * ((1 - settings.blend) * of_shape + settings.blend * smoothed(v, j) * p * p.transpose());
    }
    whole /= whole(3, 3);
    const Eigen::Vector3d top = whole.topRightCorner<3, 1>();
    const Eigen::Matrix3d r = nearest_rotation(whole.topLeftCorner<3, 3>() - top * whole.bottomLeftCorner<1, 3>());
    positions.row(v) = top + r * (reference::rest_position(*sheet.skin, v) - p.head<3>());
  }
  return positions;
}

class DirectDeltaMushKernels : public OnEachInstructionSet {};

INSTANTIATE_TEST_SUITE_P(Kernels, DirectDeltaMushKernels, each_instruction_set(), set_name);

Floats skinned(const DirectDeltaMush& mush, const Matrices& matrices) {
  rigs::Stack<float> stack(matrices, 1, rigs::Layout::column_major);
  Floats positions(3 * mush.vertex_count());
  skin_direct_delta_mush(mush, stack.read(), positions);
  return positions;
}

TEST_P(DirectDeltaMushKernels, AgreeWithTheFormulas) {
  rigs::Random random(2);
  for (const std::int32_t size : {3, 17}) {  // blocks that are full and not
    const Sheet sheet(size);
    for (const MushSettings settings : {MushSettings(), MushSettings{10, 2, 0.3, 4, LaplacianKind::uniform}}) {
      const auto mush = DirectDeltaMush::compute(sheet.skin, sheet.face_offsets, sheet.face_vertices, settings);
      const Matrices pose = rigs::through_float(rigs::random_pose(random, sheet.joint_count, 0.2));
      EXPECT_LT(rigs::distance(skinned(*mush, pose), reference(sheet, settings, pose)), 1e-5);
    }
  }
}

TEST_P(DirectDeltaMushKernels, EveryVariantKeepsTheRestMeshAndRigidMotions) {
  rigs::Random random(3);
  const Sheet sheet(17);
  for (int variant = 0; variant <= 5; ++variant) {
    MushSettings settings;
    settings.variant = variant;
    const auto mush = DirectDeltaMush::compute(sheet.skin, sheet.face_offsets, sheet.face_vertices, settings);
    const Matrix4<double> motion = rigs::through_float({rigs::random_rigid(random)})[0];
    for (const Matrix4<double>& all : {motion, Matrix4<double>(Matrix4<double>::Identity())}) {
      const Floats positions = skinned(*mush, Matrices(sheet.joint_count, all));
      for (std::ptrdiff_t v = 0; v < sheet.skin->vertex_count(); ++v) {
        const Eigen::Vector4d moved = all * reference::rest_position(*sheet.skin, v).homogeneous();
        EXPECT_LT((Eigen::Map<const Eigen::Vector3f>(&positions[3 * v]).cast<double>() - moved.head<3>()).norm(), 2e-6)
            << "variant " << variant << ", vertex " << v;
      }
    }
  }
}

TEST(DirectDeltaMush, KeepsTheRestMeshOfAnyLength) {
  for (const float length : {1e-42f, 1e-38f, 1e-25f, 1e-10f, 1e10f}) {
    const Sheet sheet(5, 3, length);
    const auto mush = DirectDeltaMush::compute(sheet.skin, sheet.face_offsets, sheet.face_vertices);
    const Floats positions = skinned(*mush, Matrices(3, Matrix4<double>::Identity()));
    for (std::size_t i = 0; i < positions.size(); ++i) {
      EXPECT_LE(std::abs(positions[i] - sheet.rest[i]), std::max(1e-5f * length, 3e-45f)) << length << ", number " << i;
    }
  }
}

/// By way of a vertex with that neighbourhood: joint j brings column j.
TEST_P(DirectDeltaMushKernels, TurnByTheNearestRotationOfAnyMatrix) {
  rigs::Random random(4);
  Floats centers(3, 0);
  const Skin skin(Floats{0.3f, -0.4f, 0.5f}, std::vector<std::int64_t>{0, 0}, {}, {}, 1);
  const std::shared_ptr<const Skin> borrowed(std::shared_ptr<const Skin>(), &skin);
  const DirectDeltaMush mush(borrowed, MushArrays{{0, 1}, {0}, {1, 0, 0, 1, 0, 1, 0, 0, 0, 1}, centers, {0}});
  const Eigen::Vector3d vector(0.3f, -0.4f, 0.5f);
  for (const Eigen::Vector3d& extents : {Eigen::Vector3d(1, 1, 1),
                                         {1, 0.5, 0.2},
                                         {1, 1, 0},
                                         {1, 0.3, 0},
                                         {1, 0.01, 0},
                                         {1, 1, 0.999},
                                         {1, 0.5, -0.2},
                                         {1, 1, -0.9},
                                         {1e-8, 1e-9, 0},
                                         {1e5, 10, 1}}) {
    for (int i = 0; i < 200; ++i) {
      const Eigen::Matrix3d u = rigs::random_rigid(random).topLeftCorner<3, 3>();
      const Eigen::Matrix3d v = rigs::random_rigid(random).topLeftCorner<3, 3>();
      Matrix4<double> matrix = Matrix4<double>::Identity();
      matrix.topLeftCorner<3, 3>() = u * extents.asDiagonal() * v.transpose();
      const Matrices given = rigs::through_float({matrix});
      const Eigen::Vector3d expected = nearest_rotation(given[0].topLeftCorner<3, 3>()) * vector;
      const Floats got = skinned(mush, given);
      EXPECT_LT((Eigen::Map<const Eigen::Vector3f>(got.data()).cast<double>() - expected).norm(),
                1e-6 * extents[0] / (extents[1] + extents[2]))
          << extents.transpose();
    }
  }
}

TEST(DirectDeltaMush, SmoothsByAPolynomialThatIsTheInverse) {
  for (const double strength : {0.1, 3.0, 100.0, 1000.0}) {
    for (const int iterations : {1, 5, 20}) {
      const auto coefficients = smoothing_polynomial(strength, iterations, 3);
      for (double t = 0; t <= 3; t += 0.01) {
        const double angle = std::acos(t / 1.5 - 1);
        double sum = 0;
        for (std::size_t k = 0; k < coefficients.size(); ++k) sum += coefficients[k] * std::cos(double(k) * angle);
        EXPECT_NEAR(sum, std::pow(1 + strength * t, -iterations), 1e-11) << strength << " " << iterations << " " << t;
      }
    }
  }
}

/// The largest size of an eigenvalue: how fast the matrix's powers grow.
double spectral_radius(Eigen::MatrixXd matrix) {
  double logarithm = 0;
  for (double power = 1; power < 1e9; power *= 2) {
    const double norm = matrix.norm();
    logarithm += std::log(norm) / power;
    matrix /= norm;
    matrix = (matrix * matrix).eval();
  }
  return std::exp(logarithm);
}

TEST(DirectDeltaMush, NoEigenvalueOfALaplacianIsBeyondTheOneThatIsSaid) {
  rigs::Random random(5);
  for (const double thin : {1.0, 1e-3, 1e-7}) {
    Floats points;
    for (int i = 0; i < 60; ++i) {
      for (const double x : rigs::vector(random, 1)) points.push_back(static_cast<float>(i % 3 ? thin * x : x));
    }
    Numbers offsets{0}, corners;
    for (int i = 0; i + 2 < 60; ++i) {
      corners.insert(corners.end(), {i, i + 1, i + 2});
      offsets.push_back(3 * (i + 1));
    }
    for (const LaplacianKind kind : {LaplacianKind::cotangent, LaplacianKind::uniform}) {
      const Laplacian own = laplacian(points, offsets, corners, kind);
      Eigen::MatrixXd dense = Eigen::MatrixXd::Identity(60, 60);
      for (int v = 0; v < 60; ++v) {
        for (auto i = own.begin[v]; i < own.begin[v + 1]; ++i) dense(v, own.columns[i]) = own.values[i];
      }
      EXPECT_LE(spectral_radius(dense), own.largest + 1e-6);
      // What is below 0 would be beyond that distance from the largest.
      EXPECT_LE(spectral_radius(own.largest * Eigen::MatrixXd::Identity(60, 60) - dense), own.largest + 1e-6);
      EXPECT_LE(own.largest, 3);
    }
  }
}

TEST(DirectDeltaMush, StopsWhenItIsCancelled) {
  const Sheet sheet(30);
  Progress progress;
  progress.cancel();
  EXPECT_EQ(DirectDeltaMush::compute(sheet.skin, sheet.face_offsets, sheet.face_vertices, {}, &progress), nullptr);
}

}  // namespace
}  // namespace sinew
