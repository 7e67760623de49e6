/// The expression of a scripted driver, in the part of Python that Blender computes itself.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace sinew {

namespace rig {
class Expression;
}

/// Immutable: any number of threads may use it at the same time.
class DriverExpression {
 public:
  /// names  of the variables, of which the last counts if several have one name
  /// Throws InputError for what is not one of Blender's simple expressions, with the place.
  DriverExpression(std::string_view text, std::span<const std::string> names);

  /// Whether it depends on the frame, other than by a variable of that name.
  bool reads_frame() const;

  /// variables  in the order of their names. Returns nothing if something is divided by 0 or has no value, such as the
  ///            root of -1: Blender then switches the driver off.
  std::optional<double> value(std::span<const float> variables, double frame) const;

 private:
  std::shared_ptr<const rig::Expression> expression_;
};

}  // namespace sinew
