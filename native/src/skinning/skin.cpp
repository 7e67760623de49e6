#include "sinew/skin.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <mutex>

#include "base/offsets.h"
#include "base/steady_instruction_set.h"
#include "skinning/blocked_skin.h"
#include "skinning/kernels.h"

namespace sinew {

namespace {

/// Has no branch in the loop, so that it is vectorised.
bool all_finite(std::span<const float> numbers) {
  constexpr std::uint32_t kExponent = 0x7f800000;
  std::uint32_t any = 0;
  for (const float number : numbers) any |= (std::bit_cast<std::uint32_t>(number) & kExponent) == kExponent;
  return any == 0;
}

void check_positions(std::span<const float> positions) {
  if (all_finite(positions)) return;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (!std::isfinite(positions[i])) fail("the rest position of vertex ", i / 3, " is not finite");
  }
}

}  // namespace

struct Skin::Packed {
  std::mutex mutex;
  std::map<int, std::unique_ptr<BlockedSkin>> by_lanes;  // guarded by mutex
};

Skin::Skin(std::span<const float> rest_positions, std::span<const std::int64_t> offsets,
           std::span<const std::int32_t> joints, std::span<const float> weights, std::ptrdiff_t joint_count)
    : rest_positions_(rest_positions.begin(), rest_positions.end()),
      offsets_(offsets.begin(), offsets.end()),
      joints_(joints.begin(), joints.end()),
      weights_(weights.begin(), weights.end()),
      joint_count_(joint_count) {
  check();
  drop_dead_influences();
  measure();
  packed_ = std::make_unique<Packed>();
  const SteadyInstructionSet steady;
  blocked();
}

Skin::Skin(Skin&&) noexcept = default;
Skin& Skin::operator=(Skin&&) noexcept = default;
Skin::~Skin() = default;

const BlockedSkin& Skin::blocked() const {
  const int lanes = kernel_lanes();
  const std::lock_guard lock(packed_->mutex);
  auto& blocked = packed_->by_lanes[lanes];
  if (!blocked) {
    blocked = std::make_unique<BlockedSkin>(rest_positions_, offsets_, joints_, weights_, joint_count_);
  }
  return *blocked;
}

void Skin::set_rest_positions(std::span<const float> positions) {
  if (positions.size() != rest_positions_.size()) {
    fail("positions has ", plural(positions.size(), "number"), "; the skin has ", grouped(rest_positions_.size()), " (",
         vertex_count(), " x 3)");
  }
  check_positions(positions);
  std::ranges::copy(positions, rest_positions_.begin());
  const SteadyInstructionSet steady;
  const std::lock_guard lock(packed_->mutex);
  const int lanes = kernel_lanes();
  std::erase_if(packed_->by_lanes, [&](const auto& other) { return other.first != lanes; });
  for (auto& [own, blocked] : packed_->by_lanes) blocked->pack_rest_positions();
}

void check_counts(std::int64_t vertices, std::int64_t influences, std::int64_t joints) {
  if (joints < 0) fail("joint_count is ", joints, "; expected 0 or more");
  if (joints > kMostJoints) {
    fail("joint_count is ", grouped(joints), "; expected at most ", grouped(kMostJoints));
  }
  const auto check_most = [](std::int64_t count, const char* what) {
    if (count <= kMostNumbers) return;
    fail("there are ", plural(count, what), "; expected at most ", grouped(kMostNumbers));
  };
  check_most(vertices, "vertex");
  check_most(influences, "influence");
}

