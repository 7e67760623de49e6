#include "sinew/decompose.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/cancelled.h"
#include "base/parallel.h"
#include "decompose/check_clip.h"
#include "decompose/clusters.h"
#include "decompose/weight_fit.h"

namespace sinew {
namespace {

constexpr int kMotionSweeps = 5, kWeightSweeps = 2;

/// The iterations that have to lower the error too little before it ends.
constexpr int kPatience = 3;

/// Joints whose squared weights have a smaller sum move nothing, and begin anew where the error is largest.
constexpr double kLeastMass = 1e-3;

constexpr double kLeastWeight = 1e-5;

class Decomposer {
 public:
  Decomposer(const DeformedMesh& mesh, const DecompositionStart& start, const DecompositionSettings& settings,
             Progress* progress)
      : mesh_(mesh),
        start_(start),
        settings_(settings),
        progress_(progress),
        clip_(mesh.rest, mesh.frames, !has_weights(), progress) {}

  Decomposition run() {
    if (progress_) progress_->start(settings_.iterations + kClusterSteps + 1);
    if (has_weights()) {
      fit_motions();
    } else {
      stop_if_cancelled(progress_);
      neighbours_ = neighbours_of(clip_, mesh_.face_offsets, mesh_.face_vertices, progress_);
      start_.matrices.empty() ? find_both() : fit_weights();
    }
    return result();
  }

 private:
  bool has_weights() const { return start_.weights.bones() > 0; }
  std::size_t points() const { return static_cast<std::size_t>(clip_.point_count()); }

  void done(int steps) {
    if (progress_) progress_->advance(steps);
    stop_if_cancelled(progress_);
  }

  void set_weights(std::size_t width) {
    weights_ = {width, std::vector<std::int32_t>(points() * width), std::vector<double>(points() * width)};
  }

  WeightFit weight_fit(std::size_t candidates, int sweeps) const {
    return {
        clip_,
        neighbours_,
        {static_cast<std::size_t>(settings_.max_influences), candidates, settings_.smoothing, sweeps, settings_.local}};
  }

  /// Whether the error has changed too little for long enough.
  bool has_settled(double square) {
    const bool is_little = square >= square_ * (1 - settings_.tolerance) * (1 - settings_.tolerance);
    square_ = square;
    quiet_ = is_little ? quiet_ + 1 : 0;
    return quiet_ >= kPatience || square == 0;
  }

  void find_both() {
    std::vector<Eigen::Vector3d> heads(start_.heads.size() / 3);
    for (std::size_t j = 0; j < heads.size(); ++j) {
      heads[j] = (Eigen::Vector3d::Map(start_.heads.data() + 3 * j) - clip_.centre) / clip_.size;
    }
    const auto [labels, count] = find_clusters(clip_, neighbours_, start_.joint_count, heads, progress_);
    done(0);
    set_weights(static_cast<std::size_t>(settings_.max_influences));
    for (std::size_t p = 0; p < points(); ++p) {
      weights_.joints[p * weights_.width] = labels[p];
      weights_.weights[p * weights_.width] = 1;
    }
    motions_ = Motions(clip_.frames, count);
    MotionFit(clip_, weights_, count, progress_).fit_alone(motions_, progress_);
    const auto candidates = static_cast<std::size_t>(std::max(2 * settings_.max_influences, 12));
    const WeightFit fit = weight_fit(candidates, kWeightSweeps);
    while (iterations_ < settings_.iterations) {
      const double square = fit.improve(motions_, weights_, progress_);
      const MotionFit motion_fit(clip_, weights_, count, progress_);
      motion_fit.improve(motions_, kMotionSweeps, progress_);
      ++iterations_;
      done(1);
      if (has_settled(square)) break;
      if (iterations_ + 1 < settings_.iterations) revive(motion_fit);
    }
  }

  /// Gives joints that have lost their points those around the point that moves worst.
  void revive(const MotionFit& fit) {
    std::vector<std::int32_t> idle;
    for (std::int32_t j = 0; j < motions_.joints(); ++j) {
      if (!(fit.mass(j) >= kLeastMass)) idle.push_back(j);
    }
    if (idle.empty() || !start_.heads.empty()) return;
    std::vector<double> squares = squares_of_points();
    for (const std::int32_t joint : idle) {
      const auto worst = static_cast<std::uint32_t>(std::max_element(squares.begin(), squares.end()) - squares.begin());
      if (squares[worst] == 0) return;
      std::vector<std::uint32_t> around{worst};
      for (std::size_t i = 0, last = 1; i < last && around.size() < 20; ++i, last = around.size()) {
        for (const auto& [other, share] : neighbours_[around[i]]) {
          if (std::find(around.begin(), around.end(), other) == around.end()) around.push_back(other);
        }
      }
      for (const std::uint32_t p : around) {
        std::fill_n(weights_.weights.begin() + static_cast<std::ptrdiff_t>(p * weights_.width), weights_.width, 0.0);
        weights_.joints[p * weights_.width] = joint;
        weights_.weights[p * weights_.width] = 1;
        squares[p] = 0;
      }
      WeightRows alone{weights_.width, weights_.joints, std::vector<double>(weights_.weights.size())};
      for (const std::uint32_t p : around) alone.weights[p * weights_.width] = 1;
      Motions own = motions_;
      MotionFit(clip_, alone, motions_.joints(), progress_).fit_alone(own, progress_);
      for (std::ptrdiff_t f = 0; f < clip_.frames; ++f) motions_.set(f, joint, own.at(f, joint));
    }
  }

