#include "sinew/driver_expression.h"

#include "rig/expression.h"

namespace sinew {

DriverExpression::DriverExpression(std::string_view text, std::span<const std::string> names)
    : expression_(std::make_shared<const rig::Expression>(text, names)) {}

bool DriverExpression::reads_frame() const { return expression_->reads_frame(); }

std::optional<double> DriverExpression::value(std::span<const float> variables, double frame) const {
  const rig::Expression::Result result = expression_->value(variables, frame);
  return result.is_undefined ? std::nullopt : std::optional(result.number);
}

}  // namespace sinew
