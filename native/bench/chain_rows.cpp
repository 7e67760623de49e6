#include "chain_rows.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "baselines.h"
#include "sinew/deformer.h"
#include "sinew/stencils.h"
#include "sinew/threads.h"

namespace sinew::bench {
namespace {

constexpr int kKeys = 50, kIterations = 5, kStencils = 4, kEntries = 12;

/// A tube of quads, its stages, and keys of which each changes one vertex in twenty.
struct Tube {
  explicit Tube(std::int32_t rings, std::int32_t around = 300) {
    std::vector<std::int32_t> edges, offsets{0}, corners;
    const auto at = [&](std::int32_t ring, std::int32_t k) { return ring * around + k % around; };
    for (std::int32_t ring = 0; ring < rings; ++ring) {
      for (std::int32_t k = 0; k < around; ++k) {
        const double angle = 2 * std::numbers::pi * k / around;
        const double radius = 1 + 0.02 * std::sin(7.0 * k) * std::cos(5.0 * ring);
        for (const double x : {radius * std::cos(angle), radius * std::sin(angle), 0.01 * ring}) {
          rest.push_back(static_cast<float>(x));
        }
        edges.insert(edges.end(), {at(ring, k), at(ring, k + 1)});
        if (ring + 1 == rings) continue;
        edges.insert(edges.end(), {at(ring, k), at(ring + 1, k)});
        corners.insert(corners.end(), {at(ring, k), at(ring, k + 1), at(ring + 1, k + 1), at(ring + 1, k)});
        offsets.push_back(static_cast<std::int32_t>(corners.size()));
      }
    }
    vertices = rings * around;
    const auto topology = std::make_shared<Topology>(vertices, edges, offsets, corners);
    for (std::int32_t v = 0; v < vertices; ++v) {
      weights.push_back(v / around % 100 < 20 ? 0.7f : 0.0f);
    }
    smooth.emplace(topology);
    corrective.emplace(topology, rest);
    partly.emplace(topology, rest, VertexGroup{weights});
    hook.emplace(vertices, std::nullopt, VertexGroup{std::vector<float>(vertices, 1.0f)});
    shape = rest;
    for (std::size_t i = 0; i < shape.size(); i += 3) shape[i] += 0.3f * std::sin(shape[i + 2]);
    make_keys();
    make_stencils(rings, around);
  }

  /// As many as Subdivision makes in one step: four for each vertex, each of the twelve around.
  void make_stencils(std::int32_t rings, std::int32_t around) {
    std::vector<std::int64_t> offsets{0};
    std::vector<std::int32_t> own;
    std::vector<float> shares;
    for (std::int32_t row = 0; row < kStencils * vertices; ++row) {
      const std::int32_t ring = row / kStencils / around, k = row / kStencils % around;
      for (std::int32_t i = 0; i < kEntries; ++i) {
        own.push_back(std::clamp(ring + i / 4 - 1, 0, rings - 1) * around + (k + i % 4) % around);
        shares.push_back(row % kStencils == 0 && i == 0 ? 0.34f : i == 0 ? 0.45f : i < 4 ? 0.1f : 0.05f);
      }
      offsets.push_back(std::ssize(own));
    }
    stencils.emplace(offsets, own, shares, vertices);
    made.resize(3 * static_cast<std::size_t>(kStencils * vertices));
  }

  void make_keys() {
    std::vector<std::vector<float>> shapes(kKeys + 1, rest);
    for (int k = 1; k <= kKeys; ++k) {
      const std::size_t first = static_cast<std::size_t>(vertices) * (k - 1) / kKeys * 19 / 20;
      for (std::size_t i = 3 * first; i < 3 * (first + vertices / 20); ++i) shapes[k][i] += 0.01f;
    }
    const std::vector<std::span<const float>> positions(shapes.begin(), shapes.end());
    keys.emplace(std::vector<std::shared_ptr<const Layer>>(),
                 std::make_shared<ShapeKeys>(positions, std::vector<std::int64_t>(kKeys + 1)));
  }

