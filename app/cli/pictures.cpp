#include "app/cli/pictures.h"

#include <functional>
#include <string_view>

namespace fluorocut::cli {

Result<void> Pictures::add(const std::string& name, const Image& image) {
    const auto& pixels = image.pixels();
    const std::string_view bytes(reinterpret_cast<const char*>(pixels.data()), pixels.size() * sizeof(pixels[0]));
    const auto [other, is_new] = seen_.try_emplace(std::hash<std::string_view>()(bytes), name);
    if (is_new) return {};
    return invalidInput(name, "the same picture as " + other->second, "another exposure for each",
                        "give each picture once");
}

}  // namespace fluorocut::cli
