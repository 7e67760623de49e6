#include "sinew/corrective_smooth.h"

#include <cmath>
#include <mutex>

#include "base/vertex_numbers.h"
#include "smoothing/smoothing.h"
#include "smoothing/smoothing_kernels.h"

namespace sinew {
namespace {

// The approximate cost of a vertex on one thread: to copy in and out, per iteration of either type, and
// to correct.
constexpr double kMicroseconds = 3.5e-3, kMicrosecondsSimple = 1e-3, kMicrosecondsLength = 1.3e-3,
                 kMicrosecondsCorners = 8e-3;

// For how many settings losses are remembered: those of the viewport and of a render may differ.
constexpr std::size_t kRemembered = 2;

std::vector<float> pinned_weights(const Topology& topology, const VertexGroup& group, bool pin) {
  std::vector<float> weights = weights_of(group, topology.vertex_count());
  for (std::size_t v = 0; pin && v < weights.size(); ++v) {
    if (topology.is_boundary(v)) weights[v] = 0;
  }
  return weights;
}

/// What the rest shape loses to smoothing with certain settings.
struct Losses {
  float factor = 0;
  int iterations = 0;
  SmoothType type{};
  Aligned<float> numbers;
  int readers = 0;

  bool are_of(const CorrectiveSmooth::Settings& settings) const {
    return factor == settings.factor && iterations == settings.iterations && type == settings.type;
  }
};

}  // namespace

class CorrectiveSmooth::Body {
 public:
  Body(const Topology& topology, const VertexGroup& group, bool pin_boundary, CornerAngle angle)
      : vertex_count(topology.vertex_count()),
        around_(topology, pinned_weights(topology, group, pin_boundary)),
        angle_(angle) {
    remembered_.reserve(kRemembered);
  }

  bool has_rest() const { return rest_ != nullptr; }

  void set_rest(std::span<const float> positions) {
    check_position_count("rest_positions", positions, vertex_count);
    for (std::size_t i = 0; i < positions.size(); ++i) {
      if (!std::isfinite(positions[i])) fail("rest_positions is not finite at vertex ", i / 3);
    }
    rest_ = aligned<float>(4 * around_.point_count());
    around_.gather(positions.data(), 0, around_.point_count(), rest_.get());
    remembered_.clear();
  }

  void apply(const Settings& settings, std::span<float> positions) {
    if (microseconds(settings) == 0) return;
    const Reading losses(*this, settings.only_smooth ? nullptr : borrow_losses(settings));
    Smoothing smoothing(around_, microseconds(settings), spaces_);
    smoothing.load(positions.data());
    iterate(settings, smoothing);
    if (settings.only_smooth) return smoothing.store(positions.data());
    smoothing.each_piece([&](std::size_t begin, std::size_t end) {
      float* const corrected = smoothing.other_points();
      restore_losses(around_, begin, end, smoothing.points(), losses->numbers.get(), settings.scale, angle_, corrected);
      around_.scatter(corrected, begin, end, positions.data());
    });
  }

  const std::ptrdiff_t vertex_count;

  /// Of apply(); 0 if it does nothing.
  double microseconds(const Settings& settings) const {
    if (settings.iterations <= 0 || settings.factor == 0) return 0;
    const double step = settings.type == SmoothType::simple ? kMicrosecondsSimple : kMicrosecondsLength;
    return static_cast<double>(around_.worked_on) *
           (kMicroseconds + step * settings.iterations + (settings.only_smooth ? 0 : kMicrosecondsCorners));
  }

 private:
  /// Counts as a reader during its lifetime. own  already counts it, or is null.
  class Reading {
   public:
    Reading(Body& body, Losses* own) : body_(body), own_(own) {}
    Reading(const Reading&) = delete;
    ~Reading() {
      const std::lock_guard lock(body_.mutex_);
      if (own_) --own_->readers;
    }
    const Losses* operator->() const { return own_; }

   private:
    Body& body_;
    Losses* own_;
  };

  void iterate(const Settings& settings, Smoothing& smoothing) const {
    const auto step = settings.type == SmoothType::simple ? simple_step : length_step;
    smoothing.iterate(settings.iterations, [&](std::size_t begin, std::size_t end, const float* from, float* to) {
      step(around_, begin, end, settings.factor, from, to);
    });
  }

  /// Returns the losses for these settings, with one more reader.
  Losses* borrow_losses(const Settings& settings) {
    std::unique_ptr<Losses> made;
    {
      const std::lock_guard lock(mutex_);
      for (const auto& known : remembered_) {
        if (!known->are_of(settings)) continue;
        ++known->readers;
        return known.get();
      }
      // Reuses the oldest one that nobody reads.
      const auto idle = std::ranges::find(remembered_, 0, [](const auto& known) { return known->readers; });
      if (remembered_.size() >= kRemembered && idle != remembered_.end()) {
        made = std::move(*idle);
        remembered_.erase(idle);
      }
    }
    if (!made) {
      made = std::make_unique<Losses>();
      made->numbers = aligned<float>(3 * kBlock * around_.corner_begin.back());
    }
    measure(settings, *made);
    const std::lock_guard lock(mutex_);
    return remembered_.emplace_back(std::move(made)).get();
  }

  void measure(const Settings& settings, Losses& losses) {
    Smoothing smoothing(around_, microseconds(settings), spaces_);
    smoothing.load_points(rest_.get());
    iterate(settings, smoothing);
    smoothing.each_piece([&](std::size_t begin, std::size_t end) {
      measure_losses(around_, begin, end, rest_.get(), smoothing.points(), losses.numbers.get());
    });
    losses.factor = settings.factor;
    losses.iterations = settings.iterations;
    losses.type = settings.type;
    losses.readers = 1;
  }

  const Neighbourhood around_;
  const CornerAngle angle_;
  Aligned<float> rest_;  // the neighbourhood's points, or null
  Kept<SmoothingSpace> spaces_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<Losses>> remembered_;  // guarded by mutex_
};

CorrectiveSmooth::CorrectiveSmooth(std::shared_ptr<const Topology> topology, std::span<const float> rest_positions,
                                   const VertexGroup& group, bool pin_boundary, CornerAngle angle)
    : body_(std::make_unique<Body>(*topology, group, pin_boundary, angle)) {
  if (!rest_positions.empty() || vertex_count() == 0) set_rest_positions(rest_positions);
}

CorrectiveSmooth::CorrectiveSmooth(CorrectiveSmooth&&) noexcept = default;
CorrectiveSmooth::~CorrectiveSmooth() = default;

std::ptrdiff_t CorrectiveSmooth::vertex_count() const { return body_->vertex_count; }

void CorrectiveSmooth::set_rest_positions(std::span<const float> positions) { body_->set_rest(positions); }

void CorrectiveSmooth::check(const Settings& settings) const {
  check_setting("factor", settings.factor);
  check_setting("scale", settings.scale);
  if (!settings.only_smooth && !body_->has_rest()) {
    fail("there are no rest positions; pass some, or only_smooth");
  }
}

double CorrectiveSmooth::microseconds(const Settings& settings) const { return body_->microseconds(settings); }

void CorrectiveSmooth::apply(const Settings& settings, std::span<float> positions) const {
  check_position_count("positions", positions, vertex_count());
  check(settings);
  body_->apply(settings, positions);
}

}  // namespace sinew
