// Errors that are expected to happen: a bad file, a ring that is not in the image, a fit that does not converge.
//
// A broken contract (our own bug) is not an Error: it throws std::logic_error. Exceptions of libraries are caught in
// the .cpp that calls the library and become an Error there.
//
// An Error's text is one clear sentence for the person at the screen: which file or field, what was found, what was
// expected, and what to do. Build it with the factory functions so that all four are thought of.
#pragma once

#include <string>
#include <string_view>

namespace fluorocut {

enum class ErrorCode {
    invalidOption,  // an argument or an option's value is outside its limits
    invalidInput,   // an input file is missing, malformed, unsupported or contradicts another
    outputFailed,   // a result could not be written (disk full, no permission)
    noSolution,     // the step ran and found nothing it can answer for
    cancelled,      // the user asked to stop; not a failure
};

// "invalidInput", "noSolution", ...: the stable name used in JSON output and logs.
std::string_view name(ErrorCode code);

struct Error {
    ErrorCode code = ErrorCode::noSolution;
    std::string where;     // file, field or step ("pelvis.nii.gz, header field pixdim[1]")
    std::string found;     // what was found ("NaN")
    std::string expected;  // what was expected ("a spacing between 0.01 and 50 mm")
    std::string advice;    // what to do, empty when it is obvious

    // "pelvis.nii.gz, header field pixdim[1]: found NaN, expected a spacing between 0.01 and 50 mm; export it again."
    std::string message() const;

    bool isCancelled() const { return code == ErrorCode::cancelled; }
};

Error invalidOption(std::string where, std::string found, std::string expected, std::string advice = {});
Error invalidInput(std::string where, std::string found, std::string expected, std::string advice = {});
Error outputFailed(std::string where, std::string found, std::string advice = {});
Error noSolution(std::string where, std::string found, std::string expected, std::string advice = {});
Error cancelled(std::string where);

}  // namespace fluorocut
