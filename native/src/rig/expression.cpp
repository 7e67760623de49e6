#include "rig/expression.h"

#include <algorithm>
#include <cmath>

#include "rig/expression_functions.h"
#include "rig/expression_parser.h"

namespace sinew::rig {
namespace {

bool holds(Expression::Comparison comparison, double a, double b) {
  switch (comparison) {
    case Expression::Comparison::equal:
      return a == b;
    case Expression::Comparison::unequal:
      return a != b;
    case Expression::Comparison::less:
      return a < b;
    case Expression::Comparison::less_or_equal:
      return a <= b;
    case Expression::Comparison::greater:
      return a > b;
    default:
      return a >= b;
  }
}

}  // namespace

Expression::Expression(std::string_view text, std::span<const std::string> names)
    : steps_(parsed_expression(text, names)) {}

bool Expression::reads_frame() const { return std::ranges::find(steps_, Code::frame, &Step::code) != steps_.end(); }

Expression::Result Expression::value(std::span<const float> variables, double frame) const {
  double stack[1 + kExpressionDepth];  // the first is below what counts
  double* top = stack;
  bool is_undefined = false;
  const std::span functions = expression_functions();
  for (std::size_t i = 0; i < steps_.size(); ++i) {
    const Step& step = steps_[i];
    switch (step.code) {
      case Code::constant:
        *++top = step.number;
        break;
      case Code::variable:
        *++top = variables[step.operand];
        break;
      case Code::frame:
        *++top = frame;
        break;
      case Code::negate:
        *top = -*top;
        break;
      case Code::invert:
        *top = *top == 0;
        break;
      case Code::add:
        --top;
        *top += top[1];
        break;
      case Code::subtract:
        --top;
        *top -= top[1];
        break;
      case Code::multiply:
        --top;
        *top *= top[1];
        break;
      case Code::divide:
        --top;
        is_undefined |= top[1] == 0;
        *top /= top[1];
        break;
      case Code::compare:
        --top;
        *top = holds(step.comparison, top[0], top[1]);
        break;
      case Code::compare_chained:
        --top;
        if (holds(step.comparison, top[0], top[1])) {
          *top = top[1];
        } else {
          *top = 0;
          i = step.operand - std::size_t{1};
        }
        break;
      case Code::function: {
        const ExpressionFunction& function = functions[step.operand];
        top -= function.arguments - 1;
        is_undefined |= function.is_pole != nullptr && function.is_pole(top);
        *top = function.call(top);
        break;
      }
      case Code::lowest:
        for (int k = 1; k < step.operand; ++k, --top) {
          if (top[-1] > *top) top[-1] = *top;
        }
        break;
      case Code::highest:
        for (int k = 1; k < step.operand; ++k, --top) {
          if (top[-1] < *top) top[-1] = *top;
        }
        break;
      case Code::jump:
        i = step.operand - std::size_t{1};
        break;
      case Code::jump_if_false:
        if (*top-- == 0) i = step.operand - std::size_t{1};
        break;
      case Code::jump_if_true_keeping:
        if (*top != 0) {
          i = step.operand - std::size_t{1};
        } else {
          --top;
        }
        break;
      case Code::jump_if_false_keeping:
        if (*top == 0) {
          i = step.operand - std::size_t{1};
        } else {
          --top;
        }
        break;
    }
    is_undefined |= top > stack && std::isnan(*top);
  }
  return {*top, is_undefined};
}

}  // namespace sinew::rig
