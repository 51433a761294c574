# find_package(svl): the targets svl::svl (shared) and svl::static.
get_filename_component(_svl_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
include(CMakeFindDependencyMacro)
find_dependency(Threads)
if(NOT TARGET svl::svl)
  add_library(svl::svl SHARED IMPORTED)
  set_target_properties(svl::svl PROPERTIES
    IMPORTED_LOCATION "${_svl_prefix}/lib/libsvl.so.@VERSION@"
    IMPORTED_SONAME "libsvl.so.@ABI@"
    INTERFACE_LINK_LIBRARIES m
    INTERFACE_INCLUDE_DIRECTORIES "${_svl_prefix}/include")
  add_library(svl::static STATIC IMPORTED)
  set_target_properties(svl::static PROPERTIES
    IMPORTED_LOCATION "${_svl_prefix}/lib/libsvl.a"
    INTERFACE_INCLUDE_DIRECTORIES "${_svl_prefix}/include"
    INTERFACE_LINK_LIBRARIES "Threads::Threads;${CMAKE_DL_LIBS};m")
endif()
unset(_svl_prefix)
