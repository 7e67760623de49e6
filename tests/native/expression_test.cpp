#include "rig/expression.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "failures.h"

namespace sinew::rig {
namespace {

const std::string kNames[] = {"a", "b", "var_2"};
constexpr float kInputs[] = {3, -2, 0};

double value(std::string_view text) {
  const Expression::Result result = Expression(text, kNames).value(kInputs, 24.5);
  EXPECT_FALSE(result.is_undefined) << text;
  return result.number;
}

bool is_undefined(std::string_view text) { return Expression(text, kNames).value(kInputs, 24.5).is_undefined; }

std::string refusal(std::string_view text) {
  return complaint([&] { Expression(text, kNames); });
}

TEST(Expression, ComputesAsPythonDoes) {
  const struct {
    const char* text;
    double expected;
  } cases[] = {
      {"a", 3},
      {" 1 + 2*a - b / 4 ", 7.5},
      {"-a - -b", -5},
      {"+-+a", -3},
      {"(1 + 2) * a", 9},
      {"1.5e2 + .5 + 2. + 1E-1", 152.6},
      {"frame + var_2", 24.5},
      {"pi", std::numbers::pi},
      {"True + True - False", 2},
      {"a == 3", 1},
      {"a != 3", 0},
      {"1 < a < 4", 1},
      {"1 < a < 3", 0},
      {"5 > a >= 3 > b", 1},
      {"4 > 5 > 1 / 0", 0},
      {"a and b", -2},
      {"var_2 and 1 / 0", 0},
      {"a or 1 / 0", 3},
      {"var_2 or b or 7", -2},
      {"not a", 0},
      {"not not b", 1},
      {"not a == 4", 1},
      {"1 if a > 2 else 2", 1},
      {"1 if a > 3 else 2 if b < 0 else 3", 2},
      {"(b if a < 0 else a if b < -5 else a * b) + 1", -5},
      {"(1 if a and b else 2) if a or b else 3", 1},
      {"1 / var_2 if var_2 else 9", 9},
      {"(a or b) and (1 if 2 < a < 4 or b else 5)", 1},
      {"min(a, b, 7)", -2},
      {"max(a, b, 7, 1)", 7},
      {"max(a)", 3},
      {"radians(180)", std::numbers::pi},
      {"degrees(pi)", 180},
      {"abs(b) + fabs(b)", 4},
      {"floor(-1.5) * 100 + ceil(-1.5) * 10 + trunc(-1.7)", -211},
      {"round(2.5) * 10 + int(2.9)", 32},
      {"sin(a)", std::sin(3.0)},
      {"cos(a)", std::cos(3.0)},
      {"tan(a)", std::tan(3.0)},
      {"asin(0.5)", std::asin(0.5)},
      {"acos(0.5)", std::acos(0.5)},
      {"atan(a)", std::atan(3.0)},
      {"atan2(a, b)", std::atan2(3.0, -2.0)},
      {"exp(a)", std::exp(3.0)},
      {"log(a)", std::log(3.0)},
      {"log(a, 10)", std::log(3.0) / std::log(10.0)},
      {"sqrt(a)", std::sqrt(3.0)},
      {"pow(a, b)", std::pow(3.0, -2.0)},
      {"fmod(b, 1.5)", -0.5},
      {"lerp(a, b, 0.25)", 1.75},
      {"clamp(a) + clamp(b)", 1},
      {"clamp(a, 5, 7)", 5},
      {"smoothstep(0, 2, 0.5)", 0.15625},
  };
  for (const auto& [text, expected] : cases) EXPECT_DOUBLE_EQ(value(text), expected) << text;
}

TEST(Expression, TheLastOfSeveralNamesCounts) {
  const std::string names[] = {"frame", "pi", "pi"};
  EXPECT_EQ(Expression("frame * 10 + pi", names).value(kInputs, 24.5).number, 30);
}

TEST(Expression, SaysWhereBlenderSwitchesTheDriverOff) {
  for (const char* text :
       {"1 / var_2", "var_2 / var_2", "log(0)", "log(-1)", "log(a, 1)", "sqrt(b)", "asin(a)", "acos(b)", "pow(0, b)",
        "pow(b, 0.5)", "fmod(a, 0)", "smoothstep(a, a, 1)", "sqrt(b) and 0", "1 if log(0) < 5 else 2"}) {
    EXPECT_TRUE(is_undefined(text)) << text;
  }
  EXPECT_FALSE(is_undefined("exp(1000)")) << "too large is not undefined";
  EXPECT_FALSE(is_undefined("pow(10, 400)"));
}

TEST(Expression, RefusesWhatIsNotSimple) {
  const std::string advice =
      ". Write it with numbers, variables, + - * /, comparisons, and, or, not, if, else and Blender's functions.";
  const auto simple = [&](const std::string& text, const std::string& reason) {
    return "The expression \"" + text + "\" is not one of Blender's simple expressions: " + reason + advice;
  };
  EXPECT_EQ(refusal("a ** 2"), simple("a ** 2", "\"*\" is not expected at character 4"));
  EXPECT_EQ(refusal("a % 2"), simple("a % 2", "\"%\" is not expected at character 3"));
  EXPECT_EQ(refusal("a +"), simple("a +", "it ends too early"));
  EXPECT_EQ(refusal(""), simple("", "it ends too early"));
  EXPECT_EQ(refusal("a b"), simple("a b", "\"b\" is not expected at character 3"));
  EXPECT_EQ(refusal("(a"), simple("(a", "it ends too early"));
  EXPECT_EQ(refusal("1 if a"), simple("1 if a", "it ends too early"));
  EXPECT_EQ(refusal("and"), simple("and", "\"and\" is not expected at character 1"));
  EXPECT_EQ(refusal("noise(a)"), simple("noise(a)", "it does not know the name \"noise\""));
  EXPECT_EQ(refusal("self.x"), simple("self.x", "it does not know the name \"self\""));
  EXPECT_EQ(refusal("sin"), simple("sin", "\"sin\" has no arguments"));
  EXPECT_EQ(refusal("min()"), simple("min()", "\"min\" has no arguments"));
  EXPECT_EQ(refusal("sin(a, b)"), simple("sin(a, b)", "\"sin\" cannot have 2 arguments"));
  EXPECT_EQ(refusal("1e"), simple("1e", "\"1e\" is not expected at character 1"));
  EXPECT_EQ(refusal("1e999"), simple("1e999", "the number 1e999 is too large or too small"));
  EXPECT_EQ(refusal("1e-999"), simple("1e-999", "the number 1e-999 is too large or too small"));
  EXPECT_EQ(refusal("0e-999"), "(no complaint)");
  const std::string deep = std::string(1000, '(') + "a" + std::string(1000, ')');
  EXPECT_EQ(refusal(deep), simple(deep, "it is nested too deeply"));
  std::string wide = "a";
  for (int i = 0; i < 80; ++i) wide = "a + (" + wide + ")";
  EXPECT_EQ(refusal(wide), simple(wide, "it is nested too deeply"));
  std::string long_one = "a";
  for (int i = 0; i < 40000; ++i) long_one += "+a";
  EXPECT_EQ(refusal(long_one), simple(long_one, "it is too long"));
}

}  // namespace
}  // namespace sinew::rig
