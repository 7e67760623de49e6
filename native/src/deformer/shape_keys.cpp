#include "sinew/shape_keys.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/check.h"
#include "base/parallel.h"
#include "skinning/tile.h"

// CMakeLists.txt has this file compiled without fused multiply-adds: Blender rounds in between.

namespace sinew {
namespace {

// The approximate cost on one thread of comparing a vertex of two keys.
constexpr double kMicrosecondsToCompare = 1e-3;

// How many vertices are compared at once; in most of a character's keys, most such groups are equal.
constexpr std::size_t kCompared = 64;

constexpr std::uint32_t kNoWeights = ~std::uint32_t{0};

/// Consecutive vertices that differ, counted from the tile's first.
struct Run {
  std::uint16_t first;
  std::uint16_t count;
  std::uint32_t delta;   ///< where their differences begin, in vertices
  std::uint32_t weight;  ///< where their weights begin, or kNoWeights
};

/// Has no branch in the loop, so that it is vectorised.
bool differ(const float* a, const float* b, std::size_t numbers) {
  int any = 0;
  for (std::size_t i = 0; i < numbers; ++i) any |= a[i] != b[i];
  return any != 0;
}

using Weights = std::span<const std::optional<std::span<const float>>>;

void check(std::span<const std::span<const float>> positions, std::span<const std::int64_t> relative_to,
           Weights weights) {
  if (positions.empty()) fail("there are no shape keys; expected the base at least");
  if (relative_to.size() != positions.size()) {
    fail("relative_to has ", plural(std::ssize(relative_to), "entry"), "; there are ",
         plural(std::ssize(positions), "key"));
  }
  if (!weights.empty() && weights.size() != positions.size()) {
    fail("weights has ", plural(std::ssize(weights), "entry"), "; there are ", plural(std::ssize(positions), "key"));
  }
  const std::size_t numbers = positions[0].size();
  if (numbers % 3 != 0) {
    fail("key 0 has ", plural(std::ssize(positions[0]), "number"), "; expected three per vertex");
  }
  for (std::size_t k = 0; k < positions.size(); ++k) {
    if (positions[k].size() != numbers) {
      fail("key ", k, " has ", plural(std::ssize(positions[k]) / 3, "vertex"), "; key 0 has ",
           grouped(static_cast<long long>(numbers / 3)));
    }
    if (!weights.empty() && weights[k] && 3 * weights[k]->size() != numbers) {
      fail("key ", k, " has ", plural(std::ssize(*weights[k]), "weight"), "; there are ",
           plural(static_cast<long long>(numbers / 3), "vertex"));
    }
  }
}

}  // namespace

/// The changes of all keys to kTile vertices.
struct ShapeKeys::Tile {
  std::vector<std::uint32_t> run_begin{0};  ///< K + 1, in runs
  std::vector<Run> runs;
  std::vector<float> deltas;  ///< r_v - k_v, x y z
  std::vector<float> weights;

  /// weight: of each vertex, or null.
  void add(const float* reference, const float* key, const float* weight, std::size_t vertices) {
    for (std::size_t first = 0; first < vertices; first += kCompared) {
      const std::size_t count = std::min(kCompared, vertices - first);
      if (!differ(reference + 3 * first, key + 3 * first, 3 * count)) continue;
      for (std::size_t v = first; v < first + count; ++v) {
        if (!differ(reference + 3 * v, key + 3 * v, 3)) continue;
        if (weight && weight[v] == 0) continue;
        add_vertex(v, reference + 3 * v, key + 3 * v, weight);
      }
    }
  }

  void end_key() { run_begin.push_back(static_cast<std::uint32_t>(runs.size())); }

  std::span<const Run> of(std::size_t key) const {
    return std::span(runs).subspan(run_begin[key], run_begin[key + 1] - run_begin[key]);
  }

