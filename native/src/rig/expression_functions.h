/// The functions that expressions of drivers may call.
#pragma once

#include <span>
#include <string_view>

namespace sinew::rig {

struct ExpressionFunction {
  std::string_view name;
  int arguments;
  double (*call)(const double* arguments);
  bool (*is_pole)(const double* arguments) = nullptr;  ///< whether the value would be infinite, if that can be
};

/// Functions of one name differ in the number of their arguments. min and max are not among them.
std::span<const ExpressionFunction> expression_functions();

}  // namespace sinew::rig
