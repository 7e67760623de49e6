/// Turns the text of an expression into steps.
#pragma once

#include "rig/expression.h"

namespace sinew::rig {

/// No expression needs more numbers on the stack: deeper ones are refused.
constexpr int kExpressionDepth = 64;

/// names  see Expression. Throws InputError.
std::vector<Expression::Step> parsed_expression(std::string_view text, std::span<const std::string> names);

}  // namespace sinew::rig
