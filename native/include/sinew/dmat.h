/// .dmat, a dense matrix in a file: text or binary.
#pragma once

#include <Eigen/Core>
#include <filesystem>

#include "sinew/types.h"

namespace sinew {

/// Reads rows x columns numbers. First line `columns rows`, then the entries column by column as
/// text; or `0 0`, a second header line `columns rows`, and the entries as little-endian float64.
/// Throws InputError, naming the file, for: no file, a header that is none or promises more than
/// the file can hold, too few or too many entries, letters, numbers that are not finite.
Eigen::MatrixXd read_dmat(const std::filesystem::path& path);

/// Writes what read_dmat reads back bit for bit, as text (shortest digits) or binary.
void write_dmat(const std::filesystem::path& path, const Eigen::Ref<const Eigen::MatrixXd>& matrix,
                bool binary = false);

}  // namespace sinew
