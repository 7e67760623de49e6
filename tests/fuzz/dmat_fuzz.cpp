/// A file for read_dmat. What can be read is written, both ways, and reads back the same.
#include "files.h"
#include "sinew/dmat.h"

using namespace sinew;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto path = fuzz::folder().file("a.dmat", fuzz::as_text(data, size));
  Eigen::MatrixXd matrix;
  if (!fuzz::reads(size, [&] { matrix = read_dmat(path); })) return 0;
  for (const bool binary : {false, true}) {
    write_dmat(path, matrix, binary);
    const Eigen::MatrixXd again = read_dmat(path);
    fuzz::require(
        again.rows() == matrix.rows() && again.cols() == matrix.cols() && (matrix.size() == 0 || again == matrix),
        "a matrix that is written reads back the same");
  }
  return 0;
}
