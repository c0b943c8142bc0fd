#include "tests/architecture/include_rules.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <regex>
#include <sstream>

namespace fluorocut::architecture {
namespace {

// Where the first `folders` parts of a path end: "core/imaging/carm.h", 2 -> "core/imaging".
std::string_view folderOf(std::string_view path, int folders) {
    std::size_t end = 0;
    for (int i = 0; i < folders; ++i) {
        const std::size_t slash = path.find('/', end == 0 ? 0 : end + 1);
        if (slash == std::string_view::npos) return path.substr(0, end);
        end = slash;
    }
    return path.substr(0, end);
}

std::string_view coreFolderOf(std::string_view path) {
    const std::string_view folder = folderOf(path, 2);
    return folder.starts_with("core/") ? folder.substr(5) : std::string_view();
}

int orderOf(std::string_view folder) {
    const auto& all = coreFolders();
    const auto found = std::find(all.begin(), all.end(), folder);
    return found == all.end() ? -1 : static_cast<int>(found - all.begin());
}

bool isStage(std::string_view folder) {
    static constexpr std::array<std::string_view, 7> kStages{"distortion", "fiducial", "registration", "planning",
                                                             "cutting",    "robot",    "cavity"};
    return std::find(kStages.begin(), kStages.end(), folder) != kStages.end();
}

bool startsWithAny(std::string_view path, std::initializer_list<std::string_view> prefixes) {
    return std::any_of(prefixes.begin(), prefixes.end(), [&](std::string_view p) { return path.starts_with(p); });
}

// An estimator that can see the truth proves nothing.
bool maySeeSimulation(std::string_view file) {
    return startsWithAny(file, {"core/simulation/", "core/robot/adaptors/", "core/experiments/", "app/", "tests/"});
}

bool maySeeTruth(std::string_view file) {
    return startsWithAny(
        file, {"core/simulation/", "core/robot/adaptors/", "core/experiments/", "app/cli/commands/", "tests/"});
}

// The rules of one core folder using another; what[...] is the sentence's verb.
std::string coreViolation(std::string_view from, std::string_view to, bool simulated_adaptor) {
    if (from == to) return {};
    const int from_order = orderOf(from);
    const int to_order = orderOf(to);
    const std::string pair = "core/" + std::string(from) + " uses core/" + std::string(to);
    if (from_order < 0 || to_order < 0) return pair + ": a folder that is not in the list of core folders";
    if (isStage(from) && isStage(to)) return pair + ": stages do not use each other; procedure passes values";
    if (simulated_adaptor && to == "simulation") return {};
    if (to_order > from_order) return pair + ": a folder uses only those above it in the list";
    return {};
}

std::string thirdPartyViolation(std::string_view file, const std::string& include) {
    static const std::regex kInCppOnly(R"((itk[A-Z].*\.h(xx)?|vtk[A-Z].*\.h|opencv2/.*|assimp/.*|dcmtk/.*))");
    static const std::regex kNotInCore(R"((Q[A-Z]\w*|Q[A-Z]\w*/.*|q[a-z]+\.h|Qt\w*/.*|vtk[A-Z].*))");
    static const std::regex kNowhere(R"((gdcm.*|itkGDCM.*|opencv2/(imgcodecs|highgui)(/.*|\.hpp)))");
    if (std::regex_match(include, kNowhere)) return "brings in GDCM or its kind, which is kept out";
    if (file.ends_with(".h") && std::regex_match(include, kInCppOnly))
        return "headers of that library stay in .cpp files";
    if (file.starts_with("core/") && std::regex_match(include, kNotInCore)) return "core has no Qt and no rendering";
    return {};
}

std::string ownViolation(std::string_view file, std::string_view include) {
    const std::string_view from_room = folderOf(file, 1);
    const std::string_view to_room = folderOf(include, 1);
    if (to_room == "tests" && from_room != "tests") return "only tests include tests";
    if (to_room == "app" && from_room != "app" && from_room != "tests") return "nothing but app includes app";
    if (to_room == "ui" && from_room == "core") return "core never includes ui";
    if (to_room == "ui" && file.starts_with("app/cli/")) return "the command line runs without ui";
    if (include.starts_with("core/simulation/") && !maySeeSimulation(file)) {
        return "simulation is for tests, experiments, reports of error, simulated adaptors and programs that generate";
    }
    if (include == "core/simulation/truth.h" && !maySeeTruth(file)) {
        return "the truth is for tests, experiments, reports of error and simulated adaptors";
    }
    if (from_room == "core" && to_room == "core") {
        return coreViolation(coreFolderOf(file), coreFolderOf(include), file.starts_with("core/robot/adaptors/"));
    }
    return {};
}

}  // namespace

const std::vector<std::string>& coreFolders() {
    static const std::vector<std::string> folders{"base",       "geometry",   "image",        "io",        "imaging",
                                                  "distortion", "fiducial",   "registration", "planning",  "cutting",
                                                  "robot",      "cavity",     "fabrication",  "casestore", "procedure",
                                                  "simulation", "experiments"};
    return folders;
}

std::vector<Include> includesOf(std::string_view text) {
    static const std::regex kInclude(R"re(^\s*#\s*include\s*([<"])([^>"]*)[>"].*)re");
    std::vector<Include> includes;
    std::istringstream lines{std::string(text)};
    std::string line;
    bool in_comment = false;
    for (int number = 1; std::getline(lines, line); ++number) {
        std::smatch match;
        if (!in_comment && std::regex_match(line, match, kInclude)) {
            includes.push_back({number, match[2], match[1] == "\""});
            continue;
        }
        // Block comments that span lines; our sources use line comments, which cannot match above.
        const std::size_t open = line.rfind("/*");
        const std::size_t close = line.rfind("*/");
        if (open != std::string::npos && (close == std::string::npos || close < open)) in_comment = true;
        if (close != std::string::npos && (open == std::string::npos || open < close)) in_comment = false;
    }
    return includes;
}