 private:
  void add_vertex(std::size_t v, const float* reference, const float* key, const float* weight) {
    const bool goes_on = runs.size() > run_begin.back() && runs.back().first + std::size_t{runs.back().count} == v;
    if (goes_on) {
      ++runs.back().count;
    } else {
      runs.push_back({static_cast<std::uint16_t>(v), 1, static_cast<std::uint32_t>(deltas.size() / 3),
                      weight ? static_cast<std::uint32_t>(weights.size()) : kNoWeights});
    }
    for (int axis = 0; axis < 3; ++axis) deltas.push_back(reference[axis] - key[axis]);
    if (weight) weights.push_back(weight[v]);
  }
};

ShapeKeys::ShapeKeys(std::span<const std::span<const float>> positions, std::span<const std::int64_t> relative_to,
                     Weights weights) {
  check(positions, relative_to, weights);
  const auto keys = positions.size();
  const std::size_t vertices = positions[0].size() / 3;
  base_.assign(positions[0].begin(), positions[0].end());
  tiles_.resize((vertices + kTile - 1) / kTile);
  const auto take_tiles = [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const std::size_t first = t * kTile, count = std::min(kTile, vertices - first);
      for (std::size_t k = 0; k < keys; ++k) {
        const auto reference = static_cast<std::size_t>(relative_to[k]);  // a negative one is huge
        if (k > 0 && reference < keys) {
          const bool weighted = !weights.empty() && weights[k];
          tiles_[t].add(positions[reference].data() + 3 * first, positions[k].data() + 3 * first,
                        weighted ? weights[k]->data() + first : nullptr, count);
        }
        tiles_[t].end_key();
      }
      tiles_[t].runs.shrink_to_fit();
      tiles_[t].deltas.shrink_to_fit();
      tiles_[t].weights.shrink_to_fit();
    }
  };
  const bool parallel = threads_pay(kMicrosecondsToCompare * static_cast<double>(vertices * keys));
  parallel_for(tiles_.size(), parallel ? 1 : tiles_.size(), take_tiles);

  for (std::size_t i = 0; i < base_.size(); ++i) {
    if (!std::isfinite(base_[i])) fail("vertex ", i / 3, " of key 0 is not finite");
  }
  differing_.assign(keys, 0);
  for (std::size_t t = 0; t < tiles_.size(); ++t) {
    for (std::size_t k = 0; k < keys; ++k) {
      for (const Run& run : tiles_[t].of(k)) {
        differing_[k] += run.count;
        for (std::size_t i = 0; i < run.count; ++i) {
          const float* delta = tiles_[t].deltas.data() + 3 * (run.delta + i);
          const float weight = run.weight == kNoWeights ? 0 : tiles_[t].weights[run.weight + i];
          const bool finite = std::all_of(delta, delta + 3, [](float x) { return std::isfinite(x); });
          if (finite && std::isfinite(weight)) continue;
          fail("vertex ", t * kTile + run.first + i, " of key ", k, " is not finite");
        }
      }
    }
  }
}

ShapeKeys::ShapeKeys(ShapeKeys&&) noexcept = default;
ShapeKeys& ShapeKeys::operator=(ShapeKeys&&) noexcept = default;
ShapeKeys::~ShapeKeys() = default;

std::ptrdiff_t ShapeKeys::delta_count() const {
  return std::accumulate(differing_.begin(), differing_.end(), std::ptrdiff_t{0});
}

std::ptrdiff_t ShapeKeys::changed_by(std::span<const float> values) const {
  std::ptrdiff_t sum = 0;
  for (std::size_t k = 0; k < values.size(); ++k) sum += values[k] != 0 ? differing_[k] : 0;
  return sum;
}

bool ShapeKeys::change(std::size_t tile, std::span<const float> values) const {
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (values[k] != 0 && !tiles_[tile].of(k).empty()) return true;
  }
  return false;
}

void ShapeKeys::mark(std::size_t tile, std::span<const float> values, std::uint8_t* touched) const {
  const std::size_t vertices = base_.size() / 3;
  std::fill_n(touched, std::min(kTile, vertices - tile * kTile), std::uint8_t{0});
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (values[k] == 0) continue;
    for (const Run& run : tiles_[tile].of(k)) {
      std::fill_n(touched + run.first, run.count, std::uint8_t{1});
    }
  }
}

void ShapeKeys::add(std::size_t tile, std::span<const float> values, float* positions) const {
  const Tile& own = tiles_[tile];
  for (std::size_t k = 0; k < values.size(); ++k) {
    const float value = values[k];
    if (value == 0) continue;
    for (const Run& run : own.of(k)) {
      float* at = positions + 3 * std::size_t{run.first};
      const float* delta = own.deltas.data() + 3 * std::size_t{run.delta};
      if (run.weight == kNoWeights) {
        for (std::size_t i = 0; i < 3 * std::size_t{run.count}; ++i) at[i] -= value * delta[i];
        continue;
      }
      for (std::size_t i = 0; i < run.count; ++i) {
        const float factor = own.weights[run.weight + i] * value;
        for (int axis = 0; axis < 3; ++axis) at[3 * i + axis] -= factor * delta[3 * i + axis];
      }
    }
  }
}

}  // namespace sinew
