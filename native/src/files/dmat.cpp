#include "sinew/dmat.h"

#include <algorithm>
#include <bit>

#include "base/text.h"
#include "files/write_files.h"

namespace sinew {
namespace {

static_assert(std::endian::native == std::endian::little,
              "binary .dmat is read and written as the machine's own float64");

// The most columns, and the most rows: as many as other parts of a rig can count.
constexpr long long kMostOfEither = (1LL << 31) - 1;

struct Header {
  long long columns;
  long long rows;
};

/// Removes the header line from `unread`, including its line feed: what follows may be binary.
Header parse_header(const std::string& name, std::string_view& unread) {
  const std::size_t end = std::min(unread.find('\n'), unread.size());
  const std::string_view whole = trimmed(unread.substr(0, end));
  std::string_view line = whole;
  const std::string_view columns = next_word(line), rows = next_word(line);
  Header header{};
  if (!parse_number(columns, header.columns) || !parse_number(rows, header.rows) || !next_word(line).empty() ||
      header.columns < 0 || header.rows < 0) {
    fail(name, ": expected a first line `columns rows`, found ", excerpt(whole));
  }
  unread.remove_prefix(std::min(end + 1, unread.size()));
  return header;
}

[[noreturn]] void ends_early(const std::string& name, Header header, std::size_t numbers) {
  fail(name, " ends after ", plural(static_cast<long long>(numbers), "number"), "; its header promises ",
       plural(header.columns, "column"), " x ", plural(header.rows, "row"));
}

std::size_t count_words(std::string_view text) {
  std::size_t count = 0;
  while (!next_word(text).empty()) ++count;
  return count;
}

/// Rejects a header that promises more than the rest of the file can hold, before memory is allocated.
void check_size(const std::string& name, Header header, std::string_view unread, bool binary) {
  // The shortest text entry is a digit and a separator, which the last may lack.
  const std::size_t most = binary ? unread.size() / sizeof(double) : (unread.size() + 1) / 2;
  if (header.rows != 0 && header.columns > static_cast<long long>(most) / header.rows) {
    ends_early(name, header, binary ? most : count_words(unread));
  }
  // A matrix without rows may have any number of columns, and vice versa.
  const long long longest = std::max(header.columns, header.rows);
  if (longest > kMostOfEither) {
    fail(name, " declares ", plural(header.columns, "column"), " x ", plural(header.rows, "row"), "; expected at most ",
         grouped(kMostOfEither), " of either");
  }
}

void read_text(const std::string& name, std::string_view unread, Eigen::MatrixXd& matrix) {
  for (Eigen::Index i = 0; i < matrix.size(); ++i) {
    const std::string_view word = next_word(unread);
    if (word.empty()) ends_early(name, {matrix.cols(), matrix.rows()}, i);
    if (!parse_number(word, matrix.data()[i])) {
      fail(name, ", row ", i % matrix.rows(), ", column ", i / matrix.rows(), ": expected a finite number, found ",
           excerpt(word));
    }
  }
  if (!next_word(unread).empty()) {
    fail(name, " goes on after the ", plural(matrix.size(), "number"), " that its header promises");
  }
}

void read_binary(const std::string& name, std::string_view unread, Eigen::MatrixXd& matrix) {
  const std::size_t due = static_cast<std::size_t>(matrix.size()) * sizeof(double);
  if (unread.size() > due) {
    fail(name, " goes on for ", plural(static_cast<long long>(unread.size() - due), "byte"), " after the ",
         plural(matrix.size(), "number"), " that its header promises");
  }
  std::copy(unread.begin(), unread.end(), reinterpret_cast<char*>(matrix.data()));
  for (Eigen::Index i = 0; i < matrix.size(); ++i) {
    if (!std::isfinite(matrix.data()[i])) {
      fail(name, ", row ", i % matrix.rows(), ", column ", i / matrix.rows(), ": the number is not finite");
    }
  }
}

void append_header(std::string& bytes, Eigen::Index columns, Eigen::Index rows) {
  append_number(bytes, columns);
  bytes += ' ';
  append_number(bytes, rows);
  bytes += '\n';
}

}  // namespace

Eigen::MatrixXd read_dmat(const Path& path) {
  const std::string name = shown(path.filename());
  const std::string bytes = read_file(path);
  if (bytes.empty()) fail(name, " is empty; expected a first line `columns rows`");
  std::string_view unread = bytes;
  skip_byte_order_mark(path, unread);
  Header header = parse_header(name, unread);
  const bool binary = header.columns == 0 && header.rows == 0 && !unread.empty();
  if (binary) header = parse_header(name, unread);
  check_size(name, header, unread, binary);
  Eigen::MatrixXd matrix(header.rows, header.columns);
  binary ? read_binary(name, unread, matrix) : read_text(name, unread, matrix);
  return matrix;
}

std::string dmat_bytes(const Path& path, const Eigen::Ref<const Eigen::MatrixXd>& matrix, bool binary) {
  std::string bytes;
  if (binary) append_header(bytes, 0, 0);
  append_header(bytes, matrix.cols(), matrix.rows());
  const Eigen::Index columns = matrix.rows() == 0 ? 0 : matrix.cols();  // empty columns may be billions
  for (Eigen::Index column = 0; column < columns; ++column) {
    for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
      const double number = matrix(row, column);
      if (!std::isfinite(number)) {
        fail("row ", row, ", column ", column, " of the matrix for ", shown(path.filename()), " is not finite");
      }
      if (binary) {
        bytes.append(reinterpret_cast<const char*>(&number), sizeof number);
      } else {
        append_number(bytes, number);
        bytes += '\n';
      }
    }
  }
  return bytes;
}

void write_dmat(const Path& path, const Eigen::Ref<const Eigen::MatrixXd>& matrix, bool binary) {
  write_file(path, dmat_bytes(path, matrix, binary));
}

}  // namespace sinew
