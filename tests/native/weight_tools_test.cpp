#include "sinew/weight_tools.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <functional>
#include <random>

#include "failures.h"

namespace sinew {
namespace {

using Ints = std::vector<std::int32_t>;

/// A strip of quads along x, two vertices wide.
struct Strip {
  std::vector<float> positions;
  Ints offsets{0}, corners;

  explicit Strip(int length, float first = 0) {
    for (int i = 0; i < length; ++i) {
      for (const float y : {0.0f, 1.0f}) positions.insert(positions.end(), {first + static_cast<float>(i), y, 0});
    }
    for (int i = 0; i + 1 < length; ++i) {
      corners.insert(corners.end(), {2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1});
      offsets.push_back(static_cast<std::int32_t>(corners.size()));
    }
  }
  std::ptrdiff_t vertices() const { return std::ssize(positions) / 3; }
  Faces faces() const { return {offsets, corners}; }
};

WeightTable random_table(std::ptrdiff_t vertices, int bones, unsigned seed) {
  std::mt19937 random(seed);
  std::exponential_distribution<float> draw;
  std::vector<float> dense(static_cast<std::size_t>(vertices * bones));
  for (float& weight : dense) weight = draw(random);
  for (std::ptrdiff_t v = 0; v < vertices; ++v) {
    float* const row = dense.data() + v * bones;
    const float sum = std::accumulate(row, row + bones, 0.0f);
    for (int j = 0; j < bones; ++j) row[j] /= sum;
  }
  return WeightTable::from_dense("weights", dense, vertices, bones);
}

float weight_of(const WeightTable& table, std::size_t vertex, int bone) {
  for (const BoneWeight& own : table.row(vertex)) {
    if (own.bone == bone) return own.weight;
  }
  return 0;
}

double sum_of_row(const WeightTable& table, std::size_t vertex) {
  double sum = 0;
  for (const BoneWeight& own : table.row(vertex)) sum += own.weight;
  return sum;
}

TEST(SmoothWeights, TheOthersShareWhatLockedOnesLeave) {
  const Strip strip(8);
  const WeightTable before = random_table(strip.vertices(), 4, 1);
  const Ints locked{2};
  for (const double strength : {0.0, 3.0}) {
    SmoothWeightsSettings settings;
    settings.strength = strength;
    const WeightTable free = *smooth_weights(before, strip.faces(), settings);
    settings.locked = locked;
    const WeightTable made = *smooth_weights(before, strip.faces(), settings);
    for (std::size_t v = 0; v < static_cast<std::size_t>(strip.vertices()); ++v) {
      EXPECT_EQ(weight_of(made, v, 2), weight_of(before, v, 2));
      EXPECT_NEAR(sum_of_row(made, v), sum_of_row(before, v), 1e-6);
      // In the proportions that they have without locks.
      EXPECT_NEAR(weight_of(made, v, 0) * weight_of(free, v, 3), weight_of(made, v, 3) * weight_of(free, v, 0), 1e-6);
    }
  }
}

/// How far a vertex moves at most over the poses, if it has other weights.
double largest_move(const WeightTable& before, const std::vector<double>& after, std::size_t v, const float* position,
                    const std::vector<Matrix4<double>>& matrices) {
  const auto bones = static_cast<std::size_t>(before.bones());
  const Eigen::Vector4d rest(position[0], position[1], position[2], 1);
  double largest = 0;
  for (std::size_t f = 0; f < matrices.size() / bones; ++f) {
    Eigen::Vector4d off = Eigen::Vector4d::Zero();
    for (std::size_t j = 0; j < bones; ++j) {
      off += (after[j] - weight_of(before, v, static_cast<int>(j))) * (matrices[f * bones + j] * rest);
    }
    largest = std::max(largest, off.head<3>().norm());
  }
  return largest;
}

TEST(ReduceWeights, TheFitIsNotTakenIfAVertexMovesFarther) {
  constexpr int kBones = 4, kPoses = 3;
  const Strip strip(60);
  const WeightTable before = random_table(strip.vertices(), kBones, 2);
  std::mt19937 random(3);
  std::normal_distribution<double> draw;
  std::vector<Matrix4<double>> matrices(kBones * kPoses, Matrix4<double>::Identity());
  for (auto& matrix : matrices) matrix.topRightCorner<3, 1>() << draw(random), draw(random), draw(random);
  const auto stack = MatrixStack<const double>::of(matrices.data(), kPoses, kBones);
  const auto made = reduce_weights(before, strip.positions, stack, {}, {3, 0, {}});
  int fitted = 0;
  for (std::size_t v = 0; v < static_cast<std::size_t>(strip.vertices()); ++v) {
    double best = std::numeric_limits<double>::infinity();
    for (int out = 0; out < kBones; ++out) {
      std::vector<double> own(kBones);
      for (int j = 0; j < kBones; ++j)
        own[j] = j == out ? 0 : weight_of(before, v, j) / (1 - weight_of(before, v, out));
      best = std::min(best, largest_move(before, own, v, &strip.positions[3 * v], matrices));
    }
    std::vector<double> own(kBones);
    for (int j = 0; j < kBones; ++j) own[j] = weight_of(made->weights, v, j);
    const double move = largest_move(before, own, v, &strip.positions[3 * v], matrices);
    EXPECT_LE(move, best + 1e-5);
    EXPECT_NEAR(move, made->largest[v], 1e-5);
    EXPECT_LE(made->weights.row(v).size(), 3u);
    fitted += move < best - 1e-5;
  }
  EXPECT_GT(fitted, 5);
  EXPECT_LT(fitted, strip.vertices());
}

TEST(MirrorWeights, FacesAcrossThePlaneCountOnTheirSideAlone) {
  const Strip strip(6, -2.3f);  // none of its vertices is in the middle, or has a twin
  const WeightTable before = random_table(strip.vertices(), 3, 4), others = random_table(strip.vertices(), 3, 9);
  WeightTable other(3);  // other weights on the side that is overwritten
  for (std::size_t v = 0; v < 12; ++v) other.add_row(v < 6 ? others.row(v) : before.row(v));
  const Ints pairs{1, 0, 2};
  const WeightTable made = *mirror_weights(before, strip.positions, strip.faces(), pairs, {});
  const WeightTable made_of_other = *mirror_weights(other, strip.positions, strip.faces(), pairs, {});
  EXPECT_TRUE(std::ranges::equal(made.entries(), made_of_other.entries()));
  for (std::size_t v = 0; v < 12; ++v) EXPECT_NEAR(sum_of_row(made, v), 1, 1e-6);
  // -0.3 is nearest to what is between -0.3 and 0.7, of which 0.7 alone counts.
  for (int bone = 0; bone < 3; ++bone) {
    EXPECT_NEAR(weight_of(made, 4, bone), weight_of(before, 6, bone < 2 ? 1 - bone : bone), 1e-6);
  }
}

TEST(TransferWeights, SmallWeightsAreFilledIn) {
  const Strip body(4);
  // Beyond the body, where a bone of little weight fades out.
  const Strip sleeve(12);
  std::vector<float> dense;
  for (int v = 0; v < 8; ++v) dense.insert(dense.end(), {0.995f, 0.005f});
  const WeightTable weights = WeightTable::from_dense("weights", dense, 8, 2);
  const auto made = transfer_weights(body.positions, body.faces(), weights, sleeve.positions, sleeve.faces(), {});
  ASSERT_FALSE(made->matched.back());
  for (std::size_t v = 0; v < 24; ++v) EXPECT_NEAR(weight_of(made->weights, v, 1), 0.005, 1e-4) << v;
}

/// Cancels at the first look, the second, the fourth and so on, until there are fewer looks: then the result is that of
/// `expected`. Returns how many attempts were cancelled.
template <class Run>
int cancelled_attempts(const WeightTable& expected, const Run& run) {
  int attempts = 0;
  for (std::int64_t looks = 0;; looks = looks == 0 ? 1 : 2 * looks, ++attempts) {
    Progress progress;
    progress.cancel_after(looks);
    if (const std::optional<WeightTable> made = run(&progress)) {
      EXPECT_EQ(*made, expected);
      return attempts;
    }
    EXPECT_LT(progress.fraction(), 1);
  }
}

TEST(WeightTools, AreCancelledAtAnyTime) {
  const Strip strip(4000);
  const WeightTable table = random_table(strip.vertices(), 6, 5);
  std::vector<Matrix4<double>> matrices(6, Matrix4<double>::Identity());
  for (int j = 0; j < 6; ++j) matrices[j](2, 3) = j;
  const auto stack = MatrixStack<const double>::of(matrices.data(), 1, 6);
  std::vector<float> apart = strip.positions;  // half of it has no source near by
  for (std::size_t i = apart.size() / 2; i < apart.size(); i += 3) apart[i + 2] = 0.5f * static_cast<float>(i);
  const std::function<std::optional<WeightTable>(Progress*)> tools[] = {
      [&](Progress* progress) { return smooth_weights(table, strip.faces(), {}, progress); },
      [&](Progress* progress) {
        SmoothWeightsSettings settings;
        settings.strength = 1;
        return smooth_weights(table, strip.faces(), settings, progress);
      },
      [&](Progress* progress) -> std::optional<WeightTable> {
        auto made = reduce_weights(table, strip.positions, stack, strip.faces(), {2, 2, {}}, progress);
        if (!made) return std::nullopt;
        return std::move(made->weights);
      },
      [&](Progress* progress) {
        MirrorSettings settings;
        settings.origin = 2000;
        return mirror_weights(table, strip.positions, strip.faces(), Ints{0, 1, 2, 3, 4, 5}, settings, progress);
      },
      [&](Progress* progress) -> std::optional<WeightTable> {
        auto made = transfer_weights(strip.positions, strip.faces(), table, apart, strip.faces(), {}, progress);
        if (!made) return std::nullopt;
        return std::move(made->weights);
      }};
  for (const auto& tool : tools) EXPECT_GT(cancelled_attempts(*tool(nullptr), tool), 3);
}

}  // namespace
}  // namespace sinew
