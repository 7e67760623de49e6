#include "rig_description_of.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <array>
#include <initializer_list>
#include <map>
#include <string>
#include <unordered_map>
#include <vector>

#include "arrays.h"

namespace sinew::bindings {
namespace {

/// Lists in lists, and strips in strips: a list may contain itself. It is more than a matrix or a program has.
constexpr int kMostNested = 16;
constexpr std::size_t kMostStrips = 65'536;
constexpr std::size_t kMostNumbers = 1 << 28;  // of one entry

[[noreturn]] void wrong(const std::string& where, const std::string& what) { throw InputError(where + " " + what); }

/// Names in the order of an enumeration's values, which begin at `first`.
struct Names {
  int first;
  std::vector<std::string_view> names;
};

const Names kRotationModes = {-1, {kRotationModeNames.begin(), kRotationModeNames.end()}};
const Names kInheritScales = {0, {"FULL", "FIX_SHEAR", "ALIGNED", "AVERAGE", "NONE", "NONE_LEGACY"}};
const Names kHandleTypes = {0, {"AUTO", "ABSOLUTE", "RELATIVE", "TANGENT"}};
const Names kSplineHandles = {0, {"FREE", "AUTO", "VECTOR", "ALIGNED"}};
const Names kMappings = {0, {"STRAIGHT", "CURVED"}};
const Names kCycleModes = {0, {"NONE", "REPEAT", "REPEAT_OFFSET", "MIRROR"}};
const Names kModifierTypes = {0, {"CYCLES", "GENERATOR", "FNGENERATOR", "ENVELOPE", "LIMITS", "STEPPED"}};
const Names kFunctions = {0, {"SIN", "COS", "TAN", "SQRT", "LN", "SINC"}};
const Names kDriverTypes = {0, {"AVERAGE", "SCRIPTED", "SUM", "MIN", "MAX"}};
const Names kVariableTypes = {0, {"SINGLE_PROP", "TRANSFORMS", "LOC_DIFF", "ROTATION_DIFF"}};
const Names kChannels = {
    0, {"LOC_X", "LOC_Y", "LOC_Z", "ROT_X", "ROT_Y", "ROT_Z", "SCALE_X", "SCALE_Y", "SCALE_Z", "SCALE_AVG", "ROT_W"}};
const Names kTransformSpaces = {0, {"WORLD_SPACE", "TRANSFORM_SPACE", "LOCAL_SPACE"}};
const Names kChannelRotations = {0,
                                 {"AUTO", "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX", "QUATERNION", "SWING_TWIST_X",
                                  "SWING_TWIST_Y", "SWING_TWIST_Z"}};
const Names kStripTypes = {0, {"CLIP", "TRANSITION", "META"}};
const Names kStripBlends = {0, {"REPLACE", "ADD", "SUBTRACT", "MULTIPLY", "COMBINE"}};
const Names kExtrapolations = {0, {"HOLD", "HOLD_FORWARD", "NOTHING"}};
const Names kMixes = {0, {"ADD", "MULTIPLY", "QUATERNION"}};
const Names kValueKinds = {0, {"FLOAT", "INT", "BOOLEAN", "ENUM"}};

/// Blender's numbers of interpolations.
constexpr std::array kInterpolations = {
    KeyInterpolation::constant,    KeyInterpolation::linear,    KeyInterpolation::bezier,  KeyInterpolation::back,
    KeyInterpolation::bounce,      KeyInterpolation::circular,  KeyInterpolation::cubic,   KeyInterpolation::elastic,
    KeyInterpolation::exponential, KeyInterpolation::quadratic, KeyInterpolation::quartic, KeyInterpolation::quintic,
    KeyInterpolation::sine,
};

/// A key of a dictionary: to make a new text for each look takes longer than the look.
PyObject* key_of(std::string_view name) {
  static auto& keys = *new std::unordered_map<const char*, std::pair<std::string, PyObject*>>;
  auto& [text, key] = keys[name.data()];
  if (key == nullptr || text != name) {
    text = name;
    key = PyUnicode_InternFromString(text.c_str());
    if (key == nullptr) throw py::error_already_set();
  }
  return key;
}

/// A dictionary whose entries are read one by one; those that nobody has read are mistakes.
class Entries {
 public:
  /// owner, part: what it is, for messages. The owner's text must live as long.
  Entries(const py::handle& object, std::string_view owner, std::string_view part = "") : owner_(owner), part_(part) {
    if (!PyDict_Check(object.ptr())) wrong(where(), "is not a dictionary");
    dict_ = py::reinterpret_borrow<py::dict>(object);
    read_.reserve(dict_.size());
  }

  std::string_view owner() const { return owner_; }
  std::string where() const { return std::string(owner_) + std::string(part_); }

  /// Returns an entry or an empty handle.
  py::handle find(std::string_view key) {
    PyObject* const name = key_of(key);
    PyObject* const found = PyDict_GetItem(dict_.ptr(), name);
    if (found && std::ranges::find(read_, name) == read_.end()) read_.push_back(name);
    return found;
  }

  py::handle get(const char* key) {
    const py::handle found = find(key);
    if (!found) wrong(where(), std::string("has no \"") + key + "\"");
    return found;
  }

