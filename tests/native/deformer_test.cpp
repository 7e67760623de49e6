#include "sinew/deformer.h"

#include <gtest/gtest.h>

#include <thread>

#include "each_instruction_set.h"
#include "failures.h"
#include "sinew/skinning.h"
#include "skinned.h"

namespace sinew {
namespace {

using Floats = std::vector<float>;
using rigs::Matrices;
using Points = Eigen::MatrixX3d;
using Rows = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;

Points points_of(std::span<const float> numbers) {
  return Eigen::Map<const Rows>(numbers.data(), static_cast<Eigen::Index>(numbers.size() / 3), 3).cast<double>();
}

Floats random_numbers(rigs::Random& random, std::ptrdiff_t count, double low, double high) {
  Floats numbers;
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    numbers.push_back(static_cast<float>(rigs::uniform(random, low, high)));
  }
  return numbers;
}

/// Joints that keep near each other, so that no blend of dual quaternions comes near zero.
Matrices gentle_pose(rigs::Random& random, std::int32_t joints) {
  Matrices pose;
  for (std::int32_t j = 0; j < joints; ++j) {
    pose.push_back(rigs::turn(rigs::uniform(random, -60, 60), rigs::vector(random, 1), rigs::vector(random, 0.5)));
  }
  return rigs::through_float(pose);
}

/// What a layer is made of and its pose, for library and oracle alike.
struct Part {
  std::shared_ptr<const Skin> skin;
  SkinningMethod method = SkinningMethod::linear;
  std::optional<Floats> mask{}, share{};
  Matrices pose{};
  std::optional<Matrix4<double>> space{};

