/// Writes one or several files completely or not at all: a failure leaves the existing files as they were.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "sinew/rig_skeleton.h"

namespace sinew {

struct PolygonMesh;

/// Each file is first written beside its destination under a unique name, so that two programs may write the same file,
/// and is moved to its destination when all are written. The destructor removes files that have not been moved.
class FilesToWrite {
 public:
  FilesToWrite() = default;
  FilesToWrite(const FilesToWrite&) = delete;
  ~FilesToWrite();

  /// Throws InputError, naming `path`, if it cannot be written or is a folder.
  void add(const std::filesystem::path& path, std::string_view bytes);

  /// Moves the files to their destinations. Throws InputError, naming the file that could not be moved.
  void replace();

 private:
  struct File {
    std::filesystem::path neighbour, path;
  };
  std::vector<File> files_;
};

/// Writes one file.
void write_file(const std::filesystem::path& path, std::string_view bytes);

// These return the contents of files. They throw InputError, naming the file, for what its format cannot hold.
std::string dmat_bytes(const std::filesystem::path& path, const Eigen::Ref<const Eigen::MatrixXd>& matrix, bool binary);
std::string obj_text(const PolygonMesh& mesh);
std::string skeleton_text(const std::filesystem::path& path, const RigSkeleton& skeleton);

}  // namespace sinew
