#include "base/text.h"

#include <gtest/gtest.h>

#include <bit>
#include <fstream>

#include "failures.h"
#include "files.h"

namespace sinew {
namespace {

template <class T>
std::string parsed(std::string_view word) {
  T number{};
  if (!parse_number(word, number)) return "no";
  std::string text;
  append_number(text, number);
  return text;
}

TEST(Text, NumbersAreWholeWordsAndFinite) {
  EXPECT_EQ(parsed<double>("+1.5"), "1.5");
  EXPECT_EQ(parsed<double>("-2e3"), "-2000");
  EXPECT_EQ(parsed<double>(".5"), "0.5");
  EXPECT_EQ(parsed<float>("0.1"), "0.1");
  EXPECT_EQ(parsed<std::int32_t>("+7"), "7");
  for (const char* word :
       {"", "+", "-", "+-5", "++5", "1.5x", "1,5", "nan", "-inf", "infinity", "1e400", "-1e5000", "0x10", "abc"}) {
    EXPECT_EQ(parsed<double>(word), "no") << word;
  }
  for (const char* word : {"1.5", "1e3", "99999999999", "x"}) {
    EXPECT_EQ(parsed<std::int32_t>(word), "no") << word;
  }
  EXPECT_EQ(parsed<float>("1e39"), "no");
  EXPECT_EQ(parsed<double>("1e+99999999999999999999"), "no");
  EXPECT_EQ(parsed<double>(std::string(400, '7')), "no");
  EXPECT_EQ(parsed<double>(std::string(800, '7') + "e-400"), "no");
}

TEST(Text, NumbersTooSmallForTheTypeAreZero) {
  EXPECT_EQ(parsed<float>("1e-60"), "0");
  EXPECT_EQ(parsed<float>("-1e-60"), "-0");
  EXPECT_EQ(parsed<double>("1e-400"), "0");
  EXPECT_EQ(parsed<double>("1e-5000"), "0");
  EXPECT_EQ(parsed<double>("-1.5E-99999999999999999999"), "-0");
  EXPECT_EQ(parsed<double>("0." + std::string(400, '0') + "1"), "0");
  EXPECT_EQ(parsed<double>("0." + std::string(800, '0') + "1e+400"), "0");
  EXPECT_EQ(parsed<double>("0." + std::string(400, '0') + "1e400"), "0.1");
  EXPECT_EQ(parsed<double>("0e99999999999999999999"), "0");
  EXPECT_EQ(parsed<double>("5e-324"), "5e-324");
  EXPECT_EQ(parsed<float>("1e-45"), "1e-45");
}

TEST(Text, WordsAndTrimming) {
  std::string_view text = " \t a\r\n\n b ";
  EXPECT_EQ(next_word(text), "a");
  EXPECT_EQ(next_word(text), "b");
  EXPECT_EQ(next_word(text), "");
  EXPECT_EQ(trimmed(" \t a b\r"), "a b");
  EXPECT_EQ(trimmed(" \r"), "");
}

TEST(Text, LinesOfEverySystem) {
  const TemporaryFolder folder;
  LineReader file(folder.file("a",
                              "\xEF\xBB\xBF"
                              "1 x\r\n\r\n2 y z\n3"));
  ASSERT_TRUE(file.next_line());
  EXPECT_EQ(file.number<int>("a number"), 1);
  EXPECT_EQ(file.word(), "x");
  EXPECT_EQ(file.word(), "");
  ASSERT_TRUE(file.next_line());
  EXPECT_EQ(file.word(), "");
  ASSERT_TRUE(file.next_line());
  EXPECT_EQ(file.word(), "2");
  EXPECT_EQ(trimmed(file.rest()), "y z");
  ASSERT_TRUE(file.next_line());
  EXPECT_EQ(file.line(), "3");
  EXPECT_FALSE(file.next_line());
  EXPECT_EQ(file.name(), "a");
}

TEST(Text, LinesOfEveryEncoding) {
  const TemporaryFolder folder;
  LineReader latin1(folder.file("a",
                                "1 gr\xF6\xDF"
                                "e\n"));
  latin1.next_line();
  EXPECT_EQ(latin1.line(), "1 größe");
  LineReader utf8(folder.file("b", "1 größe\n"));
  utf8.next_line();
  EXPECT_EQ(utf8.line(), "1 größe");
  EXPECT_EQ(complaint([&] {
              LineReader(folder.file("c.bf", std::string("\xFF\xFE"
                                                         "1\0",
                                                         4)));
            }),
            "c.bf is UTF-16 text; save it as UTF-8");
}

TEST(Text, NumbersThatAreNoneAreNamedWithTheirLine) {
  const TemporaryFolder folder;
  LineReader file(folder.file("a.bf", "1\nx" + std::string(100, 'y') + "\n"));
  file.next_line();
  EXPECT_EQ(file.number<double>("a weight"), 1);
  EXPECT_EQ(complaint([&] { file.number<double>("a weight"); }),
            "a.bf, line 1: the line ends where a weight is expected");
  file.next_line();
  EXPECT_EQ(complaint([&] { file.number<double>("a weight"); }),
            "a.bf, line 2: expected a weight, found \"x" + std::string(39, 'y') + "\"");
}

TEST(Text, ReadFileGivesTheBytes) {
  const TemporaryFolder folder;
  const std::string bytes("a\r\n\0\xFF", 5);
  EXPECT_EQ(read_file(folder.file("a", bytes)), bytes);
  EXPECT_EQ(read_file(folder.file("b", "")), "");
}

TEST(Text, ReadFileSaysWhyItCannot) {
  const TemporaryFolder folder;
  const std::string path = folder.path("a").string();
  EXPECT_EQ(complaint([&] { read_file(path); }), "there is no file " + path);
  EXPECT_EQ(complaint([&] { read_file(folder.path()); }), folder.path().string() + " is a folder; expected a file");
}

TEST(Text, FilesMayHaveNamesOfAnyLanguage) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / u8"größe-骨.bf";
  EXPECT_TRUE(complaint([&] { read_file(path); }).ends_with("größe-骨.bf"));
  std::ofstream(path, std::ios::binary) << "bytes";
  EXPECT_EQ(read_file(path), "bytes");
}

TEST(Text, NamingPutsTheFileInFront) {
  EXPECT_EQ(naming("/x/a.bf", [] { return 3; }), 3);
  EXPECT_EQ(complaint([] { naming("/x/a.bf", [] { fail("wrong"); }); }), "a.bf: wrong");
}

TEST(Text, NumbersAreWrittenSoThatTheyReadBack) {
  for (const double number : {0.1, -1.0 / 3, 1e300, 5e-324, -0.0, 123456789.0}) {
    std::string text;
    append_number(text, number);
    double back = 7;
    ASSERT_TRUE(parse_number(text, back)) << text;
    EXPECT_EQ(std::bit_cast<std::uint64_t>(back), std::bit_cast<std::uint64_t>(number)) << text;
  }
}

}  // namespace
}  // namespace sinew
