#include <algorithm>

#include "mesh/adjacency.h"
#include "sinew/weight_tools.h"
#include "weight_tools/check_tables.h"
#include "weight_tools/vertex_reduction.h"
#include "weights/weight_rows.h"

namespace sinew {
namespace {

constexpr std::size_t kVertices = 64;  // in a task

/// Steps of the progress.
constexpr std::int64_t kReduceSteps = 100, kFadeSteps = 20;

/// Returns the weights in which each bone fades towards the vertices that have lost it.
WeightTable fade(const WeightTable& before, const WeightTable& reduced, const Faces& faces, int rings,
                 std::span<const std::uint8_t> is_locked, Progress* progress) {
  const auto vertices = static_cast<std::size_t>(before.vertices()), bones = static_cast<std::size_t>(before.bones());
  const Lists<std::uint32_t> around = neighbours_by_sides(faces, vertices);
  const auto entry_of = [&](std::uint32_t v, std::int32_t bone) {
    const auto row = reduced.row(v);
    const auto found = std::ranges::lower_bound(row, bone, {}, &BoneWeight::bone);
    return found != row.end() && found->bone == bone ? reduced.offsets()[v] + (found - row.begin()) : std::int64_t{-1};
  };
  const Lists<std::uint32_t> lost(bones, [&](const auto& add) {
    for (std::uint32_t v = 0; v < vertices; ++v) {
      for (const BoneWeight& own : before.row(v)) {
        if (entry_of(v, own.bone) < 0) add(own.bone, v);
      }
    }
  });
  std::vector<float> factors(reduced.entries().size(), 1);
  parallel_for(bones, 1, [&](std::size_t begin, std::size_t end) {
    std::vector<int> ring(vertices, -1);
    std::vector<std::uint32_t> reached;
    for (std::size_t bone = begin; bone < end; ++bone) {
      stop_if_cancelled(progress);
      reached.assign(lost[bone].begin(), lost[bone].end());
      for (const std::uint32_t v : reached) ring[v] = 0;
      for (std::size_t next = 0; next < reached.size(); ++next) {
        const int step = ring[reached[next]] + 1;
        if (step > rings) break;
        for (const std::uint32_t other : around[reached[next]]) {
          if (ring[other] >= 0) continue;
          ring[other] = step;
          reached.push_back(other);
          const std::int64_t entry = entry_of(other, static_cast<std::int32_t>(bone));
          if (entry >= 0) factors[entry] = static_cast<float>(step) / static_cast<float>(rings + 1);
        }
      }
      for (const std::uint32_t v : reached) ring[v] = -1;
    }
  });
  return table_of_rows(vertices, before.bones(), 4096, progress, kFadeSteps, [&](auto begin, auto end, auto& rows) {
    RowSum sum(bones);
    for (std::size_t v = begin; v < end; ++v) {
      const auto row = reduced.row(v);
      const std::span<const float> own = std::span(factors).subspan(reduced.offsets()[v], row.size());
      if (std::ranges::all_of(own, [](float factor) { return factor == 1; }) ||
          std::ranges::any_of(row, [&](const BoneWeight& one) { return is_locked[one.bone] != 0; })) {
        rows.add_row(row);
        continue;
      }
      for (std::size_t i = 0; i < row.size(); ++i) sum.add(row[i].bone, static_cast<double>(own[i]) * row[i].weight);
      rows.add_row(sum.take(sum_of(row) / sum.total()));
    }
  });
}

}  // namespace

std::optional<ReducedWeights> reduce_weights(const WeightTable& weights, std::span<const float> positions,
                                             MatrixStack<const double> matrices, const Faces& faces,
                                             const ReduceSettings& settings, Progress* progress) {
  check_positions("positions", positions, weights.vertices());
  check_faces(faces, weights.vertices());
  check_range("max_influences", settings.most, 1, 64);
  check_range("rings", settings.rings, 0, 64);
  const std::vector<std::uint8_t> is_locked = checked_locked(settings.locked, weights.bones());
  if (settings.rings > 0 && faces.offsets.empty())
    fail("rings is ", settings.rings, ", and there are no faces; expected both");
  if (matrices.joints != weights.bones()) {
    fail("matrices has ", plural(matrices.joints, "joint"), ", weights ", plural(weights.bones(), "column"));
  }
  if (matrices.frames < 1) fail("matrices has no poses; expected one at least");
  for (std::ptrdiff_t f = 0; f < matrices.frames; ++f) {
    for (std::ptrdiff_t j = 0; j < matrices.joints; ++j) {
      if (!matrices.at(f, j).allFinite()) fail("matrices is not finite in pose ", f, " at joint ", j);
    }
  }
  const auto vertices = static_cast<std::size_t>(weights.vertices());
  try {
    if (progress) progress->start(kReduceSteps + (settings.rings > 0 ? 2 * kFadeSteps : 0));
    ReducedWeights result{WeightTable(), std::vector<float>(vertices), std::vector<float>(vertices)};
    const auto keep = [&](std::size_t v, const Move& move) {
      result.largest[v] = move.largest;
      result.mean[v] = move.mean;
    };
    result.weights = table_of_rows(vertices, weights.bones(), kVertices, progress, kReduceSteps,
                                   [&](auto begin, auto end, auto& rows) {
                                     VertexReduction reduction(positions, matrices, is_locked, settings.most);
                                     for (std::size_t v = begin; v < end; ++v)
                                       keep(v, reduction.run(v, weights.row(v), rows));
                                   });
    if (settings.rings == 0) return result;
    WeightTable faded = fade(weights, result.weights, faces, settings.rings, is_locked, progress);
    parallel_for((vertices + kVertices - 1) / kVertices, 1, [&](std::size_t first, std::size_t last) {
      VertexReduction reduction(positions, matrices, is_locked, settings.most);
      for (std::size_t v = first * kVertices; v < std::min(vertices, last * kVertices); ++v) {
        if (v % kVertices == 0) stop_if_cancelled(progress);
        if (std::ranges::equal(faded.row(v), result.weights.row(v))) continue;
        keep(v, reduction.measure(v, weights.row(v), faded.row(v)));
      }
    });
    result.weights = std::move(faded);
    if (progress) progress->advance(kFadeSteps);
    return result;
  } catch (const Cancelled&) {
    return std::nullopt;
  }
}

}  // namespace sinew
