/// .dmat files, which hold a dense matrix as text or binary.
#pragma once

#include <Eigen/Core>
#include <filesystem>

#include "sinew/types.h"

namespace sinew {

/// Reads rows x columns numbers. The first line is `columns rows`, then come the entries, column by
/// column, as text; or it is `0 0`, then come a second header line `columns rows` and the entries as
/// little-endian float64.
/// Throws InputError, naming the file, for a missing file, a header that is malformed or promises
/// more than the file can hold, too few or too many entries, text that is not a number, and numbers
/// that are not finite.
Eigen::MatrixXd read_dmat(const std::filesystem::path& path);

/// Writes a file that read_dmat reads back bit for bit, as text (with the fewest digits) or binary.
void write_dmat(const std::filesystem::path& path, const Eigen::Ref<const Eigen::MatrixXd>& matrix,
                bool binary = false);

}  // namespace sinew
