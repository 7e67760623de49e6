# macOS on Apple's processors.
set(CMAKE_SYSTEM_PROCESSOR arm64)
set(processor arm64)
include(${CMAKE_CURRENT_LIST_DIR}/macos.cmake)
