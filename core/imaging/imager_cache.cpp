#include "core/imaging/imager_cache.h"

#include <algorithm>

namespace fluorocut {
namespace {

constexpr std::size_t kMostEntries = 4, kMostBytes = std::size_t{128} << 20;

}  // namespace

std::shared_ptr<const void> ImagerCache::find(std::type_index type, const PixelGrid& grid) {
    const std::lock_guard lock(mutex_);
    const auto found = std::find_if(entries_.begin(), entries_.end(),
                                    [&](const Entry& entry) { return entry.type == type && entry.grid == grid; });
    if (found == entries_.end()) return nullptr;
    std::rotate(found, found + 1, entries_.end());
    return entries_.back().value;
}

void ImagerCache::keep(Entry entry) {
    if (entry.bytes > kMostBytes) return;
    std::vector<Entry> dropped;  // freed without the lock
    const std::lock_guard lock(mutex_);
    std::size_t bytes = entry.bytes;
    entries_.push_back(std::move(entry));
    std::size_t kept = 1;
    while (kept < entries_.size() && kept < kMostEntries) {
        bytes += entries_[entries_.size() - 1 - kept].bytes;
        if (bytes > kMostBytes) break;
        ++kept;
    }
    const auto end = entries_.end() - static_cast<std::ptrdiff_t>(kept);
    dropped.assign(std::make_move_iterator(entries_.begin()), std::make_move_iterator(end));
    entries_.erase(entries_.begin(), end);
}

}  // namespace fluorocut
