/// Objects that a thread keeps from call to call.
#pragma once

#include <memory>

#ifdef __MINGW32__
#include <cxxabi.h>
#endif

namespace sinew {

/// Returns the calling thread's own T, which is made at its first call and destroyed when the thread ends. Each T must
/// have only one user.
template <class T>
T& per_thread() {
#ifdef __MINGW32__
  // A thread_local T would be destroyed after its memory has been freed (GCC bug 83562).
  thread_local T* own = nullptr;
  if (!own) {
    auto made = std::make_unique<T>();
    abi::__cxa_thread_atexit([](void* object) { delete static_cast<T*>(object); }, made.get(), nullptr);
    own = made.release();
  }
  return *own;
#else
  thread_local const auto own = std::make_unique<T>();
  return *own;
#endif
}

}  // namespace sinew
