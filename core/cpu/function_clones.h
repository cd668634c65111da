// SPDX-License-Identifier: Apache-2.0
// Versions of one function for several instruction sets; at its start the program selects the best
// one for the processor. All give the same results: none contracts or reorders operations.
#pragma once

// SIGHTLINE_CLONES("avx2"), before a function's definition.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(SIGHTLINE_NO_TARGET_CLONES)
#define SIGHTLINE_CLONES(...) __attribute__((target_clones(__VA_ARGS__, "default")))
#else
#define SIGHTLINE_CLONES(...)
#endif
