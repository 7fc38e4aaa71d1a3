// SPDX-License-Identifier: GPL-3.0-or-later
// What a device's sub-groups are good for: members of Device (opencl/device.h).
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "base/token.h"
#include "opencl/commands.h"
#include "opencl/device.h"

namespace bvhlab::opencl {
namespace {

/// clGetKernelSubGroupInfo of OpenCL 2.1, or of cl_khr_subgroups with KHR behind its name.
using AskSubGroups = cl_int(CL_API_CALL*)(cl_kernel, cl_device_id, cl_uint, std::size_t,
                                          const void*, std::size_t, void*, std::size_t*);
constexpr cl_uint largest_size_for_range = 0x2033;  // CL_KERNEL_MAX_SUB_GROUP_SIZE_FOR_NDRANGE

/// In the order of team_check.cl.
constexpr std::array<const char*, 4> operations{"the numbers of threads", "votes",
                                                "meetings over local memory", "shuffles"};
constexpr std::size_t votes = 1, shuffles = 3;

/// cl_khr_subgroups is written against OpenCL C 2.0, and its functions are a feature of 3.0, but
/// compilers offer them to 1.2, too, which has the least that a driver can do wrong.
constexpr std::array<const char*, 3> standards{"CL1.2", "CL3.0", "CL2.0"};

/// How often each operation went wrong in a few work-groups.
std::array<std::uint32_t, operations.size()> wrong_operations(Device& device) {
    constexpr std::size_t groups = 3;
    Token token;
    Commands commands(device, token);
    Program program(device, {{"team.cl", "team_check.cl"}, "", true});
    Kernel& kernel = program["check_team"];
    const std::size_t group = std::min<std::size_t>(64, kernel.largest_group);
    const auto wrong = commands.buffer<std::uint32_t>(operations.size());
    const auto next = commands.buffer<std::uint32_t>(1);
    const auto taken = commands.buffer<std::uint32_t>(groups * group);
    commands.fill(wrong, 0U);
    commands.fill(next, 0U);
    commands.fill(taken, 0U);
    const Local words{group * sizeof(std::uint32_t)};
    commands.run(kernel, Range(groups * group, group), wrong, next, taken, words, words);

    std::array<std::uint32_t, operations.size()> counts;
    commands.download(wrong, std::span<std::uint32_t>(counts));
    // Each thread takes one number, in one of the rounds.
    std::vector<std::uint32_t> times(taken.size());
    commands.download(taken, std::span(times));
    counts[votes] += std::uint32_t(std::ranges::count_if(times, [](auto t) { return t != 1; }));
    return counts;
}

}  // namespace

std::size_t Device::sub_group_size(cl_kernel kernel, std::size_t group) const {
    cl_platform_id platform = nullptr;
    check(api().GetDeviceInfo(id_, CL_DEVICE_PLATFORM, sizeof(platform), &platform, nullptr),
          "clGetDeviceInfo");
    const auto find = [&](const char* name) {
        return reinterpret_cast<AskSubGroups>(
            api().GetExtensionFunctionAddressForPlatform(platform, name));
    };
    auto ask = find("clGetKernelSubGroupInfoKHR");
    if (!ask) ask = find("clGetKernelSubGroupInfo");
    std::size_t size = 0;
    if (!ask || ask(kernel, id_, largest_size_for_range, sizeof(group), &group, sizeof(size), &size,
                    nullptr) != CL_SUCCESS)
        return 0;
    return size;
}

/// What a driver claims is not enough here either: a small kernel must compile, and come to what
/// local memory comes to.
void Device::check_sub_groups() {
    SubGroups& found = info_.sub_groups;
    if (found.standard.empty()) return;
    const std::string driver = "its driver (" + info_.driver + ") ";
    std::string log;
    for (const char* const standard : standards) {
        found.standard = standard;
        try {
            const auto wrong = wrong_operations(*this);
            found.shuffles &= wrong[shuffles] == 0;
            const auto bad = std::ranges::find_if(wrong, [](auto count) { return count != 0; });
            found.usable = bad - wrong.begin() >= std::ptrdiff_t(shuffles);
            found.reason = bad == wrong.end()
                               ? ""
                               : driver + "gets " + operations[std::size_t(bad - wrong.begin())] +
                                     " of sub-groups wrong";
            return;
        } catch (const Error& error) {
            if (log.empty()) log = error.what();
        }
    }
    found = SubGroups();
    found.reason = driver + "claims sub-groups, but does not compile them: " + log;
}

}  // namespace bvhlab::opencl
