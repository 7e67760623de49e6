#include "base/utf8.h"

#include <algorithm>
#include <cstdint>

namespace sinew {
namespace {

constexpr std::size_t kMostLetters = 40;

bool is_ascii(char c) { return static_cast<unsigned char>(c) < 0x80; }

bool is_control(char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; }

/// Returns how many bytes the first character has, 1 to 4; 0 if the text does not begin with one.
std::size_t letter_length(std::string_view text) {
  if (text.empty()) return 0;
  if (is_ascii(text[0])) return 1;
  const auto first = static_cast<unsigned char>(text[0]);
  const std::size_t length = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4 || text.size() < length) return 0;
  std::uint32_t letter = first & (0xFFu >> (length + 1));
  for (std::size_t i = 1; i < length; ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    if (byte >> 6 != 2) return 0;
    letter = letter << 6 | (byte & 0x3F);
  }
  const std::uint32_t least = length == 4 ? 0x10000 : length == 3 ? 0x800 : 0x80;
  const bool is_surrogate = letter >= 0xD800 && letter < 0xE000;
  return letter < least || letter > 0x10FFFF || is_surrogate ? 0 : length;
}

}  // namespace

bool is_utf8(std::string_view bytes) {
  while (true) {
    bytes.remove_prefix(std::ranges::find_if_not(bytes, is_ascii) - bytes.begin());
    if (bytes.empty()) return true;
    const std::size_t length = letter_length(bytes);
    if (length == 0) return false;
    bytes.remove_prefix(length);
  }
}

std::string utf8_from_latin1(std::string_view bytes) {
  std::string text;
  text.reserve(bytes.size());
  for (const char c : bytes) {
    const auto letter = static_cast<unsigned char>(c);
    if (is_ascii(c)) {
      text += c;
    } else {
      text += static_cast<char>(0xC0 | letter >> 6);
      text += static_cast<char>(0x80 | (letter & 0x3F));
    }
  }
  return text;
}

std::string printable(std::string_view bytes) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  while (!bytes.empty()) {
    const std::size_t length = is_control(bytes[0]) ? 0 : letter_length(bytes);
    if (length == 0) {
      const auto byte = static_cast<unsigned char>(bytes[0]);
      text.append({'\\', 'x', kDigits[byte >> 4], kDigits[byte & 15]});
    }
    text += bytes.substr(0, length);
    bytes.remove_prefix(std::max<std::size_t>(length, 1));
  }
  return text;
}

std::string excerpt(std::string_view bytes) {
  std::size_t end = 0;
  for (std::size_t letters = 0; letters < kMostLetters && end < bytes.size(); ++letters) {
    end += std::max<std::size_t>(letter_length(bytes.substr(end)), 1);
  }
  return '"' + printable(bytes.substr(0, end)) + '"';
}

}  // namespace sinew
