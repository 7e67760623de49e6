#include "sinew/deformer.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <string>

#include "check.h"
#include "method.h"
#include "parallel.h"
#include "space.h"

namespace sinew {
namespace {

// What adding one vertex of a key costs one thread, about, and what one vertex of a tile costs that
// only passes through.
constexpr double kMicrosecondsKey = 0.5e-3, kMicrosecondsCopy = 0.3e-3;
// And what one vertex costs that is split anew: 33 ns linear, 58 ns by dual quaternions, of three
// bones.
constexpr double kMicrosecondsBend = 40e-3;

std::optional<std::vector<float>> checked(const char* name,
                                          std::optional<std::span<const float>> numbers,
                                          std::ptrdiff_t vertices) {
  if (!numbers) return std::nullopt;
  if (std::ssize(*numbers) != vertices) {
    fail(name, " has ", plural(std::ssize(*numbers), "number"), "; the skin has ",
         plural(vertices, "vertex"));
  }
  for (std::size_t v = 0; v < numbers->size(); ++v) {
    if (!std::isfinite((*numbers)[v])) fail(name, " is not finite at vertex ", v);
  }
  return std::vector<float>(numbers->begin(), numbers->end());
}

void check_bends(const Bends& bends, const Skin& skin) {
  if (!bends.vertices().empty() && bends.vertices().back() >= skin.vertex_count()) {
    fail("bends names vertex ", bends.vertices().back(), "; the skin has ",
         plural(skin.vertex_count(), "vertex"));
  }
  if (bends.joint_count() > skin.joint_count()) {
    fail("bends names joint ", bends.joint_count() - 1, "; the skin has ",
         plural(skin.joint_count(), "joint"));
  }
}

void check_matrices_of(const Layer& layer, const LayerPose& pose, std::size_t i) {
  const std::string where = "layer " + std::to_string(i) + ": ";
  if (pose.matrices.frames != 1) {
    fail(where, "there are ", plural(pose.matrices.frames, "frame"), " of matrices; expected 1");
  }
  check_matrices(layer.skin(), pose.matrices, where);
}

/// A layer in one frame.
struct PosedLayer {
  const Layer* layer;
  const BlockedSkin* skin;
  std::optional<Space> space;  ///< points go through it and back
  std::optional<Matrix4<double>> armature_from_mesh;
  bool split_elsewhere;  ///< the skin was split in another space
  Palette palette;
  // In the space of the mesh, where matrices are skinned there but given in the armature's:
  std::vector<Matrix4<float>> matrices;
  std::vector<Matrix4<double>> rest_frames;

