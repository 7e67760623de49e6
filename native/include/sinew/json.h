/// Values as JSON has them.
#pragma once

#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace sinew {

/// null, a switch, a number, text, a list or an object.
struct Json {
  using List = std::vector<Json>;
  struct Entry;
  using Entries = std::vector<Entry>;  ///< of an object, in their order
  /// What JSON does not have; as messages call it.
  struct Other {
    std::string text;
  };

  /// A list of numbers alone, however they are nested, is kept as these numbers: see JsonList.
  std::variant<std::monostate, bool, double, std::string, std::vector<float>, List, Entries, Other> value;

  template <class T>
  const T* get() const {
    return std::get_if<T>(&value);
  }
};

struct Json::Entry {
  std::string name;
  Json json;
};

/// Makes a list.
class JsonList {
 public:
  void add(Json item);
  Json done() &&;

 private:
  std::vector<float> numbers_;
  Json::List items_;  // as soon as one of them is no number
};

/// How deep lists and objects may be nested.
inline constexpr int kMostNested = 64;

/// Reads UTF-8 text as RFC 8259 has it, and NaN, Infinity and -Infinity, which Python writes. Numbers are rounded to
/// float64, in lists to float32. Throws InputError, with line and column, for anything else.
Json parse_json(std::string_view text);

}  // namespace sinew
