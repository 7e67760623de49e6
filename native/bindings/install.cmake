# The contents of the Python package besides its metadata (pyproject.toml): the module and its stub. For a module that
# is a single file, PEP 561 has no py.typed, only a package of stubs.
if(SINEW_MODULE)
  install(FILES ${SINEW_MODULE} DESTINATION .)
else()
  install(TARGETS sinew_native LIBRARY DESTINATION .)
endif()
install(FILES ${CMAKE_CURRENT_LIST_DIR}/sinew_native.pyi DESTINATION sinew_native-stubs RENAME __init__.pyi)
