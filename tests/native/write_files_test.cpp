#include "files/write_files.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>

#include "failures.h"
#include "files.h"

namespace sinew {
namespace {

std::ptrdiff_t file_count(const TemporaryFolder& folder) {
  return std::distance(std::filesystem::directory_iterator(folder.path()), {});
}

/// As on a full disk: no file may have more bytes.
class FullDisk {
 public:
  explicit FullDisk(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FullDisk() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }

 private:
  rlimit before_;
  void (*handler_)(int);
};

TEST(WriteFiles, ReplacesTheWholeFile) {
  const TemporaryFolder folder;
  folder.file("a", "a long old text");
  write_file(folder.path("a"), "new");
  EXPECT_EQ(folder.bytes("a"), "new");
  EXPECT_EQ(file_count(folder), 1);
}

TEST(WriteFiles, AFullDiskLeavesTheOldFiles) {
  const TemporaryFolder folder;
  const std::string small = folder.file("small", "old"), large = folder.file("large", "old");
  const std::string said = [&] {
    const FullDisk full_disk(4);
    return complaint([&] {
      FilesToWrite files;
      files.add(small, "new");
      files.add(large, "new and long");
      files.replace();
    });
  }();
  EXPECT_EQ(said, large + " cannot be written: File too large");
  EXPECT_EQ(folder.bytes("small"), "old");
  EXPECT_EQ(folder.bytes("large"), "old");
  EXPECT_EQ(file_count(folder), 2);
}

TEST(WriteFiles, TwoWritersOfOneFileDoNotMix) {
  const TemporaryFolder folder;
  const auto path = folder.path("a");
  FilesToWrite first, second;
  first.add(path, "first");
  second.add(path, "second, longer");
  first.replace();
  EXPECT_EQ(folder.bytes("a"), "first");
  second.replace();
  EXPECT_EQ(folder.bytes("a"), "second, longer");
  EXPECT_EQ(file_count(folder), 1);
}

TEST(WriteFiles, SaysWhyItCannot) {
  const TemporaryFolder folder;
  const std::string nowhere = folder.path("none") / "a";
  EXPECT_EQ(complaint([&] { write_file(nowhere, "new"); }), nowhere + " cannot be written: No such file or directory");
  const std::string taken = folder.path("taken"), other = folder.file("other", "old");
  std::filesystem::create_directory(taken);
  EXPECT_EQ(complaint([&] {
              FilesToWrite files;
              files.add(other, "new");
              files.add(taken, "new");
              files.replace();
            }),
            taken + " cannot be written: Is a directory");
  EXPECT_EQ(folder.bytes("other"), "old");
  EXPECT_EQ(file_count(folder), 2);
}

}  // namespace
}  // namespace sinew
