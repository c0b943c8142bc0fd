// Pictures that must differ from each other: one given twice, under whatever name, tells nothing new.
#pragma once

#include <cstddef>
#include <map>
#include <string>

#include "core/base/result.h"
#include "core/image/image.h"

namespace fluorocut::cli {

class Pictures {
  public:
    // invalidInput: pixel for pixel the same as one before. Noise alone makes two exposures differ.
    Result<void> add(const std::string& name, const Image& image);

  private:
    std::map<std::size_t, std::string> seen_;  // name by the hash of its pixels
};

}  // namespace fluorocut::cli
