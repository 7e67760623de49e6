/// Rigs with arbitrary bones, constraints, drivers and curves. Whatever is accepted is computed, again with the same bits.
#include <array>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "../native/rig_descriptions.h"
#include "bytes.h"
#include "files.h"
#include "sinew/rig_program.h"
#include "sinew/threads.h"

using namespace sinew;

namespace {

constexpr std::array kExpressions = {"a + b / 2", "1 if a > b else frame", "clamp(a, 0, b)", "sqrt(a) ** 2", "a / b"};

class Maker {
 public:
  explicit Maker(Bytes& bytes) : bytes_(bytes), raw_(byte() & 1) {}

  RigDescription rig() {
    RigDescription rig;
    rig.blender = byte() & 1 ? 502 : 403;
    const int bones = 1 + byte() % 6;
    if (byte() & 1) {
      for (float& number : rig.world) number = this->number();
    }
    if (byte() & 1) rig.matrices.push_back({"outside", rig.world});
    for (int i = byte() % 3; i > 0; --i) object(rig);
    for (int i = 0; i < bones; ++i) bone(rig);
    for (int i = byte() % 2; i > 0; --i) spline(rig);
    for (int i = byte() % 6, bone = 0; i > 0; --i) {
      bone = std::min(bone + byte() % 3, raw_ ? bone + 2 : bones - 1);
      constraint(rig, bone);
    }
    if (byte() & 1)
      rig.properties.push_back({"[\"p\"]", 1, static_cast<ValueKind>(byte() % 4), number(), number(), {number()}});
    for (int i = byte() % 3; i > 0; --i) rig.curves.push_back({{path(rig), byte() % most_index()}, curve()});
    if (byte() & 1) nla(rig);
    for (int i = byte() % 4; i > 0; --i) driver(rig);
    return rig;
  }

 private:
  std::uint8_t byte() { return bytes_.take<std::uint8_t>(); }
  float number() { return raw_ ? bytes_.take<float>() : static_cast<float>(bytes_.take<std::int8_t>()) / 16; }
  int most_index() { return raw_ ? 4 : 1; }
  int place(std::size_t count) { return raw_ ? bytes_.take<std::int8_t>() : byte() % static_cast<int>(count); }

  void bone(RigDescription& rig) {
    const int parent = rig.bones.empty() ? -1 : byte() % static_cast<int>(rig.bones.size() + 1) - 1;
    add_bone(rig, "b" + std::to_string(rig.bones.size()), parent, {number(), number(), number()});
    BoneDescription& bone = rig.bones.back();
    const std::uint8_t flags = byte();
    bone.rotation_mode = static_cast<RotationMode>(byte() % 8 - 1);
    bone.inherit_scale = static_cast<InheritScale>(byte() % 6);
    bone.inherits_rotation = flags & 1;
    bone.uses_local_location = flags & 2;
    bone.is_connected = flags & 4;
    bone.has_constraints = flags & 8;
    if (flags & 16) {
      bone.segments = raw_ ? bytes_.take<std::int8_t>() : 1 + byte() % 32;
      for (int& handle : bone.handles) handle = place(rig.bones.size());
      for (HandleType& type : bone.handle_types) type = static_cast<HandleType>(byte() % 4);
      bone.connected_child = place(rig.bones.size());
      bone.maps_curved = flags & 32;
    }
    if (flags & 64) bone.length = number();
    for (int i = byte() % 8; i > 0; --i) bone.values[byte() % bone.values.size()] = number();
  }

  void object(RigDescription& rig) {
    rig.matrices.push_back({"o" + std::to_string(rig.objects.size()), rig.world});
    ObjectDescription made{rig.matrices.back().name, static_cast<int>(rig.matrices.size()) - 1,
                           place(rig.matrices.size()) - 1};
    if (raw_) made.matrix = place(rig.matrices.size());
    made.rotation_mode = static_cast<RotationMode>(byte() % 8 - 1);
    for (int i = byte() % 8; i > 0; --i) made.values[byte() % made.values.size()] = number();
    if (byte() & 1) made.parent_inverse[byte() % made.parent_inverse.size()] = number();
    for (int* own : {&made.local, &made.basis}) {
      if (byte() & 1) continue;
      *own = static_cast<int>(rig.matrices.size());
      rig.matrices.push_back({made.name + std::to_string(*own), rig.world});
      if (raw_) *own = place(rig.matrices.size());
    }
    rig.objects.push_back(made);
  }