  template <class T>
  T get(const char* key) {
    return cast<T>(key, get(key));
  }
  template <class T>
  T get(const char* key, const T& fallback) {
    const py::handle found = find(key);
    return found ? cast<T>(key, found) : fallback;
  }
  template <class T>
  std::optional<T> get_if(const char* key) {
    const py::handle found = find(key);
    return found ? std::optional<T>(cast<T>(key, found)) : std::nullopt;
  }

  /// One of the names, as an enumeration.
  template <class Enum>
  Enum choice(const char* key, const Names& names, Enum fallback) {
    const py::handle found = find(key);
    if (!found) return fallback;
    const auto name = cast<std::string_view>(key, found);
    const auto at = std::find(names.names.begin(), names.names.end(), name);
    if (at == names.names.end()) {
      std::string expected;
      for (const std::string_view known : names.names) expected += (expected.empty() ? "" : ", ") + std::string(known);
      wrong(where(), std::string("has \"") + key + "\": \"" + std::string(name) + "\"; expected one of " + expected);
    }
    return static_cast<Enum>(names.first + (at - names.names.begin()));
  }

  /// `N` numbers, from a list or an array of any shape.
  template <std::size_t N>
  std::array<float, N> numbers(const char* key) {
    return numbers<N>(key, get(key));
  }
  template <std::size_t N>
  std::array<float, N> numbers(const char* key, const py::handle& object) const {
    std::array<float, N> result{};
    with_numbers(key, object, [&](std::span<const float> all) {
      if (all.size() != N) {
        wrong(where(), std::string("has ") + std::to_string(all.size()) + " numbers as \"" + key + "\"; expected " +
                           std::to_string(N));
      }
      std::copy(all.begin(), all.end(), result.begin());
    });
    return result;
  }

  /// The elements of a list; none if there is no such entry.
  py::tuple sequence(const char* key) {
    const py::handle found = find(key);
    if (!found) return py::tuple();
    if (!py::isinstance<py::list>(found) && !py::isinstance<py::tuple>(found)) {
      wrong(where(), std::string("has no list as \"") + key + "\"");
    }
    return py::tuple(py::reinterpret_borrow<py::object>(found));  // an element may change the list
  }

  /// Throws InputError if there is an entry that nobody has asked for.
  template <class IsKnown>
  void done_with(const IsKnown& is_known) const {
    if (read_.size() == dict_.size()) return;
    for (const auto& [key, value] : dict_) {
      const auto name = cast<std::string>("a key", key);
      if (!is_known(name)) wrong(where(), "has \"" + name + "\", which is unknown");
    }
  }
  void done(std::initializer_list<std::string_view> known) const {
    done_with([&](std::string_view name) { return std::ranges::find(known, name) != known.end(); });
  }

  /// Calls `use` with the numbers of an array in place, or of what append() takes.
  template <class Use>
  void with_numbers(std::string_view key, const py::handle& object, const Use& use) const {
    if (py::isinstance<py::array>(object)) {
      use(std::span<const float>(Numbers<float>(key.data(), py::reinterpret_borrow<py::array>(object))));
    } else {
      std::vector<float> numbers;
      append(key, object, numbers);
      use(std::span<const float>(numbers));
    }
  }

  /// Appends the numbers of lists in lists, of an array, or a single one.
  void append(std::string_view key, const py::handle& object, std::vector<float>& numbers, int depth = 0) const {
    if (depth > kMostNested) wrong(where(), "has lists that are nested without end as \"" + std::string(key) + "\"");
    if (numbers.size() > kMostNumbers) wrong(where(), "has too many numbers as \"" + std::string(key) + "\"");
    if (PyFloat_CheckExact(object.ptr())) {  // as cast() would, faster
      numbers.push_back(static_cast<float>(PyFloat_AS_DOUBLE(object.ptr())));
    } else if (PyBool_Check(object.ptr())) {
      numbers.push_back(object.ptr() == Py_True ? 1.0f : 0.0f);
    } else if (PyList_Check(object.ptr()) || PyTuple_Check(object.ptr())) {
      for (py::ssize_t i = 0; i < PySequence_Fast_GET_SIZE(object.ptr()); ++i) {  // an element may change the list
        append(key, py::reinterpret_borrow<py::object>(PySequence_Fast_GET_ITEM(object.ptr(), i)), numbers, depth + 1);
      }
    } else if (py::isinstance<py::array>(object)) {
      with_numbers(key, object, [&](auto all) { numbers.insert(numbers.end(), all.begin(), all.end()); });
    } else {
      numbers.push_back(cast<float>(key, object));
    }
  }

  /// Throws InputError, which names the entry. The text of a string_view lives as long as the object.
  template <class T>
  T cast(std::string_view key, const py::handle& object) const {
    if constexpr (std::is_convertible_v<T, std::string_view>) {
      py::ssize_t size = 0;
      const char* const text = PyUnicode_Check(object.ptr()) ? PyUnicode_AsUTF8AndSize(object.ptr(), &size) : nullptr;
      if (text != nullptr) return T(text, static_cast<std::size_t>(size));
      PyErr_Clear();
    } else {
      try {
        return object.cast<T>();
      } catch (const py::cast_error&) {
      }
    }
    wrong(where(), "has " + value_text(object) + " as \"" + std::string(key) + "\"; expected " + kind_of<T>());
  }

