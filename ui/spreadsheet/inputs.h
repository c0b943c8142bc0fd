// Inputs: what a picture of the spreadsheet was worked out from, as an identity: two that are equal give the same
// picture. Images, volumes and meshes count by which object they are (they are never changed), numbers by their bits.
// The objects are held on to, so that none of them can be another one at the same place in memory.
//
// Memo: results kept by their inputs, for several threads: what one works out, the others wait for and share.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/rigid3.h"
#include "core/imaging/carm.h"

namespace fluorocut::ui {

class Inputs {
  public:
    template <class T>
    Inputs& add(const std::shared_ptr<const T>& object) {
        objects_.push_back(object);
        return *this;
    }
    Inputs& add(double value) {
        bits_.push_back(std::bit_cast<std::uint64_t>(value));
        return *this;
    }
    Inputs& add(const std::string& text) {
        texts_.push_back(text);
        return *this;
    }
    Inputs& add(const Vector3& v) { return add(v.x()).add(v.y()).add(v.z()); }
    Inputs& add(const Rigid3& motion) {
        const Eigen::Quaterniond& q = motion.rotation();
        return add(q.w()).add(q.x()).add(q.y()).add(q.z()).add(motion.translation());
    }
    Inputs& add(const CArm& carm) {
        return add(carm.distortion)
            .add(carm.columns)
            .add(carm.rows)
            .add(carm.pixel_mm.x())
            .add(carm.pixel_mm.y())
            .add(carm.focal_length_mm)
            .add(carm.principal_point_px.x())
            .add(carm.principal_point_px.y());
    }

    friend bool operator==(const Inputs&, const Inputs&) = default;

  private:
    std::vector<std::shared_ptr<const void>> objects_;
    std::vector<std::uint64_t> bits_;
    std::vector<std::string> texts_;
};

template <class T>
class Memo {
  public:
    // Keeps the latest `most` results.
    explicit Memo(std::size_t most) : most_(most) {}

    // A failure is kept like a value, but that somebody cancelled it is not.
    Result<std::shared_ptr<const T>> get(const Inputs& inputs, const std::function<Result<T>()>& make) {
        const std::shared_ptr<Slot> slot = slotOf(inputs);
        const std::scoped_lock lock(slot->mutex);
        if (!slot->kept) {
            Result<T> made = make();
            if (!made && made.error().isCancelled()) return made.error();
            if (made)
                slot->kept.emplace(std::make_shared<const T>(std::move(*made)));
            else
                slot->kept.emplace(made.error());
        }
        return *slot->kept;
    }

  private:
    struct Slot {
        std::mutex mutex;
        std::optional<Result<std::shared_ptr<const T>>> kept;
    };

    std::shared_ptr<Slot> slotOf(const Inputs& inputs) {
        const std::scoped_lock lock(mutex_);
        const auto found =
            std::find_if(slots_.begin(), slots_.end(), [&](const auto& one) { return one.first == inputs; });
        if (found != slots_.end()) {
            slots_.splice(slots_.begin(), slots_, found);
        } else {
            slots_.emplace_front(inputs, std::make_shared<Slot>());
            if (slots_.size() > most_) slots_.pop_back();
        }
        return slots_.front().second;
    }

    std::size_t most_;
    std::mutex mutex_;
    std::list<std::pair<Inputs, std::shared_ptr<Slot>>> slots_;
};

}  // namespace fluorocut::ui
