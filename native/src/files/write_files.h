/// Writing files so that a failure leaves what was there: whole files, and several of them together.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "sinew/rig_skeleton.h"

namespace sinew {

struct PolygonMesh;

/// Each is written to a neighbour with a name of its own, so that two programs may write the same file, and goes to
/// its place when all are written. What has not gone there is removed at the end.
class FilesToWrite {
 public:
  FilesToWrite() = default;
  FilesToWrite(const FilesToWrite&) = delete;
  ~FilesToWrite();

  /// Throws InputError, naming `path`, if it cannot be written or is a folder.
  void add(const std::filesystem::path& path, std::string_view bytes);

  /// Throws InputError, naming the file that could not go to its place.
  void replace();

 private:
  struct File {
    std::filesystem::path neighbour, path;
  };
  std::vector<File> files_;
};

/// One file.
void write_file(const std::filesystem::path& path, std::string_view bytes);

// What the files hold. Throw InputError, naming the file, for what its format cannot hold.
std::string dmat_bytes(const std::filesystem::path& path, const Eigen::Ref<const Eigen::MatrixXd>& matrix, bool binary);
std::string obj_text(const PolygonMesh& mesh);
std::string skeleton_text(const std::filesystem::path& path, const RigSkeleton& skeleton);

}  // namespace sinew
