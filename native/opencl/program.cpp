// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/program.h"

#include <unistd.h>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string_view>
#include <system_error>

namespace bvhlab::opencl {
namespace {

namespace fs = std::filesystem;

std::string options_of(const Device& device, const ProgramSource& source) {
    const SubGroups& sub_groups = device.info().sub_groups;
    const std::string standard = source.sub_groups ? sub_groups.standard : "CL1.2";
    std::string options = "-cl-std=" + standard + " -w " + source.options;
    if (source.sub_groups) options += " -DHAS_SUB_GROUPS";
    if (source.sub_groups && sub_groups.shuffles) options += " -DHAS_SHUFFLES";
    if (source.sub_groups && sub_groups.ballots) options += " -DHAS_BALLOTS";
    if (device.info().has_long_atomics) options += " -DHAS_LONG_ATOMICS";
    if (device.info().is_gpu) options += " -DIS_GPU";
    return options;
}

std::string build_log(const Device& device, cl_program program) {
    std::size_t size = 0;
    api().GetProgramBuildInfo(program, device.id(), CL_PROGRAM_BUILD_LOG, 0, nullptr, &size);
    std::string log(size, '\0');
    api().GetProgramBuildInfo(program, device.id(), CL_PROGRAM_BUILD_LOG, size, log.data(),
                              nullptr);
    while (!log.empty() && (log.back() == '\0' || log.back() == '\n')) log.pop_back();
    return log;
}

ProgramHandle compile(const Device& device, const ProgramSource& source) {
    const std::string text = program_text(source);
    const char* begin = text.c_str();
    cl_int code = CL_SUCCESS;
    ProgramHandle program(
        api().CreateProgramWithSource(device.context(), 1, &begin, nullptr, &code));
    check(code, "clCreateProgramWithSource");
    const std::string options = options_of(device, source);
    const cl_device_id id = device.id();
    code = api().BuildProgram(program.get(), 1, &id, options.c_str(), nullptr, nullptr);
    if (code != CL_SUCCESS)
        throw Error("the kernels of " + source.files.back() + " do not compile on device '" +
                    device.info().id + "', driver " + device.info().driver + ", with " + options +
                    ": " + error_name(code) + "\n" + build_log(device, program.get()));
    return program;
}

// --- binaries -----------------------------------------------------------------------------------
// A file holds the text that names the program, and the binary; before each its length, and before
// the binary a hash of it, as drivers crash over spoilt ones.

/// Empty where the user has no folder for caches.
fs::path cache_folder() {
    const char* const cache = std::getenv("XDG_CACHE_HOME");
    if (cache && *cache) return fs::path(cache) / "bvh_lab" / "opencl";
    const char* const home = std::getenv("HOME");
    return home && *home ? fs::path(home) / ".cache" / "bvh_lab" / "opencl" : fs::path();
}

/// All that the binary depends on.
std::string binary_key(const Device& device, const ProgramSource& source) {
    const DeviceInfo& info = device.info();
    return info.id + "\n" + info.driver + "\n" + options_of(device, source) + "\n" +
           program_text(source);
}

fs::path binary_path(const std::string& key) {
    const fs::path folder = cache_folder();
    if (folder.empty()) return {};
    return folder / (std::to_string(std::hash<std::string>()(key)) + ".bin");
}

/// What stands before a binary in its file.
std::string head_of(const std::string& key, std::string_view binary) {
    return std::to_string(key.size()) + "\n" + key + std::to_string(binary.size()) + "\n" +
           std::to_string(std::hash<std::string_view>()(binary)) + "\n";
}

/// The binary kept for `key`, or nothing.
std::string load_binary(const std::string& key) {
    const fs::path path = binary_path(key);
    std::ifstream file(path, std::ios::binary);
    if (path.empty() || !file) return {};
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    // The binary stands behind two lines that follow the key.
    std::size_t begin = std::to_string(key.size()).size() + 1 + key.size();
    for (int line = 0; line < 2; ++line) {
        begin = bytes.find('\n', begin);
        if (begin == std::string::npos) return {};
        ++begin;
    }
    std::string binary = bytes.substr(begin);
    if (bytes.substr(0, begin) != head_of(key, binary)) return {};
    return binary;
}

/// A null handle where the binary does not serve.
ProgramHandle program_of(const Device& device, const ProgramSource& source,
                         const std::string& binary) {
    const cl_device_id id = device.id();
    const std::size_t size = binary.size();
    const auto* bytes = reinterpret_cast<const unsigned char*>(binary.data());
    cl_int status = CL_SUCCESS, code = CL_SUCCESS;
    ProgramHandle program(
        api().CreateProgramWithBinary(device.context(), 1, &id, &size, &bytes, &status, &code));
    if (code != CL_SUCCESS || status != CL_SUCCESS) return {};
    const std::string options = options_of(device, source);
    code = api().BuildProgram(program.get(), 1, &id, options.c_str(), nullptr, nullptr);
    return code == CL_SUCCESS ? std::move(program) : ProgramHandle();
}

/// Keeps the program's binary for later; whole or not at all.
void save_binary(const std::string& key, cl_program program) {
    std::size_t size = 0;
    if (api().GetProgramInfo(program, CL_PROGRAM_BINARY_SIZES, sizeof(size), &size, nullptr) !=
            CL_SUCCESS ||
        size == 0)
        return;
    std::string binary(size, '\0');
    char* bytes = binary.data();
    if (api().GetProgramInfo(program, CL_PROGRAM_BINARIES, sizeof(bytes), &bytes, nullptr) !=
        CL_SUCCESS)
        return;
    const fs::path path = binary_path(key);
    if (path.empty()) return;
    std::error_code error;
    fs::create_directories(path.parent_path(), error);
    const fs::path aside = path.string() + "." + std::to_string(getpid());
    {
        std::ofstream file(aside, std::ios::binary);
        file << head_of(key, binary) << binary;
        file.close();
        if (!file) {
            fs::remove(aside, error);
            return;
        }
    }
    fs::rename(aside, path, error);
    if (error) fs::remove(aside, error);
}

}  // namespace

std::string program_text(const ProgramSource& source) {
    std::string text = "#line 1 \"common.cl\"\n" + kernel_source("common.cl");
    for (const std::string& file : source.files)
        text += "#line 1 \"" + file + "\"\n" + kernel_source(file);
    return text + "// " + source.options + (source.sub_groups ? ", sub-groups\n" : "\n");
}

ProgramHandle build_program(const Device& device, const ProgramSource& source, bool keep_binary) {
    if (!keep_binary) return compile(device, source);
    const std::string key = binary_key(device, source);
    const std::string binary = load_binary(key);
    if (!binary.empty())
        if (ProgramHandle program = program_of(device, source, binary)) return program;
    ProgramHandle program = compile(device, source);
    save_binary(key, program.get());
    return program;
}

}  // namespace bvhlab::opencl
