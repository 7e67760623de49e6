/// Reads a rig's objects by tables. A row of a table has an entry's name and where it goes; what is not there keeps the default
/// of its member, and an entry that no row has is a mistake.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <unordered_map>
#include <vector>

#include "base/text.h"
#include "sinew/json.h"
#include "sinew/rig_description.h"

namespace sinew::entries {

/// What is read, for messages: "bone 3", or "spline "Rail"" and ", a point,".
struct Where {
  std::string_view owner, part = {};
};

struct Entry {
  const Json& json;
  std::string_view name;
  Where where;
};

template <class... Parts>
[[noreturn]] void wrong(const Where& where, const Parts&... parts) {
  fail(where.owner, where.part, " ", parts...);
}

/// As messages call it.
inline std::string described(const Json& json) {
  if (const auto* other = json.get<Json::Other>()) return other->text;
  if (const auto* text = json.get<std::string>()) return excerpt(*text);
  if (const auto* flag = json.get<bool>()) return *flag ? "true" : "false";
  if (json.get<std::monostate>()) return "null";
  if (json.get<Json::Entries>()) return "a dictionary";
  const auto* number = json.get<double>();
  if (number == nullptr) return "a list";
  std::string text;
  append_number(text, *number);
  return text;
}

[[noreturn]] inline void unexpected(const Entry& entry, const Json& found, const char* expected) {
  wrong(entry.where, "has ", described(found), " as \"", entry.name, "\"; expected ", expected);
}

inline const std::string& text_of(const Entry& entry) {
  const auto* text = entry.json.get<std::string>();
  if (text == nullptr) unexpected(entry, entry.json, "text");
  return *text;
}

inline double number_of(const Entry& entry, const char* expected = "a number") {
  if (const auto* number = entry.json.get<double>()) return *number;
  if (const auto* flag = entry.json.get<bool>()) return *flag ? 1 : 0;
  unexpected(entry, entry.json, expected);
}

/// Calls `use` with each element.
template <class Use>
void for_each(const Entry& entry, const Use& use) {
  if (const auto* list = entry.json.get<Json::List>()) {
    for (const Json& item : *list) use(item);
  } else if (const auto* numbers = entry.json.get<std::vector<float>>()) {
    for (const float number : *numbers) use(Json{static_cast<double>(number)});
  } else {
    wrong(entry.where, "has no list as \"", entry.name, "\"");
  }
}

inline std::size_t count_of(const Entry& entry) {
  std::size_t count = 0;
  for_each(entry, [&](const Json&) { ++count; });
  return count;
}

/// Appends a single number, or those of lists in lists.
inline void append_numbers(const Entry& entry, const Json& json, std::vector<float>& numbers) {
  if (const auto* several = json.get<std::vector<float>>()) {
    numbers.insert(numbers.end(), several->begin(), several->end());
  } else if (const auto* list = json.get<Json::List>()) {
    for (const Json& item : *list) append_numbers(entry, item, numbers);
  } else if (json.get<double>() || json.get<bool>()) {
    numbers.push_back(static_cast<float>(number_of({json, entry.name, entry.where})));
  } else {
    unexpected(entry, json, "a number");
  }
}

inline std::vector<float> numbers_of(const Entry& entry) {
  std::vector<float> numbers;
  append_numbers(entry, entry.json, numbers);
  return numbers;
}

/// Copies `count` numbers.
inline void read_numbers(const Entry& entry, float* numbers, std::size_t count) {
  const auto* several = entry.json.get<std::vector<float>>();
  const std::vector<float> collected = several != nullptr ? std::vector<float>() : numbers_of(entry);
  const std::vector<float>& found = several != nullptr ? *several : collected;
  if (found.size() != count) {
    wrong(entry.where, "has ", found.size(), " numbers as \"", entry.name, "\"; expected ", count);
  }
  std::copy(found.begin(), found.end(), numbers);
}

/// An object whose entries are looked for one by one, each once.
class Object {
 public:
  Object(const Json& json, const Where& where) : entries_(json.get<Json::Entries>()), where_(where) {
    if (entries_ == nullptr) wrong(where, "is not a dictionary");
  }

  const Json* find(std::string_view name) {
    const std::size_t count = entries_->size();
    for (std::size_t i = 0; i < count; ++i) {  // most files have the order of the table
      const std::size_t at = next_ + i < count ? next_ + i : next_ + i - count;
      const Json::Entry& entry = (*entries_)[at];
      if (entry.name != name) continue;
      next_ = at + 1;
      ++found_;
      return &entry.json;
    }
    return nullptr;
  }

  /// Throws InputError if there is an entry that was not found.
  template <class IsKnown>
  void check_all_found(const IsKnown& is_known) const {
    if (found_ == entries_->size()) return;
    for (auto entry = entries_->begin(); entry != entries_->end(); ++entry) {
      const auto is_same = [&](const auto& other) { return other.name == entry->name; };
      if (!is_known(entry->name)) wrong(where_, "has \"", entry->name, "\", which is unknown");
      if (std::any_of(entries_->begin(), entry, is_same)) wrong(where_, "has \"", entry->name, "\" twice");
    }
  }