  void spline(RigDescription& rig) {
    SplineDescription made;
    made.name = "s";
    made.matrix = place(rig.matrices.size() + 1) - 1;
    const std::uint8_t flags = byte();
    made.type = static_cast<SplineType>(byte() % 3);
    made.order = raw_ ? bytes_.take<std::int8_t>() : 2 + byte() % 3;
    made.reaches_ends = flags & 1;
    made.resolution = raw_ ? bytes_.take<std::int8_t>() : 1 + byte() % 16;
    made.radius_interpolation = static_cast<RadiusInterpolation>(byte() % 4);
    made.points.resize(byte() % 5);
    made.handles.resize(made.points.size());
    for (auto& point : made.points) {
      for (float& each : point) each = number();
    }
    for (auto& handles : made.handles) {
      for (SplineHandle& each : handles) each = static_cast<SplineHandle>(byte() % 4);
    }
    const int count = static_cast<int>(made.points.size());
    made.radii = "radii";
    rig.properties.push_back({"radii", count, ValueKind::real, 0, 10, std::vector<float>(count, number())});
    if (flags & 2) {
      SplineHook hook{target(rig), {}, number(), {place(3 * count + 1)}};
      for (float& each : hook.inverse) each = number();
      made.hooks.push_back(hook);
    }
    if (flags & 4) made.keys.push_back({"[\"p\"]", place(2) - 1, std::vector<std::array<float, 10>>(count)});
    made.has_keys = flags & 8;
    made.is_closed = flags & 16;
    if (flags & 32) made.time = "[\"p\"]";
    if (flags & 64) made.tilts.assign(made.points.size(), number());
    made.tilt_interpolation = made.radius_interpolation;
    made.twist = static_cast<SplineTwist>(flags >> 7);
    made.duration = raw_ ? bytes_.take<std::int8_t>() : 1 + byte();
    rig.splines.push_back(made);
  }

  RigTarget target(const RigDescription& rig) {
    RigTarget target{static_cast<RigTarget::Type>(byte() % 4), place(rig.bones.size())};
    if (target.type == RigTarget::Type::outside && !raw_) {
      target.index = rig.matrices.empty() ? 0 : byte() % static_cast<int>(rig.matrices.size());
    }
    if (target.type == RigTarget::Type::outside && rig.matrices.empty()) target.type = RigTarget::Type::none;
    return target;
  }

  static bool follows_spline(ConstraintType type) {
    return type == ConstraintType::spline_ik || type == ConstraintType::follow_path;
  }

  int target_count(ConstraintType type) {
    if (type == ConstraintType::armature || raw_) return byte() % 3;
    if (type == ConstraintType::ik) return 2;
    const bool is_limit = constraint_name(type).starts_with("LIMIT") && type != ConstraintType::limit_distance;
    return is_limit || type == ConstraintType::maintain_volume || follows_spline(type) ? 0 : 1;
  }

  void constraint(RigDescription& rig, int bone) {
    ConstraintDescription& made =
        add_constraint(rig, static_cast<ConstraintType>(byte() % kConstraintTypeCount), bone, -1);
    for (int i = target_count(made.type); i > 0; --i) made.targets.push_back(target(rig));
    if (made.type == ConstraintType::armature) made.weights.assign(made.targets.size(), number());
    for (int i = byte() % 8; i > 0; --i) made.settings[byte() % made.settings.size()] = number();
    if (made.type == ConstraintType::action && byte() & 1) made.action.push_back({place(kPoseBend), curve()});
    made.space = target(rig);
    if (follows_spline(made.type)) {
      made.spline = place(rig.splines.size() + 1) - 1;
      for (int i = made.type == ConstraintType::spline_ik ? byte() % 4 : 0; i > 0; --i) made.joints.push_back(number());
    }
  }

