#include "text.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

namespace sinew {

std::string read_file(const Path& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) fail("there is no file ", path.string());
  if (std::filesystem::is_directory(path, error)) {
    fail(path.string(), " is a folder; expected a file");
  }
  std::ifstream stream(path, std::ios::binary);
  const auto size = std::filesystem::file_size(path, error);
  if (!stream || error) fail(path.string(), " cannot be read: ", std::strerror(errno));
  std::string bytes(size, '\0');
  stream.read(bytes.data(), static_cast<std::streamsize>(size));
  if (stream.gcount() != static_cast<std::streamsize>(size)) {
    fail(path.string(), " cannot be read to its end");
  }
  return bytes;
}

void write_file(const Path& path, std::string_view bytes) {
  Path partial = path;
  partial += ".partial";
  {
    std::ofstream stream(partial, std::ios::binary);
    stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    stream.close();
    if (!stream) fail(path.string(), " cannot be written: ", std::strerror(errno));
  }
  std::error_code error;
  std::filesystem::rename(partial, path, error);
  if (error) {
    std::filesystem::remove(partial);
    fail(path.string(), " cannot be written: ", error.message());
  }
}

std::string_view next_word(std::string_view& text) {
  const auto separates = [](char c) { return is_blank(c) || c == '\n'; };
  std::size_t begin = 0;
  while (begin < text.size() && separates(text[begin])) ++begin;
  std::size_t end = begin;
  while (end < text.size() && !separates(text[end])) ++end;
  const std::string_view word = text.substr(begin, end - begin);
  text.remove_prefix(end);
  return word;
}

LineReader::LineReader(const Path& path) : path_(path), bytes_(read_file(path)), unread_(bytes_) {
  if (unread_.starts_with("\xEF\xBB\xBF")) unread_.remove_prefix(3);
}

bool LineReader::next_line() {
  if (unread_.empty()) return false;
  const std::size_t end = std::min(unread_.find('\n'), unread_.size());
  line_ = rest_ = unread_.substr(0, end);
  unread_.remove_prefix(std::min(end + 1, unread_.size()));
  ++line_number_;
  return true;
}

}  // namespace sinew
