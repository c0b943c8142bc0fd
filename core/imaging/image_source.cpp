#include "core/imaging/image_source.h"

#include <fmt/format.h>

namespace fluorocut {

Result<void> checkRequest(const ImageSource& source, const ImageRequest& request) {
    const ImageSourceCapabilities can = source.capabilities();
    if (request.position) {
        if (!can.moves) {
            return invalidOption(source.name() + ", position", "a request to move",
                                 "a request without a position: this source cannot move the C-arm");
        }
        if (auto ok = request.position->validate(); !ok) return ok;
    }
    if (request.frame < 0 || (can.frames > 0 && request.frame >= can.frames)) {
        return invalidOption(source.name() + ", frame", fmt::format("{}", request.frame),
                             can.frames > 0 ? fmt::format("0 to {}", can.frames - 1) : "0 or more");
    }
    return {};
}

}  // namespace fluorocut
