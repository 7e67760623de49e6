#include "characters.h"

#include <algorithm>
#include <map>
#include <numeric>

#include "sinew/forward_kinematics.h"

namespace sinew::bench {
namespace {

using Influences = std::vector<std::pair<std::int32_t, double>>;  // joint, weight

/// A mesh whose vertices carry their influences.
struct WeightedMesh {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Influences> influences;
  std::vector<std::vector<std::int32_t>> faces;

  std::int32_t add_mean(const std::vector<std::int32_t>& corners) {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    std::map<std::int32_t, double> weights;
    for (const std::int32_t corner : corners) {
      position += positions[corner];
      for (const auto& [joint, weight] : influences[corner]) weights[joint] += weight;
    }
    positions.push_back(position / static_cast<double>(corners.size()));
    influences.emplace_back(weights.begin(), weights.end());
    for (auto& entry : influences.back()) entry.second /= static_cast<double>(corners.size());
    return static_cast<std::int32_t>(positions.size()) - 1;
  }
};

WeightedMesh weighted_mesh(const Rig& rig) {
  WeightedMesh mesh;
  for (std::ptrdiff_t v = 0; v < rig.mesh.vertex_count(); ++v) {
    mesh.positions.emplace_back(Eigen::Map<const Eigen::Vector3f>(rig.mesh.positions.data() + 3 * v).cast<double>());
    Influences own;
    for (std::ptrdiff_t c = 0; c < rig.weights.cols(); ++c) {
      if (rig.weights(v, c) != 0) own.emplace_back(static_cast<std::int32_t>(c), rig.weights(v, c));
    }
    mesh.influences.push_back(std::move(own));
  }
  for (std::ptrdiff_t f = 0; f < rig.mesh.face_count(); ++f) {
    const auto first = rig.mesh.face_vertices.begin();
    mesh.faces.emplace_back(first + rig.mesh.face_offsets[f], first + rig.mesh.face_offsets[f + 1]);
  }
  return mesh;
}

void subdivide(WeightedMesh& mesh) {
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> middle;
  const auto middle_of = [&](std::int32_t a, std::int32_t b) {
    const auto [entry, is_new] = middle.try_emplace(std::minmax(a, b), 0);
    if (is_new) entry->second = mesh.add_mean({a, b});
    return entry->second;
  };
  std::vector<std::vector<std::int32_t>> faces;
  for (const auto& face : mesh.faces) {
    std::vector<std::int32_t> edges;
    for (std::size_t i = 0; i < face.size(); ++i) {
      edges.push_back(middle_of(face[i], face[(i + 1) % face.size()]));
    }
    const std::int32_t centre = mesh.add_mean(face);
    for (std::size_t i = 0; i < face.size(); ++i) {
      faces.push_back({face[i], edges[i], centre, edges[(i + face.size() - 1) % face.size()]});
    }
  }
  mesh.faces = std::move(faces);
}

/// Keeps the `most` largest, after filling up to `at_least` with the nearest joints.
void limit_influences(WeightedMesh& mesh, const Eigen::MatrixX3d& joints, std::size_t most, std::size_t at_least) {
  std::vector<std::int32_t> nearest(joints.rows());
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    Influences& own = mesh.influences[v];
    if (own.size() < at_least) {
      const auto distance = [&](std::int32_t j) { return (joints.row(j).transpose() - mesh.positions[v]).norm(); };
      std::iota(nearest.begin(), nearest.end(), 0);
      std::partial_sort(nearest.begin(), nearest.begin() + at_least, nearest.end(),
                        [&](auto a, auto b) { return distance(a) < distance(b); });
      for (std::size_t i = 0; own.size() < at_least; ++i) {
        const auto is_own = [&](const auto& entry) { return entry.first == nearest[i]; };
        if (std::ranges::any_of(own, is_own)) continue;
        own.emplace_back(nearest[i], 0.05 / (1 + distance(nearest[i])));
      }
    }
    std::ranges::sort(own, [](const auto& a, const auto& b) { return a.second > b.second; });
    own.resize(std::min(own.size(), most));
    double sum = 0;
    for (const auto& entry : own) sum += entry.second;
    for (auto& entry : own) entry.second /= sum;
  }
}

Skin skin_of(const WeightedMesh& mesh, std::ptrdiff_t joints) {
  std::vector<float> positions, weights;
  std::vector<std::int64_t> offsets{0};
  std::vector<std::int32_t> names;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    for (const double coordinate : mesh.positions[v]) {
      positions.push_back(static_cast<float>(coordinate));
    }
    for (const auto& [joint, weight] : mesh.influences[v]) {
      names.push_back(joint);
      weights.push_back(static_cast<float>(weight));
    }
    offsets.push_back(static_cast<std::int64_t>(names.size()));
  }
  return Skin(positions, offsets, names, weights, joints);
}

}  // namespace

