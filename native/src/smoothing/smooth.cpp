#include "sinew/smooth.h"

#include "base/vertex_numbers.h"
#include "smoothing/smoothing.h"
#include "smoothing/smoothing_kernels.h"

namespace sinew {
namespace {

// The approximate cost of a vertex on one thread: to copy in and out, and per iteration.
constexpr double kMicrosecondsToCopy = 3.5e-3, kMicrosecondsStep = 1e-3;

std::vector<float> positive_weights(const VertexGroup& group, std::ptrdiff_t vertices) {
  std::vector<float> weights = weights_of(group, vertices);
  for (float& weight : weights) weight = std::max(weight, 0.0f);
  return weights;
}

}  // namespace

class Smooth::Body {
 public:
  Body(const Topology& topology, const VertexGroup& group)
      : vertex_count(topology.vertex_count()), around(topology, positive_weights(group, vertex_count)) {}

  std::ptrdiff_t vertex_count;
  Neighbourhood around;
  mutable Kept<SmoothingSpace> spaces;
};

Smooth::Smooth(std::shared_ptr<const Topology> topology, const VertexGroup& group)
    : body_(std::make_unique<const Body>(*topology, group)) {}

Smooth::Smooth(Smooth&&) noexcept = default;
Smooth::~Smooth() = default;

std::ptrdiff_t Smooth::vertex_count() const { return body_->vertex_count; }

void Smooth::check(const Settings& settings) const { check_setting("factor", settings.factor); }

double Smooth::microseconds(const Settings& settings) const {
  const bool moves = settings.x || settings.y || settings.z;
  if (settings.iterations <= 0 || settings.factor == 0 || !moves) return 0;
  return static_cast<double>(body_->around.worked_on) * (kMicrosecondsToCopy + kMicrosecondsStep * settings.iterations);
}

void Smooth::apply(const Settings& settings, std::span<float> positions) const {
  check_position_count("positions", positions, vertex_count());
  check(settings);
  const double microseconds = this->microseconds(settings);
  if (microseconds == 0) return;
  const Neighbourhood& around = body_->around;
  Smoothing smoothing(around, microseconds, body_->spaces);
  smoothing.load(positions.data());
  smoothing.iterate(settings.iterations, [&](std::size_t begin, std::size_t end, const float* from, float* to) {
    mean_step(around, begin, end, settings, from, to);
  });
  smoothing.store(positions.data());
}

}  // namespace sinew
