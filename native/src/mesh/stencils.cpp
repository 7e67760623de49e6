#include "sinew/stencils.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "base/kept.h"
#include "base/offsets.h"
#include "base/parallel.h"
#include "base/vertex_numbers.h"
#include "mesh/faces.h"
#include "sinew/lists.h"

namespace sinew {
namespace {

constexpr std::size_t kPadded = 4;  // numbers of a point that is read as one vector
constexpr std::size_t kRowsPerTask = 4096;
constexpr double kMicrosecondsPerEntry = 1e-3;  // measured: an entry is read and added in about 1 ns

/// What each processor has registers for.
using Four [[gnu::vector_size(16)]] = float;

Four four_at(const float* numbers) {
  Four four;
  std::memcpy(&four, numbers, sizeof four);
  return four;
}

void check_finite(std::string_view name, std::span<const float> numbers) {
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (!std::isfinite(numbers[i])) fail(name, "[", i, "] is ", numbers[i], "; expected a finite number");
  }
}

/// What there is of each of so many rows, or of none.
void check_rows(std::string_view name, std::span<const float> numbers, std::size_t count) {
  if (!numbers.empty() && numbers.size() != 3 * count) {
    fail(name, " has ", plural(std::ssize(numbers) / 3, "row"), "; expected ", grouped(std::ptrdiff_t(count)));
  }
  check_finite(name, numbers);
}

}  // namespace

struct Stencils::Scratch {
  Kept<std::vector<float>> points;
};

Stencils::Stencils(std::span<const std::int64_t> offsets, std::span<const std::int32_t> vertices,
                   std::span<const float> weights, std::ptrdiff_t vertex_count, std::span<const float> scales,
                   std::span<const float> shifts)
    : vertex_count_(vertex_count), pattern_begin_{0}, scratch_(std::make_unique<Scratch>()) {
  check_vertex_count(vertex_count);
  check_vertices("vertices", vertices, vertex_count);
  if (weights.size() != vertices.size()) {
    fail("weights has ", plural(std::ssize(weights), "number"), "; expected ", vertices.size(),
         ", one for each of vertices");
  }
  if (vertices.size() >= std::numeric_limits<std::uint32_t>::max()) {
    fail("vertices has ", plural(std::ssize(vertices), "number"), "; expected fewer than 2^32");
  }
  check_finite("weights", weights);
  check_offsets("offsets", offsets, std::ssize(vertices), "entries");
  const std::size_t count = offsets.size() - 1;
  check_rows("scales", scales, count);
  check_rows("shifts", shifts, count);
  const bool is_placed = !scales.empty() || !shifts.empty();
  vertices_.assign(vertices.begin(), vertices.end());
  rows_.reserve(count);
  std::unordered_map<std::string, std::uint32_t> patterns;  // by the bytes of their weights and placings
  for (std::size_t r = 0; r + 1 < offsets.size(); ++r) {
    const auto own = weights.subspan(offsets[r], offsets[r + 1] - offsets[r]);
    Placing placing;
    if (!scales.empty()) std::copy_n(&scales[3 * r], 3, placing.scale.begin());
    if (!shifts.empty()) std::copy_n(&shifts[3 * r], 3, placing.shift.begin());
    std::string bytes(reinterpret_cast<const char*>(own.data()), own.size_bytes());
    if (is_placed) bytes.append(reinterpret_cast<const char*>(&placing), sizeof placing);
    const auto [at, is_new] = patterns.try_emplace(std::move(bytes), static_cast<std::uint32_t>(patterns.size()));
    if (is_new) {
      if (is_placed) placings_.push_back(placing);
      pattern_weights_.insert(pattern_weights_.end(), own.begin(), own.end());
      pattern_begin_.push_back(static_cast<std::uint32_t>(pattern_weights_.size()));
    }
    rows_.push_back({static_cast<std::uint32_t>(offsets[r]), at->second});
  }
}

Stencils::~Stencils() = default;