 private:
  template <class T>
  static std::string kind_of() {
    if constexpr (std::is_convertible_v<T, std::string_view>) return "text";
    if constexpr (std::is_same_v<T, bool>) return "true or false";
    return "a number";
  }

  py::dict dict_;
  std::string_view owner_, part_;
  std::vector<PyObject*> read_;  // keys, each once
};

/// Reads the parts of a description that refer to each other by name.
class Reader {
 public:
  RigDescription read(const py::dict& description) {
    Entries rig(description, "the rig");
    rig_.name = rig.get<std::string>("name", "");
    rig_.blender = rig.get<int>("blender");
    const py::handle world = rig.find("world");
    const bool moves = world && py::isinstance<py::str>(world);
    if (world && !moves) rig_.world = columns(rig, "world");
    check_rig_size(rig.sequence("bones").size(), rig.sequence("objects").size());
    read_matrices(rig);
    read_objects(rig);
    if (moves) rig_.place = matrix_named(rig.get<std::string>("world"), "the rig");
    read_values(rig);
    const py::tuple bones = rig.sequence("bones");
    rig_.bones.reserve(bones.size());
    for (std::size_t i = 0; i < bones.size(); ++i) name_bone(bones[i], i);
    for (std::size_t i = 0; i < bones.size(); ++i) read_bone(bones[i], i);
    for (const py::handle spline : rig.sequence("splines")) read_spline(spline);
    for (const py::handle constraint : rig.sequence("constraints")) read_constraint(constraint);
    for (const py::handle property : rig.sequence("properties")) read_property(property);
    for (const py::handle curve : rig.sequence("curves")) rig_.curves.push_back(animated_value(curve));
    read_nla(rig);
    for (const py::handle driver : rig.sequence("drivers")) read_driver(driver);
    rig_.refused = rig.get<std::vector<std::string>>("refused", {});
    rig.done({"name", "blender", "world", "matrices", "objects", "values", "bones", "constraints", "properties",
              "curves", "actions", "tracks", "mixed", "drivers", "splines", "refused"});
    return std::move(rig_);
  }

  static AnimatedValue animated_value(const py::handle& object) {
    Entries entries(object, "a curve");
    AnimatedValue value{{entries.get<std::string>("path"), entries.get<int>("index", 0)}, {}};
    value.curve = curve_of(entries);
    entries.done({"path", "index", "keys", "modifiers", "is_extrapolated", "is_free"});
    return value;
  }

 private:
  /// Matrices are rows in Python.
  static std::array<float, 16> columns(Entries& entries, const char* key) {
    const std::array<float, 16> rows = entries.numbers<16>(key);
    std::array<float, 16> result{};
    for (int i = 0; i < 16; ++i) result[i] = rows[(i % 4) * 4 + i / 4];
    return result;
  }

  static std::array<float, 9> columns3(Entries& entries, const char* key) {
    const std::array<float, 9> rows = entries.numbers<9>(key);
    std::array<float, 9> result{};
    for (int i = 0; i < 9; ++i) result[i] = rows[(i % 3) * 3 + i / 3];
    return result;
  }

  void read_matrices(Entries& rig) {
    for (const py::handle object : rig.sequence("matrices")) {
      Entries entries(object, "a matrix from outside");
      OutsideMatrix matrix{entries.get<std::string>("name"), {}};
      matrix.matrix = columns(entries, "matrix");
      entries.done({"name", "matrix"});
      matrices_.emplace(matrix.name, static_cast<int>(rig_.matrices.size()));
      rig_.matrices.push_back(std::move(matrix));
    }
  }

  /// After the matrices, to which each object adds its own.
  void read_objects(Entries& rig) {
    for (const py::handle entry : rig.sequence("objects")) {
      Entries entries(entry, "an object");
      ObjectDescription object{entries.get<std::string>("name"), static_cast<int>(rig_.matrices.size())};
      const py::handle parent = entries.find("parent");
      if (parent && !parent.is_none()) {
        const auto name = entries.cast<std::string>("parent", parent);
        const auto found = matrices_.find(name);
        if (found == matrices_.end()) {
          wrong(entries.where(), "names parent \"" + name + "\", which is neither a matrix nor an object before it");
        }
        object.parent = found->second;
      }
      if (entries.find("matrix_parent_inverse")) object.parent_inverse = columns(entries, "matrix_parent_inverse");
      object.rotation_mode = entries.choice("rotation_mode", kRotationModes, RotationMode::xyz);
      std::size_t place = 0;
      for (const RigSetting& setting : object_settings()) {
        for (int i = 0; i < setting.count; ++i) object.values[place++] = setting.initial;
      }
      for (const int deltas : {0, +kPoseBend}) object.values[deltas + kQuaternion] = 1;
      if (const py::handle found = entries.find("values")) {
        object.values = entries.numbers<kObjectValueCount>("values", found);
      }
      entries.done({"name", "parent", "matrix_parent_inverse", "rotation_mode", "values", "local", "basis"});
      const auto add_matrix = [&](const std::string& name) {
        const auto number = static_cast<int>(rig_.matrices.size());
        if (!matrices_.emplace(name, number).second) {
          wrong("object \"" + object.name + "\"", "has the name of a matrix; give each a name of its own");
        }
        rig_.matrices.push_back({name, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}});
        return number;
      };
      add_matrix(object.name);
      if (entries.find("local")) object.local = add_matrix(entries.get<std::string>("local"));
      if (entries.find("basis")) object.basis = add_matrix(entries.get<std::string>("basis"));
      rig_.objects.push_back(std::move(object));
    }
  }

