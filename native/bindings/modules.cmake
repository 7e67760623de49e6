# The Python module, once for the Python that builds it and once for that of each folder in SINEW_PYTHON_ROOTS; or, for
# another system, once for each of SINEW_CROSS_PYTHONS. All are written to python/ in the build folder and differ in
# their suffix.

set(SINEW_PYTHON_ROOTS "" CACHE STRING
    "Root folders of other Debian releases: a module is built for the Python of each")
set(SINEW_CROSS_PYTHONS "" CACHE STRING
    "Pythons of another system: for each suffix|folder of headers, on Windows also |python3XX.dll")

if(NOT SINEW_CROSS_PYTHONS)
  find_package(Python3 QUIET COMPONENTS Interpreter Development.Module)
  if(NOT Python3_FOUND)
    message(FATAL_ERROR "The headers of ${Python3_EXECUTABLE} were not found. On Debian and Ubuntu install those of the "
      "system's Python with: apt install python3-dev.")
  endif()
endif()
set(PYBIND11_NOPYTHON ON)  # only its headers, which are the same for all
find_package(pybind11 3.1 REQUIRED)
set(SINEW_MODULE_OPTIONS "" CACHE STRING "More options for the compiler of the Python module alone")

add_custom_target(modules)  # all of them
file(GENERATE OUTPUT ${CMAKE_BINARY_DIR}/modules.txt
  CONTENT "$<JOIN:$<TARGET_GENEX_EVAL:modules,$<TARGET_PROPERTY:modules,FILES>>,\n>\n")

# Two sources are compiled: what is called each frame, and what copies arguments. Optimising the latter, which is much
# more, would take as long again; it comes second, so that the linker keeps pybind11's own functions from the former.
function(add_python_module target soabi)  # ARGN: folders with Python's headers
  add_library(${target} MODULE
    bindings/host/bind_described.cpp
    bindings/host/bind_host.cpp
    bindings/host/bind_places.cpp
    bindings/host/bind_pose_record.cpp
    bindings/host/bind_shortcut.cpp
    bindings/host/bind_stored_curves.cpp
    bindings/host/bind_struct_values.cpp
    bindings/host/watched.cpp
    bindings/json_of.cpp)
  set(copying ${target}_copying)
  add_library(${copying} OBJECT
    bindings/bind_automatic_weights.cpp
    bindings/bind_bvh.cpp
    bindings/bind_cages.cpp
    bindings/bind_decompose.cpp
    bindings/bind_deformer.cpp
    bindings/bind_direct_delta_mush.cpp
    bindings/bind_files.cpp
    bindings/bind_method_data.cpp
    bindings/bind_rigs.cpp
    bindings/bind_skeleton.cpp
    bindings/bind_skinning.cpp
    bindings/bind_stages.cpp
    bindings/bind_stencils.cpp
    bindings/bind_tasks.cpp
    bindings/bind_weight_tools.cpp
    bindings/explain_arguments.cpp
    bindings/kept_program.cpp
    bindings/module.cpp)
  target_link_libraries(${target} PRIVATE ${copying})
  target_compile_options(${copying} PRIVATE $<$<AND:$<CONFIG:Release>,$<NOT:$<CXX_COMPILER_ID:MSVC>>>:-Os>)
  foreach(part ${target} ${copying})
    target_include_directories(${part} PRIVATE bindings)
    target_include_directories(${part} SYSTEM PRIVATE ${ARGN} ${pybind11_INCLUDE_DIRS})
    target_link_libraries(${part} PRIVATE sinew)
    target_compile_definitions(${part} PRIVATE SINEW_VERSION="${PROJECT_VERSION}")
    target_compile_options(${part} PRIVATE ${SINEW_MODULE_OPTIONS})
    # Compiled as one source, since most of the time goes into pybind11's templates, which all files share.
    set_target_properties(${part} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
  endforeach()
  if(UNIX AND NOT APPLE)
    # The symbols of a static TBB or Highway must be neither visible outside nor taken from another add-on.
    set(exports ${CMAKE_CURRENT_SOURCE_DIR}/bindings/exports.map)
    target_link_options(${target} PRIVATE -Wl,--version-script=${exports} $<$<CONFIG:Release>:-s>)
    set_target_properties(${target} PROPERTIES LINK_DEPENDS ${exports})
  elseif(APPLE)
    # As above. Python's symbols are those of the process.
    target_link_options(${target} PRIVATE -Wl,-undefined,dynamic_lookup -Wl,-exported_symbol,_PyInit_sinew_native
      -Wl,-dead_strip $<$<CONFIG:Release>:-Wl,-S,-x>)
  elseif(MINGW)
    # It needs no DLL of the compiler, and holds no time, so that the same source gives the same file.
    target_link_options(${target} PRIVATE -static -Wl,--no-insert-timestamp $<$<CONFIG:Release>:-s>)
  endif()
  set(extension .so)
  if(WIN32)
    set(extension .pyd)
  endif()
  set_target_properties(${target} PROPERTIES PREFIX "" OUTPUT_NAME sinew_native SUFFIX .${soabi}${extension}
    LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/python)
  add_dependencies(modules ${target})
  set_property(TARGET modules APPEND PROPERTY FILES $<TARGET_FILE:${target}>)
endfunction()

foreach(entry IN LISTS SINEW_CROSS_PYTHONS)
  string(REPLACE "|" ";" entry "${entry}")
  list(POP_FRONT entry suffix headers)
  # Python's headers, of which only the configuration differs between systems.
  set(picked ${CMAKE_BINARY_DIR}/headers/${suffix})
  file(COPY ${headers}/ DESTINATION ${picked} PATTERN pyconfig.h EXCLUDE)
  if(WIN32)
    configure_file(bindings/pyconfig/windows.h ${picked}/pyconfig.h COPYONLY)
  else()
    configure_file(bindings/pyconfig/unix.h ${picked}/pyconfig.h COPYONLY)
  endif()
  string(MAKE_C_IDENTIFIER sinew_native_${suffix} target)
  add_python_module(${target} ${suffix} ${picked})
  target_link_libraries(${target} PRIVATE ${entry})  # the DLL: GNU ld needs no import library
endforeach()
if(SINEW_CROSS_PYTHONS)
  return()
endif()

add_python_module(sinew_native ${Python3_SOABI} ${Python3_INCLUDE_DIRS})
target_link_libraries(sinew_native PRIVATE Python3::Module)  # its import library on Windows, nothing on Linux
include(bindings/install.cmake)
configure_file(bindings/sinew_native.pyi ${CMAKE_BINARY_DIR}/python/sinew_native.pyi COPYONLY)

foreach(root IN LISTS SINEW_PYTHON_ROOTS)
  file(GLOB includes ${root}/usr/include/python3.*)
  list(LENGTH includes count)
  if(NOT count EQUAL 1)
    message(FATAL_ERROR "${root} has no Python headers (or those of several versions)")
  endif()
  get_filename_component(name ${includes} NAME)  # python3.13
  string(REPLACE "python3." "3" digits ${name})
  # The release's Python headers, without those of its C library.
  set(picked ${CMAKE_BINARY_DIR}/headers/${name})
  set(triple ${CMAKE_LIBRARY_ARCHITECTURE})
  file(MAKE_DIRECTORY ${picked}/${triple})
  file(CREATE_LINK ${root}/usr/include/${triple}/${name} ${picked}/${triple}/${name} SYMBOLIC)
  add_python_module(sinew_native_${digits} cpython-${digits}-${triple} ${includes} ${picked})
endforeach()
