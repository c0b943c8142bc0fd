// ImagerCache: what a projector works out once for the pixels of a distorted imager (where every one of them looks) and
// needs at each projection. It lives and dies with the distortion, which never changes; a copy starts empty. Any thread
// may ask; two that ask for the same at once may both work it out.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <typeindex>
#include <vector>

#include "core/geometry/rigid3.h"

namespace fluorocut {

// All of an imager that decides where its pixels lie in the detector plane.
struct PixelGrid {
    int columns = 0, rows = 0;
    Vector2 pixel_mm = Vector2::Zero(), principal_point_px = Vector2::Zero();

    bool operator==(const PixelGrid&) const = default;
};

class ImagerCache {
  public:
    ImagerCache() = default;
    ImagerCache(const ImagerCache&) {}
    ImagerCache& operator=(const ImagerCache&) { return *this; }

    // The T of this grid, made by `make` (a std::shared_ptr<const T>) unless it is at hand. `bytes`: its size. The four
    // used last are kept, up to 128 MB in all.
    template <class T, class Make>
    std::shared_ptr<const T> get(const PixelGrid& grid, std::size_t bytes, const Make& make) {
        if (std::shared_ptr<const void> known = find(typeid(T), grid)) return std::static_pointer_cast<const T>(known);
        const std::shared_ptr<const T> made = make();
        keep({typeid(T), grid, bytes, made});
        return made;
    }

  private:
    struct Entry {
        std::type_index type;
        PixelGrid grid;
        std::size_t bytes;
        std::shared_ptr<const void> value;
    };
    std::shared_ptr<const void> find(std::type_index type, const PixelGrid& grid);
    void keep(Entry entry);

    std::mutex mutex_;
    std::vector<Entry> entries_;  // the one used last at the end
};

}  // namespace fluorocut