  /// Returns where skinning moves a point minus where it is, in all frames.
  Eigen::RowVectorXd offsets_of(std::size_t p) const {
    Eigen::RowVectorXd moved =
        -Eigen::RowVectorXf::Map(clip_.row(p), static_cast<Eigen::Index>(clip_.numbers())).cast<double>();
    for (std::size_t i = p * weights_.width; i < (p + 1) * weights_.width; ++i) {
      if (weights_.weights[i] == 0) continue;
      const Eigen::RowVector4d shares = weights_.weights[i] * clip_.rest[p].transpose();
      moved.noalias() += shares * motions_.rows().middleRows<4>(4 * weights_.joints[i]);
    }
    return moved;
  }

  std::vector<double> squares_of_points() const {
    std::vector<double> squares(points());
    parallel_for(points(), 256, [&](std::size_t begin, std::size_t end) {
      stop_if_cancelled(progress_);
      for (std::size_t p = begin; p < end; ++p) squares[p] = offsets_of(p).squaredNorm();
    });
    return squares;
  }

  void fit_weights() {
    const auto joints = std::ssize(start_.matrices) / clip_.frames;
    motions_ = Motions(clip_.frames, joints);
    for (std::ptrdiff_t f = 0; f < clip_.frames; ++f) {
      for (std::ptrdiff_t j = 0; j < joints; ++j) {
        motions_.set(f, j, clip_.inward(start_.matrices[f * joints + j], f));
      }
    }
    done(kClusterSteps);
    set_weights(static_cast<std::size_t>(settings_.max_influences));
    const WeightFit fit = weight_fit(static_cast<std::size_t>(joints), 1);
    while (iterations_ < settings_.iterations) {
      const double square = fit.improve(motions_, weights_, progress_);
      ++iterations_;
      done(1);
      if (settings_.smoothing == 0 || has_settled(square)) break;
    }
  }

  void fit_motions() {
    std::size_t width = 1;
    for (std::size_t v = 0; v < points(); ++v) width = std::max(width, start_.weights.row(v).size());
    set_weights(width);
    for (std::size_t v = 0; v < points(); ++v) {
      std::size_t place = v * width;
      for (const auto& [joint, weight] : start_.weights.row(v)) {
        weights_.joints[place] = joint;
        weights_.weights[place++] = weight;
      }
    }
    move_by_sums();
    motions_ = Motions(clip_.frames, start_.weights.bones());
    const MotionFit fit(clip_, weights_, start_.weights.bones(), progress_);
    fit.fit_alone(motions_, progress_);
    done(kClusterSteps);
    while (iterations_ < settings_.iterations) {
      fit.improve(motions_, kMotionSweeps, progress_);
      const std::vector<double> squares = squares_of_points();
      ++iterations_;
      done(1);
      if (has_settled(std::accumulate(squares.begin(), squares.end(), 0.0))) break;
    }
  }

  /// Skinning moves a vertex whose weights have another sum than 1 by that sum of the frame's centre, from which the clip's
  /// positions are measured.
  void move_by_sums() {
    for (std::size_t p = 0; p < points(); ++p) {
      const auto own = std::span(weights_.weights).subspan(p * weights_.width, weights_.width);
      const double more = (std::accumulate(own.begin(), own.end(), 0.0) - 1) / clip_.size;
      for (std::size_t f = 0; f < clip_.frame_centres.size(); ++f) {
        float* const moved = clip_.moves.data() + p * clip_.numbers() + 3 * f;
        for (int axis = 0; axis < 3; ++axis) {
          moved[axis] = static_cast<float>(moved[axis] - more * clip_.frame_centres[f][axis]);
        }
      }
    }
  }

  /// Numbers joints anew without those that move nothing, unless the caller knows their numbers.
  std::vector<std::int32_t> joint_numbers() const {
    std::vector<std::int32_t> number(motions_.joints(), -1);
    for (std::size_t i = 0; i < weights_.weights.size(); ++i) {
      if (weights_.weights[i] > 0) number[weights_.joints[i]] = 0;
    }
    std::int32_t next = 0;
    for (std::int32_t& one : number) {
      if (one == 0 || start_.joint_count == 0) one = next++;
    }
    return number;
  }

