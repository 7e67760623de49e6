/// Error messages: turns a caller's mistake into one sentence.
#pragma once

#include <concepts>
#include <span>
#include <string>
#include <string_view>

#include "base/utf8.h"
#include "sinew/types.h"

namespace sinew {

/// A piece of a message: a text that lives until the message is written, or a number.
class MessagePart {
 public:
  MessagePart(std::string_view text) : text_(text) {}
  MessagePart(const std::string& text) : text_(text) {}
  MessagePart(const char* text) : text_(text) {}
  MessagePart(char letter) : letter_(letter), kind_(Kind::letter) {}
  MessagePart(std::floating_point auto number) : real_(number), kind_(Kind::real) {}
  MessagePart(std::signed_integral auto number) : signed_(number), kind_(Kind::signed_number) {}
  MessagePart(std::unsigned_integral auto number) : unsigned_(number), kind_(Kind::unsigned_number) {}

  void append_to(std::string& message) const;

 private:
  enum class Kind { text, letter, real, signed_number, unsigned_number };
  union {
    std::string_view text_;
    char letter_;
    double real_;
    long long signed_;
    unsigned long long unsigned_;
  };
  Kind kind_ = Kind::text;
};

/// Throws InputError with the parts written one after the other, reals with six digits. The message is UTF-8 whatever
/// they hold.
[[noreturn]] void fail_with(std::span<const MessagePart> parts);

template <class... Parts>
[[noreturn]] void fail(const Parts&... parts) {
  const MessagePart all[] = {MessagePart(parts)...};
  fail_with(all);
}

/// Formats a number with thousands separators: 29960 -> "29,960".
std::string grouped(long long number);

/// Returns count and noun: "1 row", "29,960 rows"; "entry" becomes "entries" (but "key" "keys"),
/// "vertex" and "matrix" become "vertices" and "matrices".
std::string plural(long long number, std::string noun);

/// Throws InputError unless low <= value <= high.
template <class Value>
void check_range(const char* name, Value value, double low, double high) {
  if (value >= low && value <= high) return;
  if (high < 1000) fail(name, " is ", value, "; expected ", low, " to ", high);
  fail(name, " is ", value, "; expected ", low, " to ", grouped(static_cast<long long>(high)));
}

}  // namespace sinew
