#include "sinew/surface_deform.h"

#include <gtest/gtest.h>

#include <limits>
#include <numeric>

#include "failures.h"
#include "meshes.h"

namespace sinew {
namespace {

using meshes::Floats;
using Ints = std::vector<std::int32_t>;

/// Vertices that are attached to faces of a random target.
struct Bound {
  Bound(rigs::Random& random, std::int32_t vertex_count, std::int32_t target_count)
      : vertices(vertex_count), target(meshes::random_positions(random, target_count)) {
    const auto some = [&](double low, double high) { return static_cast<float>(rigs::uniform(random, low, high)); };
    for (std::int32_t v = 0; v < vertex_count; v += 1 + random() % 2) {
      bound.push_back(v);
      for (int i = static_cast<int>(random() % 5); i >= 0; --i) {
        const std::int32_t kind = static_cast<std::int32_t>(random() % 3);
        const std::int32_t size = 3 + static_cast<std::int32_t>(random() % 3);
        const std::int32_t first = static_cast<std::int32_t>(random() % (target_count - size));
        for (std::int32_t c = 0; c < size; ++c) corners.push_back(first + c);
        std::rotate(corners.end() - size, corners.end() - 1, corners.end());
        for (std::int32_t c = 0; c < (kind == 1 ? size : 3); ++c) weights.push_back(some(-0.3, 1));
        kinds.push_back(kind);
        distances.push_back(some(-0.5, 0.5));
        influences.push_back(some(0, 0.5));
        corner_offsets.push_back(static_cast<std::int32_t>(corners.size()));
      }
      offsets.push_back(static_cast<std::int32_t>(kinds.size()));
    }
    matrix = rigs::random_rigid(random).cast<float>();
  }

  SurfaceDeform::Binding binding() const {
    return {bound, offsets, kinds, corner_offsets, corners, weights, distances, influences};
  }

  SurfaceDeform deform(const VertexGroup& group = {}) const { return {vertices, binding(), group}; }

  SurfaceDeform::Settings settings(const SurfaceDeform& own, float strength) const {
    return {own.shape_of(target, matrix), strength};
  }

  /// Attachment by attachment.
  void move(meshes::Points& points, double strength, const Floats& group) const {
    std::size_t next = 0;
    for (std::size_t b = 0; b < bound.size(); ++b) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (std::int32_t n = offsets[b]; n < offsets[b + 1]; ++n) {
        std::vector<Eigen::Vector3d> face;
        for (std::int32_t c = corner_offsets[n]; c < corner_offsets[n + 1]; ++c) {
          const Eigen::Vector3d corner = Eigen::Vector3f(target.data() + 3 * corners[c]).cast<double>();
          face.push_back((matrix.cast<double>() * corner.homogeneous()).head<3>());
        }
        Eigen::Vector3d normal = Eigen::Vector3d::Zero(), mean = normal, place = normal;
        for (std::size_t c = 0; c < face.size(); ++c) {
          normal += face[c].cross(face[(c + 1) % face.size()]);
          mean += face[c] / static_cast<double>(face.size());
        }
        if (kinds[n] == 2) face[2] = mean;
        const std::size_t count = kinds[n] == 1 ? face.size() : 3;
        for (std::size_t c = 0; c < count; ++c) place += weights[next++] * face[c];
        sum += influences[n] * (place + distances[n] * normal.normalized());
      }
      Eigen::Vector3d& point = points[bound[b]];
      point += strength * group[bound[b]] * (sum - point);
    }
  }

