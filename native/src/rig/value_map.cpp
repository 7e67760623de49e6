#include "rig/value_map.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "base/check.h"

namespace sinew::rig {
namespace {

/// Reads ["..."] at the beginning of `text` and takes it away. Returns nothing if it is not there.
bool take_quoted(std::string_view& text, std::string& name) {
  if (!text.starts_with("[\"")) return false;
  const std::size_t special = std::min(text.find_first_of("\\\"", 2), text.size());
  name.assign(text, 2, special - 2);
  for (std::size_t i = special; i + 1 < text.size(); ++i) {
    if (text[i] == '\\') {
      ++i;
      const std::size_t letter = std::string_view("nrtabf").find(text[i]);
      name += letter == std::string_view::npos ? text[i] : "\n\r\t\a\b\f"[letter];
    } else if (text[i] == '"') {
      if (text[i + 1] != ']') return false;
      text.remove_prefix(i + 2);
      return true;
    } else {
      name += text[i];
    }
  }
  return false;
}

bool take(std::string_view& text, std::string_view prefix) {
  if (!text.starts_with(prefix)) return false;
  text.remove_prefix(prefix.size());
  return true;
}

std::string as_key(std::string_view name) {
  std::string text = "[\"";
  for (const char c : name) {
    if (c == '"' || c == '\\') text += '\\';
    text += c;
  }
  return text + "\"]";
}

/// A custom property's path as it is looked up: double quotes, and no dot before a bracket.
std::string plain_path(std::string_view path) {
  if (path.find('\'') == path.npos && path.find(".[") == path.npos) return std::string(path);
  std::string plain;
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (path[i] == '.' && i + 1 < path.size() && path[i + 1] == '[') continue;
    const bool opens = path[i] == '\'' && i > 0 && path[i - 1] == '[';
    const bool closes = path[i] == '\'' && i + 1 < path.size() && path[i + 1] == ']';
    plain += opens || closes ? '"' : path[i];
  }
  return plain;
}

/// Finds a setting by name among those before (or from) a place.
template <class Accept>
int place_of_setting(std::span<const RigSetting> settings, std::string_view name, int& count, const Accept& accept) {
  int place = 0;
  for (const RigSetting& setting : settings) {
    if (setting.name == name && accept(place)) {
      count = setting.count;
      return place;
    }
    place += setting.count;
  }
  return -1;
}

int count_of(std::span<const RigSetting> settings) {
  int count = 0;
  for (const RigSetting& setting : settings) count += setting.count;
  return count;
}

std::string constraint_key(int bone, std::string_view name) { return std::to_string(bone) + " " + std::string(name); }

}  // namespace

