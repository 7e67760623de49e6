/// Scripted drivers, in the part of Python that Blender computes itself ("simple expressions").
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace sinew::rig {

/// A driver's expression as a small program for a stack. Immutable.
class Expression {
 public:
  struct Result {
    double number = 0;
    /// Whether something was divided by 0 or has no value, such as the logarithm of -1. Blender then switches the driver
    /// off for good.
    bool is_undefined = false;
  };

  Expression() = default;

  /// names  of the variables; of several with one name the last counts, and `frame` is the time unless one has its name.
  /// Throws InputError for what is not a simple expression, with the place.
  Expression(std::string_view text, std::span<const std::string> names);

  /// Whether it depends on the frame, other than by a variable of that name.
  bool reads_frame() const;

  /// variables  in the order of their names.
  Result value(std::span<const float> variables, double frame) const;

  // What a step does with the numbers at the top of the stack. Jumps keep the tested number if they jump.
  enum class Code : std::uint8_t {
    constant,
    variable,
    frame,
    negate,
    invert,
    add,
    subtract,
    multiply,
    divide,
    compare,
    compare_chained,
    function,
    lowest,
    highest,
    jump,
    jump_if_false,
    jump_if_true_keeping,
    jump_if_false_keeping,
  };
  enum class Comparison : std::uint8_t { equal, unequal, less, less_or_equal, greater, greater_or_equal };
  struct Step {
    Code code;
    Comparison comparison = Comparison::equal;
    std::uint16_t operand = 0;  ///< variable, function, number of arguments, or the step to jump to
    double number = 0;
  };

 private:
  std::vector<Step> steps_;
};

}  // namespace sinew::rig