  CurveDescription curve() {
    CurveDescription curve;
    float frame = 0;
    for (int i = byte() % 4; i > 0; --i) {
      CurveKey key;
      frame = raw_ ? number() : frame + static_cast<float>(byte());
      key.point[0] = frame;
      for (float* each : {key.left, key.right}) each[0] = number(), each[1] = number();
      key.point[1] = number();
      key.interpolation = static_cast<KeyInterpolation>(byte() % 13);
      key.easing = static_cast<KeyEasing>(byte() % 4);
      curve.keys.push_back(key);
    }
    if (byte() & 1) {
      CurveModifier modifier;
      modifier.type = static_cast<CurveModifier::Type>(byte() % 6);
      modifier.before = static_cast<CycleMode>(byte() % 4);
      modifier.after = static_cast<CycleMode>(byte() % 4);
      modifier.cycles_after = bytes_.take<std::int8_t>();
      modifier.coefficients = {number(), number()};
      modifier.is_factorised = byte() & 1;
      modifier.function = static_cast<CurveFunction>(byte() % 6);
      for (float* each : {&modifier.amplitude, &modifier.phase_multiplier, &modifier.reference, &modifier.step,
                          &modifier.step_offset, &modifier.envelope_low}) {
        *each = number();
      }
      if (byte() & 1) modifier.points = {{0, number(), number()}, {number(), number(), number()}};
      if (byte() & 1) modifier.least_frame = number();
      if (byte() & 1) modifier.most_value = number();
      if (byte() & 1) modifier.last_stepped = number();
      if (byte() & 1 && modifier.type != CurveModifier::Type::cycles) {
        modifier.influence = number();
        modifier.has_range = true;
        modifier.range_end = number();
        modifier.blend_in = number();
      }
      curve.modifiers.push_back(modifier);
    }
    curve.is_extrapolated = byte() & 1;
    curve.is_free = byte() & 1;
    return curve;
  }

  void nla(RigDescription& rig) {
    rig.mixed.push_back({path(rig), static_cast<PropertyMix>(byte() % 3), {number(), number(), number()}});
    rig.mixed.push_back({"pose.bones[\"b0\"].rotation_quaternion", PropertyMix::quaternion, {1, 0, 0, 0}});
    if (!raw_) rig.mixed[0] = {"pose.bones[\"b0\"].scale", PropertyMix::multiply, {1, 1, 1}};
    for (int i = byte() % 3; i > 0; --i) {
      rig.actions.emplace_back();
      for (int k = byte() % 4; k > 0; --k) {
        rig.actions.back().push_back({{rig.mixed[byte() % 2].path, byte() % (raw_ ? 5 : 3)}, curve()});
      }
    }
    for (int i = byte() % 3; i > 0; --i) rig.tracks.push_back(strips(rig, 0));
  }

  std::vector<StripDescription> strips(const RigDescription& rig, int depth) {
    std::vector<StripDescription> made(byte() % 4);
    float frame = 0;
    for (StripDescription& strip : made) {
      strip.type = static_cast<StripType>(byte() % 3);
      strip.start = raw_ ? number() : frame;
      strip.end = raw_ ? number() : frame + 1 + static_cast<float>(byte() % 8);
      frame = strip.end + static_cast<float>(byte() % 4);
      for (float* each :
           {&strip.action_start, &strip.action_end, &strip.scale, &strip.repeat, &strip.blend_in, &strip.blend_out}) {
        *each = number();
      }
      strip.blend = static_cast<StripBlend>(byte() % 5);
      strip.extrapolation = static_cast<StripExtrapolation>(byte() % 3);
      const std::uint8_t flags = byte();
      strip.is_reversed = flags & 1;
      strip.is_muted = flags & 2;
      strip.keeps_frames = flags & 4;
      strip.is_time_cyclic = flags & 8;
      if (flags & 16) strip.influence = number();
      if (flags & 32) strip.time = number();
      if (flags & 64) strip.influence_curve = curve();
      if (flags & 128) strip.time_curve = curve();
      strip.action = place(rig.actions.size() + 1) - 1;
      if (strip.type == StripType::meta && depth < 10) strip.strips = strips(rig, depth + 1);
    }
    return made;
  }

