// SPDX-License-Identifier: GPL-3.0-or-later
// devices, and errors of devices as Python's.
#include <pybind11/stl.h>
#include <unistd.h>

#include "base/parallel.h"
#include "opencl/device.h"
#include "python/convert.h"
#include "trace/trace.h"

namespace bvhlab {
namespace {

py::dict cpu_entry() {
    py::dict cpu;
    cpu["id"] = "cpu";
    cpu["name"] = std::string("native threads, ") + simd_name();
    cpu["available"] = true;
    cpu["reason"] = "";
    cpu["threads"] = thread_count(0);
    cpu["simd"] = simd_name();
    cpu["platform"] = "";
    cpu["driver"] = "";
    cpu["memory"] = std::uint64_t(sysconf(_SC_PHYS_PAGES)) * std::uint64_t(sysconf(_SC_PAGESIZE));
    cpu["is_gpu"] = false;
    return cpu;
}

py::dict opencl_entry(const opencl::DeviceInfo& info) {
    py::dict entry;
    entry["id"] = info.id;
    entry["name"] = info.name;
    entry["available"] = info.available;
    entry["reason"] = info.reason;
    entry["threads"] = info.compute_units;
    entry["simd"] = "";
    entry["platform"] = info.platform;
    entry["driver"] = info.driver;
    entry["memory"] = info.memory;
    entry["is_gpu"] = info.is_gpu;
    return entry;
}

py::list list_devices() {
    std::vector<opencl::DeviceInfo> infos;
    {
        const py::gil_scoped_release release;
        infos = opencl::devices();
    }
    py::list list;
    list.append(cpu_entry());
    for (const opencl::DeviceInfo& info : infos) list.append(opencl_entry(info));
    return list;
}

/// opencl::Error is a RuntimeError as it is.
void translate_memory_error(std::exception_ptr thrown) {
    try {
        if (thrown) std::rethrow_exception(thrown);
    } catch (const opencl::MemoryError& error) {
        PyErr_SetString(PyExc_MemoryError, error.what());
    }
}

}  // namespace

void bind_device(py::module_& module) {
    py::register_exception_translator(&translate_memory_error);
    module.def("devices", &list_devices,
               "The devices there are, \"cpu\" first: dicts of \"id\", \"name\", \"available\", "
               "\"reason\" (why it is not), \"threads\" (compute units of an OpenCL device), "
               "\"simd\", \"platform\", \"driver\", \"memory\" (bytes) and \"is_gpu\". Where no "
               "OpenCL device can be used, entries say why; nothing is raised.");
}

}  // namespace bvhlab
