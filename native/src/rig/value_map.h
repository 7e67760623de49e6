/// Where each number of a rig is, by its path. Immutable once the rig is built.
#pragma once

#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "sinew/rig_description.h"

namespace sinew::rig {

/// The number's kind and limits, and what it is in the description.
struct ValueInfo {
  float initial = 0;
  float low = 0;
  float high = 0;
  ValueKind kind = ValueKind::real;
};

class ValueMap {
 public:
  ValueMap() = default;

  /// Lays out all numbers. Throws InputError for constraints and properties with too few or too many of them, for
  /// numbers that are not finite, and for two things with one name.
  explicit ValueMap(const RigDescription& description);

  const std::vector<ValueInfo>& values() const { return values_; }

  int first_of_bone(int bone) const { return bone * kBoneValueCount; }
  int first_of_constraint(int constraint) const { return constraints_[constraint]; }
  int first_weight(int constraint) const { return weights_[constraint]; }
  int first_of_object(int object) const { return objects_[object]; }

  /// Returns -1 if there is none.
  int bone_named(std::string_view name) const;

  /// The place of the first of a property's numbers, and how many it has; -1 and 0 for an unknown path.
  struct Found {
    int first = -1;
    int count = 0;
  };
  Found find(std::string_view path) const;

  /// All that find() and find_outside() find, by path.
  std::vector<std::pair<std::string, Found>> properties() const;

  /// As find(), but of one number of a property: `path` may end in [2] or .z.
  int find_element(std::string_view path) const;

  /// Returns -1 if there is none.
  int find_outside(std::string_view name) const;

  /// Whether a number is a setting of a constraint, or the weight of one of its targets.
  bool is_of_constraint(int value) const;

  void set_initial(int value, float number) { values_[value].initial = number; }

  /// The path of a number, with its index, for messages.
  std::string name(int value) const;

 private:
  Found find_in_bone(std::string_view name, std::string_view rest, bool is_of_armature) const;

  std::vector<ValueInfo> values_;
  std::vector<int> constraints_;
  std::vector<int> weights_;
  std::vector<int> objects_;
  std::vector<int> constraint_bones_;
  std::vector<ConstraintType> types_;
  std::vector<int> target_counts_;
  std::vector<std::string> bone_names_;
  std::vector<std::string> constraint_names_;
  std::vector<std::pair<std::string, int>> properties_;  ///< path and first number, in the order of the numbers
  std::unordered_map<std::string, int> bones_;
  std::unordered_map<std::string, Found> property_places_;
  std::unordered_map<std::string, int> outside_;
  std::unordered_map<std::string, int> constraint_places_;  ///< by bone's number and name
};

}  // namespace sinew::rig