ValueMap::ValueMap(const RigDescription& description) {
  const auto append = [&](float value, const RigSetting& setting) {
    if (!std::isfinite(value)) {
      fail("the rig has ", value, " as a value of ", setting.name, "; expected a finite number");
    }
    values_.push_back({value, setting.low, setting.high, setting.kind});
  };
  const auto append_all = [&](std::span<const RigSetting> settings, std::span<const float> numbers) {
    std::size_t at = 0;
    for (const RigSetting& setting : settings) {
      for (int i = 0; i < setting.count; ++i) append(numbers[at++], setting);
    }
  };
  values_.reserve(description.bones.size() * kBoneValueCount);
  for (const BoneDescription& bone : description.bones) {
    const int number = static_cast<int>(bone_names_.size());
    if (!bones_.emplace(bone.name, number).second) {
      fail("two bones are named \"", bone.name, "\"; give each a name of its own");
    }
    bone_names_.push_back(bone.name);
    append_all(bone_settings(), bone.values);
  }
  for (const ConstraintDescription& constraint : description.constraints) {
    const std::span<const RigSetting> settings = constraint_settings(constraint.type);
    if (static_cast<int>(constraint.settings.size()) != count_of(settings)) {
      fail("constraint \"", constraint.name, "\" has ", plural(constraint.settings.size(), "setting"), "; a ",
           constraint_name(constraint.type), " has ", count_of(settings));
    }
    constraints_.push_back(static_cast<int>(values_.size()));
    append_all(settings, constraint.settings);
    weights_.push_back(static_cast<int>(values_.size()));
    for (const float weight : constraint.weights) append(weight, {"weight", 1, ValueKind::real, 0, 1, 1});
    const int number = static_cast<int>(constraint_names_.size());
    constraint_places_.emplace(constraint_key(constraint.bone, constraint.name), number);
    constraint_names_.push_back(constraint.name);
    constraint_bones_.push_back(constraint.bone);
    types_.push_back(constraint.type);
    target_counts_.push_back(static_cast<int>(constraint.weights.size()));
  }
  for (const CustomProperty& property : description.properties) {
    const Found place{static_cast<int>(values_.size()), property.count};
    if (property.count < 1 || static_cast<int>(property.values.size()) != property.count) {
      fail("property ", property.path, " has ", plural(property.values.size(), "value"), " and a count of ",
           property.count, "; expected one value or more, and as many as the count says");
    }
    property_places_.emplace(plain_path(property.path), place);
    properties_.emplace_back(property.path, place.first);
    for (const float value : property.values) {
      append(value, {property.path, 1, property.kind, property.low, property.high, 0});
    }
  }
  for (const OutsideValue& outside : description.values) {
    outside_.emplace(outside.name, static_cast<int>(values_.size()));
    properties_.emplace_back(outside.name, static_cast<int>(values_.size()));
    append(outside.value, {.name = outside.name});
  }
  for (const ObjectDescription& object : description.objects) {
    objects_.push_back(static_cast<int>(values_.size()));
    for (const RigSetting& setting : object_settings()) {
      const std::string path = "objects" + as_key(object.name) + "." + std::string(setting.name);
      const Found place{static_cast<int>(values_.size()), setting.count};
      property_places_.emplace(path, place);
      properties_.emplace_back(path, place.first);
      const auto at = object.values.begin() + (place.first - objects_.back());
      append_all({&setting, 1}, {at, static_cast<std::size_t>(setting.count)});
    }
  }
}

int ValueMap::bone_named(std::string_view name) const {
  const auto found = bones_.find(std::string(name));
  return found == bones_.end() ? -1 : found->second;
}

ValueMap::Found ValueMap::find_in_bone(std::string_view name, std::string_view rest, bool is_of_armature) const {
  const int bone = bone_named(name);
  if (bone < 0) return {};
  Found found;
  if (!is_of_armature && take(rest, ".constraints")) {
    std::string constraint_name;
    if (!take_quoted(rest, constraint_name) || !take(rest, ".")) return {};
    const auto place = constraint_places_.find(constraint_key(bone, constraint_name));
    if (place == constraint_places_.end()) return {};
    const int constraint = place->second;
    if (take(rest, "targets[")) {
      int target = -1;
      const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), target);
      if (error != std::errc() || target < 0 || target >= target_counts_[constraint]) return {};
      rest.remove_prefix(end - rest.data());
      return rest == "].weight" ? Found{weights_[constraint] + target, 1} : Found{};
    }
    const int setting =
        place_of_setting(constraint_settings(types_[constraint]), rest, found.count, [](int) { return true; });
    if (setting >= 0) found.first = constraints_[constraint] + setting;
    return found;
  }
  if (!take(rest, ".")) return {};
  const int setting = place_of_setting(bone_settings(), rest, found.count,
                                       [&](int place) { return (place >= kArmatureValues) == is_of_armature; });
  if (setting >= 0) found.first = first_of_bone(bone) + setting;
  return found;
}

ValueMap::Found ValueMap::find(std::string_view path) const {
  const std::string plain = plain_path(path);
  std::string_view rest = plain;
  const bool is_of_armature = take(rest, "data.bones");
  if (is_of_armature || take(rest, "pose.bones")) {
    std::string name;
    if (take_quoted(rest, name)) {
      const Found found = find_in_bone(name, rest, is_of_armature);
      if (found.first >= 0) return found;
    }
  }
  const auto property = property_places_.find(plain);
  return property == property_places_.end() ? Found{} : property->second;
}

