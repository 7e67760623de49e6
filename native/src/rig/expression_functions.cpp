#include "rig/expression_functions.h"

#include <array>
#include <cmath>
#include <numbers>

namespace sinew::rig {
namespace {

constexpr double kHalfTurn = std::numbers::pi;

double limited(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

double smoothstep(const double* x) {
  const double t = limited((x[2] - x[0]) / (x[1] - x[0]), 0, 1);
  return t * t * (3.0 - 2.0 * t);
}

constexpr std::array kFunctions{
    ExpressionFunction{"radians", 1, [](const double* x) { return x[0] * kHalfTurn / 180.0; }},
    ExpressionFunction{"degrees", 1, [](const double* x) { return x[0] * 180.0 / kHalfTurn; }},
    ExpressionFunction{"abs", 1, [](const double* x) { return std::fabs(x[0]); }},
    ExpressionFunction{"fabs", 1, [](const double* x) { return std::fabs(x[0]); }},
    ExpressionFunction{"floor", 1, [](const double* x) { return std::floor(x[0]); }},
    ExpressionFunction{"ceil", 1, [](const double* x) { return std::ceil(x[0]); }},
    ExpressionFunction{"trunc", 1, [](const double* x) { return std::trunc(x[0]); }},
    ExpressionFunction{"round", 1, [](const double* x) { return std::round(x[0]); }},
    ExpressionFunction{"int", 1, [](const double* x) { return std::trunc(x[0]); }},
    ExpressionFunction{"sin", 1, [](const double* x) { return std::sin(x[0]); }},
    ExpressionFunction{"cos", 1, [](const double* x) { return std::cos(x[0]); }},
    ExpressionFunction{"tan", 1, [](const double* x) { return std::tan(x[0]); }},
    ExpressionFunction{"asin", 1, [](const double* x) { return std::asin(x[0]); }},
    ExpressionFunction{"acos", 1, [](const double* x) { return std::acos(x[0]); }},
    ExpressionFunction{"atan", 1, [](const double* x) { return std::atan(x[0]); }},
    ExpressionFunction{"atan2", 2, [](const double* x) { return std::atan2(x[0], x[1]); }},
    ExpressionFunction{"exp", 1, [](const double* x) { return std::exp(x[0]); }},
    ExpressionFunction{"log", 1, [](const double* x) { return std::log(x[0]); },
                       [](const double* x) { return x[0] == 0; }},
    ExpressionFunction{"log", 2, [](const double* x) { return std::log(x[0]) / std::log(x[1]); },
                       [](const double* x) { return x[0] == 0 || x[1] == 0 || x[1] == 1; }},
    ExpressionFunction{"sqrt", 1, [](const double* x) { return std::sqrt(x[0]); }},
    ExpressionFunction{"pow", 2, [](const double* x) { return std::pow(x[0], x[1]); },
                       [](const double* x) { return x[0] == 0 && x[1] < 0; }},
    ExpressionFunction{"fmod", 2, [](const double* x) { return std::fmod(x[0], x[1]); }},
    ExpressionFunction{"lerp", 3, [](const double* x) { return x[0] * (1.0 - x[2]) + x[1] * x[2]; }},
    ExpressionFunction{"clamp", 1, [](const double* x) { return limited(x[0], 0, 1); }},
    ExpressionFunction{"clamp", 3, [](const double* x) { return limited(x[0], x[1], x[2]); }},
    ExpressionFunction{"smoothstep", 3, smoothstep, [](const double* x) { return x[0] == x[1]; }},
};

}  // namespace

std::span<const ExpressionFunction> expression_functions() { return kFunctions; }

}  // namespace sinew::rig