  std::int32_t vertices;
  Floats target;
  Ints bound, offsets{0}, kinds, corner_offsets{0}, corners;
  Floats weights, distances, influences;
  Matrix4<float> matrix;
};

TEST(SurfaceDeform, IsTheSlowFormula) {
  rigs::Random random(1);
  for (const bool has_group : {false, true}) {
    const Bound bound(random, 4000, 500);
    const Floats group = meshes::some_weights(random, bound.vertices);
    const SurfaceDeform own = has_group ? bound.deform({group, true}) : bound.deform();
    EXPECT_EQ(own.vertex_count(), bound.vertices);
    EXPECT_EQ(own.least_target_count(), 1 + *std::max_element(bound.corners.begin(), bound.corners.end()));
    const Floats before = meshes::random_positions(random, bound.vertices);
    Floats positions = before;
    own.apply(bound.settings(own, 0.8f), positions);
    Floats shares(bound.vertices, 1);
    for (std::size_t v = 0; has_group && v < shares.size(); ++v) shares[v] = 1 - group[v];
    auto expected = meshes::points_of(before);
    bound.move(expected, 0.8, shares);
    EXPECT_LT(meshes::largest_difference(positions, expected), 5e-6);
  }
}

TEST(SurfaceDeform, AFaceWithoutSizeHasNoNormal) {
  rigs::Random random(2);
  Bound bound(random, 50, 20);
  std::fill(bound.target.begin(), bound.target.end(), 0.5f);
  const SurfaceDeform own = bound.deform();
  Floats positions = meshes::random_positions(random, bound.vertices);
  own.apply(bound.settings(own, 1), positions);
  for (const float number : positions) EXPECT_TRUE(std::isfinite(number));
}

TEST(SurfaceDeform, AnyNumberOfThreadsMakesTheSame) {
  const ThreadsOfATest threads_of_a_test;
  rigs::Random random(3);
  const Bound bound(random, 20000, 8000);
  const SurfaceDeform own = bound.deform();
  const Floats before = meshes::random_positions(random, bound.vertices);
  set_thread_count(1);
  Floats expected = before;
  own.apply(bound.settings(own, 1), expected);
  EXPECT_NE(expected, before);
  for (const int threads : {2, 8}) {
    set_thread_count(threads);
    Floats positions = before;
    own.apply(bound.settings(own, 1), positions);
    EXPECT_EQ(positions, expected);
  }
  Floats positions = before;
  own.apply(bound.settings(own, 0), positions);
  EXPECT_EQ(positions, before);
}

TEST(SurfaceDeform, RefusesWhatIsWrong) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto said = [&](const auto& change) {
    rigs::Random random(4);
    Bound bound(random, 10, 20);
    change(bound);
    return complaint([&] { bound.deform(); });
  };
  EXPECT_EQ(said([](Bound&) {}), "(no complaint)");
  EXPECT_EQ(said([](Bound& b) { b.vertices = -1; }), "vertex_count is -1; expected 0 to 536,870,912");
  EXPECT_EQ(said([](Bound& b) { b.bound[0] = 10; }), "vertices names vertex 10; the mesh has 10 vertices");
  EXPECT_EQ(said([](Bound& b) { b.kinds[0] = 3; }), "attachments holds 3; expected 0, 1 or 2");
  EXPECT_EQ(said([](Bound& b) { b.corners[0] = -1; }), "corners names vertex -1 of the target");
  EXPECT_EQ(said([&](Bound& b) { b.distances[1] = nan; }), "distances is not finite at vertex 1");
  EXPECT_EQ(said([&](Bound& b) { b.influences[0] = nan; }), "influences is not finite at vertex 0");
  EXPECT_EQ(said([&](Bound& b) { b.weights[2] = nan; }), "weights is not finite at vertex 2");
  EXPECT_TRUE(said([](Bound& b) { b.offsets[1] = 500; }).starts_with("offsets[2] is "));
  EXPECT_TRUE(said([](Bound& b) { b.corner_offsets.pop_back(); }).starts_with("corner_offsets has "));
  EXPECT_TRUE(said([](Bound& b) { b.corner_offsets[1] = 2; }).starts_with("attachment 0 is to a face with 2 corners"));
  EXPECT_TRUE(said([](Bound& b) { b.weights.pop_back(); }).starts_with("weights has "));
  rigs::Random random(5);
  const Bound bound(random, 10, 20);
  EXPECT_EQ(complaint([&] { bound.deform({Floats(2)}); }), "weights has 2 numbers; the mesh has 10 vertices");
  const SurfaceDeform own = bound.deform();
  EXPECT_TRUE(complaint([&] { own.shape_of(Floats(3), bound.matrix); }).starts_with("the target has 1 vertex; "));
  Floats positions(6);
  const auto settings = bound.settings(own, 1);
  EXPECT_EQ(complaint([&] { own.apply(settings, positions); }), "positions has 6 numbers; expected 30 (10 x 3)");
  positions.resize(30);
  EXPECT_EQ(complaint([&] { own.apply({}, positions); }), "the target has no shape");
  EXPECT_EQ(complaint([&] {
              own.apply({settings.shape, nan}, positions);
            }),
            "strength is nan; expected a finite number");
  const Bound other(random, 10, 6);
  EXPECT_EQ(complaint([&] { own.apply(other.settings(other.deform(), 1), positions); }),
            "the shape is not one of this object's");
}

}  // namespace
}  // namespace sinew
