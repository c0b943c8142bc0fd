// The house as it stands, held against its rules.
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <stdexcept>

#include <gmock/gmock.h>

#include "tests/architecture/include_rules.h"

namespace fluorocut::architecture {
namespace {

namespace fs = std::filesystem;

const fs::path kRoot = FLUOROCUT_SOURCE_DIR;

std::string content(const fs::path& path) {
    std::ifstream stream(path, std::ios::binary);
    if (!stream) throw std::runtime_error("cannot read " + path.string());
    return {std::istreambuf_iterator<char>(stream), {}};
}

// Relative paths of all our sources below a room.
std::vector<std::string> sourcesOf(const std::string& room) {
    std::vector<std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(kRoot / room)) {
        const std::string extension = entry.path().extension().string();
        if (extension == ".h" || extension == ".cpp") files.push_back(fs::relative(entry.path(), kRoot).string());
    }
    return files;
}

std::string outputOf(const std::string& command) {
    const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
    if (!pipe) throw std::runtime_error("cannot run " + command);
    std::string output;
    std::array<char, 4096> buffer{};
    while (const std::size_t n = fread(buffer.data(), 1, buffer.size(), pipe.get()))
        output.append(buffer.data(), n);
    return output;
}

class Room : public testing::TestWithParam<std::string> {};

TEST_P(Room, IncludesOnlyWhatItMay) {
    const auto files = sourcesOf(GetParam());
    EXPECT_FALSE(files.empty());
    for (const std::string& file : files) {
        for (const Include& include : includesOf(content(kRoot / file))) {
            EXPECT_EQ(includeViolation(file, include), "");
            if (include.quoted) {
                EXPECT_TRUE(fs::exists(kRoot / include.path)) << file << " includes " << include.path;
            }
        }
    }
}

TEST_P(Room, OpensEveryHeaderWithItsPurpose) {
    for (const std::string& file : sourcesOf(GetParam())) {
        if (!file.ends_with(".h")) continue;
        const std::string text = content(kRoot / file);
        EXPECT_TRUE(text.starts_with("// ")) << file << " does not say first what it is for";
        EXPECT_NE(text.find("\n#pragma once\n"), std::string::npos) << file;
    }
}

INSTANTIATE_TEST_SUITE_P(House, Room, testing::Values("app", "core", "tests", "ui"),
                         [](const auto& room) { return room.param; });

TEST(House, CoreLibrariesLinkOnlyWhatTheyMay) {
    int folders = 0;
    for (const auto& entry : fs::directory_iterator(kRoot / "core")) {
        if (!entry.is_directory()) continue;
        const std::string folder = entry.path().filename().string();
        EXPECT_THAT(coreFolders(), testing::Contains(folder)) << "name it in the list of core folders";
        for (const std::string& linked : linkedFolders(content(entry.path() / "CMakeLists.txt"))) {
            EXPECT_EQ(linkViolation(folder, linked), "");
        }
        ++folders;
    }
    EXPECT_GE(folders, 5);
}

TEST(House, TheCommandLineLinksNeitherGdcmNorAScreen) {
    const std::string libraries = outputOf("ldd '" FLUOROCUT_CLI "'");
    ASSERT_THAT(libraries, testing::HasSubstr("libc.so")) << "ldd gave no list";
    EXPECT_THAT(unwantedLibraries(libraries), testing::IsEmpty());
}

}  // namespace
}  // namespace fluorocut::architecture