Rig read_walking_rig(const std::filesystem::path& folder) {
  RigPaths paths = find_rig(folder);
  paths.poses = folder / "walk.dmat";
  return read_rig(paths);
}

std::vector<std::int32_t> joints_of_columns(const Rig& rig) {
  std::vector<std::int32_t> joints(rig.weights.cols());
  const auto& columns = rig.skeleton.weight_columns();
  for (std::size_t j = 0; j < columns.size(); ++j) {
    if (columns[j] >= 0) joints[columns[j]] = static_cast<std::int32_t>(j);
  }
  return joints;
}

Character read_character(const std::filesystem::path& folder, int subdivisions, int influences, int at_least,
                         int frames) {
  const Rig rig = read_walking_rig(folder);
  const std::vector<std::int32_t> joint_of = joints_of_columns(rig);
  const std::ptrdiff_t columns = rig.weights.cols();
  const auto joint_count = static_cast<std::size_t>(rig.skeleton.joint_count());

  WeightedMesh mesh = weighted_mesh(rig);
  for (int i = 0; i < subdivisions; ++i) subdivide(mesh);
  if (influences > 0) {
    Eigen::MatrixX3d heads(columns, 3);
    for (std::ptrdiff_t c = 0; c < columns; ++c) heads.row(c) = rig.skeleton.heads().row(joint_of[c]);
    limit_influences(mesh, heads, influences, at_least);
  }

  Character character{skin_of(mesh, columns), {}, {}, {}, {}, {}, {}, {}, {0}, {}};
  for (const auto& face : mesh.faces) {
    character.face_vertices.insert(character.face_vertices.end(), face.begin(), face.end());
    character.face_offsets.push_back(static_cast<std::int32_t>(character.face_vertices.size()));
  }
  const auto vertices = static_cast<std::ptrdiff_t>(mesh.positions.size());
  if (vertices <= kMostDense) {
    character.dense_weights.setZero(vertices, columns);
    character.rest.resize(vertices, 3);
    for (std::ptrdiff_t v = 0; v < vertices; ++v) {
      character.rest.row(v) = mesh.positions[v].transpose();
      for (const auto& [joint, weight] : mesh.influences[v]) {
        character.dense_weights(v, joint) = weight;
      }
    }
  }
  for (const std::int32_t joint : joint_of) {
    character.inverse_rest.push_back(rig.skeleton.inverse_rest()[joint]);
    character.rest_frames.push_back(character.inverse_rest.back().inverse());
  }
  const auto joints = rig.skeleton.joint_count();
  std::vector<Eigen::Quaterniond> rotations(joint_count);
  std::vector<Matrix4<double>> local(joint_count), world(joint_count);
  std::vector<Matrix4<float>> matrices(joint_count);
  Matrix4<double> stretch = Matrix4<double>::Identity();
  stretch.diagonal() << 0.98, 1.05, 0.97, 1;
  for (int f = 0; f < frames; ++f) {
    rig.poses->sample(static_cast<double>(rig.poses->pose_count()) * f / frames, true, rotations);
    rotation_transforms<double>(rotations, MatrixStack<double>::of(local.data(), 1, joints));
    forward_kinematics<double>(rig.skeleton, MatrixStack<const double>::of(local.data(), 1, joints),
                               MatrixStack<double>::of(world.data(), 1, joints));
    skinning_matrices<double>(rig.skeleton, MatrixStack<const double>::of(world.data(), 1, joints),
                              MatrixStack<float>::of(matrices.data(), 1, joints));
    for (const std::int32_t joint : joint_of) {
      character.transforms.push_back(world[joint]);
      const std::size_t j = character.matrices.size() % joint_of.size();
      const Matrix4<double> along = character.rest_frames[j] * stretch * character.inverse_rest[j];
      character.matrices.push_back(matrices[joint]);
      character.stretched.push_back(j % 2 == 0 ? matrices[joint] : matrices[joint] * along.cast<float>());
    }
  }
  return character;
}

}  // namespace sinew::bench