  void read_values(Entries& rig) {
    for (const py::handle object : rig.sequence("values")) {
      Entries entries(object, "a value from outside");
      rig_.values.push_back({entries.get<std::string>("name"), entries.get<float>("value")});
      entries.done({"name", "value"});
    }
  }

  void name_bone(const py::handle& object, std::size_t index) {
    const std::string where = "bone " + std::to_string(index);
    Entries entries(object, where);
    names_.emplace(entries.get<std::string>("name"), static_cast<int>(index));
  }

  int bone_named(std::string_view name, std::string_view where) const {
    const auto found = names_.find(name);
    if (found == names_.end()) {
      wrong(std::string(where), "names bone \"" + std::string(name) + "\", which the rig does not have");
    }
    return found->second;
  }

  /// A bone's name or None.
  int optional_bone(Entries& entries, const char* key) const {
    const py::handle found = entries.find(key);
    if (!found || found.is_none()) return -1;
    return bone_named(entries.cast<std::string_view>(key, found), entries.owner());
  }

  void read_bone(const py::handle& object, std::size_t index) {
    const std::string where = "bone " + std::to_string(index);
    Entries entries(object, where);
    BoneDescription bone;
    bone.name = entries.get<std::string>("name");
    bone.parent = optional_bone(entries, "parent");
    bone.rest = columns(entries, "matrix_local");
    bone.rest_in_parent = columns3(entries, "matrix");
    bone.head = entries.numbers<3>("head");
    bone.head_in_armature = entries.numbers<3>("head_local");
    bone.tail_in_armature = entries.numbers<3>("tail_local");
    bone.length = entries.get<float>("length");
    bone.rotation_mode = entries.choice("rotation_mode", kRotationModes, RotationMode::quaternion);
    bone.inherit_scale = entries.choice("inherit_scale", kInheritScales, InheritScale::full);
    bone.inherits_rotation = entries.get<bool>("use_inherit_rotation", true);
    bone.uses_local_location = entries.get<bool>("use_local_location", true);
    bone.is_connected = entries.get<bool>("use_connect", false);
    bone.deforms = entries.get<bool>("use_deform", true);
    bone.has_constraints = entries.get<bool>("has_constraints", false);
    bone.segments = entries.get<int>("bbone_segments", 1);
    bone.handle_types = {entries.choice("bbone_handle_type_start", kHandleTypes, HandleType::automatic),
                         entries.choice("bbone_handle_type_end", kHandleTypes, HandleType::automatic)};
    bone.handles = {optional_bone(entries, "bbone_custom_handle_start"),
                    optional_bone(entries, "bbone_custom_handle_end")};
    bone.connected_child = optional_bone(entries, "connected_child");
    bone.handles_scale = {entries.get<std::array<bool, 3>>("bbone_handle_use_scale_start", {}),
                          entries.get<std::array<bool, 3>>("bbone_handle_use_scale_end", {})};
    bone.handles_ease = {entries.get<bool>("bbone_handle_use_ease_start", false),
                         entries.get<bool>("bbone_handle_use_ease_end", false)};
    bone.uses_end_roll = entries.get<bool>("use_endroll_as_inroll", false);
    bone.scales_ease = entries.get<bool>("use_scale_easing", false);
    bone.maps_curved = entries.choice("bbone_mapping_mode", kMappings, false);
    read_bone_values(entries, bone);
    entries.done({"name",
                  "parent",
                  "matrix_local",
                  "matrix",
                  "head",
                  "head_local",
                  "tail_local",
                  "length",
                  "rotation_mode",
                  "inherit_scale",
                  "use_inherit_rotation",
                  "use_local_location",
                  "use_connect",
                  "use_deform",
                  "has_constraints",
                  "bbone_segments",
                  "bbone_handle_type_start",
                  "bbone_handle_type_end",
                  "bbone_custom_handle_start",
                  "bbone_custom_handle_end",
                  "connected_child",
                  "bbone_handle_use_scale_start",
                  "bbone_handle_use_scale_end",
                  "bbone_handle_use_ease_start",
                  "bbone_handle_use_ease_end",
                  "use_endroll_as_inroll",
                  "use_scale_easing",
                  "bbone_mapping_mode",
                  "values"});
    rig_.bones.push_back(std::move(bone));
  }

  /// All numbers in the order of bone_settings().
  static void read_bone_values(Entries& entries, BoneDescription& bone) {
    std::size_t place = 0;
    for (const RigSetting& setting : bone_settings()) {
      for (int i = 0; i < setting.count; ++i) bone.values[place++] = setting.initial;
    }
    bone.values[kQuaternion] = 1;
    if (const py::handle found = entries.find("values"))
      bone.values = entries.numbers<kBoneValueCount>("values", found);
  }

