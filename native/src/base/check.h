/// Error messages: turns a caller's mistake into one sentence.
#pragma once

#include <sstream>
#include <string>

#include "base/utf8.h"
#include "sinew/types.h"

namespace sinew {

/// Throws InputError with the parts written one after the other. The message is UTF-8 whatever they hold.
template <class... Parts>
[[noreturn]] void fail(const Parts&... parts) {
  std::ostringstream message;
  (message << ... << parts);
  throw InputError(printable(message.str()));
}

/// Formats a number with thousands separators: 29960 -> "29,960".
inline std::string grouped(long long number) {
  std::string digits = std::to_string(number);
  const std::size_t first = digits.front() == '-' ? 1 : 0;
  for (std::size_t at = digits.size(); at > first + 3;) {
    at -= 3;
    digits.insert(at, ",");
  }
  return digits;
}

/// Returns count and noun: "1 row", "29,960 rows"; "entry" becomes "entries" (but "key" "keys"),
/// "vertex" and "matrix" become "vertices" and "matrices".
inline std::string plural(long long number, std::string noun) {
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

/// Throws InputError unless low <= value <= high.
template <class Value>
void check_range(const char* name, Value value, double low, double high) {
  if (value >= low && value <= high) return;
  if (high < 1000) fail(name, " is ", value, "; expected ", low, " to ", high);
  fail(name, " is ", value, "; expected ", low, " to ", grouped(static_cast<long long>(high)));
}

}  // namespace sinew
