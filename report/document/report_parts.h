// SPDX-License-Identifier: Apache-2.0
// Parts of a report as data (report.proto), each made by one call:
//
//   AddSection(&report, "fit", "How well the model fits",
//              {RemarkBlock("1 is as large as noise makes it."),
//               TableBlock("Fits", {WordsColumn("model"), NumberColumn("rms", "px")},
//                          {{StrongCell("nominal"), NumberCell(0.2134, "0.213")}})});
//
// Texts are UTF-8 and plain: nothing in them is markup.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sightline/v1/report.pb.h"

namespace sightline {

using ReportBlocks = std::vector<v1::ReportBlock>;
using ReportCells = std::vector<v1::ReportCell>;

// Placeholder for an unknown value.
inline constexpr char kNoValue[] = "\u2013";

v1::ReportRun PlainRun(const std::string& text);
v1::ReportRun StrongRun(const std::string& text);
v1::ReportRun CodeRun(const std::string& text);

v1::ReportBlock ParagraphBlock(const std::vector<v1::ReportRun>& runs);
v1::ReportBlock TextBlock(const std::string& text);
// A remark that explains the blocks next to it.
v1::ReportBlock RemarkBlock(const std::string& text);
// Bullet points.
v1::ReportBlock ListBlock(const std::vector<std::vector<v1::ReportRun>>& items);

// A named value that is shown as `text`.
v1::ReportFact TextFact(const std::string& name, const std::string& text,
                        const std::string& detail = "");
// The same with its number in `unit`, which is left out if it is not finite.
v1::ReportFact NumberFact(const std::string& name, double number, const std::string& unit,
                          const std::string& text, const std::string& detail = "");
v1::ReportFact CountFact(const std::string& name, int64_t count, const std::string& detail = "");
v1::ReportBlock FactsBlock(const std::vector<v1::ReportFact>& facts);

v1::ReportColumn WordsColumn(const std::string& name);
// Empty `unit`: cells state their own, or there is none.
v1::ReportColumn NumberColumn(const std::string& name, const std::string& unit = "");
// Fractions from 0 to 1, each drawn as a bar beside its text.
v1::ReportColumn ShareColumn(const std::string& name);

v1::ReportCell TextCell(const std::string& text, const std::string& detail = "");
v1::ReportCell StrongCell(const std::string& text, const std::string& detail = "");
// `number` in `unit` or, if that is empty, in the unit of the column. It is left out if not finite.
v1::ReportCell NumberCell(double number, const std::string& text, const std::string& unit = "",
                          const std::string& detail = "");
v1::ReportCell CountCell(int64_t count);
// A value of a quantity whose name ends in its unit, shown by QuantityText. The number is in the
// unit without a prefix; fractions are in per cent.
v1::ReportCell QuantityCell(const std::string& name, double value, int significant = 3,
                            const std::string& detail = "");
// The same for a set value, shown by SettingText.
v1::ReportCell SettingCell(const std::string& name, double value, const std::string& detail = "");
// A probability or another fraction from 0 to 1 for a ShareColumn.
v1::ReportCell ShareCell(double share, const std::string& text);

// Every row needs as many cells as there are columns. `title` names the table to screen readers.
v1::ReportBlock TableBlock(const std::string& title, const std::vector<v1::ReportColumn>& columns,
                           const std::vector<ReportCells>& rows);

v1::ReportBlock PictureBlock(const std::string& png, const std::string& caption,
                             const std::string& alternative, bool pixels = false);
v1::ReportBlock ChartBlock(v1::ReportChart chart);

// Blocks side by side.
v1::ReportBlock GroupBlock(v1::ReportGroup::Layout layout, ReportBlocks blocks);
// Blocks one below the other under a heading and inside a frame.
v1::ReportBlock TitledBlock(const std::string& title, ReportBlocks blocks);
v1::ReportBlock CardBlock(const std::string& title, const std::string& subtitle,
                          ReportBlocks blocks);
// Only the title is visible until the reader opens the block.
v1::ReportBlock FoldedBlock(const std::string& title, ReportBlocks blocks);

// Adds a section unless it is empty. `id` is unique in the report.
void AddSection(v1::Report* report, const std::string& id, const std::string& title,
                ReportBlocks blocks);

}  // namespace sightline
