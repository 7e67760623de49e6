/// Bytes of files as text, whatever their encoding.
#pragma once

#include <string>
#include <string_view>

namespace sinew {

bool is_utf8(std::string_view bytes);

/// Each byte is the letter with that number.
std::string utf8_from_latin1(std::string_view bytes);

/// For messages: UTF-8 without control characters. Each byte that is not a part of that becomes
/// `\x` and two digits.
std::string printable(std::string_view bytes);

/// For messages: at most the first 40 letters, printable, in quotation marks.
std::string excerpt(std::string_view bytes);

}  // namespace sinew
