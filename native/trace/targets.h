// SPDX-License-Identifier: GPL-3.0-or-later
// Include before <hwy/foreach_target.h>: the instruction sets that traversal is compiled for. The
// baseline (which Highway may run lane by lane, as SCALAR), SSE4, AVX2 and AVX-512 differ for this
// code; the targets between them do not.
#pragma once

#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
