#include <gtest/gtest.h>

#include <bit>
#include <limits>

#include "each_instruction_set.h"
#include "failures.h"
#include "sinew/deformer.h"
#include "skinned.h"

namespace sinew {
namespace {

using Floats = std::vector<float>;
using rigs::Matrices;
using rigs::skinned;

/// Joints that keep near each other, but for every `wild`th, which no sign brings near the others, and
/// every `scaled`th, which is larger than the others. 0: none is.
Matrices pose_of(rigs::Random& random, std::int32_t joints, int wild, int scaled) {
  Matrices pose;
  for (std::int32_t j = 0; j < joints; ++j) {
    const double most = wild > 0 && j % wild == 0 ? 180 : 60;
    pose.push_back(rigs::turn(rigs::uniform(random, -most, most), rigs::vector(random, 1), rigs::vector(random, 1)));
    if (scaled > 0 && j % scaled == 0) pose.back().topLeftCorner<3, 3>() *= 1.5;
  }
  return rigs::through_float(pose);
}

struct Subject {
  Skin skin;
  Matrices pose;
};

/// Few and many influences, influences in blocks and one by one, joints that agree and not, and sizes.
std::vector<Subject> subjects() {
  rigs::Random random(1);
  std::vector<Subject> all;
  for (const std::ptrdiff_t vertices : {1, 15, 16, 17, 100, 5000}) {
    for (const std::int32_t influences : {1, 3, 8, 14}) {
      all.push_back({rigs::coherent_skin(random, vertices, 20, influences), pose_of(random, 20, 0, 0)});
    }
    all.push_back({rigs::coherent_skin(random, vertices, 20, 3), pose_of(random, 20, 2, 0)});
    all.push_back({rigs::coherent_skin(random, vertices, 20, 3), pose_of(random, 20, 0, 3)});
    all.push_back({rigs::random_skin(random, vertices, 40), pose_of(random, 40, 0, 0)});
  }
  return all;
}

class Blended : public OnEachInstructionSet {};

INSTANTIATE_TEST_SUITE_P(Kernels, Blended, each_instruction_set(), set_name);

TEST_P(Blended, SharesOf0And1AreTheMethodsToTheBit) {
  for (const auto& [skin, pose] : subjects()) {
    const Floats linear = skinned(skin_linear, skin, pose), dual = skinned(skin_dual_quaternion, skin, pose);
    const Floats shares = rigs::mixed_shares(skin.vertex_count()), blended = skinned(rigs::skin_mixed, skin, pose);
    for (std::size_t i = 0; i < blended.size(); ++i) {
      const float share = shares[i / 3];
      if (share > 0 && share < 1) continue;
      const float expected = share == 0 ? linear[i] : dual[i];
      EXPECT_EQ(std::bit_cast<int>(blended[i]), std::bit_cast<int>(expected)) << i;
    }
  }
}

TEST_P(Blended, InBetweenIsTheShareOfTheWay) {
  for (const auto& [skin, pose] : subjects()) {
    const Floats linear = skinned(skin_linear, skin, pose), dual = skinned(skin_dual_quaternion, skin, pose);
    const Floats shares = rigs::mixed_shares(skin.vertex_count()), blended = skinned(rigs::skin_mixed, skin, pose);
    for (std::size_t i = 0; i < blended.size(); ++i) {
      EXPECT_NEAR(blended[i], (1 - shares[i / 3]) * linear[i] + shares[i / 3] * dual[i], 1e-6) << i;
    }
  }
}

TEST_P(Blended, EqualsTheReference) {
  rigs::Random random(2);
  const Skin skin = rigs::coherent_skin(random, 3000, 20, 4);
  const Matrices pose = pose_of(random, 20, 0, 0);
  const Floats shares = rigs::mixed_shares(3000);
  const Eigen::MatrixX3d linear = reference::skin_linear(skin, pose);
  Eigen::MatrixX3d expected = reference::skin_dual_quaternion(skin, pose);
  for (int v = 0; v < 3000; ++v) expected.row(v) = (1 - shares[v]) * linear.row(v) + shares[v] * expected.row(v);
  EXPECT_LT(rigs::distance(skinned(rigs::skin_mixed, skin, pose), expected), 4e-7 * rigs::kDiagonal);
}

TEST(BlendShares, AreFrom0To1) {
  EXPECT_EQ(complaint([] { BlendShares(Floats{0, 1, 1.5f}); }), "the share of vertex 2 is 1.5; expected 0 to 1");
  EXPECT_EQ(complaint([] { BlendShares(Floats{-0.25f}); }), "the share of vertex 0 is -0.25; expected 0 to 1");
  EXPECT_EQ(complaint([] {
              BlendShares(Floats{0, std::numeric_limits<float>::quiet_NaN()});
            }),
            "the share of vertex 1 is nan; expected 0 to 1");
  EXPECT_EQ(BlendShares(Floats{}).vertex_count(), 0);
}

TEST(MethodData, BelongsToItsMethodAndItsVertices) {
  rigs::Random random(3);
  const auto skin = std::make_shared<const Skin>(rigs::coherent_skin(random, 100, 4, 2));
  const auto layer = [&](SkinningMethod method, std::shared_ptr<const MethodData> data) {
    return complaint(
        [&] { Layer(skin, method, {}, std::nullopt, std::nullopt, nullptr, std::nullopt, std::move(data)); });
  };
  const auto shares = std::make_shared<const BlendShares>(Floats(100));
  EXPECT_EQ(layer(SkinningMethod::blended, nullptr), "the method blended needs data of its own; pass it as data");
  EXPECT_EQ(layer(SkinningMethod::linear, shares), "the data is of the method blended; the method is linear");
  EXPECT_EQ(layer(SkinningMethod::blended, std::make_shared<const BlendShares>(Floats(99))),
            "the data has 99 vertices; the skin has 100");
  EXPECT_EQ(layer(SkinningMethod::blended, shares), "(no complaint)");

  rigs::Stack<float> pose(rigs::identities(4), 1);
  Floats positions(300);
  EXPECT_EQ(complaint([&] { skin_blended(*skin, BlendShares(Floats(99)), pose.read(), positions); }),
            "the data has 99 vertices; the skin has 100");
}

}  // namespace
}  // namespace sinew
