#include <algorithm>

#include "rig/build.h"

namespace sinew::rig {
namespace {

/// Whole numbers. Where a curve reaches its ends, the first and the last one are repeated; a closed one that does so
/// consists of Bezier curves, between which knots are repeated, too.
std::vector<float> knots_of(const SplineDescription& given, int points) {
  const int order = given.order;
  const bool is_circle = given.is_closed && given.reaches_ends;
  const int count = points + order + (given.is_closed ? order - 1 : 0);
  const int copied = given.is_closed ? 2 * order - 1 : given.reaches_ends ? order : 0;  // at the end
  const int repeats = is_circle ? order - 1 : 1;
  int left = given.reaches_ends && !given.is_closed ? order : repeats;
  float knot = 0;
  std::vector<float> knots;
  if (is_circle) knots.push_back(knot++);
  while (static_cast<int>(knots.size()) < count - copied) {
    knots.push_back(knot);
    if (--left > 0) continue;
    left = repeats;
    ++knot;
  }
  for (int i = 0; i < copied; ++i) knots.push_back(knot + (knots[i] - knots[0]));
  return knots;
}

/// What each point has of the curve at a time, by the recursion of Cox and de Boor.
std::vector<float> basis_at(float time, int order, const std::vector<float>& knots) {
  const int pieces = static_cast<int>(knots.size()) - 1;
  time = clamped(time, knots.front(), knots.back());
  std::vector<float> basis(knots.size());
  int piece = 0;
  while (piece < pieces && !(knots[piece] != knots[piece + 1] && time >= knots[piece] && time <= knots[piece + 1])) {
    ++piece;
  }
  if (piece == pieces) return basis;
  basis[piece] = 1;
  int last = piece;
  for (int degree = 2; degree <= order; ++degree) {
    if (last + degree > pieces) last = pieces - degree;
    for (int i = std::max(piece - order - 1, 0); i <= last; ++i) {
      float before = 0;
      float after = 0;
      if (basis[i] != 0) before = ((time - knots[i]) * basis[i]) / (knots[i + degree - 1] - knots[i]);
      if (basis[i + 1] != 0) after = ((knots[i + degree] - time) * basis[i + 1]) / (knots[i + degree] - knots[i + 1]);
      basis[i] = before + after;
    }
  }
  for (int i = last + 1; i < static_cast<int>(basis.size()); ++i) basis[i] = 0;
  return basis;
}

}  // namespace

std::vector<NurbsPlace> nurbs_places(const SplineDescription& given) {
  const int points = static_cast<int>(given.points.size());
  const std::vector<float> knots = knots_of(given, points);
  const int count = given.resolution * (given.is_closed ? points : points - 1);
  const float start = knots[given.order - 1];
  const float end = knots[given.is_closed ? points + given.order - 1 : points];
  const float step = (end - start) / static_cast<float>(count - (given.is_closed ? 0 : 1));
  float time = start;
  std::vector<NurbsPlace> places;
  for (int number = 0; number < count; ++number, time += step) {
    const std::vector<float> basis = basis_at(time, given.order, knots);
    const auto counts = [](float share) { return share > 0; };
    const auto first = std::ranges::find_if(basis, counts);
    const auto last = std::find_if(basis.rbegin(), basis.rend(), counts).base();
    NurbsPlace& place = places.emplace_back();
    if (first == basis.end()) continue;
    place.first = static_cast<int>(first - basis.begin());
    float sum = 0;
    for (auto each = first; each != last; ++each) {
      const int point = static_cast<int>(each - basis.begin()) % points;
      place.shares.push_back(*each * (given.weights.empty() ? 1.0F : given.weights[point]));
      sum += place.shares.back();
    }
    constexpr float kRounding = 1e-6F;
    if (sum != 0 && (sum < 1.0F - kRounding || sum > 1.0F + kRounding)) {
      for (float& share : place.shares) share /= sum;
    }
  }
  return places;
}

}  // namespace sinew::rig