  int matrix_named(const std::string& name, const std::string& where) const {
    const auto found = matrices_.find(name);
    if (found == matrices_.end()) {
      wrong(where, "looks at \"" + name + "\", which is not among the matrices from outside");
    }
    return found->second;
  }

  /// {"bone": name}, {"armature": true}, {"outside": name} or None.
  RigTarget target_of(const py::handle& object, const std::string& where) const {
    if (!object || object.is_none()) return {};
    Entries entries(object, where, ", a target,");
    RigTarget target;
    if (const py::handle bone = entries.find("bone")) {
      target = {RigTarget::Type::bone, bone_named(entries.cast<std::string_view>("bone", bone), where)};
    } else if (const py::handle outside = entries.find("outside")) {
      target = {RigTarget::Type::outside, matrix_named(entries.cast<std::string>("outside", outside), where)};
    } else if (entries.get<bool>("armature")) {
      target.type = RigTarget::Type::armature;
    }
    entries.done({"bone", "outside", "armature"});
    return target;
  }

  static ConstraintType constraint_type(const std::string& name, const std::string& where) {
    for (int i = 0; i < kConstraintTypeCount; ++i) {
      if (constraint_name(static_cast<ConstraintType>(i)) == name) return static_cast<ConstraintType>(i);
    }
    wrong(where, "is of type " + name + ", which is not computed");
  }

  int spline_named(const std::string& name, const std::string& where) const {
    const auto found = std::ranges::find(rig_.splines, name, &SplineDescription::name);
    if (found == rig_.splines.end()) wrong(where, "follows spline \"" + name + "\", which the rig does not have");
    return static_cast<int>(found - rig_.splines.begin());
  }

  void read_spline(const py::handle& object) {
    Entries entries(object, "a spline");
    SplineDescription spline;
    spline.name = entries.get<std::string>("name");
    const std::string where = "spline \"" + spline.name + "\"";
    const RigTarget place = target_of(entries.find("object"), where);
    if (place.type == RigTarget::Type::outside) spline.matrix = place.index;
    spline.is_poly = entries.choice("type", {0, {"BEZIER", "POLY"}}, false);
    spline.resolution = entries.get<int>("resolution_u", spline.resolution);
    spline.radius_interpolation = entries.choice("radius_interpolation", {0, {"LINEAR", "CARDINAL", "BSPLINE", "EASE"}},
                                                 RadiusInterpolation::linear);
    spline.radii = entries.get<std::string>("radii");
    for (const py::handle point : entries.sequence("points")) {
      Entries parts(point, where, ", a point,");
      spline.points.push_back(parts.numbers<9>("co"));
      spline.handles.push_back({parts.choice("handle_left_type", kSplineHandles, SplineHandle::free),
                                parts.choice("handle_right_type", kSplineHandles, SplineHandle::free)});
      parts.done({"co", "handle_left_type", "handle_right_type"});
    }
    spline.has_keys = entries.get<bool>("has_shape_keys", false);
    for (const py::handle object_of_key : entries.sequence("shape_keys")) {
      Entries parts(object_of_key, where, ", a shape key,");
      SplineKey key{parts.get<std::string>("value"), parts.get<int>("relative", -1), {}};
      std::vector<float> numbers;
      parts.append("points", parts.get("points"), numbers);
      if (numbers.size() % 10 != 0) wrong(parts.where(), "has points that are not of 10 numbers");
      key.points.resize(numbers.size() / 10);
      for (std::size_t i = 0; i < numbers.size(); ++i) key.points[i / 10][i % 10] = numbers[i];
      parts.done({"value", "relative", "points"});
      spline.keys.push_back(std::move(key));
    }
    for (const py::handle modifier : entries.sequence("hooks")) {
      Entries parts(modifier, where, ", a hook,");
      SplineHook hook;
      hook.target = target_of(parts.find("target"), where);
      hook.inverse = columns(parts, "matrix_inverse");
      hook.strength = parts.get<float>("strength", hook.strength);
      hook.points = parts.get<std::vector<int>>("handles", {});
      parts.done({"target", "matrix_inverse", "strength", "handles"});
      spline.hooks.push_back(std::move(hook));
    }
    entries.done({"name", "object", "type", "resolution_u", "radius_interpolation", "radii", "points", "has_shape_keys",
                  "shape_keys", "hooks"});
    rig_.splines.push_back(std::move(spline));
  }

