/// Maps the names of methods and other options in Python to enumerators.
#pragma once

#include <string>
#include <utility>

#include "sinew/corrective_smooth.h"
#include "sinew/hook.h"
#include "sinew/lattice.h"
#include "sinew/skinning_method.h"

namespace sinew::bindings {

inline Stretch stretch_named(const std::string& name) {
  if (name == "polar") return Stretch::polar;
  if (name == "frame") return Stretch::frame;
  if (name == "frame_each") return Stretch::frame_each;
  throw InputError("there is no stretch \"" + name + "\"; expected polar, frame or frame_each");
}

inline SkinningMethod method_named(const std::string& name) {
  std::string known;
  for (const SkinningMethod method : kSkinningMethods) {
    if (name == name_of(method)) return method;
    known += (known.empty() ? "" : ", ") + std::string(name_of(method));
  }
  throw InputError("there is no method \"" + name + "\"; expected one of " + known);
}

inline SmoothType smooth_type_named(const std::string& name) {
  if (name == "simple") return SmoothType::simple;
  if (name == "length_weighted") return SmoothType::length_weighted;
  throw InputError("there is no smooth_type \"" + name + "\"; expected simple or length_weighted");
}

inline CornerAngle corner_angle_named(const std::string& name) {
  if (name == "polynomial") return CornerAngle::polynomial;
  if (name == "arc_cosine") return CornerAngle::arc_cosine;
  throw InputError("there is no corner_angle \"" + name + "\"; expected polynomial or arc_cosine");
}

inline Falloff falloff_named(const std::string& name) {
  constexpr std::pair<const char*, Falloff> falloffs[] = {
      {"none", Falloff::none},     {"constant", Falloff::constant},
      {"linear", Falloff::linear}, {"smooth", Falloff::smooth},
      {"sharp", Falloff::sharp},   {"root", Falloff::root},
      {"sphere", Falloff::sphere}, {"inverse_square", Falloff::inverse_square}};
  std::string known;
  for (const auto& [own, falloff] : falloffs) {
    if (name == own) return falloff;
    known += (known.empty() ? "" : ", ") + std::string(own);
  }
  throw InputError("there is no falloff \"" + name + "\"; expected one of " + known);
}

inline Spline spline_named(const std::string& name) {
  if (name == "linear") return Spline::linear;
  if (name == "cardinal") return Spline::cardinal;
  if (name == "catmull_rom") return Spline::catmull_rom;
  if (name == "bspline") return Spline::b_spline;
  throw InputError("there is no interpolation \"" + name + "\"; expected linear, cardinal, catmull_rom or bspline");
}

}  // namespace sinew::bindings
