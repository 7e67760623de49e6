/// Reading text and binary files, with errors that tell where.
#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/check.h"

namespace sinew {

using Path = std::filesystem::path;

/// Returns the path for a message, as UTF-8 on every system.
std::string shown(const Path& path);

/// Reads the whole file as bytes. Throws InputError, naming the file, if it cannot be read.
std::string read_file(const Path& path);

/// Rethrows an InputError of `build()` with the file's name in front.
template <class Build>
auto naming(const Path& path, const Build& build) {
  try {
    return build();
  } catch (const InputError& error) {
    fail(shown(path.filename()), ": ", error.what());
  }
}

/// Returns the shortest decimal form that reads back as the same number.
template <class T>
void append_number(std::string& text, T number) {
  char buffer[32];
  const auto result = std::to_chars(buffer, buffer + sizeof buffer, number);
  text.append(buffer, result.ptr);
}

inline bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

/// Removes the byte order mark that some editors put before UTF-8 text. Throws InputError, naming the
/// file, if the mark is that of UTF-16.
void skip_byte_order_mark(const Path& path, std::string_view& text);

/// Returns the text without the blanks at both ends.
std::string_view trimmed(std::string_view text);

/// Splits off the next word of `text`; empty at the end. Line feeds separate words, too.
std::string_view next_word(std::string_view& text);

/// Reads a text file line by line and word by word, as UTF-8; text that is not UTF-8 is taken as Latin-1.
class LineReader {
 public:
  explicit LineReader(const Path& path);

  /// Goes to the next line. False at the end of the file.
  bool next_line();

  /// The current line without its end.
  std::string_view line() const { return line_; }
  /// The next word of the current line; empty at its end.
  std::string_view word() { return next_word(rest_); }
  /// The rest of the current line.
  std::string_view rest() const { return rest_; }

  /// Returns the next word as a number; `what` describes the expected number in error messages.
  template <class T>
  T number(const char* what);

  /// Throws InputError with the file's name and the number of the current line before the parts.
  template <class... Parts>
  [[noreturn]] void fail_here(const Parts&... parts) const {
    fail(shown(path_.filename()), ", line ", line_number_, ": ", parts...);
  }

  std::string name() const { return shown(path_.filename()); }
  std::size_t byte_count() const { return bytes_.size(); }

 private:
  Path path_;
  std::string bytes_;
  std::string_view unread_;
  std::string_view line_;
  std::string_view rest_;
  std::int64_t line_number_ = 0;
};

/// Parses the whole word, which must not begin with a plus sign. Returns false if it is not a number;
/// a number out of range becomes zero or infinite. For float and double.
template <class Real>
bool parse_real(std::string_view word, Real& number);

/// Parses the whole word. Returns false if it is not a number of this type, or not finite. A number
/// too small for the type becomes zero.
template <class T>
bool parse_number(std::string_view word, T& number) {
  if (word.starts_with('+')) {
    word.remove_prefix(1);
    if (word.starts_with('-')) return false;
  }
  if constexpr (std::is_floating_point_v<T>) {
    return parse_real(word, number) && std::isfinite(number);
  } else {
    const char* const end = word.data() + word.size();
    const auto result = std::from_chars(word.data(), end, number);
    return result.ec == std::errc() && result.ptr == end;
  }
}

template <class T>
T LineReader::number(const char* what) {
  const std::string_view text = word();
  T value{};
  if (text.empty()) fail_here("the line ends where ", what, " is expected");
  if (!parse_number(text, value)) {
    fail_here("expected ", what, ", found ", excerpt(text));
  }
  return value;
}

}  // namespace sinew