  void read_constraint(const py::handle& object) {
    Entries entries(object, "a constraint");
    ConstraintDescription constraint;
    const auto bone = entries.get<std::string>("bone");
    constraint.name = entries.get<std::string>("name");
    const std::string where = "constraint \"" + constraint.name + "\" of bone \"" + bone + "\"";
    constraint.bone = bone_named(bone, where);
    constraint.type = constraint_type(entries.get<std::string>("type"), where);
    constraint.settings = settings_of(entries, constraint.type, where);
    for (const py::handle target : entries.sequence("targets")) constraint.targets.push_back(target_of(target, where));
    if (const py::handle weights = entries.find("weights")) entries.append("weights", weights, constraint.weights);
    constraint.space = target_of(entries.find("space"), where);
    for (const py::handle channel : entries.sequence("action")) {
      Entries curve(channel, where, ", its action,");
      constraint.action.push_back({curve.get<int>("channel"), curve_of(curve)});
      curve.done({"channel", "keys", "modifiers", "is_extrapolated", "is_free"});
    }
    if (entries.find("spline")) constraint.spline = spline_named(entries.get<std::string>("spline"), where);
    if (const py::handle joints = entries.find("joints")) entries.append("joints", joints, constraint.joints);
    entries.done({"bone", "name", "type", "settings", "targets", "weights", "space", "action", "spline", "joints"});
    rig_.constraints.push_back(std::move(constraint));
  }

  static std::vector<float> settings_of(Entries& constraint, ConstraintType type, const std::string& where) {
    std::vector<float> numbers;
    const py::handle given = constraint.find("settings");
    Entries entries(given ? given : py::handle(py::dict()), where, ", its settings,");
    for (const RigSetting& setting : constraint_settings(type)) {
      const std::size_t before = numbers.size();
      if (const py::handle found = entries.find(setting.name)) {
        entries.append(setting.name, found, numbers);
      } else {
        numbers.insert(numbers.end(), setting.count, setting.initial);
      }
      if (const std::size_t count = numbers.size() - before; static_cast<int>(count) != setting.count) {
        wrong(where, "has " + std::to_string(count) + " numbers as " + std::string(setting.name) + "; expected " +
                         std::to_string(setting.count));
      }
    }
    entries.done_with([&](std::string_view name) {
      return std::ranges::any_of(constraint_settings(type), [&](const RigSetting& each) { return each.name == name; });
    });
    return numbers;
  }

  void read_property(const py::handle& object) {
    Entries entries(object, "a property");
    CustomProperty property;
    property.path = entries.get<std::string>("path");
    property.kind = entries.choice("type", kValueKinds, ValueKind::real);
    property.low = entries.get<float>("min", property.low);
    property.high = entries.get<float>("max", property.high);
    entries.append("value", entries.get("value"), property.values);
    property.count = static_cast<int>(property.values.size());
    entries.done({"path", "type", "min", "max", "value"});
    rig_.properties.push_back(std::move(property));
  }

  /// Keys are rows: left handle, point and right handle, each as frame and value; amplitude, period, back;
  /// interpolation and easing as Blender numbers them.
  static void add_keys(const Entries& entries, std::span<const float> numbers, CurveDescription& curve) {
    constexpr std::size_t kColumns = 11;
    if (numbers.size() % kColumns != 0) {
      wrong(entries.where(),
            "has " + std::to_string(numbers.size()) + " numbers as \"keys\"; expected 11 for each key");
    }
    curve.keys.reserve(numbers.size() / kColumns);
    for (std::size_t i = 0; i < numbers.size(); i += kColumns) {
      const float* row = numbers.data() + i;
      CurveKey key;
      std::copy_n(row, 2, key.left);
      std::copy_n(row + 2, 2, key.point);
      std::copy_n(row + 4, 2, key.right);
      key.amplitude = row[6];
      key.period = row[7];
      key.back = row[8];
      if (!(row[9] >= 0 && row[9] < kInterpolations.size())) wrong(entries.where(), "has an unknown interpolation");
      if (!(row[10] >= 0 && row[10] <= 3)) wrong(entries.where(), "has an unknown easing");
      key.interpolation = kInterpolations[static_cast<std::size_t>(row[9])];
      key.easing = static_cast<KeyEasing>(row[10]);
      curve.keys.push_back(key);
    }
  }

  static CurveDescription curve_of(Entries& entries) {
    CurveDescription curve;
    const py::handle keys = entries.find("keys");
    if (keys)
      entries.with_numbers("keys", keys, [&](std::span<const float> numbers) { add_keys(entries, numbers, curve); });
    curve.is_extrapolated = entries.get<bool>("is_extrapolated", false);
    curve.is_free = entries.get<bool>("is_free", false);
    for (const py::handle modifier : entries.sequence("modifiers")) curve.modifiers.push_back(modifier_of(modifier));
    return curve;
  }

