#include "base/text.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <limits>
#include <system_error>

#ifndef __cpp_lib_to_chars  // LLVM's library cannot parse such numbers yet; the systems that use it have this
#include <locale.h>
#include <stdlib.h>
#ifdef __APPLE__
#include <xlocale.h>
#endif
#endif

namespace sinew {

std::string shown(const Path& path) {
  const std::u8string text = path.u8string();
  return {text.begin(), text.end()};
}

#ifdef __cpp_lib_to_chars

namespace {

/// Whether the absolute value of a decimal number that is not zero is less than one.
bool is_below_one(std::string_view word) {
  const std::size_t end = std::min(word.find_first_of("eE"), word.size());
  const auto point = static_cast<std::int64_t>(std::min(word.find('.'), end));
  const auto first = static_cast<std::int64_t>(word.find_first_of("123456789"));
  std::int64_t exponent = 0;
  if (end < word.size()) {
    const std::string_view digits = word.substr(end + (word[end + 1] == '+' ? 2 : 1));
    if (std::from_chars(digits.data(), digits.data() + digits.size(), exponent).ec != std::errc()) {
      return digits.front() == '-';
    }
  }
  const std::int64_t place = first < point ? point - first - 1 : point - first;  // of the first digit; 0: units
  return exponent < -place;
}

}  // namespace

template <class Real>
bool parse_real(std::string_view word, Real& number) {
  const char* const end = word.data() + word.size();
  const auto [parsed_to, error] = std::from_chars(word.data(), end, number);
  if (parsed_to != end) return false;
  if (error == std::errc::result_out_of_range) {  // too large or too small
    number = is_below_one(word) ? 0 : std::numeric_limits<Real>::infinity();
    if (word.starts_with('-')) number = -number;
    return true;
  }
  return error == std::errc();
}

#else

template <class Real>
bool parse_real(std::string_view word, Real& number) {
  // Numbers that are not decimal, leading blanks and a plus sign are not accepted.
  if (word.starts_with('+') || word.find_first_not_of("0123456789.eE+-") != word.npos) return false;
  static const locale_t kPointIsDot = newlocale(LC_ALL_MASK, "C", nullptr);
  const std::string text(word);
  char* end = nullptr;
  if constexpr (std::is_same_v<Real, float>) {
    number = strtof_l(text.c_str(), &end, kPointIsDot);
  } else {
    number = strtod_l(text.c_str(), &end, kPointIsDot);
  }
  return !text.empty() && end == text.c_str() + text.size();
}

#endif

template bool parse_real(std::string_view, float&);
template bool parse_real(std::string_view, double&);

std::string read_file(const Path& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) fail("there is no file ", shown(path));
  if (std::filesystem::is_directory(path, error)) {
    fail(shown(path), " is a folder; expected a file");
  }
  const auto size = std::filesystem::file_size(path, error);
  if (error) fail(shown(path), " cannot be read: ", error.message());
  std::ifstream stream(path, std::ios::binary);
  if (!stream) fail(shown(path), " cannot be read: ", std::strerror(errno));
  std::string bytes(size, '\0');
  stream.read(bytes.data(), static_cast<std::streamsize>(size));
  if (stream.gcount() != static_cast<std::streamsize>(size)) {
    fail(shown(path), " cannot be read to its end");
  }
  return bytes;
}

void skip_byte_order_mark(const Path& path, std::string_view& text) {
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF")) {
    fail(shown(path.filename()), " is UTF-16 text; save it as UTF-8");
  }
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

std::string_view next_word(std::string_view& text) {
  const auto separates = [](char c) { return is_blank(c) || c == '\n'; };
  std::size_t begin = 0;
  while (begin < text.size() && separates(text[begin])) ++begin;
  std::size_t end = begin;
  while (end < text.size() && !separates(text[end])) ++end;
  const std::string_view word = text.substr(begin, end - begin);
  text.remove_prefix(end);
  return word;
}

LineReader::LineReader(const Path& path) : path_(path), bytes_(read_file(path)), unread_(bytes_) {
  skip_byte_order_mark(path, unread_);
  if (!is_utf8(unread_)) unread_ = bytes_ = utf8_from_latin1(unread_);
}

bool LineReader::next_line() {
  if (unread_.empty()) return false;
  const std::size_t end = std::min(unread_.find('\n'), unread_.size());
  line_ = rest_ = unread_.substr(0, end);
  unread_.remove_prefix(std::min(end + 1, unread_.size()));
  ++line_number_;
  return true;
}

}  // namespace sinew