  std::string path(const RigDescription& rig) {
    static constexpr std::array kProperties = {"location", "rotation_quaternion", "scale", "bbone_rollin",
                                               "ik_stretch"};
    if (!rig.objects.empty() && byte() % 4 == 0) return "objects[\"o0\"].scale";
    if (!rig.constraints.empty() && byte() & 1) {
      const ConstraintDescription& chosen = rig.constraints[byte() % rig.constraints.size()];
      return "pose.bones[\"b" + std::to_string(chosen.bone) + "\"].constraints[\"" + chosen.name + "\"].influence";
    }
    const int bone = byte() % static_cast<int>(rig.bones.size());
    return "pose.bones[\"b" + std::to_string(bone) + "\"]." + kProperties[byte() % kProperties.size()];
  }

  void driver(RigDescription& rig) {
    DriverDescription driver;
    driver.value = {path(rig), byte() % most_index()};
    driver.type = static_cast<DriverType>(byte() % 5);
    driver.expression = kExpressions[byte() % kExpressions.size()];
    if (raw_) {
      const auto text = bytes_.list<char>(byte() % 32);
      driver.expression.assign(text.begin(), text.end());
    }
    for (const char* name : {"a", "b"}) {
      VariableDescription variable;
      variable.name = name;
      variable.type = static_cast<VariableType>(byte() % 4);
      variable.path = !rig.properties.empty() && byte() & 1 ? "[\"p\"]" : "pose.bones[\"b0\"].location[1]";
      for (VariableTarget& read : variable.targets) {
        read = {target(rig), static_cast<TransformChannel>(byte() % 11), static_cast<TransformSpace>(byte() % 3),
                static_cast<ChannelRotation>(byte() % 11)};
      }
      driver.variables.push_back(variable);
    }
    if (byte() & 1) driver.curve = curve();
    rig.drivers.push_back(driver);
  }

  Bytes& bytes_;
  bool raw_;  // numbers as they come
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  [[maybe_unused]] static const bool alone = (set_thread_count(1), true);
  Bytes bytes(data, size);
  const RigDescription rig = Maker(bytes).rig();
  std::optional<RigProgram> program;
  if (!fuzz::accepts([&] { program.emplace(rig); })) return 0;
  const std::array<float, 3> frames = {1, 2.5F, static_cast<float>(bytes.take<std::int8_t>())};
  const auto bones = static_cast<std::ptrdiff_t>(rig.bones.size());
  std::array<std::vector<Matrix4<float>>, 2> poses;
  for (std::vector<Matrix4<float>>& each : poses) {
    each.assign(frames.size() * rig.bones.size(), Matrix4<float>::Zero());
    RigOutputs outputs;
    outputs.poses = MatrixStack<float>::of(each.data(), static_cast<std::ptrdiff_t>(frames.size()), bones);
    if (!fuzz::accepts([&] { program->evaluate(frames, {}, outputs); })) return 0;
  }
  fuzz::require(std::memcmp(poses[0].data(), poses[1].data(), poses[0].size() * sizeof(Matrix4<float>)) == 0,
                "a rig computes the same bits again");
  if (bones > 0) {
    const MatrixStack<const float> given = MatrixStack<float>::of(poses[0].data(), 3, bones);
    Matrix4<float> local[3];
    const auto space = static_cast<BoneSpace>(bytes.take<std::uint8_t>() % 4);
    program->convert(given, bytes.take<std::uint8_t>() % bones, space, BoneSpace::local,
                     MatrixStack<float>::of(local, 3, 1));
  }
  return 0;
}
