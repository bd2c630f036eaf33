// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/report/trials_page.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "blindcorner/report/side_by_side.h"
#include "blindcorner/simulation/credible_level.h"
#include "blindcorner/simulation/paired_difference.h"
#include "report/bar_chart.h"
#include "report/chart.h"
#include "report/colours.h"
#include "report/formatted.h"
#include "report/html.h"
#include "report/trials_front.h"

namespace blindcorner {
namespace {

using Results = std::vector<TrialResult>;

/// Bars of the published study: about 33 trials in each zone of 1 m/s, from 6 to 12 m/s.
constexpr double kPublishedLowest = 6;
constexpr std::array kPublishedNlos{1.0, 1.0, 0.81, 0.31, 0.09, 0.0};
constexpr std::array kPublishedLos{1.0, 1.0, 0.80, 0.17, 0.0, 0.0};
constexpr const char* kPublishedNlosName = "published, sight and NLOS";
constexpr const char* kPublishedLosName = "published, sight only";
/// Published success by localisation error in metres, from 1-2 to 6-7.
constexpr std::array kPublishedErrors{0.89, 0.71, 0.42, 0.29, 0.24, 0.13};

/// Perceptions that are compared with each other.
constexpr std::array<std::pair<const char*, const char*>, 7> kPairs{{{"solver", "los"},
                                                                     {"oracle", "los"},
                                                                     {"solver", "oracle"},
                                                                     {"cnn", "los"},
                                                                     {"solver", "cnn"},
                                                                     {"cnn_wide", "los"},
                                                                     {"solver", "cnn_wide"}}};

Results chosen(const Results& results, const std::function<bool(const TrialResult&)>& wanted) {
  Results list;
  std::ranges::copy_if(results, std::back_inserter(list), wanted);
  return list;
}

Results of(const Results& results, const std::string& perception) {
  return chosen(results, [&](const TrialResult& r) { return r.trial.perception == perception; });
}

int reached(const Results& results) {
  return static_cast<int>(std::ranges::count_if(results, &TrialResult::reached));
}

/// A share with its interval, as text.
std::string share_text(const Results& results) {
  if (results.empty()) return "-";
  const int good = reached(results), all = static_cast<int>(results.size());
  const ShareInterval interval = wilson_interval(good, all);
  return formatted("%.3f (%.3f to %.3f), %d/%d", static_cast<double>(good) / all, interval.low,
                   interval.high, good, all);
}

/// The pairs of kPairs for which both perceptions were driven.
std::vector<std::pair<const char*, const char*>> pairs_of(const Results& results) {
  const std::vector<std::string> names = perceptions_of(results);
  const auto driven = [&](const char* name) { return std::ranges::count(names, name) > 0; };
  std::vector<std::pair<const char*, const char*>> pairs;
  for (const auto& [first, second] : kPairs) {
    if (driven(first) && driven(second)) pairs.emplace_back(first, second);
  }
  return pairs;
}

std::string colour_of(const std::string& name) {
  if (name == kPublishedLosName || name == "published") return "var(--edge,#b9c0c7)";
  if (name == kPublishedNlosName) return colour::kLine;
  return colour::of_method(name);
}

Bar bar_of(const std::string& name, double share, std::optional<ShareInterval> interval = {}) {
  return {name, colour_of(name), share, interval};
}

Bar bar_of(const std::string& name, const Results& results) {
  const int all = static_cast<int>(results.size());
  const int good = reached(results);
  return bar_of(name, static_cast<double>(good) / all, wilson_interval(good, all));
}

/// Adds a bar if there were trials. A missing bar does not mean a share of 0.
void add_bar(BarGroup& group, const std::string& name, const Results& results) {
  if (!results.empty()) group.bars.push_back(bar_of(name, results));
}

/// Published success in a speed zone, if the study has this zone.
std::optional<double> published(const DriveTrials& trials, int zone, const auto& bars) {
  const double place = zone_lower(trials, zone) - kPublishedLowest;
  const double width = zone_lower(trials, zone + 1) - zone_lower(trials, zone);
  if (std::abs(width - 1) > 1e-9 || std::abs(place - std::round(place)) > 1e-9) return {};
  if (place < 0 || place >= static_cast<double>(bars.size())) return {};
  return bars[static_cast<std::size_t>(std::lround(place))];
}

std::string zone_name(const DriveTrials& trials, int zone) {
  const double lower = zone_lower(trials, zone), upper = zone_lower(trials, zone + 1);
  return upper > lower ? formatted("%g to %g m/s", lower, upper) : formatted("%g m/s", lower);
}

Results in_zone(const Results& results, int zone) {
  return chosen(results, [&](const TrialResult& r) { return r.trial.zone == zone; });
}

std::string trials_headline(const Results& results) {
  std::string text;
  for (const std::string& name : perceptions_of(results)) {
    const Results own = of(results, name);
    const std::string who = name == "los"      ? "with direct sight only"
                            : name == "oracle" ? "told the truth"
                                               : "with " + name;
    text += (text.empty() ? "The vehicle reaches its goal in " : ", ") +
            formatted("%d of %zu drives ", reached(own), own.size()) + who;
  }
  return text.empty() ? text : text + ".";
}

std::string success_section(const Drive& drive, const Results& results) {
  const std::vector<std::string> names = perceptions_of(results);
  std::vector<BarGroup> groups;
  std::string rows = "<table><tr><th>speed zone";
  for (const std::string& name : names) rows += "<th>" + html_safe(name);
  // The published zones are for cars, so a robot's study has none of them.
  bool compared = false;
  for (int zone = 0; zone < drive.trials.zones; ++zone) {
    compared = compared || published(drive.trials, zone, kPublishedNlos).has_value();
  }
  if (compared) rows += formatted("<th>%s<th>%s", kPublishedNlosName, kPublishedLosName);
  rows += "</tr>\n";
  for (int zone = 0; zone < drive.trials.zones; ++zone) {
    BarGroup group{zone_name(drive.trials, zone), {}};
    rows += "<tr><td>" + group.label;
    for (const std::string& name : names) {
      const Results here = in_zone(of(results, name), zone);
      add_bar(group, name, here);
      rows += "<td>" + share_text(here);
    }
    const auto nlos = published(drive.trials, zone, kPublishedNlos);
    const auto los = published(drive.trials, zone, kPublishedLos);
    if (nlos) group.bars.push_back(bar_of(kPublishedNlosName, *nlos));
    if (los) group.bars.push_back(bar_of(kPublishedLosName, *los));
    if (compared) rows += nlos ? formatted("<td>%.2f<td>%.2f", *nlos, *los) : "<td>-<td>-";
    rows += "</tr>\n";
    groups.push_back(std::move(group));
  }
  return "<h2>Success by speed</h2>\n" +
         bars_svg("Share of trials that reach the goal, with 95 % intervals", "wanted speed",
                  groups) +
         rows + "</table>\n";
}

/// Outcomes of the trials that two perceptions have in common.
PairedCounts paired(const Results& first, const Results& second) {
  std::map<std::uint64_t, bool> other;
  for (const TrialResult& result : second) other[result.trial.seed] = result.reached();
  PairedCounts counts;
  for (const TrialResult& result : first) {
    const auto match = other.find(result.trial.seed);
    if (match == other.end()) continue;
    if (result.reached()) ++(match->second ? counts.both : counts.only_first);
    if (!result.reached()) ++(match->second ? counts.only_second : counts.neither);
  }
  return counts;
}

std::string difference_cell(const PairedCounts& counts) {
  if (counts.trials() == 0) return "<td>-";
  const PairedDifference d = paired_difference(counts);
  return formatted("<td>%+.3f (%+.3f to %+.3f), +%d -%d of %d", d.value, d.low, d.high,
                   counts.only_first, counts.only_second, counts.trials());
}

std::string difference_section(const Drive& drive, const Results& results) {
  const auto pairs = pairs_of(results);
  if (pairs.empty()) return "";
  std::string html =
      "<h2>Differences, paired by seed</h2>\n<p>Success of the first minus that of the second on "
      "the same trials, with 95 % intervals (Newcombe's tenth method); then trials that only the "
      "first, and only the second, drove well.</p>\n<table><tr><th>speed zone";
  for (const auto& [first, second] : pairs) html += formatted("<th>%s - %s", first, second);
  for (int zone = -1; zone < drive.trials.zones; ++zone) {
    html += "</tr>\n<tr><td>" + (zone < 0 ? "all" : zone_name(drive.trials, zone));
    const Results here = zone < 0 ? results : in_zone(results, zone);
    for (const auto& [first, second] : pairs) {
      html += difference_cell(paired(of(here, first), of(here, second)));
    }
  }
  return html + "</tr></table>\n";
}

Results to_the_goal(const Results& results) { return chosen(results, &TrialResult::reached); }

/// Differences of a figure between two perceptions, over the trials in which both have it (a
/// missing speed through the corner is 0).
std::vector<double> differences(const Results& first, const Results& second,
                                double TrialResult::*figure) {
  std::map<std::uint64_t, double> other;
  for (const TrialResult& result : second) {
    if (result.*figure > 0) other[result.trial.seed] = result.*figure;
  }
  std::vector<double> values;
  for (const TrialResult& result : first) {
    const auto match = other.find(result.trial.seed);
    if (!(result.*figure > 0) || match == other.end()) continue;
    values.push_back(result.*figure - match->second);
  }
  return values;
}

/// Mean and its 95 % interval (Student's t), from the values alone.
std::string mean_text(const std::vector<double>& values) {
  if (values.empty()) return "-";
  if (values.size() < 2) return formatted("%.3f, n = 1", values.front());
  const MeanInterval interval = mean_interval(values);
  return formatted("%.3f (%.3f to %.3f), n = %zu", interval.mean, interval.low, interval.high,
                   values.size());
}

std::string corner_differences(const Results& results) {
  const auto pairs = pairs_of(results);
  if (pairs.empty()) return "";
  std::string rows = "<table><tr><th>paired by seed<th>difference of mean speeds, m/s</tr>\n";
  for (const auto& [first, second] : pairs) {
    rows += formatted("<tr><td>%s - %s<td>", first, second) +
            mean_text(
                differences(of(results, first), of(results, second), &TrialResult::corner_speed)) +
            "</tr>\n";
  }
  return rows + "</table>\n";
}

/// Section for studies with a corner: the mean speed there, and the rate of collisions that came
/// with it.
std::string corner_section(const Drive& drive, const Results& results) {
  const DriveTrials& trials = drive.trials;
  if (trials.corner_radius <= 0) return "";
  std::string rows =
      "<table><tr><th>perception<th>mean speed, m/s<th>collisions<th>stopped, timeout</tr>\n";
  for (const std::string& name : perceptions_of(results)) {
    const Results here = of(results, name);
    std::vector<double> speeds;
    for (const TrialResult& result : here) {
      if (result.corner_speed > 0) speeds.push_back(result.corner_speed);
    }
    const auto collided = std::ranges::count(here, "collision", &TrialResult::outcome);
    const ShareInterval share =
        wilson_interval(static_cast<int>(collided), static_cast<int>(here.size()));
    rows += "<tr><td>" + html_safe(name) + "<td>" + mean_text(speeds) +
            formatted("<td>%td/%zu = %.4f (%.4f to %.4f)<td>%td</tr>\n", collided, here.size(),
                      static_cast<double>(collided) / static_cast<double>(here.size()), share.low,
                      share.high, std::ssize(here) - reached(here) - collided);
  }
  return formatted(
             "<h2>Speed through the corner</h2>\n<p>Distance over time of each drive within %g m "
             "of (%g, %g) m, also of drives that stop or collide there; means with 95 %% intervals "
             "(Student's t), collisions with Wilson's. ",
             trials.corner_radius, trials.corner.x(), trials.corner.y()) +
         (drive.speed_mode == SpeedMode::safe
              ? formatted("Speeds are chosen with a risk of %g.", drive.risk)
              : std::string("Speeds are the wanted ones.")) +
         "</p>\n" + rows + "</table>\n" + corner_differences(results);
}

std::string error_section(const Results& results) {
  if (results.empty()) return "";
  std::vector<BarGroup> groups;
  std::string rows =
      "<table><tr><th>injected error<th>disc of 1 m<th>with the covariance<th>published</tr>\n";
  for (int bin = 0; bin < kErrorBins; ++bin) {
    const Results here = chosen(results, [&](const TrialResult& r) {
      return std::min(static_cast<int>(r.trial.error), kErrorBins - 1) == bin;
    });
    const Results disc = of(here, "oracle_disc"), wide = of(here, "oracle_covariance");
    BarGroup group{formatted("%d to %d m", bin, bin + 1), {}};
    add_bar(group, "oracle_disc", disc);
    add_bar(group, "oracle_covariance", wide);
    rows += "<tr><td>" + group.label + "<td>" + share_text(disc) + "<td>" + share_text(wide);
    const bool known = bin > 0;
    const double share = known ? kPublishedErrors[static_cast<std::size_t>(bin) - 1] : 0;
    if (known) group.bars.push_back(bar_of("published", share));
    rows += known ? formatted("<td>%.2f</tr>\n", share) : "<td>-</tr>\n";
    groups.push_back(std::move(group));
  }
  return "<h2>Success against injected localisation error</h2>\n<p>The truth moved by a drawn "
         "distance in a drawn direction, the same all through a drive: taken for a disc of 1 m "
         "there (as published), or stated with a covariance whose root mean square distance is the "
         "injected one. Speeds over all zones alike; those of the published bars are not known.</p>"
         "\n" +
         bars_svg("Share of trials that reach the goal, with 95 % intervals", "injected error",
                  groups) +
         rows + "</table>\n";
}

/// Share of trials whose value is at most the one on the axis.
ChartSeries distribution(const std::string& name, std::vector<double> values) {
  std::ranges::sort(values);
  ChartSeries series{name, {}, SeriesStyle::line, colour_of(name)};
  const auto count = static_cast<double>(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    series.points.push_back({values[i], static_cast<double>(i + 1) / count});
  }
  return series;
}

double mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

/// Outcomes of at least one trial, except reaching the goal.
std::vector<std::string> failures_of(const Results& results) {
  std::set<std::string> names;
  for (const TrialResult& result : results) {
    if (!result.reached()) names.insert(result.outcome);
  }
  return {names.begin(), names.end()};
}

std::string outcome_titles(const Results& results) {
  std::string titles;
  for (const std::string& name : failures_of(results)) titles += "<th>" + html_safe(name);
  return titles;
}

/// Cells with the number of trials in `here` for each failure among `all`.
std::string outcome_cells(const Results& all, const Results& here) {
  std::string cells;
  for (const std::string& name : failures_of(all)) {
    cells += formatted("<td>%td", std::ranges::count(here, name, &TrialResult::outcome));
  }
  return cells;
}

std::string clearance_section(const Results& results) {
  Chart clearance{"clearance", "least distance to anything, m", "share of trials with at most it"};
  Chart time{"time of trials that reach the goal", "s", "share of trials with at most it"};
  std::string rows =
      "<table><tr><th>perception" + outcome_titles(results) +
      "<th>median clearance, m"
      "<th>mean way to the goal, m<th>mean time to the goal, s<th>run time a trial, s</tr>\n";
  for (const std::string& name : perceptions_of(results)) {
    std::vector<double> distances, lengths, times, run_times;
    for (const TrialResult& result : of(results, name)) {
      distances.push_back(result.clearance);
      run_times.push_back(result.run_time);
      if (result.reached()) times.push_back(result.time), lengths.push_back(result.length);
    }
    clearance.series.push_back(distribution(name, distances));
    time.series.push_back(distribution(name, times));
    std::ranges::sort(distances);
    rows += "<tr><td>" + html_safe(name) + outcome_cells(results, of(results, name)) +
            formatted("<td>%.2f<td>%.3f<td>%.2f<td>%.1f</tr>\n", distances[distances.size() / 2],
                      mean(lengths), mean(times), mean(run_times));
  }
  for (Chart* chart : {&clearance, &time}) chart->width = 460, chart->height = 300;
  return "<h2>Clearance and time</h2>\n" + rows + "</table>\n" + charts_html({clearance, time});
}

std::string path_section(const Results& results) {
  const auto pairs = pairs_of(results);
  if (pairs.empty()) return "";
  std::string rows =
      "<h2>Way and time, paired by seed</h2>\n<p>Of trials that both drove to the goal: the first "
      "minus the second, means with 95 % intervals (Student).</p>\n"
      "<table><tr><th>pair<th>way, m<th>time, s</tr>\n";
  for (const auto& [first, second] : pairs) {
    const Results a = to_the_goal(of(results, first)), b = to_the_goal(of(results, second));
    rows += formatted("<tr><td>%s - %s<td>", first, second) +
            mean_text(differences(a, b, &TrialResult::length)) + "<td>" +
            mean_text(differences(a, b, &TrialResult::time)) + "</tr>\n";
  }
  return rows + "</table>\n";
}

/// Observed against predicted occupancy of one perception's cells.
ChartSeries reliability(const std::string& name, const Results& results, std::string& rows) {
  ChartSeries series{name, {}, SeriesStyle::marked_line, colour_of(name)};
  ReliabilityDiagram all(kMapBins);
  std::vector<int> trials(all.counts().size());  // number of trials with cells in the bin
  for (const TrialResult& result : results) {
    all.merge(result.map);
    for (std::size_t i = 0; i < trials.size(); ++i) {
      trials[i] += result.map.counts()[i].statements > 0 ? 1 : 0;
    }
  }
  const std::vector<ReliabilityBin> bins = all.bins(trials);
  for (std::size_t i = 0; i < bins.size(); ++i) {
    const ReliabilityBin& bin = bins[i];
    if (bin.statements == 0) continue;
    series.points.push_back({bin.mean_predicted, bin.observed});
    rows += "<tr><td>" + html_safe(name) +
            formatted("<td>%.1f-%.1f<td>%.3f<td>%.3f (%.3f to %.3f)<td>%d<td>%d</tr>\n", bin.lower,
                      bin.upper, bin.mean_predicted, bin.observed, bin.interval.low,
                      bin.interval.high, bin.statements, trials[i]);
  }
  return series;
}

std::string reliability_section(const Results& results) {
  Chart chart{"occupancy grid", "probability that a cell is occupied", "share that is"};
  chart.width = 460, chart.height = 360;
  std::string rows =
      "<table><tr><th>perception<th>bin<th>mean probability<th>share occupied<th>cells<th>trials"
      "</tr>\n";
  for (const std::string& name : perceptions_of(results)) {
    ChartSeries series = reliability(name, of(results, name), rows);
    if (!series.points.empty()) chart.series.push_back(std::move(series));
  }
  if (chart.series.empty()) return "";
  chart.series.push_back({"honest", {{0, 0}, {1, 1}}, SeriesStyle::line, colour::kLine});
  return "<h2>Reliability of the map</h2>\n<p>Cells of the hidden object's search region in the "
         "last frame before it came in sight. Intervals count each trial once, because cells of "
         "one trial stand or fall together.</p>\n" +
         charts_html({chart}) + rows + "</table>\n";
}

std::string pairs_section(const nlohmann::json& pairs) {
  if (pairs.empty()) return "";
  return "<h2>One world, two perceptions</h2>\n<p>The seeds that tell most: first one in which "
         "only the first fails, then one of each other kind.</p>\n" +
         side_by_side_part(pairs);
}

/// The command that repeats a trial.
std::string replay_command(const Drive& drive, const Trial& trial) {
  std::string text = "blindcorner drive " + drive.path + " -o replay --perception " +
                     trial.perception +
                     formatted(" --seed %llu --speed %.3f",
                               static_cast<unsigned long long>(trial.seed), trial.speed);
  if (trial.risk) text += formatted(" (with a risk of %g in the drive file)", *trial.risk);
  if (trial.error > 0) text += formatted(" --injected-error %.3f", trial.error);
  if (drive.sensor.light != 1) text += formatted(" --light %g", drive.sensor.light);
  return text;
}

std::string failures_section(const Drive& drive, const Results& results,
                             const std::function<bool(const Trial&)>& replayed) {
  std::string html = "<h2>Failed trials</h2>\n";
  if (std::ranges::all_of(results, &TrialResult::reached)) return html + "<p>None.</p>\n";
  const bool any_page = std::ranges::any_of(results, [&replayed](const TrialResult& result) {
    return !result.reached() && replayed(result.trial);
  });
  html += std::string("<table><tr><th>perception<th>speed, m/s<th>seed<th>outcome<th>time, s") +
          (any_page ? "<th>page" : "") + "<th class=\"text\">drive it again</tr>\n";
  for (const TrialResult& result : results) {
    if (result.reached()) continue;
    const Trial& trial = result.trial;
    html += "<tr><td>" + html_safe(trial.perception) +
            formatted("<td>%.3f<td>%llu<td>", trial.speed,
                      static_cast<unsigned long long>(trial.seed)) +
            html_safe(result.outcome) + formatted("<td>%.2f", result.time);
    if (any_page) html += "<td>";
    if (replayed(trial)) {
      html += "<a href=\"" + replay_page(trial).generic_string() + "\">replay</a>";
    }
    html += "<td style=\"text-align:left\"><code>" + html_safe(replay_command(drive, trial)) +
            "</code></tr>\n";
  }
  return html + "</table>\n";
}

/// The programs that drove the trials, because a study may continue with another version.
std::string programs_section(const Results& results) {
  std::map<std::string, int> counts;
  for (const TrialResult& result : results) {
    ++counts[result.program.empty() ? "a version that kept no record of itself" : result.program];
  }
  std::string html;
  for (const auto& [program, count] : counts) {
    html += (html.empty() ? "" : ", ") + html_safe(program) + formatted(" (%d trials)", count);
  }
  return html.empty() ? "" : "<p>Driven by " + html + ".</p>\n";
}

}  // namespace

std::filesystem::path replay_page(const Trial& trial) {
  const std::string risk = trial.risk ? formatted("_%g", *trial.risk) : std::string();
  return std::filesystem::path("replay") /
         (trial.perception + "_" + std::to_string(trial.seed) + risk) / "drive.html";
}

std::string trials_page(const Drive& drive, const std::vector<TrialResult>& results,
                        const std::function<bool(const Trial&)>& replayed,
                        const TrialsExtras& extras) {
  const Results plain =
      chosen(results, [](const TrialResult& r) { return r.trial.error == 0 && !r.trial.risk; });
  const Results honest = chosen(results, [](const TrialResult& r) { return r.trial.error == 0; });
  const Results misled = chosen(results, [](const TrialResult& r) { return r.trial.error > 0; });
  const std::string body =
      formatted(
          "<p>%zu trials of %s, light times %g. The same seeds, and so the same worlds and "
          "speeds, for every perception; intervals hold 95 %% (Wilson).</p>\n",
          results.size(), html_safe(drive.name).c_str(), drive.sensor.light) +
      pairs_section(extras.pairs) + front_section(drive, honest, extras.limits) +
      corner_section(drive, plain) + success_section(drive, plain) +
      difference_section(drive, plain) + error_section(misled) + clearance_section(plain) +
      path_section(plain) + reliability_section(plain) +
      failures_section(drive, results, replayed) + programs_section(results);
  return plain_page("Trials: " + drive.name, trials_headline(plain), body);
}

}  // namespace blindcorner
