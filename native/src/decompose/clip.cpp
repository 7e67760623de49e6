#include "decompose/clip.h"

#include <algorithm>
#include <cmath>

#include "base/cancelled.h"
#include "base/parallel.h"
#include "mesh/adjacency.h"

namespace sinew {
namespace {

/// Vertices that move alike differ by no more than this share of the size.
constexpr double kAlike = 1e-6;

Eigen::Vector3d at(std::span<const float> positions, std::size_t i) {
  return Eigen::Vector3f::Map(positions.data() + 3 * i).cast<double>();
}

Eigen::Vector3d centroid(std::span<const float> positions) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < positions.size() / 3; ++i) sum += at(positions, i);
  return sum / (static_cast<double>(positions.size()) / 3);
}

double spread(std::span<const float> positions, const Eigen::Vector3d& centre) {
  double sum = 0;
  for (std::size_t i = 0; i < positions.size() / 3; ++i) sum += (at(positions, i) - centre).squaredNorm();
  return std::sqrt(sum / (static_cast<double>(positions.size()) / 3));
}

}  // namespace

Clip::Clip(std::span<const float> rest_positions, std::span<const float> all_frames, bool joins,
           const Progress* progress) {
  const std::size_t vertices = rest_positions.size() / 3;
  frames = std::ssize(all_frames) / std::ssize(rest_positions);
  const auto frame = [&](std::size_t f) { return all_frames.subspan(3 * vertices * f, 3 * vertices); };
  centre = centroid(rest_positions);
  frame_centres.resize(static_cast<std::size_t>(frames));
  parallel_for(frame_centres.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) {
      stop_if_cancelled(progress);
      frame_centres[f] = centroid(frame(f));
    }
  });
  size = spread(rest_positions, centre);
  for (std::size_t f = 0; f < frame_centres.size() && size == 0; ++f) size = spread(frame(f), frame_centres[f]);
  if (size == 0) size = 1;

  const auto moves_alike = [&](std::uint32_t a, std::uint32_t b) {
    for (std::size_t f = 0; f < frame_centres.size(); ++f) {
      if ((at(frame(f), a) - at(frame(f), b)).cwiseAbs().maxCoeff() > kAlike * size) return false;
    }
    return true;
  };
  std::vector<std::uint32_t> first_of(vertices);
  for_coincident(rest_positions, [&](std::span<const std::uint32_t> own) {
    for (std::size_t i = 0; i < own.size(); ++i) {
      first_of[own[i]] = own[i];
      for (std::size_t k = 0; joins && k < std::min<std::size_t>(i, 16); ++k) {
        if (first_of[own[k]] != own[k] || !moves_alike(own[k], own[i])) continue;
        first_of[own[i]] = own[k];
        break;
      }
    }
  });
  point_of = points_of(first_of).first;
  std::vector<std::uint32_t> vertex_of;
  for (std::uint32_t v = 0; v < vertices; ++v) {
    if (first_of[v] == v) vertex_of.push_back(v);
  }

  rest.resize(vertex_of.size());
  moves.resize(vertex_of.size() * numbers());
  parallel_for(vertex_of.size(), 256, [&](std::size_t begin, std::size_t end) {
    stop_if_cancelled(progress);
    for (std::size_t p = begin; p < end; ++p) {
      rest[p] << (at(rest_positions, vertex_of[p]) - centre) / size, 1;
    }
    for (std::size_t f = 0; f < frame_centres.size(); ++f) {
      const std::span<const float> own = frame(f);
      for (std::size_t p = begin; p < end; ++p) {
        const Eigen::Vector3d moved = (at(own, vertex_of[p]) - frame_centres[f]) / size;
        Eigen::Vector3f::Map(moves.data() + p * numbers() + 3 * f) = moved.cast<float>();
      }
    }
  });
}

Clip Clip::with_frames(std::ptrdiff_t most) const {
  Clip few;
  few.rest = rest;
  few.frames = std::min(frames, most);
  few.centre = centre;
  few.size = size;
  std::vector<std::size_t> kept(static_cast<std::size_t>(few.frames));
  for (std::size_t i = 0; i < kept.size(); ++i) {
    kept[i] = few.frames == 1 ? static_cast<std::size_t>(frames) / 2
                              : i * (static_cast<std::size_t>(frames) - 1) / (kept.size() - 1);
    few.frame_centres.push_back(frame_centres[kept[i]]);
  }
  few.moves.resize(rest.size() * few.numbers());
  parallel_for(rest.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      for (std::size_t i = 0; i < kept.size(); ++i) {
        std::copy_n(row(p) + 3 * kept[i], 3, few.moves.data() + p * few.numbers() + 3 * i);
      }
    }
  });
  return few;
}

Eigen::Matrix<double, 3, 4> Clip::inward(const Matrix4<double>& matrix, std::ptrdiff_t frame) const {
  Eigen::Matrix<double, 3, 4> own = matrix.topRows<3>();
  own.col(3) = (matrix.block<3, 3>(0, 0) * centre + own.col(3) - frame_centres[frame]) / size;
  return own;
}

Matrix4<double> Clip::outward(const Eigen::Matrix<double, 3, 4>& matrix, std::ptrdiff_t frame) const {
  Matrix4<double> result = Matrix4<double>::Identity();
  result.block<3, 3>(0, 0) = matrix.leftCols<3>();
  result.block<3, 1>(0, 3) = frame_centres[frame] + size * matrix.col(3) - matrix.leftCols<3>() * centre;
  return result;
}

}  // namespace sinew
