// What a procedure is begun with, as it lies in the case: `fluorocut/procedure-setup/1`, JSON, with the CT (MetaImage,
// float), the implant's mesh (STL, float), the fiducials and the distortion maps as items of their own, named by their
// SHA-256. A procedure works with what it reads back from there, so that whoever recomputes it has the same.
// Used by this folder only.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/procedure/content.h"
#include "core/procedure/setup.h"

namespace fluorocut {

struct SetupItems {
    std::vector<CaseContentItem> items;  // the last one is the setup itself, naming the others
    std::vector<StepInput> inputs;       // "ct", "implant", ...: role and hash of the others
};

Result<SetupItems> setupItems(const ProcedureSetup& setup);

// The content under a hash.
using ContentReader = std::function<Result<std::string>(const std::string& hash)>;

Result<ProcedureSetup> readSetup(std::string_view json, const ContentReader& content);

}  // namespace fluorocut
