#include "base/utf8.h"

#include <gtest/gtest.h>

#include "base/check.h"
#include "failures.h"

namespace sinew {
namespace {

TEST(Utf8, IsToldFromOtherBytes) {
  for (const char* text : {"", "abc\n\t", "größe", "骨", "🦴", "a\xC2\x80", "\xF4\x8F\xBF\xBF"}) {
    EXPECT_TRUE(is_utf8(text)) << text;
  }
  for (const char* bytes : {"gr\xF6\xDF"
                            "e",                                             // Latin-1
                            "\xC3",                                          // cut
                            "ab\xE9\xAA",                                    // cut
                            "\xE9\xAA\xAAx\x80",                             // a part without its beginning
                            "\xC0\xAF", "\xE0\x80\x80", "\xF0\x80\x80\x80",  // longer than need be
                            "\xED\xA0\x80",                                  // half of a UTF-16 pair
                            "\xF4\x90\x80\x80", "\xFF\xFE"}) {               // beyond the last letter
    EXPECT_FALSE(is_utf8(bytes)) << printable(bytes);
  }
}

TEST(Utf8, Latin1LettersHaveTheirNumbers) {
  EXPECT_EQ(utf8_from_latin1("gr\xF6\xDF"
                             "e \xE9\n"),
            "größe é\n");
  std::string all;
  for (int byte = 0; byte < 256; ++byte) all += static_cast<char>(byte);
  const std::string text = utf8_from_latin1(all);
  EXPECT_TRUE(is_utf8(text));
  EXPECT_EQ(text.size(), 128u + 2 * 128);
  EXPECT_TRUE(text.ends_with("ÿ"));
}

TEST(Utf8, MessagesCanBeShown) {
  EXPECT_EQ(printable("größe 骨"), "größe 骨");
  EXPECT_EQ(printable("gr\xF6\xDF"
                      "e\r\x7F"),
            "gr\\xf6\\xdf"
            "e\\x0d\\x7f");
  EXPECT_EQ(printable(std::string_view("2\0 \0", 4)), "2\\x00 \\x00");
  EXPECT_EQ(printable(printable("\xFF")), "\\xff");
  EXPECT_EQ(complaint([] { fail("a\xFF.bf: ", 3, "\xC3"); }), "a\\xff.bf: 3\\xc3");
}

TEST(Utf8, ExcerptsEndBetweenLetters) {
  std::string letters;
  for (int i = 0; i < 50; ++i) letters += "骨";
  EXPECT_EQ(excerpt(letters), '"' + letters.substr(0, 40 * 3) + '"');
  EXPECT_EQ(excerpt(std::string(100, '\xFF')).size(), 2u + 40 * 4);
  EXPECT_EQ(excerpt("two"), "\"two\"");
  EXPECT_EQ(excerpt(""), "\"\"");
}

}  // namespace
}  // namespace sinew
