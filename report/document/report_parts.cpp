// SPDX-License-Identifier: Apache-2.0
#include "report/document/report_parts.h"

#include <cassert>
#include <cmath>
#include <utility>

#include "report/page/html.h"
#include "report/page/number_text.h"

namespace sightline {
namespace {

v1::ReportBlock GroupOf(v1::ReportGroup group, ReportBlocks blocks) {
  for (v1::ReportBlock& block : blocks) *group.add_blocks() = std::move(block);
  v1::ReportBlock made;
  *made.mutable_group() = std::move(group);
  return made;
}

v1::ReportColumn ColumnOfKind(const std::string& name, v1::ReportColumn::Kind kind) {
  v1::ReportColumn column;
  column.set_name(name);
  column.set_kind(kind);
  return column;
}

// Magnitude 1 has the unit without a prefix.
v1::ReportCell CellOfQuantity(const std::string& name, double value, const std::string& text,
                              const std::string& detail) {
  const ShownUnit unit = ShownUnitOf(name, 1);
  return NumberCell(unit.per_named * value, text, unit.name, detail);
}

}  // namespace

v1::ReportRun PlainRun(const std::string& text) {
  v1::ReportRun run;
  run.set_text(text);
  return run;
}

v1::ReportRun StrongRun(const std::string& text) {
  v1::ReportRun run = PlainRun(text);
  run.set_strong(true);
  return run;
}

v1::ReportRun CodeRun(const std::string& text) {
  v1::ReportRun run = PlainRun(text);
  run.set_code(true);
  return run;
}

v1::ReportBlock ParagraphBlock(const std::vector<v1::ReportRun>& runs) {
  v1::ReportBlock block;
  block.mutable_paragraph()->mutable_runs()->Assign(runs.begin(), runs.end());
  return block;
}

v1::ReportBlock TextBlock(const std::string& text) { return ParagraphBlock({PlainRun(text)}); }

v1::ReportBlock RemarkBlock(const std::string& text) {
  v1::ReportBlock block = TextBlock(text);
  block.mutable_paragraph()->set_remark(true);
  return block;
}

v1::ReportBlock ListBlock(const std::vector<std::vector<v1::ReportRun>>& items) {
  v1::ReportBlock block;
  for (const std::vector<v1::ReportRun>& runs : items) {
    block.mutable_list()->add_items()->mutable_runs()->Assign(runs.begin(), runs.end());
  }
  return block;
}

v1::ReportFact TextFact(const std::string& name, const std::string& text,
                        const std::string& detail) {
  v1::ReportFact fact;
  fact.set_name(name);
  fact.set_text(text);
  fact.set_detail(detail);
  return fact;
}

v1::ReportFact NumberFact(const std::string& name, double number, const std::string& unit,
                          const std::string& text, const std::string& detail) {
  v1::ReportFact fact = TextFact(name, text, detail);
  if (std::isfinite(number)) fact.set_number(number);
  fact.set_unit(unit);
  return fact;
}

v1::ReportFact CountFact(const std::string& name, int64_t count, const std::string& detail) {
  return NumberFact(name, static_cast<double>(count), "", GroupedInteger(count), detail);
}

v1::ReportBlock FactsBlock(const std::vector<v1::ReportFact>& facts) {
  v1::ReportBlock block;
  block.mutable_facts()->mutable_facts()->Assign(facts.begin(), facts.end());
  return block;
}

v1::ReportColumn WordsColumn(const std::string& name) {
  return ColumnOfKind(name, v1::ReportColumn::TEXT);
}

v1::ReportColumn NumberColumn(const std::string& name, const std::string& unit) {
  v1::ReportColumn column = ColumnOfKind(name, v1::ReportColumn::NUMBER);
  column.set_unit(unit);
  return column;
}

v1::ReportColumn ShareColumn(const std::string& name) {
  return ColumnOfKind(name, v1::ReportColumn::SHARE);
}

v1::ReportCell TextCell(const std::string& text, const std::string& detail) {
  v1::ReportCell cell;
  cell.set_text(text);
  cell.set_detail(detail);
  return cell;
}

v1::ReportCell StrongCell(const std::string& text, const std::string& detail) {
  v1::ReportCell cell = TextCell(text, detail);
  cell.set_strong(true);
  return cell;
}

v1::ReportCell NumberCell(double number, const std::string& text, const std::string& unit,
                          const std::string& detail) {
  v1::ReportCell cell = TextCell(text, detail);
  if (!std::isfinite(number)) return cell;
  cell.set_number(number);
  cell.set_unit(unit);
  return cell;
}

v1::ReportCell CountCell(int64_t count) {
  return NumberCell(static_cast<double>(count), GroupedInteger(count));
}

v1::ReportCell QuantityCell(const std::string& name, double value, int significant,
                            const std::string& detail) {
  return CellOfQuantity(name, value, QuantityText(name, value, significant), detail);
}

v1::ReportCell SettingCell(const std::string& name, double value, const std::string& detail) {
  return CellOfQuantity(name, value, SettingText(name, value), detail);
}

v1::ReportCell ShareCell(double share, const std::string& text) { return NumberCell(share, text); }

v1::ReportBlock TableBlock(const std::string& title, const std::vector<v1::ReportColumn>& columns,
                           const std::vector<ReportCells>& rows) {
  v1::ReportBlock block;
  v1::ReportTable& table = *block.mutable_table();
  table.set_title(title);
  table.mutable_columns()->Assign(columns.begin(), columns.end());
  for (const ReportCells& row : rows) {
    assert(row.size() == columns.size());
    table.add_rows()->mutable_cells()->Assign(row.begin(), row.end());
  }
  return block;
}

v1::ReportBlock PictureBlock(const std::string& png, const std::string& caption,
                             const std::string& alternative, bool pixels) {
  v1::ReportBlock block;
  block.mutable_picture()->set_png(png);
  block.mutable_picture()->set_caption(caption);
  block.mutable_picture()->set_alternative(alternative);
  block.mutable_picture()->set_pixels(pixels);
  return block;
}

v1::ReportBlock ChartBlock(v1::ReportChart chart) {
  v1::ReportBlock block;
  *block.mutable_chart() = std::move(chart);
  return block;
}

v1::ReportBlock GroupBlock(v1::ReportGroup::Layout layout, ReportBlocks blocks) {
  v1::ReportGroup group;
  group.set_layout(layout);
  return GroupOf(std::move(group), std::move(blocks));
}

v1::ReportBlock TitledBlock(const std::string& title, ReportBlocks blocks) {
  v1::ReportGroup group;
  group.set_title(title);
  return GroupOf(std::move(group), std::move(blocks));
}

v1::ReportBlock CardBlock(const std::string& title, const std::string& subtitle,
                          ReportBlocks blocks) {
  v1::ReportGroup group;
  group.set_title(title);
  group.set_subtitle(subtitle);
  group.set_framed(true);
  return GroupOf(std::move(group), std::move(blocks));
}

v1::ReportBlock FoldedBlock(const std::string& title, ReportBlocks blocks) {
  v1::ReportGroup group;
  group.set_title(title);
  group.set_folded(true);
  return GroupOf(std::move(group), std::move(blocks));
}

void AddSection(v1::Report* report, const std::string& id, const std::string& title,
                ReportBlocks blocks) {
  if (blocks.empty()) return;
  v1::ReportSection& section = *report->add_sections();
  section.set_id(id);
  section.set_title(title);
  for (v1::ReportBlock& block : blocks) *section.add_blocks() = std::move(block);
}

}  // namespace sightline