  static CurveModifier modifier_of(const py::handle& object) {
    Entries entries(object, "a modifier of a curve");
    CurveModifier modifier;
    modifier.type = entries.choice("type", kModifierTypes, CurveModifier::Type::cycles);
    modifier.before = entries.choice("mode_before", kCycleModes, CycleMode::none);
    modifier.after = entries.choice("mode_after", kCycleModes, CycleMode::none);
    modifier.cycles_before = entries.get<int>("cycles_before", 0);
    modifier.cycles_after = entries.get<int>("cycles_after", 0);
    modifier.is_additive = entries.get<bool>("use_additive", false);
    if (const py::handle list = entries.find("coefficients")) {
      entries.append("coefficients", list, modifier.coefficients);
    }
    modifier.is_factorised = entries.get<bool>("is_factorised", false);
    modifier.function = entries.choice("function_type", kFunctions, CurveFunction::sine);
    const auto read = [&](const char* key, float& number) { number = entries.get<float>(key, number); };
    read("amplitude", modifier.amplitude);
    read("phase_multiplier", modifier.phase_multiplier);
    read("phase_offset", modifier.phase_offset);
    read("value_offset", modifier.value_offset);
    read("reference_value", modifier.reference);
    read("default_min", modifier.envelope_low);
    read("default_max", modifier.envelope_high);
    read("frame_step", modifier.step);
    read("frame_offset", modifier.step_offset);
    read("influence", modifier.influence);
    read("blend_in", modifier.blend_in);
    read("blend_out", modifier.blend_out);
    modifier.least_frame = entries.get_if<float>("min_x");
    modifier.most_frame = entries.get_if<float>("max_x");
    modifier.least_value = entries.get_if<float>("min_y");
    modifier.most_value = entries.get_if<float>("max_y");
    modifier.first_stepped = entries.get_if<float>("first_stepped");
    modifier.last_stepped = entries.get_if<float>("last_stepped");
    if (entries.find("range")) {
      const std::array<float, 2> range = entries.numbers<2>("range");
      modifier.has_range = true;
      modifier.range_start = range[0];
      modifier.range_end = range[1];
    }
    for (const py::handle point : entries.sequence("points")) {
      const std::array<float, 3> numbers = entries.numbers<3>("points", point);
      modifier.points.push_back({numbers[0], numbers[1], numbers[2]});
    }
    entries.done({"type",
                  "mode_before",
                  "mode_after",
                  "cycles_before",
                  "cycles_after",
                  "use_additive",
                  "coefficients",
                  "is_factorised",
                  "function_type",
                  "amplitude",
                  "phase_multiplier",
                  "phase_offset",
                  "value_offset",
                  "reference_value",
                  "default_min",
                  "default_max",
                  "frame_step",
                  "frame_offset",
                  "first_stepped",
                  "last_stepped",
                  "min_x",
                  "max_x",
                  "min_y",
                  "max_y",
                  "points",
                  "influence",
                  "range",
                  "blend_in",
                  "blend_out"});
    return modifier;
  }

  void read_nla(Entries& rig) {
    for (const py::handle object : rig.sequence("mixed")) {
      Entries entries(object, "a property that strips set");
      MixedPropertyDescription property;
      property.path = entries.get<std::string>("path");
      property.mix = entries.choice("mix", kMixes, PropertyMix::add);
      entries.append("default", entries.get("default"), property.defaults);
      entries.done({"path", "mix", "default"});
      rig_.mixed.push_back(std::move(property));
    }
    for (const py::handle object : rig.sequence("actions")) {
      Entries entries(object, "an action");
      const auto name = entries.get<std::string>("name");
      if (!actions_.emplace(name, static_cast<int>(rig_.actions.size())).second) {
        wrong("action \"" + name + "\"", "occurs twice; give each a name of its own");
      }
      std::vector<AnimatedValue>& curves = rig_.actions.emplace_back();
      for (const py::handle curve : entries.sequence("curves")) curves.push_back(animated_value(curve));
      entries.done({"name", "curves"});
    }
    for (const py::handle object : rig.sequence("tracks")) {
      Entries entries(object, "a track");
      rig_.tracks.push_back(strips_of(entries, 0));
      entries.done({"strips"});
    }
  }

  std::vector<StripDescription> strips_of(Entries& owner, int depth) {
    if (depth > kMostNested) wrong(owner.where(), "has strips that are nested without end");
    std::vector<StripDescription> strips;
    for (const py::handle object : owner.sequence("strips")) strips.push_back(strip_of(object, depth));
    return strips;
  }

  StripDescription strip_of(const py::handle& object, int depth) {
    Entries entries(object, "a strip");
    if (++strip_count_ > kMostStrips) wrong("the rig", "has more than " + std::to_string(kMostStrips) + " strips");
    StripDescription strip;
    strip.type = entries.choice("type", kStripTypes, StripType::clip);
    strip.start = entries.get<float>("frame_start");
    strip.end = entries.get<float>("frame_end");
    strip.action_start = entries.get<float>("action_frame_start", 0);
    strip.action_end = entries.get<float>("action_frame_end", 0);
    strip.scale = entries.get<float>("scale", 1);
    strip.repeat = entries.get<float>("repeat", 1);
    strip.blend_in = entries.get<float>("blend_in", 0);
    strip.blend_out = entries.get<float>("blend_out", 0);
    strip.blend = entries.choice("blend_type", kStripBlends, StripBlend::replace);
    strip.extrapolation = entries.choice("extrapolation", kExtrapolations, StripExtrapolation::hold);
    strip.is_reversed = entries.get<bool>("use_reverse", false);
    strip.is_muted = entries.get<bool>("mute", false);
    strip.keeps_frames = entries.get<bool>("keeps_frames", false);
    strip.is_time_cyclic = entries.get<bool>("use_animated_time_cyclic", false);
    strip.influence = entries.get_if<float>("influence");
    strip.time = entries.get_if<float>("strip_time");
    strip.influence_curve = optional_curve(entries, "influence_curve");
    strip.time_curve = optional_curve(entries, "time_curve");
    if (const py::handle found = entries.find("action")) {
      const auto name = entries.cast<std::string>("action", found);
      const auto action = actions_.find(name);
      if (action == actions_.end()) wrong("a strip", "plays action \"" + name + "\", which is not described");
      strip.action = action->second;
    }
    strip.strips = strips_of(entries, depth + 1);
    entries.done({"type",
                  "frame_start",
                  "frame_end",
                  "action_frame_start",
                  "action_frame_end",
                  "scale",
                  "repeat",
                  "blend_in",
                  "blend_out",
                  "blend_type",
                  "extrapolation",
                  "use_reverse",
                  "mute",
                  "keeps_frames",
                  "use_animated_time_cyclic",
                  "influence",
                  "strip_time",
                  "influence_curve",
                  "time_curve",
                  "action",
                  "strips"});
    return strip;
  }

