// SPDX-License-Identifier: Apache-2.0
// Embeds files in the program: pages, styles and scripts that must be available from any working
// folder.
//
//   SIGHTLINE_EMBED(page_style, PATH_OF_THE_FILE)  // at namespace scope, in one .cpp file
//   const std::string_view style SIGHTLINE_EMBEDDED(page_style);
//
// The symbol must be unique in the program. The path is a string literal, usually a definition by
// the build; the source file depends on the embedded file (OBJECT_DEPENDS).
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
