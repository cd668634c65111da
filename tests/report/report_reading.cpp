// SPDX-License-Identifier: Apache-2.0
#include "tests/report/report_reading.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"

namespace sightline {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

using BlockVisitor = std::function<void(const v1::ReportBlock&)>;

void VisitBlocks(const google::protobuf::RepeatedPtrField<v1::ReportBlock>& blocks,
                 const BlockVisitor& visit) {
  for (const v1::ReportBlock& block : blocks) {
    visit(block);
    if (block.has_group()) VisitBlocks(block.group().blocks(), visit);
  }
}

void VisitBlocks(const v1::Report& report, const BlockVisitor& visit) {
  for (const v1::ReportSection& section : report.sections()) VisitBlocks(section.blocks(), visit);
}

std::string TableFault(const v1::ReportTable& table) {
  if (table.title().empty()) return "a table has no title";
  for (const v1::ReportRow& row : table.rows()) {
    if (row.cells_size() != table.columns_size()) {
      return absl::StrCat(table.title(), ": a row has ", row.cells_size(), " cells, there are ",
                          table.columns_size(), " columns");
    }
    for (const v1::ReportCell& cell : row.cells()) {
      if (!std::isfinite(cell.number())) return table.title() + ": a number is not finite";
    }
  }
  return "";
}

std::string ChartFault(const v1::ReportChart& chart) {
  const std::string name = absl::StrCat("chart ", chart.title(), " ", chart.y().title(), ": ");
  if (chart.series().empty()) return name + "has no series";
  for (const v1::ReportSeries& series : chart.series()) {
    const int size = series.x_size();
    if (series.y_size() != size) return name + "x and y differ in length";
    if (series.low_size() != series.high_size()) return name + "low and high differ in length";
    for (const int other : {series.low_size(), series.labels_size(), series.notes_size()}) {
      if (other != 0 && other != size) return name + "a list is not as long as x";
    }
  }
  return "";
}

std::string BlockFault(const v1::ReportBlock& block) {
  switch (block.content_case()) {
    case v1::ReportBlock::kTable:
      return TableFault(block.table());
    case v1::ReportBlock::kChart:
      return ChartFault(block.chart());
    case v1::ReportBlock::kMap:
      return block.map().values_size() == block.map().rows() * block.map().columns()
                 ? ""
                 : "a map has not a value a cell";
    case v1::ReportBlock::kGroup:
      return block.group().blocks().empty() ? "a group is empty" : "";
    case v1::ReportBlock::kPicture:
      return block.picture().png().empty() ? "a picture is empty" : "";
    case v1::ReportBlock::CONTENT_NOT_SET:
      return "a block is empty";
    default:
      return "";
  }
}

void AppendTexts(const Message& message, std::string* texts) {
  const google::protobuf::Reflection& reflection = *message.GetReflection();
  std::vector<const FieldDescriptor*> fields;
  reflection.ListFields(message, &fields);
  for (const FieldDescriptor* field : fields) {
    const int count = field->is_repeated() ? reflection.FieldSize(message, field) : 1;
    for (int i = 0; i < count; ++i) {
      if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
        AppendTexts(field->is_repeated() ? reflection.GetRepeatedMessage(message, field, i)
                                         : reflection.GetMessage(message, field),
                    texts);
      } else if (field->type() == FieldDescriptor::TYPE_STRING) {
        absl::StrAppend(texts,
                        field->is_repeated() ? reflection.GetRepeatedString(message, field, i)
                                             : reflection.GetString(message, field),
                        "\n");
      }
    }
  }
}

}  // namespace

std::string ReportFault(const v1::Report& report) {
  if (report.title().empty() || report.kind().empty()) return "title or kind is empty";
  std::set<std::string> ids;
  for (const v1::ReportSection& section : report.sections()) {
    if (section.title().empty()) return "a section has no title";
    if (!ids.insert(section.id()).second) return "section id used twice: " + section.id();
    if (section.blocks().empty()) return "an empty section: " + section.id();
  }
  std::string fault;
  VisitBlocks(report, [&](const v1::ReportBlock& block) {
    if (fault.empty()) fault = BlockFault(block);
  });
  if (!fault.empty()) return fault;
  v1::Report read;
  const std::string json = ToJson(report);
  // The library's reader takes numbers that are not finite, as charts with gaps have them.
  if (const auto status = google::protobuf::util::JsonStringToMessage(json, &read); !status.ok()) {
    return std::string(status.message());
  }
  return ToJson(read) == json ? "" : "the JSON reads back as another report";
}

v1::Report SectionOf(const v1::Report& report, const std::string& id) {
  v1::Report found;
  for (const v1::ReportSection& section : report.sections()) {
    if (section.id() == id) *found.add_sections() = section;
  }
  return found;
}

std::string FindingOf(const v1::Report& report) {
  std::string text;
  for (const v1::ReportRun& run : report.finding()) text += run.text();
  return text;
}

v1::ReportTable FirstTableOf(const v1::Report& report, const std::string& section) {
  const std::vector<v1::ReportTable> tables = TablesOf(SectionOf(report, section));
  return tables.empty() ? v1::ReportTable() : tables.front();
}

std::string TextOf(const v1::Report& report) {
  std::string texts;
  AppendTexts(report, &texts);
  return texts;
}

std::vector<v1::ReportTable> TablesOf(const v1::Report& report) {
  std::vector<v1::ReportTable> found;
  VisitBlocks(report, [&](const v1::ReportBlock& block) {
    if (block.has_table()) found.push_back(block.table());
  });
  return found;
}

std::vector<v1::ReportChart> ChartsOf(const v1::Report& report) {
  std::vector<v1::ReportChart> found;
  VisitBlocks(report, [&](const v1::ReportBlock& block) {
    if (block.has_chart()) found.push_back(block.chart());
  });
  return found;
}

std::vector<v1::ReportMap> MapsOf(const v1::Report& report) {
  std::vector<v1::ReportMap> found;
  VisitBlocks(report, [&](const v1::ReportBlock& block) {
    if (block.has_map()) found.push_back(block.map());
  });
  return found;
}

std::vector<v1::ReportPicture> PicturesOf(const v1::Report& report) {
  std::vector<v1::ReportPicture> found;
  VisitBlocks(report, [&](const v1::ReportBlock& block) {
    if (block.has_picture()) found.push_back(block.picture());
  });
  return found;
}

std::vector<v1::ReportGroup> GroupsOf(const v1::Report& report) {
  std::vector<v1::ReportGroup> found;
  VisitBlocks(report, [&](const v1::ReportBlock& block) {
    if (block.has_group()) found.push_back(block.group());
  });
  return found;
}

v1::ReportCell CellOf(const v1::ReportTable& table, const std::string& row,
                      const std::string& column) {
  for (const v1::ReportRow& of : table.rows()) {
    if (of.cells().empty() || of.cells(0).text() != row) continue;
    for (int i = 0; i < std::min(table.columns_size(), of.cells_size()); ++i) {
      if (table.columns(i).name() == column) return of.cells(i);
    }
  }
  return {};
}

int PointsOf(const v1::ReportChart& chart, v1::ReportColour colour, v1::ReportSeries::Mark mark) {
  int points = 0;
  for (const v1::ReportSeries& series : chart.series()) {
    if (series.colour() == colour && series.mark() == mark) points += series.x_size();
  }
  return points;
}

}  // namespace sightline