  /// Leaves out weights that are too small to be seen, and has the others sum to 1 in float32.
  void round_weights() {
    if (has_weights()) return;
    for (std::size_t p = 0; p < points(); ++p) {
      const auto own = std::span(weights_.weights).subspan(p * weights_.width, weights_.width);
      double sum = 0;
      for (double& weight : own) sum += weight = weight < kLeastWeight ? 0 : weight;
      for (double& weight : own) weight = static_cast<float>(weight / sum);
    }
  }

  WeightTable influences(std::span<const std::int32_t> number) const {
    if (has_weights()) return start_.weights;
    WeightTable table(std::ranges::max(number) + 1);
    std::vector<BoneWeight> row;
    for (const std::uint32_t p : clip_.point_of) {
      row.clear();
      for (std::size_t i = p * weights_.width; i < (p + 1) * weights_.width; ++i) {
        if (weights_.weights[i] == 0) continue;
        row.push_back({number[weights_.joints[i]], static_cast<float>(weights_.weights[i])});
      }
      table.add_row(row);
    }
    return table;
  }

  void add_motions(Decomposition& made, const std::vector<std::int32_t>& number) const {
    const auto joints = made.weights.bones();
    made.rest.assign(joints, Matrix4<double>::Identity());
    made.poses.resize(static_cast<std::size_t>(clip_.frames * joints));
    const MotionFit fit(clip_, weights_, motions_.joints(), progress_);
    for (std::ptrdiff_t j = 0; j < motions_.joints(); ++j) {
      if (number[j] < 0) continue;
      Eigen::Vector3d head = clip_.centre;
      if (!start_.heads.empty()) {
        head = Eigen::Vector3d::Map(start_.heads.data() + 3 * j);
      } else if (fit.mass(j) > 0) {
        head += clip_.size * fit.centre(j);
      }
      made.rest[number[j]].block<3, 1>(0, 3) = head;
      for (std::ptrdiff_t f = 0; f < clip_.frames; ++f) {
        made.poses[f * joints + number[j]] =
            start_.matrices.empty() ? clip_.outward(motions_.at(f, j), f) : start_.matrices[f * joints + j];
      }
    }
  }

  void add_errors(Decomposition& made) const {
    const std::size_t frames = static_cast<std::size_t>(clip_.frames);
    std::vector<double> squares(points()), sums(points()), largest(points());
    parallel_for(points(), 256, [&](std::size_t begin, std::size_t end) {
      stop_if_cancelled(progress_);
      for (std::size_t p = begin; p < end; ++p) {
        const Eigen::RowVectorXd off = offsets_of(p);
        for (std::size_t f = 0; f < frames; ++f) {
          const double distance = clip_.size * off.segment<3>(static_cast<Eigen::Index>(3 * f)).norm();
          squares[p] += distance * distance;
          sums[p] += distance;
          largest[p] = std::max(largest[p], distance);
        }
      }
    });
    for (const std::uint32_t p : clip_.point_of) {
      made.rms += squares[p];
      made.mean += sums[p];
      made.largest = std::max(made.largest, largest[p]);
      made.vertex_rms.push_back(static_cast<float>(std::sqrt(squares[p] / static_cast<double>(frames))));
      made.vertex_largest.push_back(static_cast<float>(largest[p]));
    }
    const double count = static_cast<double>(frames) * static_cast<double>(clip_.point_of.size());
    made.rms = std::sqrt(made.rms / count);
    made.mean /= count;
  }

  Decomposition result() {
    Decomposition made;
    round_weights();
    const std::vector<std::int32_t> number = joint_numbers();
    made.weights = influences(number);
    add_motions(made, number);
    add_errors(made);
    made.iterations = iterations_;
    done(settings_.iterations - iterations_ + 1);
    return made;
  }

  const DeformedMesh& mesh_;
  const DecompositionStart& start_;
  const DecompositionSettings& settings_;
  Progress* progress_;
  Clip clip_;
  Neighbours neighbours_;
  WeightRows weights_;
  Motions motions_;
  int iterations_ = 0, quiet_ = 0;
  double square_ = std::numeric_limits<double>::infinity();
};

}  // namespace

std::optional<Decomposition> decompose(const DeformedMesh& mesh, const DecompositionStart& start,
                                       const DecompositionSettings& settings, Progress* progress) {
  check_decomposition(mesh, start, settings);
  try {
    return Decomposer(mesh, start, settings, progress).run();
  } catch (const Cancelled&) {
    return std::nullopt;
  }
}

}  // namespace sinew
