// SPDX-License-Identifier: GPL-3.0-or-later
// Devices, programs, buffers and commands; on PoCL in CI.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <numeric>
#include <string>
#include <vector>

#include "opencl/commands.h"
#include "opencl/program.h"

namespace bvhlab::opencl {
namespace {

std::shared_ptr<Device> device() {
    return Device::open("opencl");
}

TEST(OpenClDevice, IsFoundAndSaysWhatItIs) {
    const auto all = devices();
    ASSERT_FALSE(all.empty());
    const DeviceInfo& info = device()->info();
    EXPECT_TRUE(info.available);
    EXPECT_EQ(info.id, "opencl:" + info.platform + "/" + info.name);
    EXPECT_GT(info.memory, 1U << 20U);
    EXPECT_GE(info.memory, info.largest_buffer);
    EXPECT_EQ(Device::open(info.id), device());
}

TEST(OpenClDevice, AnUnknownOneIsAnsweredWithThoseThereAre) {
    try {
        Device::open("opencl:nobody/nothing");
        FAIL();
    } catch (const std::invalid_argument& error) {
        EXPECT_NE(std::string(error.what()).find(device()->info().id), std::string::npos);
    }
}

TEST(OpenClDevice, ABufferThatDoesNotFitSaysWhatIsNeeded) {
    const std::size_t bytes = std::size_t(device()->info().largest_buffer) + 1;
    try {
        Buffer<std::uint8_t>(*device(), bytes);
        FAIL();
    } catch (const MemoryError& error) {
        EXPECT_NE(std::string(error.what()).find("MiB are needed"), std::string::npos);
    }
}

TEST(OpenClDevice, ManyBuffersTogetherMustFitToo) {
    Device& open = *device();
    EXPECT_THROW(open.take_memory(std::size_t(open.info().memory) + 1), MemoryError);
    open.take_memory(1000);  // nothing was kept of the failed one
    open.give_memory(1000);
}

TEST(OpenClDevice, SaysWhyItDoesNotUseSubGroups) {
    const SubGroups& sub_groups = device()->info().sub_groups;
    EXPECT_NE(sub_groups.usable && sub_groups.shuffles && sub_groups.ballots,
              !sub_groups.reason.empty())
        << sub_groups.reason;
    if (!sub_groups.usable) GTEST_SKIP() << "no sub-groups: " << sub_groups.reason;
    EXPECT_FALSE(sub_groups.standard.empty());
    Program program(*device(), {{"team.cl", "team_check.cl"}, "", true});
    const Kernel& kernel = program["check_team"];
    for (const std::size_t group : {7, 32, 64}) {
        const std::size_t size = device()->sub_group_size(kernel.handle.get(), group);
        EXPECT_GT(size, 0U);
    }
}

TEST(OpenClProgram, ABuildErrorNamesDriverAndLine) {
    try {
        device()->program({{"arithmetic.cl"}, "-DBox=1"});
        FAIL();
    } catch (const Error& error) {
        const std::string text = error.what();
        EXPECT_NE(text.find(device()->info().driver), std::string::npos);
        EXPECT_NE(text.find("common.cl"), std::string::npos) << text;
    }
}

TEST(OpenClProgram, IsBuiltOnce) {
    const ProgramSource source{{"arithmetic.cl"}, "-DTWICE"};
    const cl_program first = device()->program(source);
    const double seconds = device()->build_seconds();
    EXPECT_EQ(device()->program(source), first);
    EXPECT_EQ(device()->build_seconds(), seconds);
}

TEST(OpenClProgram, IsKeptAsABinaryThatMayBeSpoilt) {
    namespace fs = std::filesystem;
    const fs::path folder =
        fs::temp_directory_path() / ("bvhlab_cache_" + std::to_string(getpid()));
    const char* const before = std::getenv("XDG_CACHE_HOME");
    const std::string kept = before ? before : "";
    device();  // PoCL's own cache stays where it is
    setenv("XDG_CACHE_HOME", folder.c_str(), 1);
    const ProgramSource source{{"arithmetic.cl"}, "-DKEPT"};
    const auto files = [&] {
        std::vector<fs::path> all;
        for (const auto& entry : fs::directory_iterator(folder / "bvh_lab" / "opencl"))
            all.push_back(entry.path());
        return all;
    };
    EXPECT_TRUE(build_program(*device(), source, true));
    ASSERT_EQ(files().size(), 1U);
    const auto written = fs::last_write_time(files()[0]);
    EXPECT_TRUE(build_program(*device(), source, true));  // from the file
    EXPECT_EQ(fs::last_write_time(files()[0]), written);
    fs::resize_file(files()[0], fs::file_size(files()[0]) / 2);
    EXPECT_TRUE(build_program(*device(), source, true));
    fs::permissions(folder / "bvh_lab" / "opencl", fs::perms::owner_read | fs::perms::owner_exec);
    EXPECT_TRUE(build_program(*device(), {{"arithmetic.cl"}, "-DNOT_KEPT"}, true));
    fs::permissions(folder / "bvh_lab" / "opencl", fs::perms::owner_all);
    fs::remove_all(folder);
    before ? setenv("XDG_CACHE_HOME", kept.c_str(), 1) : unsetenv("XDG_CACHE_HOME");
}

TEST(OpenClCommands, CopyWhatTheyAreGiven) {
    const Token token;
    Commands commands(*device(), token);
    std::vector<int> values(1000), back(1000);
    std::iota(values.begin(), values.end(), 0);
    const auto buffer = commands.upload(std::span(values));
    const auto copied = commands.buffer<int>(1000);
    commands.copy(buffer, copied, 1000);
    commands.download(copied, std::span(back));
    EXPECT_EQ(back, values);
    EXPECT_EQ(commands.value(buffer, 17), 17);
    commands.fill(buffer, 3);
    EXPECT_EQ(commands.value(buffer, 999), 3);
    EXPECT_EQ(commands.times().transfer_bytes, 4000U + 4000U + 4U + 4U);
}

TEST(OpenClCommands, StopAfterACancel) {
    Token token;
    Commands commands(*device(), token);
    token.cancel();
    Program program(*device(), {{"arithmetic.cl"}, ""});
    EXPECT_THROW(commands.run(program["check_arithmetic"], 1, 0.0F, 0.0F, 0.0F, 0.0, 0.0,
                              commands.buffer<float>(4), commands.buffer<double>(4)),
                 Cancelled);
}

TEST(OpenClCommands, AnArgumentOfTheWrongSizeIsNamed) {
    const Token token;
    Commands commands(*device(), token);
    Program program(*device(), {{"arithmetic.cl"}, ""});
    try {
        commands.run(program["check_arithmetic"], 1, 0.0);
        FAIL();
    } catch (const Error& error) {
        EXPECT_NE(std::string(error.what()).find("argument 0 of kernel 'check_arithmetic'"),
                  std::string::npos);
    }
}

}  // namespace
}  // namespace bvhlab::opencl
