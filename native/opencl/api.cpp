// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/api.h"

#include <dlfcn.h>

#include <array>
#include <map>

namespace bvhlab::opencl {
namespace {

struct Library {
    Api api;
    std::string reason;  ///< empty where all functions were found
};

Library open_library() {
    Library library;
    // Never closed: drivers leave threads behind.
    void* const handle = dlopen("libOpenCL.so.1", RTLD_NOW | RTLD_LOCAL);
    if (!handle) {
        library.reason = std::string("there is no OpenCL loader: ") + dlerror();
        return library;
    }
    const auto find = [&](auto& function, const char* name) {
        void* const symbol = dlsym(handle, name);
        if (!symbol && library.reason.empty())
            library.reason = std::string("the OpenCL loader has no function ") + name +
                             "; version 1.2 is needed";
        function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(symbol);
    };
#define BVHLAB_OPENCL_FIND(name) find(library.api.name, "cl" #name);
    BVHLAB_OPENCL_FUNCTIONS(BVHLAB_OPENCL_FIND)
#undef BVHLAB_OPENCL_FIND
    return library;
}

}  // namespace

const Api& api() {
    static const Library library = open_library();
    if (!library.reason.empty()) throw Error(library.reason);
    return library.api;
}

std::string error_name(cl_int code) {
#define BVHLAB_OPENCL_CODE(name) \
    { name, #name }
    static const std::map<cl_int, const char*> names{
        BVHLAB_OPENCL_CODE(CL_DEVICE_NOT_FOUND),
        BVHLAB_OPENCL_CODE(CL_DEVICE_NOT_AVAILABLE),
        BVHLAB_OPENCL_CODE(CL_COMPILER_NOT_AVAILABLE),
        BVHLAB_OPENCL_CODE(CL_MEM_OBJECT_ALLOCATION_FAILURE),
        BVHLAB_OPENCL_CODE(CL_OUT_OF_RESOURCES),
        BVHLAB_OPENCL_CODE(CL_OUT_OF_HOST_MEMORY),
        BVHLAB_OPENCL_CODE(CL_PROFILING_INFO_NOT_AVAILABLE),
        BVHLAB_OPENCL_CODE(CL_BUILD_PROGRAM_FAILURE),
        BVHLAB_OPENCL_CODE(CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST),
        BVHLAB_OPENCL_CODE(CL_INVALID_VALUE),
        BVHLAB_OPENCL_CODE(CL_INVALID_PLATFORM),
        BVHLAB_OPENCL_CODE(CL_INVALID_DEVICE),
        BVHLAB_OPENCL_CODE(CL_INVALID_CONTEXT),
        BVHLAB_OPENCL_CODE(CL_INVALID_COMMAND_QUEUE),
        BVHLAB_OPENCL_CODE(CL_INVALID_MEM_OBJECT),
        BVHLAB_OPENCL_CODE(CL_INVALID_BINARY),
        BVHLAB_OPENCL_CODE(CL_INVALID_BUILD_OPTIONS),
        BVHLAB_OPENCL_CODE(CL_INVALID_PROGRAM),
        BVHLAB_OPENCL_CODE(CL_INVALID_PROGRAM_EXECUTABLE),
        BVHLAB_OPENCL_CODE(CL_INVALID_KERNEL_NAME),
        BVHLAB_OPENCL_CODE(CL_INVALID_KERNEL),
        BVHLAB_OPENCL_CODE(CL_INVALID_ARG_INDEX),
        BVHLAB_OPENCL_CODE(CL_INVALID_ARG_VALUE),
        BVHLAB_OPENCL_CODE(CL_INVALID_ARG_SIZE),
        BVHLAB_OPENCL_CODE(CL_INVALID_KERNEL_ARGS),
        BVHLAB_OPENCL_CODE(CL_INVALID_WORK_GROUP_SIZE),
        BVHLAB_OPENCL_CODE(CL_INVALID_WORK_ITEM_SIZE),
        BVHLAB_OPENCL_CODE(CL_INVALID_GLOBAL_WORK_SIZE),
        BVHLAB_OPENCL_CODE(CL_INVALID_BUFFER_SIZE),
        BVHLAB_OPENCL_CODE(CL_INVALID_OPERATION),
        {-1001, "CL_PLATFORM_NOT_FOUND_KHR"},
    };
#undef BVHLAB_OPENCL_CODE
    const auto found = names.find(code);
    return found != names.end() ? found->second : "OpenCL error " + std::to_string(code);
}

void check(cl_int code, const std::string& what) {
    if (code == CL_SUCCESS) return;
    const std::string text = what + ": " + error_name(code);
    if (code == CL_MEM_OBJECT_ALLOCATION_FAILURE || code == CL_OUT_OF_HOST_MEMORY ||
        code == CL_INVALID_BUFFER_SIZE)
        throw MemoryError(text);
    throw Error(text);
}

}  // namespace bvhlab::opencl