  std::shared_ptr<const Layer> layer() const {
    const auto span = [](const std::optional<Floats>& numbers) {
      return numbers ? std::optional<std::span<const float>>(*numbers) : std::nullopt;
    };
    return std::make_shared<Layer>(skin, method, StretchRule{}, span(mask), span(share), nullptr, std::nullopt,
                                   rigs::data_of(method, *skin));
  }
};

/// The same influences on other points.
Skin on_points(const Skin& skin, const Points& points) {
  const Rows rows = points.cast<float>();
  return Skin({rows.data(), static_cast<std::size_t>(rows.size())}, skin.offsets(), skin.joints(), skin.weights(),
              skin.joint_count());
}

/// there, centers: in the armature's space.
Points skinned(const Part& part, const Skin& there, const Points& centers) {
  if (part.method == SkinningMethod::rotation_centers) {
    return reference::skin_rotation_centers(there, part.pose, centers);
  }
  const Points linear = reference::skin_linear(there, part.pose);
  if (part.method == SkinningMethod::linear) return linear;
  const Points dual = reference::skin_dual_quaternion(there, part.pose);
  if (part.method == SkinningMethod::dual_quaternion) return dual;
  const Floats shares = rigs::mixed_shares(there.vertex_count());
  const auto share = Eigen::Map<const Eigen::VectorXf>(shares.data(), std::ssize(shares)).cast<double>().array();
  return linear.array() + (dual - linear).array().colwise() * share;
}

/// Slow and obvious: through C^-1, skinned in the armature's space, back through C.
Points expected(const std::vector<Part>& parts, const Points& input) {
  Points shape;
  for (const Part& part : parts) {
    const Matrix4<double> space = part.space.value_or(Matrix4<double>::Identity());
    const Matrix4<double> inverse = space.inverse();
    const auto moved = [](const Matrix4<double>& matrix, const Points& points) -> Points {
      return (points * matrix.topLeftCorner<3, 3>().transpose()).rowwise() + matrix.topRightCorner<3, 1>().transpose();
    };
    const Skin there = on_points(*part.skin, moved(inverse, input));
    Points own = moved(space, skinned(part, there, moved(inverse, rigs::points_of(rigs::random_centers(*part.skin)))));
    for (Eigen::Index v = 0; part.mask && v < own.rows(); ++v) {
      own.row(v) = input.row(v) + (*part.mask)[v] * (own.row(v) - input.row(v));
    }
    if (shape.size() == 0) shape = own;
    for (Eigen::Index v = 0; part.share && v < own.rows(); ++v) {
      shape.row(v) += (*part.share)[v] * (own.row(v) - shape.row(v));
    }
  }
  return shape;
}

struct Posed {
  explicit Posed(const std::vector<Part>& parts) {
    for (const Part& part : parts) {
      stacks.push_back(std::make_unique<rigs::Stack<float>>(part.pose, 1));
      poses.push_back({stacks.back()->read(), part.space});
    }
  }
  std::vector<std::unique_ptr<rigs::Stack<float>>> stacks;
  std::vector<LayerPose> poses;
};

Deformer made(const std::vector<Part>& parts, std::shared_ptr<const ShapeKeys> keys = nullptr) {
  std::vector<std::shared_ptr<const Layer>> layers;
  for (const Part& part : parts) layers.push_back(part.layer());
  return Deformer(std::move(layers), std::move(keys));
}

Floats deformed(const Deformer& deformer, const std::vector<Part>& parts, std::span<const float> values = {},
                std::span<const float> rest = {}) {
  constexpr float kUntouched = -77;
  const Posed posed(parts);
  const std::ptrdiff_t size = 3 * deformer.vertex_count();
  Floats positions(size + 8, kUntouched);
  deformer.deform(posed.poses, std::span(positions).first(size), values, rest);
  for (int i = 0; i < 8; ++i) EXPECT_EQ(positions[size + i], kUntouched);
  positions.resize(size);
  return positions;
}

Matrix4<double> mirrored() {
  Matrix4<double> matrix = rigs::similarity();
  matrix.col(0) *= -1;
  return matrix;
}

class DeformerOnEachInstructionSet : public OnEachInstructionSet {};

INSTANTIATE_TEST_SUITE_P(Kernels, DeformerOnEachInstructionSet, each_instruction_set(), set_name);

TEST_P(DeformerOnEachInstructionSet, InEverySpaceMaskedMixedOnEveryInput) {
  rigs::Random random(1);
  const std::vector<std::optional<Matrix4<double>>> spaces{std::nullopt, rigs::turn(30, {1, 1, 0}, {1, 2, 0}),
                                                           rigs::similarity(), rigs::sheared(), mirrored()};
  for (const std::ptrdiff_t vertices : {1, 17, 4096, 4097, 9001}) {
    const auto skin = std::make_shared<const Skin>(rigs::coherent_skin(random, vertices, 9, 3));
    // Fourteen joints a vertex: blended vertex by vertex.
    const auto loose = std::make_shared<const Skin>(rigs::random_skin(random, vertices, 40));
    for (const auto& space : spaces) {
      std::vector<Part> parts{{skin, SkinningMethod::linear},   {skin, SkinningMethod::dual_quaternion},
                              {loose, SkinningMethod::linear},  {loose, SkinningMethod::dual_quaternion},
                              {skin, SkinningMethod::blended},  {skin, SkinningMethod::rotation_centers},
                              {loose, SkinningMethod::blended}, {loose, SkinningMethod::rotation_centers}};
      for (Part& part : parts) {
        part.pose = gentle_pose(random, static_cast<std::int32_t>(part.skin->joint_count()));
        part.space = space;
      }
      parts[1].mask = parts[2].mask = random_numbers(random, vertices, 0, 1);
      for (const int i : {1, 2, 3, 4, 5, 6, 7}) parts[i].share = random_numbers(random, vertices, 0, 1);
      const Floats other = random_numbers(random, 3 * vertices, -1, 1);
      const Deformer all = made(parts);
      EXPECT_LT(rigs::distance(deformed(all, parts), expected(parts, points_of(skin->rest_positions()))),
                2e-6 * rigs::kDiagonal);
      EXPECT_LT(rigs::distance(deformed(all, parts, {}, other), expected(parts, points_of(other))),
                2e-6 * rigs::kDiagonal);
    }
  }
}

TEST_P(DeformerOnEachInstructionSet, WithoutMoreItIsTheSkinningFunction) {
  rigs::Random random(2);
  for (const std::ptrdiff_t vertices : {5, 10000}) {
    for (const bool loose : {false, true}) {
      const auto skin = std::make_shared<const Skin>(loose ? rigs::random_skin(random, vertices, 40)
                                                           : rigs::coherent_skin(random, vertices, 40, 3));
      Part part{skin, SkinningMethod::linear};
      part.pose = rigs::random_pose(random, 40);
      EXPECT_EQ(deformed(made({part}), {part}), rigs::skinned(skin_linear, *skin, part.pose));
      part.method = SkinningMethod::dual_quaternion;
      const Floats dual = rigs::skinned(skin_dual_quaternion, *skin, part.pose);
      EXPECT_EQ(deformed(made({part}), {part}), dual);
      // From positions that the caller has, packed on the way, come the same bits.
      EXPECT_EQ(deformed(made({part}), {part}, {}, skin->rest_positions()), dual);
    }
  }
}

std::shared_ptr<const ShapeKeys> keys_on(const Floats& base, rigs::Random& random) {
  // The second changes the first tile alone.
  Floats second = base, third = base;
  for (std::size_t i = 0; i < base.size(); ++i) {
    if (i < 300) second[i] += 0.25f;
    third[i] += static_cast<float>(rigs::uniform(random, -0.1, 0.1));
  }
  const std::vector<std::span<const float>> positions{base, second, third};
  return std::make_shared<ShapeKeys>(positions, std::vector<std::int64_t>{0, 0, 1});
}

TEST(Deformer, ShapeKeysComeFirst) {
  rigs::Random random(3);
  const auto skin = std::make_shared<const Skin>(rigs::coherent_skin(random, 9001, 12, 3));
  const Floats base = random_numbers(random, 3 * 9001, -1, 1);  // not the skin's
  const auto keys = keys_on(base, random);
  for (const auto method : {SkinningMethod::linear, SkinningMethod::dual_quaternion}) {
    Part part{skin, method};
    part.pose = gentle_pose(random, 12);
    const Deformer deformer = made({part}, keys);
    const Deformer sum({}, keys);
    for (const Floats& values : {Floats{}, Floats{1, 0, 0}, Floats{0, 0.7f, 0}, Floats{0, -1, 2}}) {
      Floats input(base.size());
      sum.deform({}, input, values);
      EXPECT_EQ(deformed(deformer, {part}, values), deformed(deformer, {part}, {}, input));
      EXPECT_EQ(values.empty() || values[1] == 0, input == base);
    }
  }
}

TEST(Deformer, StretchRestFramesFollowTheSpace) {
  // A stretch along a joint's own axes is the same in whichever space it is looked at.
  rigs::Random random(4);
  for (const Stretch stretch : {Stretch::polar, Stretch::frame, Stretch::frame_each}) {
    const auto skin = std::make_shared<const Skin>(rigs::coherent_skin(random, 500, 6, 3));
    Matrices frames = rigs::random_pose(random, 6), pose = gentle_pose(random, 6);
    for (int j = 0; j < 6; ++j) {
      Matrix4<double> scale = Matrix4<double>::Identity();
      scale.diagonal() << 1.2, 0.7 + 0.1 * j, 0.9, 1;
      pose[j] = pose[j] * frames[j] * scale * frames[j].inverse();
    }
    // Sheared so far that neither Y and X nor X and Z say where the axes are.
    Matrix4<double> sheared_far = Matrix4<double>::Identity();
    sheared_far.topLeftCorner<3, 3>() << 2, 0, 1, 2, 2, 0, 2, 0, 2;
    pose[5] = pose[5] * frames[5] * sheared_far * frames[5].inverse();
    if (stretch == Stretch::polar) frames.clear();
    const StretchRule rule{stretch, frames};
    rigs::Stack<float> stack(pose, 1);
    const auto with_space = [&](const Matrix4<double>& space) {
      const Points rest = points_of(skin->rest_positions());
      const Matrix4<double> inverse = space.inverse();
      const Points there =
          (rest * inverse.topLeftCorner<3, 3>().transpose()).rowwise() + inverse.topRightCorner<3, 1>().transpose();
      Floats in_armature(1500), positions(1500);
      skin_dual_quaternion(on_points(*skin, there), stack.read(), in_armature, rule);
      const Deformer deformer({std::make_shared<Layer>(skin, SkinningMethod::dual_quaternion, rule)});
      const LayerPose posed{stack.read(), space};
      deformer.deform({&posed, 1}, positions);
      const Points back = (points_of(in_armature) * space.topLeftCorner<3, 3>().transpose()).rowwise() +
                          space.topRightCorner<3, 1>().transpose();
      return rigs::distance(positions, back);
    };
    EXPECT_LT(with_space(rigs::sheared()), 4e-6 * rigs::kDiagonal);
    // A polar stretch is about the origin, which is not the same in both spaces.
    if (stretch != Stretch::polar) {
      EXPECT_LT(with_space(rigs::similarity()), 4e-6 * rigs::kDiagonal);
    }
  }
}

/// Four layers of all kinds, in spaces of all kinds, on keys.
struct Everything {
  std::vector<Part> parts;
  std::shared_ptr<const ShapeKeys> keys;
  Floats values{0, 0.5f, 0.25f};

