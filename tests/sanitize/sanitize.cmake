# SPDX-License-Identifier: GPL-3.0-or-later
# How library and tests are compiled for BVHLAB_SANITIZE, a list such as "address,undefined".
# Clang only: its libFuzzer stands on the same build, and it can leave files uninstrumented.
if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  message(FATAL_ERROR "BVHLAB_SANITIZE needs Clang, and this is ${CMAKE_CXX_COMPILER_ID}: "
                      "configure with the presets sanitize or sanitize-thread")
endif()
set(sanitize_flags -fsanitize=${BVHLAB_SANITIZE} -fno-sanitize-recover=all)
add_link_options(${sanitize_flags})
add_compile_options(${sanitize_flags} -fno-omit-frame-pointer -gline-tables-only
                    -fsanitize-ignorelist=${CMAKE_CURRENT_LIST_DIR}/ignore.txt)
add_compile_definitions(BVHLAB_SANITIZE _GLIBCXX_ASSERTIONS)

# Neither Ninja nor ccache sees that list change: what is compiled depends on a definition instead.
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${CMAKE_CURRENT_LIST_DIR}/ignore.txt)
file(SHA256 ${CMAKE_CURRENT_LIST_DIR}/ignore.txt ignored)
add_compile_definitions(BVHLAB_SANITIZE_IGNORES=\"${ignored}\")

# One instruction set instead of all that Highway knows: a fourth of the time to compile.
# Highway takes AVX2 only where AES is there too, else it emulates: neither quick nor what users run.
file(STRINGS /proc/cpuinfo has_avx2 REGEX "aes.*avx2.*bmi2" LIMIT_COUNT 1)
add_compile_definitions(HWY_COMPILE_ONLY_STATIC)
if(has_avx2)
  add_compile_options(-march=haswell -maes)
endif()

# The traversals take half of the whole time to compile: their local variables are not watched, nor
# do those that are only there to be compared with guide the fuzzer. What they read and write is.
if(BVHLAB_SANITIZE MATCHES "address")
  file(GLOB traversals CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/native/trace/traverse_*.cpp)
  foreach(traversal IN LISTS traversals)
    set(lighter -mllvm -asan-stack=0 -fno-sanitize-address-use-after-scope)
    if(BVHLAB_WITH_FUZZ AND NOT traversal MATCHES "traverse_watertight.cpp$")
      list(APPEND lighter -fno-sanitize=fuzzer-no-link)
    endif()
    set_source_files_properties(${traversal} PROPERTIES COMPILE_OPTIONS "${lighter}"
                                SKIP_PRECOMPILE_HEADERS ON)  # made for other options
  endforeach()
endif()

# Left out: tests whose time goes into an oracle of the test itself, or into statistics and sums over
# millions whose code other tests run as well.
set(not_sanitized
    Bsdf.White* Bsdf.SamplesFollow* EndPointOverlap.IsThatOfEvery* Environment.SamplesBring*
    Hlbvh.IsThePlainOne LeafCounts.HaveTheMean* PathTracer.GlossShows* Sums.Cost*)
list(JOIN not_sanitized : not_sanitized)
