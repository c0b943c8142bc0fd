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
    if (can.frames > 0 && !(request.frame >= 1 && request.frame <= can.frames)) {
        return invalidOption(source.name() + ", frame", fmt::format("{}", request.frame),
                             fmt::format("1 to {}", can.frames));
    }
    return {};
}

}  // namespace fluorocut
