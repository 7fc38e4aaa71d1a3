// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/builders.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "build/atrbvh.h"
#include "build/hlbvh.h"
#include "build/ploc.h"
#include "build/prbvh.h"
#include "build/prbvh_a.h"
#include "build/sbvh.h"
#include "build/trbvh.h"
#include "opencl/atrbvh.h"
#include "opencl/hlbvh.h"
#include "opencl/lbvh.h"
#include "opencl/ploc.h"
#include "opencl/prbvh.h"
#include "opencl/prbvh_a.h"
#include "opencl/trbvh.h"

namespace bvhlab::opencl {
namespace {

/// What a builder is given.
struct Job {
    Commands& commands;
    const Mesh& mesh;
    const DeviceMesh& on_device;
    const CostModel& model;
    const Parameters& parameters;
    Token& token;
    BuildLog& log;
};

struct DeviceBuilder {
    std::string_view id;
    DeviceBinary (*build)(const Job&);  ///< null: the CPU core makes the tree
};

const DeviceBuilder device_builders[] = {
    {"lbvh", [](const Job& job) { return build_lbvh(job.commands, job.on_device, job.token); }},
    {"hlbvh",
     [](const Job& job) {
         return build_hlbvh(job.commands, job.on_device, hlbvh_config(job.parameters), job.token);
     }},
    {"ploc",
     [](const Job& job) {
         return build_ploc(job.commands, job.on_device, ploc_config(job.parameters), job.token);
     }},
    {"atrbvh",
     [](const Job& job) {
         return build_atrbvh(job.commands, job.on_device, job.model, atrbvh_config(job.parameters),
                             job.token, job.log);
     }},
    {"prbvh",
     [](const Job& job) {
         return build_prbvh(job.commands, job.on_device, job.model, prbvh_config(job.parameters),
                            job.token, job.log);
     }},
    {"prbvh_a",
     [](const Job& job) {
         return build_prbvh_a(job.commands, job.on_device, job.model,
                              annealing_config(job.parameters), job.token, job.log);
     }},
    {"prbvh_s",
     [](const Job& job) {
         return build_prbvh_s(job.commands, job.mesh, job.model, sbvh_config(job.parameters),
                              prbvh_config(job.parameters), job.token, job.log);
     }},
    {"prbvh_sa",
     [](const Job& job) {
         return build_prbvh_sa(job.commands, job.mesh, job.model, sbvh_config(job.parameters),
                               annealing_config(job.parameters), job.token, job.log);
     }},
    {"sah", nullptr},
    {"sbvh", nullptr},
    {"trbvh",
     [](const Job& job) {
         return build_trbvh(job.commands, job.on_device, job.model, trbvh_config(job.parameters),
                            job.token, job.log);
     }},
    {"hybrid", nullptr},
};

const DeviceBuilder& find(std::string_view id) {
    std::string known;
    for (const DeviceBuilder& builder : device_builders) {
        if (builder.id == id) return builder;
        known += (known.empty() ? "" : ", ") + std::string(builder.id);
    }
    throw std::invalid_argument("builder '" + std::string(id) +
                                "' is not there on OpenCL devices: choose device cpu, or one of " +
                                known);
}

}  // namespace

// --- times --------------------------------------------------------------------------------------

CallTimer::CallTimer(Commands& commands)
    : commands_(commands),
      programs_before_(commands.device().build_seconds()),
      transfers_before_(commands.times().transfer_seconds) {}

CallTimes CallTimer::stop() {
    commands_.finish();
    CallTimes times;
    const double wall = watch_.seconds();
    times.device = commands_.times();
    times.program_seconds = commands_.device().build_seconds() - programs_before_;
    const double transfers = times.device.transfer_seconds - transfers_before_;
    // Another thread's programs may have been built meanwhile.
    times.seconds = std::max(wall - transfers - times.program_seconds, 0.0);
    return times;
}

// --- builders -----------------------------------------------------------------------------------

bool made_on_device(std::string_view builder) {
    return find(builder).build != nullptr;
}

BuiltTree build_tree(Commands& commands, const Mesh& mesh, const BuilderInfo& builder,
                     const CostModel& model, const Parameters& parameters, Token& token) {
    const DeviceBuilder& ours = find(builder.id);
    BuiltTree tree{};
    tree.made_on_device = ours.build != nullptr;
    CallTimer timer(commands);
    tree.mesh = upload(commands, mesh);
    commands.stage("building");
    if (ours.build) {
        tree.binary = ours.build({commands, mesh, tree.mesh, model, parameters, token, tree.log});
    } else {
        const BinaryBvh binary = builder.build(mesh, model, parameters, token, tree.log);
        tree.binary = upload(commands, binary);
    }
    tree.times = timer.stop();
    return tree;
}

}  // namespace bvhlab::opencl
