#include "base/check.h"

#include <charconv>
#include <iterator>

namespace sinew {

void MessagePart::append_to(std::string& message) const {
  switch (kind_) {
    case Kind::text:
      message += text_;
      break;
    case Kind::letter:
      message += letter_;
      break;
    case Kind::real: {
      char digits[32];
      message.append(digits, std::to_chars(digits, std::end(digits), real_, std::chars_format::general, 6).ptr);
      break;
    }
    case Kind::signed_number:
      message += std::to_string(signed_);
      break;
    case Kind::unsigned_number:
      message += std::to_string(unsigned_);
      break;
  }
}

void fail_with(std::span<const MessagePart> parts) {
  std::string message;
  for (const MessagePart& part : parts) part.append_to(message);
  throw InputError(printable(message));
}

std::string grouped(long long number) {
  std::string digits = std::to_string(number);
  const std::size_t first = digits.front() == '-' ? 1 : 0;
  for (std::size_t at = digits.size(); at > first + 3;) {
    at -= 3;
    digits.insert(at, ",");
  }
  return digits;
}

std::string plural(long long number, std::string noun) {
  if (number != 1) {
    if (noun.ends_with("y") && !noun.ends_with("ey")) {
      noun.replace(noun.size() - 1, 1, "ies");
    } else if (noun.ends_with("ex") || noun.ends_with("ix")) {
      noun.replace(noun.size() - 2, 2, "ices");
    } else {
      noun += "s";
    }
  }
  return grouped(number) + " " + noun;
}

}  // namespace sinew