void Stencils::apply(std::span<const float> positions, std::span<float> out) const {
  if (std::ssize(positions) != 3 * vertex_count()) {
    fail("positions has ", plural(std::ssize(positions) / 3, "vertex"), "; expected ", grouped(vertex_count()));
  }
  if (std::ssize(out) != 3 * count()) {
    fail("out has ", plural(std::ssize(out) / 3, "vertex"), "; expected ", grouped(count()));
  }
  const auto points = scratch_->points.borrow([] { return std::make_unique<std::vector<float>>(); });
  points->resize(kPadded * static_cast<std::size_t>(vertex_count()));
  for (std::size_t v = 0; v < static_cast<std::size_t>(vertex_count()); ++v) {
    std::copy_n(&positions[3 * v], 3, &(*points)[kPadded * v]);
  }
  const float* const all = points->data();
  const double microseconds = kMicrosecondsPerEntry * static_cast<double>(entry_count());
  const std::size_t grain = threads_pay(microseconds) ? kRowsPerTask : rows_.size();
  parallel_for(rows_.size(), std::max<std::size_t>(grain, 1), [&](std::size_t begin, std::size_t end) {
    placings_.empty() ? apply_rows<false>(all, out, begin, end) : apply_rows<true>(all, out, begin, end);
  });
}

/// points: V, kPadded each.
template <bool kIsPlaced>
void Stencils::apply_rows(const float* points, std::span<float> out, std::size_t begin, std::size_t end) const {
  for (std::size_t r = begin; r < end; ++r) {
    const std::uint32_t pattern = rows_[r].pattern;
    const float* weight = pattern_weights_.data() + pattern_begin_[pattern];
    const float* const last = pattern_weights_.data() + pattern_begin_[pattern + 1];
    const std::uint32_t* vertex = vertices_.data() + rows_[r].begin;
    Four sum{};
    for (; weight != last; ++weight, ++vertex) sum += *weight * four_at(points + kPadded * *vertex);
    if constexpr (kIsPlaced) {
      const Placing& placing = placings_[pattern];
      sum = sum * four_at(placing.scale.data()) + four_at(placing.shift.data());
    }
    std::memcpy(&out[3 * r], &sum, 3 * sizeof(float));
  }
}

std::optional<std::vector<std::int32_t>> colours_apart(std::ptrdiff_t vertex_count, std::span<const std::int32_t> edges,
                                                       const Faces& faces, int steps, int most) {
  check_vertex_count(vertex_count);
  check_vertices("edges", edges, vertex_count);
  check_faces(faces, vertex_count);
  if (steps < 0) fail("steps is ", steps, "; expected 0 or more");
  if (most < 1) fail("most is ", most, "; expected 1 or more");
  const auto count = static_cast<std::size_t>(vertex_count);
  const auto side_of = [&](std::size_t e) { return edges.subspan(2 * e, 2); };
  const auto corners_of = [&](std::size_t f) {
    return faces.vertices.subspan(faces.offsets[f], faces.offsets[f + 1] - faces.offsets[f]);
  };
  const Lists<std::uint32_t> edges_at(count, [&](const auto& add) {
    for (std::size_t i = 0; i < edges.size(); ++i) add(edges[i], static_cast<std::uint32_t>(i / 2));
  });
  const Lists<std::uint32_t> faces_at(count, [&](const auto& add) {
    for (std::size_t f = 0; f < faces.count(); ++f) {
      for (const std::int32_t v : corners_of(f)) add(v, static_cast<std::uint32_t>(f));
    }
  });
  constexpr std::uint32_t kNever = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::int32_t> colours(count, -1);
  std::vector<std::uint32_t> seen(count, kNever), seen_face(faces.count(), kNever), near;
  std::vector<std::uint32_t> used(std::min<std::size_t>(most, count), kNever);  // each vertex could have its own
  for (std::uint32_t v = 0; v < count; ++v) {
    near.assign(1, v);
    seen[v] = v;
    const auto visit = [&](std::int32_t other) {
      if (std::exchange(seen[other], v) == v) return;
      near.push_back(static_cast<std::uint32_t>(other));
      if (colours[other] >= 0) used[colours[other]] = v;
    };
    std::size_t begin = 0;
    for (int step = 0; step < steps && begin < near.size(); ++step) {
      const std::size_t end = near.size();
      for (; begin < end; ++begin) {
        const std::uint32_t at = near[begin];
        for (const std::uint32_t e : edges_at[at]) std::ranges::for_each(side_of(e), visit);
        for (const std::uint32_t f : faces_at[at]) {
          if (std::exchange(seen_face[f], v) != v) std::ranges::for_each(corners_of(f), visit);
        }
      }
    }
    const auto free = std::ranges::find_if(used, [&](std::uint32_t by) { return by != v; });
    if (free == used.end()) return std::nullopt;
    colours[v] = static_cast<std::int32_t>(free - used.begin());
  }
  return colours;
}

}  // namespace sinew