std::string includeViolation(std::string_view file, const Include& include) {
    const bool ours = startsWithAny(include.path, {"app/", "core/", "ui/", "tests/"});
    std::string what;
    if (ours && !include.quoted) {
        what = "our own headers are included with quotes";
    } else if (!ours && include.quoted && !include.path.starts_with("resources/")) {
        what = "includes are written from the root (core/geometry/rigid3.h)";
    } else {
        what = ours ? ownViolation(file, include.path) : thirdPartyViolation(file, include.path);
    }
    if (what.empty()) return {};
    return std::string(file) + ":" + std::to_string(include.line) + " includes " + include.path + ": " + what;
}

std::vector<std::string> linkedFolders(std::string_view cmake_text) {
    static const std::regex kComment("#[^\n]*");
    static const std::regex kLibrary(R"(\bfluorocut_([a-z_]+)\b(?!\s*\())");
    const std::string text = std::regex_replace(std::string(cmake_text), kComment, "");
    std::vector<std::string> folders;
    for (std::sregex_iterator it(text.begin(), text.end(), kLibrary), end; it != end; ++it) {
        const std::string name = (*it)[1];
        if (name != "settings") folders.push_back(name);
    }
    return folders;
}

std::string linkViolation(std::string_view folder, std::string_view linked) {
    const std::string what = coreViolation(folder, linked, folder == "robot");
    return what.empty() ? what : "core/" + std::string(folder) + "/CMakeLists.txt: " + what;
}

std::vector<std::string> unwantedLibraries(std::string_view ldd_output) {
    // GDCM and what brings it in; Qt, VTK and X do not belong in a program without a screen.
    // libX11 itself does no harm: OpenCV's core is linked with it and never opens a display.
    static const std::regex kUnwanted(R"((gdcm|imgcodecs|highgui|libQt\d|libvtk|not found))", std::regex::icase);
    std::vector<std::string> unwanted;
    std::istringstream lines{std::string(ldd_output)};
    std::string line;
    while (std::getline(lines, line)) {
        if (std::regex_search(line, kUnwanted)) unwanted.push_back(line);
    }
    return unwanted;
}

}  // namespace fluorocut::architecture
