#include "sinew/json.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <limits>
#include <utility>

#include "base/text.h"

namespace sinew {
namespace {

/// As UTF-8.
void append_character(std::string& text, std::uint32_t character) {
  const auto rest = [&](int shift) { text += static_cast<char>(0x80 | (character >> shift & 0x3F)); };
  if (character < 0x80) {
    text += static_cast<char>(character);
  } else if (character < 0x800) {
    text += static_cast<char>(0xC0 | character >> 6);
    rest(0);
  } else if (character < 0x10000) {
    text += static_cast<char>(0xE0 | character >> 12);
    rest(6), rest(0);
  } else {
    text += static_cast<char>(0xF0 | character >> 18);
    rest(12), rest(6), rest(0);
  }
}

bool is_json_number(std::string_view word) {
  const auto skip = [&](std::string_view characters) {
    const bool is_there = !word.empty() && characters.find(word.front()) != characters.npos;
    if (is_there) word.remove_prefix(1);
    return is_there;
  };
  const auto digits = [&] {
    std::size_t count = 0;
    while (skip("0123456789")) ++count;
    return count;
  };
  skip("-");
  const bool begins_with_zero = word.starts_with('0');
  const std::size_t whole = digits();
  if (whole == 0 || (begins_with_zero && whole > 1)) return false;
  if (skip(".") && digits() == 0) return false;
  if (skip("eE")) {
    skip("+-");
    if (digits() == 0) return false;
  }
  return word.empty();
}

class JsonParser {
 public:
  explicit JsonParser(std::string_view text) : text_(text) {}

  Json parse() {
    Json value = parse_value(0);
    if (next() != kEnd) wrong("expected the end");
    return value;
  }

 private:
  static constexpr char kEnd = '\0';

  [[noreturn]] void wrong(std::string_view what) const {
    const std::string_view before = text_.substr(0, at_), rest = text_.substr(at_);
    const auto line = 1 + std::ranges::count(before, '\n');
    const std::size_t column = before.size() - (before.rfind('\n') + 1) + 1;
    fail("line ", line, ", column ", column, ": ", what, ", found ", rest.empty() ? "the end" : excerpt(rest));
  }

  char here() const { return at_ < text_.size() ? text_[at_] : kEnd; }

  /// Skips blanks.
  char next() {
    at_ = std::min(text_.find_first_not_of(" \t\r\n", at_), text_.size());
    return here();
  }

  Json parse_value(int depth) {
    const char first = next();
    if (first == '"') return {parse_text()};
    if (first == '{' || first == '[') {
      if (depth == kMostNested) wrong("expected lists and objects that are nested less deeply");
      return first == '{' ? parse_object(depth) : parse_list(depth);
    }
    const std::size_t end = std::min(text_.find_first_not_of("0123456789+-.eE", at_), text_.size());
    const std::string_view word = text_.substr(at_, end - at_);
    if (double number = 0; is_json_number(word) && parse_real(word, number)) {
      at_ = end;
      return {number};
    }
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    static const std::pair<std::string_view, Json> words[] = {
        {"null", {}},
        {"true", {true}},
        {"false", {false}},
        {"NaN", {std::numeric_limits<double>::quiet_NaN()}},
        {"Infinity", {kInfinity}},
        {"-Infinity", {-kInfinity}},
    };
    for (const auto& [name, meant] : words) {
      if (!text_.substr(at_).starts_with(name)) continue;
      at_ += name.size();
      return meant;
    }
    wrong("expected a value");
  }

  /// Whether a list or an object that ends so has any items.
  bool begins(char end) {
    ++at_;
    if (next() != end) return true;
    ++at_;
    return false;
  }

  bool goes_on(char end) {
    const char found = next();
    if (found != ',' && found != end) wrong(std::string("expected , or ") + end);
    ++at_;
    return found == ',';
  }

  Json parse_list(int depth) {
    JsonList list;
    for (bool more = begins(']'); more; more = goes_on(']')) list.add(parse_value(depth + 1));
    return std::move(list).done();
  }

  Json parse_object(int depth) {
    Json::Entries entries;
    for (bool more = begins('}'); more; more = goes_on('}')) {
      if (next() != '"') wrong("expected a name in quotation marks");
      std::string name = parse_text();
      if (next() != ':') wrong("expected :");
      ++at_;
      entries.push_back({std::move(name), parse_value(depth + 1)});
    }
    return {std::move(entries)};
  }

  std::string parse_text() {
    std::string text;
    ++at_;
    while (here() != '"') {
      if (static_cast<unsigned char>(here()) < 0x20) wrong("expected the text to end with a quotation mark");
      if (here() == '\\') {
        append_escaped(text);
      } else {
        text += text_[at_++];
      }
    }
    ++at_;
    return text;
  }

  void append_escaped(std::string& text) {
    constexpr std::string_view kNames = R"("\/bfnrt)", kMeant = "\"\\/\b\f\n\r\t";
    ++at_;
    if (here() == 'u') {
      std::uint32_t character = parse_unit();
      if (character >= 0xD800 && character < 0xE000) {  // one of two halves
        const bool has_second = character < 0xDC00 && text_.substr(at_).starts_with("\\u");
        if (has_second) ++at_;
        const std::uint32_t second = has_second ? parse_unit() : 0;
        if (second < 0xDC00 || second >= 0xE000) wrong("expected the second half of a character");
        character = 0x10000 + (character - 0xD800) * 0x400 + (second - 0xDC00);
      }
      append_character(text, character);
    } else {
      const std::size_t place = kNames.find(here());
      if (place == kNames.npos) wrong("expected what \\ stands for");
      text += kMeant[place];
      ++at_;
    }
  }

  /// After a backslash: u and four digits.
  std::uint32_t parse_unit() {
    ++at_;
    std::uint32_t unit = 0;
    const std::string_view digits = text_.substr(at_, 4);
    const auto parsed = std::from_chars(digits.data(), digits.data() + digits.size(), unit, 16);
    if (digits.size() < 4 || parsed.ptr != digits.data() + 4) wrong("expected four hexadecimal digits");
    at_ += 4;
    return unit;
  }

  std::string_view text_;
  std::size_t at_ = 0;
};

}  // namespace

void JsonList::add(Json item) {
  if (items_.empty()) {
    const auto* const several = item.get<std::vector<float>>();
    if (several != nullptr && !several->empty()) {
      numbers_.insert(numbers_.end(), several->begin(), several->end());
      return;
    }
    const auto* const number = item.get<double>();
    const auto* const flag = item.get<bool>();
    if (number != nullptr || flag != nullptr) {
      numbers_.push_back(number != nullptr ? static_cast<float>(*number) : static_cast<float>(*flag));
      return;
    }
    for (const float each : numbers_) items_.push_back({static_cast<double>(each)});
    numbers_.clear();
  }
  items_.push_back(std::move(item));
}

Json JsonList::done() && {
  if (items_.empty()) return {std::move(numbers_)};
  return {std::move(items_)};
}

Json parse_json(std::string_view text) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  if (!is_utf8(text)) fail("the text is not UTF-8");
  return JsonParser(text).parse();
}

}  // namespace sinew
