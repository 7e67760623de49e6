#include "sinew/dmat.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <vector>

#include "failures.h"
#include "files.h"

namespace sinew {
namespace {

std::string raw(const std::vector<double>& numbers) {
  std::string bytes(numbers.size() * sizeof(double), '\0');
  std::memcpy(bytes.data(), numbers.data(), bytes.size());
  return bytes;
}

Eigen::MatrixXd table(std::initializer_list<std::initializer_list<double>> rows) { return Eigen::MatrixXd(rows); }

void expect_same_bits(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  ASSERT_EQ(a.rows(), b.rows());
  ASSERT_EQ(a.cols(), b.cols());
  const auto bits = [](double number) { return std::bit_cast<std::uint64_t>(number); };
  EXPECT_TRUE(
      std::equal(a.data(), a.data() + a.size(), b.data(), [&](double x, double y) { return bits(x) == bits(y); }));
}

class Dmat : public testing::Test {
 protected:
  Eigen::MatrixXd read(const std::string& bytes) { return read_dmat(folder_.file("a.dmat", bytes)); }
  std::string said(const std::string& bytes) {
    return complaint([&] { read(bytes); });
  }
  TemporaryFolder folder_;
};

TEST_F(Dmat, TextGoesColumnByColumn) { EXPECT_EQ(read("2 3\n1\n2\n3\n4\n5\n6\n"), table({{1, 4}, {2, 5}, {3, 6}})); }

TEST_F(Dmat, AnyWhiteSpaceSeparates) {
  const Eigen::MatrixXd expected = table({{1.5, -3}, {2, 4e-5}});
  EXPECT_EQ(read("2 2\r\n+1.5\r\n\r\n2\r\n-3\r\n4e-5\r\n"), expected);
  EXPECT_EQ(read("2\t2\n\n\n1.5 2\n\n -3\t4e-5"), expected);
  EXPECT_EQ(read("  2 2  \n1.5 2 -3 4e-5"), expected);
  EXPECT_EQ(read("\xEF\xBB\xBF"
                 "2 2\n1.5 2 -3 4e-5"),
            expected);
}

TEST_F(Dmat, BinaryHasASecondHeader) {
  const std::vector<double> numbers{1, 2, 3, 4, 5, -6e-300};
  const Eigen::MatrixXd expected = table({{1, 4}, {2, 5}, {3, -6e-300}});
  EXPECT_EQ(read("0 0\n2 3\n" + raw(numbers)), expected);
  EXPECT_EQ(read("0 0\r\n2 3\r\n" + raw(numbers)), expected);
}

TEST_F(Dmat, BinaryNumbersMayLookLikeLineEnds) {
  const std::vector<double> numbers{std::bit_cast<double>(0x0D0A0D0A0D0A0D0A),
                                    std::bit_cast<double>(0x2020202020202020)};
  const Eigen::MatrixXd matrix = read("0 0\n1 2\n" + raw(numbers));
  EXPECT_EQ(matrix(0, 0), numbers[0]);
  EXPECT_EQ(matrix(1, 0), numbers[1]);
}

TEST_F(Dmat, NothingIsAMatrixToo) {
  for (const auto& [bytes, rows, columns] : {std::tuple{"0 0\n", 0, 0},
                                             {"0 0", 0, 0},
                                             {"3 0\n", 0, 3},
                                             {"0 3\n", 3, 0},
                                             {"0 0\n0 0\n", 0, 0},
                                             {"0 0\n3 0\n", 0, 3}}) {
    const Eigen::MatrixXd matrix = read(bytes);
    EXPECT_EQ(matrix.rows(), rows) << bytes;
    EXPECT_EQ(matrix.cols(), columns) << bytes;
  }
}

TEST_F(Dmat, RoundTripsBitForBit) {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Random(37, 11);
  matrix(0, 0) = -0.0;
  matrix(1, 0) = std::numeric_limits<double>::denorm_min();
  matrix(2, 0) = std::numeric_limits<double>::max();
  matrix(3, 0) = -1.0 / 3;
  for (const bool binary : {false, true}) {
    for (const Eigen::MatrixXd& written :
         {matrix, Eigen::MatrixXd(0, 0), Eigen::MatrixXd(0, 4), Eigen::MatrixXd(4, 0)}) {
      write_dmat(folder_.path("a.dmat"), written, binary);
      expect_same_bits(read_dmat(folder_.path("a.dmat")), written);
    }
    const std::string bytes = folder_.bytes("a.dmat");
    EXPECT_EQ(bytes.starts_with("0 0\n"), binary);
  }
}

TEST_F(Dmat, WritesABlockOfALargerMatrix) {
  const Eigen::MatrixXd large = Eigen::MatrixXd::Random(9, 9);
  write_dmat(folder_.path("a.dmat"), large.block(2, 3, 4, 5));
  EXPECT_EQ(read_dmat(folder_.path("a.dmat")), large.block(2, 3, 4, 5));
}

TEST_F(Dmat, RefusesWhatIsNoFile) {
  EXPECT_EQ(complaint([&] { read_dmat(folder_.path("none.dmat")); }),
            "there is no file " + folder_.path("none.dmat").string());
  EXPECT_EQ(complaint([&] { read_dmat(folder_.path()); }), folder_.path().string() + " is a folder; expected a file");
  EXPECT_EQ(said(""), "a.dmat is empty; expected a first line `columns rows`");
}

TEST_F(Dmat, RefusesAHeaderThatIsNone) {
  const auto expected = [](const std::string& line) {
    return "a.dmat: expected a first line `columns rows`, found \"" + line + "\"";
  };
  for (const std::string line : {"2", "2 3 4", "-2 3", "2 -3", "2.5 3", "two three", ""}) {
    EXPECT_EQ(said(line + "\n1 2 3 4 5 6\n"), expected(line));
    EXPECT_EQ(said("0 0\n" + line + "\n" + raw({1, 2, 3, 4, 5, 6})), expected(line));
  }
  EXPECT_EQ(said(std::string(100, 'x')), expected(std::string(40, 'x')));
}

TEST_F(Dmat, RefusesAHeaderThatPromisesTooMuch) {
  EXPECT_EQ(said("50000 25000\n1 2 3 4\n"),
            "a.dmat ends after 4 numbers; its header promises 50,000 columns x 25,000 rows");
  EXPECT_EQ(said("0 0\n50000 25000\n1"),
            "a.dmat ends after 0 numbers; its header promises 50,000 columns x 25,000 rows");
  // Products beyond 64 bits.
  EXPECT_EQ(
      said("9223372036854775807 9223372036854775807\n1"),
      "a.dmat ends after 1 number; its header promises 9,223,372,036,854,775,807 columns x 9,223,372,036,854,775,807 "
      "rows");
  EXPECT_EQ(said("0 0\n4294967296 4294967296\n"),
            "a.dmat ends after 0 numbers; its header promises 4,294,967,296 columns x 4,294,967,296 rows");
}

TEST_F(Dmat, RefusesAHeaderThatPromisesNothingTooOften) {
  EXPECT_EQ(said("9223372036854775807 0\n"),
            "a.dmat declares 9,223,372,036,854,775,807 columns x 0 rows; expected at most "
            "2,147,483,647 of either");
  EXPECT_EQ(said("0 0\n0 2147483648\n"),
            "a.dmat declares 0 columns x 2,147,483,648 rows; expected at most 2,147,483,647 of either");
  EXPECT_EQ(read("2147483647 0\n").cols(), 2147483647);
}

TEST_F(Dmat, RefusesOtherTextThanUtf8) {
  const std::string sentence = "a.dmat is UTF-16 text; save it as UTF-8";
  EXPECT_EQ(said(std::string("\xFF\xFE"
                             "1\0 \0"
                             "1\0\n\0"
                             "5\0",
                             12)),
            sentence);
  EXPECT_EQ(said(std::string("\xFE\xFF\0"
                             "1\0 \0"
                             "1\0\n\0"
                             "5",
                             12)),
            sentence);
  EXPECT_EQ(said(std::string("1\0 \0"
                             "1\0\n",
                             7)),
            "a.dmat: expected a first line `columns rows`, found \"1\\x00 \\x001\\x00\"");
  EXPECT_EQ(said("1 1\ngr\xF6\xDF"
                 "e"),
            "a.dmat, row 0, column 0: expected a finite number, found \"gr\\xf6\\xdfe\"");
}

TEST_F(Dmat, RefusesTextThatEndsEarlyOrGoesOn) {
  EXPECT_EQ(said("2 3\n1.0 2.0 3.0 4.0\n"), "a.dmat ends after 4 numbers; its header promises 2 columns x 3 rows");
  EXPECT_EQ(said("1 1\n1 2"), "a.dmat goes on after the 1 number that its header promises");
  EXPECT_EQ(said("0 3\n1"), "a.dmat goes on after the 0 numbers that its header promises");
}

TEST_F(Dmat, RefusesBinaryThatEndsEarlyOrGoesOn) {
  const std::string bytes = "0 0\n2 3\n" + raw({1, 2, 3, 4, 5, 6});
  EXPECT_EQ(said(bytes.substr(0, bytes.size() - 1)),
            "a.dmat ends after 5 numbers; its header promises 2 columns x 3 rows");
  EXPECT_EQ(said(bytes.substr(0, bytes.size() - 8)),
            "a.dmat ends after 5 numbers; its header promises 2 columns x 3 rows");
  EXPECT_EQ(said(bytes + "\n"), "a.dmat goes on for 1 byte after the 6 numbers that its header promises");
  EXPECT_EQ(said("0 0\n"
                 "0 3\nabc"),
            "a.dmat goes on for 3 bytes after the 0 numbers that its header promises");
}

TEST_F(Dmat, RefusesWhatIsNoFiniteNumber) {
  for (const std::string word : {"x", "nan", "inf", "1e999", "1,5", "-"}) {
    EXPECT_EQ(said("2 2\n1 2\n3 " + word + "\n"),
              "a.dmat, row 1, column 1: expected a finite number, found \"" + word + "\"");
  }
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), -std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(said("0 0\n2 2\n" + raw({1, 2, bad, 4})), "a.dmat, row 0, column 1: the number is not finite");
  }
}

TEST_F(Dmat, RefusesToWriteWhatItCouldNotRead) {
  folder_.file("a.dmat", "old");
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(2, 3);
  matrix(1, 2) = std::numeric_limits<double>::quiet_NaN();
  for (const bool binary : {false, true}) {
    EXPECT_EQ(complaint([&] { write_dmat(folder_.path("a.dmat"), matrix, binary); }),
              "row 1, column 2 of the matrix for a.dmat is not finite");
    EXPECT_EQ(folder_.bytes("a.dmat"), "old");
  }
}

TEST_F(Dmat, BillionsOfColumnsWithoutRowsAreAHeader) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.dmat", "2147483605 0\n");
  write_dmat(path, read_dmat(path));
  EXPECT_EQ(folder.bytes("a.dmat"), "2147483605 0\n");
}

}  // namespace
}  // namespace sinew
