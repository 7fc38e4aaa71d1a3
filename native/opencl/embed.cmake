# SPDX-License-Identifier: GPL-3.0-or-later
# Writes OUTPUT, a C++ file with the text of every kernel file in FOLDER.
file(GLOB kernels RELATIVE ${FOLDER} ${FOLDER}/*.cl)
list(SORT kernels)
set(text "// Made from native/opencl/kernels by embed.cmake.\n#include \"opencl/program.h\"\n\n#include <map>\n#include <stdexcept>\n\nnamespace bvhlab::opencl {\n\nstd::string kernel_source(const std::string& file) {\n    static const std::map<std::string, const char*> sources{\n")
foreach(kernel IN LISTS kernels)
  file(READ ${FOLDER}/${kernel} source)
  string(APPEND text "        {\"${kernel}\", R\"kernel(${source})kernel\"},\n")
endforeach()
string(APPEND text "    };\n    const auto found = sources.find(file);\n    if (found == sources.end()) throw std::logic_error(\"there is no kernel file \" + file);\n    return found->second;\n}\n\n}  // namespace bvhlab::opencl\n")
file(WRITE ${OUTPUT} "${text}")
