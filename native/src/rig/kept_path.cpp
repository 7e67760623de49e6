#include "rig/kept_path.h"

#include <cstring>

namespace sinew::rig {
namespace {

/// Whether these are the same to the bit, as zeros of two signs are not. kept: empty, or as many.
template <typename T>
bool is_kept(const std::vector<T>& kept, const std::vector<T>& now) {
  return !kept.empty() && std::memcmp(kept.data(), now.data(), now.size() * sizeof(T)) == 0;
}

/// Adds how far each key is from what it is relative to.
void add_keys(const Spline& spline, State& state) {
  for (const ShapeOfSpline& key : spline.keys) {
    const float share = state.values[key.value];
    if (share == 0) continue;
    const float* radii = state.values.data() + spline.radii;
    for (std::size_t i = 0; i < spline.points.size(); ++i) {
      const auto base = [&](int number) {
        if (key.relative >= 0) return spline.keys[key.relative].points[i][number];
        return number == 9 ? radii[i] : spline.points[i][number / 3][number % 3];
      };
      for (int k = 0; k < 9; ++k) state.spline_points[i][k / 3][k % 3] -= share * (base(k) - key.points[i][k]);
      state.spline_radii[i] -= share * (base(9) - key.points[i][9]);
    }
  }
}

/// Writes where the points of a spline are in this frame, and their radii.
void move_points(State& state, const Spline& spline) {
  state.spline_points.assign(spline.points.begin(), spline.points.end());
  const float* radii = state.values.data() + spline.radii;
  state.spline_radii.assign(radii, radii + spline.points.size());
  add_keys(spline, state);
  if (!spline.hooks.empty()) {
    const Mat4 inverse_world = inverse(state.outside[spline.matrix]);
    for (const SplineHook& hook : spline.hooks) {
      const RigTarget& target = hook.target;
      const Mat4 place = target.type == RigTarget::Type::bone      ? state.world * state.poses[target.index]
                         : target.type == RigTarget::Type::outside ? state.outside[target.index]
                                                                   : state.world;
      move_by_hook(hook, inverse_world * place * matrix_of(std::span<const float, 16>(hook.inverse)),
                   state.spline_points);
    }
  }
  if (!spline.hooks.empty() || spline.has_keys) place_handles(spline, state.spline_points);
}

}  // namespace

SplinePath& path_of(const Program& program, State& state, int number) {
  KeptPath& kept = state.paths[number];
  if (kept.pass == state.pass) return kept.path;
  kept.pass = state.pass;
  const Spline& spline = program.splines[number];
  move_points(state, spline);
  if (is_kept(kept.points, state.spline_points) && is_kept(kept.radii, state.spline_radii)) return kept.path;
  kept.points.assign(state.spline_points.begin(), state.spline_points.end());
  kept.radii.assign(state.spline_radii.begin(), state.spline_radii.end());
  kept.path.build(spline, kept.points, kept.radii.data());
  return kept.path;
}

const SplinePath& turned_path_of(const Program& program, State& state, int spline) {
  SplinePath& path = path_of(program, state, spline);
  if (!path.is_turned()) path.turn(program.splines[spline]);
  return path;
}

}  // namespace sinew::rig