void Skin::check() const {
  check_counts(static_cast<std::int64_t>(rest_positions_.size() / 3), static_cast<std::int64_t>(joints_.size()),
               joint_count_);
  if (rest_positions_.size() % 3 != 0) {
    fail("rest_positions has ", plural(rest_positions_.size(), "number"), "; expected three per vertex");
  }
  const std::size_t vertices = rest_positions_.size() / 3;
  if (joints_.size() != weights_.size()) {
    fail("joints has ", grouped(joints_.size()), " entries and weights has ", grouped(weights_.size()),
         "; expected as many of each");
  }
  const auto total = static_cast<std::int64_t>(joints_.size());
  check_offsets<std::int64_t>("offsets", offsets_, total, "influences", static_cast<std::ptrdiff_t>(vertices),
                              "vertices");
  check_positions(rest_positions_);
  std::uint32_t largest_joint = 0;
  for (const std::int32_t joint : joints_) largest_joint = std::max(largest_joint, static_cast<std::uint32_t>(joint));
  if (all_finite(weights_) && (total == 0 || largest_joint < joint_count_)) return;
  for (std::int64_t i = 0; i < total; ++i) {
    if (joints_[i] < 0 || joints_[i] >= joint_count_) {
      fail("influence ", i, " names joint ", joints_[i], "; there are ", plural(joint_count_, "joint"));
    }
    if (!std::isfinite(weights_[i])) fail("the weight of influence ", i, " is not finite");
  }
}

/// Removes all influences of vertices whose weights are all zero, so that the frame loop has only one
/// case, not two, of a vertex that nothing moves.
void Skin::drop_dead_influences() {
  std::int64_t kept = 0;
  std::int64_t begin = 0;
  for (std::size_t v = 0; v + 1 < offsets_.size(); ++v) {
    const std::int64_t end = offsets_[v + 1];
    const auto alive = [&] {
      for (auto i = begin; i < end; ++i) {
        if (weights_[i] != 0) return true;
      }
      return false;
    };
    if (alive()) {
      if (kept != begin) {
        std::copy(joints_.begin() + begin, joints_.begin() + end, joints_.begin() + kept);
        std::copy(weights_.begin() + begin, weights_.begin() + end, weights_.begin() + kept);
      }
      kept += end - begin;
    }
    begin = end;
    offsets_[v + 1] = kept;
  }
  joints_.resize(kept);
  weights_.resize(kept);
}

void Skin::measure() {
  for (std::ptrdiff_t v = 0; v < vertex_count(); ++v) {
    const std::ptrdiff_t count = offsets_[v + 1] - offsets_[v];
    most_influences_ = std::max(most_influences_, count);
    if (count == 0) {
      ++unweighted_count_;
      continue;
    }
    double sum = 0;
    for (auto i = offsets_[v]; i < offsets_[v + 1]; ++i) sum += weights_[i];
    largest_sum_error_ = std::max(largest_sum_error_, std::abs(sum - 1));
  }
}

Skin Skin::from_dense(std::span<const float> rest_positions, const double* weights, std::ptrdiff_t rows,
                      std::ptrdiff_t columns, std::ptrdiff_t row_stride, std::ptrdiff_t column_stride) {
  const auto vertices = static_cast<std::ptrdiff_t>(rest_positions.size() / 3);
  check_counts(vertices, 0, columns);
  if (rows != vertices) {
    fail("weights has ", plural(rows, "row"), "; there are ", plural(vertices, "vertex"));
  }
  std::vector<std::int64_t> offsets{0};
  std::vector<std::int32_t> joints;
  std::vector<float> sparse;
  offsets.reserve(rows + 1);
  for (std::ptrdiff_t v = 0; v < rows; ++v) {
    for (std::ptrdiff_t j = 0; j < columns; ++j) {
      const double weight = weights[v * row_stride + j * column_stride];
      if (!std::isfinite(weight)) fail("the weight in row ", v, ", column ", j, " is not finite");
      if (weight == 0) continue;
      joints.push_back(static_cast<std::int32_t>(j));
      sparse.push_back(static_cast<float>(weight));
    }
    offsets.push_back(static_cast<std::int64_t>(joints.size()));
  }
  return Skin(rest_positions, offsets, joints, sparse, columns);
}

}  // namespace sinew
