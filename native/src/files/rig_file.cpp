#include "sinew/rig_file.h"

#include "files/entries.h"

namespace sinew {
namespace entries {

/// What a description keeps as a flag.
enum class Mapping : std::uint8_t { straight, curved };

constexpr std::string_view names(NamesOf<RotationMode>) { return "AXIS_ANGLE QUATERNION XYZ XZY YXZ YZX ZXY ZYX"; }
constexpr std::string_view names(NamesOf<InheritScale>) { return "FULL FIX_SHEAR ALIGNED AVERAGE NONE NONE_LEGACY"; }
constexpr std::string_view names(NamesOf<HandleType>) { return "AUTO ABSOLUTE RELATIVE TANGENT"; }
constexpr std::string_view names(NamesOf<SplineHandle>) { return "FREE AUTO VECTOR ALIGNED"; }
constexpr std::string_view names(NamesOf<RadiusInterpolation>) { return "LINEAR CARDINAL BSPLINE EASE"; }
constexpr std::string_view names(NamesOf<CycleMode>) { return "NONE REPEAT REPEAT_OFFSET MIRROR"; }
constexpr std::string_view names(NamesOf<CurveModifier::Type>) {
  return "CYCLES GENERATOR FNGENERATOR ENVELOPE LIMITS STEPPED";
}
constexpr std::string_view names(NamesOf<CurveFunction>) { return "SIN COS TAN SQRT LN SINC"; }
constexpr std::string_view names(NamesOf<DriverType>) { return "AVERAGE SCRIPTED SUM MIN MAX"; }
constexpr std::string_view names(NamesOf<VariableType>) { return "SINGLE_PROP TRANSFORMS LOC_DIFF ROTATION_DIFF"; }
constexpr std::string_view names(NamesOf<TransformChannel>) {
  return "LOC_X LOC_Y LOC_Z ROT_X ROT_Y ROT_Z SCALE_X SCALE_Y SCALE_Z SCALE_AVG ROT_W";
}
constexpr std::string_view names(NamesOf<TransformSpace>) { return "WORLD_SPACE TRANSFORM_SPACE LOCAL_SPACE"; }
constexpr std::string_view names(NamesOf<ChannelRotation>) {
  return "AUTO XYZ XZY YXZ YZX ZXY ZYX QUATERNION SWING_TWIST_X SWING_TWIST_Y SWING_TWIST_Z";
}
constexpr std::string_view names(NamesOf<StripType>) { return "CLIP TRANSITION META"; }
constexpr std::string_view names(NamesOf<StripBlend>) { return "REPLACE ADD SUBTRACT MULTIPLY COMBINE"; }
constexpr std::string_view names(NamesOf<StripExtrapolation>) { return "HOLD HOLD_FORWARD NOTHING"; }
constexpr std::string_view names(NamesOf<PropertyMix>) { return "ADD MULTIPLY QUATERNION"; }
constexpr std::string_view names(NamesOf<ValueKind>) { return "FLOAT INT BOOLEAN ENUM"; }
constexpr std::string_view names(NamesOf<Mapping>) { return "STRAIGHT CURVED"; }
constexpr std::string_view names(NamesOf<SplineType>) { return "BEZIER POLY NURBS"; }
constexpr std::string_view names(NamesOf<SplineTwist>) { return "MINIMUM Z_UP"; }

/// Blender's numbers of interpolations.
constexpr std::array kInterpolations = {
    KeyInterpolation::constant,    KeyInterpolation::linear,    KeyInterpolation::bezier,  KeyInterpolation::back,
    KeyInterpolation::bounce,      KeyInterpolation::circular,  KeyInterpolation::cubic,   KeyInterpolation::elastic,
    KeyInterpolation::exponential, KeyInterpolation::quadratic, KeyInterpolation::quartic, KeyInterpolation::quintic,
    KeyInterpolation::sine,
};

template <class Enum>
Enum choice_of(Reader& reader, const Entry& entry) {
  Enum choice{};
  read(reader, entry, choice);
  return choice;
}

int bone_named(const Reader& reader, const std::string& name, std::string_view where) {
  const auto found = reader.bones.find(name);
  if (found == reader.bones.end()) wrong({where}, "names bone \"", name, "\", which the rig does not have");
  return found->second;
}

int matrix_named(const Reader& reader, const std::string& name, std::string_view where) {
  const auto found = reader.matrices.find(name);
  if (found == reader.matrices.end()) {
    wrong({where}, "looks at \"", name, "\", which is not among the matrices from outside");
  }
  return found->second;
}

/// A bone's name or null.
template <int BoneDescription::*member>
void into_bone(Reader& reader, const Entry& entry, BoneDescription& bone) {
  if (!entry.json.get<std::monostate>()) bone.*member = bone_named(reader, text_of(entry), entry.where.owner);
}

template <std::size_t end>
void into_handle(Reader& reader, const Entry& entry, BoneDescription& bone) {
  if (!entry.json.get<std::monostate>()) bone.handles[end] = bone_named(reader, text_of(entry), entry.where.owner);
}

/// Adds a world matrix for an object. Returns its number.
int added_matrix(Reader& reader, const Entry& entry, const ObjectDescription& object) {
  const auto number = static_cast<int>(reader.rig.matrices.size());
  if (!reader.matrices.emplace(text_of(entry), number).second) {
    fail("object \"", object.name, "\" has the name of a matrix; give each a name of its own");
  }
  reader.rig.matrices.push_back({text_of(entry), {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}});
  return number;
}

template <>
struct Table<RigTarget> {
  static constexpr Row<RigTarget> rows[] = {
      {"bone",
       [](Reader& reader, const Entry& entry, RigTarget& target) {
         target = {RigTarget::Type::bone, bone_named(reader, text_of(entry), entry.where.owner)};
       }},
      {"outside",
       [](Reader& reader, const Entry& entry, RigTarget& target) {
         target = {RigTarget::Type::outside, matrix_named(reader, text_of(entry), entry.where.owner)};
       }},
      {"armature",
       [](Reader&, const Entry& entry, RigTarget& target) {
         if (number_of(entry, "true or false") != 0) target.type = RigTarget::Type::armature;
       }},
  };
};

RigTarget target_of(Reader& reader, const Json& json) {
  RigTarget target;
  if (json.get<std::monostate>()) return target;
  const Where where{reader.owner, ", a target,"};
  read_object(reader, json, where, target);
  if (json.get<Json::Entries>()->size() != 1) {
    wrong(where, "has ", json.get<Json::Entries>()->size(), " entries; expected one of bone, outside, armature");
  }
  return target;
}

void read(Reader& reader, const Entry& entry, RigTarget& target) { target = target_of(reader, entry.json); }

void read(Reader& reader, const Entry& entry, std::vector<RigTarget>& targets) {
  for_each(entry, [&](const Json& item) { targets.push_back(target_of(reader, item)); });
}

/// Rows of left handle, point and right handle, each as frame and value; amplitude, period, back; interpolation and easing
/// as Blender numbers them.
void read(Reader&, const Entry& entry, std::vector<CurveKey>& keys) {
  constexpr std::size_t kColumns = 11;
  const std::vector<float> numbers = numbers_of(entry);
  if (numbers.size() % kColumns != 0) {
    wrong(entry.where, "has ", numbers.size(), " numbers as \"keys\"; expected 11 for each key");
  }
  keys.reserve(numbers.size() / kColumns);
  for (auto row = numbers.begin(); row != numbers.end(); row += kColumns) {
    if (!(row[9] >= 0 && row[9] < kInterpolations.size())) wrong(entry.where, "has an unknown interpolation");
    if (!(row[10] >= 0 && row[10] <= 3)) wrong(entry.where, "has an unknown easing");
    keys.push_back({{row[0], row[1]},
                    {row[2], row[3]},
                    {row[4], row[5]},
                    row[6],
                    row[7],
                    row[8],
                    kInterpolations[static_cast<std::size_t>(row[9])],
                    static_cast<KeyEasing>(row[10])});
  }
}

template <>
struct Table<CurveModifier> {
  using Of = CurveModifier;
  static constexpr std::string_view name = "a modifier of a curve";
  static constexpr Row<Of> rows[] = {
      {"type", into<&Of::type>},
      {"mode_before", into<&Of::before>},
      {"mode_after", into<&Of::after>},
      {"cycles_before", into<&Of::cycles_before>},
      {"cycles_after", into<&Of::cycles_after>},
      {"use_additive", into<&Of::is_additive>},
      {"coefficients", into<&Of::coefficients>},
      {"is_factorised", into<&Of::is_factorised>},
      {"function_type", into<&Of::function>},
      {"amplitude", into<&Of::amplitude>},
      {"phase_multiplier", into<&Of::phase_multiplier>},
      {"phase_offset", into<&Of::phase_offset>},
      {"value_offset", into<&Of::value_offset>},
      {"reference_value", into<&Of::reference>},
      {"default_min", into<&Of::envelope_low>},
      {"default_max", into<&Of::envelope_high>},
      {"points",
       [](Reader&, const Entry& entry, Of& modifier) {
         const std::vector<float> numbers = numbers_of(entry);
         if (numbers.size() % 3 != 0) {
           wrong(entry.where, "has ", numbers.size(), " numbers as \"points\"; expected 3 for each point");
         }
         for (auto row = numbers.begin(); row != numbers.end(); row += 3) {
           modifier.points.push_back({row[0], row[1], row[2]});
         }
       }},
      {"min_x", into<&Of::least_frame>},
      {"max_x", into<&Of::most_frame>},
      {"min_y", into<&Of::least_value>},
      {"max_y", into<&Of::most_value>},
      {"frame_step", into<&Of::step>},
      {"frame_offset", into<&Of::step_offset>},
      {"first_stepped", into<&Of::first_stepped>},
      {"last_stepped", into<&Of::last_stepped>},
      {"influence", into<&Of::influence>},
      {"range",
       [](Reader&, const Entry& entry, Of& modifier) {
         float range[2] = {};
         read_numbers(entry, range, 2);
         modifier.has_range = true;
         modifier.range_start = range[0];
         modifier.range_end = range[1];
       }},
      {"blend_in", into<&Of::blend_in>},
      {"blend_out", into<&Of::blend_out>},
  };
};

template <>
struct Table<CurveDescription> {
  using Of = CurveDescription;
  static constexpr std::string_view part = ", its curve,";
  static constexpr Row<Of> rows[] = {
      {"keys", into<&Of::keys>},
      {"modifiers", into<&Of::modifiers>},
      {"is_extrapolated", into<&Of::is_extrapolated>},
      {"is_free", into<&Of::is_free>},
  };
};

template <>
struct Table<AnimatedValue> {
  using Of = AnimatedValue;
  static constexpr std::string_view name = "a curve";
  static constexpr auto inner = &Of::curve;
  static constexpr Row<Of> rows[] = {
      {"path", [](Reader&, const Entry& entry, Of& of) { of.value.path = text_of(entry); }, kNeeded},
      {"index", [](Reader& reader, const Entry& entry, Of& of) { read(reader, entry, of.value.index); }},
  };
};

template <>
struct Table<StripDescription> {
  using Of = StripDescription;
  static constexpr std::string_view name = "a strip";
  static constexpr Row<Of> rows[] = {
      {"type", into<&Of::type>},
      {"frame_start", into<&Of::start>, kNeeded},
      {"frame_end", into<&Of::end>, kNeeded},
      {"action_frame_start", into<&Of::action_start>},
      {"action_frame_end", into<&Of::action_end>},
      {"scale", into<&Of::scale>},
      {"repeat", into<&Of::repeat>},
      {"blend_in", into<&Of::blend_in>},
      {"blend_out", into<&Of::blend_out>},
      {"blend_type", into<&Of::blend>},
      {"extrapolation", into<&Of::extrapolation>},
      {"use_reverse", into<&Of::is_reversed>},
      {"mute", into<&Of::is_muted>},
      {"keeps_frames", into<&Of::keeps_frames>},
      {"use_animated_time_cyclic", into<&Of::is_time_cyclic>},
      {"influence", into<&Of::influence>},
      {"strip_time", into<&Of::time>},
      {"influence_curve", into<&Of::influence_curve>},
      {"time_curve", into<&Of::time_curve>},
      {"action",
       [](Reader& reader, const Entry& entry, Of& strip) {
         const auto found = reader.actions.find(text_of(entry));
         if (found == reader.actions.end()) {
           wrong(entry.where, "plays action \"", text_of(entry), "\", which is not described");
         }
         strip.action = found->second;
       }},
      {"strips", into<&Of::strips>},
  };
};

struct Track {
  std::vector<StripDescription> strips;
};
template <>
struct Table<Track> {
  static constexpr std::string_view name = "a track";
  static constexpr Row<Track> rows[] = {{"strips", into<&Track::strips>}};
};

struct Action {
  std::vector<AnimatedValue> curves;
};
template <>
struct Table<Action> {
  static constexpr std::string_view name = "an action";
  static constexpr Row<Action> rows[] = {
      {"name",
       [](Reader& reader, const Entry& entry, Action&) {
         const std::string& name = text_of(entry);
         if (!reader.actions.emplace(name, static_cast<int>(reader.actions.size())).second) {
           wrong({"action"}, "\"", name, "\" occurs twice; give each a name of its own");
         }
       },
       kNeeded},
      {"curves", into<&Action::curves>},
  };
};

template <>
struct Table<MixedPropertyDescription> {
  using Of = MixedPropertyDescription;
  static constexpr std::string_view name = "a property that strips set";
  static constexpr Row<Of> rows[] = {
      {"path", into<&Of::path>, kNeeded},
      {"default", into<&Of::defaults>, kNeeded},
      {"mix", into<&Of::mix>},
  };
};

template <>
struct Table<BoneDescription> {
  using Of = BoneDescription;
  static constexpr Row<Of> rows[] = {
      {"name", into<&Of::name>, kNeeded},
      {"values", into<&Of::values>},
      {"matrix_local", into_matrix<&Of::rest>, kNeeded},
      {"matrix", into_matrix<&Of::rest_in_parent>, kNeeded},
      {"head", into<&Of::head>, kNeeded},
      {"head_local", into<&Of::head_in_armature>, kNeeded},
      {"tail_local", into<&Of::tail_in_armature>, kNeeded},
      {"length", into<&Of::length>, kNeeded},
      {"use_inherit_rotation", into<&Of::inherits_rotation>},
      {"use_local_location", into<&Of::uses_local_location>},
      {"use_connect", into<&Of::is_connected>},
      {"use_deform", into<&Of::deforms>},
      {"bbone_segments", into<&Of::segments>},
      {"parent", into_bone<&Of::parent>},
      {"has_constraints", into<&Of::has_constraints>},
      {"rotation_mode", into<&Of::rotation_mode>},
      {"inherit_scale", into<&Of::inherit_scale>},
      {"bbone_handle_type_start", into_item<&Of::handle_types, 0>},
      {"bbone_handle_type_end", into_item<&Of::handle_types, 1>},
      {"bbone_handle_use_ease_start", into_item<&Of::handles_ease, 0>},
      {"bbone_handle_use_ease_end", into_item<&Of::handles_ease, 1>},
      {"use_endroll_as_inroll", into<&Of::uses_end_roll>},
      {"use_scale_easing", into<&Of::scales_ease>},
      {"bbone_mapping_mode", [](Reader& reader, const Entry& entry,
                                Of& bone) { bone.maps_curved = choice_of<Mapping>(reader, entry) == Mapping::curved; }},
      {"bbone_custom_handle_start", into_handle<0>},
      {"bbone_custom_handle_end", into_handle<1>},
      {"bbone_handle_use_scale_start", into_item<&Of::handles_scale, 0>},
      {"bbone_handle_use_scale_end", into_item<&Of::handles_scale, 1>},
      {"connected_child", into_bone<&Of::connected_child>},
  };
};

template <>
struct Table<ActionChannel> {
  using Of = ActionChannel;
  static constexpr std::string_view part = ", its action,";
  static constexpr auto inner = &Of::curve;
  static constexpr Row<Of> rows[] = {{"channel", into<&Of::value>, kNeeded}};
};

ConstraintType constraint_type(const std::string& name, const std::string& owner) {
  for (int i = 0; i < kConstraintTypeCount; ++i) {
    if (constraint_name(static_cast<ConstraintType>(i)) == name) return static_cast<ConstraintType>(i);
  }
  fail(owner, " is of type ", name, ", which is not computed");
}

std::vector<float> initial_settings(std::span<const RigSetting> settings) {
  std::vector<float> numbers;
  for (const RigSetting& each : settings) numbers.insert(numbers.end(), each.count, each.initial);
  return numbers;
}

/// By the library's own table of them.
void read_settings(Reader& reader, const Entry& entry, ConstraintDescription& constraint) {
  const Where where{reader.owner, ", its settings,"};
  const std::span<const RigSetting> settings = constraint_settings(constraint.type);
  Object object(entry.json, where);
  float* numbers = constraint.settings.data();
  for (const RigSetting& setting : settings) {
    if (const Json* const found = object.find(setting.name)) {
      const Entry own{*found, setting.name, where};
      if (setting.count == 1 && (found->get<double>() || found->get<bool>())) {
        *numbers = static_cast<float>(number_of(own));
      } else {
        const std::vector<float> several = numbers_of(own);
        if (several.size() != static_cast<std::size_t>(setting.count)) {
          wrong({reader.owner}, "has ", several.size(), " numbers as ", setting.name, "; expected ", setting.count);
        }
        std::copy(several.begin(), several.end(), numbers);
      }
    }
    numbers += setting.count;
  }
  object.check_all_found(
      [&](std::string_view name) { return std::ranges::find(settings, name, &RigSetting::name) != settings.end(); });
}

template <>
struct Table<ConstraintDescription> {
  using Of = ConstraintDescription;
  static constexpr std::string_view name = "a constraint";
  static constexpr Row<Of> rows[] = {
      {"name", into<&Of::name>, kNeeded},
      {"bone",
       [](Reader& reader, const Entry& entry, Of& constraint) {
         reader.owner = "constraint \"" + constraint.name + "\" of bone \"" + text_of(entry) + "\"";
         constraint.bone = bone_named(reader, text_of(entry), reader.owner);
       },
       kNeeded},
      {"type",
       [](Reader& reader, const Entry& entry, Of& constraint) {
         constraint.type = constraint_type(text_of(entry), reader.owner);
         constraint.settings = initial_settings(constraint_settings(constraint.type));
       },
       kNeeded},
      {"settings", read_settings},
      {"targets", into<&Of::targets>},
      {"weights", into<&Of::weights>},
      {"space", into<&Of::space>},
      {"action", into<&Of::action>},
      {"spline",
       [](Reader& reader, const Entry& entry, Of& constraint) {
         const auto& splines = reader.rig.splines;
         const auto found = std::ranges::find(splines, text_of(entry), &SplineDescription::name);
         if (found == splines.end()) {
           wrong({reader.owner}, "follows spline \"", text_of(entry), "\", which the rig does not have");
         }
         constraint.spline = static_cast<int>(found - splines.begin());
       }},
      {"joints", into<&Of::joints>},
  };
};

struct SplinePoint {
  std::array<float, 9> places{};
  std::array<SplineHandle, 2> handles{};
  float tilt = 0;
  float weight = 1;
};
template <>
struct Table<SplinePoint> {
  using Of = SplinePoint;
  static constexpr std::string_view part = ", a point,";
  static constexpr Row<Of> rows[] = {
      {"co", into<&Of::places>, kNeeded},
      {"handle_left_type", into_item<&Of::handles, 0>},
      {"handle_right_type", into_item<&Of::handles, 1>},
      {"tilt", into<&Of::tilt>},
      {"weight", into<&Of::weight>},
  };
};

template <>
struct Table<SplineKey> {
  using Of = SplineKey;
  static constexpr std::string_view part = ", a shape key,";
  static constexpr Row<Of> rows[] = {
      {"value", into<&Of::value>, kNeeded},
      {"relative", into<&Of::relative>},
      {"points",
       [](Reader&, const Entry& entry, Of& key) {
         const std::vector<float> numbers = numbers_of(entry);
         if (numbers.size() % 10 != 0) wrong(entry.where, "has points that are not of 10 numbers");
         key.points.resize(numbers.size() / 10);
         for (std::size_t i = 0; i < numbers.size(); ++i) key.points[i / 10][i % 10] = numbers[i];
       },
       kNeeded},
  };
};

template <>
struct Table<SplineHook> {
  using Of = SplineHook;
  static constexpr std::string_view part = ", a hook,";
  static constexpr Row<Of> rows[] = {
      {"target", into<&Of::target>},
      {"matrix_inverse", into_matrix<&Of::inverse>, kNeeded},
      {"strength", into<&Of::strength>},
      {"handles",
       [](Reader& reader, const Entry& entry, Of& hook) {
         for_each(entry, [&](const Json& item) {
           read(reader, {item, entry.name, entry.where}, hook.points.emplace_back());
         });
       }},
  };
};

template <>
struct Table<SplineDescription> {
  using Of = SplineDescription;
  static constexpr std::string_view name = "a spline";
  static constexpr Row<Of> rows[] = {
      {"name",
       [](Reader& reader, const Entry& entry, Of& spline) {
         spline.name = text_of(entry);
         reader.owner = "spline \"" + spline.name + "\"";
       },
       kNeeded},
      {"object",
       [](Reader& reader, const Entry& entry, Of& spline) {
         const RigTarget place = target_of(reader, entry.json);
         if (place.type == RigTarget::Type::outside) spline.matrix = place.index;
       }},
      {"type", into<&Of::type>},
      {"order_u", into<&Of::order>},
      {"use_endpoint_u", into<&Of::reaches_ends>},
      {"use_cyclic_u", into<&Of::is_closed>},
      {"resolution_u", into<&Of::resolution>},
      {"tilt_interpolation", into<&Of::tilt_interpolation>},
      {"twist_mode", into<&Of::twist>},
      {"eval_time", into<&Of::time>},
      {"path_duration", into<&Of::duration>},
      {"use_path_clamp", into<&Of::stays_within>},
      {"radius_interpolation", into<&Of::radius_interpolation>},
      {"radii", into<&Of::radii>, kNeeded},
      {"points",
       [](Reader& reader, const Entry& entry, Of& spline) {
         std::vector<SplinePoint> points;
         read(reader, entry, points);
         for (const SplinePoint& point : points) {
           spline.points.push_back(point.places);
           spline.handles.push_back(point.handles);
           spline.tilts.push_back(point.tilt);
           spline.weights.push_back(point.weight);
         }
       }},
      {"has_shape_keys", into<&Of::has_keys>},
      {"shape_keys", into<&Of::keys>},
      {"hooks", into<&Of::hooks>},
  };
};

template <>
struct Table<CustomProperty> {
  using Of = CustomProperty;
  static constexpr std::string_view name = "a property";
  static constexpr Row<Of> rows[] = {
      {"path", into<&Of::path>, kNeeded},
      {"type", into<&Of::kind>},
      {"min", into<&Of::low>},
      {"max", into<&Of::high>},
      {"value",
       [](Reader&, const Entry& entry, Of& property) {
         property.values = numbers_of(entry);
         property.count = static_cast<int>(property.values.size());
       },
       kNeeded},
  };
};

template <>
struct Table<OutsideValue> {
  using Of = OutsideValue;
  static constexpr std::string_view name = "a value from outside";
  static constexpr Row<Of> rows[] = {{"name", into<&Of::name>, kNeeded}, {"value", into<&Of::value>, kNeeded}};
};

template <>
struct Table<OutsideMatrix> {
  using Of = OutsideMatrix;
  static constexpr std::string_view name = "a matrix from outside";
  static constexpr Row<Of> rows[] = {
      {"name",
       [](Reader& reader, const Entry& entry, Of& matrix) {
         matrix.name = text_of(entry);
         reader.matrices.emplace(matrix.name, static_cast<int>(reader.rig.matrices.size()) - 1);
       },
       kNeeded},
      {"matrix", into_matrix<&Of::matrix>, kNeeded},
  };
};

/// The matrices that an object adds follow those from outside.
template <>
struct Table<ObjectDescription> {
  using Of = ObjectDescription;
  static constexpr Row<Of> rows[] = {
      {"parent",
       [](Reader& reader, const Entry& entry, Of& object) {
         if (entry.json.get<std::monostate>()) return;
         const auto found = reader.matrices.find(text_of(entry));
         if (found == reader.matrices.end()) {
           wrong(entry.where, "names parent \"", text_of(entry),
                 "\", which is neither a matrix nor an object before it");
         }
         object.parent = found->second;
       }},
      {"name",
       [](Reader& reader, const Entry& entry, Of& object) {
         object.name = text_of(entry);
         object.matrix = added_matrix(reader, entry, object);
       },
       kNeeded},
      {"matrix_parent_inverse", into_matrix<&Of::parent_inverse>},
      {"rotation_mode", into<&Of::rotation_mode>},
      {"values", into<&Of::values>},
      {"local",
       [](Reader& reader, const Entry& entry, Of& object) { object.local = added_matrix(reader, entry, object); }},
      {"basis",
       [](Reader& reader, const Entry& entry, Of& object) { object.basis = added_matrix(reader, entry, object); }},
  };
};

template <>
struct Table<VariableTarget> {
  using Of = VariableTarget;
  static constexpr std::string_view part = ", a variable,";
  static constexpr Row<Of> rows[] = {
      {"target", into<&Of::target>},
      {"transform_type", into<&Of::channel>},
      {"transform_space", into<&Of::space>},
      {"rotation_mode", into<&Of::rotation>},
      {"stored_mode", into<&Of::order>},
      {"stored_angles",
       [](Reader& reader, const Entry& entry, Of& target) {
         std::vector<std::string> names;
         read(reader, entry, names);
         if (names.size() > target.angles.size()) wrong(entry.where, "has more than 3 names as \"stored_angles\"");
         std::ranges::move(names, target.angles.begin());
       }},
  };
};

template <>
struct Table<VariableDescription> {
  using Of = VariableDescription;
  static constexpr std::string_view part = ", a variable,";
  static constexpr Row<Of> rows[] = {
      {"name", into<&Of::name>, kNeeded},
      {"type", into<&Of::type>},
      {"path", into<&Of::path>},
      {"outside", into<&Of::outside>},
      {"targets",
       [](Reader& reader, const Entry& entry, Of& variable) {
         std::vector<VariableTarget> targets;
         read(reader, entry, targets);
         if (targets.size() > variable.targets.size()) wrong(entry.where, "has more than two targets");
         for (const VariableTarget& target : targets) {
           const auto names = std::ranges::count_if(target.angles, [](const auto& name) { return !name.empty(); });
           if (names != (target.order >= RotationMode::xyz ? 3 : 0)) {
             wrong(entry.where, "has ", names,
                   " names as \"stored_angles\"; expected 3 if \"stored_mode\" has angles, otherwise none");
           }
         }
         std::ranges::move(targets, variable.targets.begin());
       }},
  };
};

template <>
struct Table<DriverDescription> {
  using Of = DriverDescription;
  static constexpr std::string_view name = "a driver";
  static constexpr Row<Of> rows[] = {
      {"path",
       [](Reader& reader, const Entry& entry, Of& driver) {
         driver.value.path = text_of(entry);
         reader.owner = "the driver of " + driver.value.path;
       },
       kNeeded},
      {"index", [](Reader& reader, const Entry& entry, Of& driver) { read(reader, entry, driver.value.index); }},
      {"type", into<&Of::type>},
      {"expression", into<&Of::expression>},
      {"variables", into<&Of::variables>},
      {"curve", into<&Of::curve>},
  };
};

/// Numbers of a bone or an object that has not moved.
template <std::size_t N>
void put_at_rest(std::span<const RigSetting> settings, std::array<float, N>& values) {
  std::ranges::copy(initial_settings(settings), values.begin());
  values[kQuaternion] = 1;
}

/// In the order in which they name each other.
template <>
struct Table<RigDescription> {
  using Of = RigDescription;
  static constexpr Row<Of> rows[] = {
      {"format",
       [](Reader& reader, const Entry& entry, Of&) {
         int format = 0;
         read(reader, entry, format);
         if (format > kRigFormat) {
           wrong(entry.where, "has format ", format, ", and this Sinew reads up to ", kRigFormat,
                 "; use a newer one, or write the rig with this one");
         }
         if (format < 1) wrong(entry.where, "has format ", format, "; expected 1 to ", kRigFormat);
       }},
      {"name", into<&Of::name>},
      {"blender", into<&Of::blender>, kNeeded},
      {"matrices", into<&Of::matrices>},
      {"objects",
       [](Reader& reader, const Entry& entry, Of& rig) {
         check_rig_size(0, count_of(entry));
         for_each(entry, [&](const Json& item) {
           ObjectDescription& object = rig.objects.emplace_back();
           put_at_rest(object_settings(), object.values);
           object.values[kPoseBend + kQuaternion] = 1;
           read_object(reader, item, {"an object"}, object);
         });
       }},
      {"world",
       [](Reader& reader, const Entry& entry, Of& rig) {
         if (const auto* name = entry.json.get<std::string>()) {
           rig.place = matrix_named(reader, *name, entry.where.owner);
         } else {
           into_matrix<&Of::world>(reader, entry, rig);
         }
       }},
      {"values", into<&Of::values>},
      {"bones",
       [](Reader& reader, const Entry& entry, Of& rig) {
         check_rig_size(count_of(entry), 0);
         for_each(entry, [&](const Json& item) {
           const auto number = static_cast<int>(rig.bones.size());
           BoneDescription& bone = rig.bones.emplace_back();
           put_at_rest(bone_settings(), bone.values);
           const std::string where = "bone " + std::to_string(number);
           const Json* const name = Object(item, {where}).find("name");
           if (name != nullptr && name->get<std::string>()) reader.bones.emplace(*name->get<std::string>(), number);
         });
         std::size_t number = 0;
         for_each(entry, [&](const Json& item) {
           const std::string where = "bone " + std::to_string(number);
           read_object(reader, item, {where}, rig.bones[number++]);
         });
       }},
      {"splines", into<&Of::splines>},
      {"constraints", into<&Of::constraints>},
      {"properties", into<&Of::properties>},
      {"curves", into<&Of::curves>},
      {"mixed", into<&Of::mixed>},
      {"actions",
       [](Reader& reader, const Entry& entry, Of& rig) {
         std::vector<Action> actions;
         read(reader, entry, actions);
         for (Action& action : actions) rig.actions.push_back(std::move(action.curves));
       }},
      {"tracks",
       [](Reader& reader, const Entry& entry, Of& rig) {
         std::vector<Track> tracks;
         read(reader, entry, tracks);
         for (Track& track : tracks) rig.tracks.push_back(std::move(track.strips));
       }},
      {"drivers", into<&Of::drivers>},
      {"refused", into<&Of::refused>},
  };
};

}  // namespace entries

RigDescription rig_description_of(const Json& rig) {
  entries::Reader reader;
  read_object(reader, rig, {"the rig"}, reader.rig);
  return std::move(reader.rig);
}

RigDescription rig_description_of(std::string_view text) {
  constexpr std::string_view kExpected = "; expected a rig as `sinew rig -o` writes it";
  Json rig;
  try {
    rig = parse_json(text);
  } catch (const InputError& error) {
    fail(error.what(), kExpected);
  }
  if (!rig.get<Json::Entries>()) fail("the file holds no JSON object", kExpected);
  return rig_description_of(rig);
}

std::vector<AnimatedValue> animated_values_of(const Json& rows) {
  entries::Reader reader;
  std::vector<AnimatedValue> found;
  read(reader, entries::Entry{rows, "curves", {"an edit"}}, found);
  return found;
}

RigProgram read_rig_program(const std::filesystem::path& path) {
  const std::string text = read_file(path);
  try {
    return RigProgram(rig_description_of(text));
  } catch (const InputError& error) {
    fail(shown(path), ": ", error.what());
  }
}

}  // namespace sinew
