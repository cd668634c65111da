#include "planning_service/web/web_page.h"

#include <cstddef>

// The assembler copies the files' bytes into read-only data; the build gives their paths.
#define SIGHTLINE_EMBED(symbol, path)     \
  asm(".section .rodata\n"                \
      ".global " #symbol "\n" #symbol     \
      ":\n"                               \
      ".incbin \"" path                   \
      "\"\n"                              \
      ".global " #symbol "_end\n" #symbol \
      "_end:\n"                           \
      ".byte 0\n"                         \
      ".previous\n");                     \
  extern "C" const char symbol[];         \
  extern "C" const char symbol##_end[];

SIGHTLINE_EMBED(sightline_web_index, SIGHTLINE_WEB_PAGE "/index.html")
SIGHTLINE_EMBED(sightline_web_style, SIGHTLINE_WEB_PAGE "/assets/page.css")
SIGHTLINE_EMBED(sightline_web_script, SIGHTLINE_WEB_PAGE "/assets/page.js")
SIGHTLINE_EMBED(sightline_web_part_reader, SIGHTLINE_WEB_PAGE "/assets/part_reader.js")
SIGHTLINE_EMBED(sightline_web_icon, SIGHTLINE_WEB_PAGE "/assets/icon.svg")
SIGHTLINE_EMBED(sightline_web_results_worker, SIGHTLINE_WEB_PAGE "/results_worker.js")

namespace sightline {
namespace {

std::string Between(const char* begin, const char* end) {
  return std::string(begin, static_cast<size_t>(end - begin));
}

}  // namespace

std::vector<WebPageFile> WebPage() {
  constexpr char kScript[] = "text/javascript; charset=utf-8";
  return {
      {"/", "text/html; charset=utf-8", Between(sightline_web_index, sightline_web_index_end)},
      {"/assets/page.css", "text/css; charset=utf-8",
       Between(sightline_web_style, sightline_web_style_end)},
      {"/assets/page.js", kScript, Between(sightline_web_script, sightline_web_script_end)},
      {"/assets/part_reader.js", kScript,
       Between(sightline_web_part_reader, sightline_web_part_reader_end)},
      {"/assets/icon.svg", "image/svg+xml", Between(sightline_web_icon, sightline_web_icon_end)},
      // A service worker is in charge of the folder it comes from.
      {"/results_worker.js", kScript,
       Between(sightline_web_results_worker, sightline_web_results_worker_end)},
  };
}

}  // namespace sightline
