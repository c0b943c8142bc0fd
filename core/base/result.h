// Result<T>: a value, or the Error that explains why there is none. Result<void> is success or an Error.
//
//     Result<Volume> volume = readVolume(path);
//     if (!volume) return volume.error();
//     use(*volume);
//
// Reading the value of a failed Result (or the error of a successful one) is a broken contract and throws
// std::logic_error.
#pragma once

#include <stdexcept>
#include <utility>
#include <variant>

#include "core/base/error.h"

namespace fluorocut {

template <class T>
class [[nodiscard]] Result {
  public:
    Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
    Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

    bool ok() const { return state_.index() == 0; }
    explicit operator bool() const { return ok(); }

    const T& value() const& { return requireValue(*this); }
    T& value() & { return requireValue(*this); }
    T&& value() && { return std::move(requireValue(*this)); }

    const T& operator*() const& { return value(); }
    T& operator*() & { return value(); }
    T&& operator*() && { return std::move(*this).value(); }
    const T* operator->() const { return &value(); }
    T* operator->() { return &value(); }

    const Error& error() const {
        if (ok()) throw std::logic_error("error() of a successful Result");
        return std::get<1>(state_);
    }

  private:
    template <class Self>
    static auto& requireValue(Self& self) {
        if (!self.ok()) throw std::logic_error("value() of a failed Result: " + std::get<1>(self.state_).message());
        return std::get<0>(self.state_);
    }

    std::variant<T, Error> state_;
};

template <>
class [[nodiscard]] Result<void> {
  public:
    Result() = default;
    Result(Error error) : state_(std::move(error)) {}

    bool ok() const { return state_.index() == 0; }
    explicit operator bool() const { return ok(); }

    const Error& error() const {
        if (ok()) throw std::logic_error("error() of a successful Result");
        return std::get<1>(state_);
    }

  private:
    std::variant<std::monostate, Error> state_;
};

}  // namespace fluorocut
