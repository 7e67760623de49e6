/// What the fuzzer gives, as numbers.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <vector>

class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : data_(data), left_(size) {}

  /// Zero when nothing is left.
  template <class T>
  T take() {
    T value{};
    const std::size_t size = std::min(sizeof value, left_);
    std::memcpy(&value, data_, size);
    data_ += size;
    left_ -= size;
    return value;
  }

  template <class T, class Raw = T>
  std::vector<T> list(std::size_t count) {
    std::vector<T> values(count);
    for (T& value : values) value = static_cast<T>(take<Raw>());
    return values;
  }

 private:
  const std::uint8_t* data_;
  std::size_t left_;
};
