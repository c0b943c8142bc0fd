#include "core/base/error.h"

#include <stdexcept>
#include <utility>

namespace fluorocut {

std::string_view name(ErrorCode code) {
    switch (code) {
        case ErrorCode::invalidOption:
            return "invalidOption";
        case ErrorCode::invalidInput:
            return "invalidInput";
        case ErrorCode::outputFailed:
            return "outputFailed";
        case ErrorCode::noSolution:
            return "noSolution";
        case ErrorCode::cancelled:
            return "cancelled";
    }
    throw std::logic_error("ErrorCode outside its enumeration");
}

std::string Error::message() const {
    if (isCancelled()) return where + ": cancelled.";
    std::string text = where + ": found " + found;
    if (!expected.empty()) text += ", expected " + expected;
    if (!advice.empty()) text += "; " + advice;
    if (!text.ends_with('.')) text += '.';
    return text;
}

Error invalidOption(std::string where, std::string found, std::string expected, std::string advice) {
    return {ErrorCode::invalidOption, std::move(where), std::move(found), std::move(expected), std::move(advice)};
}

Error invalidInput(std::string where, std::string found, std::string expected, std::string advice) {
    return {ErrorCode::invalidInput, std::move(where), std::move(found), std::move(expected), std::move(advice)};
}

Error outputFailed(std::string where, std::string found, std::string advice) {
    return {ErrorCode::outputFailed, std::move(where), std::move(found), {}, std::move(advice)};
}

Error noSolution(std::string where, std::string found, std::string expected, std::string advice) {
    return {ErrorCode::noSolution, std::move(where), std::move(found), std::move(expected), std::move(advice)};
}

Error cancelled(std::string where) {
    return {ErrorCode::cancelled, std::move(where), {}, {}, {}};
}

}  // namespace fluorocut
