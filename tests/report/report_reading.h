// SPDX-License-Identifier: Apache-2.0
// Properties that every report has, and how tests look into one.
#pragma once

#include <string>
#include <vector>

#include "sightline/v1/report.pb.h"

namespace sightline {

// Empty if sections have names and unique ids, rows have a cell a column, lists of a series are of
// equal length, maps have a value a cell, numbers of cells are finite, and the JSON of the report
// reads back as the same report; otherwise what is wrong.
std::string ReportFault(const v1::Report& report);

// The section of this id as a report of its own; without sections: there is none.
v1::Report SectionOf(const v1::Report& report, const std::string& id);

// The sentences below the heading.
std::string FindingOf(const v1::Report& report);

// The first table of the section; without columns: there is none.
v1::ReportTable FirstTableOf(const v1::Report& report, const std::string& section);

// All texts, a line each, in the order of the message.
std::string TextOf(const v1::Report& report);

// Everything of a kind, groups looked through, in order.
std::vector<v1::ReportTable> TablesOf(const v1::Report& report);
std::vector<v1::ReportChart> ChartsOf(const v1::Report& report);
std::vector<v1::ReportMap> MapsOf(const v1::Report& report);
std::vector<v1::ReportPicture> PicturesOf(const v1::Report& report);
std::vector<v1::ReportGroup> GroupsOf(const v1::Report& report);

// The cell of the row whose first cell is `row`, in the first column named `column`; empty if there
// is none.
v1::ReportCell CellOf(const v1::ReportTable& table, const std::string& row,
                      const std::string& column);

// Points of all series of this look.
int PointsOf(const v1::ReportChart& chart, v1::ReportColour colour, v1::ReportSeries::Mark mark);

}  // namespace sightline
