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
  const auto size = std::filesystem::file_size(path, error);
  if (error) fail(path.string(), " cannot be read: ", error.message());
  std::ifstream stream(path, std::ios::binary);
  if (!stream) fail(path.string(), " cannot be read: ", std::strerror(errno));
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
  std::error_code error;
  std::ofstream stream(partial, std::ios::binary);
  if (!stream) fail(path.string(), " cannot be written: ", std::strerror(errno));
  stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  stream.close();
  if (!stream) error.assign(errno, std::generic_category());
  if (!error) std::filesystem::rename(partial, path, error);
  if (error) {
    std::error_code ignored;
    std::filesystem::remove(partial, ignored);
    fail(path.string(), " cannot be written: ", error.message());
  }
}

void skip_byte_order_mark(const Path& path, std::string_view& text) {
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF")) {
    fail(path.filename().string(), " is UTF-16 text; save it as UTF-8");
  }
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
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
  skip_byte_order_mark(path, unread_);
  if (!is_utf8(unread_)) unread_ = bytes_ = utf8_from_latin1(unread_);
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
