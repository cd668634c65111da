// SPDX-License-Identifier: Apache-2.0
// Files inside the program: pages, styles and scripts that must be there whatever the folder it
// runs in.
//
//   SIGHTLINE_EMBED(page_style, PATH_OF_THE_FILE)  // at namespace scope, in one .cpp file
//   const std::string_view style SIGHTLINE_EMBEDDED(page_style);
//
// The symbol must be the only one of its name in the program. The path is a text literal, mostly a
// definition that the build gives; the source file depends on it (OBJECT_DEPENDS).
#pragma once

#include <cstddef>

// The assembler copies the file's bytes into read-only data.
#define SIGHTLINE_EMBED(symbol, path)                                                      \
  asm(".section .rodata\n"                                                                 \
      ".global " #symbol "\n" #symbol                                                      \
      ":\n"                                                                                \
      ".incbin \"" path                                                                    \
      "\"\n"                                                                               \
      ".global " #symbol "_end\n" #symbol                                                  \
      "_end:\n"                                                                            \
      ".byte 0\n"                                                                          \
      ".previous\n");                                                                      \
  extern "C" const char symbol[]; /* NOLINT(bugprone-macro-parentheses): it is declared */ \
  extern "C" const char symbol##_end[];

// Initialises a text or a view of one, of the standard library's or Abseil's: {bytes, how many}.
#define SIGHTLINE_EMBEDDED(symbol) \
  { symbol, static_cast<std::size_t>(symbol##_end - (symbol)) }