int ValueMap::find_element(std::string_view path) const {
  const Found whole = find(path);
  if (whole.first >= 0) return whole.count == 1 ? whole.first : -1;
  if (path.ends_with(']') && !path.ends_with("\"]") && !path.ends_with("']")) {
    const std::size_t bracket = path.rfind('[');
    if (bracket == std::string_view::npos) return -1;
    int index = -1;
    std::from_chars(path.data() + bracket + 1, path.data() + path.size(), index);
    const Found found = find(path.substr(0, bracket));
    return found.first >= 0 && index >= 0 && index < found.count ? found.first + index : -1;
  }
  if (path.size() > 2 && path[path.size() - 2] == '.') {
    const Found found = find(path.substr(0, path.size() - 2));
    const std::size_t index = std::string_view(found.count == 4 ? "wxyz" : "xyz").find(path.back());
    if (found.first >= 0 && found.count > 1 && index != std::string_view::npos) {
      return found.first + static_cast<int>(index);
    }
  }
  return -1;
}

bool ValueMap::is_of_constraint(int value) const {
  const auto after_bones = static_cast<int>(bone_names_.size()) * kBoneValueCount;
  return value >= after_bones && (properties_.empty() || value < properties_.front().second);
}

int ValueMap::find_outside(std::string_view name) const {
  const auto found = outside_.find(std::string(name));
  return found == outside_.end() ? -1 : found->second;
}

namespace {

std::string setting_name(std::span<const RigSetting> settings, int place) {
  for (const RigSetting& setting : settings) {
    if (place < setting.count) {
      return std::string(setting.name) + (setting.count > 1 ? "[" + std::to_string(place) + "]" : "");
    }
    place -= setting.count;
  }
  return "?";
}

}  // namespace

std::string ValueMap::name(int value) const {
  const int bone_values = static_cast<int>(bone_names_.size()) * kBoneValueCount;
  if (value < bone_values) {
    const int place = value % kBoneValueCount;
    return (place < kArmatureValues ? "pose.bones" : "data.bones") + as_key(bone_names_[value / kBoneValueCount]) +
           "." + setting_name(bone_settings(), place);
  }
  const auto property = std::upper_bound(properties_.begin(), properties_.end(), value,
                                         [](int number, const auto& entry) { return number < entry.second; });
  if (property != properties_.begin()) {
    const auto& [path, first] = *std::prev(property);
    const auto place = property_places_.find(plain_path(path));
    const bool is_array = place != property_places_.end() && place->second.count > 1;
    return is_array ? path + "[" + std::to_string(value - first) + "]" : path;
  }
  const auto next = std::upper_bound(constraints_.begin(), constraints_.end(), value);
  const auto constraint = static_cast<std::size_t>(next - constraints_.begin() - 1);
  const std::string owner = "pose.bones" + as_key(bone_names_[constraint_bones_[constraint]]) + ".constraints" +
                            as_key(constraint_names_[constraint]) + ".";
  if (value >= weights_[constraint]) {
    return owner + "targets[" + std::to_string(value - weights_[constraint]) + "].weight";
  }
  return owner + setting_name(constraint_settings(types_[constraint]), value - constraints_[constraint]);
}

std::vector<std::pair<std::string, ValueMap::Found>> ValueMap::properties() const {
  std::vector<std::pair<std::string, Found>> found;
  for (int value = 0; value < static_cast<int>(values_.size());) {
    std::string path = name(value);
    Found place = find(path);
    constexpr std::string_view kFirst = "[0]";
    if (place.first != value && path.ends_with(kFirst)) {
      const std::string whole = path.substr(0, path.size() - kFirst.size());
      place = find(whole);
      if (place.first == value) path = whole;
    }
    if (place.first != value) place = {find_outside(path), 1};
    if (place.first == value) found.emplace_back(path, place);  // otherwise another has the same name
    value += place.first == value ? place.count : 1;
  }
  return found;
}

}  // namespace sinew::rig
