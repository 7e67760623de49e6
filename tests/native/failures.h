/// What a call complains about.
#pragma once

#include <string>

#include "base/parallel.h"
#include "sinew/threads.h"
#include "sinew/types.h"

namespace sinew {

/// The message of the InputError that the call must throw.
template <class Call>
std::string complaint(const Call& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "(no complaint)";
}

/// Lets a test choose the number of threads, and has them used even for work that would not pay.
struct ThreadsOfATest {
  ThreadsOfATest() { set_threads_always_pay(true); }
  ~ThreadsOfATest() {
    set_threads_always_pay(false);
    set_thread_count(0);
  }
};

}  // namespace sinew
