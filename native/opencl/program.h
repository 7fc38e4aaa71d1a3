// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "opencl/device.h"

namespace bvhlab::opencl {

/// Text of a file of kernels/, as it was when this was compiled. Throws std::logic_error for a name
/// that is not there.
std::string kernel_source(const std::string& file);

/// Sources and options as one text, which names a program.
std::string program_text(const ProgramSource& source);

/// Builds a program. With `keep_binary` it is taken from the folder of binaries (XDG_CACHE_HOME or
/// ~/.cache, then bvh_lab/opencl) where device, driver and sources are the same, and else left
/// there. A binary that cannot be used is built anew; a folder that cannot be written to is done
/// without.
/// Throws Error with driver and build log where it does not compile.
ProgramHandle build_program(const Device& device, const ProgramSource& source, bool keep_binary);

}  // namespace bvhlab::opencl