  void take(const Layer& own, const LayerPose& pose) {
    layer = &own;
    skin = &own.skin().blocked();
    space.reset();
    armature_from_mesh.reset();
    if (pose.mesh_from_armature) {
      space.emplace(*pose.mesh_from_armature);
      armature_from_mesh = space->back;
    }
    split_elsewhere = pose.mesh_from_armature != own.split_space();
    MatrixStack<const float> stack = pose.matrices;
    StretchRule rule = own.rule();
    if (space && space->is_carried_by(own.method())) {
      matrices.clear();
      for (std::ptrdiff_t j = 0; j < stack.joints; ++j) {
        const Matrix4<double> matrix = stack.at(0, j).cast<double>();
        matrices.push_back((space->forth * matrix * space->back).cast<float>());
      }
      stack = MatrixStack<const float>::of(matrices.data(), 1, stack.joints);
      rest_frames.clear();
      for (const auto& rest : rule.rest_frames) rest_frames.push_back(space->moved_frame(rest));
      rule.rest_frames = rest_frames;
      space.reset();
    }
    prepare(*skin, own.method(), rule, stack, 0, palette);
  }
};

/// out may be in. 3 x vertices numbers.
void transform(const Matrix4<double>& matrix, const float* in, std::size_t vertices, float* out) {
  const Eigen::Matrix3d linear = matrix.topLeftCorner<3, 3>();
  const Eigen::Vector3d offset = matrix.topRightCorner<3, 1>();
  for (std::size_t v = 0; v < vertices; ++v) {
    const Eigen::Vector3d point = Eigen::Map<const Eigen::Vector3f>(in + 3 * v).cast<double>();
    Eigen::Map<Eigen::Vector3f>(out + 3 * v) = (linear * point + offset).cast<float>();
  }
}

/// out = from + part (to - from), vertex by vertex; out may be either.
void mix(const float* from, const float* to, const float* part, std::size_t vertices, float* out) {
  for (std::size_t v = 0; v < vertices; ++v) {
    for (std::size_t i = 3 * v; i < 3 * v + 3; ++i) out[i] = from[i] + part[v] * (to[i] - from[i]);
  }
}

/// Which vertices of a tile are not where the skin's influences were split over segments.
struct Moved {
  bool all;
  const std::uint8_t* touched;  ///< one byte a vertex, or null: none
};

/// Skins the bends of tile t again that have moved, split at where they are.
/// input  the tile's points, space of the mesh.
/// rest   the same as the layer skins them: space of the mesh or of the armature.
/// own    out, in the space of `rest`.
void bend_tile(const PosedLayer& posed, std::size_t t, std::size_t count, const Moved& moved,
               const float* input, const float* rest, float* own) {
  thread_local Bends::Split split;
  if (!moved.all && !moved.touched) return;
  const Bends& bends = *posed.layer->bends();
  const auto vertices = bends.vertices();
  const auto first = static_cast<std::int64_t>(t * kTile);
  const auto end = first + static_cast<std::int64_t>(count);
  auto at = std::ranges::lower_bound(vertices, first);
  for (; at != vertices.end() && *at < end; ++at) {
    const auto v = static_cast<std::size_t>(*at - first);
    if (!moved.all && !moved.touched[v]) continue;
    Eigen::Vector3d point = Eigen::Map<const Eigen::Vector3f>(input + 3 * v).cast<double>();
    if (const auto& back = posed.armature_from_mesh) {
      point = (back->topRows<3>() * point.homogeneous()).eval();
    }
    bends.split(static_cast<std::size_t>(at - vertices.begin()), point, split);
    run_vertex({split.joints, split.weights}, posed.layer->method(), posed.palette, rest + 3 * v,
               own + 3 * v);
  }
}

/// What a thread needs besides; a tile's own.
struct Scratch {
  alignas(64) float input[3 * kTile];   ///< shape keys added
  alignas(64) float points[3 * kTile];  ///< the input, packed
  alignas(64) float moved[3 * kTile];   ///< the input in an armature's space
  alignas(64) float moved_points[3 * kTile];
  alignas(64) float own[3 * kTile];         ///< a layer that is mixed in
  alignas(64) std::uint8_t touched[kTile];  ///< by shape keys
};

Scratch& scratch_of_thread() {
  thread_local const std::unique_ptr<Scratch> scratch = std::make_unique<Scratch>();
  return *scratch;
}

/// One frame, as its tiles see it.
struct Frame {
  std::span<const PosedLayer> layers;
  const ShapeKeys* keys;  ///< or null
  std::span<const float> key_values;
  const float* input;         ///< V x 3, before shape keys are added
  const BlockedSkin* packed;  ///< has the input in packed form, or null
  std::size_t vertices;
  float* positions;  ///< out, V x 3
  bool has_bends;    ///< of some layer
  bool all_moved;    ///< none of them is where it was split

  void run_tile(std::size_t t) const {
    const std::size_t first = t * kTile, count = std::min(kTile, vertices - first);
    Scratch& scratch = scratch_of_thread();
    float* const out = positions + 3 * first;
    const float* rest = input + 3 * first;
    Moved moved{all_moved, nullptr};
    if (keys && keys->change(t, key_values)) {
      std::copy_n(rest, 3 * count, scratch.input);
      keys->add(t, key_values, scratch.input);
      rest = scratch.input;
      if (has_bends) {
        keys->mark(t, key_values, scratch.touched);
        moved.touched = scratch.touched;
      }
    }
    if (layers.empty()) {
      std::copy_n(rest, 3 * count, out);
    } else {
      skin_tile(t, count, moved, rest, scratch, out);
    }
    // Stages after skinning that look at one vertex alone belong here; those that look at its
    // neighbours need a region of their own, when all tiles are done.
  }

