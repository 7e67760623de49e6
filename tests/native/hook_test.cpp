#include "sinew/hook.h"

#include <gtest/gtest.h>

#include <limits>

#include "failures.h"
#include "meshes.h"

namespace sinew {
namespace {

using meshes::Floats;
using Ints = std::vector<std::int32_t>;

/// What is left of the strength at distance d of 1.
double fallen(Falloff falloff, double d) {
  if (d > 1) return 0;
  const double f = 1 - d;
  switch (falloff) {
    case Falloff::none:
    case Falloff::constant:
      return 1;
    case Falloff::linear:
      return f;
    case Falloff::smooth:
      return 3 * f * f - 2 * f * f * f;
    case Falloff::sharp:
      return f * f;
    case Falloff::root:
      return std::sqrt(f);
    case Falloff::sphere:
      return std::sqrt(2 * f - f * f);
    case Falloff::inverse_square:
      return 1 - d * d;
  }
  return 0;
}

void pull(const Hook::Settings& settings, double weight, Eigen::Vector3d& point) {
  const Eigen::Matrix3d there =
      settings.uniform ? Eigen::Matrix3d(settings.uniform->cast<double>()) : Eigen::Matrix3d::Identity();
  double part = settings.strength * weight;
  if (settings.falloff != Falloff::none && settings.radius != 0) {
    part *= fallen(settings.falloff, (there * (point - settings.center.cast<double>())).norm() / settings.radius);
  }
  point += part * ((settings.matrix.cast<double>() * point.homogeneous()).head<3>() - point);
}

Hook::Settings some_settings(rigs::Random& random, Falloff falloff) {
  Hook::Settings settings;
  settings.matrix = rigs::random_rigid(random).cast<float>();
  settings.strength = 0.7f;
  settings.falloff = falloff;
  settings.radius = 0.9f;
  settings.center = rigs::vector(random, 0.3).cast<float>();
  return settings;
}

constexpr Falloff kFalloffs[] = {Falloff::none,  Falloff::constant, Falloff::linear, Falloff::smooth,
                                 Falloff::sharp, Falloff::root,     Falloff::sphere, Falloff::inverse_square};

TEST(Hook, IsTheSlowFormula) {
  rigs::Random random(1);
  constexpr std::int32_t kVertices = 9000;
  const Floats positions = meshes::random_positions(random, kVertices);
  const Floats weights = meshes::some_weights(random, kVertices);
  Ints named;
  for (std::int32_t v = 0; v < kVertices; ++v) {
    if (random() % 4 == 0) named.push_back(v);
  }
  std::vector<bool> is_named(kVertices);
  for (const std::int32_t v : named) is_named[v] = true;
  for (const Falloff falloff : kFalloffs) {
    for (const bool by_name : {false, true}) {
      for (const bool invert : {false, true}) {
        Hook::Settings settings = some_settings(random, falloff);
        if (invert) settings.uniform = rigs::random_rigid(random).topLeftCorner<3, 3>().cast<float>() * 1.3f;
        const Hook hook(kVertices, by_name ? std::optional<std::span<const std::int32_t>>(named) : std::nullopt,
                        {weights, invert});
        EXPECT_EQ(hook.vertex_count(), kVertices);
        Floats own = positions;
        hook.apply(settings, own);
        auto expected = meshes::points_of(positions);
        for (std::int32_t v = 0; v < kVertices; ++v) {
          if (by_name && !is_named[v]) continue;
          pull(settings, invert ? 1 - weights[v] : weights[v], expected[v]);
        }
        // A root is steep at the radius.
        const bool steep = falloff == Falloff::root || falloff == Falloff::sphere;
        EXPECT_LT(meshes::largest_difference(own, expected), steep ? 1e-3 : 2e-6);
      }
    }
  }
}

TEST(Hook, MovesWhatIsNamedTwiceTwice) {
  Hook::Settings settings;
  settings.matrix(0, 3) = 2;
  const Ints named{1, 1};
  Floats positions(6);
  Hook(2, named).apply(settings, positions);
  EXPECT_EQ(positions, (Floats{0, 0, 0, 4, 0, 0}));
}

TEST(Hook, WithoutVerticesAndGroupMovesNothing) {
  Hook::Settings settings;
  settings.matrix(0, 3) = 2;
  Floats positions(6);
  Hook(2, std::nullopt).apply(settings, positions);
  EXPECT_EQ(positions, Floats(6));
  const Ints named{0, 1};
  settings.strength = 0;
  Hook(2, named).apply(settings, positions);
  EXPECT_EQ(positions, Floats(6));
}

TEST(Hook, AnyNumberOfThreadsMakesTheSame) {
  const ThreadsOfATest threads_of_a_test;
  rigs::Random random(3);
  const Floats positions = meshes::random_positions(random, 20000);
  const Hook::Settings settings = some_settings(random, Falloff::smooth);
  const Hook hook(20000, std::nullopt, {Floats(20000, 0.5f)});
  set_thread_count(1);
  Floats expected = positions;
  hook.apply(settings, expected);
  for (const int threads : {2, 8}) {
    set_thread_count(threads);
    Floats own = positions;
    hook.apply(settings, own);
    EXPECT_EQ(own, expected);
  }
}

TEST(Hook, RefusesWhatIsWrong) {
  const Ints outside{0, 3};
  EXPECT_EQ(complaint([&] { Hook(3, outside); }), "vertices names vertex 3; the mesh has 3 vertices");
  EXPECT_EQ(complaint([&] { Hook(-1, outside); }), "vertex_count is -1; expected 0 to 536,870,912");
  EXPECT_EQ(complaint([&] { Hook(3, std::nullopt, {Floats(2)}); }), "weights has 2 numbers; the mesh has 3 vertices");
  const Ints named{0};
  const Hook hook(3, named);
  Floats positions(6);
  EXPECT_EQ(complaint([&] { hook.apply({}, positions); }), "positions has 6 numbers; expected 9 (3 x 3)");
  positions.resize(9);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto said = [&](const auto& change) {
    Hook::Settings settings;
    change(settings);
    return complaint([&] { hook.apply(settings, positions); });
  };
  EXPECT_EQ(said([&](auto& s) { s.strength = nan; }), "strength is nan; expected a finite number");
  EXPECT_EQ(said([&](auto& s) { s.radius = nan; }), "radius is nan; expected a finite number");
  EXPECT_EQ(said([&](auto& s) { s.matrix(1, 2) = nan; }), "matrix is not finite");
  EXPECT_EQ(said([&](auto& s) { s.center[1] = nan; }), "center is not finite");
  EXPECT_EQ(said([&](auto& s) { s.uniform.emplace().fill(nan); }), "uniform is not finite");
}

}  // namespace
}  // namespace sinew
