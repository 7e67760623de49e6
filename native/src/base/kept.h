/// Memory that is reused from call to call.
#pragma once

#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace sinew {

/// A pool: each running call borrows one T; it grows to the largest number of concurrent calls.
template <class T>
class Kept {
 public:
  /// Returns its T to the pool when destroyed.
  class Loan {
   public:
    Loan(Kept& owner, std::unique_ptr<T> value) : owner_(owner), value_(std::move(value)) {}
    Loan(const Loan&) = delete;
    ~Loan() {
      const std::lock_guard lock(owner_.mutex_);
      owner_.idle_.push_back(std::move(value_));
    }
    T& operator*() const { return *value_; }
    T* operator->() const { return value_.get(); }

   private:
    Kept& owner_;
    std::unique_ptr<T> value_;
  };

  /// Borrows a T. make  called if none is idle; returns a unique_ptr<T>.
  template <class Make>
  Loan borrow(const Make& make) {
    {
      const std::lock_guard lock(mutex_);
      if (!idle_.empty()) {
        std::unique_ptr<T> value = std::move(idle_.back());
        idle_.pop_back();
        return Loan(*this, std::move(value));
      }
    }
    auto made = make();
    const std::lock_guard lock(mutex_);
    idle_.reserve(++made_);  // so that returning it does not throw
    return Loan(*this, std::move(made));
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<T>> idle_;
  std::size_t made_ = 0;
};

}  // namespace sinew
