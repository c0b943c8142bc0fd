#include "core/imaging/slab/slab_volume.h"

#include <algorithm>
#include <cmath>
#include <new>

#include <sys/mman.h>

#include "core/base/parallel.h"

namespace fluorocut {
namespace {

constexpr std::ptrdiff_t kBefore = 32;  // readable voxels before the first row
constexpr std::ptrdiff_t kBeyond = 66;  // ... and beyond each row: a window of 64 and its second tap

std::ptrdiff_t paddedLength(int columns) {
    return (columns + kBeyond + 31) / 32 * 32;
}

// Zeroed memory in large pages where the system has them: the projector streams through all of it.
std::shared_ptr<std::int16_t> allocateZeroed(std::size_t count) {
    const std::size_t bytes = count * sizeof(std::int16_t);
    void* memory = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) throw std::bad_alloc();
    ::madvise(memory, bytes, MADV_HUGEPAGE);
    return {static_cast<std::int16_t*>(memory), [bytes](std::int16_t* p) { ::munmap(p, bytes); }};
}

void findExtents(SlabOrientation& o) {
    o.extents.assign(static_cast<std::size_t>(o.slices), {o.rows, -1, o.columns, -1});
    parallelFor(o.extents.size(), 4, [&](std::size_t begin, std::size_t end) {
        for (std::size_t slice = begin; slice < end; ++slice) {
            SlabOrientation::Extent& extent = o.extents[slice];
            for (int r = 0; r < o.rows; ++r) {
                const std::int16_t* row =
                    o.first + o.slice_stride * static_cast<std::ptrdiff_t>(slice) + o.row_stride * r;
                int first = 0, last = o.columns - 1;
                while (first <= last && row[first] == 0)
                    ++first;
                if (first > last) continue;
                while (row[last] == 0)
                    --last;
                extent.row_first = std::min(extent.row_first, r);
                extent.row_last = r;
                extent.column_first = std::min(extent.column_first, first);
                extent.column_last = std::max(extent.column_last, last);
            }
        }
    });
    o.slice_first = o.slices;
    o.slice_last = -1;
    for (int slice = 0; slice < o.slices; ++slice) {
        if (o.extents[static_cast<std::size_t>(slice)].empty()) continue;
        o.slice_first = std::min(o.slice_first, slice);
        o.slice_last = slice;
    }
}

}  // namespace

SlabVolume::SlabVolume(const Volume& hounsfield, float air_below_hu) {
    const int ni = hounsfield.size(0), nj = hounsfield.size(1), nk = hounsfield.size(2);
    float densest = 1;
    for (const float hu : hounsfield.voxels())
        densest = std::max(densest, hu + 1000);
    const float units_per_hu = 32767 / densest;
    hu_per_unit_ = densest / 32767.0;

    const std::ptrdiff_t along_i = paddedLength(ni), along_j = paddedLength(nj);
    rows_along_i_ = allocateZeroed(static_cast<std::size_t>(kBefore + along_i * nj * nk + kBeyond));
    rows_along_j_ = allocateZeroed(static_cast<std::size_t>(kBefore + along_j * ni * nk + kBeyond));
    std::int16_t* by_i = rows_along_i_.get() + kBefore;
    std::int16_t* by_j = rows_along_j_.get() + kBefore;
    parallelFor(static_cast<std::size_t>(nk), 1, [&](std::size_t begin, std::size_t end) {
        for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k) {
            for (int j = 0; j < nj; ++j) {
                const float* from = hounsfield.row(j, k);
                std::int16_t* to = by_i + along_i * (static_cast<std::ptrdiff_t>(k) * nj + j);
                for (int i = 0; i < ni; ++i) {
                    const float value = from[i] > air_below_hu ? (from[i] + 1000) * units_per_hu + 0.5f : 0.0f;
                    to[i] = static_cast<std::int16_t>(std::clamp(value, 0.0f, 32767.0f));
                }
            }
            // Slice i, row k, column j. Blocked, so that both sides stay in the cache.
            constexpr int kBlock = 32;
            for (int i0 = 0; i0 < ni; i0 += kBlock) {
                for (int j0 = 0; j0 < nj; j0 += kBlock) {
                    for (int i = i0; i < std::min(i0 + kBlock, ni); ++i) {
                        std::int16_t* to = by_j + along_j * (static_cast<std::ptrdiff_t>(i) * nk + k);
                        const std::int16_t* column = by_i + along_i * (static_cast<std::ptrdiff_t>(k) * nj) + i;
                        for (int j = j0; j < std::min(j0 + kBlock, nj); ++j)
                            to[j] = column[along_i * j];
                    }
                }
            }
        }
    });

    orientations_[0] = {0, 1, 2, ni, nk, nj, along_j, along_j * nk, by_j, {}};
    orientations_[1] = {1, 0, 2, nj, nk, ni, along_i * nj, along_i, by_i, {}};
    orientations_[2] = {2, 0, 1, nk, nj, ni, along_i, along_i * nj, by_i, {}};
    for (SlabOrientation& orientation : orientations_)
        findExtents(orientation);
}

std::pair<Vector3, Vector3> SlabVolume::occupied() const {
    Vector3 low = Vector3::Zero(), high = Vector3::Zero();
    for (const SlabOrientation& o : orientations_) {
        if (o.slice_first > o.slice_last) continue;
        low[o.main_axis] = o.slice_first - 1;
        high[o.main_axis] = o.slice_last + 1;
    }
    return {low, high};
}

}  // namespace fluorocut
