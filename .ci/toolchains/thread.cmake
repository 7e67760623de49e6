# This machine, under the thread sanitizer: it sees how TBB synchronises only if TBB itself is instrumented.
set(CMAKE_CXX_FLAGS_INIT -fsanitize=thread)