  static CurveDescription optional_curve(Entries& owner, const char* key) {
    const py::handle found = owner.find(key);
    if (!found) return {};
    Entries parts(found, owner.owner(), ", its curve,");
    const CurveDescription curve = curve_of(parts);
    parts.done({"keys", "modifiers", "is_extrapolated", "is_free"});
    return curve;
  }

  void read_driver(const py::handle& object) {
    Entries entries(object, "a driver");
    DriverDescription driver;
    driver.value = {entries.get<std::string>("path"), entries.get<int>("index", 0)};
    const std::string where = "the driver of " + driver.value.path;
    driver.type = entries.choice("type", kDriverTypes, DriverType::scripted);
    driver.expression = entries.get<std::string>("expression", "");
    for (const py::handle variable : entries.sequence("variables")) {
      driver.variables.push_back(variable_of(variable, where));
    }
    driver.curve = optional_curve(entries, "curve");
    entries.done({"path", "index", "type", "expression", "variables", "curve"});
    rig_.drivers.push_back(std::move(driver));
  }

  /// Names of values from outside.
  static void read_angles(Entries& target, VariableTarget& written) {
    const py::tuple names = target.sequence("stored_angles");
    const bool has_euler = written.order >= RotationMode::xyz;
    if (names.size() != (has_euler ? 3 : 0)) {
      wrong(target.where(),
            "has " + std::to_string(names.size()) +
                " names as \"stored_angles\"; expected 3 if \"stored_mode\" has angles, otherwise none");
    }
    for (std::size_t i = 0; i < names.size(); ++i) {
      written.angles[i] = target.cast<std::string>("stored_angles", names[i]);
    }
  }

  VariableDescription variable_of(const py::handle& object, const std::string& where) const {
    Entries entries(object, where, ", a variable,");
    VariableDescription variable;
    variable.name = entries.get<std::string>("name");
    variable.type = entries.choice("type", kVariableTypes, VariableType::property);
    variable.path = entries.get<std::string>("path", "");
    variable.outside = entries.get<std::string>("outside", "");
    const py::tuple targets = entries.sequence("targets");
    if (targets.size() > variable.targets.size()) wrong(entries.where(), "has more than two targets");
    for (std::size_t i = 0; i < targets.size(); ++i) {
      Entries target(targets[i], where, ", a variable,");
      VariableTarget& written = variable.targets[i];
      written.target = target_of(target.find("target"), where);
      written.channel = target.choice("transform_type", kChannels, TransformChannel::location_x);
      written.space = target.choice("transform_space", kTransformSpaces, TransformSpace::world);
      written.rotation = target.choice("rotation_mode", kChannelRotations, ChannelRotation::automatic);
      written.order = target.choice("stored_mode", kRotationModes, RotationMode::quaternion);
      read_angles(target, written);
      target.done({"target", "transform_type", "transform_space", "rotation_mode", "stored_mode", "stored_angles"});
    }
    entries.done({"name", "type", "path", "outside", "targets"});
    return variable;
  }

  RigDescription rig_;
  struct Hash : std::hash<std::string_view> {
    using is_transparent = void;
  };
  std::unordered_map<std::string, int, Hash, std::equal_to<>> names_;
  std::unordered_map<std::string, int> matrices_;
  std::unordered_map<std::string, int> actions_;
  std::size_t strip_count_ = 0;
};

}  // namespace

RigDescription rig_description_of(const py::dict& description) { return Reader().read(description); }

py::dict rig_file(const std::filesystem::path& path) {
  const std::string expected = "; expected a rig as `sinew rig -o` writes it";
  py::object found;
  try {
    const py::object file = py::module_::import("io").attr("open")(path, "rb");
    const py::object bytes = file.attr("read")();
    file.attr("close")();
    found = py::module_::import("json").attr("loads")(bytes);
  } catch (py::error_already_set& error) {
    if (!error.matches(PyExc_OSError) && !error.matches(PyExc_ValueError) && !error.matches(PyExc_RecursionError))
      throw;
    throw InputError(std::string(py::str(error.value())) + expected);
  }
  if (!py::isinstance<py::dict>(found)) throw InputError("the file holds no JSON object" + expected);
  return found;
}

std::vector<AnimatedValue> animated_values_of(const py::list& rows) {
  std::vector<AnimatedValue> found;
  for (const py::handle row : py::tuple(rows)) found.push_back(Reader::animated_value(row));
  return found;
}

}  // namespace sinew::bindings
