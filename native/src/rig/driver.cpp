#include "rig/driver.h"

#include <cmath>
#include <utility>

#include "rig/rotation_channels.h"

namespace sinew::rig {

Driver::Driver(const DriverDescription& data) : type_(data.type) {
  FCurve curve(data.curve);
  if (!curve.is_empty()) curve_ = std::make_shared<const FCurve>(std::move(curve));
  if (type_ != DriverType::scripted) return;
  std::vector<std::string> names;
  for (const VariableDescription& variable : data.variables) names.push_back(variable.name);
  expression_ = Expression(data.expression, names);
}

Driver::Result Driver::combined(std::span<const float> variables, float time) const {
  float value = 0;
  switch (type_) {
    case DriverType::scripted: {
      const Expression::Result result = expression_.value(variables, time);
      if (std::isfinite(result.number)) value = static_cast<float>(result.number);
      return {value, result.is_undefined};
    }
    case DriverType::average:
    case DriverType::sum:
      if (variables.size() == 1) return {variables[0], false};
      for (const float variable : variables) value += variable;
      if (type_ == DriverType::average) value = variables.empty() ? 0 : value / static_cast<float>(variables.size());
      return {value, false};
    default: {
      if (!variables.empty()) value = variables[0];
      for (const float variable : variables) {
        if (type_ == DriverType::maximum ? variable > value : variable < value) value = variable;
      }
      return {value, false};
    }
  }
}

Driver::Result Driver::value(std::span<const float> variables, float time) const {
  Result result = combined(variables, time);
  if (curve_) result.value = curve_->value(result.value, curve_->has_keys() ? 0 : result.value);
  return result;
}

float transform_channel(const Mat4& m, const ReadTransform& read, EulerOrder order, const Vec3* own_euler) {
  const int channel = static_cast<int>(read.channel);
  if (read.channel <= TransformChannel::location_z) return m[3][channel];
  if (read.channel == TransformChannel::scale_average) return std::cbrt(determinant(upper(m)));
  if (read.channel != TransformChannel::rotation_w && read.channel >= TransformChannel::scale_x) {
    return length(m.axis(channel - static_cast<int>(TransformChannel::scale_x)));
  }
  const int number =
      read.channel == TransformChannel::rotation_w ? 0 : 1 + channel - static_cast<int>(TransformChannel::rotation_x);
  const Quat found = rotation_channel(m, read.rotation, order, number);
  if (own_euler == nullptr || read.rotation != ChannelRotation::automatic || number == 0) return found[number];
  return made_compatible({found[1], found[2], found[3]}, *own_euler)[number - 1];
}

float rotation_difference(const Mat4& a, const Mat4& b) {
  Quat inverse = quaternion_of(a);
  for (int i = 1; i < 4; ++i) inverse[i] = -inverse[i];
  const float angle = std::fabs(2.0F * safe_acos((inverse * quaternion_of(b))[0]));
  return angle > kPi ? 2.0F * kPi - angle : angle;
}

}  // namespace sinew::rig
