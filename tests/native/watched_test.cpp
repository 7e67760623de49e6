// Stands in for Blender: structs that own and point to others, and that are freed in every order. Under the address
// sanitizer, reading a struct that no longer exists ends the test.
#include "host/watched.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <functional>
#include <memory>

#include "failures.h"

namespace sinew::bindings {
namespace {

struct Bones {
  char mark = 'S';
  std::int32_t flag = 3;
};

struct Rig {
  Bones* data = nullptr;
  std::int32_t mode = 1;
};

struct Modifier {
  Rig* object = nullptr;
  float factor = 0.5f;
};

struct Owner {
  char mark = 'S';
  std::int32_t mode = 0;
};

template <class T>
Address address_of(const T& value) {
  return reinterpret_cast<Address>(&value);
}

/// An object that owns a modifier, which points to a rig, which points to its bones.
struct Scene {
  std::unique_ptr<Owner> owner = std::make_unique<Owner>();
  std::unique_ptr<Modifier> modifier = std::make_unique<Modifier>();
  std::unique_ptr<Rig> rig = std::make_unique<Rig>();
  std::unique_ptr<Bones> bones = std::make_unique<Bones>();

  Scene() {
    modifier->object = rig.get();
    rig->data = bones.get();
  }

  std::vector<WatchedStruct> structs() const {
    return {
        {address_of(*owner), -1, 0, {{offsetof(Owner, mark), 1}, {offsetof(Owner, mode), 4}}},
        {address_of(*modifier), 0, 0, {{offsetof(Modifier, object), 8}, {offsetof(Modifier, factor), 4}}},
        {address_of(*rig), 1, 0, {{offsetof(Rig, mode), 4}, {offsetof(Rig, data), 8}}},
        {address_of(*bones), 2, 1, {{offsetof(Bones, mark), 1}, {offsetof(Bones, flag), 4}}},
    };
  }

  // What Blender does: whoever frees something takes away what led to it.
  void free_bones() {
    rig->data = nullptr;
    bones.reset();
  }
  void free_rig() {
    modifier->object = nullptr;
    rig.reset();
  }
  void free_modifier() {
    owner->mark = 0;
    modifier.reset();
  }
};

TEST(Watched, HoldsWhileNothingChanges) {
  const Scene scene;
  const Watched watched(scene.structs());
  EXPECT_TRUE(watched.holds());
  EXPECT_TRUE(watched.holds());
  EXPECT_TRUE(Watched({}).holds());
}

TEST(Watched, SeesEachRegion) {
  const std::vector<std::function<void(Scene&)>> changes = {
      [](Scene& scene) { scene.owner->mark = 0; },         [](Scene& scene) { scene.owner->mode = 1; },
      [](Scene& scene) { scene.modifier->factor = 0.6f; }, [](Scene& scene) { scene.rig->mode = 2; },
      [](Scene& scene) { scene.bones->mark = 0; },         [](Scene& scene) { scene.bones->flag = 2; },
  };
  for (const auto& change : changes) {
    Scene scene;
    const Watched watched(scene.structs());
    change(scene);
    EXPECT_FALSE(watched.holds());
  }
}

TEST(Watched, WhatIsBetweenTheRegionsMayChange) {
  Scene scene;
  std::vector<WatchedStruct> structs = scene.structs();
  structs[0].regions.pop_back();
  const Watched watched(structs);
  scene.owner->mode = 7;
  EXPECT_TRUE(watched.holds());
}

TEST(Watched, NothingIsReadThatWasFreed) {
  const std::vector<std::function<void(Scene&)>> frees = {&Scene::free_bones, &Scene::free_rig, &Scene::free_modifier};
  for (std::size_t first = 0; first < frees.size(); ++first) {
    Scene scene;
    const Watched watched(scene.structs());
    frees[first](scene);
    if (first > 0) scene.bones.reset();  // and all that was reached through it
    if (first > 1) scene.rig.reset();
    EXPECT_FALSE(watched.holds());
  }
}

TEST(Watched, AnotherStructAtTheSamePlaceIsSeen) {
  Scene scene;
  const Watched watched(scene.structs());
  Rig other{scene.bones.get(), 1};
  scene.modifier->object = &other;
  scene.rig.reset();
  EXPECT_FALSE(watched.holds());
}

TEST(Watched, RefusesAStructThatNothingVouchesFor) {
  struct Case {
    std::function<void(std::vector<WatchedStruct>&)> spoil;
    const char* sentence;
  };
  const std::vector<Case> cases = {
      {[](auto& structs) { structs[0].parent = 1; }, "watched struct 0 has the parent 1"},
      {[](auto& structs) { structs[1].parent = -1; }, "watched struct 1 has the parent -1"},
      {[](auto& structs) { structs[2].parent = 2; }, "watched struct 2 has the parent 2"},
      {[](auto& structs) { structs[2].parent = 3; }, "watched struct 2 has the parent 3"},
      {[](auto& structs) { structs[2].voucher = 2; }, "watched struct 2 names region 2 of its parent, which has 2"},
      {[](auto& structs) { structs[2].voucher = 1; }, "watched struct 2 is not where region 1 of its parent points"},
      {[](auto& structs) {
         structs[2].parent = 0;
         structs[2].voucher = 1;
       },
       "watched struct 2 is not where"},
      {[](auto& structs) { structs[3].voucher = 0; }, "watched struct 3 is not where region 0"},
      {[](auto& structs) { std::swap(structs[2], structs[3]); }, "watched struct 2 has the parent 2"},
  };
  const Scene scene;
  for (const Case& each : cases) {
    std::vector<WatchedStruct> structs = scene.structs();
    each.spoil(structs);
    EXPECT_NE(complaint([&] { const Watched watched(structs); }).find(each.sentence), std::string::npos)
        << each.sentence;
  }
}

TEST(Watched, AStructThatIsRefusedIsNotRead) {
  Scene scene;
  const std::vector<WatchedStruct> structs = scene.structs();
  scene.free_bones();
  EXPECT_EQ(complaint([&] { const Watched watched(structs); }),
            "watched struct 3 is not where region 1 of its parent points");
}

}  // namespace
}  // namespace sinew::bindings
