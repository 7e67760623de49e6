#include "sinew/shape_keys.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "failures.h"
#include "rigs.h"
#include "skinning/tile.h"

namespace sinew {
namespace {

using Floats = std::vector<float>;
using Weights = std::vector<std::optional<std::span<const float>>>;

struct Keys {
  std::vector<Floats> positions;
  std::vector<std::int64_t> relative_to;
  std::vector<Floats> weights;  // empty: none

  std::vector<std::span<const float>> spans() const { return {positions.begin(), positions.end()}; }
  Weights weight_spans() const {
    Weights spans;
    for (const Floats& own : weights) {
      own.empty() ? spans.emplace_back(std::nullopt) : spans.emplace_back(own);
    }
    return spans;
  }
  ShapeKeys made() const { return ShapeKeys(spans(), relative_to, weight_spans()); }
};

/// Some keys, each of which differs from another in some places.
Keys some_keys(rigs::Random& random, std::size_t vertices) {
  Keys keys;
  keys.relative_to = {0, 0, 1, 99, 4, 0, -1};
  const auto any = [&] { return static_cast<float>(rigs::uniform(random, -1, 1)); };
  for (std::size_t k = 0; k < keys.relative_to.size(); ++k) {
    keys.positions.push_back(k == 0 ? Floats(3 * vertices) : keys.positions[k / 2]);
    for (std::size_t v = 0; v < vertices; ++v) {
      const bool changes = k == 0 || (k == 1 && v % 1000 > 700) || (k == 2 && random() % 5 == 0) || k == 3 || k == 5;
      for (std::size_t i = 3 * v; changes && i < 3 * v + 3; ++i) keys.positions[k][i] = any();
    }
    keys.weights.emplace_back();
  }
  for (const std::size_t k : {2, 5}) {
    for (std::size_t v = 0; v < vertices; ++v) {
      keys.weights[k].push_back(random() % 3 == 0 ? 0 : any());
    }
  }
  return keys;
}

/// The plain loop of the header's formula. `volatile`: rounded after each step.
Floats summed(const Keys& keys, const Floats& values) {
  Floats shape = keys.positions[0];
  for (std::size_t k = 1; k < values.size(); ++k) {
    const auto r = static_cast<std::size_t>(keys.relative_to[k]);
    if (values[k] == 0 || r >= values.size()) continue;
    for (std::size_t i = 0; i < shape.size(); ++i) {
      const volatile float factor = keys.weights[k].empty() ? values[k] : keys.weights[k][i / 3] * values[k];
      const volatile float difference = keys.positions[r][i] - keys.positions[k][i];
      const volatile float product = factor * difference;
      shape[i] -= product;
    }
  }
  return shape;
}

Floats sum_of(const ShapeKeys& keys, const Floats& values) {
  Floats shape(keys.base().begin(), keys.base().end());
  for (std::size_t t = 0; t * kTile < shape.size() / 3; ++t) {
    const std::size_t first = 3 * t * kTile, last = std::min(shape.size(), first + 3 * kTile);
    const Floats before(shape.begin() + first, shape.begin() + last);
    keys.add(t, values, shape.data() + first);
    const bool changed = !std::equal(before.begin(), before.end(), shape.begin() + first);
    EXPECT_LE(changed, keys.change(t, values));
  }
  return shape;
}

TEST(ShapeKeys, AreThePlainLoopToTheBit) {
  rigs::Random random(1);
  for (const std::size_t vertices : {1u, 63u, 64u, 65u, 4096u, 10001u}) {
    const Keys keys = some_keys(random, vertices);
    const ShapeKeys made = keys.made();
    EXPECT_EQ(made.count(), 7);
    EXPECT_EQ(made.vertex_count(), vertices);
    EXPECT_TRUE(std::ranges::equal(made.base(), keys.positions[0]));
    for (const Floats& values : {Floats(7), Floats{9, 0.3f, -0.7f, 1, 1, 0.1f, 1}, Floats{0, 0, 0.33f, 0, 0, 0, 0},
                                 Floats{1, 1, 1, 1, 1, 1, 1}}) {
      EXPECT_EQ(sum_of(made, values), summed(keys, values));
    }
  }
}

TEST(ShapeKeys, KeepOnlyWhatDiffers) {
  Keys keys;
  keys.positions.assign(4, Floats(3 * 9000));
  for (const std::size_t v : {0, 4095, 4096, 8999}) keys.positions[1][3 * v + 1] = 1;
  keys.positions[2][3 * 50] = 2;
  keys.positions[2][3 * 51] = 2;
  keys.positions[3] = keys.positions[1];
  keys.relative_to = {0, 0, 0, 1};
  keys.weights = {{}, {}, Floats(9000, 1.0f), {}};
  keys.weights[2][51] = 0;
  const ShapeKeys made = keys.made();
  EXPECT_EQ(made.delta_count(), 5);
  EXPECT_EQ(made.changed_by(Floats{1, 1, 0, 1}), 4);
  EXPECT_TRUE(made.change(0, Floats{0, 0, 1, 0}));
  EXPECT_FALSE(made.change(1, Floats{0, 0, 1, 0}));
  EXPECT_TRUE(made.change(2, Floats{0, 1, 0, 0}));
  EXPECT_FALSE(made.change(2, Floats{1, 0, 1, 1}));
}

TEST(ShapeKeys, MarkWhatTheyChange) {
  rigs::Random random(3);
  constexpr std::size_t kVertices = 5001;
  const Keys keys = some_keys(random, kVertices);
  const ShapeKeys made = keys.made();
  for (const Floats& values : {Floats(7), Floats{0, 0.3f, 0, 0, 0, 0, 0}, Floats{1, 0, 1, 1, 1, 0, 1}}) {
    const Floats shape = sum_of(made, values);
    for (const std::size_t t : {0, 1}) {
      const std::size_t count = std::min(kTile, kVertices - t * kTile);
      std::vector<std::uint8_t> touched(count + 1, 7);
      made.mark(t, values, touched.data());
      EXPECT_EQ(touched[count], 7);
      for (std::size_t v = 0; v < count; ++v) {
        const std::size_t at = 3 * (t * kTile + v);
        EXPECT_EQ(touched[v], !std::equal(&shape[at], &shape[at] + 3, &keys.positions[0][at]));
      }
    }
  }
}

TEST(ShapeKeys, AnyNumberOfThreadsMakesTheSame) {
  const ThreadsOfATest threads_of_a_test;
  rigs::Random random(2);
  const Keys keys = some_keys(random, 20000);
  const Floats values{0, 0.3f, -0.7f, 1, 1, 0.1f, 1};
  for (const int threads : {1, 2, 8}) {
    set_thread_count(threads);
    EXPECT_EQ(sum_of(keys.made(), values), summed(keys, values)) << threads << " threads";
  }
}

TEST(ShapeKeys, RefuseWhatIsWrong) {
  Keys keys;
  EXPECT_EQ(complaint([&] { keys.made(); }), "there are no shape keys; expected the base at least");
  keys.positions.assign(2, Floats(30));
  EXPECT_EQ(complaint([&] { keys.made(); }), "relative_to has 0 entries; there are 2 keys");
  keys.relative_to = {0, 0};
  keys.weights = {{}};
  EXPECT_EQ(complaint([&] { keys.made(); }), "weights has 1 entry; there are 2 keys");
  keys.weights = {{}, Floats(9)};
  EXPECT_EQ(complaint([&] { keys.made(); }), "key 1 has 9 weights; there are 10 vertices");
  keys.weights.clear();
  keys.positions[1].resize(27);
  EXPECT_EQ(complaint([&] { keys.made(); }), "key 1 has 9 vertices; key 0 has 10");
  keys.positions[1].resize(28);
  EXPECT_EQ(complaint([&] { keys.made(); }), "key 1 has 9 vertices; key 0 has 10");
  keys.positions[0].resize(28);
  EXPECT_EQ(complaint([&] { keys.made(); }), "key 0 has 28 numbers; expected three per vertex");
  keys.positions.assign(2, Floats(30));
  keys.positions[1][29] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(complaint([&] { keys.made(); }), "vertex 9 of key 1 is not finite");
  keys.positions[0][7] = std::numeric_limits<float>::infinity();
  EXPECT_EQ(complaint([&] { keys.made(); }), "vertex 2 of key 0 is not finite");
  keys.positions.assign(2, Floats(30));
  keys.positions[1][3] = 1;
  keys.weights = {{}, Floats(10, std::numeric_limits<float>::quiet_NaN())};
  EXPECT_EQ(complaint([&] { keys.made(); }), "vertex 1 of key 1 is not finite");
}

TEST(ShapeKeys, OfNoVertices) {
  Keys keys;
  keys.positions.assign(2, Floats());
  keys.relative_to = {0, 0};
  EXPECT_EQ(keys.made().vertex_count(), 0);
  EXPECT_EQ(keys.made().delta_count(), 0);
}

}  // namespace
}  // namespace sinew
