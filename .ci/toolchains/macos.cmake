# What both processors have in common. Programs do not run here, so there are none for tests.
execute_process(COMMAND ${CMAKE_CURRENT_LIST_DIR}/../macos ${processor}
  OUTPUT_VARIABLE tools OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
set(CMAKE_SYSTEM_NAME Darwin)
set(CMAKE_C_COMPILER ${tools}/cc)
set(CMAKE_CXX_COMPILER ${tools}/c++)
set(CMAKE_AR ${tools}/ar CACHE FILEPATH "")
set(CMAKE_RANLIB ${tools}/ranlib CACHE FILEPATH "")
set(CMAKE_INSTALL_NAME_TOOL true CACHE FILEPATH "")  # all libraries are static
set(CMAKE_OSX_SYSROOT "" CACHE PATH "")  # the compiler knows its own, and for which macOS it compiles
set(CMAKE_FIND_ROOT_PATH ${tools})
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(Eigen3_DIR /usr/share/eigen3/cmake)  # headers alone
set(SINEW_TESTS OFF CACHE BOOL "")
set(SINEW_PRECOMPILED_HEADERS OFF CACHE BOOL "")  # zig has none
