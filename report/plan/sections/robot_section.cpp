// SPDX-License-Identifier: Apache-2.0
#include "report/plan/sections/robot_section.h"

#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "report/page/number_text.h"
#include "report/plan/sections/plan_text.h"

namespace sightline {
namespace {

// Degrees or millimetres: the position at the start and, if it visibly changes during the scan,
// "to" the position at the end.
v1::ReportCell JointCell(const v1::RobotScan& scan, int joint, bool rotary) {
  if (joint >= scan.start_position_size() || joint >= scan.end_position_size()) {
    return TextCell(kNoValue);
  }
  const double factor = rotary ? 180 / std::numbers::pi : 1e3;
  const std::string start = FixedNumber(factor * scan.start_position(joint), 1);
  const std::string end = FixedNumber(factor * scan.end_position(joint), 1);
  return NumberCell(factor * scan.start_position(joint), start, "",
                    start == end ? "" : absl::StrCat("to ", end));
}

ReportCells RowOf(const v1::PlannedScan& scan, const ReportRobot& robot) {
  v1::ReportCell number = CountCell(scan.index());
  number.set_strong(true);
  ReportCells row = {number};
  for (size_t j = 0; j < robot.joints.size(); ++j) {
    row.push_back(JointCell(scan.robot(), static_cast<int>(j), robot.joints[j].rotary));
  }
  row.push_back(scan.robot().reachable() ? FixedCell(scan.robot().move_time_s(), 1)
                                         : TextCell(kNoValue));
  const std::string remarks = absl::StrJoin(scan.remarks(), "; ");
  row.push_back(TextCell(remarks.empty() ? scan.robot().because() : remarks));
  return row;
}

}  // namespace

ReportBlocks RobotBlocks(const v1::Plan& plan, const ReportRobot& robot) {
  int unreached = 0;
  for (const v1::PlannedScan& scan : plan.scans()) unreached += !scan.robot().reachable();
  std::vector<v1::ReportRun> runs = {PlainRun(absl::StrCat(
      robot.name, " moves ", FixedNumber(plan.robot_move_time_s(), 1),
      " s between scans, by its slowest joint. ", unreached == 0 ? "It reaches every scan." : ""))};
  if (unreached > 0) {
    runs.push_back(StrongRun(absl::StrCat("It cannot make ", unreached, " of ",
                                          CountText(plan.scans_size(), "scan"), ".")));
  }
  std::vector<v1::ReportColumn> columns = {NumberColumn("scan")};
  for (const ReportRobot::Joint& joint : robot.joints) {
    columns.push_back(NumberColumn(joint.name, joint.rotary ? "\u00b0" : "mm"));
  }
  columns.push_back(NumberColumn("move", "s"));
  columns.push_back(WordsColumn("remarks"));
  std::vector<ReportCells> rows;
  for (const v1::PlannedScan& scan : plan.scans()) rows.push_back(RowOf(scan, robot));
  v1::ReportBlock table = TableBlock("Joints of the robot at every scan", columns, rows);
  for (int i = 0; i < plan.scans_size(); ++i) ShowScan(i, table.mutable_table()->mutable_rows(i));
  return {ParagraphBlock(runs), table};
}

}  // namespace sightline