 private:
  const Json::Entries* entries_;
  Where where_;
  std::size_t found_ = 0, next_ = 0;
};

using Places = std::unordered_map<std::string, int>;

/// What has been read, for the entries that name other parts of it.
struct Reader {
  RigDescription rig;
  Places bones, matrices, actions;
  std::string owner;  ///< for messages: constraint "Follow" of bone "Hand"
};

template <class Owner>
struct Row {
  std::string_view name;
  void (*read)(Reader& reader, const Entry& entry, Owner& owner);
  bool is_needed = false;
};
inline constexpr bool kNeeded = true;

/// Has `rows` and, for messages, `name` or, in an owner that the reader names, `part`. It may have `inner`: a member whose
/// own table has more rows of the same object.
template <class Owner>
struct Table;

template <class Owner>
concept HasTable = requires {
  Table<Owner>::rows;
};
template <class Owner>
concept HasInner = requires {
  Table<Owner>::inner;
};

/// Has an overload of `names` for each enumeration: its names in the order of its values, with blanks between them.
template <class Enum>
struct NamesOf {};

template <class Owner>
void read_rows(Reader& reader, Object& object, const Where& where, Owner& owner) {
  for (const Row<Owner>& row : Table<Owner>::rows) {
    const Json* const found = object.find(row.name);
    if (found != nullptr) {
      row.read(reader, {*found, row.name, where}, owner);
    } else if (row.is_needed) {
      wrong(where, "has no \"", row.name, "\"");
    }
  }
  if constexpr (HasInner<Owner>) read_rows(reader, object, where, owner.*Table<Owner>::inner);
}

template <class Owner>
bool is_known(std::string_view name) {
  if constexpr (HasInner<Owner>) {
    if (is_known<std::remove_reference_t<decltype(std::declval<Owner>().*Table<Owner>::inner)>>(name)) return true;
  }
  return std::ranges::find(Table<Owner>::rows, name, &Row<Owner>::name) != std::end(Table<Owner>::rows);
}

template <class Owner>
void read_object(Reader& reader, const Json& json, const Where& where, Owner& owner) {
  Object object(json, where);
  read_rows(reader, object, where, owner);
  object.check_all_found(is_known<Owner>);
}

inline void read(Reader&, const Entry& entry, bool& flag) { flag = number_of(entry, "true or false") != 0; }

inline void read(Reader&, const Entry& entry, float& number) { number = static_cast<float>(number_of(entry)); }

inline void read(Reader&, const Entry& entry, int& number) {
  const double found = number_of(entry, "a whole number");
  if (!(std::abs(found) < 0x1p31 && found == std::floor(found))) unexpected(entry, entry.json, "a whole number");
  number = static_cast<int>(found);
}

inline void read(Reader&, const Entry& entry, std::optional<float>& number) {
  number = static_cast<float>(number_of(entry));
}

inline void read(Reader&, const Entry& entry, std::string& text) { text = text_of(entry); }

inline void read(Reader&, const Entry& entry, std::vector<float>& numbers) { numbers = numbers_of(entry); }

inline void read(Reader&, const Entry& entry, std::vector<std::string>& texts) {
  for_each(entry, [&](const Json& item) { texts.push_back(text_of({item, entry.name, entry.where})); });
}

template <std::size_t N>
void read(Reader&, const Entry& entry, std::array<float, N>& numbers) {
  read_numbers(entry, numbers.data(), N);
}

template <std::size_t N>
void read(Reader&, const Entry& entry, std::array<bool, N>& flags) {
  std::array<float, N> numbers{};
  read_numbers(entry, numbers.data(), N);
  std::ranges::transform(numbers, flags.begin(), [](float number) { return number != 0; });
}

template <class Enum>
requires std::is_enum_v<Enum>
void read(Reader&, const Entry& entry, Enum& choice) {
  const std::string& name = text_of(entry);
  constexpr std::string_view known = names(NamesOf<Enum>());
  int number = std::is_same_v<Enum, RotationMode> ? static_cast<int>(RotationMode::axis_angle) : 0;
  for (std::string_view rest = known, word; !(word = next_word(rest)).empty(); ++number) {
    choice = static_cast<Enum>(number);
    if (word == name) return;
  }
  std::string expected;
  for (const char letter : known) expected.append(letter == ' ' ? ", " : std::string(1, letter));
  wrong(entry.where, "has \"", entry.name, "\": \"", name, "\"; expected one of ", expected);
}

/// A part of its own.
template <HasTable Part>
void read(Reader& reader, const Entry& entry, Part& part) {
  read_object(reader, entry.json, {entry.where.owner, Table<Part>::part}, part);
}

template <HasTable Item>
void read(Reader& reader, const Entry& entry, std::vector<Item>& items) {
  for_each(entry, [&](const Json& item) {
    if constexpr (requires { Table<Item>::name; }) {
      read_object(reader, item, {Table<Item>::name}, items.emplace_back());
    } else {
      read_object(reader, item, {reader.owner, Table<Item>::part}, items.emplace_back());
    }
  });
}

/// A row's function that reads a member.
template <auto member, class Owner>
void into(Reader& reader, const Entry& entry, Owner& owner) {
  read(reader, entry, owner.*member);
}

/// That reads one of several.
template <auto member, std::size_t index, class Owner>
void into_item(Reader& reader, const Entry& entry, Owner& owner) {
  read(reader, entry, (owner.*member)[index]);
}

/// That reads a matrix, whose rows a file has and whose columns a member.
template <auto member, class Owner>
void into_matrix(Reader&, const Entry& entry, Owner& owner) {
  auto& columns = owner.*member;
  constexpr std::size_t side = std::tuple_size_v<std::remove_reference_t<decltype(columns)>> == 16 ? 4 : 3;
  std::array<float, side * side> rows{};
  read_numbers(entry, rows.data(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) columns[i] = rows[(i % side) * side + i / side];
}

}  // namespace sinew::entries
