/// Converts bytes of files to text, whatever their encoding.
#pragma once

#include <string>
#include <string_view>

namespace sinew {

bool is_utf8(std::string_view bytes);

/// Converts each byte to the character with that number.
std::string utf8_from_latin1(std::string_view bytes);

/// For messages: returns UTF-8 without control characters. Every other byte becomes `\x` and two
/// digits.
std::string printable(std::string_view bytes);

/// For messages: returns at most the first 40 characters, printable, in quotation marks.
std::string excerpt(std::string_view bytes);

}  // namespace sinew
