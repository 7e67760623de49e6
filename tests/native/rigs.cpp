#include "rigs.h"

namespace sinew::rigs {

double uniform(Random& random, double low, double high) {
  return low + (high - low) * (random() / 4294967296.0);  // the same on every machine
}

Eigen::Vector3d vector(Random& random, double size) {
  return {uniform(random, -size, size), uniform(random, -size, size), uniform(random, -size, size)};
}

Matrix4<double> rigid(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation) {
  Matrix4<double> matrix = Matrix4<double>::Identity();
  matrix.topLeftCorner<3, 3>() = rotation.normalized().toRotationMatrix();
  matrix.topRightCorner<3, 1>() = translation;
  return matrix;
}

Matrix4<double> turn(double degrees, const Eigen::Vector3d& axis, const Eigen::Vector3d& translation) {
  const double radians = degrees * std::numbers::pi / 180;
  return rigid(Eigen::Quaterniond(Eigen::AngleAxisd(radians, axis.normalized())), translation);
}

Matrix4<double> similarity() {
  Matrix4<double> matrix = turn(40, {1, 2, 3}, {0.3, -0.2, 0.1});
  matrix.topLeftCorner<3, 3>() *= 1.25;
  return matrix;
}

Matrix4<double> sheared() {
  Matrix4<double> matrix = similarity();
  matrix.col(1) *= 1.4;
  matrix(0, 1) += 0.2;
  return matrix;
}

Matrix4<double> random_rigid(Random& random, double size) {
  return turn(uniform(random, -180, 180), vector(random, 1), vector(random, size));
}

Matrices random_pose(Random& random, std::ptrdiff_t count, double size) {
  Matrices pose;
  for (std::ptrdiff_t i = 0; i < count; ++i) pose.push_back(random_rigid(random, size));
  return pose;
}

Matrices identities(std::ptrdiff_t count) { return Matrices(count, Matrix4<double>::Identity()); }

std::vector<std::int32_t> chain(std::int32_t count) {
  std::vector<std::int32_t> parents(count);
  std::iota(parents.begin(), parents.end(), -1);
  return parents;
}

std::vector<std::int32_t> bushy_tree(std::int32_t count, std::int32_t children) {
  std::vector<std::int32_t> parents(count);
  for (std::int32_t j = 0; j < count; ++j) parents[j] = j == 0 ? -1 : (j - 1) / children;
  return parents;
}

std::vector<std::int32_t> random_forest(Random& random, std::int32_t count) {
  std::vector<std::int32_t> name(count);
  std::iota(name.begin(), name.end(), 0);
  std::shuffle(name.begin(), name.end(), random);
  std::vector<std::int32_t> parents(count, -1);
  for (std::int32_t i = 1; i < count; ++i) {
    if (random() % 8 != 0) parents[name[i]] = name[random() % i];
  }
  return parents;
}

Skin random_skin(Random& random, std::ptrdiff_t vertices, std::int32_t joints) {
  SkinMaker maker;
  for (std::ptrdiff_t v = 0; v < vertices; ++v) {
    maker.add_vertex(random);
    std::vector<std::int32_t> own;
    std::vector<double> weights;
    for (std::ptrdiff_t i = 0; i < v % 16; ++i) {
      weights.push_back(uniform(random, 0.01, 1));
      own.push_back(static_cast<std::int32_t>(random() % joints));
    }
    maker.set_influences(own, weights);
  }
  return maker.skin(joints);
}

Skin coherent_skin(Random& random, std::ptrdiff_t vertices, std::int32_t joints, std::int32_t influences) {
  SkinMaker maker;
  for (std::ptrdiff_t v = 0; v < vertices; ++v) {
    maker.add_vertex(random);
    std::vector<std::int32_t> own;
    for (std::int32_t i = 0; i < influences && v % 37 != 36; ++i) {
      own.push_back(static_cast<std::int32_t>((v / 48 + i) % joints));
    }
    std::shuffle(own.begin(), own.end(), random);
    std::vector<double> weights;
    for (std::size_t i = 0; i < own.size(); ++i) weights.push_back(uniform(random, 0.05, 1));
    maker.set_influences(own, weights);
  }
  return maker.skin(joints);
}

Matrices through_float(const Matrices& matrices) {
  Matrices rounded;
  for (const auto& matrix : matrices) rounded.push_back(matrix.cast<float>().cast<double>());
  return rounded;
}

double distance(const std::vector<float>& a, const Eigen::MatrixX3d& b) {
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;
  return (Eigen::Map<const Rows>(a.data(), b.rows(), 3).cast<double>() - b).cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
}

}  // namespace sinew::rigs
