#include "tests/support/fixtures.h"

#include <cstdlib>

#include <unistd.h>

namespace fluorocut::test {

namespace fs = std::filesystem;

fs::path sharedData() {
    const char* override_path = std::getenv("FLUOROCUT_TEST_DATA");
    const fs::path path = override_path ? fs::path(override_path) : fs::path(FLUOROCUT_SOURCE_DIR) / "../shared/data";
    return fs::is_directory(path) ? fs::canonical(path) : fs::path();
}

ScratchFolder::ScratchFolder() {
    std::string pattern = (fs::temp_directory_path() / "fluorocut-test-XXXXXX").string();
    if (!mkdtemp(pattern.data())) throw std::runtime_error("cannot make a scratch folder " + pattern);
    path_ = pattern;
}

ScratchFolder::~ScratchFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
}

}  // namespace fluorocut::test
