#include "sinew/weight_tools.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>

#include "failures.h"
#include "weight_tools/inpaint_weights.h"
#include "weights/cotangents.h"

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

bool is_same_row(const WeightTable& a, const WeightTable& b, std::size_t vertex) {
  return std::ranges::equal(a.row(vertex), b.row(vertex));
}

/// Strips one behind the other.
Strip as_one(const std::vector<Strip>& strips) {
  Strip all(0);
  for (const Strip& strip : strips) {
    const auto first = static_cast<std::int32_t>(all.vertices());
    all.positions.insert(all.positions.end(), strip.positions.begin(), strip.positions.end());
    for (const std::int32_t corner : strip.corners) all.corners.push_back(first + corner);
    for (std::size_t i = 1; i < strip.offsets.size(); ++i) all.offsets.push_back(all.offsets.back() + 4);
  }
  return all;
}

TEST(SmoothWeights, OfCoincidentVerticesTheLeastMaskCounts) {
  const Strip strips = as_one({Strip(3), Strip(3, 2)});  // vertices 4 and 6, and 5 and 7, coincide
  const WeightTable before = random_table(strips.vertices(), 4, 6);
  for (const double strength : {0.0, 3.0}) {
    for (const float least : {0.0f, 0.25f}) {
      std::vector<float> mask(12, 1), equal = mask;
      mask[4] = mask[7] = equal[4] = equal[5] = equal[6] = equal[7] = least;
      SmoothWeightsSettings settings;
      settings.strength = strength;
      settings.positions = strips.positions;
      settings.mask = mask;
      const WeightTable made = *smooth_weights(before, strips.faces(), settings);
      for (const std::size_t v : {4u, 5u, 6u, 7u}) EXPECT_EQ(is_same_row(made, before, v), least == 0) << v;
      EXPECT_FALSE(is_same_row(made, before, 3));
      settings.mask = equal;
      EXPECT_EQ(made, *smooth_weights(before, strips.faces(), settings));
    }
  }
}

