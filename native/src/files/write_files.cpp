#include "files/write_files.h"

#include <cerrno>
#include <fstream>
#include <random>
#include <system_error>

#include "base/check.h"
#include "base/text.h"

namespace sinew {
namespace {

using Path = std::filesystem::path;

[[noreturn]] void cannot_be_written(const Path& path, const std::error_code& why) {
  fail(shown(path), " cannot be written: ", why.message());
}

}  // namespace

void FilesToWrite::add(const Path& path, std::string_view bytes) {
  std::error_code ignored;
  const auto there = std::filesystem::status(path, ignored);
  if (std::filesystem::is_directory(there)) {
    cannot_be_written(path, std::make_error_code(std::errc::is_a_directory));
  }
  // A new file would take the place of the device: whoever may do that, such as root, would have no /dev/null any more.
  if (std::filesystem::exists(there) && !std::filesystem::is_regular_file(there)) {
    fail(shown(path), " cannot be written: it is a device or a pipe; name a file");
  }
  Path neighbour = path;
  neighbour += ".partial-" + std::to_string(std::random_device()());
  const auto failed = [] { return std::error_code(errno, std::generic_category()); };
  std::ofstream stream(neighbour, std::ios::binary);
  if (!stream) cannot_be_written(path, failed());
  files_.push_back({neighbour, path});
  stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  stream.close();
  if (!stream) cannot_be_written(path, failed());
}

void FilesToWrite::replace() {
  for (File& file : files_) {
    std::error_code error;
    std::filesystem::rename(file.neighbour, file.path, error);
    if (error) cannot_be_written(file.path, error);
    file.neighbour.clear();
  }
}

FilesToWrite::~FilesToWrite() {
  std::error_code ignored;
  for (const File& file : files_) {
    if (!file.neighbour.empty()) std::filesystem::remove(file.neighbour, ignored);
  }
}

void write_file(const Path& path, std::string_view bytes) {
  FilesToWrite file;
  file.add(path, bytes);
  file.replace();
}

}  // namespace sinew
