// SPDX-License-Identifier: Apache-2.0
#include "planning/robot/robot_moves.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <numeric>
#include <optional>

#include "absl/strings/str_cat.h"
#include "planning/strategy/scan_order.h"

namespace sightline {
namespace {

// Extra time of a move without a collision-free path [s].
constexpr double kBlockedS = 1000;
// Number of trials of the local search for an order; each takes the best joint positions.
constexpr int kMostTrials = 3000;
// Upper limit of rounds; every round checks at least one new move for collisions.
constexpr int kMostRounds = 200;

constexpr int kHome = -1;

// {scan, position, scan, position}; home is a scan with the single position 0.
using Edge = std::array<int, 4>;

struct KnownMove {
  double time_s = 0;
  std::string remark;
};

class Sequence {
 public:
  Sequence(const RobotCell& cell, std::span<const ScanToReach> scans, const TimeBetween& between,
           const std::atomic<bool>* interrupted)
      : cell_(cell), scans_(scans), between_(between), interrupted_(interrupted) {
    for (const ScanToReach& scan : scans) {
      // If interrupted, one position has to do: there is no time to choose among several.
      reach_.push_back(cell.Reachable(scan.measurement, scan.travel, !Stopped()));
    }
  }

  const Reach& reach(int scan) const { return reach_[static_cast<size_t>(scan)]; }
  bool Stopped() const { return interrupted_ != nullptr && *interrupted_; }

  // Order by the times between scans if the best positions could be chosen for each pair alone.
  std::vector<int> FirstOrder(const std::vector<int>& scans, int locked) const {
    const size_t n = scans.size();
    std::vector<std::vector<double>> times(n, std::vector<double>(n, 0));
    std::vector<double> first(n, 0);
    for (size_t i = 0; i < n; ++i) {
      first[i] = LeastTime(kHome, scans[i]);
      for (size_t j = 0; j < n; ++j) {
        if (i != j) times[i][j] = LeastTime(scans[i], scans[j]);
      }
    }
    std::vector<int> order;
    for (const int i : OrderByMoveTimes(std::move(times), first, locked)) {
      order.push_back(scans[static_cast<size_t>(i)]);
    }
    return order;
  }

  // Improves an order by moving and reversing segments; the first `locked` scans stay.
  std::vector<int> Improved(std::vector<int> order, size_t locked) const {
    double least_s = Choose(order).time_s;
    int trials = 0;
    for (bool better = true; better && !Stopped();) {
      better = false;
      const auto consider = [&](std::vector<int> trial) {
        if (++trials > kMostTrials) return;
        if (const double time_s = Choose(trial).time_s; time_s < least_s - 1e-9) {
          least_s = time_s;
          order = std::move(trial);
          better = true;
        }
      };
      for (size_t i = locked; i < order.size() && trials <= kMostTrials; ++i) {
        for (size_t j = locked; j < order.size(); ++j) {
          std::vector<int> moved = order;
          moved.erase(moved.begin() + static_cast<std::ptrdiff_t>(i));
          moved.insert(moved.begin() + static_cast<std::ptrdiff_t>(j), order[i]);
          consider(std::move(moved));
          if (j <= i + 1) continue;
          std::vector<int> reversed = order;
          std::reverse(reversed.begin() + static_cast<std::ptrdiff_t>(i),
                       reversed.begin() + static_cast<std::ptrdiff_t>(j) + 1);
          consider(std::move(reversed));
        }
      }
    }
    return order;
  }

  struct Choice {
    double time_s = 0;
    std::vector<int> positions;  // of every scan in the order
  };

  // Joint positions of least time along an order, given the known moves (dynamic programming).
  Choice Choose(const std::vector<int>& order) const {
    std::vector<std::vector<double>> least;
    std::vector<std::vector<int>> before;
    for (size_t k = 0; k < order.size(); ++k) {
      const int scan = order[k];
      const size_t count = reach(scan).positions.size();
      least.emplace_back(count, std::numeric_limits<double>::infinity());
      before.emplace_back(count, 0);
      const int from = k == 0 ? kHome : order[k - 1];
      const size_t from_count = k == 0 ? 1 : reach(from).positions.size();
      const double fixed_s = k == 0 ? 0 : between_(from, scan);
      for (size_t p = 0; p < count; ++p) {
        for (size_t r = 0; r < from_count; ++r) {
          const double time_s = (k == 0 ? 0 : least[k - 1][r]) + fixed_s +
                                Time({from, static_cast<int>(r), scan, static_cast<int>(p)});
          if (time_s < least[k][p]) {
            least[k][p] = time_s;
            before[k][p] = static_cast<int>(r);
          }
        }
      }
    }
    Choice choice;
    if (order.empty()) return choice;
    choice.positions.resize(order.size());
    const auto last = std::min_element(least.back().begin(), least.back().end());
    choice.time_s = *last;
    choice.positions.back() = static_cast<int>(last - least.back().begin());
    for (size_t k = order.size() - 1; k > 0; --k) {
      choice.positions[k - 1] = before[k][static_cast<size_t>(choice.positions[k])];
    }
    return choice;
  }

  // Checks the moves of a choice for collisions; false if any takes longer than assumed.
  bool LookAt(const std::vector<int>& order, const Choice& choice) {
    bool as_supposed = true;
    for (size_t k = 0; k < order.size() && !Stopped(); ++k) {
      const Edge edge = EdgeTo(order, choice, k);
      if (known_.contains(edge)) continue;
      const double supposed_s = Time(edge);
      const KnownMove move = Look(edge);
      as_supposed &= move.time_s <= supposed_s;
      known_[edge] = move;
    }
    return as_supposed;
  }