TEST(SmoothWeights, WithAStrengthAMaskBelowHalfHoldsAVertex) {
  const Strip strip(4);
  const WeightTable before = random_table(strip.vertices(), 4, 7);
  SmoothWeightsSettings settings;
  settings.strength = 2;
  const std::vector<float> mask{1, 0, 0.25f, 0.49f, 0.5f, 0.75f, 1, 1};
  settings.mask = mask;
  const WeightTable made = *smooth_weights(before, strip.faces(), settings);
  for (std::size_t v = 0; v < 8; ++v) EXPECT_EQ(is_same_row(made, before, v), mask[v] < 0.5f) << v;
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

/// A strip whose first two vertices have a bone 2 more, and poses in which each bone goes its own way. One of three
/// weights has to go: that of bone 0.
struct Fading {
  Strip strip{5};
  WeightTable weights{3};
  std::vector<Matrix4<double>> matrices{3, Matrix4<double>::Identity()};

  Fading() {
    for (std::ptrdiff_t v = 0; v < strip.vertices(); ++v) {
      const BoneWeight two[] = {{0, 0.5f}, {1, 0.5f}}, three[] = {{0, 0.2f}, {1, 0.4f}, {2, 0.4f}};
      weights.add_row(v < 2 ? std::span<const BoneWeight>(three) : two);
    }
    for (int j = 0; j < 3; ++j) matrices[j](j, 3) = 1;
  }
  WeightTable faded(int rings, const Ints& locked = {}) const {
    const auto stack = MatrixStack<const double>::of(matrices.data(), 1, 3);
    return reduce_weights(weights, strip.positions, stack, strip.faces(), {2, rings, locked})->weights;
  }
};

TEST(ReduceWeights, ABoneFadesOverSoManyRings) {
  const Fading fading;
  for (const int rings : {0, 1, 2, 3}) {
    const WeightTable made = fading.faded(rings);
    for (std::size_t v = 0; v < 10; ++v) {
      const double share = std::min(1.0, static_cast<double>(v / 2) / (rings + 1));  // of what it had
      EXPECT_NEAR(weight_of(made, v, 0), share / (share + 1), 1e-6) << v << " of " << rings;
      EXPECT_NEAR(sum_of_row(made, v), 1, 1e-6);
    }
    if (rings == 0) {
      for (std::size_t v = 2; v < 10; ++v) EXPECT_TRUE(is_same_row(made, fading.weights, v));
    }
  }
}

TEST(ReduceWeights, WhereABoneIsLockedNothingFades) {
  const Fading fading;
  const WeightTable made = fading.faded(2, {1});
  for (std::size_t v = 0; v < 2; ++v) {
    EXPECT_EQ(weight_of(made, v, 0), 0);
    EXPECT_EQ(weight_of(made, v, 1), 0.4f);
  }
  for (std::size_t v = 2; v < 10; ++v) EXPECT_TRUE(is_same_row(made, fading.weights, v)) << v;
}

/// The bones that a vertex in the origin keeps of as many as there are matrices, of one pose.
std::vector<int> kept_of(const std::vector<float>& weights, const std::vector<Matrix4<double>>& matrices, int most) {
  const auto bones = std::ssize(weights);
  const auto stack = MatrixStack<const double>::of(matrices.data(), 1, bones);
  const WeightTable table = WeightTable::from_dense("weights", weights, 1, bones);
  const std::vector<float> origin(3);
  const WeightTable made = reduce_weights(table, origin, stack, {}, {most, 0, {}})->weights;
  std::vector<int> kept;
  for (const BoneWeight& own : made.row(0)) kept.push_back(own.bone);
  return kept;
}

TEST(ReduceWeights, WhereNothingMovesTheLargestWeightsStay) {
  // All sets are tried of 12 bones; of 20 one leaves after the other; of 60 all but 24 at once.
  for (const int bones : {12, 20, 60}) {
    std::vector<float> weights;
    for (int j = 0; j < bones; ++j) weights.push_back(0.01f + 0.001f * static_cast<float>(7 * j % bones));
    const std::vector<Matrix4<double>> still(bones, Matrix4<double>::Identity());
    const int most = bones == 20 ? 9 : 4;
    std::vector<int> largest(bones);
    std::iota(largest.begin(), largest.end(), 0);
    std::ranges::sort(largest, [&](int a, int b) { return weights[a] > weights[b]; });
    largest.resize(most);
    std::ranges::sort(largest);
    EXPECT_EQ(kept_of(weights, still, most), largest) << bones;
    std::vector<Matrix4<double>> far = still;
    far[0](0, 3) = 1e200;  // its square is no number
    EXPECT_EQ(kept_of(weights, far, most), largest) << bones << ", too far";
  }
}

TEST(ReduceWeights, OfVeryManyThoseThatMoveTheVertexStay) {
  std::vector<float> weights(60, 0.96f / 56);
  std::vector<Matrix4<double>> matrices(60, Matrix4<double>::Identity());
  for (const int j : {10, 20, 30, 40}) {  // little, but far; together they move it nowhere
    weights[j] = 0.01f;
    matrices[j](j == 10 || j == 20 ? 0 : 1, 3) = j == 10 || j == 30 ? 100 : -100;
  }
  EXPECT_EQ(kept_of(weights, matrices, 4), (std::vector{10, 20, 30, 40}));
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

/// Which bone an island follows that begins at this place on the X axis: 1 if it is that of the coat, of which the part
/// from 4 to 8 has nothing below, or 0 if it is that of another body, which begins at `other`.
int followed_from(float first, int length, float other = 15) {
  const Strip bodies = as_one({Strip(4), Strip(4, other)}), coat = as_one({Strip(9), Strip(length, first)});
  std::vector<float> dense;
  for (int v = 0; v < 16; ++v) dense.insert(dense.end(), {v < 8 ? 0.0f : 1.0f, v < 8 ? 1.0f : 0.0f});
  const WeightTable weights = WeightTable::from_dense("weights", dense, 16, 2);
  const auto made =
      transfer_weights(bodies.positions, bodies.faces(), weights, coat.positions, coat.faces(), {0.01, 30, false});
  EXPECT_TRUE(made->matched[6] && !made->matched[16] && !made->matched[18]);
  for (std::size_t v = 0; v < 18; ++v) EXPECT_EQ(weight_of(made->weights, v, 1), 1);
  for (std::size_t v = 18; v < made->matched.size(); ++v) {
    EXPECT_TRUE(std::ranges::equal(made->weights.row(v), made->weights.row(18)));
  }
  EXPECT_EQ(made->weights.row(18).size(), 1u);
  return made->weights.row(18).front().bone;
}

TEST(TransferWeights, AnIslandFollowsTheNearestOfItsOwnMeshOrTheSource) {
  EXPECT_EQ(followed_from(10, 2), 1);      // 2 from the coat, 4 from the body
  EXPECT_EQ(followed_from(13, 2), 0);      // 5 and 1
  EXPECT_EQ(followed_from(11, 6, 19), 1);  // as far from both
  EXPECT_EQ(followed_from(11, 3), 0);      // its first point is nearer to the coat, its last one to the body still more
}

TEST(TransferWeights, NumbersAreTakenToTheNearestWeights) {
  std::mt19937 random(8);
  std::normal_distribution<double> draw;
  for (int trial = 0; trial < 200; ++trial) {
    const int count = 1 + trial % 6;
    const Eigen::VectorXd given = Eigen::VectorXd::NullaryExpr(count, [&] { return draw(random); });
    Eigen::VectorXd found = given;
    project_on_simplex(found);
    EXPECT_NEAR(found.sum(), 1, 1e-12);
    EXPECT_GE(found.minCoeff(), 0);
    double best = std::numeric_limits<double>::infinity();  // over all choices of what is not 0
    for (unsigned used = 1; used < 1u << count; ++used) {
      Eigen::VectorXd own = Eigen::VectorXd::Zero(count);
      double sum = -1;
      for (int i = 0; i < count; ++i) sum += used >> i & 1 ? given[i] : 0;
      for (int i = 0; i < count; ++i) own[i] = used >> i & 1 ? given[i] - sum / std::popcount(used) : 0;
      if (own.minCoeff() >= 0) best = std::min(best, (own - given).norm());
    }
    EXPECT_NEAR((found - given).norm(), best, 1e-12) << given.transpose();
  }
}

TEST(Cotangents, AreClamped) {
  const double flat = 0.5 * std::tan(std::numbers::pi / 180), third = std::sqrt(1 / 3.0);
  const struct {
    Eigen::Vector3d last;  // corner, beside those at 0 and 1
    std::array<double, 3> cotangents;
  } cases[] = {{{0.5, std::sqrt(0.75), 0}, {third, third, third}},
               {{0.5, flat, 0}, {20, 20, 0}},  // of 1, 1 and 178 degrees
               {{0.5, 0, 0}, {20, 20, 0}},
               {{0, 0, 0}, {0, 20, 0}}};  // beside a side without length is no angle
  const Triangle corners{0, 1, 2};
  for (const double least : {0.0, 0.01}) {
    for (const auto& [last, cotangents] : cases) {
      const std::vector<Eigen::Vector3d> points{{0, 0, 0}, {1, 0, 0}, last};
      std::vector<double> found(3);
      const std::vector<double> areas =
          join_by_cotangents(points, {&corners, 1}, least,
                             [&](std::uint32_t a, std::uint32_t b, double value) { found[3 - a - b] = 2 * value; });
      for (int k = 0; k < 3; ++k) {
        EXPECT_NEAR(found[k], std::max(least, cotangents[k]), 1e-12) << "corner " << k << " of " << last.transpose();
        EXPECT_NEAR(areas[k], last.y() / 6, 1e-12);
      }
    }
  }
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
