#include "baselines.h"

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>
#include <xmmintrin.h>

#include <map>

namespace sinew::bench {
namespace {

template <class Body>
void deal(int threads, std::ptrdiff_t count, const Body& body) {
  if (threads <= 1) return body(0, count);
  // More threads than cores, if that is what is asked for.
  static const oneapi::tbb::global_control allowed(oneapi::tbb::global_control::max_allowed_parallelism, 64);
  static std::map<int, oneapi::tbb::task_arena> arenas;
  arenas.try_emplace(threads, threads).first->second.execute([&] {
    oneapi::tbb::parallel_for(oneapi::tbb::blocked_range<std::ptrdiff_t>(0, count),
                              [&](const auto& range) { body(range.begin(), range.end()); });
  });
}

/// Reads one block's points and weights, 16 sums of them, and writes them three times.
void move_block(const float* points, const float* weights, std::size_t joints, bool stream, float* out) {
  __m128 sum[4] = {};
  for (std::size_t row = 0; row < 3 + joints; ++row) {
    const float* in = row < 3 ? points + kBlock * row : weights + kBlock * (row - 3);
    for (int i = 0; i < 4; ++i) sum[i] = _mm_add_ps(sum[i], _mm_load_ps(in + 4 * i));
  }
  for (int i = 0; i < 12; ++i) {
    stream ? _mm_stream_ps(out + 4 * i, sum[i % 4]) : _mm_storeu_ps(out + 4 * i, sum[i % 4]);
  }
}

}  // namespace

void report_skin(const Character& character, std::ptrdiff_t frame, Eigen::MatrixXd& positions, int threads) {
  const std::ptrdiff_t joints = character.skin.joint_count();
  const Matrix4<double>* transforms = character.transforms.data() + frame * joints;
  deal(threads, character.rest.rows(), [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
    for (std::ptrdiff_t v = begin; v < end; ++v) {
      const Eigen::Vector4d rest = character.rest.row(v).transpose().homogeneous();
      Eigen::Vector4d sum = Eigen::Vector4d::Zero();
      for (std::ptrdiff_t j = 0; j < joints; ++j) {
        sum += character.dense_weights(v, j) * (transforms[j] * (character.inverse_rest[j] * rest));
      }
      positions.row(v) = sum.head<3>().transpose();
    }
  });
}

void move_bytes(const BlockedSkin& skin, bool stream, int threads, float* positions) {
  const auto vertices = static_cast<std::ptrdiff_t>(skin.vertex_count());
  deal(threads, static_cast<std::ptrdiff_t>(skin.blocks.size()), [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
    for (std::ptrdiff_t b = begin; b < end; ++b) {
      const Block& block = skin.blocks[b];
      const JointSet set = skin.sets[block.joint_set];
      if ((b + 1) * kBlock > vertices) continue;
      move_block(skin.points.get() + b * kBlockFloats, skin.packed_weights.get() + block.weights,
                 set.is_rigid ? 0 : set.count, stream, positions + b * kBlockFloats);
    }
  });
  if (stream) _mm_sfence();
}

void move_numbers(std::span<const float> in, std::span<float> out, int threads) {
  constexpr std::ptrdiff_t kPieces = 256;
  const std::ptrdiff_t read = std::ssize(in) / kPieces & ~15, written = std::ssize(out) / kPieces & ~15;
  deal(threads, kPieces, [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
    for (std::ptrdiff_t piece = begin; piece < end; ++piece) {
      __m128 sum[4] = {};
      const float* const first = in.data() + piece * read;
      for (const float* number = first; number < first + read; number += 16) {
        for (int i = 0; i < 4; ++i) sum[i] = _mm_add_ps(sum[i], _mm_loadu_ps(number + 4 * i));
      }
      float* const to = out.data() + piece * written;
      for (std::ptrdiff_t i = 0; i < written; i += 4) _mm_storeu_ps(to + i, sum[i / 4 % 4]);
    }
  });
}

}  // namespace sinew::bench
