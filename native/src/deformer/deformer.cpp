#include "sinew/deformer.h"

#include <chrono>
#include <functional>
#include <string>

#include "base/check.h"
#include "base/kept.h"
#include "base/parallel.h"
#include "base/vertex_numbers.h"
#include "deformer/run_layers.h"

namespace sinew {
namespace {

void check_stage(const Stage& stage, std::ptrdiff_t vertices, std::size_t i) {
  std::visit(
      [&](const auto& one) {
        const std::ptrdiff_t own = one.stage->vertex_count();
        if (own != vertices) {
          fail("stage ", i, " has ", plural(own, "vertex"), "; the deformer has ", grouped(vertices));
        }
        try {
          one.stage->check(one.settings);
        } catch (const InputError& error) {
          fail("stage ", i, ": ", error.what());
        }
      },
      stage);
}

/// Writes the milliseconds since it was made, or since it last wrote.
class Watch {
 public:
  explicit Watch(std::span<double> milliseconds) : out_(milliseconds) {}
  void stop(std::size_t i) {
    if (out_.empty()) return;
    const auto now = Clock::now();
    out_[i] = std::chrono::duration<double, std::milli>(now - last_).count();
    last_ = now;
  }

 private:
  using Clock = std::chrono::steady_clock;
  std::span<double> out_;
  Clock::time_point last_ = Clock::now();
};

}  // namespace

/// The shapes from which stencils make the output.
struct Deformer::Scratch {
  explicit Scratch(const Stencils& stencils, std::ptrdiff_t vertices) {
    if (stencils.vertex_count() != vertices) {
      fail("the stencils have ", plural(stencils.vertex_count(), "vertex"), "; the deformer has ", grouped(vertices));
    }
  }
  Kept<std::vector<float>> shapes;
};

Deformer::Deformer(std::ptrdiff_t vertex_count, std::shared_ptr<const Stencils> stencils)
    : stencils_(std::move(stencils)), vertex_count_(vertex_count) {
  check_vertex_count(vertex_count);
  if (stencils_) scratch_ = std::make_unique<Scratch>(*stencils_, vertex_count_);
}

Deformer::Deformer(std::vector<std::shared_ptr<const Layer>> layers, std::shared_ptr<const ShapeKeys> keys,
                   std::shared_ptr<const Stencils> stencils)
    : layers_(std::move(layers)), keys_(std::move(keys)), stencils_(std::move(stencils)) {
  if (layers_.empty() && !keys_) fail("there are no layers and no shape keys; expected at least one of them");
  vertex_count_ = layers_.empty() ? keys_->vertex_count() : layers_[0]->skin().vertex_count();
  check_layers(layers_);
  if (keys_ && keys_->vertex_count() != vertex_count_) {
    fail("the keys have ", plural(keys_->vertex_count(), "vertex"), "; the layers have ", grouped(vertex_count_));
  }
  if (stencils_) scratch_ = std::make_unique<Scratch>(*stencils_, vertex_count_);
}

Deformer::~Deformer() = default;
Deformer::Deformer(Deformer&&) noexcept = default;

void Deformer::check(std::span<const LayerPose> poses, std::span<float> positions, std::span<const float> key_values,
                     std::span<const float> rest_positions, std::span<const Stage> stages,
                     std::span<double> milliseconds) const {
  check_poses(layers_, poses, "the deformer");
  for (std::size_t i = 0; i < stages.size(); ++i) check_stage(stages[i], vertex_count_, i);
  const std::size_t steps = step_count(stages.size());
  if (!milliseconds.empty() && milliseconds.size() != steps) {
    fail("milliseconds has ", plural(std::ssize(milliseconds), "number"), "; expected ", steps, ", ",
         stencils_ ? "two more than there are stages, with stencils" : "one more than there are stages");
  }
  check_position_count("the result", positions, result_count());
  if (!key_values.empty()) {
    if (!keys_) fail("there are key values, but no shape keys");
    if (!rest_positions.empty()) fail("there are key values and rest positions; expected one");
    if (std::ssize(key_values) != keys_->count()) {
      fail("there are ", plural(std::ssize(key_values), "key value"), "; expected ", grouped(keys_->count()),
           ", one per key");
    }
  }
  if (rest_positions.empty()) {
    if (layers_.empty() && !keys_ && vertex_count_ > 0) {
      fail("there are no layers and no shape keys; expected rest_positions");
    }
    return;
  }
  check_position_count("rest_positions", rest_positions, vertex_count_);
  const std::less<const float*> before;
  if (before(positions.data(), rest_positions.data() + rest_positions.size()) &&
      before(rest_positions.data(), positions.data() + positions.size())) {
    fail("the result and rest_positions overlap");
  }
}

void Deformer::deform(std::span<const LayerPose> poses, std::span<float> positions, std::span<const float> key_values,
                      std::span<const float> rest_positions, std::span<const Stage> stages,
                      std::span<double> milliseconds) const {
  check(poses, positions, key_values, rest_positions, stages, milliseconds);
  if (!stencils_) return make_shape(poses, positions, key_values, rest_positions, stages, milliseconds);
  const auto shape = scratch_->shapes.borrow([] { return std::make_unique<std::vector<float>>(); });
  shape->resize(3 * static_cast<std::size_t>(vertex_count_));
  const std::size_t last = stages.size() + 1;
  make_shape(poses, *shape, key_values, rest_positions, stages,
             milliseconds.empty() ? milliseconds : milliseconds.first(last));
  Watch watch(milliseconds);
  stencils_->apply(*shape, positions);
  watch.stop(last);
}

void Deformer::make_shape(std::span<const LayerPose> poses, std::span<float> positions,
                          std::span<const float> key_values, std::span<const float> rest_positions,
                          std::span<const Stage> stages, std::span<double> milliseconds) const {
  double microseconds = 0;
  for (const Stage& stage : stages) {
    microseconds += std::visit([](const auto& one) { return one.stage->microseconds(one.settings); }, stage);
  }
  const WorkAhead work_ahead(microseconds);
  Watch watch(milliseconds);
  if (!rest_positions.empty()) {
    run_layers(layers_, poses, {rest_positions}, positions);
  } else if (keys_) {
    run_layers(layers_, poses, {keys_->base(), keys_.get(), key_values}, positions);
  } else if (!layers_.empty()) {
    run_layers(layers_, poses, {layers_[0]->skin().rest_positions(), nullptr, {}, true}, positions);
  }
  watch.stop(0);
  for (std::size_t i = 0; i < stages.size(); ++i) {
    std::visit([&](const auto& one) { one.stage->apply(one.settings, positions); }, stages[i]);
    watch.stop(i + 1);
  }
}

}  // namespace sinew
