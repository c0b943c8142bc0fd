// Has moved to core/casestore/content.h, where the desktop's documents reach it without the procedure.
#pragma once

#include "core/casestore/content.h"
