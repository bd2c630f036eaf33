// SPDX-License-Identifier: Apache-2.0
#include "report/trials_front.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <optional>

#include "blindcorner/planner/vehicles/single_track_parameters.h"
#include "blindcorner/simulation/credible_level.h"
#include "blindcorner/simulation/paired_difference.h"
#include "report/chart.h"
#include "report/colours.h"
#include "report/formatted.h"
#include "report/html.h"

namespace blindcorner {
namespace {

using nlohmann::json;
using Results = std::vector<const TrialResult*>;
using Test = std::function<bool(const TrialResult&)>;
using Figure = std::function<std::optional<double>(const TrialResult&)>;

/// Braking that uses more than this share of the friction limit is hard.
constexpr double kHardShare = 0.5;

/// The trials of one perception with one risk. No risk: that of the drive file.
struct Group {
  std::string perception;
  std::optional<double> risk;
  Results results;
};

double risk_of(const Drive& drive, const Group& group) {
  const double own = drive.speed_mode == SpeedMode::safe ? drive.risk : drive.traffic_risk;
  return group.risk.value_or(own);
}

/// Groups in order of the perception, as the trials name them, then of the risk.
std::vector<Group> groups_of(const Drive& drive, const std::vector<TrialResult>& results) {
  std::vector<Group> groups;
  for (const TrialResult& result : results) {
    const Trial& trial = result.trial;
    const auto same = [&](const Group& g) {
      return g.perception == trial.perception && g.risk == trial.risk;
    };
    auto group = std::ranges::find_if(groups, same);
    if (group == groups.end()) {
      groups.push_back({trial.perception, trial.risk, {}});
      group = groups.end() - 1;
    }
    group->results.push_back(&result);
  }
  std::map<std::string, std::size_t> order;
  for (const Group& group : groups) order.emplace(group.perception, order.size());
  std::ranges::sort(groups, {}, [&](const Group& g) {
    return std::pair(order.at(g.perception), risk_of(drive, g));
  });
  return groups;
}

bool collided(const TrialResult& result) { return result.outcome == "collision"; }
bool someone(const TrialResult& result) { return result.present; }
bool nobody(const TrialResult& result) { return !result.present; }
bool braked(const TrialResult& result) { return result.hardest_braking > 0; }

Test hard_on(const Drive& drive) {
  const double limit = kHardShare * drive.vehicle.friction * kGravity;
  return [limit](const TrialResult& result) { return result.hardest_braking > limit; };
}

/// Time beyond what the same way takes at the wanted speed, s. Only for drives that reach the goal.
std::optional<double> time_lost(const TrialResult& result) {
  if (!result.reached()) return {};
  return result.time - result.length / result.trial.speed;
}

std::optional<double> mean_speed(const TrialResult& result) {
  return result.time > 0 ? std::optional(result.length / result.time) : std::nullopt;
}

std::optional<double> impact(const TrialResult& result) {
  return collided(result) ? std::optional(result.impact_speed) : std::nullopt;
}

Results chosen(const Results& results, const Test& wanted) {
  Results list;
  std::ranges::copy_if(results, std::back_inserter(list),
                       [&](const TrialResult* r) { return wanted(*r); });
  return list;
}

int count(const Results& results, const Test& test) {
  return static_cast<int>(
      std::ranges::count_if(results, [&](const TrialResult* r) { return test(*r); }));
}

std::vector<double> values(const Results& results, const Figure& figure) {
  std::vector<double> list;
  for (const TrialResult* result : results) {
    if (const auto value = figure(*result)) list.push_back(*value);
  }
  return list;
}

std::string share_cell(const Results& results, const Test& test) {
  if (results.empty()) return "<td>none driven";
  const int all = static_cast<int>(results.size()), some = count(results, test);
  const ShareInterval interval = wilson_interval(some, all);
  return formatted("<td>%.3f (%.3f to %.3f), %d/%d", static_cast<double>(some) / all, interval.low,
                   interval.high, some, all);
}

std::string mean_cell(const std::vector<double>& list) {
  if (list.empty()) return "<td>none";
  if (list.size() < 2) return formatted("<td>%.2f, n = 1", list.front());
  const MeanInterval interval = mean_interval(list);
  return formatted("<td>%.2f (%.2f to %.2f), n = %zu", interval.mean, interval.low, interval.high,
                   list.size());
}

std::string risk_text(const Drive& drive, const Group& group) {
  return formatted("%g", risk_of(drive, group));
}

std::string cost_table(const Drive& drive, const std::vector<Group>& groups) {
  std::string rows =
      "<table><tr><th>perception<th>risk<th>collisions where somebody comes<th>speed at impact, "
      "m/s<th>brakes hard<th>brakes where nobody comes<th>time lost, s<th>mean speed, m/s</tr>\n";
  for (const Group& group : groups) {
    rows += "<tr><td>" + html_safe(group.perception) + "<td>" + risk_text(drive, group) +
            share_cell(chosen(group.results, someone), collided) +
            mean_cell(values(group.results, impact)) + share_cell(group.results, hard_on(drive)) +
            share_cell(chosen(group.results, nobody), braked) +
            mean_cell(values(group.results, time_lost)) +
            mean_cell(values(group.results, mean_speed)) + "</tr>\n";
  }
  return rows + "</table>\n";
}

/// Pairs of trials with the same seed.
std::vector<std::pair<const TrialResult*, const TrialResult*>> matched(const Results& first,
                                                                       const Results& second) {
  std::map<std::uint64_t, const TrialResult*> other;
  for (const TrialResult* result : second) other[result->trial.seed] = result;
  std::vector<std::pair<const TrialResult*, const TrialResult*>> pairs;
  for (const TrialResult* result : first) {
    const auto match = other.find(result->trial.seed);
    if (match != other.end()) pairs.emplace_back(result, match->second);
  }
  return pairs;
}

std::string share_difference(const Results& first, const Results& second, const Test& test) {
  PairedCounts counts;
  for (const auto& [a, b] : matched(first, second)) {
    const bool one = test(*a), other = test(*b);
    ++(one ? (other ? counts.both : counts.only_first)
           : (other ? counts.only_second : counts.neither));
  }
  if (counts.trials() == 0) return "<td>none driven";
  const PairedDifference d = paired_difference(counts);
  return formatted("<td>%+.3f (%+.3f to %+.3f), +%d -%d of %d", d.value, d.low, d.high,
                   counts.only_first, counts.only_second, counts.trials());
}

std::string mean_difference(const Results& first, const Results& second, const Figure& figure) {
  std::vector<double> list;
  for (const auto& [a, b] : matched(first, second)) {
    const auto one = figure(*a), other = figure(*b);
    if (one && other) list.push_back(*one - *other);
  }
  return mean_cell(list);
}

std::string difference_table(const Drive& drive, const std::vector<Group>& groups) {
  constexpr std::array<std::pair<const char*, const char*>, 6> kPairs{{{"solver", "los"},
                                                                       {"solver", "los_cautious"},
                                                                       {"los_cautious", "los"},
                                                                       {"oracle", "los"},
                                                                       {"cnn", "los"},
                                                                       {"cnn_wide", "los"}}};
  const auto own = [&groups](const char* name) {
    const auto group = std::ranges::find_if(
        groups, [name](const Group& g) { return g.perception == name && !g.risk; });
    return group == groups.end() ? nullptr : &*group;
  };
  std::string rows;
  for (const auto& [first, second] : kPairs) {
    const Group *a = own(first), *b = own(second);
    if (a == nullptr || b == nullptr) continue;
    rows += formatted("<tr><td>%s - %s", first, second) +
            share_difference(chosen(a->results, someone), chosen(b->results, someone), collided) +
            share_difference(a->results, b->results, hard_on(drive)) +
            share_difference(chosen(a->results, nobody), chosen(b->results, nobody), braked) +
            mean_difference(a->results, b->results, time_lost) +
            mean_difference(a->results, b->results, mean_speed) + "</tr>\n";
  }
  if (rows.empty()) return "";
  return "<p>The first minus the second, paired by seed, at the drive file's risk: shares by "
         "Newcombe's tenth method, means by Student's t.</p>\n<table><tr><th>pair<th>collisions"
         "<th>brakes hard<th>brakes where nobody comes<th>time lost, s<th>mean speed, m/s</tr>\n" +
         rows + "</table>\n";
}

double share(int some, std::size_t all) {
  return all > 0 ? static_cast<double>(some) / static_cast<double>(all) : 0.0;
}

/// A vertical line from 0 to 1. The axis therefore reaches from 0 to 1.
ChartSeries limit_line(const std::string& name, double speed, const char* colour) {
  return {name, {{speed, 0}, {speed, 1}}, SeriesStyle::line, colour};
}

/// A number of limits.json; empty: null, or not there.
std::optional<double> number_of(const json& limits, const char* name) {
  if (!limits.is_object() || !limits.contains(name) || !limits[name].is_number()) return {};
  return limits[name].get<double>();
}

Chart speed_chart(const Drive& drive, const std::vector<Group>& groups, const json& limits) {
  Chart chart{"collisions where somebody comes", "wanted speed, m/s", "share of trials"};
  for (const Group& group : groups) {
    if (group.risk) continue;
    ChartSeries series{group.perception,
                       {},
                       SeriesStyle::marked_line,
                       colour::of_method(group.perception, chart.series.size())};
    for (int zone = 0; zone < drive.trials.zones; ++zone) {
      const Results here = chosen(group.results, [zone](const TrialResult& r) {
        return r.present && r.trial.zone == zone;
      });
      if (here.empty()) continue;
      const double lower = zone_lower(drive.trials, zone);
      const int hits = count(here, collided);
      series.points.push_back({(lower + zone_lower(drive.trials, zone + 1)) / 2,
                               share(hits, here.size()),
                               formatted("%d of %zu", hits, here.size())});
    }
    if (!series.points.empty()) chart.series.push_back(std::move(series));
  }
  if (const auto at = number_of(limits, "direct_sight_limit_m_per_s")) {
    chart.series.push_back(
        limit_line("on paper: from here direct sight must hit", *at, colour::kInk));
  }
  if (const auto at = number_of(limits, "light_limit_m_per_s")) {
    chart.series.push_back(
        limit_line("on paper: from here the light comes too late", *at, colour::kLine));
  }
  return chart;
}

Chart front_chart(const Drive& drive, const std::vector<Group>& groups) {
  Chart chart{"what is avoided against what it costs", "mean speed of all trials, m/s",
              "share of collisions where somebody comes"};
  std::map<std::string, std::size_t> places;
  for (const Group& group : groups) {
    const std::vector<double> speeds = values(group.results, mean_speed);
    const Results risky = chosen(group.results, someone);
    if (speeds.empty() || risky.empty()) continue;
    const auto [place, added] = places.emplace(group.perception, chart.series.size());
    if (added) {
      chart.series.push_back({group.perception,
                              {},
                              SeriesStyle::labelled_line,
                              colour::of_method(group.perception, place->second)});
    }
    double sum = 0;
    for (const double speed : speeds) sum += speed;
    chart.series[place->second].points.push_back({sum / static_cast<double>(speeds.size()),
                                                  share(count(risky, collided), risky.size()),
                                                  risk_text(drive, group)});
  }
  for (ChartSeries& series : chart.series) {
    // A single point is no front and needs no label: the legend says what it is.
    if (series.points.size() == 1) series.style = SeriesStyle::marks;
  }
  return chart;
}

/// Times before the meeting against the speed, as limits.json states them.
std::optional<Chart> paper_chart(const json& limits) {
  if (!limits.is_object() || !limits.contains("speed_m_per_s")) return {};
  Chart chart{"on paper", "speed, m/s", "time before the meeting, s"};
  for (const auto& [field, name] : {std::pair("direct_sight_s", "direct sight comes"),
                                    {"stop_s", "the last moment to brake"},
                                    {"light_s", "the light tells more than noise"}}) {
    ChartSeries series{name};
    const json& speeds = limits["speed_m_per_s"];
    for (std::size_t i = 0; limits.contains(field) && i < limits[field].size(); ++i) {
      if (i >= speeds.size() || !limits[field][i].is_number() || !speeds[i].is_number()) continue;
      series.points.push_back({speeds[i], limits[field][i]});
    }
    if (!series.points.empty()) chart.series.push_back(std::move(series));
  }
  if (chart.series.empty()) return {};
  return chart;
}

}  // namespace

std::string front_section(const Drive& drive, const std::vector<TrialResult>& results,
                          const json& limits) {
  // Files of earlier versions say nothing of impacts and brakings.
  std::vector<TrialResult> told;
  std::ranges::copy_if(results, std::back_inserter(told), &TrialResult::with_costs);
  const std::vector<Group> groups = groups_of(drive, told);
  if (groups.empty()) return "";
  std::vector<Chart> charts{speed_chart(drive, groups, limits), front_chart(drive, groups)};
  if (auto paper = paper_chart(limits)) charts.push_back(std::move(*paper));
  std::erase_if(charts, [](const Chart& chart) { return chart.series.empty(); });
  for (Chart& chart : charts) chart.width = 460, chart.height = 320;
  return formatted(
             "<h2>Collisions, and what avoiding them costs</h2>\n<p>Hard braking uses more than "
             "%g of the friction limit of %.1f m/s^2; braking for curves does not count. Time lost "
             "is that of drives to the goal beyond their way at the wanted speed. Numbers beside "
             "points are the risk of each decision.</p>\n",
             kHardShare, drive.vehicle.friction * kGravity) +
         charts_html(charts) + cost_table(drive, groups) + difference_table(drive, groups);
}

}  // namespace blindcorner
