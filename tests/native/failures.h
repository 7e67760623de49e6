/// What a call complains about.
#pragma once

#include <string>

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

/// Puts the number of threads back at the end of a test.
struct KeepThreadCount {
  ~KeepThreadCount() { set_thread_count(0); }
};

}  // namespace sinew
