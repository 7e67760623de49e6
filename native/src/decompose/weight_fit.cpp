#include "decompose/weight_fit.h"

#include <algorithm>
#include <numeric>
#include <span>

#include "base/cancelled.h"
#include "base/parallel.h"
#include "decompose/simplex_least_squares.h"

namespace sinew {
namespace {

/// So many points are a task: their moves are multiplied with those of their joints as matrices.
constexpr std::size_t kPoints = 64;

/// Steps towards (I + L)^-1, each of which halves what is missing.
constexpr int kSmoothSteps = 8;

using Rows = Motions::Rows;

Rows moves_of(const Clip& clip, std::size_t begin, std::size_t end) {
  Rows moves(end - begin, clip.numbers());
  std::copy(clip.row(begin), clip.row(end), moves.data());
  return moves;
}

/// Sums over frames of M_j^T M_k: J x J matrices of 4 x 4.
Eigen::MatrixXd squares_of(const Motions& motions, const Progress* progress) {
  Eigen::MatrixXd squares(motions.rows().rows(), motions.rows().rows());
  parallel_for(motions.joints(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t j = begin; j < end; ++j) {
      stop_if_cancelled(progress);
      const auto first = static_cast<Eigen::Index>(4 * j);
      squares.middleCols<4>(first).noalias() = motions.rows() * motions.rows().middleRows<4>(first).transpose();
    }
  });
  return squares;
}

/// Dense weights, P x J.
class Panel {
 public:
  Panel(const WeightRows& weights, std::size_t points, std::size_t joints)
      : joints_(joints), numbers_(points * joints) {
    for (std::size_t i = 0; i < points * weights.width; ++i) {
      if (weights.weights[i] > 0) {
        numbers_[i / weights.width * joints + weights.joints[i]] = static_cast<float>(weights.weights[i]);
      }
    }
  }
  const float* row(std::size_t point) const { return numbers_.data() + point * joints_; }

  /// w <- (w + mean of neighbours' w) / 2 in place of 1 + L: the same w* after many steps.
  void smooth(const Neighbours& neighbours, const Progress* progress) {
    const std::vector<float> start = numbers_;
    std::vector<float> next(numbers_.size());
    for (int step = 0; step < kSmoothSteps; ++step) {
      parallel_for(neighbours.size(), 512, [&](std::size_t begin, std::size_t end) {
        stop_if_cancelled(progress);
        for (std::size_t p = begin; p < end; ++p) {
          float* const own = next.data() + p * joints_;
          std::copy_n(start.data() + p * joints_, joints_, own);
          if (neighbours[p].empty()) continue;
          for (const auto& [point, share] : neighbours[p]) {
            const float* const other = row(point);
            for (std::size_t j = 0; j < joints_; ++j) own[j] += share * other[j];
          }
          for (std::size_t j = 0; j < joints_; ++j) own[j] *= 0.5f;
        }
      });
      numbers_.swap(next);
    }
  }

 private:
  std::size_t joints_;
  std::vector<float> numbers_;
};

/// Smooth weights below are those of joints too far away.
constexpr float kNear = 1e-6f;

/// Finds the joints that are tried at a point: those of the largest smooth weights; all if none is known or `most` is 0.
void choose(const float* smooth, std::size_t joints, std::size_t most, std::vector<std::int32_t>& chosen) {
  chosen.clear();
  for (std::size_t j = 0; j < joints && most > 0; ++j) {
    if (smooth[j] > kNear) chosen.push_back(static_cast<std::int32_t>(j));
  }
  if (chosen.size() > most) {
    std::nth_element(
        chosen.begin(), chosen.begin() + static_cast<std::ptrdiff_t>(most), chosen.end(),
        [&](std::int32_t a, std::int32_t b) { return std::pair(-smooth[a], a) < std::pair(-smooth[b], b); });
    chosen.resize(most);
    std::sort(chosen.begin(), chosen.end());
  }
  if (chosen.empty()) {
    chosen.resize(joints);
    std::iota(chosen.begin(), chosen.end(), 0);
  }
}

/// Least squares of the points of one task; their joints are chosen once, for all sweeps.
struct Task {
  std::vector<std::uint32_t> begin{0};  ///< of each point in those below, and the end
  std::vector<std::int32_t> chosen;     ///< of each point
  std::vector<double> moved;            ///< of each point and chosen joint: sum over frames of x . M (u, 1)

  std::span<const std::int32_t> chosen_at(std::size_t i) const {
    return std::span(chosen).subspan(begin[i], begin[i + 1] - begin[i]);
  }
  Eigen::Map<const Eigen::VectorXd> moved_at(std::size_t i) const {
    return {moved.data() + begin[i], static_cast<Eigen::Index>(begin[i + 1] - begin[i])};
  }
};

/// One point's system: G_ik = u^T (sum over frames of M_i^T M_k) u for its chosen joints i and k, with a pull on the
/// diagonal. Of the columns, n numbers each, a solution asks for a few. The memory is kept from point to point.
class System final : public Gram {
 public:
  /// squares and chosen stay where they are until the next begin.
  void begin(const Eigen::MatrixXd& squares, const Eigen::Vector4d& rest, std::span<const std::int32_t> chosen) {
    squares_ = &squares;
    rest_ = rest;
    chosen_ = chosen;
    is_made_.assign(size(), 0);
    columns_.resize(std::max(columns_.size(), size() * size()));
    diagonal_.resize(size());
    for (std::size_t i = 0; i < size(); ++i) diagonal_[i] = entry(i, i);
  }

  void pull(double by) {
    for (double& own : diagonal_) own += by;
  }

  std::span<const double> diagonal() override { return diagonal_; }