  std::int32_t vertices;
  std::vector<float> rest, shape, weights;
  std::optional<Smooth> smooth;
  std::optional<CorrectiveSmooth> corrective, partly;
  std::optional<Hook> hook;
  std::optional<Deformer> keys;
  std::optional<Stencils> stencils;
  mutable std::vector<float> made;
};

/// Numbers of 4 bytes that each of so many vertices needs, one time after the other.
struct Traffic {
  double read, written;
  int times = 1;
};

// Of a mesh of quads. Points have four numbers, a vertex four neighbours and four corners.
constexpr Traffic kIn{3 + 1, 4}, kOut{4 + 1, 3};      // by way of vertex numbers
constexpr Traffic kSteps{4 + 4 + 2, 4, kIterations};  // neighbours, points, weight, count
constexpr Traffic kCorners{4 + 4 * (2 + 3), 0};       // points, the corners' ends and losses

/// One row and its bound. share  of the vertices that move any bytes.
void add(const std::string& what, const Tube& tube, double share, int threads, int steps,
         const std::vector<Traffic>& traffic, std::function<void(std::span<float>)> run) {
  const std::string name =
      "|" + what + "|" + std::to_string(tube.vertices) + "|" + std::to_string(threads) + "|" + std::to_string(steps);
  const auto time = [=, &tube](benchmark::State& state) {
    set_thread_count(threads);
    std::vector<float> positions = tube.shape;
    run(positions);
    for (auto _ : state) run(positions);
    set_thread_count(0);
  };
  const auto bound = [=, &tube](benchmark::State& state) {
    std::vector<std::pair<std::vector<float>, std::vector<float>>> memory;
    for (const Traffic& one : traffic) {
      const auto count = [&](double numbers) { return static_cast<std::size_t>(numbers * share * tube.vertices); };
      memory.emplace_back(std::vector<float>(count(one.read), 0.1f), count(one.written));
    }
    for (auto _ : state) {
      for (std::size_t i = 0; i < traffic.size(); ++i) {
        for (int k = 0; k < traffic[i].times; ++k) {
          move_numbers(memory[i].first, memory[i].second, threads);
        }
      }
    }
  };
  benchmark::RegisterBenchmark(("chain" + name).c_str(), time)->UseRealTime();
  benchmark::RegisterBenchmark(("chain bound" + name).c_str(), bound)->UseRealTime();
}

void add_rows(const Tube& tube, int threads) {
  // Each frame is smoothed on top of the last: the bytes that move are the same.
  const auto corrective = [&](const char* what, const CorrectiveSmooth& stage, double share,
                              CorrectiveSmooth::Settings settings) {
    settings.iterations = kIterations;
    std::vector<Traffic> traffic{kIn, kSteps, kOut};
    if (!settings.only_smooth) traffic.push_back(kCorners);
    add(what, tube, share, threads, settings.only_smooth ? kIterations : 1, traffic,
        [&stage, settings](std::span<float> positions) { stage.apply(settings, positions); });
  };
  CorrectiveSmooth::Settings only{}, length{};
  only.only_smooth = true;
  length.type = SmoothType::length_weighted;
  corrective("Corrective Smooth, only smooth", *tube.corrective, 1, only);
  corrective("Corrective Smooth", *tube.corrective, 1, {});
  corrective("Corrective Smooth, length weighted", *tube.corrective, 1, length);
  corrective("Corrective Smooth, 20 % have weight", *tube.partly, 0.2, {});
  add("Smooth", tube, 1, threads, kIterations, {kIn, kSteps, kOut}, [&tube](std::span<float> positions) {
    tube.smooth->apply({0.5f, kIterations}, positions);
  });
  add("Hook, smooth falloff", tube, 1, threads, 1, {{3 + 2, 3}}, [&tube](std::span<float> positions) {
    Hook::Settings settings;
    settings.matrix(0, 3) = 1e-6f;
    settings.falloff = Falloff::smooth;
    settings.radius = 10;
    tube.hook->apply(settings, positions);
  });
  // Points are written with four numbers, and read again; a stencil is its entries, and where they and its weights begin.
  add("stencils, four of twelve", tube, 1, threads, 1, {{3, 4}, {4 + kStencils * (kEntries + 2.0), 3.0 * kStencils}},
      [&tube](std::span<float> positions) { tube.stencils->apply(positions, tube.made); });
  const std::vector<float> values(kKeys + 1, 0.5f);
  add("50 keys of 5 %", tube, 1, threads, 1, {{3 + 3 * kKeys / 20.0, 3}},
      [&tube, values](std::span<float> positions) { tube.keys->deform({}, positions, values); });
}

}  // namespace

void add_chain_rows(int cores) {
  static const Tube small(100), large(600);
  for (const Tube* tube : {&small, &large}) {
    for (const int threads : cores > 1 ? std::vector{1, cores} : std::vector{1}) {
      add_rows(*tube, threads);
    }
  }
}

}  // namespace sinew::bench
