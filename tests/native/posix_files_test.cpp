/// What only POSIX lets a test arrange: pipes, files that may not be read or that end early.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/text.h"
#include "failures.h"
#include "files.h"
#include "files/write_files.h"

namespace sinew {
namespace {

TEST(PosixFiles, ReadFileRefusesAPipe) {
  const TemporaryFolder folder;
  const std::string path = folder.path("a");
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  EXPECT_TRUE(complaint([&] { read_file(path); }).starts_with(path + " cannot be read: "));
}

TEST(PosixFiles, ReadFileRefusesWhatMayNotBeRead) {
  const TemporaryFolder folder;
  std::filesystem::path path = folder.file("a", "secret");
  ASSERT_EQ(chmod(path.c_str(), 0), 0);
  if (access(path.c_str(), R_OK) == 0) path = "/sys/bus/platform/drivers_probe";  // we are root
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no file that root may not read";
  EXPECT_EQ(complaint([&] { read_file(path); }), path.string() + " cannot be read: Permission denied");
}

TEST(PosixFiles, ReadFileRefusesAFileThatEndsEarly) {
  // The kernel says 4096 bytes and gives a handful.
  const char* path = "/sys/devices/system/cpu/online";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no " << path;
  EXPECT_EQ(complaint([&] { read_file(path); }), std::string(path) + " cannot be read to its end");
}

TEST(PosixFiles, WriteFileLeavesPipesAndDevicesAlone) {
  const TemporaryFolder folder;
  const std::string path = folder.path("a");
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  EXPECT_EQ(complaint([&] { write_file(path, "new"); }),
            path + " cannot be written: it is a device or a pipe; name a file");
  EXPECT_TRUE(std::filesystem::is_fifo(path));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

}  // namespace
}  // namespace sinew
