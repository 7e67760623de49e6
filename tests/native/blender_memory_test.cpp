#include <gtest/gtest.h>

#include <array>

#include "host/memory.h"

namespace sinew::bindings {
namespace {

struct Key {
  std::int16_t relative = 0;
  std::uint16_t flags = 0;
  float value = 0;
};
constexpr KeyLayout kLayout{offsetof(Key, flags), offsetof(Key, value), offsetof(Key, relative)};

Address address_of(const auto& object) { return reinterpret_cast<Address>(&object); }

TEST(BlendersMemory, SilentKeysAddNothingUntilTheyAreRestored) {
  std::array<Key, 3> keys{Key{0, 0, 1}, Key{0, 8, 0.5f}, Key{1, kMuted, 0.25f}};
  const std::vector<Address> addresses{address_of(keys[0]), address_of(keys[1]), address_of(keys[2])};
  std::array<float, 3> values{};
  silence_keys(addresses, kLayout, values);
  EXPECT_EQ(values, (std::array<float, 3>{0, 0.5f, 0}));
  EXPECT_EQ(keys[0].relative, 0);
  EXPECT_EQ(keys[1].relative, kNoKey);
  EXPECT_EQ(keys[2].relative, kNoKey);
  EXPECT_EQ(keys[1].flags, 8);
  EXPECT_EQ(keys[2].flags, kMuted);
  restore_keys(addresses, kLayout, std::array<std::int16_t, 3>{0, 0, 1});
  EXPECT_EQ(keys[1].relative, 0);
  EXPECT_EQ(keys[2].relative, 1);
}

TEST(BlendersMemory, ABentBoneHasAMotionForEachEndOfItsSegments) {
  struct {
    Address next = 0;
    std::array<float, 16> motion{};
    std::int32_t segment_count = 2;
    Address segments = 0;
  } bone;
  std::array<float, 64> segments{};
  for (std::size_t i = 0; i < segments.size(); ++i) segments[i] = static_cast<float>(i);
  bone.motion.fill(-1);
  bone.segments = address_of(segments);
  const auto offset = [&](const auto& member) {
    return static_cast<std::ptrdiff_t>(address_of(member) - address_of(bone));
  };
  const PoseBoneLayout layout{offset(bone.next), offset(bone.motion), offset(bone.segment_count),
                              offset(bone.segments)};
  std::array<float, 48> to{};
  const auto copy = [&](int count) {
    return copy_motions(address_of(bone), layout, count, reinterpret_cast<char*>(to.data()));
  };
  ASSERT_TRUE(copy(1));
  EXPECT_EQ(to[15], -1);
  ASSERT_TRUE(copy(3));  // the first matrix is none of a segment
  EXPECT_EQ(to[0], 16);
  EXPECT_EQ(to[47], 63);
  EXPECT_FALSE(copy(2));
  bone.segments = 0;
  EXPECT_FALSE(copy(3));
}

}  // namespace
}  // namespace sinew::bindings