  static Edge EdgeTo(const std::vector<int>& order, const Choice& choice, size_t k) {
    return k == 0 ? Edge{kHome, 0, order[0], choice.positions[0]}
                  : Edge{order[k - 1], choice.positions[k - 1], order[k], choice.positions[k]};
  }

  // Time of the order after all its moves have been checked.
  double SettledTime(const std::vector<int>& order) {
    for (int round = 0; round < kMostRounds; ++round) {
      if (LookAt(order, Choose(order)) || Stopped()) break;
    }
    return Choose(order).time_s;
  }

  KnownMove MoveAlong(const Edge& edge) const {
    const auto found = known_.find(edge);
    if (found != known_.end()) return found->second;
    return {Time(edge), "the move was not checked for collisions"};
  }

 private:
  const JointPositions& From(const Edge& edge) const {
    return edge[0] == kHome ? cell_.model().home
                            : reach(edge[0]).positions[static_cast<size_t>(edge[1])].end;
  }
  const JointPositions& To(const Edge& edge) const {
    return reach(edge[2]).positions[static_cast<size_t>(edge[3])].start;
  }

  double Time(const Edge& edge) const {
    const auto found = known_.find(edge);
    return found != known_.end() ? found->second.time_s : cell_.MoveTimeS(From(edge), To(edge));
  }

  double LeastTime(int from, int to) const {
    const int from_count = from == kHome ? 1 : static_cast<int>(reach(from).positions.size());
    double least_s = std::numeric_limits<double>::infinity();
    for (int r = 0; r < from_count; ++r) {
      for (int p = 0; p < static_cast<int>(reach(to).positions.size()); ++p) {
        least_s = std::min(least_s, Time({from, r, to, p}));
      }
    }
    return least_s + (from == kHome ? 0 : between_(from, to));
  }

  KnownMove Look(const Edge& edge) const {
    const ScanToReach& to = scans_[static_cast<size_t>(edge[2])];
    std::vector<NamedSolid> around = cell_.Around(to.measurement, to.travel.start_m);
    if (edge[0] != kHome) {
      const ScanToReach& from = scans_[static_cast<size_t>(edge[0])];
      const auto more = cell_.Around(from.measurement, from.travel.end_m);
      around.insert(around.end(), more.begin(), more.end());
    }
    const double direct_s = cell_.MoveTimeS(From(edge), To(edge));
    const auto direct = cell_.OnTheWay(From(edge), To(edge), around);
    if (!direct) return {direct_s, ""};
    const std::string touches = absl::StrCat(direct->first, " touches ", direct->second);
    if (edge[0] != kHome) {
      const JointPositions& home = cell_.model().home;
      if (!cell_.OnTheWay(From(edge), home, around) && !cell_.OnTheWay(home, To(edge), around)) {
        return {cell_.MoveTimeS(From(edge), home) + cell_.MoveTimeS(home, To(edge)),
                absl::StrCat("the arm moves through its home position, since on the straight path ",
                             touches)};
      }
    }
    return {direct_s + kBlockedS,
            absl::StrCat("no collision-free move to this scan was found: on the straight path ",
                         touches,
                         edge[0] == kHome ? "" : ", and the path through home is blocked as well")};
  }

  const RobotCell& cell_;
  const std::span<const ScanToReach> scans_;
  const TimeBetween& between_;
  const std::atomic<bool>* interrupted_;
  std::vector<Reach> reach_;
  std::map<Edge, KnownMove> known_;
};

}  // namespace

std::vector<RobotMove> SequenceScans(const RobotCell& cell, std::span<const ScanToReach> scans,
                                     int locked, const TimeBetween& between,
                                     const std::atomic<bool>* interrupted) {
  Sequence sequence(cell, scans, between, interrupted);
  const int count = static_cast<int>(scans.size());
  std::vector<int> given;
  int locked_reached = 0;
  for (int i = 0; i < count; ++i) {
    if (!sequence.reach(i).reachable()) continue;
    given.push_back(i);
    locked_reached += i < locked;
  }
  std::vector<int> order = given;
  if (given.size() > static_cast<size_t>(locked_reached) + 1 || locked_reached == 0) {
    order = sequence.FirstOrder(given, locked_reached);
    for (int round = 0; round < kMostRounds; ++round) {
      order = sequence.Improved(std::move(order), static_cast<size_t>(locked_reached));
      if (sequence.LookAt(order, sequence.Choose(order)) || sequence.Stopped()) break;
    }
  }
  if (sequence.SettledTime(given) <= sequence.SettledTime(order)) order = given;

  const Sequence::Choice choice = sequence.Choose(order);
  std::vector<RobotMove> moves;
  size_t next = 0;
  const auto add_reached = [&](size_t k) {
    const KnownMove known = sequence.MoveAlong(Sequence::EdgeTo(order, choice, k));
    RobotMove move;
    move.scan = order[k];
    move.reachable = true;
    move.position = sequence.reach(order[k]).positions[static_cast<size_t>(choice.positions[k])];
    move.move_time_s = known.time_s >= kBlockedS ? known.time_s - kBlockedS : known.time_s;
    move.remark = known.remark;
    moves.push_back(std::move(move));
  };
  const auto add_missed = [&](int i) {
    RobotMove move;
    move.scan = i;
    move.because = sequence.reach(i).because;
    moves.push_back(std::move(move));
  };
  for (int i = 0; i < locked; ++i) {
    if (sequence.reach(i).reachable()) {
      add_reached(next++);
    } else {
      add_missed(i);
    }
  }
  for (; next < order.size(); ++next) add_reached(next);
  for (int i = locked; i < count; ++i) {
    if (!sequence.reach(i).reachable()) add_missed(i);
  }
  return moves;
}

}  // namespace sightline
