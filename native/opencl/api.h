// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>

#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>

namespace bvhlab::opencl {

/// Functions of OpenCL 1.2, found in the loader at run time.
struct Api {
#define BVHLAB_OPENCL_FUNCTIONS(USE)            \
    USE(GetPlatformIDs)                         \
    USE(GetPlatformInfo)                        \
    USE(GetDeviceIDs)                           \
    USE(GetDeviceInfo)                          \
    USE(GetExtensionFunctionAddressForPlatform) \
    USE(CreateContext)                          \
    USE(ReleaseContext)                         \
    USE(CreateCommandQueue)                     \
    USE(ReleaseCommandQueue)                    \
    USE(CreateBuffer)                           \
    USE(ReleaseMemObject)                       \
    USE(CreateProgramWithSource)                \
    USE(CreateProgramWithBinary)                \
    USE(BuildProgram)                           \
    USE(GetProgramInfo)                         \
    USE(GetProgramBuildInfo)                    \
    USE(ReleaseProgram)                         \
    USE(CreateKernel)                           \
    USE(SetKernelArg)                           \
    USE(GetKernelWorkGroupInfo)                 \
    USE(ReleaseKernel)                          \
    USE(EnqueueNDRangeKernel)                   \
    USE(EnqueueReadBuffer)                      \
    USE(EnqueueWriteBuffer)                     \
    USE(EnqueueCopyBuffer)                      \
    USE(EnqueueFillBuffer)                      \
    USE(GetEventInfo)                           \
    USE(GetEventProfilingInfo)                  \
    USE(ReleaseEvent)                           \
    USE(Flush)                                  \
    USE(Finish)
#define BVHLAB_OPENCL_MEMBER(name) decltype(&::cl##name) name = nullptr;
    BVHLAB_OPENCL_FUNCTIONS(BVHLAB_OPENCL_MEMBER)
#undef BVHLAB_OPENCL_MEMBER
};

/// Why OpenCL did not do what was asked, in a sentence that names call, kernel or buffer.
struct Error : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// Memory of the device does not suffice; the sentence says how much is needed.
struct MemoryError : Error {
    using Error::Error;
};

/// The loader, opened at the first call. Throws Error with the reason where there is none.
const Api& api();

/// Name of an error code, as "CL_OUT_OF_RESOURCES".
std::string error_name(cl_int code);

/// Throws Error ("<what>: <name of the code>") unless `code` is CL_SUCCESS; MemoryError for codes
/// that tell of lacking memory.
void check(cl_int code, const std::string& what);

// Handles that release themselves.
#define BVHLAB_OPENCL_HANDLE(Name, handle, Release)                              \
    struct Name##Deleter {                                                       \
        using pointer = handle;                                                  \
        void operator()(handle object) const noexcept { api().Release(object); } \
    };                                                                           \
    using Name = std::unique_ptr<std::remove_pointer_t<handle>, Name##Deleter>;
BVHLAB_OPENCL_HANDLE(ContextHandle, cl_context, ReleaseContext)
BVHLAB_OPENCL_HANDLE(QueueHandle, cl_command_queue, ReleaseCommandQueue)
BVHLAB_OPENCL_HANDLE(MemoryHandle, cl_mem, ReleaseMemObject)
BVHLAB_OPENCL_HANDLE(ProgramHandle, cl_program, ReleaseProgram)
BVHLAB_OPENCL_HANDLE(KernelHandle, cl_kernel, ReleaseKernel)
BVHLAB_OPENCL_HANDLE(EventHandle, cl_event, ReleaseEvent)
#undef BVHLAB_OPENCL_HANDLE

}  // namespace bvhlab::opencl
