#include "rig/expression_parser.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "base/check.h"
#include "base/text.h"
#include "rig/expression_functions.h"

namespace sinew::rig {
namespace {

using Code = Expression::Code;
using Comparison = Expression::Comparison;
using Step = Expression::Step;

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool begins_name(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

constexpr std::array<std::pair<std::string_view, Comparison>, 6> kComparisons{{{"==", Comparison::equal},
                                                                               {"!=", Comparison::unequal},
                                                                               {"<", Comparison::less},
                                                                               {"<=", Comparison::less_or_equal},
                                                                               {">", Comparison::greater},
                                                                               {">=", Comparison::greater_or_equal}}};
constexpr std::array<std::string_view, 5> kWords{"and", "or", "not", "if", "else"};

/// Parses by recursive descent, one function for each level of precedence, the weakest first.
class Parser {
 public:
  Parser(std::string_view text, std::span<const std::string> names) : text_(text), names_(names) { next(); }

  std::vector<Step> parse() {
    choice();
    if (!token_.empty()) refuse();
    if (steps_.size() > std::numeric_limits<std::uint16_t>::max()) complain("it is too long");
    return std::move(steps_);
  }

 private:
  // value [if condition else choice]
  void choice() {
    const Nesting nesting(*this);
    const std::size_t begin = steps_.size();
    either();
    if (!took("if")) return;
    // The condition is computed before the value that stands in front of it.
    std::vector<Step> value(steps_.begin() + begin, steps_.end());
    steps_.resize(begin);
    --depth_;
    either();
    const std::size_t to_other = jump(Code::jump_if_false);
    --depth_;
    if (!took("else")) refuse();
    const auto shift = static_cast<std::ptrdiff_t>(steps_.size() - begin);
    for (Step& step : value) {
      if (is_jump(step)) step.operand = static_cast<std::uint16_t>(step.operand + shift);
    }
    steps_.insert(steps_.end(), value.begin(), value.end());
    const std::size_t to_end = jump(Code::jump);
    land(to_other);
    choice();
    land(to_end);
  }

  void either() {
    joined("or", Code::jump_if_true_keeping, [this] { both(); });
  }
  void both() {
    joined("and", Code::jump_if_false_keeping, [this] { negated(); });
  }

  template <class Operand>
  void joined(std::string_view word, Code code, const Operand& operand) {
    operand();
    std::vector<std::size_t> jumps;
    while (took(word)) {
      jumps.push_back(jump(code));
      --depth_;
      operand();
    }
    for (const std::size_t step : jumps) land(step);
  }

  void negated() {
    if (took("not")) {
      const Nesting nesting(*this);
      negated();
      steps_.push_back({.code = Code::invert});
    } else {
      compared();
    }
  }

  void compared() {
    sum();
    std::vector<std::size_t> jumps;
    for (std::optional<Comparison> found = took_comparison(); found;) {
      sum();
      --depth_;
      const std::optional<Comparison> following = took_comparison();
      if (following) jumps.push_back(steps_.size());
      steps_.push_back({.code = following ? Code::compare_chained : Code::compare, .comparison = *found});
      found = following;
    }
    for (const std::size_t step : jumps) land(step);
  }

  void sum() {
    product();
    for (;;) {
      const bool is_sum = took("+");
      if (!is_sum && !took("-")) return;
      product();
      combine(is_sum ? Code::add : Code::subtract);
    }
  }

  void product() {
    factor();
    for (;;) {
      const bool is_product = took("*");
      if (!is_product && !took("/")) return;
      factor();
      combine(is_product ? Code::multiply : Code::divide);
    }
  }

  void factor() {
    const Nesting nesting(*this);
    if (took("+")) return factor();
    if (took("-")) {
      factor();
      steps_.push_back({.code = Code::negate});
    } else if (took("(")) {
      choice();
      if (!took(")")) refuse();
    } else if (!token_.empty() && (is_digit(token_[0]) || token_[0] == '.')) {
      push({.code = Code::constant, .number = number()});
      next();
    } else if (!token_.empty() && begins_name(token_[0]) && std::ranges::find(kWords, token_) == kWords.end()) {
      name();
    } else {
      refuse();
    }
  }

  void name() {
    const std::string_view word = token_;
    next();
    const auto found = std::find(names_.rbegin(), names_.rend(), word);
    if (found != names_.rend()) {
      push({.code = Code::variable, .operand = static_cast<std::uint16_t>(names_.rend() - found - 1)});
    } else if (word == "frame") {
      push({.code = Code::frame});
    } else if (word == "pi") {
      push({.code = Code::constant, .number = std::numbers::pi});
    } else if (word == "True" || word == "False") {
      push({.code = Code::constant, .number = word == "True" ? 1.0 : 0.0});
    } else {
      call(word);
    }
  }

  void call(std::string_view word) {
    const bool is_lowest = word == "min";
    const std::span<const ExpressionFunction> functions = expression_functions();
    if (!is_lowest && word != "max" &&
        std::ranges::find(functions, word, &ExpressionFunction::name) == functions.end()) {
      complain("it does not know the name \"", word, "\"");
    }
    if (!took("(")) complain("\"", word, "\" has no arguments");
    int count = 0;
    if (!took(")")) {
      do {
        choice();
        ++count;
      } while (took(","));
      if (!took(")")) refuse();
    }
    depth_ -= count;
    if (is_lowest || word == "max") {
      if (count == 0) complain("\"", word, "\" has no arguments");
      push({.code = is_lowest ? Code::lowest : Code::highest, .operand = static_cast<std::uint16_t>(count)});
      return;
    }
    const auto function =
        std::ranges::find_if(functions, [&](const auto& each) { return each.name == word && each.arguments == count; });
    if (function == functions.end()) complain("\"", word, "\" cannot have ", plural(count, "argument"));
    push({.code = Code::function, .operand = static_cast<std::uint16_t>(function - functions.begin())});
  }

  double number() const {
    double value = 0;
    if (!parse_real(token_, value)) refuse();
    const bool is_zero = token_.substr(0, token_.find_first_of("eE")).find_first_of("123456789") == token_.npos;
    if (std::isinf(value) || (value == 0 && !is_zero)) complain("the number ", token_, " is too large or too small");
    return value;
  }

  // ---- steps

  /// Keeps the recursion and the stack within bounds.
  struct Nesting {
    explicit Nesting(Parser& owner) : parser(owner) {
      if (++owner.nesting_ > 4 * kExpressionDepth) owner.complain("it is nested too deeply");
    }
    ~Nesting() { --parser.nesting_; }
    Nesting(const Nesting&) = delete;
    Nesting& operator=(const Nesting&) = delete;
    Parser& parser;
  };

  void push(const Step& step) {
    if (++depth_ > kExpressionDepth) complain("it is nested too deeply");
    steps_.push_back(step);
  }
  void combine(Code code) {
    --depth_;
    steps_.push_back({.code = code});
  }
  std::size_t jump(Code code) {
    steps_.push_back({.code = code});
    return steps_.size() - 1;
  }
  void land(std::size_t step) { steps_[step].operand = static_cast<std::uint16_t>(steps_.size()); }
  static bool is_jump(const Step& step) { return step.code >= Code::jump || step.code == Code::compare_chained; }

  // ---- tokens

  bool took(std::string_view token) {
    if (token_ != token || token.empty()) return false;
    next();
    return true;
  }

  std::optional<Comparison> took_comparison() {
    for (const auto& [token, comparison] : kComparisons) {
      if (took(token)) return comparison;
    }
    return std::nullopt;
  }

  void next() {
    at_ += token_.size();
    while (at_ < text_.size() && is_space(text_[at_])) ++at_;
    token_ = text_.substr(at_, length());
  }

  std::size_t length() const {
    const std::string_view rest = text_.substr(at_);
    const auto run = [&](std::size_t from, auto belongs) {
      while (from < rest.size() && belongs(rest[from])) ++from;
      return from;
    };
    if (rest.empty()) return 0;
    if (begins_name(rest[0])) return run(0, [](char c) { return begins_name(c) || is_digit(c); });
    if (is_digit(rest[0]) || (rest[0] == '.' && rest.size() > 1 && is_digit(rest[1]))) {
      std::size_t end = run(0, is_digit);
      if (end < rest.size() && rest[end] == '.') end = run(end + 1, is_digit);
      if (end < rest.size() && (rest[end] == 'e' || rest[end] == 'E')) {
        std::size_t exponent = end + 1;
        if (exponent < rest.size() && (rest[exponent] == '+' || rest[exponent] == '-')) ++exponent;
        end = run(exponent, is_digit);
      }
      return end;
    }
    return rest.size() > 1 && rest[1] == '=' && std::string_view("=!<>").find(rest[0]) != std::string_view::npos ? 2
                                                                                                                 : 1;
  }

  // ---- errors

  [[noreturn]] void refuse() const {
    if (token_.empty()) complain("it ends too early");
    complain("\"", token_, "\" is not expected at character ", at_ + 1);
  }

  template <class... Parts>
  [[noreturn]] void complain(const Parts&... parts) const {
    fail("The expression \"", text_, "\" is not one of Blender's simple expressions: ", parts...,
         ". Write it with numbers, variables, + - * /, comparisons, and, or, not, if, else and Blender's functions.");
  }

  std::string_view text_;
  std::span<const std::string> names_;
  std::vector<Step> steps_;
  std::string_view token_;
  std::size_t at_ = 0;
  int depth_ = 0;
  int nesting_ = 0;
};

}  // namespace

std::vector<Step> parsed_expression(std::string_view text, std::span<const std::string> names) {
  return Parser(text, names).parse();
}

}  // namespace sinew::rig
