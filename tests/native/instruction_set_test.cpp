#include "sinew/instruction_set.h"

#include <gtest/gtest.h>

#include <atomic>
#include <numbers>
#include <optional>
#include <thread>

#include "each_instruction_set.h"
#include "failures.h"
#include "sinew/skinning.h"
#include "skinned.h"

namespace sinew {
namespace {

using rigs::skinned;

class EachInstructionSet : public OnEachInstructionSet {};

INSTANTIATE_TEST_SUITE_P(Kernels, EachInstructionSet, each_instruction_set(), set_name);

rigs::Matrices gentle_pose(rigs::Random& random, std::int32_t joints) {
  rigs::Matrices pose;
  for (std::int32_t j = 0; j < joints; ++j) {
    const double degrees = rigs::uniform(random, -60, 60);
    pose.push_back(rigs::turn(degrees, rigs::vector(random, 1), rigs::vector(random, 1)));
  }
  return rigs::through_float(pose);
}

TEST_P(EachInstructionSet, LinearEqualsTheReference) {
  rigs::Random random(1);
  for (const std::ptrdiff_t vertices : {1, 4, 15, 16, 17, 31, 32, 33, 48, 100, 1000, 9001}) {
    for (const std::int32_t influences : {1, 2, 3, 4, 8, 12, 14}) {
      const Skin skin = rigs::coherent_skin(random, vertices, 20, influences);
      const rigs::Matrices pose = rigs::through_float(rigs::random_pose(random, 20));
      const double error = rigs::distance(skinned(skin_linear, skin, pose), reference::skin_linear(skin, pose));
      EXPECT_LT(error, 2e-7 * rigs::kDiagonal) << vertices << " vertices, " << influences;
    }
  }
}

TEST_P(EachInstructionSet, DualQuaternionsEqualTheReference) {
  rigs::Random random(2);
  for (const std::ptrdiff_t vertices : {1, 4, 15, 16, 17, 31, 32, 33, 48, 100, 1000, 9001}) {
    for (const std::int32_t influences : {1, 2, 3, 4, 8, 12, 14}) {
      const Skin skin = rigs::coherent_skin(random, vertices, 20, influences);
      const rigs::Matrices pose = gentle_pose(random, 20);
      const double error =
          rigs::distance(skinned(skin_dual_quaternion, skin, pose), reference::skin_dual_quaternion(skin, pose));
      EXPECT_LT(error, 4e-7 * rigs::kDiagonal) << vertices << " vertices, " << influences;
    }
  }
}

/// Three joints turned by 0, 120 and 240 degrees about one axis: whichever signs they get, two of
/// them disagree, so the result depends on the order in which a vertex stores them.
TEST_P(EachInstructionSet, SignsFollowTheStoredOrderWhereTheyHaveTo) {
  const rigs::Matrices pose =
      rigs::through_float({rigs::turn(0, {0, 0, 1}, {0, 0, 0}), rigs::turn(125, {0, 0, 1}, {0, 0, 0}),
                           rigs::turn(245, {0, 0, 1}, {0, 0, 0})});
  rigs::Random random(3);
  const Skin skin = rigs::coherent_skin(random, 500, 3, 3);
  const auto positions = skinned(skin_dual_quaternion, skin, pose);
  EXPECT_LT(rigs::distance(positions, reference::skin_dual_quaternion(skin, pose)), 1e-5);

  std::vector<std::int32_t> joints(skin.joints().begin(), skin.joints().end());
  std::vector<float> weights(skin.weights().begin(), skin.weights().end());
  for (std::ptrdiff_t v = 0; v < skin.vertex_count(); ++v) {
    std::reverse(joints.begin() + skin.offsets()[v], joints.begin() + skin.offsets()[v + 1]);
    std::reverse(weights.begin() + skin.offsets()[v], weights.begin() + skin.offsets()[v + 1]);
  }
  const Skin reversed(skin.rest_positions(), skin.offsets(), joints, weights, 3);
  const auto others = skinned(skin_dual_quaternion, reversed, pose);
  EXPECT_LT(rigs::distance(others, reference::skin_dual_quaternion(reversed, pose)), 1e-5);
  EXPECT_NE(positions, others);
}

TEST_P(EachInstructionSet, IsTheOneInUse) { EXPECT_EQ(instruction_set(), GetParam()); }

TEST(InstructionSet, ASkinMadeUnderAnotherSetIsPackedAgain) {
  rigs::Random random(4);
  const Skin skin = rigs::coherent_skin(random, 100, 5, 3);
  const rigs::Matrices pose = rigs::through_float(rigs::random_pose(random, 5));
  for (const std::string& name : instruction_sets()) {
    set_instruction_set(name);
    EXPECT_LT(rigs::distance(skinned(skin_linear, skin, pose), reference::skin_linear(skin, pose)),
              2e-7 * rigs::kDiagonal);
  }
  set_instruction_set("auto");
  EXPECT_EQ(instruction_set(), instruction_sets().front());
}

TEST(InstructionSet, ListingThemDisturbsNobody) {
  const std::vector<std::string> names = instruction_sets();
  std::atomic<bool> done = false;
  std::thread reader([&] {
    while (!done) EXPECT_EQ(instruction_sets(), names);
  });
  int others = 0;
  for (int turn = 0; turn < 5000; ++turn) {
    const std::string& name = names[turn % names.size()];
    set_instruction_set(name);
    others += instruction_set() != name;
  }
  done = true;
  reader.join();
  set_instruction_set("auto");
  EXPECT_EQ(others, 0);
}

/// A skin packed for other registers than the kernels have would come out as garbage. (And what the thread sanitizer
/// looks at.)
TEST(InstructionSet, MayChangeWhileOthersSkin) {
  rigs::Random random(5);
  const Skin skin = rigs::coherent_skin(random, 3001, 20, 4);
  const rigs::Matrices pose = rigs::through_float(rigs::random_pose(random, 20));
  const auto expected = reference::skin_linear(skin, pose);
  std::atomic<int> running = 2, wrong = 0, made = 0;
  const auto skin_again_and_again = [&](bool anew) {
    for (int turn = 0; turn < 100; ++turn) {
      std::optional<Skin> own;
      if (anew) own.emplace(skin.rest_positions(), skin.offsets(), skin.joints(), skin.weights(), 20);
      wrong += !(rigs::distance(skinned(skin_linear, own ? *own : skin, pose), expected) < 2e-7 * rigs::kDiagonal);
      ++made;
    }
    --running;
  };
  std::thread one(skin_again_and_again, false), two(skin_again_and_again, true);
  const std::vector<std::string> names = instruction_sets();
  for (std::size_t turn = 0; running > 0; ++turn) set_instruction_set(names[turn % names.size()]);
  one.join();
  two.join();
  set_instruction_set("auto");
  EXPECT_EQ(made, 200);
  EXPECT_EQ(wrong, 0);
}

TEST(InstructionSet, RefusesANameThatIsNone) {
  const std::string before = instruction_set();
  const std::string said = complaint([] { set_instruction_set("MMX"); });
  EXPECT_TRUE(said.starts_with("this machine has no instruction set \"MMX\"; expected auto or one of "));
  for (const std::string& name : instruction_sets()) EXPECT_NE(said.find(name), said.npos);
  EXPECT_EQ(instruction_set(), before);
}

}  // namespace
}  // namespace sinew
