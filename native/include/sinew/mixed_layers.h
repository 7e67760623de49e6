/// Blender's Armature modifier behind others: skins the shape that the stages before it leave.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sinew/layer.h"
#include "sinew/types.h"

namespace sinew {

/// The layers of one Armature modifier, or of several that Multi Modifier mixes, as a stage. All start from the shape
/// that the stage gets; the results are mixed by their shares. The rest positions of their skins have no effect, and
/// bends are split where the vertices are in that shape. A long run of vertices without an influence costs nothing, such
/// as a body behind which a face's armature comes. Immutable; several threads may use one object at once.
class MixedLayers {
 public:
  struct Settings {
    std::span<const LayerPose> poses{};  ///< one per layer; must outlive the settings
  };

  /// layers  one or more, of which the first has no share and every other has one.
  /// Throws InputError if there are none, if two have different numbers of vertices and if the shares do not fit.
  explicit MixedLayers(std::vector<std::shared_ptr<const Layer>> layers);

  /// V.
  std::ptrdiff_t vertex_count() const { return layers_[0]->skin().vertex_count(); }
  const std::vector<std::shared_ptr<const Layer>>& layers() const { return layers_; }

  /// Throws what apply() would throw for poses that do not fit, and does nothing else.
  void check(const Settings& settings) const;

  /// The approximate time of apply() on one thread.
  double microseconds(const Settings& settings) const;

  /// positions  in and out, V x 3, in mesh space. Uses one parallel region. Allocates nothing once each thread has
  ///            seen layers of this size. The result has the same bits for any number of threads.
  /// Throws InputError if a shape does not fit.
  void apply(const Settings& settings, std::span<float> positions) const;

 private:
  std::vector<std::shared_ptr<const Layer>> layers_;
  std::vector<std::uint32_t> tiles_;  // those with an influence
};

}  // namespace sinew
