#include "weights/rigid_parts.h"

#include <algorithm>
#include <limits>
#include <map>

#include "weights/triangle_tree.h"
#include "weights/weight_rows.h"

namespace sinew {
namespace {

/// Returns the group of each vertex, and how many there are; groups that are given come first.
std::int32_t find_groups(const WeldedMesh& mesh, const WeightSettings& settings, std::vector<std::int32_t>& group_of) {
  group_of.assign(mesh.point_of.size(), -1);
  std::map<std::int32_t, std::int32_t> given;
  for (std::size_t v = 0; v < settings.rigid_parts.size(); ++v) {
    const std::int32_t part = settings.rigid_parts[v];
    if (part >= 0) group_of[v] = given.try_emplace(part, static_cast<std::int32_t>(given.size())).first->second;
  }
  auto count = static_cast<std::int32_t>(given.size());
  if (settings.rigid_size == 0 || mesh.points.empty()) return count;
  Eigen::Vector3d low = mesh.points.front(), high = low;
  for (const Eigen::Vector3d& point : mesh.points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  const double most = settings.rigid_size * (high - low).norm();
  const std::vector<double> diagonals = part_diagonals(mesh);
  const auto largest = std::ranges::max_element(diagonals) - diagonals.begin();
  std::vector<std::int32_t> group_of_part(diagonals.size(), -1);
  for (std::size_t v = 0; v < group_of.size(); ++v) {
    const std::int32_t part = mesh.part_of[mesh.point_of[v]];
    if (group_of[v] >= 0 || part == largest || diagonals[part] >= most) continue;
    if (group_of_part[part] < 0) group_of_part[part] = count++;
    group_of[v] = group_of_part[part];
  }
  return count;
}

}  // namespace

std::vector<double> part_diagonals(const WeldedMesh& mesh) {
  const auto parts = static_cast<std::size_t>(mesh.part_count);
  const Eigen::Vector3d far = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  std::vector<Eigen::Vector3d> low(parts, far), high(parts, -far);
  for (std::size_t p = 0; p < mesh.points.size(); ++p) {
    low[mesh.part_of[p]] = low[mesh.part_of[p]].cwiseMin(mesh.points[p]);
    high[mesh.part_of[p]] = high[mesh.part_of[p]].cwiseMax(mesh.points[p]);
  }
  std::vector<double> diagonals(parts);
  for (std::size_t part = 0; part < parts; ++part) diagonals[part] = (high[part] - low[part]).norm();
  return diagonals;
}

RigidRows::RigidRows(const WeldedMesh& mesh, const WeightTable& rows, std::span<const WeightWay> ways,
                     const WeightSettings& settings)
    : rows_(rows.bones()) {
  const std::int32_t groups = find_groups(mesh, settings, group_of_);
  if (groups == 0) {
    group_of_.clear();
    return;
  }
  std::vector<std::uint8_t> is_rigid(mesh.points.size());
  std::vector<std::vector<std::uint32_t>> points(groups);
  for (std::size_t v = 0; v < group_of_.size(); ++v) {
    if (group_of_[v] < 0) continue;
    is_rigid[mesh.point_of[v]] = 1;
    points[group_of_[v]].push_back(mesh.point_of[v]);
    if (ways[mesh.point_of[v]] == WeightWay::fixed) group_of_[v] = -1;
  }
  std::vector<Triangle> soft;
  for (const Triangle& triangle : mesh.triangles) {
    if (!is_rigid[triangle[0]] && !is_rigid[triangle[1]] && !is_rigid[triangle[2]]) soft.push_back(triangle);
  }
  const bool attach = settings.rigid_follow == RigidFollow::attachment && !soft.empty();
  const TriangleTree tree(mesh.points, attach ? std::span<const Triangle>(soft) : std::span<const Triangle>());
  RowSum sum(static_cast<std::size_t>(rows.bones()));
  for (std::int32_t group = 0; group < groups; ++group) {
    if (attach) {
      SurfacePoint closest;
      for (const std::uint32_t p : points[group]) {
        const SurfacePoint own = tree.closest(mesh.points[p], closest.squared_distance);
        if (own.squared_distance < closest.squared_distance) closest = own;
      }
      for (int i = 0; i < 3; ++i) sum.add(rows.row(soft[closest.triangle][i]), closest.shares[i]);
    } else {
      for (const std::uint32_t p : points[group]) sum.add(rows.row(p), 1.0 / static_cast<double>(points[group].size()));
    }
    const auto row = sum.take();
    const auto largest = std::ranges::max_element(row, {}, &BoneWeight::weight) - row.begin();
    rows_.add_row(settings.rigid_follow == RigidFollow::bone ? row.subspan(largest, 1) : row);
  }
}

}  // namespace sinew
