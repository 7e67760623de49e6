/// Input as files for the readers, and the laws that all of them keep.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "../native/memory.h"
#include "sinew/types.h"

namespace sinew::fuzz {

/// Like assert, in every build.
inline void require(bool holds, const char* law) {
  if (holds) return;
  std::fprintf(stderr, "this does not hold: %s\n", law);
  std::abort();
}

/// A folder of this process, gone at its end.
class Folder {
 public:
  Folder() : path_(std::filesystem::temp_directory_path() / ("sinew-fuzz-" + std::to_string(getpid()))) {
    std::filesystem::create_directory(path_);
  }
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }

  std::filesystem::path path(const char* name = "") const { return path_ / name; }

  std::filesystem::path file(const char* name, std::string_view bytes) const {
    std::ofstream(path(name), std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return path(name);
  }

 private:
  std::filesystem::path path_;
};

inline const Folder& folder() {
  static const Folder folder;
  return folder;
}

/// Calls what may refuse its input, in one sentence. False if it did.
template <class Call>
bool accepts(const Call& call) {
  try {
    call();
    return true;
  } catch (const InputError& error) {
    const std::string_view said = error.what();
    require(!said.empty() && said.find('\n') == said.npos, "an error is one sentence");
    return false;
  }
}

/// The same of what reads that many bytes.
template <class Read>
bool reads(std::size_t file_bytes, const Read& read) {
  bool accepted = false;
  const std::size_t bytes = bytes_allocated_by([&] { accepted = accepts(read); });
  require(bytes <= most_bytes_to_read(file_bytes), "memory is in proportion to the file");
  return accepted;
}

inline std::string_view as_text(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

}  // namespace sinew::fuzz