  explicit Everything(std::ptrdiff_t vertices) {
    rigs::Random random(5);
    const auto skin = std::make_shared<const Skin>(rigs::coherent_skin(random, vertices, 30, 4));
    const auto loose = std::make_shared<const Skin>(rigs::random_skin(random, vertices, 60));
    parts = {{skin, SkinningMethod::linear},
             {loose, SkinningMethod::dual_quaternion},
             {skin, SkinningMethod::dual_quaternion},
             {loose, SkinningMethod::linear}};
    parts[1].space = rigs::similarity();
    parts[2].space = rigs::sheared();
    parts[3].mask = random_numbers(random, vertices, 0, 1);
    for (Part& part : parts) {
      part.pose = gentle_pose(random, static_cast<std::int32_t>(part.skin->joint_count()));
      if (&part != parts.data()) part.share = random_numbers(random, vertices, 0, 1);
    }
    keys = keys_on(random_numbers(random, 3 * vertices, -1, 1), random);
  }
};

TEST(Deformer, AnyNumberOfThreadsGivesTheSameBits) {
  const ThreadsOfATest threads_of_a_test;
  const Everything all(30001);
  const Deformer deformer = made(all.parts, all.keys);
  set_thread_count(1);
  const Floats one = deformed(deformer, all.parts, all.values);
  for (const int threads : {2, 3, 8}) {
    set_thread_count(threads);
    EXPECT_EQ(deformed(deformer, all.parts, all.values), one) << threads << " threads";
  }
}

TEST(Deformer, SeveralThreadsMayUseOne) {
  const ThreadsOfATest threads_of_a_test;
  set_thread_count(2);
  const Everything all(9001);
  const Deformer deformer = made(all.parts, all.keys);
  const Posed posed(all.parts);
  const Floats by_keys = deformed(deformer, all.parts, all.values);
  const Floats plain = deformed(deformer, all.parts);
  std::vector<int> wrong(4);
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&, i] {
      Floats positions(by_keys.size());
      for (int frame = 0; frame < 8; ++frame) {
        const bool with_keys = (frame + i) % 2 == 0;
        deformer.deform(posed.poses, positions,
                        with_keys ? std::span<const float>(all.values) : std::span<const float>());
        wrong[i] += positions != (with_keys ? by_keys : plain);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, std::vector<int>(4));
}

TEST(Deformer, ASpaceWithoutAnInverseGivesNumbers) {
  Everything all(500);
  for (Part& part : all.parts) {
    part.space = rigs::similarity();
    part.space->col(2).setZero();
  }
  for (const float number : deformed(made(all.parts, all.keys), all.parts, all.values)) {
    EXPECT_TRUE(std::isfinite(number));
  }
  // Every point comes to lie where the armature's origin goes.
  rigs::Random random(6);
  Part part{all.parts[0].skin, SkinningMethod::linear};
  part.pose = Matrices(30, rigs::turn(50, {0, 1, 0}, {1, 2, 3}));
  part.space = all.parts[0].space;
  const Floats positions = deformed(made({part}), {part});
  const Eigen::Vector3d there = (*part.space * Eigen::Vector4d(1, 2, 3, 1)).head<3>();
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(positions[axis], there[axis], 1e-6);
}

/// Each vertex of the result is between two of the V vertices.
std::shared_ptr<const Stencils> halves(std::int32_t vertices, std::int32_t count) {
  std::vector<std::int64_t> offsets{0};
  std::vector<std::int32_t> of;
  for (std::int32_t r = 0; r < count; ++r) {
    of.insert(of.end(), {(7 * r) % vertices, (3 * r + 1) % vertices});
    offsets.push_back(2 * (r + 1));
  }
  return std::make_shared<const Stencils>(offsets, of, Floats(of.size(), 0.5f), vertices);
}

TEST(Deformer, StencilsComeLast) {
  const ThreadsOfATest threads_of_a_test;
  const std::int32_t vertices = 9001, count = 30005;
  const Everything all(vertices);
  std::vector<std::shared_ptr<const Layer>> layers;
  for (const Part& part : all.parts) layers.push_back(part.layer());
  const auto stencils = halves(vertices, count);
  const Deformer deformer(layers, all.keys, stencils);
  EXPECT_EQ(deformer.vertex_count(), vertices);
  EXPECT_EQ(deformer.result_count(), count);
  Floats expected(3 * count), found(3 * count);
  stencils->apply(deformed(Deformer(layers, all.keys), all.parts, all.values), expected);
  std::vector<double> milliseconds(2, -1.0);
  for (const int threads : {1, 2, 8}) {
    set_thread_count(threads);
    const Posed posed(all.parts);
    deformer.deform(posed.poses, found, all.values, {}, {}, milliseconds);
    EXPECT_EQ(found, expected) << threads << " threads";
  }
  EXPECT_GE(std::ranges::min(milliseconds), 0);

  // Of rest positions alone, which may be as long as the result or not.
  const Deformer alone(vertices, stencils);
  const Floats rest(3 * vertices, 2.0f);
  alone.deform({}, found, {}, rest);
  EXPECT_EQ(found, Floats(3 * count, 2.0f));
  Floats short_one(3 * vertices);
  EXPECT_EQ(complaint([&] { alone.deform({}, short_one, {}, rest); }),
            "the result has 27,003 numbers; expected 90,015 (30005 x 3)");
  EXPECT_EQ(complaint([&] { Deformer(vertices - 1, stencils); }),
            "the stencils have 9,001 vertices; the deformer has 9,000");
  milliseconds.resize(1);
  EXPECT_EQ(complaint([&] { alone.deform({}, found, {}, rest, {}, milliseconds); }),
            "milliseconds has 1 number; expected 2, two more than there are stages, with stencils");
}

TEST(Deformer, OfNoVertices) {
  const auto skin =
      std::make_shared<const Skin>(Floats{}, std::vector<std::int64_t>{0}, std::vector<std::int32_t>{}, Floats{}, 2);
  Part part{skin, SkinningMethod::linear, Floats{}};
  part.pose = rigs::identities(2);
  EXPECT_EQ(deformed(made({part}), {part}), Floats{});
}

TEST(Deformer, RefusesWhatDoesNotFit) {
  rigs::Random random(7);
  const auto skin = std::make_shared<const Skin>(rigs::coherent_skin(random, 10, 4, 2));
  const auto larger = std::make_shared<const Skin>(rigs::coherent_skin(random, 11, 4, 2));
  const Part first{skin}, with_share{skin, SkinningMethod::linear, {}, Floats(10)};
  const Part other{larger, SkinningMethod::linear, {}, Floats(11)};
  EXPECT_EQ(complaint([&] {
              (Part{skin, SkinningMethod::linear, Floats(9)}).layer();
            }),
            "mask has 9 numbers; the skin has 10 vertices");
  EXPECT_EQ(complaint([&] {
              (Part{skin, SkinningMethod::linear, {}, Floats(11)}).layer();
            }),
            "share has 11 numbers; the skin has 10 vertices");
  Floats bad(10);
  bad[3] = std::numeric_limits<float>::infinity();
  EXPECT_EQ(complaint([&] { (Part{skin, SkinningMethod::linear, bad}).layer(); }), "mask is not finite at vertex 3");
  EXPECT_EQ(complaint([&] {
              Layer(skin, SkinningMethod::dual_quaternion, {Stretch::frame, rigs::identities(3)});
            }),
            "there are 3 rest frames; expected 4");
  EXPECT_EQ(complaint([&] { made({}); }), "there are no layers and no shape keys; expected at least one of them");
  EXPECT_EQ(complaint([&] { made({first, other}); }), "layer 1 has 11 vertices; layer 0 has 10");
  EXPECT_EQ(complaint([&] { made({with_share}); }),
            "layer 0 has a share; there is nothing that it could be mixed with");
  EXPECT_EQ(complaint([&] { made({first, first}); }), "layer 1 has no share; only the first has none");
  const auto keys = keys_on(Floats(33), random);
  EXPECT_EQ(complaint([&] { made({first}, keys); }), "the keys have 11 vertices; the layers have 10");

  const Deformer deformer = made({first, with_share});
  rigs::Stack<float> four(1, 4), three(1, 3), two_frames(2, 4);
  Floats positions(30), rest(30);
  const auto said = [&](std::vector<LayerPose> poses, std::span<float> out, std::span<const float> values = {},
                        std::span<const float> input = {}) {
    return complaint([&] { deformer.deform(poses, out, values, input); });
  };
  const LayerPose good{four.read()};
  EXPECT_EQ(said({good}, positions), "there are 1 pose; the deformer has 2 layers");
  EXPECT_EQ(said({good, {three.read()}}, positions), "layer 1: there are 3 matrices per frame; the skin has 4 joints");
  EXPECT_EQ(said({{two_frames.read()}, good}, positions), "layer 0: there are 2 frames of matrices; expected 1");
  EXPECT_EQ(said({good, good}, std::span(positions).first(27)), "the result has 27 numbers; expected 30 (10 x 3)");
  EXPECT_EQ(said({good, good}, positions, Floats(2)), "there are key values, but no shape keys");
  EXPECT_EQ(said({good, good}, positions, {}, Floats(33)), "rest_positions has 33 numbers; expected 30 (10 x 3)");
  EXPECT_EQ(said({good, good}, positions, {}, positions), "the result and rest_positions overlap");
  EXPECT_EQ(said({good, good}, positions, {}, rest), "(no complaint)");

  const Deformer with_keys = made({first}, keys_on(rest, random));
  const auto said_of_keys = [&](const Floats& values, std::span<const float> input) {
    return complaint([&] { with_keys.deform({&good, 1}, positions, values, input); });
  };
  EXPECT_EQ(said_of_keys(Floats(2), {}), "there are 2 key values; expected 3, one per key");
  EXPECT_EQ(said_of_keys(Floats(3), rest), "there are key values and rest positions; expected one");
}

}  // namespace
}  // namespace sinew
