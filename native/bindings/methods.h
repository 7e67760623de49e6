/// The names of methods and stretches in Python.
#pragma once

#include <string>

#include "sinew/skinning_method.h"

namespace sinew::bindings {

inline Stretch stretch_named(const std::string& name) {
  if (name == "polar") return Stretch::polar;
  if (name == "frame") return Stretch::frame;
  if (name == "frame_each") return Stretch::frame_each;
  throw InputError("there is no stretch \"" + name + "\"; expected polar, frame or frame_each");
}

inline SkinningMethod method_named(const std::string& name) {
  if (name == "linear") return SkinningMethod::linear;
  if (name == "dual_quaternion") return SkinningMethod::dual_quaternion;
  throw InputError("there is no method \"" + name + "\"; expected linear or dual_quaternion");
}

}  // namespace sinew::bindings