 private:
  void skin_tile(std::size_t t, std::size_t count, const Moved& moved, const float* rest,
                 Scratch& scratch, float* out) const {
    const float* points = packed ? packed->points.get() + 3 * t * kTile : nullptr;
    for (const PosedLayer& posed : layers) {
      const bool is_first = &posed == layers.data();
      float* const own = is_first ? out : scratch.own;
      const auto bend = [&](const float* points_of_layer) {
        if (!posed.layer->bends()) return;
        const Moved own_moved{moved.all || posed.split_elsewhere, moved.touched};
        bend_tile(posed, t, count, own_moved, rest, points_of_layer, own);
      };
      const std::size_t begin = t * kBlocksPerTile, end = begin + (count + kBlock - 1) / kBlock;
      if (posed.space) {
        transform(posed.space->back, rest, count, scratch.moved);
        pack_points(scratch.moved, count, scratch.moved_points);
        run(*posed.skin, posed.layer->method(), posed.palette,
            {begin, end, scratch.moved, scratch.moved_points, own});
        bend(scratch.moved);
        transform(posed.space->forth, own, count, own);
      } else {
        if (!points) {
          pack_points(rest, count, scratch.points);
          points = scratch.points;
        }
        run(*posed.skin, posed.layer->method(), posed.palette, {begin, end, rest, points, own});
        bend(rest);
      }
      if (const auto& mask = posed.layer->mask()) {
        mix(rest, own, mask->data() + t * kTile, count, own);
      }
      if (!is_first) mix(out, own, posed.layer->share()->data() + t * kTile, count, out);
    }
  }
};

}  // namespace

Layer::Layer(std::shared_ptr<const Skin> skin, SkinningMethod method, const StretchRule& rule,
             std::optional<std::span<const float>> mask,
             std::optional<std::span<const float>> share, std::shared_ptr<const Bends> bends,
             const std::optional<Matrix4<double>>& split_space)
    : skin_(std::move(skin)),
      method_(method),
      stretch_(rule.stretch),
      rest_frames_(rule.rest_frames.begin(), rule.rest_frames.end()),
      mask_(checked("mask", mask, skin_->vertex_count())),
      share_(checked("share", share, skin_->vertex_count())),
      bends_(std::move(bends)),
      split_space_(split_space) {
  check_rest_frames(rule, skin_->joint_count(), "");
  if (bends_) check_bends(*bends_, *skin_);
}

Deformer::Deformer(std::vector<std::shared_ptr<const Layer>> layers,
                   std::shared_ptr<const ShapeKeys> keys)
    : layers_(std::move(layers)), keys_(std::move(keys)) {
  if (layers_.empty() && !keys_) fail("there are no layers and no shape keys; expected some");
  vertex_count_ = layers_.empty() ? keys_->vertex_count() : layers_[0]->skin().vertex_count();
  for (std::size_t i = 0; i < layers_.size(); ++i) {
    const std::ptrdiff_t own = layers_[i]->skin().vertex_count();
    if (own != vertex_count_) {
      fail("layer ", i, " has ", plural(own, "vertex"), "; layer 0 has ", grouped(vertex_count_));
    }
    const bool has_share = layers_[i]->share().has_value();
    if (i == 0 && has_share)
      fail("layer 0 has a share; there is nothing that it could be mixed with");
    if (i > 0 && !has_share) fail("layer ", i, " has no share; only the first has none");
  }
  if (keys_ && keys_->vertex_count() != vertex_count_) {
    fail("the keys have ", plural(keys_->vertex_count(), "vertex"), "; the layers have ",
         grouped(vertex_count_));
  }
}

void Deformer::check(std::span<const LayerPose> poses, std::span<float> positions,
                     std::span<const float> key_values,
                     std::span<const float> rest_positions) const {
  if (poses.size() != layers_.size()) {
    fail("there are ", plural(std::ssize(poses), "pose"), "; the deformer has ",
         plural(std::ssize(layers_), "layer"));
  }
  for (std::size_t i = 0; i < poses.size(); ++i) check_matrices_of(*layers_[i], poses[i], i);
  const auto check_size = [&](const char* name, std::span<const float> numbers) {
    if (std::ssize(numbers) == 3 * vertex_count_) return;
    fail(name, " has ", plural(std::ssize(numbers), "number"), "; expected ",
         grouped(3 * vertex_count_), " (", vertex_count_, " x 3)");
  };
  check_size("the result", positions);
  if (!key_values.empty()) {
    if (!keys_) fail("there are key values, but no shape keys");
    if (!rest_positions.empty()) fail("there are key values and rest positions; expected one");
    if (std::ssize(key_values) != keys_->count()) {
      fail("there are ", plural(std::ssize(key_values), "key value"), "; expected ",
           grouped(keys_->count()), ", one a key");
    }
  }
  if (rest_positions.empty()) return;
  check_size("rest_positions", rest_positions);
  const std::less<const float*> before;
  if (before(positions.data(), rest_positions.data() + rest_positions.size()) &&
      before(rest_positions.data(), positions.data() + positions.size())) {
    fail("the result and rest_positions overlap");
  }
}

void Deformer::deform(std::span<const LayerPose> poses, std::span<float> positions,
                      std::span<const float> key_values,
                      std::span<const float> rest_positions) const {
  check(poses, positions, key_values, rest_positions);
  if (vertex_count_ == 0) return;
  const auto vertices = static_cast<std::size_t>(vertex_count_);

  // Kept from call to call, and never fewer than were used before: a frame allocates nothing. What
  // runs in parallel does not come back here, so a thread needs one list.
  thread_local std::vector<PosedLayer> posed;
  if (posed.size() < layers_.size()) posed.resize(layers_.size());
  for (std::size_t i = 0; i < layers_.size(); ++i) posed[i].take(*layers_[i], poses[i]);

  Frame frame{{posed.data(), layers_.size()},
              nullptr,
              key_values,
              nullptr,
              nullptr,
              vertices,
              positions.data(),
              false,
              !rest_positions.empty()};
  if (!rest_positions.empty()) {
    frame.input = rest_positions.data();
  } else if (keys_) {
    frame.keys = keys_.get();
    frame.input = keys_->base().data();
  } else {
    frame.input = layers_[0]->skin().rest_positions().data();
    frame.packed = posed[0].skin;
  }

  const std::ptrdiff_t changed = frame.keys ? keys_->changed_by(key_values) : 0;
  double microseconds = kMicrosecondsCopy * static_cast<double>(vertices) +
                        kMicrosecondsKey * static_cast<double>(changed);
  for (std::size_t i = 0; i < layers_.size(); ++i) {
    microseconds += microseconds_a_vertex(layers_[i]->method()) * static_cast<double>(vertices);
    if (!layers_[i]->bends()) continue;
    frame.has_bends = true;
    const std::ptrdiff_t listed = std::ssize(layers_[i]->bends()->vertices());
    const bool all = frame.all_moved || posed[i].split_elsewhere;
    microseconds +=
        kMicrosecondsBend * static_cast<double>(all ? listed : std::min(listed, changed));
  }
  const std::size_t tiles = (vertices + kTile - 1) / kTile;
  parallel_for(tiles, threads_pay(microseconds) ? 1 : tiles,
               [&](std::size_t begin, std::size_t end) {
                 for (std::size_t t = begin; t < end; ++t) frame.run_tile(t);
               });
}

}  // namespace sinew