  std::span<const double> column(std::size_t k) override {
    const std::span own = std::span(columns_).subspan(k * size(), size());
    if (!is_made_[k]) {
      for (std::size_t i = 0; i < size(); ++i) own[i] = i == k ? diagonal_[k] : entry(std::max(i, k), std::min(i, k));
      is_made_[k] = 1;
    }
    return own;
  }

 private:
  std::size_t size() const { return chosen_.size(); }

  double entry(std::size_t i, std::size_t k) const {
    return rest_.dot(squares_->block<4, 4>(4 * chosen_[i], 4 * chosen_[k]) * rest_);
  }

  const Eigen::MatrixXd* squares_ = nullptr;
  Eigen::Vector4d rest_;
  std::span<const std::int32_t> chosen_;
  std::vector<std::uint8_t> is_made_;
  std::vector<double> columns_, diagonal_;
};

Task prepared(const Clip& clip, const Motions& motions, const Panel& smooth, std::size_t most, std::size_t begin,
              std::size_t end) {
  Task task;
  std::vector<std::int32_t> column(motions.joints(), -1), together, chosen;
  for (std::size_t p = begin; p < end; ++p) {
    choose(smooth.row(p), static_cast<std::size_t>(motions.joints()), most, chosen);
    task.chosen.insert(task.chosen.end(), chosen.begin(), chosen.end());
    task.begin.push_back(static_cast<std::uint32_t>(task.chosen.size()));
    for (const std::int32_t j : chosen) {
      if (column[j] >= 0) continue;
      column[j] = static_cast<std::int32_t>(together.size());
      together.push_back(j);
    }
  }
  Rows rows(4 * together.size(), clip.numbers());
  for (std::size_t i = 0; i < together.size(); ++i) {
    rows.middleRows<4>(static_cast<Eigen::Index>(4 * i)) = motions.rows().middleRows<4>(4 * together[i]);
  }
  const Rows products = moves_of(clip, begin, end) * rows.transpose();
  task.moved.reserve(task.chosen.size());
  for (std::size_t p = begin; p < end; ++p) {
    for (const std::int32_t j : task.chosen_at(p - begin)) {
      task.moved.push_back(products.block<1, 4>(static_cast<Eigen::Index>(p - begin), 4 * column[j]).dot(clip.rest[p]));
    }
  }
  return task;
}

}  // namespace

double WeightFit::improve(const Motions& motions, WeightRows& weights, const Progress* progress) const {
  const auto points = static_cast<std::size_t>(clip_.point_count()),
             joints = static_cast<std::size_t>(motions.joints());
  const std::size_t tasks = (points + kPoints - 1) / kPoints;
  const Eigen::MatrixXd squares = squares_of(motions, progress);
  const double pull = settings_.smoothing * static_cast<double>(clip_.frames);
  std::vector<Task> prepared_tasks(tasks);
  std::vector<double> left(points);
  for (int sweep = 0; sweep < settings_.sweeps; ++sweep) {
    Panel smooth(weights, points, joints);
    smooth.smooth(neighbours_, progress);
    parallel_for(tasks, 1, [&](std::size_t first, std::size_t last) {
      SimplexLeastSquares solver;
      System system;
      Eigen::VectorXd b, x;
      for (std::size_t t = first; t < last; ++t) {
        stop_if_cancelled(progress);
        const std::size_t begin = t * kPoints, end = std::min(begin + kPoints, points);
        Task& task = prepared_tasks[t];
        if (sweep == 0) task = prepared(clip_, motions, smooth, settings_.local ? settings_.candidates : 0, begin, end);
        for (std::size_t p = begin; p < end; ++p) {
          const std::span<const std::int32_t> chosen = task.chosen_at(p - begin);
          const auto n = static_cast<Eigen::Index>(chosen.size());
          system.begin(squares, clip_.rest[p], chosen);
          x.setZero(n);
          const auto moved = task.moved_at(p - begin);
          b = moved;
          const float* const target = smooth.row(p);
          const bool is_known = std::any_of(target, target + joints, [](float w) { return w > 0; });
          const double own_pull = std::max(is_known ? pull : 0.0, 1e-12 * std::ranges::max(system.diagonal()));
          system.pull(own_pull);
          for (Eigen::Index i = 0; i < n && is_known; ++i) b[i] += own_pull * target[chosen[i]];
          // Begins with the weights of before, in the order of the joints.
          const std::size_t row = p * weights.width;
          for (std::size_t i = row; i < row + weights.width; ++i) {
            if (weights.weights[i] == 0) continue;
            const auto found = std::lower_bound(chosen.begin(), chosen.end(), weights.joints[i]);
            if (found != chosen.end() && *found == weights.joints[i]) x[found - chosen.begin()] = weights.weights[i];
          }
          solver.solve_sparse(system, b, static_cast<int>(settings_.max_influences), x);
          std::size_t place = row;
          double product = 0;  // x^T G x
          for (Eigen::Index i = 0; i < n; ++i) {
            if (x[i] == 0) continue;
            weights.joints[place] = chosen[i], weights.weights[place++] = x[i];
            product += x[i] * x.dot(Eigen::VectorXd::Map(system.column(i).data(), n));
          }
          std::fill(weights.weights.begin() + static_cast<std::ptrdiff_t>(place),
                    weights.weights.begin() + static_cast<std::ptrdiff_t>(row + weights.width), 0.0);
          const double square = Eigen::VectorXf::Map(clip_.row(p), static_cast<Eigen::Index>(clip_.numbers()))
                                    .cast<double>()
                                    .squaredNorm();
          left[p] = std::max(0.0, square - 2 * x.dot(moved) + product - own_pull * x.squaredNorm());
        }
      }
    });
  }
  return std::accumulate(left.begin(), left.end(), 0.0);
}

}  // namespace sinew
